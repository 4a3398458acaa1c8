"""A plate that halts while a node slips (load_halt): against SciPy, a block in closed form, clusters against
whole steps, energy, restarts, ranks, limits, refusals."""
import glob
import os
import re
import sys

import h5py
import numpy as np
import pytest

from calls import SOURCE, check, data, refused, run, same
from cluster_scenes import ON, catalogue, drawn_scene, events_alike, start_file
from reference import Stick, System, options

sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
import catalogue as statistics  # noqa: E402

CHAIN = "-model_form chain -model_m 1 -model_k0 1 -model_f0 1 -load_halt -bc_left free"
TIGHT = " -ts_rtol 1e-12 -ts_atol 1e-12 -out_events -out_frames 2"


def drawn_chain(rng):
    """The words of a random chain of 2 to 12 blocks, and its start."""
    n, ring = int(rng.integers(2, 13)), bool(rng.integers(2))
    ring = ring and n > 3
    v, k1, zeta = float(rng.choice([0.01, 0.1, -0.02])), rng.uniform(0.2, 3), rng.uniform(0, 0.5) * rng.integers(2)
    back = bool(v < 0 or rng.integers(2))
    law = (f"coulomb -friction_fd {rng.uniform(0.3, 0.9)!r}" if rng.integers(2) else
           f"carlson-langer -friction_alpha {rng.uniform(0.3, 2)!r} -friction_sigma {rng.uniform(0.05, 0.3)!r}")
    eta = np.sign(v) * rng.uniform(0, 0.7, n)
    given = (CHAIN.replace("-bc_left free", "" if ring else "-bc_left free") + f" -grid_n {n} -model_v {v} -model_k1 {k1!r}"
             f" -model_zeta {zeta!r} -friction_law {law} -friction_back_slip {str(back).lower()} -friction_spread 0.3"
             f" -friction_seed {rng.integers(1000)} -out_rupture -out_displacement" + start_file(eta))
    return given, eta


def events_of(motion, end):
    """Rows of plate's time, duration, first node, slips of all nodes, until the plate's time is that."""
    rows, begun = [], []

    def changed(motion):
        if not begun:
            begun.extend((motion.plate, motion.t, motion.fresh, motion.slip.copy()))
        if motion.rests.all():
            rows.append((begun[0], motion.t - begun[1], begun[2], motion.slip - begun[3]))
            begun.clear()
    motion.advance(1e6, changed, plate=end)
    return rows


def compare_with_scipy(given, eta, ways=1.2):
    """The plate's time, duration, place, slip and moment of every event, and chi at the end; how many events there were."""
    v = options(given)["model_v"]
    end = ways / abs(v)
    s, _ = run(given + TIGHT + f" -ts_max_time {end + 4000} -ts_max_plate {end} -out_file c.h5")
    with h5py.File("c.h5") as file:
        chain = Stick(System(given, file["friction_amplitude"][:]), np.concatenate([0 * eta, eta]))
        last = {name: file["series"][name][-1] for name in ("t", "plate_time", "v")}
    e, rows = catalogue("c.h5"), events_of(chain, end)
    check(len(rows) == len(e["t"]), f"events {len(e['t'])}, {len(rows)}: {given}")
    for k, (plate, duration, first, slip) in enumerate(rows):
        moved = np.flatnonzero(slip)
        check(abs(e["begin"][k] - plate) < 1e-7 / abs(v) and e["begin"][k] == e["t"][k], f"event {k} at {e['t'][k]}, {plate}: {given}")
        check(e["first"][k] == first and e["extent"][k] == len(moved), f"event {k}: {e['first'][k]} {e['extent'][k]}: {given}")
        for name, exact in (("duration", duration), ("moment", abs(slip.sum()))):
            check(abs(e[name][k] - exact) < 1e-7 * max(1, exact), f"event {k}: {name} {e[name][k]}, {exact}: {given}")
    check(s["plate_time"] == end == last["plate_time"] and s["t_end"] == last["t"], f"ends at {s['plate_time']}, {end}")
    check(abs(s["t_end"] - chain.t) < 1e-6 and last["v"] == v, f"the run's clock {s['t_end']}, {chain.t}")
    return len(rows)


def test_random_chains_are_those_of_scipy():
    rng = np.random.default_rng(7)
    events = sum(compare_with_scipy(*drawn_chain(rng)) for _ in range(6))
    check(events > 30, f"events {events}")


