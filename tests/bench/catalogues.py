#!/usr/bin/env python3
"""Tables of docs/events.md:  catalogues.py alpha | spread FILE.h5 ..., of single runs;  size | loading | cuts FILE.h5 ..., of many

b by maximum likelihood on [-3.5, -0.5], with the error of independent events; the first unit of loading is left out.
"""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "postprocess"))

import numpy as np  # noqa: E402
from catalogue import ensembles, fit, magnitudes, read, statistics  # noqa: E402

LOW, HIGH = -3.5, -0.5


def within(m, low, high):
    return int(np.sum((m >= low) & (m < high)))


def row(path, kind):
    run = read(path, 1)
    m, extent, options = magnitudes(run), run["events"]["extent"], run["options"]
    b, error = fit(m, LOW, HIGH)[:2]
    ratio = within(m, 2, 5) / within(m, -1, 2)
    fitted = f"{b:.2f} ± {error:.2f}"
    if kind == "spread":
        return [options["friction_spread"], len(m), fitted, f"{ratio:.2f}", f"{extent.max():g}"]
    line = within(m, LOW, HIGH) / (np.exp(-b * (LOW - HIGH)) - 1)  # of the density fitted, beyond HIGH
    alpha = options["friction_alpha"] + (f" (nu = {options['model_v']})" if options["model_v"] != "1e-3" else "")
    return [alpha, len(m), f"{100 * np.mean(extent == 1):.0f} %", fitted, f"{np.sum(m >= HIGH)}, {line:.0f}", f"{ratio:.2f}"]


def ensembles_by(paths, option):
    for value, runs in ensembles([read(path, 1) for path in paths], option):
        s = statistics(runs, (LOW, HIGH))
        (low, high), halves = s["b_interval"], s["halves"]["events"]
        yield [value, f"{s['per_node_and_way']:.2f}", f"{s['b']:.2f} [{low:.2f}, {high:.2f}]", f"{s['p']:.2f}",
               f"{halves['ratio']:.2f} [{halves['low']:.2f}, {halves['high']:.2f}]", f"{s['typical_moment']:.0f}",
               f"{s['largest_extent']:g}"]


def cuts(paths):
    """b over the smallest event, a column for each alpha."""
    found = {alpha: {cut["low"]: cut for cut in statistics(runs, (LOW, HIGH))["cuts"]}
             for alpha, runs in ensembles([read(path, 1) for path in paths], "friction_alpha")}
    yield ["smallest event", *(f"alpha = {alpha}" for alpha in found)]
    for low in sorted(next(iter(found.values()))):
        yield [low, *(f"{c[low]['b']:.2f} [{c[low]['interval'][0]:.2f}, {c[low]['interval'][1]:.2f}]" for c in found.values())]


MANY = ["events a node and way", "b", "p", "halves: events", "typical event", "largest extent"]
HEADS = {"size": ["n (alpha = 2)", *MANY], "loading": ["nu (n = 100)", *MANY],
         "alpha": ["alpha", "events", "blocks alone", "b on [-3.5, -0.5]", "above -0.5: events, on the fitted line",
                   "ratio of 2..5 to -1..2"],
         "spread": ["spread", "events", "b on [-3.5, -0.5]", "ratio of 2..5 to -1..2", "largest extent"]}


def table(kind, paths):
    if kind == "cuts":
        return list(cuts(paths))
    option = {"size": "grid_n", "loading": "model_v"}.get(kind)
    return [HEADS[kind], *(ensembles_by(paths, option) if option else (row(path, kind) for path in paths))]


if __name__ == "__main__":
    heads, *rows = table(sys.argv[1], sys.argv[2:])
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for cells in rows:
        print("| " + " | ".join(map(str, cells)) + " |")
