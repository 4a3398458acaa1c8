"""Pictures of stability diagrams: where sliding loses stability, where the stick-slip beside it ends, and where uniform
stick-slip and trains withstand waves."""
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from figures import COLOURS, legend_beside, set_title
from figures_analysis import add_train_limits
from stickslip import Unusable, differing, options, scene_title, shown_name, text, told_apart

SLIDES, STICKS, BOTH = "#eef4fb", "#fbeeea", "#fdf3d0"  # tints of the regions
CURVES = {"sliding": (COLOURS[0], "sliding loses stability"), "stick-slip": (COLOURS[3], "stick-slip ends"),
          "waves": (COLOURS[2], "waves begin to grow on uniform stick-slip"),
          "trains": (COLOURS[6], "trains lose stability or end")}
HATCHES = {"waves": ("//", "uniform stick-slip stable on the ring"), "trains": ("\\\\", "trains stable on the ring")}


class Diagram:
    """What the file of `boundary` in two options holds."""

    def __init__(self, file):
        self.file = file
        self.names = [text(file.attrs["parameter"]), text(file.attrs["parameter2"])]
        self.value, self.value2, self.piece = (file[name][...] for name in ("value", "value2", "piece"))
        of = [text(one) for one in file["of"][...]] if "of" in file else ["sliding"] * len(self.value)
        self.of = np.array(of, dtype=object)
        self.knows_end = "stick_slip_distance" in file

    def pieces(self, of):
        """Each piece of the curve of `sliding`, `stick-slip`, `waves` or `trains` as its points."""
        chosen = self.of == of
        return [chosen & (self.piece == number) for number in np.unique(self.piece[chosen])]

    def box(self):
        """The ends of both axes."""
        prefix = "sample" if "sample" in self.file else "stick_slip_sample"
        return [self.file[prefix + suffix][...][[0, -1]] for suffix in ("", "2")]

    def unit(self, x, y):
        """Places in the box as numbers from 0 to 1."""
        result = []
        for values, (low, high), log in zip((x, y), self.box(), ("log", "log2")):
            change = np.log if self.file.attrs[log] else np.asarray
            result.append((change(np.asarray(values, dtype=float)) - change(low)) / (change(high) - change(low)))
        return result

    def even(self):
        """Many places on each axis."""
        return [(np.geomspace if self.file.attrs[log] else np.linspace)(*ends, 241)
                for ends, log in zip(self.box(), ("log", "log2"))]

    def nearest(self, of, u, w):
        """Of places of the unit box: the distance from the nearest stretch of the curve, on which hand of it they lie (1:
        left), and the number of its piece."""
        nearest, hand, number = np.full(u.shape, np.inf), np.zeros(u.shape), np.zeros(u.shape, dtype=int)
        for index, chosen in enumerate(self.pieces(of)):
            a, b = self.unit(self.value[chosen], self.value2[chosen])
            for k in range(len(a) - 1):
                du, dw = a[k + 1] - a[k], b[k + 1] - b[k]
                length = du * du + dw * dw
                if length == 0:
                    continue
                t = np.clip(((u - a[k]) * du + (w - b[k]) * dw) / length, 0, 1)
                distance = np.hypot(u - a[k] - t * du, w - b[k] - t * dw)
                closer = distance < nearest
                nearest, number = np.where(closer, distance, nearest), np.where(closer, index, number)
                hand = np.where(closer, np.sign(du * (w - b[k]) - dw * (u - a[k])), hand)
        return nearest, hand, number

    def inside(self, x, y, of):
        """Whether sliding is unstable, uniform stick-slip lives, or no wave grows on it, at places of the box: by the side of
        the nearest stretch of its curve, where there is one, else as the lattice has it."""
        lattice = {"sliding": lambda: self.file["growth"][...] > 0,
                   "stick-slip": lambda: self.file["stick_slip_distance"][...] < 0,
                   "waves": lambda: self.file["wave_growth"][...] < 0}[of]()
        u, w = self.unit(x, y)
        side = len(lattice) - 1
        by_lattice = lattice[np.clip(np.rint(w * side).astype(int), 0, side),
                             np.clip(np.rint(u * side).astype(int), 0, side)]
        nearest, hand, _ = self.nearest(of, u, w)
        # a curve has the same region on one hand all along; which one, the lattice says away from it
        away = np.isfinite(nearest) & (nearest > 1.5 / side)
        if not away.any():
            return by_lattice
        left = np.sum(by_lattice[away] == (hand[away] > 0)) >= np.sum(by_lattice[away] == (hand[away] < 0))
        return (hand > 0) if left else (hand < 0)

    def ends_at_hopf(self):
        """Uniform stick-slip ends in the box, but nowhere else than sliding begins: it shrinks to nothing there."""
        lives = self.file["stick_slip_distance"][...] < 0
        return lives.any() and not lives.all() and not self.pieces("stick-slip")

    def trains_stable(self, x, y):
        """Whether trains are stable: on the side of the nearest line on which those lie that were looked at; without a line,
        as the nearest of these."""
        known = [self.file["train/" + name][...] for name in ("value", "value2", "stable")]
        at, stable = self.unit(*known[:2]), known[2] > 0.5
        u, w = self.unit(x, y)
        pieces = len(self.pieces("trains"))
        if pieces == 0:
            nearest = np.argmin(np.hypot(u[..., None] - at[0], w[..., None] - at[1]), axis=-1)
            return stable[nearest]
        _, hand_of_known, piece_of_known = self.nearest("trains", *at)
        _, hand, number = self.nearest("trains", u, w)
        left = np.array([np.sum(np.where(stable, 1, -1)[piece_of_known == k] * hand_of_known[piece_of_known == k]) > 0
                         for k in range(pieces)])
        return np.where(left[number], hand > 0, hand < 0)


