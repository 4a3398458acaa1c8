#!/usr/bin/env python3
"""Rupture fronts of docs/published.md.

usage: tests/bench/fronts.py FRONT.h5 ...                              the table of their speeds
       tests/bench/fronts.py FRONT.h5 ... --arrest FILE.h5 -o PNG      the picture: speeds, and the path of a front

FRONT.h5 are runs of runs/published/front.yaml, FILE.h5 is one of runs/published/arrest.yaml.
"""
import argparse
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "postprocess"))

import h5py  # noqa: E402
import numpy as np  # noqa: E402
from stickslip import options  # noqa: E402


def times(path):
    """When each block first slips, of the one event of the file."""
    with h5py.File(path) as file:
        return file["events/rupture/x"][:], file["events/rupture/time"][:], options(file)


def speed(path):
    """q, and the speed over c by least squares over the second half of the blocks, with its standard error."""
    x, t, given = times(path)
    late = x >= len(x) / 2
    (slope, _), square = np.polyfit(t[late], x[late], 1, cov=True)
    return (float(given["init_eta"]) - 0.5) / 0.5, slope, np.sqrt(square[0, 0])


def path_of_a_front(x0, s1, s2, fs):
    """Places and times of the front in a continuous medium, c = 1: from the end on at the speed V of its prestress, and
    beyond x0 where what comes from behind, w = psi - c chi_x, has been used up. w at x0 grows until it has been from
    the front's arrival there to the end and back."""
    q = s1 / (fs + s1)
    v = 1 / np.sqrt(1 - q * q)
    begin = x0 / v
    t = begin + np.linspace(0, 2 * x0, 400)
    w = np.where(t < x0, s1 * (v * t - x0) / (v - 1), s1 * (x0 + v * (t - x0) / (v + 1)))
    beyond = w / s2
    return np.r_[0, x0, x0 + beyond], np.r_[0, begin, t + beyond]


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("fronts", nargs="+")
    parser.add_argument("--arrest")
    parser.add_argument("-o", "--output")
    asked = parser.parse_args()
    rows = [speed(path) for path in asked.fronts]
    if not asked.arrest:
        print("| q | V/c | its error by the fit | 1/√(1 - q²) |\n|---|---|---|---|")
        for q, found, error in rows:
            print(f"| {q:.1f} | {found:.4f} | {error:.0e} | {1 / np.sqrt(1 - q * q):.4f} |")
        return
    from style import BLACK, BLUE, REFERENCE, Picture, name_axes
    picture = Picture(3.4)
    speeds, path = picture.subplots(1, 2)
    q = np.linspace(0, 0.92, 300)
    picture.label(speeds, "1/√(1 - q²)", *speeds.plot(q, 1 / np.sqrt(1 - q * q), color=BLACK, lw=1), where=0.8)
    picture.label(speeds, "200 blocks", *speeds.plot([row[0] for row in rows], [row[1] for row in rows], "o", color=BLUE))
    name_axes(speeds, "q = (prestress - fd)/(fs - fd)", "speed of the front over c")
    x, t, _ = times(asked.arrest)
    order = np.argsort(t)
    place, when = path_of_a_front(100, 0.2, 0.2, 0.3)
    picture.label(path, "long chain, closed form", *path.plot(when, place, color=BLACK, lw=1), where=0.4)
    dots = path.plot(t[order][::6], x[order][::6], "o", ms=3, color=BLUE)
    picture.label(path, "blocks as they begin to slip", *dots, where=0.9)
    for level, words in ((100, "prestress falls below fd"), (200, "forces balance")):
        path.axhline(level, **REFERENCE)
        path.annotate(words, (when[-1], level + 3), ha="right", color=REFERENCE["color"])
    name_axes(path, "t", "block")
    picture.savefig(asked.output)
    print(asked.output)


if __name__ == "__main__":
    main()