def test_a_block_alone():
    # eta - fd = (fs - fd) cos(omega t) from its threshold on: half a turn, back to 2 fd - fs
    fs, fd, k0, m, v = 1.0, 0.6, 0.7, 2.0, 0.03
    loads = 2 * (fs - fd) / (k0 * v)
    end = 0.9 / (k0 * v) + 3.5 * loads
    block = (f"-model_form chain -grid_n 1 -bc_left free -model_m {m} -model_k0 {k0} -model_f0 1 -model_v {v} -friction_law coulomb"
             f" -friction_fs {fs} -friction_fd {fd} -init_psi 0 -init_eta 0.1 -load_halt -ts_max_time 1000 -ts_max_plate {end!r}")
    for more in ("", " -ts_type arkimex -imex_implicit friction"):
        s, _ = run(block + TIGHT + more + " -out_displacement -out_rupture -out_file b.h5")
        e = catalogue("b.h5")
        check(np.allclose(e["t"], 0.9 / (k0 * v) + loads * np.arange(4), rtol=1e-9) and (e["begin"] == e["t"]).all(), f"at {e['t']}")
        check(np.allclose(e["slip"], 2 * (fs - fd) / k0, rtol=1e-9), f"slips {e['slip']}")
        check(np.allclose(e["duration"], np.pi * np.sqrt(m / k0), rtol=1e-9), f"take {e['duration']}")
        check(np.allclose(e["clock"], e["t"] + np.cumsum(e["duration"]), rtol=1e-9), f"end at {e['clock']}")
        check(np.allclose(e["rupture/time"], e["clock"] - e["duration"], rtol=1e-12), "first slips, by the run's clock")
        check(s["plate_time"] == end and abs(s["t_end"] - end - e["duration"].sum()) < 1e-7 and s["status"] == "done", f"{s['t_end']}")
        check(abs(s["recurrence"]["system"]["mean"] / loads - 1) < 1e-9, f"recurrence {s['recurrence']}")
        s, _ = run(block + TIGHT + more + f" -ts_max_time {s['t_end'] - 1!r} -out_displacement -out_file b.h5")
        with h5py.File("b.h5") as file:  # chi = V0 T - eta/k0, T the plate's time
            chi, eta = file["chi"][-1, 0], file["eta"][-1, 0]
        check(abs(chi - (v * s["plate_time"] - eta / k0)) < 1e-9, f"chi {chi}")
        check(abs(chi - (8 * (fs - fd) - 0.1) / k0) < 1e-8, f"chi {chi} of four slips")


def test_clusters_are_whole_steps():
    rng = np.random.default_rng(4)
    compared = 0
    for scene in range(6):
        given, loading = drawn_scene(rng, 40)
        # neither a load nor an end that moves: what the plate halts for would never end, or is refused
        given = re.sub(r" -load\S* \S+", "", re.sub("(?<=bc_left_value )\\S+", "0", given))
        alike, of = events_alike(given.replace("-ts_max_time", "-load_halt -ts_max_time 1e6 -ts_max_plate"), loading)
        check(alike >= min(5, of), f"scene {scene}: {alike} of {of} events: {given}")
        e = catalogue("own.h5")
        if "chain" in given or "bc_left periodic" in given:  # at a free end of the continuum nodes weigh half in energies
            check(np.allclose(e["strain_energy"], e["friction_work"] + e["radiated"], rtol=1e-7), "the plate gives no energy to an event")
        for name in ("duration", "clock"):
            check(np.allclose(e[name][:alike], catalogue("whole.h5")[name][:alike], rtol=1e-6), f"{name}: {given}")
        compared += alike
    check(compared > 50, f"events compared: {compared}")


MEDIUM = (CHAIN + " -grid_n 20 -model_k1 4 -model_v 0.02 -model_zeta 0.1 -friction_law carlson-langer -friction_sigma 0.1 -friction_alpha 2"
          " -friction_spread 0.2 -friction_back_slip false -init_psi 0 -init_eta 0.5 -init_noise 0.4 -out_events -out_rupture")


def test_energy_and_the_end_of_the_plate():
    run(MEDIUM + " -ts_rtol 1e-11 -ts_atol 1e-11 -ts_max_time 5000 -ts_max_plate 80 -out_frames 2 -out_displacement -out_file e.h5")
    with h5py.File("e.h5") as file:
        s = {name: column[:] for name, column in file["series"].items()}
        e = {name: file["events"][name][:] for name in ("friction_work", "radiated", "t", "begin", "moment", "duration")}
    plate = np.diff(s["plate_time"])
    check(((plate > 0) == (s["v"][1:] > 0)).all() and plate.sum() == 80, "the plate goes where v is not 0, to its end")
    check(np.allclose(plate[plate > 0], s["dt"][1:][plate > 0], rtol=1e-9), "and then as the run's clock does")
    check(abs(s["t"][-1] - 80 - e["duration"].sum()) < 1e-6, "which is ahead by the events")
    given = 20 * 0.02 * plate * (s["eta_mean"][1:] + s["eta_mean"][:-1]) / 2  # at rest eta grows linearly
    energy = s["energy_kinetic"] + s["energy_elastic"]
    lost = e["friction_work"].sum() + e["radiated"].sum()
    check(len(e["t"]) > 20 and abs(energy[-1] - energy[0] - given.sum() + lost) < 1e-7 * lost, f"{energy[-1] - energy[0]} {given.sum()} {lost}")


