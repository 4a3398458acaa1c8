"""Searches end: weakly damped blocks, SI units, growth without bound, checks of ends; progress and signals."""
import json
import math
import os
import pty
import re
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from calls import SOURCE, call, check, data, line, refused, run, scene_file
from reference import System

BLOCK = "-model_form chain -grid_n 1 -bc_left free -model_k0 1 -friction_law carlson-langer"
BRAKE = ("-model_form chain -grid_n 1 -model_m 1.2 -model_k0 2e6 -model_f0 500 -model_zeta 8 -friction_law carlson-langer "
         "-friction_alpha 2 ")


def force_back(v, k0=1., zeta=0.):
    """A block begins to slip at its threshold, swings back beyond rest and comes to psi = 0 once more: the force on it there, in
    units of f0, less the threshold, by an independent integration."""
    block = System({"model_form": "chain", "grid_n": 1, "model_k0": k0, "model_zeta": zeta, "model_v": v,
                    "friction_law": "carlson-langer"})

    def passes(t, y):
        return y[0]
    passes.terminal, y = True, [0, 1.]
    for side in (1, -1):
        passes.direction, block.going = -side, np.array([side])
        y = [side * 1e-13 * v, y[1]]
        y = solve_ivp(block.rates, (0, 10 * np.pi / np.sqrt(k0)), y, "DOP853", events=passes, rtol=1e-12, atol=1e-13).y[:, -1]
    return y[1] - 1


@pytest.mark.parametrize("more", ["-model_zeta 0 -model_v 5", "-model_zeta 0.001 -model_v 6", "-model_zeta 0.005 -model_v 6"])
def test_a_block_that_swings_through_rest_has_no_cycle_with_rests(more):
    found, error = run(f"{BLOCK} {more}", code=1, command="cycle")
    check("oscillates without rest" in error and found["period"] is None, error)


def test_where_a_slip_back_only_just_stops():
    found, _ = run(f"{BLOCK} -model_zeta 0 -boundary_parameter model_v -boundary_from 1 -boundary_to 8", command="boundary")
    (end,) = found["points"]
    check(end["kind"] == "pass" and abs(end["value"] - brentq(force_back, 3, 7, xtol=1e-12)) < 1e-8, end)
    weak, _ = run(f"{scene_file('study')} -model_zeta 0.002 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 40",
                  command="boundary")
    ends = [p for p in weak["points"] if p["of"] == "stick-slip"]
    for p in ends:
        there = lambda v: force_back(v, k0=0.2, zeta=0.002)
        check(p["kind"] == "pass" and there(p["value"] * (1 - 1e-7)) * there(p["value"] * (1 + 1e-7)) < 0, p)
    check(len(ends) == 2, ends)


def test_a_brake_in_si_units():
    found, error = run(BRAKE + "-boundary_parameter model_v -boundary_from 0.001 -boundary_to 5", command="boundary")
    hopf, end = found["points"]
    check((hopf["kind"], end["kind"]) == ("hopf", "pass") and "without rest" in error, found["points"])
    # the same block in units of its own: velocities over f0/sqrt(m k0), zeta over sqrt(m k0)
    unit = 500 / np.sqrt(1.2 * 2e6)
    own, _ = run(f"-model_form chain -grid_n 1 -model_m 1 -model_k0 1 -model_f0 1 -model_zeta {8 / np.sqrt(1.2 * 2e6)} "
                 f"-friction_law carlson-langer -friction_alpha {2 * unit} -boundary_parameter model_v "
                 f"-boundary_from {0.001 / unit} -boundary_to {5 / unit}", command="boundary")
    for p, q in zip(found["points"], own["points"]):
        check(abs(p["value"] / (q["value"] * unit) - 1) < 1e-9, (p, q))


@pytest.mark.parametrize("law", ["coulomb", "carlson-langer", "coulomb -friction_stick regularised -friction_eps 0.05"])
def test_growth_without_bound_is_said(law):
    scene = f"-model_delta_sign printed -model_delta 1.5 -friction_law {law}"
    check("grows without bound" in run(scene, code=1, command="cycle")[1], law)
    if "regularised" in law:
        return
    error = run(f"{scene} -boundary_parameter model_v -boundary_from 0.1 -boundary_to 3", code=1, command="boundary")[1]
    check("nowhere" in error and "grows without bound" in error, error)


