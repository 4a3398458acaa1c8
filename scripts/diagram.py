#!/usr/bin/python3
"""Draws a diagram of docs/ from a text: scripts/diagram.py scripts/diagrams/NAME.txt -o docs/NAME.png

A line of the text is one element; `#` begins a comment, texts with blanks stand in quotes, `\\n` breaks a line:

    size WIDTH HEIGHT                            of the picture, which is the unit of all places: x to the right, y upwards
    box NAME X Y WIDTH TEXT                      a step; `ask`: a question; `end`: a result; X Y is the middle
    arrow FROM TO [LABEL [BEND]]                 between named boxes; BEND curves it
    block X Y WIDTH HEIGHT TEXT                  a body; X Y is its lower left corner
    spring X1 Y1 X2 Y2 [LABEL]                   also `damper`, `pointer` (an arrow between places), `line`
    wall X1 X2 Y above|below                     a hatched surface: the base below, the plate above
    circle X Y RADIUS
    text X Y TEXT
"""
import argparse
import os
import shlex
import sys

os.environ.setdefault("MPLBACKEND", "Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Rectangle  # noqa: E402

FILLS = {"box": "#eef2f7", "ask": "#fff4d6", "end": "#d9ead3"}
INK, FONT = "#222222", 9


class Diagram:
    def __init__(self):
        self.figure, self.axes, self.boxes = None, None, {}

    def size(self, width, height):
        self.figure = plt.figure(figsize=(float(width), float(height)))
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set(xlim=(0, float(width)), ylim=(0, float(height)), aspect="equal")
        self.axes.axis("off")

    def named(self, kind, name, x, y, width, text):
        lines = text.count("\n") + 1
        x, y, width, height = float(x), float(y), float(width), 0.19 * lines + 0.16
        style = "square,pad=0" if kind == "box" else f"round,pad=0,rounding_size={0.08 if kind == 'ask' else height / 2}"
        patch = FancyBboxPatch((x - width / 2, y - height / 2), width, height, boxstyle=style, facecolor=FILLS[kind],
                               edgecolor=INK, linewidth=0.9)
        self.axes.add_patch(patch)
        self.boxes[name] = patch, (x, y)
        self.text(x, y, text)

    def arrow(self, start, end, label="", bend="0"):
        (first, a), (second, b) = self.boxes[start], self.boxes[end]
        self.axes.add_patch(FancyArrowPatch(a, b, patchA=first, patchB=second, arrowstyle="-|>", mutation_scale=11, color=INK,
                                            linewidth=0.9, shrinkA=1, shrinkB=1, connectionstyle=f"arc3,rad={bend}"))
        if label:  # beside the middle of the visible part: beyond the curve's own sag
            (x1, y1), (x2, y2), rad = self.edge(first, a, b), self.edge(second, b, a), float(bend)
            self.text((x1 + x2) / 2 + rad * (b[1] - a[1]) / 2, (y1 + y2) / 2 - rad * (b[0] - a[0]) / 2, label, ground="white")

    @staticmethod
    def edge(patch, inside, outside):
        """Where the straight line from the middle of a box to another place leaves the box."""
        dx, dy = outside[0] - inside[0], outside[1] - inside[1]
        reach = min(half / abs(d) if d else np.inf for half, d in ((patch.get_width() / 2, dx), (patch.get_height() / 2, dy)))
        return inside[0] + reach * dx, inside[1] + reach * dy

    def text(self, x, y, text, ground=None):
        box = {"facecolor": ground, "edgecolor": "none", "pad": 1} if ground else None
        self.axes.text(float(x), float(y), text, ha="center", va="center", fontsize=FONT, color=INK, bbox=box, zorder=5)

    def line(self, x1, y1, x2, y2, label=""):
        self.stroke([float(x1), float(x2)], [float(y1), float(y2)])
        self.beside(x1, y1, x2, y2, label)

    def pointer(self, x1, y1, x2, y2, label=""):
        self.axes.add_patch(FancyArrowPatch((float(x1), float(y1)), (float(x2), float(y2)), arrowstyle="-|>", mutation_scale=11,
                                            color=INK, linewidth=1.2, shrinkA=0, shrinkB=0))
        self.beside(x1, y1, x2, y2, label)

    def stroke(self, x, y):
        self.axes.plot(x, y, color=INK, linewidth=1.1, solid_capstyle="round")

    def beside(self, x1, y1, x2, y2, label):
        level = abs(float(y2) - float(y1)) < abs(float(x2) - float(x1))
        self.text((float(x1) + float(x2)) / 2 + (0 if level else 0.26), (float(y1) + float(y2)) / 2 + (0.24 if level else 0), label)

    def along(self, x1, y1, x2, y2, s, across):
        a, b = np.array([float(x1), float(y1)]), np.array([float(x2), float(y2)])
        unit = (b - a) / np.hypot(*(b - a))
        return (a[:, None] + np.outer(b - a, s) + np.outer((-unit[1], unit[0]), across))

    def spring(self, x1, y1, x2, y2, label=""):
        turns = np.linspace(0.2, 0.8, 14)
        s = np.concatenate(([0, 0.2], (turns[1:] + turns[:-1]) / 2, [0.8, 1]))
        self.stroke(*self.along(x1, y1, x2, y2, s, np.concatenate(([0, 0], 0.09 * (-1.0)**np.arange(13), [0, 0]))))
        self.beside(x1, y1, x2, y2, label)

    def damper(self, x1, y1, x2, y2, label=""):
        for s, across in (((0, 0.42), (0, 0)), ((0.66, 0.38, 0.38, 0.66), (0.1, 0.1, -0.1, -0.1)), ((0.5, 0.5), (0.07, -0.07)),
                          ((0.5, 1), (0, 0))):
            s = (0, 0.38) if s == (0, 0.42) else s
            self.stroke(*self.along(x1, y1, x2, y2, np.array(s), np.array(across)))
        self.beside(x1, y1, x2, y2, label)

    def block(self, x, y, width, height, text):
        x, y, width, height = map(float, (x, y, width, height))
        self.axes.add_patch(Rectangle((x, y), width, height, facecolor=FILLS["box"], edgecolor=INK, linewidth=1.1))
        self.text(x + width / 2, y + height / 2, text)

    def wall(self, x1, x2, y, side):
        x1, x2, y = float(x1), float(x2), float(y)
        self.axes.add_patch(Rectangle((x1, y if side == "above" else y - 0.16), x2 - x1, 0.16, facecolor="white", edgecolor="#888888",
                                      hatch="////", linewidth=0))
        self.stroke([x1, x2], [y, y])

    def circle(self, x, y, radius):
        self.axes.add_patch(Circle((float(x), float(y)), float(radius), facecolor=FILLS["box"], edgecolor=INK, linewidth=1.1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("text")
    parser.add_argument("-o", dest="output", required=True)
    asked = parser.parse_args()
    diagram = Diagram()
    with open(asked.text, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            words = [word.replace("\\n", "\n") for word in shlex.split(line.replace("\\n", "\\\\n"), comments=True)]
            if not words:
                continue
            try:
                if words[0] in FILLS:
                    diagram.named(*words)
                else:
                    getattr(diagram, words[0])(*words[1:])
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                sys.exit(f"{asked.text}:{number}: {error}: {line.strip()}")
    diagram.figure.savefig(asked.output, dpi=130, metadata={"Software": None})


if __name__ == "__main__":
    main()