def test_a_catalogue_ends_where_the_plate_does():
    # though no series says so, and the last event is earlier
    for more in ("", ON):
        run(MEDIUM + more + " -ts_max_time 1e6 -ts_max_plate 30 -out_frames 2 -out_series false -out_file end.h5")
        one = statistics.read("end.h5", 0)
        check(abs(one["end"] - 30) < 1e-9 and len(one["t"]) == 2, f"{one['end']}, frames at {one['t']}{more}")
        check(one["events"]["t"][-1] < 29.9 and abs(one["way"] - 30 * 0.02) < 1e-9, f"the way {one['way']}{more}")


@pytest.mark.parametrize("steps", ["", ON, ON + " -state_law healing -state_t_h 20 -state_tau_inf 1.3 -state_D 0.3 -init_state 1.05"])
def test_restarts_go_on_alike(steps):
    given = MEDIUM + " -ts_max_time 300 -ts_max_plate 30 -out_frames 31 -out_displacement -out_probes 3" + steps
    run(given + " -out_checkpoint_every 40 -out_checkpoint_keep 99 -out_file whole.h5")
    kept = sorted(glob.glob("whole.chk-*.h5"))
    check(len(kept) > 8, f"{len(kept)} checkpoints")
    truth = data("whole.h5")
    for checkpoint in kept[::3]:
        s, _ = run(f"-restart {checkpoint} -out_file whole.h5")
        check(s["plate_time"] <= 30, f"the plate's clock {s['plate_time']}")
        same(data("whole.h5"), truth, checkpoint)
    s, _ = run(f"-restart {kept[-1]} -out_file whole.h5 -ts_max_plate 45 -ts_max_time 400 -out_frames 2")
    check(s["plate_time"] == 45 and s["events"] > len(truth["events/t"]), f"a run that has ended goes on: {s['plate_time']}, {s['events']}")


@pytest.mark.ranks
def test_any_number_of_ranks():
    given = MEDIUM + " -ts_max_time 300 -ts_max_plate 15 -out_frames 16 -out_displacement"
    run(given + " -out_file one.h5")
    run(given + " -out_file three.h5", ranks=3)
    one, three = data("one.h5"), data("three.h5")
    for name in ("t", "psi", "eta", "series/plate_time", "events/t", "events/clock", "events/rupture/time"):
        check(np.array_equal(one[name], three[name]), f"{name} differs")
    check(np.allclose(one["chi"], three["chi"], rtol=1e-12, atol=1e-12) and len(one["events/t"]) > 5, "chi")


def test_accuracy():
    given = MEDIUM.split(" -out_events")[0] + " -ts_max_time 30 -out_probes 7"
    exact, _ = run(given + " -ts_rtol 1e-12 -ts_atol 1e-12")
    s, _ = run(given + " -accuracy 1e-6")
    for name in ("psi", "eta"):
        check(abs(s["probes"][0][name] - exact["probes"][0][name]) < 1e-6, f"{name}: {s['probes']}, {exact['probes']}")
    check(abs(s["plate_time"] - exact["plate_time"]) < 1e-4 and s["error_estimate"] <= 1e-6, f"{s['plate_time']}, {exact['plate_time']}")


def test_what_makes_no_sense_is_refused():
    coulomb = CHAIN + " -grid_n 4 -model_k1 1 -model_v 0.1 -friction_law coulomb -init_psi 0 -ts_max_time 5"
    for more, why in ((" -friction_law cubic", "cubic friction never lets a node rest"), (" -friction_stick regularised", "friction_stick exact"),
                      (" -friction_fd 1", "does not drop"), (" -friction_law carlson-langer", "friction_sigma"),
                      (" -bc_left velocity", "held"), (" -load_sine_amplitude 0.1 -load_sine_period 3", "load_sine"),
                      (" -load_v 0:1,1:2", "load_v"), (" -model_m 0 -model_zeta 1", "model_m 0")):
        refused(coulomb + more, 2, "load_halt", why)
    refused(coulomb + " -lyapunov_count 1", 2, "lyapunov_count", "load_halt")
    refused(coulomb.replace(" -ts_max_time 5", "") + " -ts_max_plate 5", 2, "ts_max_plate", "ts_max_time")
    refused(coulomb + " -ts_max_plate 5 -accuracy 1e-3", 2, "ts_max_plate", "accuracy")
    for command in ("spectrum", "cycle", "boundary -boundary_parameter model_v -boundary_from 0.1 -boundary_to 1", "chart"):
        refused(coulomb.replace(" -init_psi 0 -ts_max_time 5", "") + " " + " ".join(command.split()[1:]), 2, "load_halt", command=command.split()[0])
    s, stderr = run(coulomb + " -bc_left velocity -bc_left_value 0 -bc_right free")
    check(s["plate_time"] is not None and s["regime"] == "undecided" and "load_halt" in s["regime_reason"], f"an end that rests: {stderr}")
    s, stderr = run(coulomb.replace(" -load_halt", "") + " -ts_max_plate 3")
    check(s["plate_time"] is None and "ts_max_plate (load_halt is false)" in stderr, f"without effect: {stderr}")
