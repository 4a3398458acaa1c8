#!/usr/bin/python3
"""Statistics of catalogues of slip events (out_events) over many runs: b-values one can cite.

usage: catalogue.py FILE.h5 [FILE.h5 ...] [--by OPTION] [--fit A B] [--from S] [--main M [--window W]]
                    [-o PICTURE.png] [--json TABLE.json]

Files that differ in nothing but seeds are one ensemble; --by makes one of each value of an option (grid_n for the scaling
with size, model_v or model_nu for the dependence on the loading or on viscosity). Magnitudes are natural logarithms of the
moment, b that of a density ~ exp(-b magnitude) on [A, B) (default: from 2 above the most frequent magnitude over 3 units).
--from leaves out events that began before the plate had moved so far; under a load that is the path, the integral of |v(t)|,
and the moment is compared with the displacement, the integral of v(t). For each ensemble:
  b         by maximum likelihood for a truncated exponential; in brackets the 95 % interval that the scatter of whole runs
            (of one run: of stretches of its time) gives it, because events of one run are not independent
  p         goodness of fit: how often catalogues drawn from the fitted law miss it by more (Kolmogorov and Smirnov's
            distance, b fitted each time). Below 0.05 the curve is not a straight line, and b only summarises it
  halves    events and moment in the second half of the time over the first, with the 95 % interval over the runs: 1 where
            the catalogue is stationary
  cut       what b becomes with another smallest event
  main      with --main: foreshocks and aftershocks of main shocks. Two events are near each other if the plate moves by less
            than W (default f0/(50 k0)) between their beginnings and their regions touch (share a node or are neighbours). A
            main shock is an event of magnitude M or more with no larger event near it; the smaller events near it are its foreshocks, if
            they begin before it, or its aftershocks. Main shocks closer than W to either end of the time that counts are left
            out. Their numbers per main shock are compared with the number of smaller events that touch its region in the same
            displacement of the plate by their mean rate in the whole run; the errors are square roots of the numbers
"""
import argparse
import json
import sys

from stickslip import Plate, Unusable, options, reading, scene_title  # first: it says which Python to take

import numpy as np

FEWEST = 20     # events for a fit
WIDTH = 0.25    # of a bin of magnitudes
STRETCHES = 20  # of the time of a lone run, for its interval
SEEDS = ("friction_seed", "init_seed")
DENSITY = "events per node, plate\ndisplacement and unit of {}"  # what curves of magnitudes show


# ---- one run ----------------------------------------------------------------------------------------------------------

def read(path, way):
    """The catalogue of one run without what began before the plate had gone `way`."""
    with reading(path) as file:
        if "events" not in file:
            raise Unusable("holds no events: run with -out_events")
        events = along_their_direction({name: data[:] for name, data in file["events"].items() if name != "rupture"})
        found = {"x": file["x"][:], "t": file["t"][:], "options": options(file), "path": path,
                 "title": scene_title(file)}
        end = found["end"] = max(plate_time(file, events), events["t"][-1] if len(events["t"]) else 0)
        plate = found["plate"] = Plate(file, end)
    if plate.way(end) == 0:
        raise Unusable("is of a plate that rests")
    begin = found["begin"] = plate.time_of(way)
    if begin >= end:
        raise Unusable(f"ends before the plate has gone {way:g} (--from)")
    found["way"], found["shift"] = plate.way(end) - plate.way(begin), float(plate.shift(end) - plate.shift(begin))
    keep = events["begin"] >= begin
    found["events"] = {name: values[keep] for name, values in events.items()}
    return found


def plate_time(file, events):
    """What the clock of events shows at the end. With load_halt that is the plate's: from the end of the last event up to the
    last frame it goes with the run's clock, that of frames, unless something slips there."""
    t = file["t"][-1]
    if "clock" not in events:
        return t
    if "series/plate_time" in file:
        return file["series/plate_time"][-1]
    before = np.flatnonzero(events["clock"] <= t)
    last = before[-1] if len(before) else None
    gone = (0, 0) if last is None else (events["t"][last], events["clock"][last])
    return gone[0] + (0 if file["psi"][-1].any() else t - gone[1])


def along_their_direction(events):
    """Files of before there was a direction have moments and drops to the left that are negative, and no slip of such events
    that could be told (it is that of the node that slips least)."""
    if "direction" in events:
        return events
    direction = np.sign(events["moment"])
    with np.errstate(divide="ignore"):
        magnitude = np.where(direction != 0, np.log(np.abs(events["moment"])), np.nan)
    return {**events, "direction": direction, "moment": np.abs(events["moment"]), "magnitude": magnitude,
            "stress_drop": direction * events["stress_drop"], "slip": np.where(direction > 0, events["slip"], np.nan)}