def test_short_waves_whose_growth_has_no_maximum():
    found, _ = run("-grid_n 26 -model_c 0 -model_nu 0.004 -bc_right free -friction_law rate-and-state -model_gamma 2 "
                   "-friction_a .15 -friction_b .24 -friction_D .3 -grid_length 6.6", command="spectrum")
    check(abs(found["growth_rate"] + 0.05275041817) < 1e-9 and abs(found["growth_continuum"]) < 1e-12, found)
    check(found["stable"] is not True and "come to 0" in found["warnings"][-1], found["warnings"])


@pytest.mark.parametrize("seed, options", [
    (667, "-cycle_cell 3 -state_law contact-age -state_b 0.0613 -state_D 1.31 -init_noise 0.3 -init_psi 0.04829 -init_eta 0.6425 "
          "-model_v 0.01795 -model_k0 0.463 -model_k1 6.598 -friction_fs 0.7147"),
    (624, "-cycle_cell 2 -state_law healing -init_noise 0.3 -init_psi 0.9802 -init_eta -0.7639 -model_v 0.1346 -model_k0 1.033 "
          "-model_k1 0.2014 -friction_fs 0.989")])
def test_cells_where_nothing_dissipates(seed, options):
    error = run(f"-model_form chain -grid_n 12 -friction_law coulomb -friction_fd 0 -model_zeta 0 -cycle_spectrum "
                f"-init_seed {seed} {options}", code=1, command="cycle")[1]
    check("no cycle" in error, error)


def test_a_check_starts_on_the_cycle():
    found, error = run(
        "-model_form chain -grid_n 1 -model_k0 0.6416411029827085 -model_zeta 0.24380780109799785 -model_v 0.8262083743409347 "
        "-model_f0 0.8261408203539736 -friction_law coulomb -friction_fs 1.0376055559072022 -state_law healing -state_t_h 1.0 "
        "-state_tau_inf 1.90201456662541 -state_D 1.0 -model_m 3.319534981732025 -boundary_parameter friction_fd "
        "-boundary_from 0.1 -boundary_to 0.95 -boundary_parameter2 model_m -boundary_from2 0.41355926720154296 "
        "-boundary_to2 4.13559267201543 -boundary_of stick-slip -boundary_points 9 -boundary_verify 4", command="boundary")
    check("ends in" not in error, error)
    checks = found["verified"]
    check(len(checks) >= 6 and all(v["from_stick_slip"] == v["expected"] for v in checks), checks)
    check({v["expected"] for v in checks} == {"stick-slip", "sliding"}, checks)


LONG = ("-grid_n 64 -grid_length 18 -model_delta 0.1 -boundary_parameter model_v -boundary_from 0.7 -boundary_to 1.0 "
        "-boundary_parameter2 model_gamma -boundary_from2 3.4 -boundary_to2 4.6 -boundary_of all -wave_pulses 1 "
        "-boundary_points 5 -summary found.json")


def test_a_search_answers_a_signal_and_tells_how_far_it_is():
    number, code = signal.SIGTERM, 143  # SIGINT: test_the_last_lines_say_what_was_reached
    told = [word for word in line(LONG, command="boundary") if word not in ("-progress", "off")] + ["-progress", "on"]
    with subprocess.Popen(told, stderr=subprocess.PIPE, text=True) as process:
        first = process.stderr.readline()  # about five seconds after the start
        process.send_signal(number)
        begin = time.monotonic()
        rest = process.stderr.read()
        process.wait()
    check(process.returncode == code and time.monotonic() - begin < 60, f"{process.returncode}: {rest}")
    check(first.startswith("boundary: ") and "growth rates" in first, first)
    with open("found.json", encoding="utf-8") as file:
        found = json.load(file)
    check(found["status"] == "stopped" and found["reason"] == signal.Signals(number).name, found["reason"])
    check(any(p["of"] == "sliding" for p in found["points"]) and found["evaluations"] > 100, "what was reached")


