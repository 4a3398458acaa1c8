"""Lyapunov exponents of a run."""
import numpy as np
from matplotlib.figure import Figure

from figures import COLOURS
from stickslip import Unusable, scene_title


def slope(rates):
    """Of the line through the sum of the rates, by least squares (growth_average.hpp)."""
    s = (np.arange(len(rates)) + 0.5) / len(rates)
    return np.average(rates, axis=0, weights=s * (1 - s))


def draw_lyapunov(file, args):
    """Left: each exponent by the time that it has been measured over; right: all of them, with errors from 16 blocks."""
    if "lyapunov" not in file:
        raise Unusable("holds no Lyapunov exponents: run with -lyapunov_count")
    group = file["lyapunov"]
    rows = len(group["t"])
    names = sorted((name for name in group if name.startswith("rate_")), key=lambda name: int(name[5:]))
    t, rates = group["t"][:rows], np.array([group[name][:rows] for name in names]).T
    if rows < 16:
        raise Unusable("holds too short a measurement of Lyapunov exponents")
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    course, last = figure.subplots(1, 2, width_ratios=(3, 2))
    lives = np.isfinite(rates).all(axis=0)
    begin = max(8, rows // 20)
    for k in np.flatnonzero(lives):
        course.plot(t[begin:], [slope(rates[:i, k]) for i in range(begin + 1, rows + 1)], lw=1,
                    color=COLOURS[k % len(COLOURS)])
    length = rows // 16
    blocks = [slope(rates[rows - 16 * length + b * length:][:length]) for b in range(16)]
    value, error = slope(rates[:, lives]), np.std(np.array(blocks)[:, lives], axis=0, ddof=1) / 4
    last.errorbar(np.flatnonzero(lives) + 1, value, error, fmt="o", ms=4, capsize=2, color=COLOURS[0])
    for axes in (course, last):
        axes.axhline(0, color="0.5", lw=0.8, zorder=0)
    gone = int((~lives).sum())
    course.set_xlabel("t")
    course.set_ylabel("exponent, from the measurement until t")
    last.set_xlabel("number" + (f" ({gone} more are −∞)" if gone else ""))
    last.set_ylabel("Lyapunov exponent")
    last.locator_params(axis="x", integer=True)
    last.margins(x=0.1)
    figure.suptitle("Lyapunov exponents, " + scene_title(file), fontsize=10)
    return figure