def signed_moments(run):
    """Those of slips against the plate are negative, so that their sum is what makes up for how far it has come."""
    return np.sign(run["shift"]) * run["events"]["direction"] * run["events"]["moment"]


def magnitudes(run):
    m = run["events"]["magnitude"]
    return m[np.isfinite(m)]


# ---- b ----------------------------------------------------------------------------------------------------------------

def mean_of(b, width):
    """Mean of a density ~ exp(-b m) on [0, width]."""
    x = np.asarray(b, float) * width
    near = np.abs(x) < 1e-4
    safe = np.where(near, 1., x)
    return width * np.where(near, 0.5 - x / 12, 1 / safe - 1 / np.expm1(safe))


def slope_of(mean, width):
    """The b of that mean, or of each of several: mean_of falls with b. Halving, then Newton's method, |b| up to 60/width."""
    mean = np.asarray(mean, float)
    least, most = np.full(mean.shape, -60.), np.full(mean.shape, 60.)  # of x = b width
    for _ in range(8):
        middle = (least + most) / 2
        above = mean_of(middle, 1) > mean / width
        least, most = np.where(above, middle, least), np.where(above, most, middle)
    x = (least + most) / 2
    for _ in range(4):
        near = np.abs(x) < 1e-2
        safe = np.where(near, 1., x)
        falls = np.where(near, 1 / 12 - x**2 / 240, 1 / safe**2 - 1 / (4 * np.sinh(safe / 2)**2))
        x = np.clip(x + (mean_of(x, 1) - mean / width) / falls, -60, 60)
    return x / width


def inside(magnitude, low, high):
    return magnitude[(magnitude >= low) & (magnitude < high)] - low


def fit(magnitude, low, high):
    """b of a density exp(-b m) on [low, high), its standard error for independent events, and their number."""
    m, width = inside(magnitude, low, high), high - low
    if len(m) < FEWEST:
        return np.nan, np.nan, len(m)
    b, step = float(slope_of(m.mean(), width)), 1e-3 / width
    variance = -(mean_of(b + step, width) - mean_of(b - step, width)) / (2 * step)
    return b, 1 / np.sqrt(len(m) * variance), len(m)


def bins(magnitude):
    """Edges of the bins of a curve."""
    return np.arange(np.floor(magnitude.min() / WIDTH) * WIDTH, magnitude.max() + 2 * WIDTH, WIDTH)


def usual_bounds(magnitude):
    """Where no range is given: three units from two above the most frequent magnitude, that of a block alone."""
    edges = bins(magnitude)
    low = edges[np.argmax(np.histogram(magnitude, edges)[0]) + 1] + 2
    return low, low + 3


def parts_of(runs, low, high):
    """Number and sum of the magnitudes in the range: of each run, or of each stretch of the time of a lone one."""
    if len(runs) > 1:
        pieces = [inside(magnitudes(run), low, high) for run in runs]
    else:
        events = runs[0]["events"]
        edges = np.linspace(runs[0]["begin"], runs[0]["end"], STRETCHES + 1)
        which = np.clip(np.searchsorted(edges, events["begin"], side="right") - 1, 0, STRETCHES - 1)
        pieces = [inside(events["magnitude"][which == k], low, high) for k in range(STRETCHES)]
    return np.array([len(p) for p in pieces]), np.array([p.sum() for p in pieces])


def interval(runs, low, high):
    """95 % of b: of the mean magnitude, by what each run (each stretch of a lone one) has beside it, as b of that mean."""
    count, total = parts_of(runs, low, high)
    if count.sum() < FEWEST:
        return np.nan, np.nan
    mean, width = total.sum() / count.sum(), high - low
    error = scatter(total - mean * count) / count.sum()
    return tuple(float(slope_of(np.clip(mean + side * error, 0, width), width)) for side in (1, -1))


def scatter(parts):
    """95 % of the sum of what runs add to a number that is zero in truth: so far from it on either side."""
    return student(len(parts) - 1) * np.std(parts, ddof=1) * np.sqrt(len(parts))


def student(freedom):
    """97.5 % of Student's distribution: exact for one and two degrees, then Cornish and Fisher's expansion, to 1 %."""
    if freedom < 3:
        return (np.tan(0.475 * np.pi), 0.95 / np.sqrt(2 * 0.975 * 0.025))[freedom - 1]
    z = 1.959964
    return z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2) + \
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * freedom**3)


