"""The catalogue of slip events (out_events): known events, any number of ranks, restart, kill -9, pictures."""
import contextlib
import csv
import io
import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from calls import PROGRAM, SOURCE, check, checkpoint_block, refused, run, scene_file, tool, words
from reference import Stick, System
from rupture_scenes import THOGERSEN, front, start


def catalogue(path):
    with h5py.File(path) as file:
        found = {name: data[:] for name, data in file["events"].items() if name != "rupture"}
        found.update({f"rupture/{name}": data[:] for name, data in file["events"].get("rupture", {}).items()})
    return found


def same(a, b, tolerance=0):
    return all(len(a[k]) == len(b[k]) and np.allclose(a[k], b[k], rtol=tolerance, atol=tolerance, equal_nan=True)
               for k in a)


CHAIN = (scene_file("catalogue") + " -grid_n 60 -model_v 0.01 -ts_max_time 150 -friction_spread 0.1"
         " -out_frames 31 -out_rupture")


def test_a_block_in_closed_form():
    # Coulomb, m = k0 = f0 = 1: slip, its duration, the drop of stress and the period in closed form.
    v, drop = 0.1, 0.5
    duration = 2 * (np.pi - np.arctan(drop / v))
    slip = v * (duration - np.sin(duration)) + drop * (1 - np.cos(duration))
    fall = slip - v * duration
    for reduce in ("auto", "off"):
        s, _ = run("-model_form chain -model_k0 1 -model_v 0.1 -friction_law coulomb -grid_n 6 -bc_left free -init_psi 0"
                   f" -init_eta 0 -ts_max_time 100 -ts_rtol 1e-9 -ts_atol 1e-9 -out_events -out_file b.h5 -scene_reduce {reduce}")
        e = catalogue("b.h5")
        check(s["events"] == 7 and len(e["t"]) == 7, f"seven events: {s['events']}")
        check(np.all(e["extent"] == 6), "all blocks slip together")
        check(np.allclose(e["slip"], slip, rtol=1e-7) and np.allclose(e["moment"], 6 * slip, rtol=1e-7), "slip, moment")
        check(np.allclose(e["magnitude"], np.log(6 * slip)), "magnitude")
        check(np.allclose(e["t"] - e["begin"], duration, atol=1e-7), "duration")
        check(np.allclose(np.diff(e["begin"]), duration + fall / v, atol=1e-7), "period")
        check(np.allclose(e["stress_drop"], fall, rtol=1e-7), "stress drop")
        check(np.allclose(e["friction_work"], 6 * 0.5 * slip, rtol=1e-6), "friction work")
    run("-model_v 0 -out_events", code=2)
    run("-model_form chain -grid_n 3 -bc_left free -model_zeta paper -out_events -ts_max_time 100 -out_file c.h5")
    e = catalogue("c.h5")
    check(len(e["t"]) > 0 and (e["radiated"] > 0).all(), "a law without a threshold, with damping")


@pytest.mark.parametrize("how", ["on", "off"])
@pytest.mark.parametrize("order", [2, 8])
def test_energies_between_free_ends(order, how):
    # Nothing is lost but in friction and damping, and nothing given but by springs and, at most K0 |v| duration moment/2, by the plate.
    n, length, v = 40, 20, 1e-4
    eta = np.random.default_rng(3).uniform(0.3, 0.9, n)
    np.savetxt("start.txt", np.c_[length / (n - 1) * np.arange(n), 0 * eta, eta], fmt="%.17g")
    run(f"-grid_order {order} -grid_n {n} -grid_length {length} -model_v {v} -model_gamma 1 -model_delta 0.1 -bc_left free"
        " -friction_law coulomb -init_type text -init_file start.txt -ts_rtol 1e-10 -ts_atol 1e-10 -ts_max_time 4000 -out_events"
        f" -out_series false -out_frames 2 -out_file i.h5 -stick_clusters {how}")
    e = catalogue("i.h5")
    check(sum((e["left"] == 0) | (e["left"] + e["extent"] > length)) >= 3, "events at the ends")
    lacks = np.abs(e["strain_energy"] - e["friction_work"] - e["radiated"])
    given = v * (e["t"] - e["begin"]) * e["moment"] / 2
    check((lacks < given + 1e-7 * e["strain_energy"]).all(), f"energies: {lacks / e['strain_energy']}")


