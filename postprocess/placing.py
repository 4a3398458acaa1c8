"""Where labels stand: clear of every curve, mark and other label, and whole inside their axes.

Curves are drawn into a grid of the figure's pixels; its sums tell of all places for a box of words at once whether something
runs through it. Of the free places beside a curve that with the most room is taken, of those in a region the deepest; where
none is free, one further away with a thin line to what is meant; and where there is none either, a key below the axes."""
import textwrap

import numpy as np
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import AutoLocator, LogLocator, MaxNLocator

STEP = 3    # pixels between places that are tried
CLEAR = 4   # pixels between words and whatever is drawn
NEAR = 22   # pixels within which other curves make a place worse


class Placing:
    """The labels of one figure: asked for by `curve` and `region`, placed by `finish`."""

    def __init__(self, figure, size):
        self.figure, self.size, self.asked = figure, size, []

    def curve(self, axes, words, x, y, colour, line=None, where=None, coordinates="data"):
        points = np.column_stack(np.broadcast_arrays(np.atleast_1d(np.asarray(x, float)), np.asarray(y, float)))
        self.asked.append({"axes": axes, "words": words, "points": points, "colour": colour, "line": line, "where": where,
                           "coordinates": coordinates})

    def region(self, axes, words, inside, colour):
        self.asked.append({"axes": axes, "words": words, "inside": inside, "colour": colour, "line": None})

    def finish(self):
        """Lays the figure out and places what was asked for, in that order."""
        asked, self.asked = self.asked, []
        self.figure.draw_without_rendering()
        for axes in self.figure.axes:
            wrap_names(axes)
            thin_ticks(axes)
        if not asked:
            return
        placed, left = self.place(asked)
        if left:  # once more, with a key for them
            for text in placed:
                text.remove()
            for axes in {id(one["axes"]): one["axes"] for one in left}.values():
                self.key(axes, [one for one in left if one["axes"] is axes])
            self.figure.draw_without_rendering()
            keyed = {id(one) for one in left}
            self.place([one for one in asked if id(one) not in keyed])
        self.figure.set_layout_engine("none")

    @staticmethod
    def handle(one):
        if one["line"] is not None:
            return one["line"]
        if "points" not in one:
            return Patch(fc=one["colour"], ec="none")
        alone = len(one["points"]) == 1
        return Line2D([], [], color=one["colour"], ls="none" if alone else "-", marker="o" if alone else None)

    @classmethod
    def key(cls, axes, left):
        """A key below the axes, in as many columns as are not wider than these."""
        handles, words = [cls.handle(one) for one in left], [one["words"] for one in left]
        below = 3.6 + 1.3 * axes.get_xlabel().count("\n")  # the numbers at the axis and its name
        for columns in range(min(3, len(left)), 0, -1):
            key = axes.legend(handles, words, loc="upper center", bbox_to_anchor=(0.5, 0), borderaxespad=below, ncols=columns)
            if key.get_window_extent().width <= axes.bbox.width:
                break

    def place(self, asked):
        taken = Taken(self.figure)
        placed, left = [], []
        for one in asked:
            text = self.words(one)
            box = text.get_window_extent()
            size = np.array([box.width, box.height])
            found = beside(one, size, taken) if "points" in one else within(one, size, taken)
            if found is None:
                text.remove()
                left.append(one)
                continue
            corner, anchor = found
            text.set_position(one["axes"].transAxes.inverted().transform(corner + size / 2))
            placed.append(text)
            taken.box(corner, size)
            if anchor is not None:
                placed.append(self.leader(one, corner, size, anchor))
                taken.line(placed[-1], one["axes"])
            taken.widened()
        return placed, left

    def words(self, one):
        axes = one["axes"]
        text = axes.text(0.5, 0.5, one["words"], color=one["colour"], fontsize=self.size, ha="center", va="center", zorder=10,
                         transform=axes.transAxes)
        text.set_in_layout(False)
        return text

    def leader(self, one, corner, size, anchor):
        """A thin line from the edge of the words to what they mean."""
        start = np.clip(anchor, corner - 1, corner + size + 1)
        ends = one["axes"].transAxes.inverted().transform([start, anchor])
        line, = one["axes"].plot(*ends.T, color=one["colour"], lw=0.7, transform=one["axes"].transAxes, zorder=9,
                                 scalex=False, scaley=False, label="_leader")
        line.set_in_layout(False)
        return line


def wrap_names(axes):
    """Names of axes in as many lines as they take beside these."""
    for label, room, long in ((axes.xaxis.label, axes.bbox.width, "width"), (axes.yaxis.label, axes.bbox.height, "height")):
        words, size = label.get_text(), getattr(label.get_window_extent(), long)
        if axes.axison and "\n" not in words and size > 1.15 * max(room, 1):
            label.set_text("\n".join(textwrap.wrap(words, max(8, int(len(words) * room / size)), break_long_words=False)))