def stopped_at(arguments, command, sign, within=60):
    """Sends SIGINT once the progress, as a terminal has it, shows `sign`: what is said at the end, and the summary."""
    told = [word for word in line(f"{arguments} -summary s.json", command=command) if word not in ("-progress", "off")]
    try:
        terminal, stderr = pty.openpty()
    except OSError:
        pytest.skip("no terminal can be had here: /dev/pts is not mounted")
    with subprocess.Popen(told, stderr=stderr, stdout=subprocess.DEVNULL) as process:
        os.close(stderr)
        said, begin = "", math.inf
        while True:
            try:
                said += os.read(terminal, 4096).decode()
            except OSError:  # the terminal of a program that has ended
                break
            if sign and re.search(sign, said):
                process.send_signal(signal.SIGINT)
                sign, begin = None, time.monotonic()
    os.close(terminal)
    took = time.monotonic() - begin
    check(sign is None and process.returncode == 130 and took < within, f"{process.returncode} after {took} s: {said}")
    with open("s.json", encoding="utf-8") as file:
        found = json.load(file)
    check(found["status"] == "stopped" and found["reason"] == "SIGINT", found["reason"])
    return said[said.rindex("\033[K"):], found


def test_the_part_of_a_branch_that_was_followed_is_kept():
    said, found = stopped_at("-model_delta 0 -model_v 0 -model_gamma 10 -cycle_spectrum -cycle_continue model_v -cycle_to 0.99 "
                             "-cycle_steps 1000 -out_file c.h5", "cycle", r"branch in model_v.* ([3-9]|\d\d+) points of branches")
    points = found["branch"]["points"]
    check(len(points) >= 3 and found["branch"]["end"] == "stopped by SIGINT", found["branch"]["end"])
    check(f"branch in model_v: {len(points)} points; stopped by SIGINT" in said and "stopped by SIGINT: branch in model_v" in said, said)
    with h5py.File("c.h5") as file:
        check(np.array_equal(file["branch/value"][:], [p["value"] for p in points]), "the file has them")
    # they are those of the whole branch
    whole, _ = run("-model_delta 0 -model_v 0 -model_gamma 10 -cycle_continue model_v -cycle_to 0.99 -cycle_steps 1000 ", command="cycle")
    for one, same in zip(points, whole["branch"]["points"]):
        check(one["value"] == same["value"] and one["period"] == same["period"], (one, same))


def test_the_part_of_a_branch_of_trains_is_kept():
    said, found = stopped_at("-model_delta 0 -model_v 0.5 -wave_speed 2 -wave_spectrum -wave_continue model_v -wave_to 0.99 "
                             "-wave_steps 1000 -out_file w.h5", "wave", "stability along the branch")
    check(len(found["branch"]["points"]) > 10 and "stopped by SIGINT: stability along the branch" in said, said)
    check(any(point["stable"] is None for point in found["branch"]["points"]), "of the last trains stability is not known")


@pytest.mark.parametrize("command, scene, sign, words", [
    ("boundary", LONG.replace("-summary found.json", ""), "waves on", "points where sliding ends, "),
    ("chart", f"{scene_file('chart-stiff-friction')} -ts_max_time 50", "row [2-9]", "rows have an error that is known"),
    ("chart", f"{scene_file('chart-stiff-friction')} -chart_kind limits", "row [2-9]", "rows")])
def test_the_last_lines_say_what_was_reached(command, scene, sign, words):
    said, _ = stopped_at(scene, command, sign)
    check(words in said and "stopped by SIGINT" in said, said)


def test_a_call_that_hears_no_signal_is_announced():
    words = line("-grid_n 260 -spectrum_method dense -spectrum_refine off", command="spectrum")
    words[words.index("-progress") + 1] = "on"
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    check("all eigenvalues of 520 unknowns in one call" in done.stderr, done.stderr)


@pytest.mark.parametrize("scene", ["-model_delta 0 -model_v 0 -model_gamma 10", scene_file("cycle-stick-pair")])
def test_waves_on_a_cycle_answer_a_signal(scene):
    _, found = stopped_at(f"{scene} -cycle_spectrum -cycle_wavenumbers 1000000", "cycle", "wavenumbers", within=5)
    check(found["period"] > 0, "the cycle itself is there")


@pytest.mark.parametrize("kind, sign", [("error", "reference, n = "), ("limits", "row 1 of .* steps")])
def test_a_chart_answers_a_signal(kind, sign):
    _, found = stopped_at(f"{scene_file('chart-stiff-friction')} -chart_kind {kind} -ts_max_time 500 -chart_row_seconds 100 "
                          "-chart_reference_seconds 100", "chart", sign, within=5)
    check(found["rows"] is not None, "rows")


