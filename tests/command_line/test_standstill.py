"""Exact stick gets on in time: what holds a block and what it begins to slip against is one number for every law, so that none starts
and stops without end; motions whose starts and stops nobody could follow before are those of an integration of its own."""
import os
import signal
import subprocess
import time

import numpy as np
import pytest

from calls import call, check, data, line, run
from reference import Stick, System, read, words

LAWS = {"stribeck": ("friction_fs", "friction_fc"), "coulomb": ("friction_fs", "friction_fd"),
        "slip-weakening": ("friction_fs", "friction_fd")}


def rounded_above(fs, low):
    """What a law makes of the two at rest lies above fs."""
    return low + (fs - low) > fs


def pairs(random, digits, count):
    """(static, sliding) friction of so many digits, half of them such that round-off lifts their sum."""
    found = []
    while len(found) < count:
        fs, low = sorted((round(x, digits) for x in random.uniform(0.1, 1.9, 2)), reverse=True)
        if low < fs and (len(found) % 2 == 0 or rounded_above(fs, low)):
            found.append((fs, low))
    return found


@pytest.mark.parametrize("law", LAWS)
def test_no_pair_of_frictions_starts_and_stops_without_end(law):
    random = np.random.default_rng(63)
    high, low = LAWS[law]
    for digits in (2, 3):
        for scene in ("", "-friction_spread 0.3 -load_normal_sine_amplitude 0.2 -load_normal_sine_period 3"):
            n = 24
            chosen = pairs(random, digits, n)
            profiles = [f"-{name}_profile " + ",".join(f"{i}:{pair[k]!r}" for i, pair in enumerate(chosen)) for k, name in enumerate((high, low))]
            found, _ = run(f"-model_form chain -grid_n {n} -bc_left free -model_k1 0 -model_v 0.3 -friction_law {law} {scene} "
                           f"{' '.join(profiles)} -init_psi 0 -init_eta 0 -ts_max_time 20")
            check(found["t_end"] == 20, f"{law}: {found['reason']}")
        for fs, fd in pairs(random, digits, 4):
            found, _ = run(f"-model_form chain -grid_n 1 -bc_left free -friction_law {law} -{high} {fs!r} -{low} {fd!r} -ts_max_time 30")
            check(found["t_end"] == 30, f"{law} {fs} {fd}: {found['reason']}")


def test_a_table_of_forces_is_its_threshold_in_both_directions():
    random = np.random.default_rng(64)
    for k in range(12):
        force = [round(x, 2) for x in np.sort(random.uniform(0.2, 1.2, 4))[::-1]]
        table = ",".join(f"{v!r}:{f!r}" for v, f in zip((0, 0.1, 0.7, 2), force))
        if k % 2:
            table = f"-1.5:{-force[2]!r},-0.3:{-force[1]!r}," + table
        for v in (0.2, -0.2):
            found, _ = run(f"-model_form chain -grid_n 1 -bc_left free -friction_law table -friction_table {table} -model_v {v} "
                           "-init_psi 0 -init_eta 0 -ts_max_time 30")
            check(found["t_end"] == 30, f"{table}: {found['reason']}")


def follows(scene, start, end, tolerance=1e-6, most=2000):
    """A run of a chain agrees with reference.Stick at its end; the number of starts and stops."""
    run(f"{scene} {start} -ts_max_time {end} -ts_rtol 1e-10 -ts_atol 1e-12 -out_frames 2 -out_file m.h5 -scene_reduce off")
    found = data("m.h5")
    motion = Stick(System(scene), read(found, 0))
    off = np.abs(read(found, -1) - motion.advance(end, most=most)).max()
    check(off < tolerance, f"{scene} {start}: off by {off} after {motion.changes} starts and stops")
    return motion.changes


def test_slip_weakening_under_a_varying_normal_load():
    random, changes = np.random.default_rng(65), 0
    for k in range(4):
        n = int(random.integers(1, 4))
        scene = (f"-model_form chain -grid_n {n} -bc_left free -friction_law slip-weakening -model_v {random.uniform(0.1, 0.5):.4f} "
                 f"-friction_fs {random.uniform(0.8, 1.2):.4f} -friction_fd {random.uniform(0.3, 0.8):.4f} -friction_Dc {random.uniform(0.3, 1):.4f} "
                 f"-friction_weakening {('exponential', 'linear')[k % 2]} -state_t_h {random.uniform(0.5, 8):.4f} -model_k1 0.7 "
                 f"-load_normal_sine_amplitude {random.uniform(0.1, 0.5):.4f} -load_normal_sine_period {random.uniform(1, 4):.4f} "
                 f"-friction_back_slip {('true', 'false')[k // 2]}")
        changes += follows(scene, f"-init_psi 0 -init_eta {random.uniform(0, 0.2):.4f} -init_noise_of eta -init_noise 0.1 -init_state 0", 12)
    check(changes > 15, f"{changes} starts and stops")