@pytest.mark.ranks
def test_same_events_on_any_number_of_ranks():
    run(CHAIN + " -ts_type rk -ts_rk_type 4 -ts_dt 0.05 -out_file one.h5")
    one = catalogue("one.h5")
    check(len(one["t"]) > 50, f"events: {len(one['t'])}")
    check((np.diff(one["t"]) >= 0).all() and (one["t"] > one["begin"]).all(), "in order of their ends")
    balance = np.abs(one["strain_energy"] - one["friction_work"]) / one["friction_work"]
    check(np.median(balance) < 0.05, f"the springs pay for friction, but for the plate: {np.median(balance)}")
    for n in (2, 3):
        run(CHAIN + " -ts_type rk -ts_rk_type 4 -ts_dt 0.05 -out_file more.h5", ranks=n)
        check(same(one, catalogue("more.h5"), 1e-9), f"the same events on {n} ranks")


def recurrence(times):
    """Of lists of ends of events."""
    waits = np.concatenate([np.diff(np.sort(t)) for t in times])
    return [len(waits), waits.mean(), waits.std(ddof=1) / waits.mean()]


@pytest.mark.ranks
def test_how_soon_events_follow_each_other():
    ring = CHAIN + " -bc_left periodic -out_file w.h5"
    for more, ranks in ((" -stick_clusters off", 1), (" -stick_clusters on", 1), ("", 3)):
        s, _ = run(ring + more, ranks=ranks)
        e = catalogue("w.h5")
        first = e["left"].astype(int)
        ends = [[t for t, left, extent in zip(e["t"], first, e["extent"]) if (i - left) % 60 < extent] for i in range(60)]
        for name, expected in (("system", recurrence([e["t"]])), ("node", recurrence(ends))):
            found = [s["recurrence"][name][key] for key in ("count", "mean", "variation")]
            check(np.allclose(found, expected, rtol=1e-9), f"{more} {ranks} {name}: {found}, {expected}")
        check(max(first + e["extent"]) > 60, "an event runs over the seam")
        check(np.allclose(e["magnitude10"] * np.log(10), e["magnitude"], rtol=1e-14), "to the base 10")
    s, _ = run(ring + " -out_checkpoint_every 300 -out_checkpoint_keep 1000")
    name = sorted(f for f in os.listdir(".") if f.startswith("w.chk"))[2]
    for ranks in (1, 2):
        again, _ = run(f"-restart {name} -out_file w.h5", ranks=ranks)
        of_system, of_node = (s["recurrence"][which] for which in ("system", "node"))
        check(all(np.isclose(again["recurrence"]["node"][key], of_node[key], rtol=1e-3) for key in of_node)
              and np.isclose(again["recurrence"]["system"]["mean"], of_system["mean"], rtol=1e-3), again["recurrence"])
    # one block in closed form: the period of test_a_block_in_closed_form, over and over
    block = ("-model_form chain -model_k0 1 -model_v 0.1 -friction_law coulomb -grid_n 6 -bc_left free -init_psi 0 -init_eta 0"
             " -ts_max_time 100 -ts_rtol 1e-9 -ts_atol 1e-9 -out_events")
    s, on_two = (run(block, ranks=ranks)[0] for ranks in (1, 2))
    duration = 2 * (np.pi - np.arctan(5))
    period = duration + (0.1 * (duration - np.sin(duration)) + 0.5 * (1 - np.cos(duration)) - 0.1 * duration) / 0.1
    for name, count in (("system", 6), ("node", 36)):
        found = s["recurrence"][name]
        check(found["count"] == count and abs(found["mean"] - period) < 1e-7 and found["variation"] < 1e-7, found)
        check(abs(found["variation"] - on_two["recurrence"][name]["variation"]) < 1e-13, (found, on_two["recurrence"][name]))


def first_slips_by_scipy(scene, eta, end):
    """When each block first slips, up to the end of the first event that is over by then."""
    motion, found = Stick(System(scene), np.concatenate([0 * eta, eta])), np.full(len(eta), np.nan)

    def changed(motion):
        if np.isnan(found[motion.fresh]):
            found[motion.fresh] = motion.t
    while motion.t < end and not (motion.changes and motion.rests.all()):
        motion.advance(end, changed, motion.changes + 1)
    return found


