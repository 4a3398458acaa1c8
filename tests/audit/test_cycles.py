"""Cycles of random scenes with smooth friction, one node and repeated cells, against SciPy: the motion comes back, and the
multipliers of the cell and of two waves on it are those of the equations linearised and integrated with it."""
import json

import numpy as np

from calls import call, check, data
from reference import System, bloch, read, words


def scene(random):
    """Options of a chain, by name."""
    cell = int(random.choice([1, 1, 2, 3]))
    p = {"model_form": "chain", "model_m": random.uniform(0.5, 2), "model_k0": random.uniform(0.1, 0.6),
         "model_k1": random.uniform(0.01, 0.5), "model_f0": random.uniform(0.7, 1.5), "model_zeta": random.uniform(0, 0.15),
         "model_v": random.uniform(0.2, 0.7), "cycle_cell": cell, "grid_n": 4 * cell, "init_noise": 0.5,
         "init_seed": int(random.integers(1000))}
    if random.random() < 0.4:
        p["model_nu"] = random.uniform(0.005, 0.05)
    kind = ("cubic", "smoothed", "rate")[random.integers(3)]
    if kind == "smoothed":
        p |= {"friction_law": "carlson-langer", "friction_stick": "regularised", "friction_eps": random.uniform(0.03, 0.2)}
    if kind == "rate":
        a, D = random.uniform(0.1, 0.2), random.uniform(0.5, 1.5)
        p |= {"friction_law": "rate-and-state", "friction_a": a, "friction_b": a * random.uniform(1.5, 2.2), "friction_D": D,
              "friction_mu0": 0.6, "friction_psi0": 1, "model_v": random.uniform(0.5, 1.5), "model_zeta": 0}
        p["model_k0"] = (p["friction_b"] - a) / D * p["model_f0"] * random.uniform(0.6, 0.9)
    return p


def apart(found, known):
    """Each of one list from the nearest of the other, both ways, beside the largest."""
    d = abs(found[:, None] - known[None, :])
    return max(d.min(axis=0).max(), d.min(axis=1).max()) / max(1, abs(known).max())


def test_multipliers_of_random_cycles(scenes):
    compared = unstable = 0
    for index, p in scenes(scene, 71, short=3):
        done = call(words(p) + ["-cycle_spectrum", "-cycle_wavenumbers", "8", "-out_file", "c.h5", "-summary", "s.json"], command="cycle")
        if done.returncode == 1:  # no cycle, which it says
            check("no cycle" in done.stderr, done.stderr)
            continue
        check(done.returncode == 0, done.stderr)
        with open("s.json", encoding="utf-8") as file:
            found = json.load(file)
        file, n = data("c.h5"), p["cycle_cell"]
        k, waves = file["spectrum/wavenumber"], file["spectrum/multiplier_re"] + 1j * file["spectrum/multiplier_im"]
        start = read(file, 0)
        end, matrices = System(p | {"grid_n": n}).carried(start, found["period"], [bloch(n, n * x) for x in (0, k[1], k[5])],
                                                           1e-9, 1e-10)
        what = f"scene {index}: {p}"
        check(abs(end - start).max() < 1e-7 * (1 + abs(start).max()), f"{what}: the motion misses by {abs(end - start).max()}")
        mine = [np.array([z["re"] + 1j * z["im"] for z in found["multipliers"]]), waves[1], waves[5]]
        for name, known, matrix in zip(("the cell", "a long wave", "a short wave"), mine, matrices):
            off = apart(known, np.linalg.eigvals(matrix))
            # a kink of a state law where psi passes 0 costs digits, which the phase mode tells
            kink = 3 * found["multiplier_error"] if "friction_b" in p and found["psi_min"] < 0 else 0
            check(off < max(1e-6, kink), f"{what}: multipliers of {name} are off by {off}")
        alike = np.linalg.eigvals(matrices[0])
        others = np.delete(alike, abs(alike - 1).argmin())  # one, of the phase, is 1
        check(found["stable_alike"] == (abs(others).max(initial=0) < 1), what)
        rates = [np.log(abs(np.linalg.eigvals(matrix)).max()) / found["period"] for matrix in matrices[1:]]
        check(found["growth_rate"] > max(rates) - max(1e-7, kink / found["period"]), f"{what}: a wave grows faster than the largest growth rate")
        check(not found["stable"] or max(rates) < 0, what)  # null where it is undecided
        compared += 1
        unstable += not found["stable"]
    check(compared > 2 and unstable > 0, f"{compared} cycles, {unstable} of them unstable")