def distance(m, b, width):
    """Largest distance between the distribution of m and the truncated exponential. Rows of m are sorted."""
    n = m.shape[-1]
    b = np.expand_dims(np.where(np.abs(b * width) < 1e-9, 1e-9 / width, b), -1)
    law = np.expm1(-b * m) / np.expm1(-b * width)
    steps = np.arange(n + 1) / n
    return np.maximum(steps[1:] - law, law - steps[:-1]).max(axis=-1)


def goodness(magnitude, low, high, draws=400, seed=1, most=2000):
    """p of the straight line. Of more than `most` events every so many are taken, which makes it less strict."""
    m, width = np.sort(inside(magnitude, low, high)), high - low
    if len(m) < FEWEST:
        return np.nan
    if len(m) > most:
        m = np.sort(np.random.default_rng(seed).choice(m, most, replace=False))
    b = slope_of(m.mean(), width)
    here = distance(m, b, width)
    uniform = np.random.default_rng(seed + 1).random((draws, len(m)))
    drawn = np.sort(-np.log1p(uniform * np.expm1(-b * width)) / b if abs(b * width) > 1e-9 else uniform * width, axis=1)
    there = distance(drawn, slope_of(drawn.mean(axis=1), width), width)
    return float((1 + np.sum(there >= here)) / (1 + draws))


# ---- many -------------------------------------------------------------------------------------------------------------

def halves(runs):
    """{events, moment}: the second half of the time over the first, and its 95 % interval over the runs."""
    found = {}
    for name in ("events", "moment"):
        both = []
        for run in runs:
            late = run["events"]["begin"] >= (run["begin"] + run["end"]) / 2
            weight = np.ones(len(late)) if name == "events" else run["events"]["moment"]
            both.append((weight[~late].sum(), weight[late].sum()))
        first, second = np.array(both, float).T
        ratio = second.sum() / first.sum() if first.sum() > 0 else np.nan
        error = np.nan
        if len(runs) > 2 and first.sum() > 0:
            # of a ratio of sums: the scatter of what each run adds to second - ratio first
            error = scatter(second - ratio * first) / first.sum()
        found[name] = {"ratio": float(ratio), "low": float(ratio - error), "high": float(ratio + error)}
    return found


def ensembles(runs, by=None):
    """The runs by the value of an option, in order: [(value, runs)]. They may differ in seeds only, else it is refused."""
    groups = {}
    for run in runs:
        groups.setdefault(run["options"].get(by, "") if by else "", []).append(run)
    free = ("out_", "summary", "progress", "ts_max_", "restart", "sweep_")
    for value, members in groups.items():
        first = members[0]["options"]
        for run in members[1:]:
            other = [name for name in first if run["options"].get(name) != first[name] and name not in SEEDS and
                     not name.startswith(free)]
            if other:
                raise Unusable(f"{members[0]['path']} and {run['path']} differ in {', '.join(sorted(other))}: no ensemble "
                               f"(--by {other[0]} makes one of each)")
    numbers = all(is_number(value) for value in groups)
    return sorted(groups.items(), key=lambda item: float(item[0]) if numbers else item[0])


def is_number(text):
    try:
        float(text)
        return True
    except ValueError:
        return False


def statistics(runs, bounds=None):
    """All that the table says of one ensemble."""
    m = np.concatenate([magnitudes(run) for run in runs])
    if len(m) == 0:
        raise Unusable("has no events in the time that counts")
    low, high = bounds or usual_bounds(m)
    b, error, number = fit(m, low, high)
    nodes = len(runs[0]["x"])
    way, shift = sum(run["way"] for run in runs), sum(abs(run["shift"]) for run in runs)
    moment = np.concatenate([run["events"]["moment"] for run in runs])
    extent = np.concatenate([run["events"]["extent"] for run in runs])
    cuts = [{"low": float(low + shift), "b": fit(m, low + shift, high)[0],
             "interval": interval(runs, low + shift, high)} for shift in (-1, -0.5, 0, 0.5, 1) if low + shift < high - 0.5]
    return {"runs": len(runs), "nodes": nodes, "events": len(m), "per_node_and_way": len(m) / (nodes * way),
            "moment_per_node_and_way": moment_per_shift(runs, nodes * shift), "largest_extent": float(extent.max()),
            # what a large event is: the moment's own mean, each event counted with its moment
            "typical_moment": float((moment**2).sum() / moment.sum()),
            "fit": [float(low), float(high)], "in_fit": number, "b": b, "b_error_if_independent": error,
            "b_interval": interval(runs, low, high), "p": goodness(m, low, high), "halves": halves(runs), "cuts": cuts}


