"""Only what slides is advanced (stick_clusters): the events of whole steps, integration by SciPy, outputs, checkpoints, refusals."""
import glob
import os
import signal
import subprocess
import time

import h5py
import numpy as np
from scipy.integrate import solve_ivp

from calls import PROGRAM, check, data, line, refused, run, same, words
from cluster_scenes import ON, catalogue, drawn_scene, events_alike, start_file

CARLSON = ("-model_form chain -model_m 1 -model_k0 1 -model_f0 1 -friction_law carlson-langer -friction_sigma 0.01"
           " -friction_alpha 3 -out_events -out_series false -out_frames 2")
SCENES = (1, 3, 5, 7, 9, 10, 11, 22)


def test_the_events_of_whole_steps():
    # among them a load that turns, a table, both states, viscosity, held ends of order 4 and 6, a profile
    compared = 0
    for scene in SCENES:
        given, loading = drawn_scene(np.random.default_rng([39, scene]))
        alike, of = events_alike(given, loading)
        check(alike >= min(5, of), f"scene {scene}: {alike} of {of} events: {given}")
        compared += alike
    check(compared > 70, f"events compared: {compared}")


def test_the_work_of_friction_with_a_state_is_of_fourth_order():
    # By clusters it is what eta gives less what goes into motion, whose integrals have errors of dt^4; by whole steps that of
    # friction itself. With a state that is the mean of a step's ends in its middle the two are 1e-7 apart here, of second order.
    given, _ = drawn_scene(np.random.default_rng([39, 7]))
    check("state_law healing" in given, given)
    run(given + " -out_file whole.h5")
    run(given + ON + " -out_file own.h5")
    whole, own = (catalogue(name)["friction_work"][:6] for name in ("whole.h5", "own.h5"))
    check(len(whole) == 6 and np.abs(whole / own - 1).max() < 2e-8, f"{whole / own - 1}")


def test_a_restart_is_the_same_to_the_last_bit():
    counted = ("steps", "rejections", "rhs_evaluations", "node_steps", "clusters", "events", "largest_moment", "recurrence", "psi_max",
               "eta_mean", "t_end")
    for scene in SCENES[1:4:2]:
        given, _ = drawn_scene(np.random.default_rng([39, scene]))
        given = given.replace("-out_frames 2", "-out_frames 21").replace("-ts_rtol 1e-10 -ts_atol 1e-10", "") + ON
        whole, _ = run(given + " -out_file whole.h5")
        for path in glob.glob("parts*.h5"):
            os.remove(path)
        run(given + f" -out_file parts.h5 -out_checkpoint_every {whole['steps'] // 3 + 1} -out_checkpoint_keep 9")
        same(data("whole.h5"), data("parts.h5"), f"{scene}: checkpoints change nothing")
        checkpoints = sorted(glob.glob("parts.chk-*.h5"))
        check(len(checkpoints) >= 3, f"{scene}: {checkpoints}")
        for path in checkpoints:
            summary, _ = run(f"-restart {path} -out_file parts.h5")
            same(data("whole.h5"), data("parts.h5"), f"{scene}: from {path}")
            check([summary.get(k) for k in counted] == [whole.get(k) for k in counted], f"{scene}: from {path}: {summary}")


def test_a_block_alone_is_that_of_scipy():
    v, k1, sigma, alpha = 1e-3, 2.0, 0.01, 3.0
    eta = np.array([0.1, 0.2, 0.9, 0.15, 0.1, 0.0])
    run(CARLSON + f" -model_k1 {k1} -model_v {v} -grid_n 6 -bc_left free -friction_back_slip false -ts_max_time 130"
        " -ts_rtol 1e-12 -ts_atol 1e-12 -out_file b.h5" + start_file(eta) + ON)
    e = catalogue("b.h5")
    check(len(e["t"]) == 1 and e["extent"][0] == 1 and e["first"][0] == 2, f"one block slips once: {e}")

    def rates(_, y):
        psi, force = y[:2]
        friction = (1 - sigma) / (1 + 2 * alpha * psi / (1 - sigma))
        return [force - friction, v - psi - 2 * k1 * psi, psi, psi * friction, psi * force]

    def stops(t, y):
        return y[0] if t > 0 else 1.0
    stops.terminal, stops.direction = True, -1
    truth = solve_ivp(rates, (0, 50), [0, 1, 0, 0, 0], method="DOP853", rtol=1e-13, atol=1e-15, events=stops)
    duration, (_, behind, slip, work, given) = truth.t[-1], truth.y[:, -1]
    check(abs(e["begin"][0] - 0.1 / v) < 1e-9 / v, f"begins at {e['begin'][0]}")
    check(abs(e["t"][0] - e["begin"][0] - duration) < 1e-9 * duration, f"lasts {e['t'][0] - e['begin'][0]}, {duration}")
    for name, exact, bound in (  # what goes through several sums of Simpson's rule has their errors, dt^4 each
            ("slip", slip, 1e-9), ("moment", slip, 1e-9), ("stress_drop", 1 - behind, 1e-8), ("friction_work", work, 1e-8),
            ("strain_energy", slip * (1 + behind) / 2, 1e-8)):
        check(abs(e[name][0] / exact - 1) < bound, f"{name} {e[name][0]}, {exact}")
    check(abs(given / work - 1) < 1e-9 and abs(e["radiated"][0]) < 1e-15, "nothing is radiated")


