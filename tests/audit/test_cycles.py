"""Cycles of random scenes with smooth friction, one node and repeated cells, against SciPy: the motion comes back, and the
multipliers of the cell and of two waves on it are those of the equations linearised by complex steps and integrated with it."""
import json

import h5py
import numpy as np
from scipy.integrate import solve_ivp

from calls import call, check

TOLERANCE = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}


def scene(random):
    """Options of a chain, by name; the friction F(psi, s) of a stored state s, and s_t."""
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


def rates_of(p):
    """f(y, twist): the unknowns psi, eta (and s = ln theta), all of one kind behind each other; a neighbour in the next cell is
    `twist` times as large in deviations, which are what is linear in D2 psi."""
    n, f0, m = p["cycle_cell"], p["model_f0"], p["model_m"]
    state = p.get("friction_law") == "rate-and-state"

    def d2(q, twist):
        return np.append(q[1:], q[0] * twist) + np.append(q[-1] / twist, q[:-1]) - 2 * q

    def friction(psi, s):
        if state:
            a = p["friction_a"]
            x = psi / 2 * np.exp((0.6 + p["friction_b"] * (s - np.log(p["friction_D"]))) / a)
            sign = np.sign(x.real)
            return a * sign * np.log(sign * x + np.sqrt(1 + x * x))
        if "friction_eps" in p:
            t = np.tanh(psi / p["friction_eps"])
            return t / (1 + psi * t)
        return psi**3 / 3 - psi

    def rates(y, twist=1):
        psi, eta, s = y[:n], y[n:2 * n], y[2 * n:]
        pull = d2(psi, twist)
        out = [(f0 * (eta - friction(psi, s)) + p.get("model_nu", 0) * pull - p["model_zeta"] * psi) / m,
               (p["model_k0"] * (p["model_v"] - psi) + p["model_k1"] * pull) / f0]
        if state:
            out.append(np.exp(-s) - np.sign(psi.real) * psi / p["friction_D"])
        return np.concatenate(out)
    return rates


def carried(rates, start, period, n, twists):
    """The end of the motion, and the matrices that take deviations with each twist round."""
    N, e, count = len(start), 1e-30, len(twists)

    def slope(y):
        return np.array([rates(y + 1j * e * unit).imag / e for unit in np.eye(N)]).T
    zero = np.zeros(N)
    beside = [np.array([rates(unit, t) - rates(zero, t) - rates(unit + 0j) + rates(zero + 0j) for unit in np.eye(N)]).T
              for t in twists]  # linear: what the other cells change

    def together(t, z):
        y = z[:N].real
        J = slope(y)
        Y = z[N:].reshape(count, N, N)
        return np.concatenate([rates(y + 0j).real, np.concatenate([((J + B) @ M).ravel() for B, M in zip(beside, Y)])])
    z = np.concatenate([start, np.tile(np.eye(N).ravel(), count)]).astype(complex)
    end = solve_ivp(together, (0, period), z, **TOLERANCE).y[:, -1]
    return end[:N].real, end[N:].reshape(count, N, N)


def apart(found, known):
    """Each of one list from the nearest of the other, both ways, beside the largest."""
    d = abs(found[:, None] - known[None, :])
    return max(d.min(axis=0).max(), d.min(axis=1).max()) / max(1, abs(known).max())


def test_multipliers_of_random_cycles(scenes):
    compared = unstable = 0
    for index, p in scenes(scene, 71, short=6):
        words = [w for name, value in p.items() for w in ("-" + name, str(value))]
        done = call(words + ["-cycle_spectrum", "-cycle_wavenumbers", "8", "-out_file", "c.h5", "-summary", "s.json"], command="cycle")
        if done.returncode == 1:  # no cycle, which it says
            check("no cycle" in done.stderr, done.stderr)
            continue
        check(done.returncode == 0, done.stderr)
        with open("s.json", encoding="utf-8") as file:
            found = json.load(file)
        with h5py.File("c.h5") as file:
            start = [file["psi"][0], file["eta"][0]] + ([np.log(file["theta"][0])] if "theta" in file else [])
            k = file["spectrum/wavenumber"][...]
            waves = file["spectrum/multiplier_re"][...] + 1j * file["spectrum/multiplier_im"][...]
        start, n = np.concatenate(start), p["cycle_cell"]
        twists = [1, np.exp(1j * n * k[1]), np.exp(1j * n * k[5])]
        end, matrices = carried(rates_of(p), start, found["period"], n, twists)
        what = f"scene {index}: {p}"
        check(abs(end - start).max() < 1e-7 * (1 + abs(start).max()), f"{what}: the motion misses by {abs(end - start).max()}")
        mine = [np.array([z["re"] + 1j * z["im"] for z in found["multipliers"]]), waves[1], waves[5]]
        for name, known, matrix in zip(("the cell", "a long wave", "a short wave"), mine, matrices):
            off = apart(known, np.linalg.eigvals(matrix))
            # a kink of a state law where psi passes 0 costs digits, which the phase mode tells
            kink = 3 * found["multiplier_error"] if "friction_b" in p and found["psi_min"] < 0 else 0
            check(off < max(1e-6, kink), f"{what}: multipliers of {name} are off by {off}")
        largest = np.sort(abs(np.linalg.eigvals(matrices[0])))[::-1]
        check(found["stable_alike"] == (len(largest) < 2 or largest[1] < 1), what)
        rates = [np.log(abs(np.linalg.eigvals(matrix)).max()) / found["period"] for matrix in matrices[1:]]
        check(found["growth_rate"] > max(rates) - max(1e-7, kink / found["period"]), f"{what}: a wave grows faster than the largest growth rate")
        check(not found["stable"] or max(rates) < 0, what)  # null where it is undecided
        compared += 1
        unstable += not found["stable"]
    check(compared > 2 and unstable > 0, f"{compared} cycles, {unstable} of them unstable")
