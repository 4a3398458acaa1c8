"""One growth rate of sliding, whoever says it: `run` and `steady_stable` of its file, `spectrum` with and without a grid in
mind, and numpy on the dense matrix of tests/reference.py, in random scenes whose nodes slide alike. Drawn are velocities
of either sign, chains and continua from 3 nodes on, all orders and ends, with and without viscosity, and laws whose fastest
wave lies between the longest and the shortest. And what no run may say: `sliding` where a wave of the scene grows."""
import h5py
import numpy as np

import reference
from calls import run

from . import sliding


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


def resolved_growth(p, system):
    """Of the waves that the grid resolves: those of the eigenvalues of -D2, each with its own small matrix."""
    symbols = np.linalg.eigvals(-system.D[np.ix_(system.free, system.free)]).real
    carried = symbols[symbols <= last_resolved(p["grid_order"], system.h) * (1 + 1e-5) + 1e-9]
    return np.linalg.eigvals(reference.waves(p, carried)).real.max() if len(carried) else None


def test_one_growth_rate(scenes):
    between = 0
    for index, p in scenes(draw, 34, short=8):
        system = reference.System(p)
        dense = system.eigenvalues()
        every, tolerance = dense.real.max(), max(1e-9, 1e-7 * np.abs(dense).max())
        chain = p["model_form"] == "chain"
        exact = chain or p["grid_order"] == 2 or "velocity" not in (p.get("bc_left"), p.get("bc_right"))
        text = f"scene {index}: {' '.join(reference.words(p))}"
        off, _ = run(["-spectrum_refine", "off", *reference.words(p)], command="spectrum")
        assert abs(off["growth_rate"] - every) <= tolerance, f"{text}: {off['growth_rate']} for {every}"
        out, said = run(["-scene_reduce", "off", "-init_psi", "steady", "-init_eta", "steady", "-init_noise", "1e-3",
                         "-ts_max_time", "0.02", "-out_file", "run.h5", "-out_frames", "2", *reference.words(p)])
        assert out["regime"] != "sliding" or every < tolerance, text
        if not exact:  # the symbol is that of the nodes inside
            continue
        resolved = every if chain else resolved_growth(p, system)
        if resolved is None:
            resolved = every
        assert abs(out["growth_rate"] - resolved) <= tolerance, f"{text}: {out['growth_rate']} for {resolved}"
        on, _ = run(reference.words(p), command="spectrum", code=None)
        if on and on["growth_rate"] is not None:
            assert abs(on["growth_rate"] - out["growth_rate"]) <= tolerance, f"{text}: {on['growth_rate']} in spectrum"
        with h5py.File("run.h5") as file:
            assert abs(every) < tolerance or file.attrs["steady_stable"] == (every < 0), text
        assert ("carries but does not resolve, grow" in said) == (resolved <= 0 < every), f"{text}: {said}"
        between += every > tolerance
    assert between, "some were unstable"
