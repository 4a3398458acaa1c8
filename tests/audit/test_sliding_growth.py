"""One growth rate of sliding, whoever says it: `run` and `steady_stable` of its file, `spectrum` with and without a grid in
mind, and numpy on the dense matrix of tests/audit/sliding.py, in random scenes whose nodes slide alike. Drawn are velocities
of either sign, chains and continua from 3 nodes on, all orders and ends, with and without viscosity, and laws whose fastest
wave lies between the longest and the shortest. And what no run may say: `sliding` where a wave of the scene grows."""
import os
import sys

import h5py
import numpy as np

from calls import run

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import sliding  # noqa: E402


def draw(random):
    least, most = ((3, 9), (9, 40), (40, 100))[random.integers(3)]
    p = sliding.scene(random, uniform=True, least=least, most=most)
    p["model_v"] *= float(random.choice([-1, 1]))
    p |= {name: p["model_v"] for name in p if name.startswith("bc_") and name.endswith("_value")}
    if random.random() < 0.6:
        p["model_nu"] = float(10**random.uniform(-3, 0.5))
    if p["state_law"] == "contact-age" and random.random() < 0.6:  # waves of finite length
        p |= {"state_b": random.uniform(0.5, 3), "state_D": random.uniform(0.1, 1), "state_theta0": random.uniform(0.1, 1)}
    if p["model_form"] == "continuum":
        p |= {"grid_length": float(10**random.uniform(0, 1.8)), "grid_n": max(p["grid_n"], 2 * p["grid_order"] + 2),
              "model_delta_sign": str(random.choice(["derived", "printed"]))}
    return p


def last_resolved(order, h):
    """The symbol of -D2 at the largest wavenumber whose square root is within 1 % of the wavenumber."""
    k = np.linspace(0, np.pi / h, 200001)[1:]
    s = np.sin(k * h / 2)**2
    symbol = 4 / h**2 * sum(c * s**(j + 1) for j, c in enumerate([1, 1 / 3, 8 / 45, 4 / 35][:order // 2]))
    return symbol[np.sqrt(symbol) >= 0.99 * k].max(initial=0)


def resolved_growth(p, line):
    """Of the waves that the grid resolves: those of the eigenvalues of -D2, each with its own small matrix."""
    n, A, dof = len(line.free), line.A, line.J.shape[0] // len(line.free)
    minus_d2 = -(line.E + line.K0 * np.eye(n)) / line.K1
    N, middle = p.get("model_nu", 0) / A, n // 2
    block = line.J.reshape(dof, n, dof, n)[:, middle, :, middle]

    def of(kappa2):
        J, away = block.copy(), kappa2 - minus_d2[middle, middle]
        J[0, 0] -= A * N * away
        J[1, 0] -= (line.K1 - line.sd * N) * away
        return np.linalg.eigvals(J).real.max()

    symbols = np.linalg.eigvals(minus_d2).real
    return max((of(k) for k in symbols if k <= last_resolved(p["grid_order"], line.h) * (1 + 1e-5) + 1e-9), default=None)


def test_one_growth_rate(scenes):
    between = 0
    for index, p in scenes(draw, 34, short=14):
        line = sliding.Line(p)
        dense = line.eigenvalues()
        every, tolerance = dense.real.max(), max(1e-9, 1e-7 * np.abs(dense).max())
        chain = p["model_form"] == "chain"
        exact = chain or p["grid_order"] == 2 or "velocity" not in (p.get("bc_left"), p.get("bc_right"))
        text = f"scene {index}: {' '.join(sliding.words(p))}"
        off, _ = run(["-spectrum_refine", "off", *sliding.words(p)], command="spectrum")
        assert abs(off["growth_rate"] - every) <= tolerance, f"{text}: {off['growth_rate']} for {every}"
        out, said = run(["-scene_reduce", "off", "-init_psi", "steady", "-init_eta", "steady", "-init_noise", "1e-3",
                         "-ts_max_time", "0.02", "-out_file", "run.h5", "-out_frames", "2", *sliding.words(p)])
        assert out["regime"] != "sliding" or every < tolerance, text
        if not exact:  # the symbol is that of the nodes inside
            continue
        resolved = every if chain else resolved_growth(p, line)
        if resolved is None:
            resolved = every
        assert abs(out["growth_rate"] - resolved) <= tolerance, f"{text}: {out['growth_rate']} for {resolved}"
        on, _ = run(sliding.words(p), command="spectrum", code=None)
        if on and on["growth_rate"] is not None:
            assert abs(on["growth_rate"] - out["growth_rate"]) <= tolerance, f"{text}: {on['growth_rate']} in spectrum"
        with h5py.File("run.h5") as file:
            assert abs(every) < tolerance or file.attrs["steady_stable"] == (every < 0), text
        assert ("carries but does not resolve, grow" in said) == (resolved <= 0 < every), f"{text}: {said}"
        between += every > tolerance
    assert between, "some were unstable"
