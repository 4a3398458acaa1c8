"""The catalogue of slip events (out_events): known events, any number of ranks, restart, kill -9, pictures."""
import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from calls import PROGRAM, SOURCE, check, checkpoint_block, refused, run, scene_file, words


def catalogue(path):
    with h5py.File(path) as file:
        return {name: data[:] for name, data in file["events"].items()}


def same(a, b, tolerance=0):
    return all(len(a[k]) == len(b[k]) and np.allclose(a[k], b[k], rtol=tolerance, atol=tolerance, equal_nan=True)
               for k in a)


CHAIN = (scene_file("catalogue") + " -grid_n 60 -model_v 0.01 -ts_max_time 150 -friction_spread 0.1"
         " -out_frames 31")


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
    done = subprocess.run(["/usr/bin/python3", "-B", os.path.join(SOURCE, "postprocess", "events.py"), "whole.h5", "one.h5",
                           "-o", "events.png", "--from", "0.2", "--label", "friction_alpha"], capture_output=True, text=True)
    check(done.returncode == 0 and "no b: " in done.stdout and "nan" not in done.stdout, "why there is no fit: " + done.stdout)
    check(os.path.getsize("events.png") > 20000, done.stderr)
    # the fit: 20000 magnitudes of a truncated exponential with b = 0.8
    sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
    import events
    m = np.random.default_rng(1).exponential(1 / 0.8, 40000)
    b, error, number = events.fit(m, 0.5, 3)
    check(abs(b - 0.8) < 3 * error and error < 0.02, f"fit {b} +- {error} of {number}")
