"""Every command ends: random scenes far from those of the other audits (SI units, hardly any damping or very much, slow and
fast plates, the printed sign, nothing that dissipates, every law and state), each in at most a minute of processor time,
with exit code 0 or 1 and, where it is 1, one line that says why."""
import re
import subprocess

import numpy as np

from calls import check, line, words

SECONDS = 60  # of processor time, of one command
LAWS = ["cubic", "carlson-langer", "coulomb", "rate-and-state", "n-shaped"]
COMMANDS = ["cycle", "boundary", "boundary", "spectrum", "wave", "cycle", "run"]


def log_uniform(g, low, high):
    return float(10 ** g.uniform(np.log10(low), np.log10(high)))


def friction(g, law):
    """The options of a law, and whether it jumps at rest."""
    if law == "rate-and-state":
        a = log_uniform(g, 0.01, 0.3)
        text = f"-friction_a {a} -friction_b {a * g.uniform(0.8, 2.5)} -friction_D {log_uniform(g, 0.05, 3)}"
        return text + (f" -state_law {g.choice(['ageing', 'slip'])}" if g.random() < 0.6 else ""), False
    text = ""
    if law == "coulomb":
        text = f"-friction_fs {g.uniform(0.6, 1.4)} -friction_fd {g.choice([0, 0.3, 0.6])}"
    if law == "carlson-langer":
        text = f"-friction_alpha {log_uniform(g, 0.1, 10)} -friction_sigma {g.choice([0, 0.01, 0.2])}"
    sticks = law in ("coulomb", "carlson-langer") and g.random() < 0.7
    if law in ("coulomb", "carlson-langer") and not sticks:
        text += f" -friction_stick regularised -friction_eps {log_uniform(g, 0.01, 0.3)}"
        if law == "coulomb":
            text += f" -friction_slip_velocity {log_uniform(g, 0.1, 3)}"
    if law in ("coulomb", "carlson-langer") and g.random() < 0.3:
        text += f" -state_law healing -state_t_h {log_uniform(g, 0.1, 10)} -state_tau_inf {g.uniform(1.1, 2)} -state_D 1"
    return text, sticks


def medium(g):
    zeta = g.choice([0, log_uniform(g, 1e-4, 1e-2), log_uniform(g, 1e-2, 5)])
    if g.random() < 0.35:
        return (f"-grid_n {g.choice([16, 26, 48])} -grid_length {log_uniform(g, 2, 60)} -model_gamma {log_uniform(g, 0.5, 10)} "
                f"-model_delta {g.choice([0, 0.05, 0.3, 1.5])} -model_delta_sign {g.choice(['derived', 'printed'])} "
                f"-model_c {g.choice([0, 1, 1])} -model_nu {g.choice([0, 0.004, 0.1])} "
                f"-model_v {log_uniform(g, 1e-3, 5)}")
    nodes = int(g.choice([1, 1, 2, 4]))
    if g.random() < 0.5:  # SI units: kilograms, newtons a metre, newtons
        m, k0, f0 = log_uniform(g, 0.1, 50), log_uniform(g, 1e3, 1e7), log_uniform(g, 10, 1e4)
    else:
        m, k0, f0 = log_uniform(g, 0.3, 3), log_uniform(g, 0.01, 3), log_uniform(g, 0.3, 3)
    v = f0 / np.sqrt(m * k0) * log_uniform(g, 1e-2, 100)
    return (f"-model_form chain -grid_n {nodes} -bc_left {g.choice(['free', 'periodic'])} -model_m {m} -model_k0 {k0} "
            f"-model_k1 {k0 * log_uniform(g, 0.1, 10)} -model_f0 {f0} -model_zeta {zeta * np.sqrt(m * k0)} -model_v {v}")


def draw(g):
    command, law = str(g.choice(COMMANDS)), str(g.choice(LAWS))
    scene = medium(g)
    text, _ = friction(g, law)
    v = float(re.search(r"-model_v (\S+)", scene)[1])
    asks = ""
    if command == "cycle":
        asks = f"-cycle_cell {g.choice([0, 1, 1, 2])} -init_noise 0.3 {g.choice(['-cycle_spectrum', ''])}"
        asks = re.sub("-cycle_cell 0(.*) -cycle_spectrum", r"-cycle_cell 0\1", asks)
    if command == "boundary":
        asks = f"-boundary_parameter model_v -boundary_from {v * 0.05} -boundary_to {v * 20} -boundary_verify {g.choice([0, 1])}"
    if command == "wave":
        asks = f"-wave_speed {g.uniform(1.1, 4)} -wave_pulses 1 {g.choice(['-wave_spectrum', ''])}"
    if command == "run":
        asks = "-ts_max_time 5 -init_psi 0.5 -init_eta 0"
    return command, f"{scene} -friction_law {law} {text} {asks}"


def test_every_command_ends(scenes):
    codes = {0: 0, 1: 0, 2: 0}
    for index, (command, options) in scenes(draw, 81, short=25):
        done = subprocess.run(["prlimit", f"--cpu={SECONDS}", *line(words(options), command=command)], capture_output=True,
                              text=True, timeout=40 * SECONDS, check=False)
        check(done.returncode in codes, f"scene {index}: code {done.returncode}: {command} {options}")
        codes[done.returncode] += 1
        errors = [text for text in done.stderr.splitlines() if text.startswith("stickslip: error: ")]
        check(len(errors) == (done.returncode != 0), f"scene {index}: {done.stderr[-500:]}: {command} {options}")
    check(codes[0] > 2 and codes[1] > 2, codes)
