"""Pictures of charts: error against seconds, and where each method fails."""
import textwrap

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from figures import COLOURS
from stickslip import Unusable, scene_title, shown_name, text


def draw_limits(file):
    """For each method the steps that are right, those that end all the same, and the limits of theory."""
    method, implicit, how = ([text(value) for value in file[name][...]] for name in ("method", "implicit", "how"))
    varied = np.nan_to_num(file["value"][...])  # nan where no option is varied, which is not equal to itself
    places = list(zip(varied, file["order"][...].astype(int), file["n"][...].astype(int)))
    groups = list(dict.fromkeys(places))
    names = [m + (f" ({i})" if m.startswith("arkimex") else "") for m, i in zip(method, implicit)]
    rows = list(dict.fromkeys(names))
    value = {name: file[name][...] for name in ("theory", "limit", "followed", "damps", "damps_theory", "shortest",
                                                "shortest_theory", "longest")}
    finite = np.concatenate([v[np.isfinite(v)] for v in value.values()])
    low, high = finite.min() / 2, finite.max() * 1.6
    columns = min(len(groups), 4)
    lines = -(-len(groups) // columns)
    figure = Figure(figsize=(3.2 + 3.4 * columns if columns > 1 else 8.6, lines * (0.6 + 0.25 * len(rows)) + 1.2),
                    layout="constrained")
    height = 0.6 + 0.25 * len(rows)
    grid = figure.add_gridspec(lines + 1, columns, height_ratios=[height] * lines + [0.8])
    panels = np.array([[figure.add_subplot(grid[i, j]) for j in range(columns)] for i in range(lines)])
    parameter = text(file.attrs["parameter"])
    for panel, group in zip(panels.flat, groups):
        for k, key in enumerate(places):
            if key != group:
                continue
            y = len(rows) - 1 - rows.index(names[k])
            followed = value["followed"][k] if np.isfinite(value["followed"][k]) else low
            ends = value["limit"][k] if np.isfinite(value["limit"][k]) else value["longest"][k]
            panel.barh(y, np.log(followed / low), left=0, height=0.62, color="#0b5394")
            panel.barh(y, np.log(max(ends, followed) / followed), left=np.log(followed / low), height=0.62,
                       color="#cfe2f3")
            if how[k]:
                panel.plot(np.log(ends / low), y, "x" if how[k] == "blow-up" else "+", color="#cc4125", ms=7, mew=1.6)
            for name, mark, fill in (("theory", "|", True), ("damps", "D", True), ("damps_theory", "D", False),
                                     ("shortest", "^", True), ("shortest_theory", "^", False)):
                if np.isfinite(value[name][k]):
                    big = 12 if mark == "|" else 7 if not fill else 4
                    panel.plot(np.log(value[name][k] / low), y, mark, ms=big, mew=1.3, zorder=3,
                               color={"|": "0.1", "D": "#b7791f", "^": "#38761d"}[mark],
                               mfc={"D": "#b7791f", "^": "#38761d"}.get(mark, "none") if fill else "none")
        title = [] if not parameter else [f"{shown_name(parameter)} = {group[0]:g}"]
        if len({g[1:] for g in groups}) > 1:
            title.append(f"order {group[1]}, n = {group[2]}")
        panel.set_title(", ".join(title))
        panel.set_yticks(range(len(rows)), rows[::-1] if panel in panels[:, 0] else [""] * len(rows), fontsize=8)
        ticks = [f * 10.0 ** e for e in range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
                 for f in ((1,) if high > 1e3 * low else (1, 3) if high > 30 * low else (1, 2, 5))]
        ticks = [t for t in ticks if low <= t <= high]
        panel.set_xticks([np.log(t / low) for t in ticks], [f"{t:g}" for t in ticks])
        panel.set_xlim(0, np.log(high / low))
        panel.tick_params(axis="y", length=0)
    for panel in panels.flat[len(groups):]:
        panel.set_axis_off()
    for panel in panels[-1]:
        panel.set_xlabel("fixed step")
    keys = [("s", "#0b5394", "#0b5394", "regime, amplitude and speed right"),
            ("s", "#cfe2f3", "#cfe2f3", "ends, but wrong"),
            ("x", "#cc4125", "none", "blow-up"), ("+", "#cc4125", "none", "Newton fails, or ψ out of bounds"),
            ("|", "0.1", "none", "theory: waves on steepest friction explode"),
            ("^", "#38761d", "#38761d", "shortest wave grows falsely (hollow: theory)"),
            ("D", "#b7791f", "#b7791f", "unstable sliding comes out stable (hollow: theory)")]
    handles = [panels.flat[0].plot([], [], mark, color=colour, mfc=fill, label=label, ls="none", mew=1.5)[0]
               for mark, colour, fill, label in keys]
    keys_below = figure.add_subplot(grid[-1, :])
    keys_below.set_axis_off()
    keys_below.legend(handles=handles, loc="center", ncol=2 if columns < 3 else 3, fontsize=8)
    figure.suptitle(scene_title(file, [parameter]), fontsize=10)
    return figure


def lower_front(seconds, error):
    """Indices of the rows that no other beats in both, by time."""
    order = np.lexsort((error, seconds))
    least, kept = np.inf, []
    for k in order:
        if error[k] < least:
            least = error[k]
            kept.append(k)
    return np.array(kept, dtype=int)


def quickest(seconds, error, among, wanted):
    """The row among these that reaches the error wanted in the least time; None where none does."""
    good = [k for k in np.flatnonzero(among) if error[k] <= wanted]
    return min(good, key=lambda k: seconds[k], default=None)


def seconds_text(seconds):
    return f"{1e3 * seconds:.2g} ms" if seconds < 0.0995 else f"{seconds:.2g} s"


def draw_chart(file, args):
    """Error against processor time: a line for each method and order, through the rows of it that no other row of it
    beats; the front of all rows bold; and for round errors the winner and the quickest IMEX method in words."""
    if text(file.attrs.get("chart_kind", "")) == "limits":
        return draw_limits(file)
    if "cost" not in file:
        raise Unusable("is a chart of another kind, of which there is no picture")
    error, seconds = file["error"][...], file["cost"][...]
    order, n = (file[name][...].astype(int) for name in ("order", "n"))
    method, implicit = ([text(value) for value in file[name][...]] for name in ("method", "implicit"))
    imex = np.array([m.startswith("arkimex") for m in method])
    names = [m + (f", {i} implicit" if split and i not in ("none", "auto") else "")
             for m, i, split in zip(method, implicit, imex)]
    drawn = np.isfinite(error) & np.isfinite(seconds) & (error > 0)
    if not drawn.any():
        raise Unusable("holds no row with an error")
    figure = Figure(figsize=(9.4, 5.8), layout="constrained")
    axes = figure.subplots()
    marks = dict(zip(sorted(set(order)), "osD^"))
    colours = {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(dict.fromkeys(names))}
    for name in colours:
        for one in sorted(set(order)):
            rows = np.flatnonzero(drawn & (order == one) & np.array([other == name for other in names]))
            if len(rows) == 0:
                continue
            rows = rows[lower_front(seconds[rows], error[rows])]
            axes.plot(seconds[rows], error[rows], marker=marks[one], ms=4, lw=1.1, color=colours[name], mfc="w",
                      ls="--" if imex[rows[0]] else "-", alpha=0.85, clip_on=False)
    all_rows = np.flatnonzero(drawn)
    front = all_rows[lower_front(seconds[drawn], error[drawn])]
    axes.plot(seconds[front], error[front], color="0.1", lw=3.2, alpha=0.35, zorder=1, solid_capstyle="round")
    axes.set(xscale="log", yscale="log", xlabel="processor time in seconds, median of the repetitions",
             ylabel="largest error of ψ and η at the end")
    span = np.log10(seconds[drawn].max() / seconds[drawn].min())
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if span < 1.7 else (1,), numticks=12))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    for name, colour in colours.items():
        if any(drawn[k] and names[k] == name for k in range(len(names))):
            axes.plot([], [], color=colour, label=name, ls="--" if name.startswith("arkimex") else "-")
    for value, mark in marks.items():
        axes.plot([], [], mark, color="0.4", mfc="none", label=f"order {value} in x")
    axes.plot([], [], color="0.1", lw=3.2, alpha=0.35, label="best of all")
    if imex.any():
        axes.plot([], [], color="0.4", ls="--", label="dashed: IMEX")
    reference = float(file.attrs["reference_error"])
    if np.isfinite(reference) and reference * 100 > error[drawn].min() / 30:
        axes.axhline(100 * reference, color="0.6", lw=0.8, ls=":", label="100 times the reference's error")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    lines = []
    for wanted in (1e-2, 1e-4, 1e-6, 1e-8):
        best, split = (quickest(seconds, error, drawn & chosen, wanted) for chosen in (True, imex))
        if best is None:
            continue
        lines.append(f"error ≤ {wanted:g}: {names[best]}, order {order[best]}, n = {n[best]}: {seconds_text(seconds[best])}")
        if imex.any() and best != split:
            lines.append("    IMEX: never" if split is None else
                         f"    IMEX: {names[split]}: {seconds[split] / seconds[best]:.2g} times as long")
    axes.text(1.02, 0.0, "\n".join(lines), transform=axes.transAxes, fontsize=7.5, color="0.25", va="bottom")
    dropped = int((~drawn).sum())
    if dropped:
        axes.text(0.01, 0.01, f"{dropped} of {len(error)} rows have no error to draw", transform=axes.transAxes,
                  fontsize=8, color="0.4")
    figure.suptitle(textwrap.fill(scene_title(file), 110), fontsize=10)
    return figure
