"""Friction that sticks, in the continuum and in chains, against an integration of its own (reference.Stick)."""
import numpy as np

import calls
from reference import Stick, System, read, words


def draw(random):
    chain = bool(random.random() < 0.3)
    p = {"model_form": "chain" if chain else "continuum", "grid_n": int(random.integers(9, 21)),
         "bc_left": "periodic" if random.random() < 0.5 else "free", "model_v": random.uniform(0.02, 0.3),
         "friction_law": str(random.choice(["coulomb", "carlson-langer"])), "friction_spread": random.uniform(0.05, 0.3),
         "friction_seed": int(random.integers(1, 10**6)), "scene_reduce": "off"}
    if p["friction_law"] == "coulomb":
        p |= {"friction_fs": 1, "friction_fd": random.uniform(0.4, 1)}
    else:
        p |= {"friction_sigma": random.uniform(0, 0.2), "friction_alpha": random.uniform(0.2, 1)}
    if random.random() < 0.3:
        p |= {"state_law": "healing", "state_t_h": random.uniform(1, 5), "state_tau_inf": random.uniform(1.2, 2),
              "state_D": random.uniform(0.3, 2)}
    if chain:
        p |= {"model_m": random.uniform(0.5, 2), "model_k0": random.uniform(0.1, 1), "model_k1": random.uniform(0.2, 2),
              "model_f0": random.uniform(0.5, 1.5), "model_zeta": float(random.choice([0, 0.2]))}
    else:
        p |= {"grid_order": int(random.choice([2, 4, 6, 8])), "model_gamma": random.uniform(0.5, 2),
              "model_c": random.uniform(0.5, 1.5), "model_delta": float(random.choice([0, random.uniform(0.05, 0.3)])),
              "model_delta_sign": str(random.choice(["derived", "printed"])), "grid_length": random.uniform(5, 10)}
        p["friction_spread_length"] = p["grid_length"] / 6
    if random.random() < 0.3:
        p["model_nu"] = 10**random.uniform(-2, -0.5)
    return p, {"init_type": "sine", "init_psi": random.uniform(0, 0.3), "init_amplitude": random.uniform(0.05, 0.6),
               "init_eta": random.uniform(-0.3, 0.6), "ts_max_time": random.uniform(2, 5)}


def amplitudes(p):
    """The factors of the thresholds, from sliding at psi = 1 without a state."""
    p = {name: value for name, value in p.items() if not name.startswith("state_")} | {"init_psi": 1, "init_eta": "steady"}
    calls.run(words(p) + ["-ts_max_time", 0, "-out_file", "a.h5"])
    system = System(p)
    return (calls.data("a.h5")["eta"][0] - system.B) / system.law.force(1., 0.)


def test_motion(scenes):
    total = 0
    for index, (p, start) in scenes(draw, salt=610, short=7):
        frames = 5
        calls.run(words(p | start) + ["-ts_rtol", 1e-11, "-ts_atol", 1e-12, "-out_frames", frames, "-out_file", "s.h5"])
        found = calls.data("s.h5")
        motion = Stick(System(p, amplitudes(p)), read(found, 0))
        for k in range(1, frames):
            u = motion.advance(found["t"][k])
            for name, values, own in zip(("psi", "eta", "tau"), read(found, k).reshape(-1, p["grid_n"]),
                                         u.reshape(-1, p["grid_n"])):
                error = np.abs(values - own).max()
                assert error < 1e-6, f"scene {index} {p}: {name} off by {error:.2g} at t = {found['t'][k]}"
            assert ((found["psi"][k] == 0) == motion.rests).all(), f"scene {index} {p}: who rests at t = {found['t'][k]}"
        total += motion.changes
    print(total, "changes")
    assert total > 20
