"""Pictures of charts: error against seconds, and where each method fails."""
import numpy as np
from matplotlib.ticker import LogLocator, NullLocator

from stickslip import Unusable, scene_title, shown_name, text
from style import BLUE, GREEN, GREY, OCHRE, RED, REFERENCE, Picture, course, logarithmic, typeset

# How a method fails: name in the file, mark, colour, filled, words.
FAILURES = (("shortest", "^", GREEN, True, "shortest wave grows falsely"),
            ("shortest_theory", "^", GREEN, False, "shortest wave, by theory"),
            ("damps", "D", OCHRE, True, "unstable sliding comes out stable"),
            ("damps_theory", "D", OCHRE, False, "unstable sliding, by theory"))
ENDS = {"blow-up": ("x", "blow-up"), "": (">", "longest step tried: ends, but wrong")}
OTHER_END = ("+", "Newton fails, or ψ out of bounds")


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
        columns = min(len(self.groups), 3)
        lines = -(-len(self.groups) // columns)
        height = 0.55 + 0.19 * len(self.rows)
        picture = Picture(lines * height + height_of_key + 0.4)
        grid = picture.add_gridspec(lines + 1, columns, height_ratios=[height] * lines + [height_of_key])
        values = np.concatenate([self.value[name][np.isfinite(self.value[name])] for name in shown])
        panels = []
        for k, group in enumerate(self.groups):
            axes = picture.add_subplot(grid[divmod(k, columns)])
            panels.append((axes, [row for row, place in enumerate(self.places) if place == group]))
            words = [f"{shown_name(self.parameter)} = {group[0]:g}"] if self.parameter else []
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
    picture, panels, key = limits.panels(0.8, ("followed", "limit", "longest", *(name for name, *_ in FAILURES)))
    seen = {}

    def mark(axes, x, row, words, symbol, colour, filled=True):
        seen[words], = axes.plot(x, limits.height(row), symbol, color=colour, mfc=colour if filled else "none", mew=1.3, zorder=3,
                                 ms=5 if filled else 7, ls="none")
    for axes, rows in panels:
        for row in rows:
            right, limit, longest = (limits.value[name][row] for name in ("followed", "limit", "longest"))
            end = limit if np.isfinite(limit) else longest
            if np.isfinite(end) and np.isfinite(right) and end > right:
                seen["ends, but wrong"], = axes.plot([right, end], [limits.height(row)] * 2, color="0.75", lw=3, zorder=1,
                                                     solid_capstyle="butt")
            symbol, words = ENDS.get(limits.how[row], OTHER_END)
            if np.isfinite(end):
                mark(axes, end, row, words, symbol, RED if limits.how[row] else GREY)
            for name, symbol, colour, filled, words in FAILURES:
                measured = limits.value[name.removesuffix("_theory")][row]  # which theory agrees with, as a rule
                if np.isfinite(limits.value[name][row]) and (filled or not np.isfinite(measured)):
                    mark(axes, limits.value[name][row], row, words, symbol, colour, filled)
        axes.grid(axis="y", color="0.93", lw=0.7)
        axes.set_axisbelow(True)
    key.legend(seen.values(), [typeset(words) for words in seen], loc="center", ncols=2)
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
    drawn = np.isfinite(error) & np.isfinite(seconds) & (error > 0)
    if not drawn.any():
        raise Unusable("holds no row with an error")
    all_rows = np.flatnonzero(drawn)
    best = all_rows[lower_front(seconds[drawn], error[drawn])]
    spread = len({*zip(order[drawn], n[drawn])}) > 1
    changed = [k for k, before in zip(best, [None, *best]) if before is None or (order[k], n[k]) != (order[before], n[before])]
    changed, columns = changed if spread else [], 4
    lines = -(-len(changed) // columns)
    picture = Picture(4.8 + 0.17 * lines)
    axes, *table = np.atleast_1d(picture.subplots(2, 1, height_ratios=[4.8, 0.17 * lines]) if lines else picture.subplots())
    for k, name in enumerate(dict.fromkeys(names[drawn])):
        rows = np.flatnonzero(drawn & (names == name))
        rows = rows[lower_front(seconds[rows], error[rows])]
        style = course(k)
        line, = axes.plot(seconds[rows], error[rows], marker="o", ms=3, mfc="w", alpha=0.45, **{**style, "lw": 1})
        bold = np.isin(rows, best)
        together = np.where(bold | np.r_[False, bold[:-1] & bold[1:]], error[rows], np.nan)
        axes.plot(seconds[rows], together, marker="o", ms=5, **{**style, "lw": 2.8}, zorder=3)
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