def place_words(axes, words, tint, x, y):
    """Words at a place of the data, on their tint."""
    x, y = axes.transAxes.inverted().transform(axes.transData.transform((x, y)))
    narrow = tint == BOTH  # a band: its curves are not covered
    x, y = np.clip(x, 0.06 if narrow else 0.15, 0.94 if narrow else 0.85), np.clip(y, 0.05, 0.95)
    axes.text(x, y, words, ha="center", va="center", fontsize=8 if narrow else 10, color="0.25", transform=axes.transAxes,
              bbox={"fc": "none" if narrow else tint, "ec": "none", "pad": 1})
    axes.plot(x + np.linspace(-0.14, 0.14, 9), np.full(9, y), ls="none",
              transform=axes.transAxes)  # unseen: keeps the legend off the words


def fill_regions(axes, diagram):
    """Sliding, stick-slip and, where the end of stick-slip is known, the band of both, each in its tint. Returns them as
    (words, tint, mask, x, y)."""
    x, y = diagram.even()
    places = np.meshgrid(x, y)
    knows_sliding = "growth" in diagram.file
    unstable = diagram.inside(*places, "sliding") if knows_sliding else np.zeros(places[0].shape, dtype=bool)
    lives = unstable
    if diagram.knows_end and not (knows_sliding and diagram.ends_at_hopf()):
        lives = diagram.inside(*places, "stick-slip")
    axes.contourf(x, y, np.where(unstable, 2., np.where(lives, 1., 0.)), levels=[-0.5, 0.5, 1.5, 2.5],
                  colors=[SLIDES, BOTH, STICKS])
    if not knows_sliding:
        return [("stick-slip lives", BOTH, lives, x, y), ("no stick-slip", SLIDES, ~lives, x, y)]
    if not diagram.knows_end:  # that perturbations of sliding decay does not say that no cycle lives beside it
        stable = ("sliding stable;\nstick-slip may coexist", SLIDES, ~unstable, x, y)
        return [("stick-slip\n(sliding unstable)", STICKS, unstable, x, y), stable]
    return [("stick-slip\n(sliding unstable)", STICKS, unstable, x, y), ("both live", BOTH, lives & ~unstable, x, y),
            ("sliding", SLIDES, ~lives & ~unstable, x, y)]


def hatch_regions(axes, diagram, regions):
    """Where uniform stick-slip and trains are stable on the ring, each hatched its way, with an entry of the key."""
    x, y = diagram.even()
    places = np.meshgrid(x, y)
    slides = next(inside for words, tint, inside, *_ in regions if tint == SLIDES)
    stable = {}
    if "wave_growth" in diagram.file:
        stable["waves"] = diagram.inside(*places, "waves") & ~slides
    if "train" in diagram.file:
        stable["trains"] = diagram.trains_stable(*places)
        at = [diagram.file["train/" + name][...] for name in ("value", "value2")]
        if diagram.inside(*at, "sliding").all():  # their amplitude vanishes where sliding becomes stable
            stable["trains"] &= ~slides
    for of, inside in stable.items():
        if not inside.any():
            continue
        hatch, words = HATCHES[of]
        colour = CURVES[of][0]
        drawn = axes.contourf(x, y, inside.astype(float), levels=[0.5, 2], colors="none", hatches=[hatch])
        for collection in getattr(drawn, "collections", [drawn]):
            collection.set_edgecolor(colour)
            collection.set_linewidth(0)
        axes.add_patch(Rectangle((0, 0), 0, 0, fc="none", ec=colour, hatch=2 * hatch, label=words))


