#!/usr/bin/env python3
"""Tables of docs/events.md:  catalogues.py alpha | spread FILE.h5 ..., of single runs;  size | loading | cuts | sigma | waiting
FILE.h5 ..., of many. Tables of docs/published.md:  decades | large | classes FILE.h5 ..., of many; its picture: picture PNG FILE.h5 ...

b by maximum likelihood on [-3.5, -0.5], with the error of independent events; the first unit of loading is left out, for sigma
and waiting the first two, for alpha, cuts and the tables of docs/published.md the first six. waiting: from one event of magnitude 2
or more to the next, anywhere and at a block (of every tenth), by their mean. decades: b on four decades of moment, which begin at e times that of a block
that slips between blocks at rest, and on each of them. large: events beyond the hollow, which is the least filled bin of
one unit of magnitude, from the beginning of those four decades to the bin that
holds most of the moment. classes: blocks, slip and speed of the events of two units of magnitude each; speed is extent over
duration, in units of sqrt(k1/m).
"""
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, "..", "..", "postprocess"), os.path.join(HERE, "..")]

import numpy as np  # noqa: E402
from catalogue import ensembles, fit, interval, magnitudes, read, statistics, student  # noqa: E402
from cluster_scenes import lone_slip  # noqa: E402

LOW, HIGH = -3.5, -0.5
DECADE = np.log(10)


def within(m, low, high):
    return int(np.sum((m >= low) & (m < high)))


def row(path, kind):
    run = read(path, 6 if kind == "alpha" else 1)
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
             for alpha, runs in ensembles([read(path, 6) for path in paths], "friction_alpha")}
    yield ["smallest event", *(f"alpha = {alpha}" for alpha in found)]
    for low in sorted(next(iter(found.values()))):
        yield [low, *(f"{c[low]['b']:.2f} [{c[low]['interval'][0]:.2f}, {c[low]['interval'][1]:.2f}]" for c in found.values())]


def over_sigma(paths):
    for sigma, runs in ensembles([read(path, 2) for path in paths], "friction_sigma"):
        fits = [fit(magnitudes(run), LOW, HIGH)[0] for run in runs]
        m = np.concatenate([magnitudes(run) for run in runs])
        yield [sigma, len(m), mean_and_interval(fits), f"{np.mean(m >= HIGH):.3f}",
               f"{max(run['events']['extent'].max() for run in runs):g}"]


def waits(run, anywhere):
    """Times from the beginning of one large event to that of the next."""
    e = run["events"]
    order = np.argsort(e["begin"])
    left, extent, begin = (e[name][order][magnitudes(run)[order] >= 2] for name in ("left", "extent", "begin"))
    if anywhere:
        return np.diff(begin)
    return np.concatenate([np.diff(begin[(left <= x) & (x < left + extent)]) for x in run["x"][::10]])


def waiting(paths):
    """Means over the runs; the last row is that of events at random."""
    parts = (0.1, 0.5, 1, 1.5, 2, 3)
    yield ["large events", "times", "mean", "variation", *(f"below {part} means" for part in parts)]
    runs = [read(path, 2) for path in paths]
    for name, anywhere in (("anywhere in the chain", True), ("at a block", False)):
        times = [waits(run, anywhere) for run in runs]
        yield [name, sum(map(len, times)), mean_and_interval([t.mean() for t in times]),
               mean_and_interval([t.std() / t.mean() for t in times]),
               *(mean_and_interval([np.mean(t < part * t.mean()) for t in times]) for part in parts)]
    yield ["at random", "", "", 1, *(f"{-np.expm1(-part):.3f}" for part in parts)]


def slip_of_a_lone_block(options):
    """How far a block of the Carlson-Langer chain slips from its threshold on between blocks at rest."""
    numbers = {name: float(options[name]) for name in ("model_k0", "model_k1", "friction_sigma", "friction_alpha")}
    return lone_slip({"model_form": "chain", "friction_law": "carlson-langer"} | numbers)[2]


def first_decade(options):
    """Where the four decades begin, to a tenth."""
    return round(float(np.log(slip_of_a_lone_block(options))) + 1, 1)


def decades(paths):
    runs = [read(path, 6) for path in paths]
    low = first_decade(runs[0]["options"])
    m = np.concatenate([magnitudes(run) for run in runs])
    for first, last in ((0, 4), (0, 1), (1, 2), (2, 3), (3, 4)):
        low_end, high_end = low + first * DECADE, low + last * DECADE
        b, _, number = fit(m, low_end, high_end)
        least, most = interval(runs, low_end, high_end)
        yield [f"{low_end:.1f} to {high_end:.1f}", number, f"{b:.2f} [{least:.2f}, {most:.2f}]"]


