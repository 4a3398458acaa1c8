"""Checkpoints between numbers of ranks: random scenes of every kind of friction, end, load and profile, with
slip events. From a checkpoint in the middle as many ranks go on to the last bit in everything that is written;
another number of ranks does so in the fields and probes of steps of fixed size."""
import glob
import os
import shutil

import numpy as np
import pytest

from calls import call, data, run, same

METHODS = ("rk:4", "rk:5dp", "rk:3bs", "euler", "ssp:rks2", "arkimex:4:friction", "rosw:ra34pw2")
AS_MANY = ("t_end", "steps", "rejections", "rhs_evaluations", "psi_min", "psi_max", "psi_mean", "eta_mean",
           "probes", "regime", "amplitude")


def draw(random):
    """(options, ranks, other ranks, steps between checkpoints, whether steps have a fixed size)"""
    u, choice = random.uniform, random.choice
    n, v, chain = int(random.integers(9, 60)), choice([-1, 1]) * u(0.1, 1.3), random.random() < 0.5
    length, sticks = n - 1 if chain else u(6, 30), random.random() < 0.6
    p = {"grid_n": n, "model_v": v, "scene_reduce": "off", "init_noise": u(0.05, 0.4), "out_frames": 7,
         "init_seed": random.integers(99), "out_probes": f"{0.2 * length},{0.7 * length}",
         "ts_max_steps": 4000}
    if chain:
        p |= {"model_form": "chain", "model_m": u(0.5, 2), "model_k0": u(0.1, 1),
              "model_k1": u(0.1, 2), "model_f0": u(0.6, 1.5), "model_zeta": u(0, 0.4)}
    else:
        p |= {"grid_length": length, "model_gamma": u(0.5, 4), "model_c": u(0.5, 2),
              "model_delta": u(0, 0.3), "grid_order": choice([2, 4, 6])}
    ends = random.integers(3)
    p |= ({}, {"bc_left": "free"}, {"bc_left": "velocity", "bc_left_value": u(-1, 1)})[ends]
    if sticks:
        p |= {"friction_law": choice(["carlson-langer", "coulomb"]), "out_events": "true", "init_psi": 0,
              "init_eta": u(-0.4, 0.4), "state_law": choice(["none", "healing", "contact-age"])}
    elif random.random() < 0.5:
        p |= {"friction_law": "rate-and-state", "friction_a": u(0.1, 0.2), "friction_D": u(0.3, 1),
              "friction_b": u(0.05, 0.3), "state_law": choice(["ageing", "slip"]), "init_psi": v}
    if random.random() < 0.5:
        p |= {"friction_spread": u(0.05, 0.5), "friction_seed": random.integers(99)}
    else:
        p["friction_amplitude_profile"] = ",".join(f"{x * length}:{u(0.6, 1.5)}" for x in (0.1, 0.5, 0.8))
    if random.random() < 0.4:
        p["model_nu"] = u(0.01, 0.3)
    if random.random() < 0.5:
        p |= {"load_sine_amplitude": u(0.05, 0.4), "load_sine_period": u(0.7, 5), "out_displacement": "true"}
    p["ts_max_time"] = u(4, 15) if sticks else u(2, 5)
    fixed = random.random() < 0.5
    if fixed:
        p |= {"ts_adapt_type": "none", "ts_dt": choice([0.02, 0.01])}
        p |= method(choice(METHODS[:4] if sticks else METHODS[:6 if "model_nu" in p or "load_sine_amplitude" in p else 7]))
    ranks = [int(k) for k in random.integers(1, 5, 2)]
    return p, *ranks, int(random.integers(5, 30)), fixed


def method(name):
    kind, *rest = name.split(":")
    return {"ts_type": kind} | ({f"ts_{kind}_type": rest[0]} if rest else {}) | \
        ({"imex_implicit": rest[1]} if len(rest) > 1 else {})


def check(index, p, ranks, others, every, fixed):
    words = [word for name, value in p.items() for word in (f"-{name}", str(value))]
    text = f"scene {index}, {ranks} ranks, then {others}: {' '.join(words)}"
    for name in glob.glob("w.*") + glob.glob("o.*"):
        os.remove(name)
    words += ["-out_checkpoint_every", str(every), "-out_checkpoint_keep", "100000", "-out_file", "w.h5"]
    done = call([*words, "-check"])
    if done.returncode == 2:
        return False
    whole, _ = run(words, ranks, code=None)
    checkpoints = sorted(glob.glob("w.chk-*.h5"))
    if whole["status"] == "failed" or len(checkpoints) < 3:
        return False
    middle, reference = checkpoints[len(checkpoints) // 2], data("w.h5")
    shutil.copy("w.h5", "o.h5")
    again, _ = run(["-restart", middle, "-out_file", "w.h5"], ranks)
    same(reference, data("w.h5"), text)
    differing = [key for key in AS_MANY if whole[key] != again[key]]
    assert not differing, f"{text}: {differing} in the summary"
    run(["-restart", middle, "-out_file", "w.h5"], others)
    other = data("w.h5")
    assert set(other) == set(reference), text
    if fixed:
        for name in ("t", "psi", "eta", "probes/psi", "probes/eta", "events/begin", "events/left"):
            if name in other:
                assert np.array_equal(other[name], reference[name]), f"{text}: {name} differs"
    return True


@pytest.mark.ranks
def test_as_many_ranks_and_others(scenes):
    assert sum(check(index, *drawn) for index, drawn in scenes(draw, 341, 3)) >= 2