@pytest.mark.parametrize("scene, sign, ends", [("-ts_adapt_dt_max 0.001", r"draws, .* [1-9]\d runs", 0), ("", "start [3-9] of 50", 1)])
def test_a_fit_answers_a_signal_with_the_best_so_far(scene, sign, ends):
    """Among the draws where starts begin and behind some starts: the parameters leave what is said to be left, by a run of their own."""
    scene = f"{scene_file('fit-steps')} {scene}"
    said, found = stopped_at(f"{scene} -fit_starts 50", "fit", sign)
    check("what is left" in said and ("stopped by SIGINT: start " if ends else "stopped by SIGINT: draws") in said, said)
    check((found["starts"] > 0) == ends and all(p["error"] is None for p in found["parameters"]), found)
    given = " ".join(f"-{p['name']} {p['value']!r}" for p in found["parameters"])
    run(f"{scene} {given} -ts_rtol 1e-9 -ts_atol 1e-9 -out_frames 801 -out_file r.h5")
    left = data("r.h5")["eta"][1:-1, 0] - np.loadtxt(os.path.join(SOURCE, "runs", "fit-steps.txt"))[:, 1]
    check(found["residual"] == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-3), f"{np.sqrt(np.mean(left**2))}, {found['residual']}")


def catches(pid, number):
    """Whether a process has set a handler for a signal."""
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        return int(re.search(r"SigCgt:\s*(\w+)", file.read())[1], 16) >> (number - 1) & 1


def test_a_signal_before_any_work_is_kept():
    """It comes before the libraries start, and ends the search as that begins, with a summary."""
    if not os.path.exists("/proc/self/status"):
        pytest.skip("without /proc nothing tells when a program catches signals")
    words = line(LONG.replace("found.json", "-"), command="boundary")
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not catches(process.pid, signal.SIGTERM):
            pass
        process.send_signal(signal.SIGTERM)
        summary, said = process.communicate(timeout=60)
    check(process.returncode == 143, f"{process.returncode}: {said}")
    found = json.loads(summary)
    check(found["status"] == "stopped" and found["points"] in (None, []), f"{found['status']} {found['points']}")


def test_a_signal_ends_a_point_of_a_sweep_that_goes_on():
    sweep = ["-sweep_command", "boundary", "-sweep_parameter1", "model_c", "-sweep_values1", "1,1.1", "-out_file", "s.h5"]
    words = LONG.replace("-summary found.json", "").split() + sweep
    with subprocess.Popen(line(words, command="sweep"), stderr=subprocess.PIPE, text=True) as process:
        while not os.path.exists("s.h5.points-0") and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        process.communicate()
    check(process.returncode == 143, process.returncode)
    done = call(["-restart", "s.h5", "-check"], command="sweep")
    check("failed" not in done.stderr, done.stderr)


def test_a_node_set_to_its_threshold_starts_within_round_off():
    # With viscosity what holds a node depends on its neighbours' psi, and its force is at the threshold within round-off only,
    # on either side of it: the motion stood there, in steps of no length, for a million of them.
    refused("-grid_n 16 -grid_length 5.6882176897552 -model_gamma 0.7002616462464633 -model_delta 0.3 -model_c 1 "
            "-model_nu 0.004 -model_v 0.12471514922221424 -friction_law carlson-langer -friction_alpha 3.0367137839161913 "
            "-friction_sigma 0 -cycle_cell 0 -init_noise 0.3", 1, "without repeating", command="cycle")


def test_a_check_in_time_that_needs_too_many_steps_is_undecided():
    found, said = run("-grid_n 8 -grid_length 8 -model_gamma 7.17 -model_delta 1.5 -model_delta_sign printed -model_nu 0.004 "
                      "-friction_law carlson-langer -friction_alpha 0.72 -friction_sigma 0.01 -friction_stick regularised "
                      "-friction_eps 0.0155 -state_law healing -state_t_h 0.34 -state_tau_inf 1.41 -boundary_parameter model_v "
                      "-boundary_from 0.034 -boundary_to 13.5 -boundary_verify 1", command="boundary")
    one = found["verified"][0]
    check(one["from_sliding"] == one["regime"] == "undecided" and one["expected"] == "stick-slip", one)
    check("is undecided in its time or a million steps where the growth rate" in said, said)
