"""Random scenes of `boundary` against growth rates computed here: matrices built from the equations, with derivatives by
complex steps, and roots by Brent's method. No code is shared with the program; only the factors of spread friction, whose
generator is the program's, are read from its files."""
import json
import os

import numpy as np
from scipy.optimize import brentq

from calls import call, data


# ---- the equations of one node ---------------------------------------------------------------------------------------

def friction(s, psi, state):
    """F and the rate of the state, for psi > 0 where the law has a threshold; analytic, so that complex steps work."""
    if s["law"] == "rate-and-state":
        F = s["a"] * np.arcsinh(psi / 2 * np.exp((0.6 + s["b"] * np.log(state / s["D"])) / s["a"]))
        u = psi * state / s["D"]
        return F, 1 - u if s["state"] == "ageing" else -u * np.log(u)
    phi = psi**3 / 3 - psi if s["law"] == "cubic" else 1 / (1 + psi)
    if s["state"] == "none":
        return phi, 0
    sign = np.where(np.real(psi) < 0, -1, 1)
    if s["state"] == "healing":
        return state * phi, (s["tau_inf"] - state) / s["t_h"] - sign * psi / s["D"] * (state - 1)
    return (1 + s["b"] * np.log(1 + state / s["theta0"])) * phi, 1 - sign * psi * state / s["D"]


def steady_state(s, psi):
    if s["state"] == "none":
        return np.zeros_like(psi)
    if s["state"] == "healing":
        return (s["tau_inf"] / s["t_h"] + abs(psi) / s["D"]) / (1 / s["t_h"] + abs(psi) / s["D"])
    return s["D"] / abs(psi)


def derivatives(s, psi):
    """F_psi, F_state, g_psi, g_state about steady sliding."""
    state, h = steady_state(s, psi), 1e-30
    of_psi, of_state = friction(s, psi + 1j * h, state), friction(s, psi, state + 1j * h)
    return [np.imag(x) / h * np.ones_like(psi) for x in (of_psi[0], of_state[0], of_psi[1], of_state[1])]


def coefficients(s):
    """A, B, K0, K1, s delta."""
    if s["form"] == "chain":
        return s["f0"] / s["m"], s["zeta"] / s["f0"], s["k0"] / s["f0"], s["k1"] / s["f0"], 0.
    return s["gamma"], 0., 1 / s["gamma"], s["c"]**2 / s["gamma"], s["delta"]


def eigenvalues(s, psi, amplitude, stencil):
    """Of the whole operator; stencil: D2 among the nodes solved for, as a matrix, or a column of scalars -k^2 (a batch)."""
    A, B, K0, K1, sd = coefficients(s)
    n = psi.size
    Fp, Fs, gp, gs = derivatives(s, psi)
    Fp, Fs = amplitude * Fp, amplitude * Fs
    one = np.eye(n)
    batch = stencil.shape[:-2]
    dims = (2 if s["state"] == "none" else 3) * n
    J = np.zeros((*batch, dims, dims))
    J[..., :n, :n] = -A * (B * one + np.diag(Fp))
    J[..., :n, n:2 * n] = A * one
    J[..., n:2 * n, :n] = -K0 * one + K1 * stencil + sd * np.diag(Fp)
    J[..., n:2 * n, n:2 * n] = -sd * one
    if dims > 2 * n:
        J[..., :n, 2 * n:] = -A * np.diag(Fs)
        J[..., n:2 * n, 2 * n:] = sd * np.diag(Fs)
        J[..., 2 * n:, :n] = np.diag(gp)
        J[..., 2 * n:, 2 * n:] = np.diag(gs)
    return np.linalg.eigvals(J)


# ---- uniform continua: every wave that fits ---------------------------------------------------------------------------

def wave_growth(s, waves):
    v = np.array([s["v"]])
    return eigenvalues(s, v, 1., -(np.asarray(waves, float)**2)[:, None, None]).real.max(axis=1)


def supremum(s):
    """Largest growth over all waves, and its wavenumber (infinite for the limit)."""
    unit = (2 if s["ends"] == ("periodic", "periodic") else 1) * np.pi / s["length"]
    held = [end == "velocity" for end in s["ends"]]
    first = 1 if all(held) else 0.5 if any(held) else 0
    top = max(100, int(1e4 / unit))  # beyond, round-off outweighs what is left of the way to the limit
    j = np.unique(np.concatenate([np.arange(64), np.geomspace(64, top, 200).astype(np.int64)]))
    for _ in range(4):  # between the neighbours of the best wave the growth rate has one maximum
        growth = wave_growth(s, unit * (first + j))
        best = int(np.argmax(growth))
        value, wave = growth[best], unit * (first + j[best])
        low, high = j[max(best - 1, 0)], j[min(best + 1, j.size - 1)]
        if high - low <= 2:
            break
        j = np.unique(np.linspace(low, high, 200).astype(np.int64))
    far = 300 * max(1, 1 / s["c"]) * (1 + s["gamma"] + abs(s["v"]) / s.get("D", 1) + 1 / s.get("t_h", 1))
    one, two = wave_growth(s, [far, 2 * far])
    limit = (4 * two - one) / 3  # the error is of order 1/k^2
    return (limit, np.inf) if limit > value + 1e-11 else (value, wave)