def touching(run, k):
    """Which regions touch that of event k, itself included."""
    x, events = run["x"], run["events"]
    n, spacing = len(x), x[1] - x[0] if len(x) > 1 else 1.
    left = np.rint((events["left"] - x[0]) / spacing).astype(int)
    count = np.rint(events["extent"] / spacing).astype(int)
    if run["options"].get("bc_left") == "periodic":
        return ((left - left[k]) % n <= count[k]) | ((left[k] - left) % n <= count)
    return (left <= left[k] + count[k]) & (left[k] <= left + count)


def window_of(run):
    """A fiftieth of the way of the plate over which its springs take up the friction force."""
    o = run["options"]
    if o["model_form"] != "chain":
        return 0.02 * float(o["model_gamma"])
    if not float(o["model_k0"]) > 0:
        raise Unusable("has model_k0 0: say how far the plate moves, --window (with --main)")
    return 0.02 * float(o["model_f0"]) / float(o["model_k0"])


def sequences(runs, main, window):
    """Foreshocks and aftershocks of the main shocks, as --main says; None where there is no main shock."""
    mains = fore = after = expected = 0
    for run in runs:
        m, way = run["events"]["magnitude"], run["plate"].way(run["events"]["begin"])
        low, high = (float(run["plate"].way(run[end])) for end in ("begin", "end"))
        for k in np.flatnonzero((m >= main) & (way >= low + window) & (way <= high - window)):
            near = touching(run, k)
            since = way - way[k]
            if (m[near & (np.abs(since) <= window)] > m[k]).any():
                continue
            smaller = near & (m < m[k])
            mains += 1
            fore += int((smaller & (since >= -window) & (since < 0)).sum())
            after += int((smaller & (since > 0) & (since <= window)).sum())
            expected += smaller.sum() * window / (high - low)
    if mains == 0:
        return None
    return {"main": main, "window": window, "main_shocks": mains, "foreshocks": fore / mains,
            "foreshocks_error": np.sqrt(fore) / mains, "aftershocks": after / mains,
            "aftershocks_error": np.sqrt(after) / mains, "by_mean_rate": float(expected / mains)}


def moment_per_shift(runs, shift):
    """nan where the plate has gone forth and back alone."""
    return float(sum(signed_moments(run).sum() for run in runs) / shift) if shift > 0 else np.nan


def size_exponent(table):
    """d ln(typical moment)/d ln(nodes) between ensembles of several sizes, by least squares; nan with fewer than two."""
    n = np.log([row["nodes"] for row in table.values()])
    if len(set(n)) < 2:
        return np.nan
    return float(np.polyfit(n, np.log([row["typical_moment"] for row in table.values()]), 1)[0])


# ---- what a user sees ---------------------------------------------------------------------------------------------------

def words(name, row):
    low, high = row["b_interval"]
    yield f"{name}: {row['runs']} runs of {row['nodes']} nodes, {row['events']} events, " \
          f"{row['per_node_and_way']:.4g} per node and displacement of the plate"
    if not np.isfinite(row["b"]):
        yield f"  no b: {row['in_fit']} events in [{row['fit'][0]:g}, {row['fit'][1]:g}), and a fit takes {FEWEST}"
    else:
        straight = "" if row["p"] >= 0.05 else ", not a straight line"
        yield f"  b = {row['b']:.3f} [{low:.3f}, {high:.3f}] on [{row['fit'][0]:g}, {row['fit'][1]:g}) from {row['in_fit']} " \
              f"events, p = {row['p']:.3f}{straight}"
        yield "  cut: " + ", ".join(f"{c['low']:g}: {c['b']:.3f} [{c['interval'][0]:.3f}, {c['interval'][1]:.3f}]"
                                    for c in row["cuts"] if np.isfinite(c["b"]))
    yield "  halves: " + ", ".join(f"{what} {h['ratio']:.3f} [{h['low']:.3f}, {h['high']:.3f}]"
                                   for what, h in row["halves"].items())
    yield f"  moment {row['moment_per_node_and_way']:.3f} of the plate's displacement, " \
          f"typical event {row['typical_moment']:.4g}, largest extent {row['largest_extent']:g}"


