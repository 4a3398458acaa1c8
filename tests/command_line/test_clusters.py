"""Only what slides is advanced (stick_clusters): the events of whole steps, integration by SciPy, outputs, checkpoints, refusals."""
import glob
import os
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

from calls import PROGRAM, check, data, line, ran, ranks_of, refused, run, same, words
from cluster_scenes import OFF, ON, catalogue, drawn_scene, events_alike, lone_slip, start_file
from reference import options

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


def under_a_load(rng):
    """A drawn scene with a state, and a plate that turns, or goes by a table with a corner and a jump."""
    while True:
        given, loading = drawn_scene(rng, 40)
        if "-state_law" in given:
            break
    p = options(given)
    v, end = p["model_v"], p["ts_max_time"]
    if rng.integers(2):
        return given + f" -load_sine_amplitude {rng.uniform(0.5, 3) * abs(v)} -load_sine_period {rng.uniform(0.05, 0.4) * end}", loading
    return given + f" -load_v 0:{v},{0.3 * end}:{2 * v},{0.5 * end}:{-0.5 * v},{0.5 * end}:{2 * v}", loading


def test_a_state_under_a_plate_that_varies(scenes):
    compared = 0
    for index, (given, loading) in scenes(under_a_load, 72, short=6):
        alike, of = events_alike(given, loading)
        check(alike >= min(4, of), f"scene {index}: {alike} of {of} events: {given}")
        compared += alike
    check(compared > 12, f"events compared: {compared}")


def test_an_event_beside_one_under_way():
    # Nodes at its edge lie in the stencil of the other, and go on with that while they rest; among its strain energies one
    # was off by 6e-6.
    given, loading = drawn_scene(np.random.default_rng([20261127, 39, 110]), 300, 10)
    alike, of = events_alike(given, loading)
    check(alike == of == 16, f"{alike} of {of} events: {given}")


def test_the_work_of_friction_with_a_state_is_of_fourth_order():
    # By clusters it is what eta gives less what goes into motion, whose integrals have errors of dt^4; by whole steps that of
    # friction itself. With a state that is the mean of a step's ends in its middle the two are 1e-7 apart here, of second order.
    given, _ = drawn_scene(np.random.default_rng([39, 7]))
    check("state_law healing" in given, given)
    run(given + OFF + " -out_file whole.h5")
    run(given + ON + " -out_file own.h5")
    whole, own = (catalogue(name)["friction_work"][:6] for name in ("whole.h5", "own.h5"))
    check(len(whole) == 6 and np.abs(whole / own - 1).max() < 2e-8, f"{whole / own - 1}")


def test_a_restart_is_the_same_to_the_last_bit():
    counted = ("regime", "regime_rate", "amplitude", "rest_fraction", "period", "psi_low", "pulses", "wave_speed", "steps", "rejections", "rhs_evaluations", "node_steps", "clusters", "events", "largest_moment", "recurrence", "psi_max",
               "eta_mean", "t_end")
    for scene in SCENES[1:4:2]:
        given, _ = drawn_scene(np.random.default_rng([39, scene]))
        given = given.replace("-out_frames 2", "-out_frames 21").replace("-ts_rtol 1e-10 -ts_atol 1e-10", "") + ON
        given = given.replace("-out_series false", "-out_probes 3,7")
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
    v, k1 = 1e-3, 2.0
    eta = np.array([0.1, 0.2, 0.9, 0.15, 0.1, 0.0])
    run(CARLSON + f" -model_k1 {k1} -model_v {v} -grid_n 6 -bc_left free -friction_back_slip false -ts_max_time 130"
        " -ts_rtol 1e-12 -ts_atol 1e-12 -out_file b.h5" + start_file(eta) + ON)
    e = catalogue("b.h5")
    check(len(e["t"]) == 1 and e["extent"][0] == 1 and e["first"][0] == 2, f"one block slips once: {e}")

    duration, behind, slip, work = lone_slip(options(CARLSON + f" -model_k1 {k1}"), v)
    check(abs(e["begin"][0] - 0.1 / v) < 1e-9 / v, f"begins at {e['begin'][0]}")
    check(abs(e["t"][0] - e["begin"][0] - duration) < 1e-9 * duration, f"lasts {e['t'][0] - e['begin'][0]}, {duration}")
    for name, exact, bound in (  # what goes through several sums of Simpson's rule has their errors, dt^4 each
            ("slip", slip, 1e-9), ("moment", slip, 1e-9), ("stress_drop", 1 - behind, 1e-8), ("friction_work", work, 1e-8),
            ("strain_energy", slip * (1 + behind) / 2, 1e-8)):
        check(abs(e[name][0] / exact - 1) < bound, f"{name} {e[name][0]}, {exact}")
    check(abs(e["radiated"][0]) < 1e-15, "nothing is radiated")


