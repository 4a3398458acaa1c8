#!/usr/bin/python3
"""Draws the catalogue of slip events of one run or several (out_events) and fits its magnitude-frequency curve.

usage: events.py FILE.h5 [FILE.h5 ...] [-o PICTURE.png] [--from S] [--fit A B] [--label OPTION] [--magnitude Mw] [--csv T.csv]

Left above: how many events there are of each magnitude, over the number of nodes, the plate's displacement and the width of the
bins, with Poisson errors; beside it the map of the first file's events in space and time; below, slip against time at a
few places, and how far the plate is ahead of the mean slip. Magnitudes are natural logarithms of the moment M, or with
--magnitude Mw 2/3 of the logarithm to the base 10, as in seismology (without the constant that belongs to units). --from leaves
out events that began before the plate had moved so far (a start is not typical). The fit is of density ~ exp(-b ln M) for
magnitudes between A and B, of the kind that is drawn: --magnitude Mw --fit -1 0.5 is from Mw = -1 to 0.5 (default: from 2 above the most frequent ln M, that of a block alone, over 3 units), by maximum likelihood for a truncated
exponential; its standard error is from the curvature. Of fewer than 20 events in the range there is no b. Beside b stands
3b/2, the slope per unit of Mw to the base 10 (Gutenberg and Richter's b). --csv writes the events that count, a line each.
--label names an option whose value is shown in the legend, e.g. friction_alpha. Statistics over many runs: catalogue.py.
"""
import argparse
import contextlib
import csv
import os
import sys

from stickslip import Unusable, options, reading, told_apart  # first: it says which Python to take

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from catalogue import (DENSITY, FEWEST, WIDTH, draw_density, fit, goodness, magnitudes, read, signed_moments,
                       usual_bounds)
from style import COLOURS, REFERENCE, Picture, name_axes, typeset

# Kinds of magnitudes: what they are of ln M, and their name.
MAGNITUDES = {"lnM": (1., "ln M"), "Mw": (2 / (3 * np.log(10)), "⅔ log₁₀ M")}


def names_of(paths, option):
    """What stands in the key: the value of an option, else that in which the files differ."""
    with contextlib.ExitStack() as stack:
        files = [stack.enter_context(reading(path)) for path in paths]
        return [f"{option} {options(file)[option]}" for file in files] if option else told_apart(files)


def fitted(m, bounds, unit):
    """The fit between its bounds (of ln M) as (b, low, high, number), and what is said of it, with the bounds in units of
    the axis."""
    low, high = bounds or usual_bounds(m)
    b, error, number = fit(m, low, high)
    shown = f"[{unit * low:.4g}, {unit * high:.4g}]" + (" of Mw" if unit != 1 else "")
    if not np.isfinite(b):
        return None, f"no b: {number} events in {shown}, and a fit takes {FEWEST} (--fit A B sets the range)"
    # what the fitted line would have above the range, against what is there
    expected = number * np.exp(-b * (high - low)) / -np.expm1(-b * (high - low)) if b > 0 else np.nan
    p = goodness(m, low, high)
    line = f"; not a straight line (p = {p:.2g})" if p < 0.05 else ""
    return (b, low, high, number), f"b = {b:.3f} +- {error:.3f} (3b/2 = {1.5 * b:.3f} +- {1.5 * error:.3f}) on {shown} " \
        f"({number} events){line}; beyond it {np.sum(m >= high)} events, {expected:.0f} on the line"


def draw_curve(picture, axes, runs, names, bounds, kind):
    """How many events there are of each magnitude, with the fits; what they say is printed."""
    unit, words = MAGNITUDES[kind]
    bounds = bounds and [value / unit for value in bounds]
    if not bounds and len({usual_bounds(magnitudes(run)) for run in runs if len(magnitudes(run))}) > 1:
        print("each b is of a range of its own: they are not to be compared (--fit A B sets one for all)")
    for k, (run, name) in enumerate(zip(runs, names)):
        m, colour = magnitudes(run), COLOURS[k % len(COLOURS)]
        if len(m) == 0:
            print(f"{name}: no events")
            continue
        scale = len(run["x"]) * run["way"] * WIDTH
        line = draw_density(axes, [m], scale, colour, unit)
        if len(runs) > 1:
            picture.label(axes, name.replace("_", " "), line)
        found, said = fitted(m, bounds, unit)
        left_out = len(run["events"]["t"]) - len(m)
        note = f" (and {left_out} whose slips cancel)" if left_out else ""
        print(f"{name}: {len(m)} events{note}, {said}; largest extent {run['events']['extent'].max():g}")
        if found:
            b, low, high, number = found
            top = number * b / -np.expm1(-b * (high - low)) * WIDTH / scale
            grid = np.linspace(low, high, 2)
            axes.plot(unit * grid, top / unit * np.exp(-b * (grid - low)), color=colour, lw=2.4, alpha=0.5)
    axes.set_yscale("log")
    name_axes(axes, f"magnitude {words}", DENSITY.format(words))


def write_table(path, paths, runs):
    """The events that count, a line for each: the file it is of, then the columns of its group (a file without one of them has
    an empty place there)."""
    names = list(dict.fromkeys(name for run in runs for name in run["events"] if name != "rupture_offset"))
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(["file", *names])
        for source, run in zip(paths, runs):
            columns = [run["events"].get(name, [""] * len(run["events"]["t"])) for name in names]
            table.writerows([source, *(value.item() if hasattr(value, "item") else value for value in row)]
                            for row in zip(*columns))


def line_of(run):
    """Length of the line of nodes, and their spacing."""
    spacing = run["x"][1] - run["x"][0] if len(run["x"]) > 1 else 1
    return spacing * len(run["x"]), spacing