def mean_and_interval(values):
    """Of the runs, with half the 95 % interval of the mean."""
    half = student(len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    return f"{np.mean(values):.3g} ± {half:.1g}"


def hollow_of(m, options):
    """Its place, and how many times as many events to a unit of magnitude there are behind it at most."""
    edges = np.arange(first_decade(options), m.max() + 1)
    counts, moments = np.histogram(m, edges)[0], np.histogram(m, edges, weights=np.exp(m))[0]
    least = int(np.argmin(counts[:np.argmax(moments) + 1]))
    return edges[least] + 0.5, counts[least:].max() / counts[least]


def large(paths):
    """A row for each ensemble (each alpha)."""
    for alpha, runs in ensembles([read(path, 6) for path in paths], "friction_alpha"):
        m = np.concatenate([magnitudes(run) for run in runs])
        hollow, rise = hollow_of(m, runs[0]["options"])
        beyond = [magnitudes(run) >= hollow for run in runs]
        moment = [np.exp(magnitudes(run)) for run in runs]
        extent = np.concatenate([run["events"]["extent"][big] for run, big in zip(runs, beyond)])
        slip = np.concatenate([mass[big] for mass, big in zip(moment, beyond)]) / extent
        yield [alpha, len(m), f"{hollow:.1f}", int(sum(big.sum() for big in beyond)),
               mean_and_interval([mass[big].sum() / mass.sum() for mass, big in zip(moment, beyond)]),
               f"{rise:.1f}", f"{np.median(extent):.0f}, {extent.max():.0f}",
               f"{np.median(slip):.2f}"]


def all_events(paths):
    """Of all runs: the options, and magnitude, extent, mean slip of a block, extent over duration and speed of sound."""
    runs = [read(path, 6) for path in paths]
    options = runs[0]["options"]
    m, extent, lasts = (np.concatenate(part) for part in zip(*(
        (magnitudes(run), run["events"]["extent"], run["events"]["t"] - run["events"]["begin"]) for run in runs)))
    return options, m, extent, np.exp(m) / extent, extent / lasts / np.sqrt(float(options["model_k1"]))


def classes(paths):
    _, m, *columns = all_events(paths)
    for low in range(-8, 8, 2):
        here = (m >= low) & (m < low + 2)
        extent, slip, speed = (column[here] for column in columns)
        yield [f"{low} to {low + 2}", int(here.sum()), f"{np.median(extent):g}, {extent.max():g}", f"{np.median(slip):.2g}",
               f"{np.median(speed):.2f}"]


def picture(output, paths):
    """Left: events to a unit of magnitude. Right: how many blocks slip in them."""
    from style import BLUE, GREY, REFERENCE, Picture, logarithmic, name_axes
    options, m, extent, _, _ = all_events(paths)
    drawn = Picture(3.2)
    curve, blocks = drawn.subplots(1, 2)
    edges = np.arange(-9, m.max() + 0.25, 0.25)
    counts = np.histogram(m, edges)[0]
    some = counts > 0
    curve.errorbar(edges[:-1][some] + 0.125, 4 * counts[some], 4 * np.sqrt(counts[some]), fmt="o", ms=3, color=BLUE, lw=0.8)
    blocks.plot(m, extent, ",", color=GREY, rasterized=True)
    middle = [(edge + 0.25, np.median(extent[near])) for edge in edges[::2]
              if np.sum(near := (m >= edge) & (m < edge + 0.5)) > 2]
    drawn.label(blocks, "median", *blocks.plot(*np.transpose(middle), color=BLUE), where=0.3)
    for axes in (curve, blocks):
        axes.axvline(hollow_of(m, options)[0], **REFERENCE)
        logarithmic(axes, "y")
    name_axes(curve, "magnitude", f"events per unit of magnitude, {len(paths)} runs")
    name_axes(blocks, "magnitude", "blocks that slip")
    drawn.savefig(output)


MANY = ["events per node and displacement", "b", "p", "halves: events", "typical event", "largest extent"]
HEADS = {"size": ["n (alpha = 2)", *MANY], "loading": ["nu (n = 100)", *MANY],
         "alpha": ["alpha", "events", "blocks alone", "b on [-3.5, -0.5]", "above -0.5: events, on the fitted line",
                   "ratio of 2..5 to -1..2"],
         "decades": ["magnitude", "events", "b"],
         "large": ["alpha", "events", "hollow", "beyond it", "their part of the moment", "rise behind the hollow",
                   "blocks: median, most", "slip of a block, median"],
         "classes": ["magnitude", "events", "blocks: median, most", "slip of a block, median", "extent/(duration c)"],
         "sigma": ["sigma", "events", "b on [-3.5, -0.5]", "part above -0.5", "largest extent"],
         "spread": ["spread", "events", "b on [-3.5, -0.5]", "ratio of 2..5 to -1..2", "largest extent"]}


def table(kind, paths):
    if kind in ("cuts", "waiting"):
        return list({"cuts": cuts, "waiting": waiting}[kind](paths))
    if kind in ("decades", "large", "classes", "sigma"):
        return [HEADS[kind], *{"decades": decades, "large": large, "classes": classes, "sigma": over_sigma}[kind](paths)]
    option = {"size": "grid_n", "loading": "model_v"}.get(kind)
    return [HEADS[kind], *(ensembles_by(paths, option) if option else (row(path, kind) for path in paths))]


if __name__ == "__main__":
    if sys.argv[1] == "picture":
        sys.exit(picture(sys.argv[2], sys.argv[3:]))
    heads, *rows = table(sys.argv[1], sys.argv[2:])
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for cells in rows:
        print("| " + " | ".join(map(str, cells)) + " |")