def thin_ticks(axes):
    """Fewer ticks below the axes, until the numbers at them do not touch."""
    axis = axes.xaxis
    if not axes.axison or not isinstance(axis.get_major_locator(), (AutoLocator, MaxNLocator, LogLocator)):
        return
    fewer = [LogLocator(subs=subs, numticks=9) for subs in ((1, 2, 5), (1, 3), (1,))] if isinstance(axis.get_major_locator(), LogLocator) else \
        [MaxNLocator(most) for most in range(6, 1, -1)]
    for locator in fewer:
        low, high = sorted(axes.get_xlim())
        boxes = [tick.label1.get_window_extent() for tick in axis.get_major_ticks()
                 if low <= tick.get_loc() <= high and tick.label1.get_visible() and tick.label1.get_text()]
        if all(after.x0 - before.x1 > CLEAR for before, after in zip(boxes, boxes[1:])):
            break
        axis.set_major_locator(locator)
        axes.figure.draw_without_rendering()


class Taken:
    """Which pixels of the figure have something drawn on them that words must not cover."""

    def __init__(self, figure):
        width, height = (int(np.ceil(v)) + 1 for v in figure.bbox.size)
        self.pixels, self.marks = np.zeros((height, width), dtype=bool), {}  # marks: by the width that they stand for
        self.words = []  # the boxes of words, which lines to others must not cross
        for axes in figure.axes:
            if not axes.axison:
                continue
            for line in axes.get_lines():
                if line.get_visible():
                    self.line(line, axes)
            for collection in axes.collections:
                if isinstance(collection, LineCollection):
                    for path in collection.get_paths():
                        self.path(collection.get_transform().transform(path.vertices), axes, True, 1)
                elif isinstance(collection, PathCollection):
                    places = collection.get_offset_transform().transform(collection.get_offsets())
                    self.path(places, axes, False, 4)
            for text in axes.texts:
                if text.get_text():
                    box = text.get_window_extent()
                    self.box(np.array([box.x0, box.y0]), np.array([box.width, box.height]))
            if axes.get_legend():
                box = axes.get_legend().get_window_extent()
                self.box(np.array([box.x0, box.y0]), np.array([box.width, box.height]))
        self.widened()

    def line(self, line, axes):
        joined = line.get_linestyle() not in ("None", "none", "")
        mark = line.get_markersize() if line.get_marker() not in (None, "None", "none", "", ",") else 0
        reach = max(line.get_linewidth() if joined else 0, mark) * line.figure.dpi / 144
        self.path(line.get_transform().transform(line.get_xydata()), axes, joined, int(np.ceil(reach)))

    def path(self, points, axes, joined, reach):
        points = np.asarray(points, float)[:, :2]
        if joined and len(points) > 1:
            points = dense(points)
        low, high = axes.bbox.min - reach, axes.bbox.max + reach
        with np.errstate(invalid="ignore"):
            points = points[np.all((points >= low) & (points <= high), axis=1)]
        column, row = np.rint(points).astype(int).T if len(points) else np.empty((2, 0), int)
        good = (column >= 0) & (column < self.pixels.shape[1]) & (row >= 0) & (row < self.pixels.shape[0])
        self.marks.setdefault(reach, np.zeros_like(self.pixels))[row[good], column[good]] = True

    def widened(self):
        """The marks at their widths, square."""
        for reach, marked in self.marks.items():
            rows = marked.copy()
            for shift in range(1, reach + 1):
                rows[:, shift:] |= marked[:, :-shift]
                rows[:, :-shift] |= marked[:, shift:]
            self.pixels |= rows
            for shift in range(1, reach + 1):
                self.pixels[shift:] |= rows[:-shift]
                self.pixels[:-shift] |= rows[shift:]
        self.marks = {}
        self.sums = sums_of(self.pixels)

    def box(self, corner, size):
        self.words.append((corner - 2, corner + size + 2))
        (left, low), (right, high) = np.floor(corner).astype(int), np.ceil(corner + size).astype(int)
        self.pixels[max(low, 0):max(high, 0), max(left, 0):max(right, 0)] = True

    def count(self, corners, size, room):
        return count_in(self.sums, corners - room, size + 2 * room)


def sums_of(pixels):
    return np.pad(np.cumsum(np.cumsum(pixels, axis=0, dtype=np.int64), axis=1), ((1, 0), (1, 0)))


def count_in(sums, corners, size):
    """How many marked pixels there are in boxes of one size."""
    most = np.array(sums.shape[::-1]) - 1
    left, low = np.clip(np.floor(corners), 0, most).astype(int).T
    right, high = np.clip(np.ceil(corners + size), 0, most).astype(int).T
    return sums[high, right] - sums[low, right] - sums[high, left] + sums[low, left]


def dense(points):
    """The points of a curve with others between them, a pixel apart; gaps stay, and far jumps are cut to the screen."""
    a, b = points[:-1], points[1:]
    good = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    a, b = np.clip(a[good], -9e3, 9e3), np.clip(b[good], -9e3, 9e3)
    if len(a) == 0:
        return points
    count = np.ceil(np.abs(b - a).max(axis=1)).astype(int) + 1
    which = np.repeat(np.arange(len(a)), count)
    part = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)) / np.repeat(count, count)
    return np.vstack([a[which] + part[:, None] * (b - a)[which], b[-1:]])