def draw_diagram(axes, file):
    """The regions in two options, named, with the curves between them."""
    diagram = Diagram(file)
    regions = fill_regions(axes, diagram)
    closed = file["closed_form_v"][...]
    hatch_regions(axes, diagram, regions)
    for of, (colour, words) in CURVES.items():
        for k, chosen in enumerate(diagram.pieces(of)):
            axes.plot(diagram.value[chosen], diagram.value2[chosen], ".-", color=colour, ms=4, clip_on=False,
                      label=words if k == 0 else None)
    mark_criticality(axes, file)
    shown = np.isfinite(closed)
    for name, across, up in ((1, diagram.value, closed), (0, closed, diagram.value2)):
        if diagram.names[name] == "model_v" and shown.any():
            axes.plot(across[shown], up[shown], "--", color=COLOURS[1], lw=1, label="closed form")
    switched = file["switched"][...] > 0.5
    if switched.any():
        axes.plot(diagram.value[switched], diagram.value2[switched], "D", color=COLOURS[4], ms=6, label="another mode leads")
    box = diagram.box()
    if file.attrs["log"]:
        axes.set_xscale("log")
    if file.attrs["log2"]:
        axes.set_yscale("log")
    axes.set_xlim(sorted(box[0]))
    axes.set_ylim(sorted(box[1]))
    for words, tint, inside, x, y in regions:  # each is named where it is deepest inside
        if inside.any():
            j, i = deepest(inside)
            place_words(axes, words, tint, x[i], y[j])
    axes.set(xlabel=shown_name(diagram.names[0]), ylabel=shown_name(diagram.names[1]))


def draw_line(axes, file):
    """The growth rate along one option, and the points."""
    if "growth" in file:
        axes.axhline(0, color="0.6", lw=0.8)
        axes.plot(file["sample"][...], file["growth"][...], color=COLOURS[0], label="growth rate of the leading mode")
    of = [text(one) for one in file["of"][...]] if "of" in file else ["sliding"] * len(file["value"])
    for v, kind, frequency, word, whose in zip(file["value"][...], [text(kind) for kind in file["kind"][...]],
                                               file["frequency"][...], criticality(file), of):
        sliding = whose == "sliding"
        colour = COLOURS[1] if sliding else COLOURS[3]
        said = filter(None, (f"{'' if sliding else 'stick-slip ends, '}{kind} at {v:.8g}", word, f"frequency {frequency:.4g}"))
        axes.plot([v], [0], "o" if sliding else "s", color=colour, mfc="white" if word == "subcritical" else colour,
                  label=", ".join(said))
    if "stick_slip_distance" in file:  # where uniform motion sticks and slips
        place, lives = file["stick_slip_sample"][...], file["stick_slip_distance"][...] < 0
        ends = np.sort(file["value"][...][[whose != "sliding" for whose in of]])
        edges = np.concatenate([[min(place[[0, -1]])], ends, [max(place[[0, -1]])]])
        for k, (low, high) in enumerate(zip(edges[:-1], edges[1:])):
            inside = (place > low) & (place < high)
            if inside.any() and lives[inside].mean() > 0.5:
                axes.axvspan(low, high, color=BOTH, zorder=0, label="stick-slip lives" if k == 0 else None)
    if file.attrs["log"]:
        axes.set_xscale("log")
    axes.set(xlabel=shown_name(text(file.attrs["parameter"])), ylabel="growth rate of steady sliding")


def draw_boundary(file, args):
    """The stability diagram with its regions named, the closed form over it, and what time integration found."""
    of_all = "train" in file or "wave_growth" in file
    figure = Figure(figsize=(8.8 if of_all else 6.4, 4.8), layout="constrained")
    axes = figure.subplots()
    two = "parameter2" in file.attrs
    (draw_diagram if two else draw_line)(axes, file)
    if "verified/value" in file:
        group = file["verified"]
        for regime, mark in (("sliding", "o"), ("stick-slip", "^"), ("both live", "s"), ("undecided", "x")):
            # a mark on the border of the picture is shown whole
            chosen = np.array([text(r) == regime for r in group["regime"][...]])
            if chosen.any():
                y = group["value2"][...][chosen] if two else np.zeros(chosen.sum())
                axes.plot(group["value"][...][chosen], y, mark, color=COLOURS[2], mfc="none", ls="none",
                          clip_on=False, label=f"integrated: {regime}")
    if of_all:
        legend_beside(axes)
    else:
        axes.legend(fontsize=8, frameon=True, framealpha=0.8)
    same = [other.strip() for other in options(file).get("boundary_same", "").split(",")]
    set_title(axes, scene_title(file, [text(file.attrs["parameter"]), text(file.attrs.get("parameter2", "")), *same]))
    return figure