@pytest.mark.parametrize("scene", [
    "slip-weakening -grid_n 2 -friction_spread .2 -model_v .2 -init_psi 0 -init_eta 0 -ts_max_time 60 "
    "-load_normal_sine_amplitude .1 -load_normal_sine_period 2",
    "slip-weakening -friction_fs 1.1053 -friction_fd 0.7516 -friction_Dc 0.40914 -state_t_h 7.5294 -grid_n 3 -model_m 0.18314 "
    "-model_k0 1.0937 -model_k1 2.9382 -model_f0 2.0595 -model_v 0.44766 -friction_spread 0.3298 -friction_seed 75 -init_psi 0.134298 "
    "-init_eta 0.0569 -init_noise 0.0403 -init_seed 53 -ts_max_time 17.67 -load_normal_sine_amplitude 0.4513 "
    "-load_normal_sine_period 2.025 -friction_back_slip false"])
def test_chains_that_stood_still_get_on(scene):
    found, _ = run(f"-model_form chain -bc_left free -friction_law {scene}")
    check(found["status"] == "done" and found["steps"] < 5000, f"{found['reason']}, {found['steps']} steps")


@pytest.mark.parametrize("law", ["carlson-langer", "stribeck -friction_fs 1 -friction_fc 0.6", "table -friction_table 0:1,0.5:0.7,2:0.5"])
def test_viscosity_and_friction_that_does_not_drop_at_once(law):
    """With clusters and by steps of the whole; a few blocks against the reference."""
    scene = f"-model_form chain -friction_law {law} -model_nu 0.1"
    start = "-init_psi 0 -init_eta .4 -init_noise_of eta -init_noise .3 -init_seed 2"
    ends = []
    for clusters in ("on", "off"):
        run(f"{scene} {start} -grid_n 24 -ts_max_time 60 -stick_clusters {clusters} -ts_rtol 1e-9 -ts_atol 1e-10 -out_frames 2 -out_file c.h5")
        ends.append(read(data("c.h5"), -1))
    check(np.abs(ends[0] - ends[1]).max() < 1e-5, f"{law}: clusters end {np.abs(ends[0] - ends[1]).max()} beside the whole")
    if "table" not in law:
        follows(f"{scene} -bc_left free -grid_n 3", start, 15)


SCENES = ["-model_form chain -grid_n 64 -bc_left free -friction_law stribeck -friction_fs 0.9 -friction_fc 0.3 -friction_spread 0.2",
          "-model_form chain -grid_n 200 -friction_law carlson-langer -friction_sigma 0.1 -friction_spread 0.3 -model_v 1e-3 -stick_clusters on",
          "-model_form chain -grid_n 1 -bc_left free -friction_law coulomb -friction_fd 1 -model_v 0 -load_force_sine_amplitude 1.02 "
          "-load_force_sine_period 1e-3"]


def too_steep(rise, clusters):
    """Friction that rises from 0.5 to 1 over so small a velocity that explicit steps get no further."""
    return (f"-model_form chain -grid_n 20 -bc_left free -friction_law table -friction_table 0:0.5,{rise}:1,1:1 -ts_type rk -ts_rk_type 5dp "
            f"-init_psi 0 -init_eta 0 -init_noise 0.2 -init_noise_of eta -model_k1 1 -stick_clusters {clusters} -ts_max_time 30")


@pytest.mark.parametrize("clusters", ["on", "off"])
def test_a_run_that_stands_still_ends_and_says_where(clusters):
    done = call(too_steep("1e-14", clusters))
    check(done.returncode == 1 and "time stands still" in done.stderr and "t = 8.5149" in done.stderr and
          "no node starts or stops" in done.stderr, done.stderr)


def at_work(scenes):
    """Runs of them, which have begun."""
    runs = [subprocess.Popen(line(f"{scene} -out_file s{k}.h5 -out_series false"), env=os.environ) for k, scene in enumerate(scenes)]
    while not all(os.path.exists(f"s{k}.h5") or process.poll() is not None for k, process in enumerate(runs)):
        time.sleep(0.05)
    time.sleep(0.5)
    return runs


def test_a_signal_is_heard_in_steps_that_hardly_get_on():
    runs = at_work([too_steep("1e-9", clusters) for clusters in ("on", "off")])
    for process in runs:
        process.send_signal(signal.SIGTERM)
    codes = [process.wait(timeout=60) for process in runs]
    check(codes == [143] * len(runs), f"exit codes {codes}")


def test_a_signal_ends_any_of_them_soon():
    runs = at_work([f"{scene} -ts_max_time 1e9" for scene in SCENES])
    begin = time.monotonic()
    for process in runs:
        process.send_signal(signal.SIGTERM)
    codes = [process.wait(timeout=60) for process in runs]
    check(codes == [143] * len(runs), f"exit codes {codes}")
    check(time.monotonic() - begin < 2, f"{time.monotonic() - begin} s until the last ends")
