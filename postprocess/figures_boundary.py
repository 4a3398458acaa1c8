"""Pictures of stability diagrams: where sliding loses stability, where the stick-slip beside it ends, and where uniform
stick-slip and trains withstand waves."""
import numpy as np
from matplotlib.colors import ListedColormap

from figures_analysis import add_train_limits
from stickslip import Unusable, differing, options, scene_title, text, told_apart
from style import (BLACK, BLUE, BOTH, COLOURS, GREEN, OCHRE, RED, REFERENCE, SLIDES, STICKS, VIOLET, Picture,
                   logarithmic, name_axes)

UNIFORM, TRAINS, ANY = "#cfead9", "#ecdcf4", "#c3cbe4"  # tints: what is stable among the motions of a ring
CURVES = {"sliding": BLUE, "stick-slip": VIOLET, "waves": GREEN, "trains": OCHRE}


class Diagram:
    """What the file of `boundary` in two options holds."""

    def __init__(self, file):
        self.file = file
        self.names = [text(file.attrs["parameter"]), text(file.attrs["parameter2"])]
        self.value, self.value2, self.piece = (file[name][...] for name in ("value", "value2", "piece"))
        of = [text(one) for one in file["of"][...]] if "of" in file else ["sliding"] * len(self.value)
        self.of = np.array(of, dtype=object)
        self.knows_end = "stick_slip_distance" in file
        prefix = "sample" if "sample" in file else "stick_slip_sample"
        self.box = [file[prefix + suffix][...][[0, -1]] for suffix in ("", "2")]  # the ends of both axes
        self.logs = [bool(file.attrs[name]) for name in ("log", "log2")]

    def pieces(self, of):
        """Each piece of the curve of `sliding`, `stick-slip`, `waves` or `trains` as its points."""
        chosen = self.of == of
        return [chosen & (self.piece == number) for number in np.unique(self.piece[chosen])]

    def unit(self, x, y):
        """Places in the box as numbers from 0 to 1."""
        result = []
        for values, (low, high), log in zip((x, y), self.box, self.logs):
            change = np.log if log else np.asarray
            result.append((change(np.asarray(values, dtype=float)) - change(low)) / (change(high) - change(low)))
        return result

    def places(self, line):
        """Numbers from 0 to 1 as places in the box."""
        return [low * (high / low)**part if log else low + (high - low) * part
                for part, (low, high), log in zip(line.T, self.box, self.logs)]

    def even(self, box=None):
        """Many places on each axis, upwards."""
        return [(np.geomspace if log else np.linspace)(*sorted(ends), 241) for ends, log in zip(box or self.box, self.logs)]

    def lines(self, of):
        """The pieces of a curve in the unit box. One of trains that ends inside, where another mode takes the lead, goes on at
        the nearest end of another."""
        lines = [np.column_stack(self.unit(self.value[chosen], self.value2[chosen])) for chosen in self.pieces(of)]
        k = 0
        while of == "trains" and k < len(lines):
            for line in (lines[k], lines[k][::-1]):
                others = [other[::way] for j, other in enumerate(lines) if j != k for way in (1, -1)]
                apart = [np.hypot(*(other[0] - line[-1])) for other in others]
                if np.all((line[-1] > 1e-6) & (line[-1] < 1 - 1e-6)) and others and min(apart) < 0.3:
                    which = int(np.argmin(apart))
                    taken = [j for j in range(len(lines)) if j != k][which // 2]
                    joined = np.vstack([line, others[which]])
                    lines = [one for j, one in enumerate(lines) if j not in (k, taken)] + [joined]
                    k = -1
                    break
            k += 1
        return lines

    def nearest(self, of, u, w):
        """Of places of the unit box: the distance from the nearest stretch of the curve, on which hand of it they lie (1:
        left), and the number of its line."""
        nearest, hand, number = np.full(u.shape, np.inf), np.zeros(u.shape), np.zeros(u.shape, dtype=int)
        for index, line in enumerate(self.lines(of)):
            a, b = line.T
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
        """Whether sliding is unstable, uniform stick-slip exists, or no wave grows on it, at places of the box: by the side of
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
        pieces = len(self.lines("trains"))
        if pieces == 0:
            return stable[np.argmin(np.hypot(u[..., None] - at[0], w[..., None] - at[1]), axis=-1)]
        _, hand_of_known, piece_of_known = self.nearest("trains", *at)
        _, hand, number = self.nearest("trains", u, w)
        left = np.array([np.sum(np.where(stable, 1, -1)[piece_of_known == k] * hand_of_known[piece_of_known == k]) > 0
                         for k in range(pieces)])
        return np.where(left[number], hand > 0, hand < 0)


def regions_of(diagram, x, y):
    """What is stable where on a lattice: (words, tint, mask)."""
    places = np.meshgrid(x, y)
    knows_sliding = "growth" in diagram.file
    unstable = diagram.inside(*places, "sliding") if knows_sliding else np.zeros(places[0].shape, dtype=bool)
    lives = unstable
    if diagram.knows_end and not (knows_sliding and diagram.ends_at_hopf()):
        lives = diagram.inside(*places, "stick-slip")
    if not knows_sliding:
        return [("stick-slip exists", BOTH, lives), ("no stick-slip", SLIDES, ~lives)]
    slides = ("sliding", SLIDES, ~lives & ~unstable)
    if not diagram.knows_end:  # that perturbations of sliding decay does not say that no cycle coexists with it
        slides = ("sliding stable;\nstick-slip may coexist", SLIDES, ~unstable)
    if "wave_growth" not in diagram.file and "train" not in diagram.file:
        return [("stick-slip\n(sliding unstable)", STICKS, unstable), ("bistable", BOTH, lives & ~unstable), slides]
    nowhere = np.zeros(places[0].shape, dtype=bool)
    uniform = diagram.inside(*places, "waves") & lives if "wave_growth" in diagram.file else nowhere
    trains = diagram.trains_stable(*places) if "train" in diagram.file else nowhere
    if "train" in diagram.file and diagram.inside(*(diagram.file["train/" + name][...] for name in ("value", "value2")),
                                                  "sliding").all():
        trains &= unstable  # their amplitude vanishes where sliding becomes stable
    return [("uniform stick-slip\nand trains stable", ANY, uniform & trains), ("uniform stick-slip\nstable", UNIFORM, uniform & ~trains),
            ("trains\nstable", TRAINS, trains & ~uniform), ("neither\nstable", STICKS, lives & ~uniform & ~trains), slides]


def fill_regions(picture, axes, diagram):
    """Each region in its tint, named in place."""
    x, y = diagram.even()
    filled = np.full((len(y), len(x)), np.nan)
    regions = regions_of(diagram, x, y)
    for k, (_, _, mask) in enumerate(regions):
        filled[mask] = k
    axes.pcolormesh(x, y, filled, cmap=ListedColormap([tint for _, tint, _ in regions]), vmin=-0.5, vmax=len(regions) - 0.5,
                    shading="nearest", rasterized=True)
    for words, _, mask in regions:
        if mask.any():
            picture.label_region(axes, words, lookup(x, y, mask))


def lookup(x, y, mask):
    """A mask on a lattice, to be asked at any place."""
    def inside(*places):
        i, j = (np.interp(place, values, np.arange(len(values)), -1, -1).round().astype(int)
                for place, values in zip(places, (x, y)))
        return (i >= 0) & (j >= 0) & mask[j, i]
    return inside


def sparse(count, most=14):
    """So few of many points that marks on them stand apart."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def scale(axes, diagram, box=None):
    """The axes of a box, by its options."""
    for which, ends, log in zip("xy", box or diagram.box, diagram.logs):
        getattr(axes, f"set_{which}lim")(sorted(ends))
        if log:
            logarithmic(axes, which)
    name_axes(axes, *diagram.names)


def draw_closed_form(picture, axes, diagram):
    """As marks on the curve that was computed."""
    closed = diagram.file["closed_form_v"][...]
    if "model_v" not in diagram.names or not np.isfinite(closed).any():
        return
    across, up = (closed, diagram.value2) if diagram.names[0] == "model_v" else (diagram.value, closed)
    shown = np.flatnonzero(np.isfinite(closed))
    shown = shown[sparse(len(shown))]
    line, = axes.plot(across[shown], up[shown], "x", color=RED, ms=5, mew=1.2, ls="none", zorder=4)
    return line


def draw_diagram(picture, axes, file):
    """The regions in two options, named, with the curves between them."""
    diagram = Diagram(file)
    fill_regions(picture, axes, diagram)
    for of, colour in CURVES.items():
        for line in diagram.lines(of):
            axes.plot(*diagram.places(line), color=colour, lw=1.6, marker="." if len(line) == 1 else None)
    mark_criticality(picture, axes, file)
    closed = draw_closed_form(picture, axes, diagram)
    if closed:
        picture.label(axes, "closed form", closed)
    switched = file["switched"][...] > 0.5
    if switched.any():
        line, = axes.plot(diagram.value[switched], diagram.value2[switched], "D", color=OCHRE, ms=6)
        picture.label(axes, "another mode leads", line)
    scale(axes, diagram)


def draw_line(picture, axes, file):
    """The growth rate along one option, and the points."""
    if "growth" in file:
        axes.axhline(0, **REFERENCE)
        line, = axes.plot(file["sample"][...], file["growth"][...], color=BLUE)
        picture.label(axes, "leading mode of sliding", line)
    of = [text(one) for one in file["of"][...]] if "of" in file else ["sliding"] * len(file["value"])
    if file.attrs["log"]:
        logarithmic(axes, "x")
    for v, kind, frequency, word, whose in zip(file["value"][...], [text(kind) for kind in file["kind"][...]],
                                               file["frequency"][...], criticality(file), of):
        sliding = whose == "sliding"
        colour = RED if sliding else VIOLET
        said = filter(None, (f"{'' if sliding else 'stick-slip ends, '}{kind} at {v:.8g}", word, f"frequency {frequency:.4g}"))
        axes.plot([v], [0], "o" if sliding else "s", color=colour, mfc="white" if word == "subcritical" else colour)
        picture.label(axes, "\n".join(said), v, 0, colour)
    if "stick_slip_distance" in file:  # where uniform motion sticks and slips
        place, lives = file["stick_slip_sample"][...], file["stick_slip_distance"][...] < 0
        ends = np.sort(file["value"][...][[whose != "sliding" for whose in of]])
        edges = np.concatenate([[min(place[[0, -1]])], ends, [max(place[[0, -1]])]])
        for low, high in zip(edges[:-1], edges[1:]):
            inside = (place > low) & (place < high)
            if inside.any() and lives[inside].mean() > 0.5:
                axes.axvspan(low, high, color=BOTH, lw=0, zorder=0)
                picture.label_region(axes, "stick-slip exists", lambda x, y, a=low, b=high: (x > a) & (x < b))
    name_axes(axes, text(file.attrs["parameter"]), "growth rate Re λ of steady sliding")


def draw_boundary(file, args):
    """The stability diagram with its regions named, the closed form over it, and what time integration found."""
    picture = Picture(4.6)
    axes = picture.subplots()
    two = "parameter2" in file.attrs
    (draw_diagram if two else draw_line)(picture, axes, file)
    if "verified/value" in file:
        group = file["verified"]
        for regime, mark in (("sliding", "o"), ("stick-slip", "^"), ("bistable", "s"), ("undecided", "x")):
            chosen = np.array([text(r) == regime for r in group["regime"][...]])
            if chosen.any():
                y = group["value2"][...][chosen] if two else np.zeros(chosen.sum())
                line, = axes.plot(group["value"][...][chosen], y, mark, color=GREEN, ms=7, mfc="none", mew=1.4, ls="none",
                                  clip_on=False)  # a mark on the border of the picture is shown whole
                picture.label(axes, f"integrated: {regime}", line)
    same = [other.strip() for other in options(file).get("boundary_same", "").split(",")]
    picture.title(scene_title(file, [text(file.attrs["parameter"]), text(file.attrs.get("parameter2", "")), *same]))
    return picture


def criticality(file):
    """The word of each point: supercritical, subcritical, or nothing."""
    return [text(word) for word in file["criticality"][...]] if "criticality" in file else [""] * len(file["value"])


def mark_criticality(picture, axes, file):
    """Open circles where sliding loses to stick-slip by a jump, and stars where that changes."""
    jump = np.flatnonzero([word == "subcritical" for word in criticality(file)])
    if len(jump):
        shown = jump[sparse(len(jump), 9)]
        line, = axes.plot(file["value"][...][shown], file["value2"][...][shown], "o", color=BLUE, mfc="white", ms=5, ls="none",
                          zorder=3, clip_on=False)
        picture.label(axes, "by a jump (subcritical)", line)
    if "special" in file:
        group = file["special"]
        for kind, x, y in zip(*(group[name][...] for name in ("kind", "value", "value2"))):
            axes.plot(x, y, "*", color=VIOLET, ms=12, ls="none", mec=BLACK, mew=0.5, zorder=5, clip_on=False)
            picture.label(axes, f"{text(kind).capitalize()} point", x, y)


def overlay_boundaries(files, args):
    """Stability diagrams over each other, which must have the same axes: the curves with the bands beside them that
    are bistable, and the closed forms as marks."""
    names = [tuple(text(file.attrs.get(one, "")) for one in ("parameter", "parameter2")) for file in files]
    if len(set(names)) > 1 or not names[0][1]:
        raise Unusable("and the others do not vary the same two options")
    picture = Picture(4.6)
    axes = picture.subplots()
    closed, diagrams = None, [Diagram(file) for file in files]
    box = [(np.min(ends), np.max(ends)) for ends in zip(*(one.box for one in diagrams))]
    x, y = diagrams[0].even(box)
    stable = unstable = True
    for k, (diagram, shown) in enumerate(zip(diagrams, told_apart(files))):
        colour = COLOURS[k % len(COLOURS)]
        for of, width in (("sliding", 1.6), ("stick-slip", 0.9)):
            for number, chosen in enumerate(diagram.pieces(of)):
                line, = axes.plot(diagram.value[chosen], diagram.value2[chosen], color=colour, lw=width)
                if number == 0:
                    picture.label(axes, shown if of == "sliding" else f"{shown}: stick-slip ends", line)
        masks = {tint: mask for _, tint, mask in regions_of(diagram, x, y)}
        if BOTH in masks and masks[BOTH].any():  # the band where sliding is stable and stick-slip lives
            axes.contourf(x, y, masks[BOTH].astype(float), levels=[0.5, 2], colors=[BOTH])
            picture.label_region(axes, f"{shown}: bistable", lookup(x, y, masks[BOTH]))
        stable, unstable = stable & masks.get(SLIDES, False), unstable & masks.get(STICKS, False)
        closed = draw_closed_form(picture, axes, diagram) or closed
    if closed:
        picture.label(axes, "closed form", closed)
    for words, mask in (("sliding", stable), ("stick-slip\n(sliding unstable)", unstable)):
        if np.any(mask):
            picture.label_region(axes, words, lookup(x, y, mask))
    scale(axes, diagrams[0], box)
    picture.title(scene_title(files[0], [*names[0], *differing(files)]))
    return picture


def diagram(files, args):
    """The diagram of a boundary with the limits of trains over it."""
    by_kind = {kind: [file for file in files if text(file.attrs["kind"]) == kind] for kind in ("boundary", "wave")}
    if len(by_kind["boundary"]) != 1 or any("curves" not in file for file in by_kind["wave"]):
        raise Unusable("and the others are not one boundary in two options and limits of trains (wave_continue2)")
    base = by_kind["boundary"][0]
    axes_of = [text(base.attrs.get(one, "")) for one in ("parameter", "parameter2")]
    picture = draw_boundary(base, args)
    for file in by_kind["wave"]:
        names = [text(file.attrs[one]) for one in ("branch_parameter", "branch_parameter2")]
        if sorted(names) != sorted(axes_of):
            raise Unusable("and the others do not vary the same two options")
        add_train_limits(picture, picture.axes[0], file, swapped=names != axes_of)
    return picture