@pytest.mark.ranks
def test_when_nodes_first_slip_is_what_scipy_finds():
    # The errors of 1e-10 of each step grow on the way by no more than the events of a chain part: a thousandfold.
    v, k1, fd = 0.01, 3.0, 0.3
    eta = np.random.default_rng(4).uniform(0.6, 0.9, 24)
    eta[9] = 1
    scene = (f"-model_form chain -model_m 1 -model_k0 1 -model_f0 1 -model_k1 {k1} -model_v {v} -friction_law coulomb"
             f" -friction_fd {fd} -friction_back_slip false -bc_left free -ts_max_time 15 -ts_rtol 1e-10 -ts_atol 1e-10"
             " -out_events -out_rupture -out_frames 2 -out_file s.h5" + start(eta))
    exact = first_slips_by_scipy(scene, eta, 15)
    slipped = np.flatnonzero(np.isfinite(exact))
    check(len(slipped) > 19 and (exact[slipped] == 0).sum() == 1, f"blocks that slip: {exact}")
    for more, ranks in ((" -stick_clusters off", 1), (" -stick_clusters on", 1), ("", 3)):
        run(scene + more, ranks=ranks)
        e = catalogue("s.h5")
        check(e["rupture_offset"][0] == 0 and e["extent"][0] == len(slipped), f"{more} one event: {e['extent']}")
        place, time_of = e["rupture/x"][:len(slipped)], e["rupture/time"][:len(slipped)]
        check((place == slipped).all() and (e["rupture/t"][:len(slipped)] == e["t"][0]).all(), f"{more} places: {place}")
        apart = np.abs(time_of - exact[slipped]).max()
        check(apart < 1e-7, f"{more} {ranks} first slips, apart by {apart}")
        for name, side in (("right", place >= 13), ("left", place <= 5)):
            (slope, _), square = np.polyfit(time_of[side], place[side], 1, cov=True)
            check(abs(e["front_speed_" + name][0] / slope - 1) < 1e-9, f"speed to the {name}: {e['front_speed_' + name]}")
            check(abs(e[f"front_speed_{name}_error"][0] / np.sqrt(square[0, 0]) - 1) < 1e-6, "its error")


def test_rows_of_ruptures_follow_each_other():
    run(CHAIN + " -out_file r.h5")
    run(CHAIN + " -out_rupture false -out_file without.h5")
    e, without = catalogue("r.h5"), catalogue("without.h5")
    check(not any("rupture" in name or "front" in name for name in without), "nothing unasked for")
    check(same(without, {name: e[name] for name in without}), "the same events")
    ends = np.r_[e["rupture_offset"][1:], len(e["rupture/t"])].astype(int)
    check((ends - e["rupture_offset"] == e["extent"]).all(), "as many rows as nodes")
    for begin, end, first, t, at in zip(e["rupture_offset"].astype(int), ends, e["begin"], e["t"], e["first"]):
        times, places = e["rupture/time"][begin:end], e["rupture/x"][begin:end]
        check(times.min() == first and places[times.argmin()] == at and times.max() < t, "from begin to end")
    check(np.isfinite(e["front_speed_right"]).any() and (e["front_speed_left"] < 0).any(), "fronts either way")


def test_fronts_as_published():
    # by some of the blocks, on the way to the speed of long chains
    for tau, alpha, n, until, speed in THOGERSEN:
        found, error = front(tau, alpha, n, until)
        check(abs(found - speed) < 1e-3 and 0 < error < 2e-4, f"tau {tau}, alpha {alpha}: {found} +- {error}")


def test_a_run_may_ask_for_ruptures_later():
    scene = CHAIN + " -out_file later.h5 -out_checkpoint_every 300 -out_checkpoint_keep 1000"
    run(scene)
    whole = catalogue("later.h5")
    run(scene + " -out_rupture false")
    name = sorted(f for f in os.listdir(".") if f.startswith("later.chk"))[2]
    run(f"-restart {name} -out_rupture true -out_file later.h5")
    e = catalogue("later.h5")
    known = np.isfinite(e["rupture_offset"])
    check(0 < known.sum() < len(known) and (e["rupture_offset"][known][0] == 0), "rows from the restart on")
    rows, tail = len(e["rupture/t"]), len(whole["rupture/t"])
    finite = np.isfinite(e["rupture/time"])
    check(finite.sum() > rows / 2 and np.array_equal(e["rupture/time"][finite], whole["rupture/time"][tail - rows:][finite]),
          "the same times where they are known")


