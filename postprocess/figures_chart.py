"""Pictures of charts: error against seconds, and where each method fails."""
import zlib

import numpy as np
from matplotlib.ticker import LogLocator, NullLocator

from stickslip import Unusable, scene_title, text
from style import (BLACK, BLUE, COLOURS, GREEN, GREY, OCHRE, RED, REFERENCE, SLATE, VIOLET, Picture, axis_name, logarithmic,
                   typeset)

# How a method fails: name in the file, mark, colour, words. Where it was not met the step that theory gives stands open.
FAILURES = (("shortest", "^", GREEN, "a wave two nodes long grows falsely"), ("damps", "D", OCHRE, "unstable sliding comes out stable"))
BY_THEORY = "open: by theory, not met in a run"
ENDS = {"blow-up": ("x", "blows up"), "": (">", "still so at the longest step tried")}
OTHER_END = ("+", "Newton fails, or ψ out of bounds")
# One method has one look in all charts: of these the colours differ, the marks say the family and what is implicit.
COLOUR = {"rk:3bs": BLUE, "rk:5dp": RED, "rk:7vr": GREEN, "rk:8vr": VIOLET, "arkimex:3": OCHRE, "arkimex:4": SLATE, "arkimex:5": BLACK,
          "rosw:ra34pw2": VIOLET}
MARK = {"rk": "o", "arkimex": "s", "rosw": "D", "bdf": "^", "theta": "v", "cn": "v", "beuler": "v", "alpha": "v"}


def look(method, implicit=""):
    """Colour and mark of a method, that of exact stick where friction is smoothed."""
    method = method.partition(",")[0]
    mark = {"wave": "<", "both": ">"}.get(implicit) if method.startswith("arkimex") else None
    return {"color": COLOUR.get(method, COLOURS[zlib.crc32(method.encode()) % len(COLOURS)]),
            "marker": mark or MARK.get(method.partition(":")[0], "X")}


