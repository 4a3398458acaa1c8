"""The largest transient growth and its time against numpy's exponentials in the energy norm, sampled finely and refined."""
import json

import h5py
import numpy as np
from scipy.optimize import minimize_scalar

import reference
from calls import call

from . import sliding


def draw(random):
    p = sliding.scene(random, uniform=random.random() < 0.4, least=9, most=22)
    if "velocity" in (p.get("bc_left"), p.get("bc_right")):
        p |= {"grid_order": 2} if p["model_form"] == "continuum" else {}
    if p["friction_law"] == "cubic":
        p["model_v"] = random.uniform(1.02, 1.6)
    elif p["model_form"] == "chain":
        p["model_zeta"] = random.uniform(0.5, 2)
    if random.random() < 0.4:
        p["model_nu"] = random.uniform(0.005, 0.6)
    if p["model_form"] == "continuum" and random.random() < 0.4:
        p["model_delta_sign"] = "printed"
    return mirrored(p) if random.random() < 0.5 else p


def mirrored(p):
    """The scene whose motion is to the left where that of p is to the right."""
    return p | {name: -p[name] for name in ("model_v", "bc_left_value", "bc_right_value") if name in p}


def in_energy_norm(system):
    """The Jacobian in variables whose sum of squares is the energy; an age of contacts counts by its logarithm."""
    m, J, w = len(system.free), system.operator(), np.ones(len(system.free))
    if system.p["model_form"] == "continuum":  # a free end's node stands for half a cell
        w[[0, -1]] = [0.5 if end == "free" else 1 for end in system.ends]
    stiffness = (system.K0 * np.eye(system.n) - system.K1 * system.D)[np.ix_(system.free, system.free)]
    T = np.kron(np.eye(system.kinds), np.diag(np.sqrt(w)))
    T[:m, :m] = np.linalg.cholesky(w[:, None] * stiffness / system.A).T
    return T @ J @ np.linalg.inv(T)


def largest(J):
    """Largest |exp(J t)| and its time."""
    values, V = np.linalg.eig(J)
    W = np.linalg.inv(V)

    def g(t):
        return np.linalg.norm((V * np.exp(values * t)) @ W, 2)
    abscissa = np.linalg.eigvalsh((J + J.T) / 2).max()
    if abscissa < 1e-9:
        return abscissa, 1, 0
    h, t, norms = min(0.03 / abscissa, 0.1 / np.abs(values).max()), [0], [1]
    while len(t) < 3000 and (norms[-1] > 1 or len(t) < 2):
        t.append(t[-1] + h)
        norms.append(g(t[-1]))
    best = (1, 0)
    for k in sorted(range(1, len(t) - 1), key=lambda k: -norms[k])[:4]:
        top = minimize_scalar(lambda s: -g(s), bounds=(t[k - 1], t[k + 1]), method="bounded", options={"xatol": 1e-8})
        best = max(best, (-top.fun, top.x))
    return abscissa, *best


def check(index, p):
    words = reference.words(p)
    done = call(["-summary", "s.json", "-out_file", "s.h5", "-spectrum_refine", "off", "-spectrum_transient", "true",
                 *words], command="spectrum")
    if done.returncode == 1 and "no steady sliding" in done.stderr:
        return False
    assert done.returncode == 0, f"scene {index}: {words}: {done.stderr}"
    with open("s.json", encoding="utf-8") as file:
        summary = json.load(file)
    found = summary["transient"]
    if not found:
        return False
    with h5py.File("s.h5") as file:
        a = reference.amplitudes(p, file["steady_psi"][...], file["steady_eta"][...])
    J = in_energy_norm(reference.System(p, a))
    text = f"scene {index}: {' '.join(words)}: {found}"
    if not summary["stable"] or summary["growth_rate"] > -1e-3:
        return False
    abscissa, growth, time = largest(J)
    text += f" against {abscissa} {growth} {time}"
    assert abs(found["numerical_abscissa"] - abscissa) < 1e-7 * (1 + np.abs(J).max()), text
    assert abs(found["growth"] - growth) < 2e-6 * growth, text
    if growth > 1.001:  # ln g is a parabola at its top: the time is known to the root of what the growth is
        assert abs(found["time"] - time) < 5e-3 * (time + 1 / abscissa), text
    return growth > 1.001


def test_largest_growth_and_its_time(scenes):
    grows = [check(index, p) for index, p in scenes(draw, 33)]
    assert sum(grows) >= 0.15 * len(grows)
