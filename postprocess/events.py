#!/usr/bin/python3
"""Draws the catalogue of slip events of one run or several (out_events) and fits its magnitude-frequency curve.

usage: events.py FILE.h5 [FILE.h5 ...] [-o PICTURE.png] [--from S] [--fit A B] [--label OPTION]

Left above: how many events there are of each magnitude, over the number of nodes, the plate's way and the width of the
bins, with Poisson errors; beside it the map of the first file's events in space and time; below, slip against time at a few places and
the cumulative moment. Magnitudes are natural logarithms of the moment. --from leaves out what began before the plate had
gone so far (a start is not typical). The fit is of density ~ exp(-b magnitude) between A and B (default: from 2 above the most frequent magnitude,
that of a block alone, over 3 units), by maximum likelihood for a truncated exponential; its standard error is from the curvature.
--label names an option whose value stands in the legend, e.g. friction_alpha. Statistics over many runs: catalogue.py.
"""
import argparse
import contextlib
import os
import sys

os.environ.setdefault("MPLBACKEND", "Agg")

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

import figures  # noqa: E402,F401  (fonts)
from catalogue import FEWEST, fit, magnitudes, read, signed_moments  # noqa: E402
from stickslip import Unusable, options, reading, told_apart  # noqa: E402


def names_of(paths, option):
    """What stands in the key: the value of an option, else that in which the files differ."""
    with contextlib.ExitStack() as stack:
        files = [stack.enter_context(reading(path)) for path in paths]
        return [f"{option} {options(file)[option]}" for file in files] if option else told_apart(files)


def catalogue_figure(paths, begin=0, bounds=None, option=None):
    """The picture; what the fits say is printed."""
    runs = [read(path, begin) for path in paths]
    figure = Figure(figsize=(12, 9), layout="constrained")
    (curve, place), (slip, moment) = figure.subplots(2, 2)
    for run, name in zip(runs, names_of(paths, option)):
        m = magnitudes(run)
        if len(m) == 0:
            print(f"{name}: no events")
            continue
        width = 0.25
        edges = np.arange(np.floor(m.min() / width) * width, m.max() + 2 * width, width)
        counts = np.histogram(m, edges)[0]
        middle, some = (edges[:-1] + edges[1:]) / 2, counts > 0
        scale = len(run["x"]) * run["way"] * width
        line = curve.errorbar(middle[some], counts[some] / scale, np.sqrt(counts[some]) / scale, fmt="o-", ms=3, lw=0.7,
                              label=name)
        low = bounds[0] if bounds else edges[np.argmax(counts) + 1] + 2
        high = bounds[1] if bounds else low + 3
        b, error, number = fit(m, low, high)
        # what the fitted line would have above the range, against what is there
        beyond = np.sum(m >= high)
        expected = number * np.exp(-b * (high - low)) / -np.expm1(-b * (high - low)) if b > 0 else np.nan
        fitted = f"b = {b:.3f} +- {error:.3f} on [{low:g}, {high:g}] ({number} events); beyond it {beyond} events, " \
                 f"{expected:.0f} on the line"
        if not np.isfinite(b):
            fitted = f"no b: {number} events in [{low:g}, {high:g}], and a fit takes {FEWEST} (--fit A B sets the range)"
        left_out = len(run["events"]["t"]) - len(m)
        note = f" (and {left_out} whose slips cancel)" if left_out else ""
        print(f"{name}: {len(m)} events{note}, {fitted}; largest extent {run['events']['extent'].max():g}")
        if np.isfinite(b):
            grid = np.linspace(low, high, 2)
            top = number * b / -np.expm1(-b * (high - low)) * width / scale
            curve.plot(grid, top * np.exp(-b * (grid - low)), color=line[0].get_color(), lw=2, alpha=0.5)
    curve.set_yscale("log")
    curve.set_xlabel("magnitude ln M")
    curve.set_ylabel("events per node, way of the plate and unit of magnitude")
    if len(runs) > 1:
        curve.legend(fontsize=8)

    run, events = runs[0], runs[0]["events"]
    x, options = run["x"], run["options"]
    ring = options["bc_left"] == "periodic"
    spacing = x[1] - x[0] if len(x) > 1 else 1
    length = spacing * len(x)
    strongest = np.nanmax(events["magnitude"], initial=1)
    weakest = np.nanmin(events["magnitude"], initial=0)
    colours = matplotlib.colormaps["viridis_r"]
    for i in np.argsort(events["magnitude"]):
        begin, end = events["left"][i] - spacing / 2, events["left"][i] + events["extent"][i] - spacing / 2
        colour = colours((events["magnitude"][i] - weakest) / max(strongest - weakest, 1e-9))
        parts = [(begin, end)] if not ring or end <= length else [(begin, length), (0, end - length)]
        for a, b in parts:
            place.plot([a, b], [events["begin"][i]] * 2, color=colour, lw=1 if b - a > 2 * spacing else 2,
                       solid_capstyle="butt")
    place.set_xlabel("x")
    place.set_ylabel("t")
    place.set_title("regions that slipped" + (f", {curve.get_legend_handles_labels()[1][0]}" if len(runs) > 1 else ""))

    # the mean slip of each event, laid on its region; what goes the plate's way is drawn upwards
    order, moments = np.argsort(events["t"]), signed_moments(run)
    for part in (0.2, 0.4, 0.6, 0.8):
        at = x[int(part * (len(x) - 1))]
        offset = (at - events["left"][order]) % length if ring else at - events["left"][order]
        hit = (offset >= -1e-9) & (offset < events["extent"][order] - 1e-9)
        t = events["t"][order][hit]
        d = np.cumsum((moments / events["extent"])[order][hit])
        slip.step(np.r_[run["begin"], t], np.r_[0, d], where="post", lw=1, label=f"x = {at:g}")
    times = np.linspace(run["begin"], run["end"], 500)
    gone = run["plate"].shift(times)
    plate = times, np.sign(run["shift"]) * (gone - gone[0])
    slip.plot(*plate, "k:", lw=1, label="plate")
    slip.set_xlabel("t")
    slip.set_ylabel("slip (mean over each event)")
    slip.legend(fontsize=8)

    moment.step(events["t"][order], np.cumsum(moments[order]) / length, where="post", lw=1)
    moment.plot(*plate, "k:", lw=1)
    moment.set_xlabel("t")
    moment.set_ylabel("moment so far over length (dotted: plate)")

    figure.suptitle(runs[0]["title"], fontsize=10)
    return figure


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("-o", "--output")
    parser.add_argument("--from", dest="begin", type=float, default=0)
    parser.add_argument("--fit", nargs=2, type=float)
    parser.add_argument("--label")
    arguments = parser.parse_args()
    output = arguments.output or os.path.splitext(arguments.files[0])[0] + "-events.png"
    try:
        catalogue_figure(arguments.files, arguments.begin, arguments.fit, arguments.label).savefig(output, dpi=110)
    except Unusable as error:
        sys.exit(f"events.py: error: {' '.join(arguments.files)}: {error}")
    print(output)


if __name__ == "__main__":
    main()