# ---- lines of nodes ---------------------------------------------------------------------------------------------------

WEIGHTS = {2: [-2, 1], 4: [-5 / 2, 4 / 3, -1 / 12], 6: [-49 / 18, 3 / 2, -3 / 20, 1 / 90],
           8: [-205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]}


def second_difference(s, n):
    """D2 on all n nodes."""
    ring, p = s["ends"][0] == "periodic", s["order"]
    D = np.zeros((n, n))

    def halo(j):
        if 0 <= j < n:
            return {j: 1.}
        if ring:
            return {j % n: 1.}
        if j >= n:
            return {n - 1 - i: w for i, w in mirrored(n - 1 - j, s["ends"][1]).items()}
        return mirrored(j, s["ends"][0])

    def mirrored(j, end):  # beyond the left end
        if s["form"] == "chain":
            return {0: 1.}
        if end == "free":
            return {-j: 1.}
        return {i: np.prod([(j - m) / (i - m) for m in range(p) if m != i]) for i in range(p)}

    for i in range(n):
        for k in range(-(p // 2), p // 2 + 1):
            for node, weight in halo(i + k).items():
                D[i, node] += WEIGHTS[p][abs(k)] * weight
    h = 1 if s["form"] == "chain" else s["length"] / (n if ring else n - 1)
    return D / h**2


def resolved_frequency(s, n):
    """Of the wave whose frequency on the grid is 1 % low."""
    A, _, K0, K1, _ = coefficients(s)
    h = s["length"] / (n if s["ends"][0] == "periodic" else n - 1)
    w = WEIGHTS[s["order"]]

    def kappa2(k):
        return -(w[0] + 2 * sum(x * np.cos(j * k * h) for j, x in enumerate(w) if j > 0)) / h**2
    k = brentq(lambda k: np.sqrt(kappa2(k)) / k - 0.99, 1e-2 / h, np.pi / h, xtol=1e-14)
    return np.sqrt(A * (K0 + K1 * kappa2(k)))


def line_growth(s, amplitude):
    """Largest real part among the modes that count."""
    n = amplitude.size
    D = second_difference(s, n)
    held = [i for i, end in ((0, s["ends"][0]), (n - 1, s["ends"][1])) if end == "velocity"]
    free = [i for i in range(n) if i not in held]
    A, _, K0, K1, _ = coefficients(s)
    psi = np.full(n, s["v"])
    for i, value in zip((0, n - 1), s["values"]):
        if i in held:
            psi[i] = value
    if held:
        M = K0 * np.eye(n) - K1 * D
        psi[free] = np.linalg.solve(M[np.ix_(free, free)], K0 * s["v"] - M[np.ix_(free, held)] @ psi[held])
    values = eigenvalues(s, psi[free], amplitude[free], D[np.ix_(free, free)])
    if s["form"] == "continuum" and s["refine"] == "auto":
        values = values[abs(values.imag) <= resolved_frequency(s, n)]
    return values.real.max()


# ---- scenes -----------------------------------------------------------------------------------------------------------

def law_of(g):
    law, state = [("cubic", "none"), ("cubic", "contact-age"), ("carlson-langer", "none"),
                  ("carlson-langer", "contact-age"), ("carlson-langer", "healing"), ("rate-and-state", "ageing"),
                  ("rate-and-state", "slip")][g.integers(7)]
    s = {"law": law, "state": state}
    if state != "none":
        s.update(D=g.uniform(0.3, 3), b=g.uniform(0.1, 1.5), theta0=g.uniform(0.3, 3), t_h=g.uniform(0.3, 3),
                 tau_inf=g.uniform(1.2, 3))
    if law == "rate-and-state":
        s.update(a=g.uniform(0.05, 0.3), D=g.uniform(0.05, 1))
        s["b"] = s["a"] * g.uniform(0.5, 3)
    return s


def uniform_scene(g):
    s = law_of(g)
    s.update(form="continuum", gamma=g.uniform(0.3, 4), c=g.uniform(0.3, 3), length=g.uniform(3, 60),
             delta=g.choice([0., g.uniform(0, 0.6)]), order=int(g.choice([2, 4, 6])), v=g.uniform(0.2, 2), refine="auto",
             ends=[("periodic", "periodic"), ("free", "free"), ("velocity", "velocity"),
                   ("velocity", "free")][g.integers(4)], n=int(g.integers(24, 65)))
    s["vary"] = str(g.choice(["v", "gamma", "delta"] + (["D", "b"] if s["state"] != "none" else [])))
    return s


def line_scene(g):
    s = law_of(g)
    s["form"] = str(g.choice(["chain", "continuum"]))
    held = g.random() < 0.6
    s["ends"] = [("velocity", "velocity"), ("velocity", "free"), ("free", "velocity")][g.integers(3)] if held else \
        [("periodic", "periodic"), ("free", "free")][g.integers(2)]
    s.update(n=int(g.integers(12, 41)), v=g.uniform(0.3, 2), values=g.uniform(0.3, 2, 2),
             spread=g.uniform(0.05, 0.5) if g.random() < 0.7 or not held else 0., seed=int(g.integers(1000)),
             refine=str(g.choice(["auto", "off"])))
    if s["form"] == "chain":
        s.update(m=g.uniform(0.5, 2), f0=g.uniform(0.5, 2), k0=g.uniform(0.05, 1), k1=g.uniform(0.1, 3),
                 zeta=g.uniform(0.05, 0.8), order=2)
    else:
        s.update(gamma=g.uniform(0.3, 4), c=g.uniform(0.3, 3), length=g.uniform(3, 20), delta=g.uniform(0, 0.6),
                 order=int(g.choice([2, 4, 6])))
    s["vary"] = str(g.choice(["v", "zeta" if s["form"] == "chain" else "delta"]))
    return s


RANGES = {"v": (0.3, 2.5), "gamma": (0.2, 5), "delta": (0, 2), "zeta": (0.02, 2), "D": (0.05, 4), "b": (0.02, 2)}
NAMES = {"gamma": "model_gamma", "delta": "model_delta", "c": "model_c", "v": "model_v", "m": "model_m",
         "f0": "model_f0", "k0": "model_k0", "k1": "model_k1", "zeta": "model_zeta", "length": "grid_length",
         "order": "grid_order", "n": "grid_n", "law": "friction_law", "state": "state_law", "form": "model_form",
         "t_h": "state_t_h", "tau_inf": "state_tau_inf", "theta0": "state_theta0", "a": "friction_a",
         "spread": "friction_spread", "seed": "friction_seed", "refine": "spectrum_refine"}
OF_STATE = {"healing": ["t_h", "tau_inf"], "contact-age": ["theta0"]}


def option(s, key):
    if key in ("b", "D"):
        return ("friction_" if s["law"] == "rate-and-state" else "state_") + key
    return NAMES[key]


def arguments(s):
    words = []
    for key, value in s.items():
        if key == "vary" or (key in ("spread", "seed") and s["spread"] == 0):
            continue
        if key in ("t_h", "tau_inf", "theta0", "D", "b"):
            if s["state"] == "none" or (key == "b" and s["state"] == "healing"):
                continue
            if key in ("t_h", "tau_inf", "theta0") and key not in OF_STATE.get(s["state"], []):
                continue
        if key == "ends":
            words += ["-bc_left", value[0], "-bc_right", value[1]]
        elif key == "values":
            for end, side, x in zip(s["ends"], ("left", "right"), value):
                words += [f"-bc_{side}_value", repr(float(x))] if end == "velocity" else []
        else:
            words += ["-" + option(s, key), value if isinstance(value, str) else repr(value.item() if
                      isinstance(value, np.generic) else value)]
    return words


def points_of(s):
    low, high = RANGES[s["vary"]]
    done = call([*arguments(s), "-boundary_parameter", option(s, s["vary"]), "-boundary_from", str(low), "-boundary_to",
                 str(high), "-boundary_of", "sliding", "-summary", "b.json"], command="boundary")
    assert done.returncode in (0, 1), done.stderr
    assert done.returncode == 0 or "no boundary" in done.stderr or "does not enter" in done.stderr, done.stderr
    with open("b.json", encoding="utf-8") as file:
        return json.load(file)["points"] or [], done.stderr


def roots_of(growth, low, high, samples):
    """Sign changes through zero (not jumps) on a fine lattice."""
    x = np.linspace(low, high, samples)
    f = np.array([growth(y) for y in x])
    found = []
    for a, b, fa, fb in zip(x, x[1:], f, f[1:]):
        if fa * fb < 0:
            root = brentq(growth, a, b, xtol=1e-13)
            if abs(growth(root)) < 1e-7:
                found.append(root)
    return found


def compare(index, s, points, found, tolerance):
    """Every point is a root and every root a point, but pairs between two of the program's samples."""
    low, high = RANGES[s["vary"]]
    label = f"scene {index}: boundary {' '.join(arguments(s))} ({s['vary']})"
    values = [p["value"] for p in points]
    for value in values:
        assert found and min(abs(np.array(found) - value)) < tolerance * (high - low), f"{label}: {value} of {found}"
    width = (high - low) / 32
    for root in found:
        near = [other for other in found if other != root and abs(other - root) < width]
        assert near or any(abs(root - value) < tolerance * (high - low) for value in values), f"{label}: {root}: {values}"


def test_uniform_continua_are_asked_as_such(scenes):
    """Zeros of the supremum over all waves, whatever the grid; null wavenumber where short waves approach it."""
    for index, s in scenes(uniform_scene, 41):
        def growth(value):
            return supremum({**s, s["vary"]: value})[0]
        points, _ = points_of(s)
        compare(index, s, points, roots_of(growth, *RANGES[s["vary"]], 65), 1e-8)
        for p in points:
            assert p["error"] == 0
            at = {**s, s["vary"]: p["value"]}
            if p["wavenumber"] is None:
                assert p["frequency"] is None and supremum(at)[1] == np.inf, (index, p)
            else:
                assert abs(wave_growth(at, [p["wavenumber"]])[0]) < 1e-8, (index, p)


def amplitudes(s, n):
    if s["spread"] == 0:
        return np.ones(n)
    words = arguments({**{k: s[k] for k in ("form", "order", "length", "ends", "spread", "seed") if k in s}, "n": n})
    if s["form"] == "chain":
        words = arguments({k: s[k] for k in ("form", "ends", "spread", "seed")} | {"n": n})
    done = call([*words, "-model_v", "2", "-spectrum_count", "1", "-out_file", "a.h5"], command="spectrum")
    assert done.returncode == 0, done.stderr
    return data("a.h5")["steady_eta"] / (8 / 3 - 2)


def test_lines_of_spread_and_held_nodes(scenes):
    """Zeros of the growth rate of the dense matrix; `error` is what the grid of half the spacing makes of them."""
    for index, s in scenes(line_scene, 42, short=8):
        if s["spread"] > 0 and any(end == "velocity" for end in s["ends"]):
            factors = amplitudes({**s, "ends": ("free", "free")}, s["n"])  # held nodes stand where free ends do
        else:
            factors = amplitudes(s, s["n"])

        def growth(value, factors=factors):
            return line_growth({**s, s["vary"]: value}, factors)
        points, stderr = points_of(s)
        compare(index, s, points, roots_of(growth, *RANGES[s["vary"]], 65), 1e-8)
        if s["form"] == "chain":
            assert all(p["error"] == 0 for p in points)
            continue
        n = 2 * s["n"] if s["ends"][0] == "periodic" else 2 * s["n"] - 1
        finer = amplitudes({**s, "ends": s["ends"] if s["ends"][0] == "periodic" else ("free", "free")}, n)
        for p in points:
            there, here, step = growth(p["value"], finer), growth(p["value"]), 1e-6
            slopes = [abs(growth(p["value"] + d) - here) / step for d in (-step, step)]
            assert abs(p["error"] - abs(there - here) / min(slopes)) <= 1e-3 * p["error"] + 1e-6, (index, p, there, slopes)
            A, _, K0, K1, _ = coefficients(s)
            if p["frequency"] > 0.9 * resolved_frequency(s, s["n"]):
                assert "shortest wavelength" in stderr, (index, p, stderr)


def test_short_waves_of_contact_age(scratch):
    """Stable on any grid up to v = 0.99..., unstable in the continuum from v = 1 on down: the limit of short waves."""
    s = {"form": "continuum", "law": "cubic", "state": "contact-age", "b": .9, "D": 2., "theta0": 2.4, "delta": 0.,
         "gamma": .4, "v": .995, "c": 1., "length": 60., "ends": ("periodic", "periodic"), "vary": "v", "refine": "auto"}
    for n in (64, 512):
        points, _ = points_of({**s, "n": n})
        assert len(points) == 1 and abs(points[0]["value"] - 1) < 1e-12
        assert points[0]["wavenumber"] is None and points[0]["frequency"] is None and points[0]["kind"] == "hopf"
    points, _ = points_of({**s, "n": 64, "refine": "off"})  # the matrix itself
    assert abs(points[0]["value"] - 1) > 1e-6 and points[0]["wavenumber"] is not None