def sequence_words(found, main):
    if found is None:
        return f"  no main shock of magnitude {main:g} or more"
    return f"  {found['main_shocks']} main shocks, each with {found['foreshocks']:.3g} +- {found['foreshocks_error']:.1g} " \
           f"foreshocks and {found['aftershocks']:.3g} +- {found['aftershocks_error']:.1g} aftershocks, " \
           f"by the mean rate {found['by_mean_rate']:.3g}"


def draw_density(axes, each, scale, colour, unit=1.):
    """How many events there are of each magnitude, from the magnitudes of each run: bins without any left out, errors those of
    the logarithm (of fewer than three runs by Poisson's law, else from the scatter of runs). The axis has ln M times `unit`.
    Returns the line."""
    edges = bins(np.concatenate(each))
    each = np.array([np.histogram(m, edges)[0] for m in each])
    counts = each.sum(axis=0).astype(float)
    counts[counts == 0] = np.nan
    error = (np.sqrt(counts) if len(each) < 3 else np.std(each, axis=0, ddof=1) * np.sqrt(len(each))) / counts
    bars = counts * [-np.expm1(-error), np.expm1(error)]
    scale = scale * unit
    return axes.errorbar(unit * (edges[:-1] + edges[1:]) / 2, counts / scale, bars / scale, fmt="o-", ms=2.5, lw=0.8,
                         elinewidth=0.6, color=colour)[0]


def picture(groups, table, by):
    """Curves of all ensembles, and b against the smallest event."""
    from style import COLOURS, Picture, axis_name, name_axes
    figure = Picture(3.6)
    curve, cut = figure.subplots(1, 2)
    for k, ((value, runs), row) in enumerate(zip(groups, table.values())):
        colour, way = COLOURS[k % len(COLOURS)], sum(run["way"] for run in runs)
        line = draw_density(curve, [magnitudes(run) for run in runs], row["nodes"] * way * WIDTH, colour)
        figure.label(curve, f"{axis_name(by)} = {value}" if by else f"{len(runs)} runs", line)
        good = [c for c in row["cuts"] if np.isfinite(c["b"])]
        b = np.array([c["b"] for c in good])
        bars = [b - [c["interval"][0] for c in good], [c["interval"][1] for c in good] - b]
        at = np.array([c["low"] for c in good]) + 0.06 * (k - (len(groups) - 1) / 2)  # side by side
        cut.errorbar(at, b, np.maximum(bars, 0), fmt="o-", ms=3, lw=1, capsize=2, color=colour)
    curve.set_yscale("log")
    name_axes(curve, "magnitude ln M", DENSITY.format("ln M"))
    name_axes(cut, "smallest magnitude ln M in the fit", "b, with its 95 % interval over the runs")
    figure.title(scene_of(groups, by))
    return figure


def scene_of(groups, by):
    with reading(groups[0][1][0]["path"]) as file:
        return scene_title(file, (by,) if by else ())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--by")
    parser.add_argument("--fit", nargs=2, type=float)
    parser.add_argument("--from", dest="begin", type=float, default=0)
    parser.add_argument("--main", type=float)
    parser.add_argument("--window", type=float)
    parser.add_argument("-o", "--output")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    if arguments.window is not None and (arguments.main is None or not arguments.window > 0):
        parser.error("--window goes with --main and is positive")
    path = arguments.files[0]
    try:
        runs = []
        for path in arguments.files:
            runs.append(read(path, arguments.begin))
        path = arguments.files[0]
        groups = ensembles(runs, arguments.by)
        if arguments.by and any(value == "" for value, _ in groups):
            raise Unusable(f"has no option {arguments.by} (--by)")
        table = {}
        for value, members in groups:
            path = members[0]["path"]
            name = f"{arguments.by} {value}" if arguments.by else "all"
            table[name] = statistics(members, arguments.fit)
            print("\n".join(words(name, table[name])))
            if arguments.main is not None:
                table[name]["sequences"] = sequences(members, arguments.main, arguments.window or window_of(members[0]))
                print(sequence_words(table[name]["sequences"], arguments.main))
        if arguments.by and np.isfinite(size_exponent(table)):
            print(f"typical moment ~ nodes^{size_exponent(table):.2f}")
        if arguments.json:
            with open(arguments.json, "w", encoding="utf-8") as file:
                json.dump(table, file, indent=1)
        if arguments.output:
            picture(groups, table, arguments.by).savefig(arguments.output)
            print(arguments.output)
    except Unusable as error:
        sys.exit(f"catalogue.py: error: {path}: {error}")


if __name__ == "__main__":
    main()