class Limits:
    """Rows of a chart of limits: a panel for each value and grid, a line for each method."""

    def __init__(self, file):
        self.file, self.value = file, {name: file[name][...] for name in file if file[name].dtype.kind == "f"}
        method, implicit, self.how = ([text(value) for value in file[name][...]] for name in ("method", "implicit", "how"))
        varied = np.nan_to_num(self.value["value"])  # nan where no option is varied, which is not equal to itself
        self.places = list(zip(varied, self.value["order"].astype(int), self.value["n"].astype(int)))
        self.groups = list(dict.fromkeys(self.places))
        self.names = [m + (f" ({i})" if m.startswith("arkimex") else "") for m, i in zip(method, implicit)]
        self.rows = list(dict.fromkeys(self.names))
        self.parameter = text(file.attrs["parameter"])

    def panels(self, height_of_key, shown):
        """The picture with a panel for each group, over the steps of the names `shown`, and the axes of the key."""
        columns = 2 if len(self.groups) == 4 else min(len(self.groups), 3)
        lines = -(-len(self.groups) // columns)
        height = 0.55 + 0.19 * len(self.rows)
        picture = Picture(lines * height + height_of_key + 0.4)
        grid = picture.add_gridspec(lines + 1, columns, height_ratios=[height] * lines + [height_of_key])
        values = np.concatenate([self.value[name][np.isfinite(self.value[name])] for name in shown])
        panels = []
        for k, group in enumerate(self.groups):
            axes = picture.add_subplot(grid[divmod(k, columns)])
            panels.append((axes, [row for row, place in enumerate(self.places) if place == group]))
            words = [f"{axis_name(self.parameter)} = {group[0]:g}"] if self.parameter else []
            words += [f"order {group[1]}, n = {group[2]}"] if len({g[1:] for g in self.groups}) > 1 else []
            axes.set_title(typeset(", ".join(words)))
            axes.set_yticks(range(len(self.rows)), self.rows[::-1] if k % columns == 0 else [""] * len(self.rows))
            axes.set(xlim=(values.min() / 2, values.max() * 2), ylim=(-0.7, len(self.rows) - 0.3))
            logarithmic(axes, "x")
            axes.xaxis.set_major_locator(LogLocator(numticks=9 if columns == 1 else 5))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.tick_params(axis="y", length=0)
            if k >= len(self.groups) - columns:
                axes.set_xlabel("fixed step")
        key = picture.add_subplot(grid[-1, :])
        key.set_axis_off()
        return picture, panels, key

    def height(self, row):
        return len(self.rows) - 1 - self.rows.index(self.names[row])


def draw_limits(file, args=None):
    """Of each method the fixed steps that are right; with --fails how longer ones go wrong."""
    return draw_fails(file) if args and args.fails else draw_right(file)


def draw_right(file):
    limits = Limits(file)
    picture, panels, key = limits.panels(0.4, ("followed", "theory"))
    for axes, rows in panels:
        left = axes.get_xlim()[0]
        for row in rows:
            longest, theory = limits.value["followed"][row], limits.value["theory"][row]
            if np.isfinite(longest):
                bar = axes.barh(limits.height(row), longest - left, left=left, height=0.62, color=BLUE)
            if np.isfinite(theory):
                axes.plot(theory, limits.height(row), "|", ms=11, mew=2, color=RED)
    handles = [bar, axes.plot([], [], "|", ms=11, mew=2, color=RED, ls="none")[0]]
    key.legend(handles, ["regime, amplitude and speed right", "theory: waves on the steepest friction explode"],
               loc="center", ncols=2)
    picture.title("Steps that are right: " + scene_title(file, [limits.parameter]))
    return picture


def draw_fails(file):
    limits = Limits(file)
    names = [name + end for name, *_ in FAILURES for end in ("", "_theory")]
    picture, panels, key = limits.panels(0.65, ("followed", "limit", "longest", *names))
    seen = {}

    def mark(axes, x, row, words, symbol, colour, filled=True):
        line, = axes.plot(x, limits.height(row), symbol, color=colour, mfc=colour if filled else "w", mew=1.3, zorder=3, ms=5, ls="none")
        if filled or words not in seen:
            seen[words] = line
    for axes, rows in panels:
        for row in rows:
            right, limit, longest = (limits.value[name][row] for name in ("followed", "limit", "longest"))
            end = limit if np.isfinite(limit) else longest
            if np.isfinite(end) and np.isfinite(right) and end > right:
                seen["ends, but is wrong"], = axes.plot([right, end], [limits.height(row)] * 2, color="0.75", lw=3, zorder=1,
                                                     solid_capstyle="butt")
            symbol, words = ENDS.get(limits.how[row], OTHER_END)
            if np.isfinite(end):
                mark(axes, end, row, words, symbol, RED if limits.how[row] else GREY)
            for name, symbol, colour, words in FAILURES:
                met, theory = limits.value[name][row], limits.value[name + "_theory"][row]
                if np.isfinite(met) or np.isfinite(theory):
                    mark(axes, met if np.isfinite(met) else theory, row, words, symbol, colour, filled=np.isfinite(met))
                if not np.isfinite(met) and np.isfinite(theory):
                    seen[BY_THEORY], = axes.plot([], [], "o", mec=GREY, mfc="w", mew=1.3, ms=5, ls="none")
        axes.grid(axis="y", color="0.93", lw=0.7)
        axes.set_axisbelow(True)
    order = ["ends, but is wrong", *(words for _, words in (*ENDS.values(), OTHER_END)), *(words for *_, words in FAILURES), BY_THEORY]
    shown = [words for words in order if words in seen]
    key.legend([seen[words] for words in shown], [typeset(words) for words in shown], loc="center", ncols=2)
    picture.title("How longer steps fail: " + scene_title(file, [limits.parameter]))
    return picture


def lower_front(seconds, error):
    """Indices of the rows that no other beats in both, by time."""
    order = np.lexsort((error, seconds))
    least, kept = np.inf, []
    for k in order:
        if error[k] < least:
            least = error[k]
            kept.append(k)
    return np.array(kept, dtype=int)


def draw_chart(file, args):
    """Error against processor time: of each method the front of its rows over all grids and orders, faint; bold where it
    is the front of all methods."""
    if text(file.attrs.get("chart_kind", "")) == "limits":
        return draw_limits(file, args)
    if "cost" not in file:
        raise Unusable("is a chart of another kind, of which there is no picture")
    error, seconds = file["error"][...], file["cost"][...]
    order, n = (file[name][...].astype(int) for name in ("order", "n"))
    method, implicit = ([text(value) for value in file[name][...]] for name in ("method", "implicit"))
    names = np.array([m + (f", {i} implicit" if m.startswith("arkimex") and i not in ("none", "auto") else "")
                      for m, i in zip(method, implicit)], object)
    looks = {name: look(m, i) for name, m, i in zip(names, method, implicit)}
    drawn = np.isfinite(error) & np.isfinite(seconds) & (error > 0)
    if not drawn.any():
        raise Unusable("holds no row with an error")
    all_rows = np.flatnonzero(drawn)
    best = all_rows[lower_front(seconds[drawn], error[drawn])]
    spread = len({*zip(order[drawn], n[drawn])}) > 1
    changed = [k for k, before in zip(best, [None, *best]) if before is None or (order[k], n[k]) != (order[before], n[before])]
    changed = changed if spread else []
    picture = Picture(4.8)
    columns = max(1, int(picture.get_figwidth() // 1.6))
    lines = -(-len(changed) // columns)
    picture.grow(0.17 * lines)
    axes, *table = np.atleast_1d(picture.subplots(2, 1, height_ratios=[picture.get_figheight() - 0.17 * lines, 0.17 * lines]) if lines else picture.subplots())
    for name in dict.fromkeys(names[drawn]):
        rows = np.flatnonzero(drawn & (names == name))
        rows = rows[lower_front(seconds[rows], error[rows])]
        line, = axes.plot(seconds[rows], error[rows], ms=3, mfc="w", alpha=0.45, lw=1, **looks[name])
        bold = np.isin(rows, best)
        together = np.where(bold | np.r_[False, bold[:-1] & bold[1:]], error[rows], np.nan)
        axes.plot(seconds[rows], together, ms=5, lw=2.8, zorder=3, **looks[name])
        picture.label(axes, name, line)
    axes.set(xlabel="processor time in seconds, median of the repetitions", ylabel=typeset("largest error of ψ and η at the end"))
    for which in "xy":
        logarithmic(axes, which)
    for number, k in enumerate(changed):
        picture.label(axes, str(number + 1), seconds[k], error[k], GREY)
        column, line = divmod(number, lines)
        table[0].text((column + 0.05) / columns, 1 - (line + 0.5) / lines, typeset(f"{number + 1}: order {order[k]}, n = {n[k]}"),
                      va="center", color=GREY)
    for panel in table:
        panel.set_axis_off()
    reference = float(file.attrs["reference_error"])
    if np.isfinite(reference) and reference * 100 > error[drawn].min() / 30:
        picture.label(axes, "100 times the reference's error", axes.axhline(100 * reference, **REFERENCE))
    dropped = int((~drawn).sum())
    picture.title(scene_title(file) + "\nbold: the best of all methods"
                  + (f"; {dropped} of {len(error)} rows have no error to draw" if dropped else ""))
    return picture