def shown_part(run, length, spacing, most=400):
    """The places between which the map shows events: all of them, or about so many nodes in the middle."""
    if length <= 3 * most * spacing:
        return -np.inf, np.inf
    middle = run["x"][0] + length / 2
    return middle - most * spacing / 2, middle + most * spacing / 2


def draw_regions(picture, axes, run, kind):
    """Each event on its region at its time, in the colour of its magnitude; of a long line the middle, as much as can be told
    apart."""
    (length, spacing), events, ring = line_of(run), run["events"], run["options"]["bc_left"] == "periodic"
    unit, words = MAGNITUDES[kind]
    low, high = shown_part(run, length, spacing)
    inside = (events["left"] < high) & (events["left"] + events["extent"] > low)
    order = np.flatnonzero(inside)[np.argsort(events["magnitude"][inside])]
    pieces, sizes = [], []
    for i in order:
        begin = events["left"][i] - spacing / 2
        end = begin + events["extent"][i]
        for a, b in [(begin, end)] if not ring or end <= length else [(begin, length), (0, end - length)]:
            pieces.append([(a, events["begin"][i]), (b, events["begin"][i])])
            sizes.append(unit * events["magnitude"][i])
    known = np.array(sizes)[np.isfinite(sizes)]
    colours = Normalize(*((known.min(), known.max()) if len(known) and np.ptp(known) > 0 else (0, 1)))
    drawn = LineCollection(pieces, array=np.array(sizes), cmap="viridis_r", norm=colours, capstyle="butt",
                           linewidths=[1 if b[0] - a[0] > 2 * spacing else 2 for a, b in pieces])
    axes.add_collection(drawn)
    axes.autoscale()
    if high - low < length:
        axes.set_xlim(low, high)
    picture.colorbar(drawn, ax=axes, label=typeset(f"magnitude {words}"))
    name_axes(axes, "x", "t")


def draw_slip(picture, axes, run, plate):
    """Slip against time at four places: the mean slip of each event, over its region; in the plate's direction upwards."""
    length, _ = line_of(run)
    x, events, moments = run["x"], run["events"], signed_moments(run)
    order, ring = np.argsort(events["t"]), run["options"]["bc_left"] == "periodic"
    for colour, part in zip(COLOURS, (0.2, 0.4, 0.6, 0.8)):
        at = x[int(part * (len(x) - 1))]
        offset = (at - events["left"][order]) % length if ring else at - events["left"][order]
        hit = (offset >= -1e-9) & (offset < events["extent"][order] - 1e-9)
        slipped = np.cumsum((moments / events["extent"])[order][hit])
        line, = axes.step(np.r_[run["begin"], events["t"][order][hit]], np.r_[0, slipped], where="post", lw=1, color=colour)
        picture.label(axes, f"x = {at:g}", line, where=(0.2 + part) * 0.9)
    picture.label(axes, "plate", *axes.plot(*plate, **REFERENCE))
    name_axes(axes, "t", "mean slip of events")


def draw_deficit(axes, run):
    """How far the blocks lie behind the plate in the mean: its path less the moment so far over the length."""
    events = run["events"]
    order = np.argsort(events["t"])
    slipped = np.cumsum(signed_moments(run)[order]) / line_of(run)[0]
    times = np.concatenate([[run["begin"]], np.repeat(events["t"][order], 2), [run["end"]]])  # before and after each event
    gone, done = run["plate"].shift(times), np.repeat(np.concatenate([[0], slipped]), 2)
    axes.plot(times, np.sign(run["shift"]) * (gone - gone[0]) - done, lw=0.9, color=COLOURS[0])
    axes.axhline(0, **REFERENCE)
    name_axes(axes, "t", "plate ahead of the mean slip")


def catalogue_figure(paths, begin=0, bounds=None, option=None, kind="lnM", table=None):
    """The picture; what the fits say is printed, and the events are written to `table`, a CSV file, where one is named."""
    runs = [read(path, begin) for path in paths]
    if table:
        write_table(table, paths, runs)
    picture = Picture(5.8)
    (curve, place), (slip, deficit) = picture.subplots(2, 2)
    names = names_of(paths, option)
    draw_curve(picture, curve, runs, names, bounds, kind)
    run, events = runs[0], runs[0]["events"]
    draw_regions(picture, place, run, kind)
    times = np.linspace(run["begin"], run["end"], 500)
    gone = run["plate"].shift(times)
    plate = times, np.sign(run["shift"]) * (gone - gone[0])
    draw_slip(picture, slip, run, plate)
    draw_deficit(deficit, run)
    for axes in (slip, deficit):
        axes.locator_params(axis="x", nbins=5)
    first = f"map and slip: {names[0].replace('_', ' ')}\n" if len(runs) > 1 else ""
    picture.title(first + run["title"])
    return picture


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("-o", "--output")
    parser.add_argument("--from", dest="begin", type=float, default=0)
    parser.add_argument("--fit", nargs=2, type=float)
    parser.add_argument("--label")
    parser.add_argument("--magnitude", choices=MAGNITUDES, default="lnM")
    parser.add_argument("--csv", metavar="TABLE.csv")
    arguments = parser.parse_args()
    output = arguments.output or os.path.splitext(arguments.files[0])[0] + "-events.png"
    try:
        catalogue_figure(arguments.files, arguments.begin, arguments.fit, arguments.label, arguments.magnitude,
                         arguments.csv).savefig(output)
    except Unusable as error:
        sys.exit(f"events.py: error: {' '.join(arguments.files)}: {error}")
    print(*filter(None, (arguments.csv, output)), sep="\n")


if __name__ == "__main__":
    main()