def test_frames_change_nothing_and_lie_in_the_steps():
    given = CARLSON.replace("-out_frames 2", "") + " -model_k1 9 -model_v 0.01 -grid_n 60 -bc_left free -ts_max_time 60"
    given += " -ts_rtol 1e-10 -ts_atol 1e-10" + start_file(np.random.default_rng(5).uniform(0, 0.7, 60))
    few, _ = run(given + ON + " -out_frames 2 -out_file few.h5")
    many, _ = run(given + ON + " -out_frames 61 -out_file many.h5")
    run(given + OFF + " -out_frames 61 -out_file whole.h5")
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


def rows(path, group):
    """Columns of a table with one row each time."""
    with h5py.File(path) as file:
        found = {name: column[:] for name, column in file[group].items()}
    check((np.diff(found["t"]) > 0).all(), f"{group}: one row a time")
    return found


def test_rows_are_those_of_whole_steps():
    # Until chaos parts them: a row of the series at each start and stop, of a probe at each step of its cluster. With a load that
    # turns the sum over what rests has no short form.
    loads = "", " -load_sine_amplitude 0.03 -load_sine_period 7"
    for more in loads:
        given = CARLSON.replace("-out_frames 2 ", "").replace("-out_series false", "") + more
        given += " -model_k1 9 -model_v 0.01 -grid_n 60 -bc_left free -ts_max_time 42 -ts_rtol 1e-11 -ts_atol 1e-11 -out_displacement"
        given += " -out_frames 12 -out_probes 30,31" + start_file(np.random.default_rng(5).uniform(0, 0.7, 60))
        whole_run, _ = run(given + OFF + " -out_file whole.h5")
        own_run, _ = run(given + ON + " -out_file own.h5")
        whole, own = rows("whole.h5", "series"), rows("own.h5", "series")
        changes = np.unique(np.r_[catalogue("own.h5")["begin"], catalogue("own.h5")["t"]])
        check(len(changes) >= 10 and np.isin(changes, own["t"]).all(), f"rows at starts and stops, {len(changes)}")
        both = [(i, np.argmin(np.abs(whole["t"] - t))) for i, t in enumerate(own["t"])]
        both = np.array([(i, k) for i, k in both if abs(whole["t"][k] - own["t"][i]) < 1e-8])
        check(len(both) > 20, f"rows at the same times: {len(both)}")
        for name in ("psi_mean", "psi_min", "psi_max", "eta_mean") + (("v",) if more else ()):
            apart = np.abs(whole[name][both[:, 1]] - own[name][both[:, 0]]).max()
            check(apart < 1e-6, f"{name} differs by {apart}")
        known = np.isfinite(own["energy_elastic"])
        check(known.sum() >= 12 and own["t"][-1] == 42, f"energies at frames: {known.sum()}")
        for name in ("energy_kinetic", "energy_elastic", "power_input", "power_friction", "power_viscous"):
            check(abs(own[name][-1] - whole[name][-1]) < 1e-6 * abs(whole["power_input"]).max() + 1e-6, f"{name} at the end")
        mean = own["eta_mean"][-1]
        whole, own = rows("whole.h5", "probes"), rows("own.h5", "probes")
        same_time = np.abs(whole["t"][:, None] - own["t"]) < 1e-8
        whole_rows, own_rows = np.nonzero(same_time)
        check(len(own_rows) > 12 and own["psi"].max() > 0.1, f"rows of probes at the same times: {len(own_rows)}")
        for name in ("psi", "eta"):
            check(np.abs(whole[name][whole_rows] - own[name][own_rows]).max() < 1e-7, f"probes, {name}")
        with h5py.File("whole.h5") as one, h5py.File("own.h5") as other:
            check(np.abs(one["chi"][:] - other["chi"][:]).max() < 1e-6, "displacement")
            check(abs(other["eta"][-1].mean() - mean) < 1e-14, "the sum over what rests")
        for name in ("regime", "amplitude", "psi_low", "psi_high", "rest_fraction", "pulses", "psi_mean", "measured_over"):
            one, other = whole_run.get(name), own_run.get(name)
            # extrema between steps are those of cubics through other steps
            alike = one == other if not isinstance(one, float) else abs(one - other) < 2e-4 * max(abs(one), 1e-3)
            check(alike, f"{name}: {one}, {other}")


