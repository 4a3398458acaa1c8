"""Random scenes of `boundary` against growth rates of the reference, and roots by Brent's method. Only the factors of spread
friction, whose generator is the program's, are read from its files."""
import json

import numpy as np
from scipy.optimize import brentq

from calls import call, data
from reference import System, d2, waves, words


# ---- uniform continua: every wave that fits ---------------------------------------------------------------------------

def wave_growth(p, numbers):
    return np.linalg.eigvals(waves(p, np.asarray(numbers, float)**2)).real.max(axis=1)


def supremum(p):
    """Largest growth over all waves, and its wavenumber (infinite for the limit)."""
    unit = (2 if p["bc_left"] == "periodic" else 1) * np.pi / p["grid_length"]
    held = [p["bc_" + end] == "velocity" for end in ("left", "right")]
    first = 1 if all(held) else 0.5 if any(held) else 0
    top = max(100, int(1e4 / unit))  # beyond, round-off outweighs what is left of the way to the limit
    j = np.unique(np.concatenate([np.arange(64), np.geomspace(64, top, 200).astype(np.int64)]))
    for _ in range(4):  # between the neighbours of the best wave the growth rate has one maximum
        growth = wave_growth(p, unit * (first + j))
        best = int(np.argmax(growth))
        value, wave = growth[best], unit * (first + j[best])
        low, high = j[max(best - 1, 0)], j[min(best + 1, j.size - 1)]
        if high - low <= 2:
            break
        j = np.unique(np.linspace(low, high, 200).astype(np.int64))
    slid = abs(p["model_v"]) / p.get("friction_D", p.get("state_D", 1))
    far = 300 * max(1, 1 / p["model_c"]) * (1 + p["model_gamma"] + slid + 1 / p.get("state_t_h", 1))
    one, two = wave_growth(p, [far, 2 * far])
    limit = (4 * two - one) / 3  # the error is of order 1/k^2
    return (limit, np.inf) if limit > value + 1e-11 else (value, wave)


# ---- lines of nodes ---------------------------------------------------------------------------------------------------

