"""Branches of cycles of random scenes: what is listed between their points. Every turn of the parameter is a fold, every change of
stability a special point, and none lies elsewhere on another walk along the same branch, in steps of other lengths."""
import json

import numpy as np

from calls import call, check
from reference import words
from settling import OWN_AGE, scene as settling_scene

STEPS = (40, 27)


def with_corner(random, p, law):
    """The same blocks under a law that turns a corner where psi passes 0."""
    p = {k: v for k, v in p.items() if not k.startswith("friction_") or k == "friction_amplitude"} | {"friction_law": law}
    if law == "table":
        psi = np.concatenate([[0], np.cumsum(random.uniform(0.2, 0.6, 4))])
        force = np.array([0, 1, 0.7, 0.6, 0.65]) * random.uniform(0.9, 1.1, 5)
        return p | {"friction_table": ",".join(f"{a:.4f}:{b:.4f}" for a, b in zip(np.concatenate([-psi[:0:-1], psi]),
                                                                                 np.concatenate([-force[:0:-1], force]))),
                    "friction_table_beyond": "constant"}
    p |= {"friction_fc": random.uniform(0.4, 0.8), "friction_sigma0": random.uniform(5, 30)}
    sigma1 = random.uniform(0.05, 0.5)
    if law == "lugre":
        p |= {"friction_sigma1": sigma1, "friction_fs": random.uniform(0.9, 1.2), "friction_vs": random.uniform(0.05, 0.3)}
    return p


def scene(random):
    """Options by name, and what is varied: its name and up to where."""
    p = settling_scene(random)
    if random.random() < 0.7:
        while p["friction_law"] in OWN_AGE:
            p = settling_scene(random)
        p = with_corner(random, p, str(random.choice(["lugre", "lugre", "lugre", "dahl", "table"])))
    p["grid_n"] = min(p["grid_n"], 2)
    p = {k: v[:2] if isinstance(v, np.ndarray) else v for k, v in p.items()}
    if p["grid_n"] == 1:
        p = {k: v[0] if isinstance(v, np.ndarray) else v for k, v in p.items()}
    if p["friction_law"] in ("lugre", "dahl", "table") and random.random() < 0.3:
        load = str(random.choice(["load", "load_force"]))
        p |= {f"{load}_sine_amplitude": random.uniform(0.05, 0.3), f"{load}_sine_period": random.uniform(3, 15)}
    names = [k for k in ("model_v", "model_k0", "model_f0", "friction_vs", "friction_sigma1", "load_force_sine_amplitude")
             if isinstance(p.get(k), float)]
    name = str(random.choice(names))
    return p, name, p[name] * np.exp(random.choice([-1, 1]) * random.uniform(0.2, 1.5))


def branch(p, name, to, steps):
    """points, special, end of a branch; None where there is no cycle."""
    done = call(words(p) + ["-cycle_continue", name, "-cycle_to", repr(float(to)), "-cycle_steps", str(steps), "-summary", "s.json"],
                command="cycle")
    if done.returncode in (1, 2):
        return None
    check(done.returncode == 0, done.stderr)
    with open("s.json", encoding="utf-8") as file:
        found = json.load(file)
    return found["branch"], found["special"]


def compare(drawn, what):
    """How many special points two walks along the branch list alike; None without a cycle."""
    p, name, to = drawn
    what, walks = f"{what}: {name} to {to}: {p}", []
    for steps in STEPS:
        walk = branch(p, name, to, steps)
        if walk is None:
            return None
        followed, special = walk
        points, value = followed["points"], np.array([point["value"] for point in followed["points"]])
        size = abs(to - value[0])
        folds = [s["after"] for s in special if s["kind"] == "fold"]
        way = np.diff(value)
        for k in np.flatnonzero(way[1:] * way[:-1] < 0):
            if min(abs(way[k:k + 2])) > 1e-8 * size:
                check(k in folds or k + 1 in folds, f"{what}: in {steps} steps a turn at point {k + 1}, {value[k + 1]}, is not listed: {special}")
        for k, (one, other) in enumerate(zip(points, points[1:])):
            rates = [abs(point["growth_rate"] or np.inf) * point["period"] for point in (one, other)]
            if one["stable"] != other["stable"] and min(rates) > 1e-7:
                check(any(s["after"] == k for s in special), f"{what}: in {steps} steps stability changes behind point {k} unlisted: {special}")
        walks.append((value, [s for s in special if s["kind"] in ("fold", "flip", "torus", "branch", "halves")]))
    alike = 0
    for (_, special), (value, others) in (walks, walks[::-1]):
        low, high = value.min() + 1e-6 * size, value.max() - 1e-6 * size
        for s in special:
            near = [o for o in others if o["kind"] == s["kind"] and abs(o["value"] - s["value"]) < 1e-8 * size]
            if not near and low < s["value"] < high and len(others) >= len(special):
                check(False, f"{what}: {s} is not among {others}")
            alike += bool(near)
    return alike