def test_frames_change_nothing_and_lie_in_the_steps():
    given = CARLSON.replace("-out_frames 2", "") + " -model_k1 9 -model_v 0.01 -grid_n 60 -bc_left free -ts_max_time 60"
    given += " -ts_rtol 1e-10 -ts_atol 1e-10" + start_file(np.random.default_rng(5).uniform(0, 0.7, 60))
    few, _ = run(given + ON + " -out_frames 2 -out_file few.h5")
    many, _ = run(given + ON + " -out_frames 61 -out_file many.h5")
    run(given + " -out_frames 61 -out_file whole.h5")
    check([few[k] for k in ("steps", "rejections", "node_steps", "clusters")] ==
          [many[k] for k in ("steps", "rejections", "node_steps", "clusters")], "the same run")
    for name, column in catalogue("few.h5").items():
        check(np.array_equal(column, catalogue("many.h5")[name], equal_nan=True), f"events/{name}")
    with h5py.File("few.h5") as one, h5py.File("many.h5") as other, h5py.File("whole.h5") as whole:
        for name in ("psi", "eta"):
            check(np.array_equal(one[name][-1], other[name][-1]), f"the end, {name}")
            until = np.searchsorted(other["t"][:], catalogue("whole.h5")["t"][5])  # chaos, as above
            moving = np.abs(whole["psi"][:until]).max()
            check(moving > 0.01 and until > 10, f"frames {until}, in which psi reaches {moving}")
            check(np.allclose(other[name][:until], whole[name][:until], rtol=0, atol=1e-6), f"frames of {name}")


def test_an_event_costs_what_slips():
    # Steps of nodes per event, counted: four times the chain, four times the events, the same cost of one.
    cost = []
    for n in (300, 1200):
        s, _ = run(CARLSON + f" -model_k1 9 -model_v 1e-3 -grid_n {n} -friction_back_slip false -ts_max_time 1200"
                   " -out_file n.h5" + start_file(np.random.default_rng(1).uniform(0, 1, n)) + ON)
        check(s["events"] > n / 4 and s["clusters"] > 1, f"{n}: events {s['events']}, clusters {s['clusters']}")
        cost.append(s["node_steps"] / s["events"])
    check(cost[1] < 1.5 * cost[0], f"steps of nodes an event: {cost}")


def test_limits_and_signals():
    given = (CARLSON + " -model_k1 9 -model_v 1e-3 -grid_n 2000 -ts_max_time 1500 -out_file s.h5" +
             start_file(np.random.default_rng(2).uniform(0, 1, 2000)) + ON)
    s, _ = run(given + " -ts_max_steps 1000")
    check(s["status"] == "stopped" and s["steps"] == 1000 and s["t_end"] < 1500, f"{s['status']} {s['steps']} {s['t_end']}")
    shown = subprocess.run([PROGRAM, "run", *words(given + " -check")], capture_output=True, text=True, check=True)
    said = shown.stderr
    check("reach t = 1500" in said and "checked: 2000 nodes" in said, f"-check takes steps of clusters: {said}")
    run(given.replace("s.h5", "whole.h5"))
    os.remove("s.h5")
    with subprocess.Popen(line(given + " -ts_max_time 60000"), stderr=subprocess.PIPE, text=True) as process:
        while not os.path.exists("s.h5"):
            time.sleep(0.01)
        time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)
    checkpoints = glob.glob("s.chk-*.h5")
    check(process.returncode == 128 + signal.SIGTERM and len(checkpoints) == 1, f"exit {process.returncode}, {checkpoints}")
    run(f"-restart {checkpoints[0]} -ts_max_time 1500 -out_file s.h5")
    for name, column in catalogue("whole.h5").items():
        check(np.array_equal(column, catalogue("s.h5")[name], equal_nan=True), f"events/{name} behind a signal")


def test_what_cannot_be_had_is_refused():
    given = CARLSON + " -model_k1 9 -model_v 0.01 -grid_n 20 -ts_max_time 5 -out_file r.h5" + ON
    for more, why in ((" -ts_rk_type 7vr", "rk:5dp"), (" -ts_type arkimex", "rk:5dp"), (" -ts_adapt_type none -ts_dt 0.1", "fixed steps"),
                      (" -ts_adapt_wnormtype 2", "-ts_adapt_wnormtype"), (" -ts_monitor", "-ts_monitor"),
                      (" -state_law healing -load_sine_amplitude 0.01 -load_sine_period 3", "load_v"),
                      (" -out_maxima 3", "out_maxima"), (" -lyapunov_count 1", "lyapunov_count"),
                      (" -friction_stick regularised", "stick")):
        refused(given + more, 2, "stick_clusters on", why)
    refused(given, 2, "stick_clusters on", "one rank", ranks=2)
