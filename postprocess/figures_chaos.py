"""Lyapunov exponents of a run."""
import numpy as np

from stickslip import Unusable, scene_title
from style import BLUE, COLOURS, GREY, REFERENCE, Picture, name_axes

SHOWN = 5  # of many exponents


def slope(rates):
    """Of the line through the sum of the rates, by least squares (growth_average.hpp)."""
    s = (np.arange(len(rates)) + 0.5) / len(rates)
    return np.average(rates, axis=0, weights=s * (1 - s))


def draw_lyapunov(file, args):
    """Left: how exponents settle with the time that they have been measured over, five of them and between which the rest
    lie; right: all of them, with errors from 16 blocks."""
    if "lyapunov" not in file:
        raise Unusable("holds no Lyapunov exponents: run with -lyapunov_count")
    group = file["lyapunov"]
    rows = len(group["t"])
    names = sorted((name for name in group if name.startswith("rate_")), key=lambda name: int(name[5:]))
    t, rates = group["t"][:rows], np.array([group[name][:rows] for name in names]).T
    if rows < 16:
        raise Unusable("holds too short a measurement of Lyapunov exponents")
    picture = Picture(3.6)
    course, last = picture.subplots(1, 2, width_ratios=(3, 2))
    lives = np.flatnonzero(np.isfinite(rates).all(axis=0))
    begin = max(8, rows // 20)
    if len(lives):
        settled = np.array([slope(rates[:i, lives]) for i in range(begin + 1, rows + 1)])
        if len(lives) > SHOWN:
            course.fill_between(t[begin:], settled.min(axis=1), settled.max(axis=1), color="0.9", lw=0)
        shown = np.unique(np.linspace(0, len(lives) - 1, SHOWN).round().astype(int))
        for colour, k in zip(COLOURS, shown):
            line, = course.plot(t[begin:], settled[:, k], lw=1.2, color=colour)
            picture.label(course, f"number {lives[k] + 1}", line, where=0.8)
        if len(lives) > SHOWN:
            picture.label_region(course, f"all {len(lives)}", lambda x, y: (x > t[begin]) & (x < t[-1]) & (
                y > np.interp(x, t[begin:], settled.min(axis=1))) & (y < np.interp(x, t[begin:], settled.max(axis=1))), GREY)
    length = rows // 16
    blocks = [slope(rates[rows - 16 * length + b * length:][:length]) for b in range(16)]
    value, error = slope(rates[:, lives]), np.std(np.array(blocks)[:, lives], axis=0, ddof=1) / 4
    last.errorbar(lives + 1, value, error, fmt="o", ms=3, capsize=2, lw=1, color=BLUE)
    for axes in (course, last):
        axes.axhline(0, **REFERENCE)
    gone = len(names) - len(lives)
    name_axes(course, "time t of measurement", "Lyapunov exponent until then")
    name_axes(last, "its number" + (f" ({gone} more are −∞)" if gone else ""), "Lyapunov exponent")
    last.locator_params(axis="x", integer=True)
    last.margins(x=0.1)
    picture.title(scene_title(file))
    return picture