def test_rows_of_a_run_that_is_stopped_are_a_beginning():
    # Clusters lie ahead of the time of the end by parts of steps, which a run that goes on further has no rows for.
    given = CARLSON.replace("-out_series false", "") + " -model_k1 9 -model_v 0.02 -grid_n 80 -ts_max_time 40 -bc_left free -out_displacement"
    given += " -out_probes 3,40 -ts_rk_type 5dp" + ON + start_file(np.random.default_rng(5).uniform(0, 0.7, 80))
    run(given + " -out_file all.h5")
    for steps in range(300, 900, 60):
        run(given + f" -ts_max_steps {steps} -out_file part.h5")
        for group in ("series", "probes"):
            whole, part = rows("all.h5", group), rows("part.h5", group)
            until = len(part["t"])
            check(until < len(whole["t"]), f"{group}: {until} rows of {len(whole['t'])}")
            for name in ("t", "psi_max") if group == "series" else ("t", "psi", "eta"):
                check(np.array_equal(part[name], whole[name][:until]), f"{group}/{name} after {steps} steps")


def test_rows_are_kept_for_every_so_many():
    given = CARLSON.replace("-out_series false", "") + " -model_k1 9 -model_v 0.01 -grid_n 80 -ts_max_time 40 -bc_left free"
    given += start_file(np.random.default_rng(5).uniform(0, 0.7, 80))
    for how in (ON, OFF):
        run(given + how + " -out_file all.h5")
        run(given + how + " -out_series_every 5 -out_file some.h5")
        some, every = rows("some.h5", "series"), rows("all.h5", "series")
        check(0 < len(some["t"]) < 0.4 * len(every["t"]), f"{how}: {len(some['t'])} of {len(every['t'])}")
        check(np.isin(some["t"], every["t"]).all() or how == ON, f"{how}: rows of all")


@pytest.mark.parametrize("medium", ["-model_k0 1", "-model_k0_profile 0:1,299:1.5"])
def test_sums_over_what_rests_keep_their_digits(medium):
    # Thousands of starts and stops later the mean of eta is that of the fields.
    given = CARLSON.replace("-out_series false", "-out_series_every 50").replace("-out_frames 2", "-out_frames 6")
    given = given.replace("-model_k0 1", medium)
    run(given + " -model_k1 9 -model_v 1e-3 -grid_n 300 -bc_left free -ts_max_time 3000 -friction_back_slip false -out_displacement"
        " -out_file s.h5" + start_file(np.random.default_rng(1).uniform(0, 1, 300)) + ON)
    series = rows("s.h5", "series")
    with h5py.File("s.h5") as file:
        for t, eta, psi in zip(file["t"][:], file["eta"][:], file["psi"][:]):
            k = np.flatnonzero(series["t"] == t)
            check(len(k) == 1 and abs(series["eta_mean"][k[0]] - eta.mean()) < 1e-12, f"at {t}")
            check(abs(series["psi_max"][k[0]] - psi.max()) < 1e-15, f"psi at {t}")
    inside = np.isnan(series["energy_elastic"])
    check(inside.sum() > 50, f"rows between frames: {inside.sum()}")


def test_a_motion_that_repeats():
    # All blocks alike on a ring: one cluster, which slips and rests. Its rows are those of whole steps in number, and its regime
    # and period are known.
    given = ("-model_form chain -model_m 1 -model_k0 1 -model_k1 1 -model_f0 1 -model_zeta 0.3 -friction_law carlson-langer"
             " -friction_alpha 2 -friction_sigma 0.1 -model_v 0.1 -grid_n 70 -scene_reduce off -init_psi 0 -init_eta 0 -ts_max_time 300"
             " -out_frames 2 -out_probes 11 -ts_rtol 1e-9 -ts_atol 1e-9 -out_file r.h5")
    whole, _ = run(given + OFF)
    of_whole = rows("r.h5", "series")
    own, _ = run(given + ON)
    of_own = rows("r.h5", "series")
    check(0.5 * len(of_whole["t"]) < len(of_own["t"]) < 2 * len(of_whole["t"]), f"{len(of_own['t'])} rows, {len(of_whole['t'])}")
    check(own["regime"] == whole["regime"] == "stick-slip", f"{own['regime']}, {whole['regime']}")
    check(own["clusters"] == 1 and own["period"] > 10, f"{own['clusters']}, {own['period']}")
    for name, bound in (("period", 1e-4), ("rest_fraction", 1e-5), ("amplitude", 1e-4), ("psi_high", 1e-4), ("psi_low", 1e-4)):
        check(abs(own[name] - whole[name]) <= bound * max(abs(whole[name]), 1e-9), f"{name}: {own[name]}, {whole[name]}")
    series = of_own["psi_mean"]
    check(abs(series.max() / own["psi_high"] - 1) < 0.01 and series.min() == 0, "the mean goes from rest to its largest value")


