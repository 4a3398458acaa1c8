"""Curves of `boundary` in two options, of random chains: what is called a meeting of two modes has two on the axis by the dense
matrix, and at a Bautin point small oscillations (periodic.py) neither grow out of sliding nor jump."""
import numpy as np

import reference
from calls import check, run

from . import periodic, sliding


def scene(random):
    """A chain of one block or a few, whose boundary has modes of different frequencies."""
    p = sliding.scene(random, uniform=True, form="chain", least=1, most=6) | {"bc_left": "free", "bc_right": "free"}
    while p["state_law"] == "none":
        p = {name: value for name, value in p.items() if not name.startswith(("friction_", "state_"))} | sliding.friction_of(random)
    p = {name: value for name, value in p.items() if name != "model_v" and not name.endswith("_value")}
    if p["friction_law"] == "rate-and-state":
        p |= {"model_k0": p["friction_b"] / p["friction_D"] * random.uniform(0.02, 0.4), "model_zeta": 0}
    if p["grid_n"] > 1 and random.random() < 0.6:
        p = sliding.with_profiles(random, p)
    numbers = [name for name, value in p.items() if isinstance(value, float) and value > 0]
    second = str(random.choice(numbers))
    return p, second, float(random.choice([-1, 1]))


def rates(p):
    values = reference.System(p).eigenvalues()
    return values[values.imag >= 0], max(1, abs(values).max())


def test_meetings_and_bautin_points(scenes):
    curves = bautin = 0
    for index, (p, second, side) in scenes(scene, 64, short=8):
        p = dict(p)
        value = p.pop(second)
        words = reference.words(p) + ["-boundary_of", "sliding", "-boundary_points", "16", "-boundary_parameter", "model_v",
                                    "-boundary_from", str(0.003 * side), "-boundary_to", str(2 * side), "-boundary_parameter2",
                                    second, "-boundary_from2", str(0.1 * value), "-boundary_to2", str(3 * value)]
        found = run(words, code=None, command="boundary")[0]
        if not found["points"]:  # no boundary in this box
            continue
        curves += 1
        sizes = [abs(q["lyapunov_coefficient"]) for q in found["points"] if q["lyapunov_coefficient"]]
        for q in found["meetings"]:
            z, scale = rates(p | {"model_v": q["value"], second: q["value2"]})
            leading = z[abs(z.real) < 1e-5 * scale].imag
            check(len(leading) > 1 and np.ptp(leading) > 1e-3 * leading.max(),
                  f"scene {index}: one mode at {q['value']}, {q['value2']}: {z}, {second} of {p}")
        for q in found["special"]:
            at = p | {"model_v": q["value"], second: q["value2"]}
            measured = periodic.Oscillations(at, "model_v", shape=np.ones(p["grid_n"]) + 0j if q["wavenumber"] < 1e-9 else None)
            l, allowed = measured.lyapunov(q["value"], 0.02 * abs(q["value"]))
            check(abs(l) < allowed + 1e-4 * np.median(sizes),
                  f"scene {index}: {l} +- {allowed} at {q['value']}, {q['value2']}, {second} of {p}; elsewhere {sizes}")
            bautin += 1
    check(curves > 3, f"{curves} curves, {bautin} Bautin points")
    print(curves, "curves", bautin, "Bautin points")