def resolved_frequency(p):
    """Of the wave whose frequency on the grid is 1 % low."""
    system = System(p)
    w = d2(2 * p["grid_order"] + 1, order=p["grid_order"])[0, :p["grid_order"] // 2 + 1]

    def kappa2(k):
        return -(w[0] + 2 * sum(x * np.cos(j * k * system.h) for j, x in enumerate(w) if j > 0)) / system.h**2
    k = brentq(lambda k: np.sqrt(kappa2(k)) / k - 0.99, 1e-2 / system.h, np.pi / system.h, xtol=1e-14)
    return np.sqrt(system.A * (system.K0 + system.K1 * kappa2(k)))


def line_growth(p, amplitude):
    """Largest real part among the modes that count."""
    values = System(p | {"grid_n": len(amplitude)}, amplitude).eigenvalues()
    if p["model_form"] == "continuum" and p["spectrum_refine"] == "auto":
        values = values[abs(values.imag) <= resolved_frequency(p | {"grid_n": len(amplitude)})]
    return values.real.max()


# ---- scenes -----------------------------------------------------------------------------------------------------------

def law_of(g):
    law, state = [("cubic", "none"), ("cubic", "contact-age"), ("carlson-langer", "none"),
                  ("carlson-langer", "contact-age"), ("carlson-langer", "healing"), ("rate-and-state", "ageing"),
                  ("rate-and-state", "slip")][g.integers(7)]
    p = {"friction_law": law, "state_law": state}
    if law == "rate-and-state":
        a = g.uniform(0.05, 0.3)
        return p | {"friction_a": a, "friction_b": a * g.uniform(0.5, 3), "friction_D": g.uniform(0.05, 1)}
    if state != "none":
        p["state_D"] = g.uniform(0.3, 3)
    if state == "contact-age":
        p |= {"state_b": g.uniform(0.1, 1.5), "state_theta0": g.uniform(0.3, 3)}
    if state == "healing":
        p |= {"state_t_h": g.uniform(0.3, 3), "state_tau_inf": g.uniform(1.2, 3)}
    return p


def uniform_scene(g):
    ends = [("periodic", "periodic"), ("free", "free"), ("velocity", "velocity"), ("velocity", "free")][g.integers(4)]
    p = law_of(g) | {"model_form": "continuum", "model_gamma": g.uniform(0.3, 4), "model_c": g.uniform(0.3, 3),
                     "grid_length": g.uniform(3, 60), "model_delta": g.choice([0., g.uniform(0, 0.6)]),
                     "grid_order": int(g.choice([2, 4, 6])), "model_v": g.uniform(0.2, 2), "bc_left": ends[0],
                     "bc_right": ends[1], "grid_n": int(g.integers(24, 65))}
    return p, str(g.choice(["model_v", "model_gamma", "model_delta"] + [name for name in p if name[-2:] in ("_D", "_b")]))


def line_scene(g):
    held = g.random() < 0.6
    ends = [("velocity", "velocity"), ("velocity", "free"), ("free", "velocity")][g.integers(3)] if held else \
        [("periodic", "periodic"), ("free", "free")][g.integers(2)]
    p = law_of(g) | {"grid_n": int(g.integers(12, 41)), "model_v": g.uniform(0.3, 2),
                     "spectrum_refine": str(g.choice(["auto", "off"]))}
    for side, end in zip(("left", "right"), ends):
        p |= {"bc_" + side: end} | ({f"bc_{side}_value": g.uniform(0.3, 2)} if end == "velocity" else {})
    if g.random() < 0.7 or not held:
        p |= {"friction_spread": g.uniform(0.05, 0.5), "friction_seed": int(g.integers(1000))}
    if g.random() < 0.5:
        p |= {"model_form": "chain", "model_m": g.uniform(0.5, 2), "model_f0": g.uniform(0.5, 2),
              "model_k0": g.uniform(0.05, 1), "model_k1": g.uniform(0.1, 3), "model_zeta": g.uniform(0.05, 0.8)}
    else:
        p |= {"model_form": "continuum", "model_gamma": g.uniform(0.3, 4), "model_c": g.uniform(0.3, 3),
              "grid_length": g.uniform(3, 20), "model_delta": g.uniform(0, 0.6), "grid_order": int(g.choice([2, 4, 6]))}
    return p, str(g.choice(["model_v", "model_zeta" if p["model_form"] == "chain" else "model_delta"]))


RANGES = {"model_v": (0.3, 2.5), "model_gamma": (0.2, 5), "model_delta": (0, 2), "model_zeta": (0.02, 2),
          "friction_D": (0.05, 4), "state_D": (0.05, 4), "friction_b": (0.02, 2), "state_b": (0.02, 2)}


def points_of(p, vary):
    low, high = RANGES[vary]
    done = call([*words(p), "-boundary_parameter", vary, "-boundary_from", str(low), "-boundary_to",
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


def compare(index, p, vary, points, found, tolerance):
    """Every point is a root and every root a point, but pairs between two of the program's samples."""
    low, high = RANGES[vary]
    label = f"scene {index}: boundary {' '.join(words(p))} ({vary})"
    values = [point["value"] for point in points]
    for value in values:
        assert found and min(abs(np.array(found) - value)) < tolerance * (high - low), f"{label}: {value} of {found}"
    width = (high - low) / 32
    for root in found:
        near = [other for other in found if other != root and abs(other - root) < width]
        assert near or any(abs(root - value) < tolerance * (high - low) for value in values), f"{label}: {root}: {values}"


def test_uniform_continua_are_asked_as_such(scenes):
    """Zeros of the supremum over all waves, whatever the grid; null wavenumber where short waves approach it."""
    for index, (p, vary) in scenes(uniform_scene, 41, short=12):
        points, _ = points_of(p, vary)
        compare(index, p, vary, points, roots_of(lambda value: supremum(p | {vary: value})[0], *RANGES[vary], 65), 1e-8)
        for point in points:
            assert point["error"] == 0
            at = p | {vary: point["value"]}
            if point["wavenumber"] is None:
                assert point["frequency"] is None and supremum(at)[1] == np.inf, (index, point)
            else:
                assert abs(wave_growth(at, [point["wavenumber"]])[0]) < 1e-8, (index, point)


def amplitudes(p):
    if "friction_spread" not in p:
        return np.ones(p["grid_n"])
    kept = {name: value for name, value in p.items() if name.startswith("grid_") or name in
            ("model_form", "bc_left", "bc_right", "friction_spread", "friction_seed")}
    if "velocity" in (p["bc_left"], p["bc_right"]):  # held nodes stand where free ends do
        kept |= {"bc_left": "free", "bc_right": "free"}
    done = call(words(kept | {"model_v": 2, "spectrum_count": 1, "out_file": "a.h5"}), command="spectrum")
    assert done.returncode == 0, done.stderr
    return data("a.h5")["steady_eta"] / (8 / 3 - 2)


def test_lines_of_spread_and_held_nodes(scenes):
    """Zeros of the growth rate of the dense matrix; `error` is what the grid of half the spacing makes of them."""
    for index, (p, vary) in scenes(line_scene, 42, short=5):
        factors = amplitudes(p)

        def growth(value, factors=factors):
            return line_growth(p | {vary: value}, factors)
        points, stderr = points_of(p, vary)
        compare(index, p, vary, points, roots_of(growth, *RANGES[vary], 65), 1e-8)
        if p["model_form"] == "chain":
            assert all(point["error"] == 0 for point in points)
            continue
        finer = amplitudes(p | {"grid_n": 2 * p["grid_n"] - (p["bc_left"] != "periodic")})
        for point in points:
            there, here, step = growth(point["value"], finer), growth(point["value"]), 1e-6
            slopes = [abs(growth(point["value"] + d) - here) / step for d in (-step, step)]
            assert abs(point["error"] - abs(there - here) / min(slopes)) <= 1e-3 * point["error"] + 1e-6, (index, point, slopes)
            if point["frequency"] > 0.9 * resolved_frequency(p):
                assert "shortest wavelength" in stderr, (index, point, stderr)


def test_short_waves_of_contact_age():
    """Stable on any grid up to v = 0.99..., unstable in the continuum from v = 1 on down: the limit of short waves."""
    p = {"friction_law": "cubic", "state_law": "contact-age", "state_b": 0.9, "state_D": 2, "state_theta0": 2.4,
         "model_delta": 0, "model_gamma": 0.4, "model_v": 0.995}
    for n in (64, 512):
        points, _ = points_of(p | {"grid_n": n}, "model_v")
        assert len(points) == 1 and abs(points[0]["value"] - 1) < 1e-12
        assert points[0]["wavenumber"] is None and points[0]["frequency"] is None and points[0]["kind"] == "hopf"
    points, _ = points_of(p | {"grid_n": 64, "spectrum_refine": "off"}, "model_v")  # the matrix itself
    assert abs(points[0]["value"] - 1) > 1e-6 and points[0]["wavenumber"] is not None