def test_auto_takes_clusters_where_they_may_pay():
    given = CARLSON + " -model_k1 9 -model_v 0.01 -ts_max_time 5 -out_file a.h5 -grid_n "
    for more, why in (("100", None), ("20", "nothing is gained"), ("100 -ts_rk_type 7vr", "rk:5dp"), ("100 -ts_type arkimex", "rk:5dp"),
                      ("100 -ts_adapt_type none -ts_dt 0.1", "fixed steps"), ("100 -ts_adapt_wnormtype 2", "-ts_adapt_wnormtype"),
                      ("100 -rk_fused false", "rk_fused"), ("100 -ts_monitor", "-ts_monitor"),
                      ("100 -lyapunov_count 1 -ts_max_time 1", "lyapunov_count"), ("100 -ts_rtol 1e-2 -ts_atol 1e-2", "tolerances"),
                      ("100 -stick_clusters off", "off"), ("100 -friction_stick regularised", "")):
        s, _ = run(given + more)
        said = s.get("clusters_reason")
        check((s["clusters"] is not None) == (why is None), f"{more}: {s['clusters']}, {said}")
        check(said is None if not why else why in said, f"{more}: {said}")


def told(summary):
    return {key: value for key, value in summary.items() if "second" not in key and key not in ("wall_s", "events_per_s")}


def everything(path):
    values = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: values.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return values


@pytest.mark.ranks
def test_ranks_that_are_not_needed_rest():
    given = CARLSON + " -model_k1 9 -model_v 0.01 -ts_max_time 60 -out_file r.h5 -grid_n 100 -out_checkpoint_every 500" + \
        start_file(np.random.default_rng(3).uniform(0, 1, 100))
    found = []
    for ranks in (1, 3):
        s, _ = run(given, ranks=ranks)
        check(s["clusters"] is not None and s["events"] > 10, f"{ranks}: {s['clusters']}")
        found.append((told(s), everything("r.h5")))
    check(found[0][0] == found[1][0], f"{[key for key in found[0][0] if found[0][0][key] != found[1][0].get(key)]}")
    check(found[0][1].keys() == found[1][1].keys() and
          all(np.array_equal(a, found[1][1][name], equal_nan=a.dtype.kind == "f") for name, a in found[0][1].items()
              if not name.startswith("provenance")), "the files differ")
    name = sorted(glob.glob("r.chk-*.h5"))[0]
    run(f"-restart {name} -out_file r.h5", ranks=2)
    check(np.array_equal(found[0][1]["events/t"], everything("r.h5")["events/t"]), "behind a checkpoint")
    # one block: a run, what fails in it, and other commands
    block = "-model_form chain -grid_n 1 -bc_left free "
    alone, both = (run(block + "-ts_max_time 5 -out_probes 0", ranks=ranks)[0]["probes"] for ranks in (1, 2))
    check(alone == both, f"{alone} {both}")
    refused(block + "-model_m 0 -model_zeta 0.5 -init_psi 1", 1, "does not say what psi is", ranks=2)
    check(len(run(block, ranks=2, command="spectrum")[0]["eigenvalues"]) == 2, "spectrum")


def test_a_resting_rank_takes_no_processor():
    given = CARLSON + " -model_k1 9 -model_v 1e-3 -grid_n 2000 -ts_max_time 1e6 -ts_max_wall 3s -out_file z.h5" + \
        start_file(np.random.default_rng(2).uniform(0, 1, 2000))
    with subprocess.Popen(line(given, 2, pids="pids"), stderr=subprocess.DEVNULL) as process:
        ranks = ranks_of(process, 2, "pids")
        while not os.path.exists("z.h5") and process.poll() is None:
            time.sleep(0.01)

        def spent():
            return [sum(int(x) for x in open(f"/proc/{rank}/stat", encoding="ascii").read().rsplit(")")[1].split()[11:13]) for rank in ranks]
        before = spent()
        time.sleep(1)
        used = sorted(b - a for a, b in zip(before, spent()))
        process.communicate(timeout=60)
    check(used[0] <= 0.1 * used[1], f"processor time of the two ranks over a second: {used}")


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
    # with the words that -progress off leaves out; in its second whole steps reach t = 207
    said = ran([PROGRAM, "run", *words(given + " -ts_max_time 700"), "-check"]).stderr
    check("reach t = 700" in said and "checked: 2000 nodes" in said, f"-check takes steps of clusters: {said}")
    run(given.replace("s.h5", "whole.h5"))
    os.remove("s.h5")
    with subprocess.Popen(line(given + " -ts_max_time 60000"), stderr=subprocess.PIPE, text=True) as process:
        while not os.path.exists("s.h5"):  # made once signals are heard
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
                      (" -out_maxima 3", "out_maxima"), (" -lyapunov_count 1", "lyapunov_count"),
                      (" -friction_stick regularised", "stick")):
        refused(given + more, 2, "stick_clusters on", why)