def criticality(file):
    """The word of each point: supercritical, subcritical, or nothing."""
    return [text(word) for word in file["criticality"][...]] if "criticality" in file else [""] * len(file["value"])


def mark_criticality(axes, file):
    """Open circles where sliding loses to stick-slip by a jump, and stars where that changes."""
    jump = np.array([word == "subcritical" for word in criticality(file)], dtype=bool)
    if jump.any():
        axes.plot(file["value"][...][jump], file["value2"][...][jump], "o", color=COLOURS[0], mfc="white", ms=5, ls="none",
                  clip_on=False, label="by a jump (subcritical)")
    if "special" in file:
        group = file["special"]
        kinds = np.array([text(one) for one in group["kind"][...]])
        for kind in dict.fromkeys(kinds):
            axes.plot(group["value"][...][kinds == kind], group["value2"][...][kinds == kind], "*", color=COLOURS[3], ms=13,
                      ls="none", mec="k", mew=0.5, zorder=5, clip_on=False, label=f"{kind.capitalize()} point")


def overlay_boundaries(files, args):
    """Stability diagrams over each other, which must have the same axes: the curves, computed and in closed form."""
    names = [tuple(text(file.attrs.get(one, "")) for one in ("parameter", "parameter2")) for file in files]
    if len(set(names)) > 1 or not names[0][1]:
        raise Unusable("and the others do not vary the same two options")
    figure = Figure(figsize=(7.6, 5.0), layout="constrained")
    axes = figure.subplots()
    for k, (file, shown) in enumerate(zip(files, told_apart(files))):
        colour = COLOURS[k % len(COLOURS)]
        diagram, closed = Diagram(file), file["closed_form_v"][...]
        value, value2 = diagram.value, diagram.value2
        for of, style, words in (("sliding", ".-", shown), ("stick-slip", ":", f"{shown}: stick-slip ends")):
            for number, chosen in enumerate(diagram.pieces(of)):
                axes.plot(value[chosen], value2[chosen], style, color=colour, ms=4, clip_on=False,
                          label=words if number == 0 else None)
        if diagram.knows_end and "growth" in file and not diagram.ends_at_hopf():  # the band where sliding is stable and stick-slip lives
            x, y = diagram.even()
            places = np.meshgrid(x, y)
            band = diagram.inside(*places, "stick-slip") & ~diagram.inside(*places, "sliding")
            if band.any():
                axes.contourf(x, y, band.astype(float), levels=[0.5, 2], colors=[colour], alpha=0.12)
        if "model_v" in names[0] and np.isfinite(closed).any():
            across, up = (value, closed) if names[0][1] == "model_v" else (closed, value2)
            axes.plot(across, up, "--", color="k", lw=0.9, zorder=4, label="closed form" if k == 0 else None)
    file = files[0]
    axes.set_xscale("log" if file.attrs["log"] else "linear")
    axes.set_yscale("log" if file.attrs["log2"] else "linear")
    axes.set(xlabel=shown_name(names[0][0]), ylabel=shown_name(names[0][1]))
    legend_beside(axes)
    set_title(axes, scene_title(file, [*names[0], *differing(files)]))
    return figure


def deepest(inside):
    """Row and column of the True entry farthest from every False one and from the rim."""
    layer, last = np.pad(inside, 1), None
    while layer.any():
        last = layer
        layer = layer[1:-1, 1:-1] & layer[:-2, 1:-1] & layer[2:, 1:-1] & layer[1:-1, :-2] & layer[1:-1, 2:]
        layer = np.pad(layer, 1)
    rows, columns = np.nonzero(last[1:-1, 1:-1])
    middle = len(rows) // 2
    return rows[middle], columns[middle]


def diagram(files, args):
    """The diagram of a boundary with the limits of trains over it."""
    by_kind = {kind: [file for file in files if text(file.attrs["kind"]) == kind] for kind in ("boundary", "wave")}
    if len(by_kind["boundary"]) != 1 or any("curves" not in file for file in by_kind["wave"]):
        raise Unusable("and the others are not one boundary in two options and limits of trains (wave_continue2)")
    base = by_kind["boundary"][0]
    axes_of = [text(base.attrs.get(one, "")) for one in ("parameter", "parameter2")]
    figure = draw_boundary(base, args)
    axes = figure.axes[0]
    for file in by_kind["wave"]:
        names = [text(file.attrs[one]) for one in ("branch_parameter", "branch_parameter2")]
        if sorted(names) != sorted(axes_of):
            raise Unusable("and the others do not vary the same two options")
        add_train_limits(axes, file, swapped=names != axes_of)
    axes.legend(fontsize=8, framealpha=0.8)
    return figure