def frame(axes, size):
    """The corners that boxes may have to lie inside the axes."""
    return axes.bbox.min + CLEAR, axes.bbox.max - CLEAR - size


def lattice(axes, size):
    low, high = frame(axes, size)
    if np.any(high < low):
        return np.empty((0, 2))
    return np.stack(np.meshgrid(np.arange(low[0], high[0] + 1, STEP), np.arange(low[1], high[1] + 1, STEP)), -1).reshape(-1, 2)


def beside(one, size, taken):
    """A free corner for the words of a curve, and where a line to them begins if they stand away from it."""
    axes, points = one["axes"], one["points"]
    points = (axes.transData if one["coordinates"] == "data" else axes.get_yaxis_transform()).transform(points)
    points = dense(points) if len(points) > 1 else points
    seen = np.isfinite(points).all(axis=1)
    seen[seen] = np.all((points[seen] >= axes.bbox.min - 1) & (points[seen] <= axes.bbox.max + 1), axis=1)
    points = points[seen]
    if len(points) == 0:
        return None
    chosen = np.unique(np.linspace(0, len(points) - 1, min(len(points), 120)).astype(int))
    anchors, part = points[chosen], chosen / max(len(points) - 1, 1)
    sides = np.array([(x, y) for x in (-1, -0.5, 0, 0.5, 1) for y in (-1, 0, 1) if y or abs(x) == 1])
    corners, along, far = [], [], []
    for gap in (CLEAR + 3, CLEAR + 9, CLEAR + 16):
        for side in sides:
            corners.append(anchors + side * (size / 2 + gap * (np.abs(side) == 1)) - size / 2)
            along.append(part)
            far.append(np.full(len(part), gap))
    corners, along, far = np.concatenate(corners), np.concatenate(along), np.concatenate(far)
    low, high = frame(axes, size)
    free = np.all((corners >= low) & (corners <= high), axis=1)
    free[free] = taken.count(corners[free], size, CLEAR) == 0
    if free.any():
        corners, along, far = corners[free], along[free], far[free]
        crowd = taken.count(corners, size, NEAR) / (2 * (size.sum() + 2 * NEAR))
        wish = 0 if one["where"] is None else 3 * np.abs(along - one["where"])
        return corners[np.argmin(crowd + wish + 0.03 * far)], None
    return away(axes, size, taken, anchors[::max(1, len(anchors) // 40)])


def away(axes, size, taken, anchors):
    """The free corner nearest to one of some places, from which a line to that place crosses no other words."""
    corners = lattice(axes, size)
    corners = corners[taken.count(corners, size, CLEAR) == 0] if len(corners) else corners
    if len(corners) == 0:
        return None
    ends = np.clip(anchors[None], corners[:, None], corners[:, None] + size)
    distance = np.hypot(*np.moveaxis(ends - anchors[None], -1, 0))
    for one in np.argsort(distance, axis=None)[:4000:4]:
        which, anchor = np.unravel_index(one, distance.shape)
        on_it = ends[which, anchor] + np.linspace(0, 1, 40)[:, None] * (anchors[anchor] - ends[which, anchor])
        if not any(np.all((on_it >= low) & (on_it <= high), axis=1).any() for low, high in taken.words):
            return corners[which], anchors[anchor]
    return None


def within(one, size, taken):
    """A free corner for the words of a region; outside of it with a line to its deepest place where it is too narrow."""
    axes = one["axes"]
    low, high = np.floor(axes.bbox.min).astype(int), np.ceil(axes.bbox.max).astype(int)
    columns, rows = np.arange(low[0], high[0], STEP), np.arange(low[1], high[1], STEP)
    places = np.stack(np.meshgrid(columns, rows), -1)
    data = axes.transData.inverted().transform(places.reshape(-1, 2) + 0.5)
    inside = np.asarray(one["inside"](data[:, 0], data[:, 1])).reshape(places.shape[:2]).astype(bool)
    sums, corners = sums_of(~inside), lattice(axes, size)
    if len(corners) == 0 or not inside.any():
        return None
    free = taken.count(corners, size, CLEAR) == 0

    def outside(chosen, room):
        return count_in(sums, (corners[chosen] - room - low) / STEP, (size + 2 * room) / STEP)
    middle = places[inside].mean(axis=0)
    for room in (60, 40, 26, 16, 10, 6, 3):
        good = np.flatnonzero(free & np.all((corners >= low + room) & (corners + size <= high - room), axis=1)
                              if room > 6 else free)
        good = good[outside(good, np.array([room, room])) == 0]
        if len(good):
            return corners[good[np.argmin(np.hypot(*(corners[good] + size / 2 - middle).T))]], None
    return away(axes, size, taken, places[deepest(inside)].astype(float)[None])


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
