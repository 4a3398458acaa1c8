"""Cycles that motions of random unlike blocks settle on, with smooth friction and with rests: see settling.py."""
import json

import h5py
import numpy as np

from calls import call, check, data, run
from reference import words
from settling import compare, scene


def test_what_motions_of_unlike_blocks_settle_on(scenes):
    found = sum(compare(p, f"scene {index}") for index, p in scenes(scene, 661, short=8))
    check(found > 0, "no cycle")


def rests(random):
    """Options of one to three blocks with exact stick, half of them under a load."""
    n, law = int(random.integers(1, 4)), str(random.choice(["carlson-langer", "coulomb", "stribeck"]))
    v = np.exp(random.uniform(np.log(0.05), np.log(0.8)))
    p = {"model_form": "chain", "grid_n": n, "model_k0": random.uniform(0.1, 0.6), "model_f0": random.uniform(0.5, 1.5),
         "model_m": random.uniform(0.5, 2), "model_zeta": random.uniform(0, 0.2), "model_v": v, "friction_law": law}
    p |= {"carlson-langer": {"friction_alpha": random.uniform(0.2, 1), "friction_sigma": random.uniform(0, 0.3)},
          "coulomb": {"friction_fd": random.uniform(0.5, 0.9)},
          "stribeck": {"friction_fs": 1, "friction_fc": random.uniform(0.4, 0.8), "friction_vs": random.uniform(0.1, 1)}}[law]
    if n > 1:
        p |= {"bc_left": "free", "model_k1": random.uniform(0.05, 1), "friction_amplitude": random.uniform(0.7, 1.3, n)}
    if random.random() < 0.4:
        p |= {"state_law": "contact-age", "state_b": random.uniform(0.03, 0.2), "state_theta0": random.uniform(0.5, 2),
              "state_D": random.uniform(0.5, 2)}
    if random.random() < 0.5:
        load = str(random.choice(["load", "load_force", "load_normal"]))
        p |= {f"{load}_sine_amplitude": random.uniform(0.02, 0.3) * (v if load == "load" else 1),
              f"{load}_sine_period": random.uniform(2, 20)}
    return p


def test_extremes_of_cycles_with_rests(scenes):
    """Those of the motion in twenty thousand frames of a run over one period, where it comes back."""
    compared = 0
    for index, p in scenes(rests, 662, short=8):
        start = ["-init_psi", "0.5"] + (["-init_noise", "0.2"] if p["grid_n"] > 1 else [])
        done = call(words(p) + start + ["-cycle_cell", "0", "-out_file", "c.h5", "-summary", "s.json"], command="cycle")
        if done.returncode == 1:
            check("no cycle" in done.stderr, f"scene {index}: {done.stderr}: {p}")
            continue
        file = data("c.h5")
        with open("s.json", encoding="utf-8") as summary:
            found = json.load(summary)
        run(words(p) + ["-ts_max_time", "1e-3", "-out_frames", "2", "-out_file", "start.h5"])
        with h5py.File("start.h5", "r+") as begin:
            for name in ("psi", "eta", "theta"):
                if name in begin:
                    begin[name][:] = file[name][0]
        run(words(p) + ["-init_type", "file", "-init_file", "start.h5", "-init_frame", "0", "-ts_max_time", repr(found["period"]),
                        "-ts_rtol", "1e-11", "-ts_atol", "1e-12", "-out_frames", "20001", "-out_file", "r.h5"])
        seen = data("r.h5")
        psi, force, size = seen["psi"], seen["eta"].mean(axis=1), np.ptp(seen["psi"])
        if abs(psi[-1] - psi[0]).max() > 1e-7 * size:  # a cycle that repels
            continue
        # an extremum lies by an eighth of the second difference beyond the frames at most
        between = [abs(np.diff(values, 2, axis=0)).max() / 8 + 1e-7 * size for values in (psi, force)]
        off = {"psi_max": abs(found["psi_max"] - psi.max()), "psi_min": abs(found["psi_min"] - psi.min()),
               "amplitude": abs(found["amplitude"] - np.ptp(psi, axis=0).max() / 2), "force_drop": abs(found["force_drop"] - np.ptp(force)) / 2}
        for name, value in off.items():
            check(value < between[name == "force_drop"], f"scene {index}: {name} is off by {value}, not {between}: {p}")
        compared += 1
    check(compared > 0, "no cycle that stays")