def test_no_event_lost_by_restart_or_kill():
    run(CHAIN + " -out_file whole.h5 -out_checkpoint_every 300 -out_checkpoint_keep 1000")
    whole = catalogue("whole.h5")
    names = sorted(f for f in os.listdir(".") if f.startswith("whole.chk"))
    check(len(names) > 3, "checkpoints")
    for name in names[:: max(1, len(names) // 4)]:
        run(f"-restart {name} -out_file whole.h5")
        check(same(whole, catalogue("whole.h5")), f"no event lost or doubled after {name}")
    # killed at any moment: rows are whole, and a restart completes them
    for delay in (0.15, 0.3, 0.45):
        for old in os.listdir("."):
            if old.startswith("killed"):
                os.remove(old)
        process = subprocess.Popen([PROGRAM, "run", *words(CHAIN), "-out_file", "killed.h5", "-out_checkpoint_every", "300",
                                    "-out_checkpoint_keep", "1000", "-progress", "off"], stderr=subprocess.DEVNULL)
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        process.wait()
        if not os.path.exists("killed.h5"):
            continue
        part = catalogue("killed.h5")
        rows = len(part["t"])
        check(same({k: v[:rows] for k, v in whole.items()}, {k: v[:rows] for k, v in part.items()}), "rows after a kill")
        names = sorted(f for f in os.listdir(".") if f.startswith("killed.chk"))
        if names:
            run(f"-restart {names[-1]} -out_file killed.h5")
            check(same(whole, catalogue("killed.h5")), "whole after a kill and a restart")


def test_checkpoints_of_before_there_was_a_direction_are_refused():
    run(CHAIN + " -ts_max_time 40 -out_file d.h5 -out_checkpoint_every 200")
    name = sorted(f for f in os.listdir(".") if f.startswith("d.chk"))[0]
    with h5py.File(name, "r+") as file:
        numbers = file["arrays/events.last"][:]
        del file["arrays/events.last"]
        file["arrays/events.last"] = numbers[:5]
    with open(name, "r+b") as file:
        block = checkpoint_block(file.read()[512:])
        file.seek(0)
        file.write(block)
    refused(f"-restart {name} -out_file d.h5", 2, "its events were written by another revision")


def test_pictures_and_fit():
    run(CHAIN + " -out_file whole.h5")
    run(CHAIN + " -friction_seed 2 -out_file one.h5")
    done = tool("events.py", "whole.h5", "one.h5", "-o", "events.png", "--from", 0.2, "--label", "friction_alpha")
    check(done.returncode == 0 and "no b: " in done.stdout and "nan" not in done.stdout, "why there is no fit: " + done.stdout)
    check(os.path.getsize("events.png") > 20000, done.stderr)
    # the fit: 20000 magnitudes of a truncated exponential with b = 0.8
    sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
    import events
    m = np.random.default_rng(1).exponential(1 / 0.8, 40000)
    b, error, number = events.fit(m, 0.5, 3)
    check(abs(b - 0.8) < 3 * error and error < 0.02, f"fit {b} +- {error} of {number}")
    # of one density: per unit of Mw the slope to the base 10 is 3b/2; of eight files the eighth is there, too
    catalogue = {"events": {"t": m, "extent": np.ones(len(m)), "magnitude": m}, "x": np.arange(4), "way": 1.}
    for kind, bounds in (("lnM", (0.5, 3)), ("Mw", (0.5 * 2 / (3 * np.log(10)), 3 * 2 / (3 * np.log(10))))):
        picture = events.Picture(3)
        with contextlib.redirect_stdout(io.StringIO()) as said:
            events.draw_curve(picture, picture.subplots(), [catalogue] * 8, list("abcdefgh"), bounds, kind)
        words = f"b = {b:.3f} +- {error:.3f} (3b/2 = {1.5 * b:.3f} +- {1.5 * error:.3f})"
        check(said.getvalue().count(words) == 8, said.getvalue())
        x, y = picture.axes[0].lines[0].get_data()
        inside = (x > bounds[0]) & (x < bounds[1])
        slope = -np.polyfit(x[inside], np.log10(y[inside]), 1)[0]
        expected = b / np.log(10) if kind == "lnM" else 1.5 * b
        check(abs(slope / expected - 1) < 0.05, f"{kind}: {slope} {expected}")
    done = tool("events.py", "whole.h5", "one.h5", "-o", "e.png", "--csv", "e.csv", "--magnitude", "Mw")
    check(done.stdout.endswith("e.csv\ne.png\n"), done.stdout + done.stderr)
    with open("e.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    with h5py.File("whole.h5") as first, h5py.File("one.h5") as second:
        for name in ("t", "moment", "extent"):
            both = [*first["events"][name][:], *second["events"][name][:]]
            check([float(row[name]) for row in rows] == both, f"{name} in the table")
