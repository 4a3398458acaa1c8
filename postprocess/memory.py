#!/usr/bin/python3
"""Experiments on friction that remembers, each a few runs of the program, drawn as PNG.

    memory.py PROGRAM EXPERIMENT [-o OUT.png]

EXPERIMENT is one of
    hold       slide, hold for a time, pull: the peak of static friction against the time held, runs and law
    steps      the plate's velocity goes up and down by ten: direct effect, then evolution over the distance D
    trigger    how fast a block that slides stably comes to slip under an oscillating plate: frequency against amplitude
    plate      stick-slip gives way to sliding as the plate speeds up and as the spring stiffens
    diagram    the boundary of stable sliding in (log k1, log v), with and without a state law
"""
import argparse
import math
import os
import sys
import tempfile

import stickslip  # first: it says which Python to take

import numpy as np

from style import BLUE, GREEN, GREY, RED, REFERENCE, SLIDES, STICKS, VIOLET, Picture, logarithmic, name_axes, typeset

RUNS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "runs")


def call(command, scene, *words):
    """Runs the program on a scene of runs/; returns its summary."""
    try:
        return stickslip.run(command, os.path.join(RUNS, scene), *words)
    except stickslip.Failed as error:
        sys.exit(f"memory.py: {command} {scene}: {error}")


def series(path):
    group = stickslip.open(path, "series")
    return {name: group[name].values for name in ("t", "eta_mean", "psi_mean", "psi_max", "psi_min")}


LAWS = (("ageing", BLUE), ("slip", RED))


def hold(picture):
    rate, healing = picture.subplots(1, 2)
    b, D, v = 0.03, 0.01, 1e-2
    times = np.logspace(-1, 4, 11)
    for law, colour in LAWS:
        peaks = []
        for time in times:
            call("run", "slide-hold-slide.yaml", "-state_law", law, "-load_v",
                 f"0:{v},10:{v},10:0,{10 + time}:0,{10 + time}:{v}", "-ts_max_time", 40 + time, "-out_file", "held.h5",
                 "-out_frames", 2)
            peaks.append(series("held.h5")["eta_mean"].max() - 0.6)
        picture.label(rate, f"{law} law: runs", *rate.plot(times, peaks, "o", color=colour), where=0.85)
    # At the peak the block moves at about v, its contacts as old as the hold made them: theta = D/v + time, which slip
    # during the pull, (force to be rebuilt)/k, has begun to wear off.
    exact = np.logspace(-1, 4, 200)
    picture.label(rate, "b ln(1 + v t/D): ageing at rest,\nnothing worn off", *rate.plot(exact, b * np.log1p(exact * v / D), color=GREY, lw=1))

    peaks, t_h, tau_inf = [], 100.0, 2.0
    for time in times:
        call("run", "hold-healing.yaml", "-load_v", f"0:0,{time}:0,{time}:0.1", "-ts_max_time", time + 3,
             "-out_file", "held.h5", "-out_frames", 2)
        peaks.append(series("held.h5")["eta_mean"].max())
    picture.label(healing, "Coulomb's law with healing: runs", *healing.plot(times, peaks, "o", color=GREEN))
    # The pull from 0.4 to the threshold lasts about 0.6 to 1.6, far less than t_h.
    law = tau_inf - (tau_inf - 1) * np.exp(-exact / t_h)
    picture.label(healing, r"$\tau_\infty - (\tau_\infty - 1)\,e^{-t/t_h}$", *healing.plot(exact, law, color=GREY, lw=1))
    for axes in (rate, healing):
        logarithmic(axes, "x")
    name_axes(rate, "time held t", "peak of friction over steady friction")
    name_axes(healing, "time held t", "peak of friction (static threshold)")


def steps(picture):
    axes = picture.subplots()
    a, b, D = 0.02, 0.03, 0.01
    levels = ((0.6, "steady at v"), (0.6 + (a - b) * math.log(10), "steady at 10 v"),
              (0.6 + a * math.log(10), "direct effect a ln 10"))
    for law, colour in LAWS:
        call("run", "velocity-steps.yaml", "-state_law", law, "-out_frames", 2, "-out_file", "steps.h5")
        s = series("steps.h5")
        travelled = np.concatenate([[0], np.cumsum(np.diff(s["t"]) * (s["psi_mean"][1:] + s["psi_mean"][:-1]) / 2)])
        picture.label(axes, f"{law} law", *axes.plot(travelled / D, s["eta_mean"], color=colour))
    for level, words in levels:
        axes.axhline(level, **REFERENCE)
        picture.label(axes, words, (0.6, 1), (level, level), GREY, coordinates="row")
    axes.margins(x=0, y=0.1)
    name_axes(axes, "slip over D", "friction η")


def plate(picture):
    def swing(*options):
        call("run", "plate.yaml", *options, "-out_file", "plate.h5", "-out_frames", 2)
        s = series("plate.h5")
        late = s["t"] > 0.7 * s["t"][-1]
        return s["psi_max"][late].max(), s["psi_min"][late].min()

    for axes, name, values in zip(picture.subplots(1, 2, sharey=True), ("model_v", "model_k0"),
                                  (np.geomspace(5e-3, 0.2, 16), np.geomspace(0.02, 10, 16))):
        extremes = np.array([swing("-" + name, x) for x in values])
        v = values if name == "model_v" else np.full(len(values), 0.02)
        high, = axes.plot(values, extremes[:, 0] / v, "^", color=RED)
        low, = axes.plot(values, np.maximum(extremes[:, 1] / v, 1e-6), "v", color=BLUE)
        at, = (point["value"] for point in call("boundary", "plate.yaml", "-boundary_of", "sliding", "-boundary_parameter", name,
                                                "-boundary_from", values[0], "-boundary_to", values[-1], "-boundary_log")["points"])
        for which in "xy":
            logarithmic(axes, which)
        ends = axes.get_xlim()
        axes.axvspan(ends[0], at, color=STICKS, lw=0, zorder=0)
        axes.axvspan(at, ends[1], color=SLIDES, lw=0, zorder=0)
        axes.set_xlim(ends)
        picture.label(axes, "largest ψ/v", high)
        picture.label(axes, "least ψ/v", low)
        picture.label_region(axes, "stick-slip", lambda x, y, at=at: x < at)
        picture.label_region(axes, "sliding", lambda x, y, at=at: x > at)
        name_axes(axes, name, "slip velocity ψ over v" if name == "model_v" else None)


def diagram(picture):
    axes = picture.subplots()

    def curve(*options):
        points = call("boundary", "memory-diagram.yaml", "-boundary_of", "sliding", *options)["points"]
        return np.array(sorted((p["value2"], p["value"]) for p in points)).T

    k1 = np.geomspace(1e-3, 9.99, 200)
    highest = curve("-state_tau_inf", 4)
    for points, colour, name in ((highest, GREEN, "healing to 4"), (curve(), BLUE, "healing to 2"),
                                 (curve("-state_tau_inf", 1.2), VIOLET, "healing to 1.2"),
                                 ((k1, (0.1 * k1) ** -0.25 - 1), GREY, "no state (figure 6)")):
        picture.label(axes, name, *axes.plot(*points, color=colour), where=0.85)
    axes.set_ylim(1e-2, 1e2)
    for which in "xy":
        logarithmic(axes, which)
    no_state = k1, (0.1 * k1) ** -0.25 - 1
    picture.label_region(axes, "sliding stable", lambda x, y: y > np.interp(x, *highest))
    picture.label_region(axes, "sliding unstable", lambda x, y: y < np.interp(x, *no_state))
    name_axes(axes, "model_k1", "model_v")


def trigger(picture):
    axes = picture.subplots()
    v, D, own = 1e-2, 0.01, math.sqrt(0.5)  # own: frequency of the block's own oscillation times D/v, sqrt((b - a)/a)
    frequencies, amplitudes = np.geomspace(0.25, 2.2, 19), np.geomspace(0.02, 0.9, 11)
    fastest = np.empty((len(amplitudes), len(frequencies)))
    for i, amplitude in enumerate(amplitudes):
        for j, frequency in enumerate(frequencies):
            s = call("run", "triggering.yaml", "-load_sine_amplitude", amplitude * v, "-load_sine_period",
                     2 * math.pi * D / (frequency * v), "-out_file", "trigger.h5", "-out_frames", 2)
            fastest[i, j] = series("trigger.h5")["psi_max"].max() / v if s["status"] == "done" else math.nan
    drawn = axes.pcolormesh(frequencies, amplitudes, np.log10(fastest), shading="nearest", cmap="viridis", rasterized=True)
    picture.colorbar(drawn, label=typeset("log10 of largest ψ over v"))
    for which in "xy":
        logarithmic(axes, which)
    axes.axvline(own, color="white", lw=1, ls=":")
    picture.label(axes, "the block's own frequency", (own, own), (amplitudes[0], amplitudes[5]), "white")
    name_axes(axes, "frequency of the load, ω D/v", "amplitude of the load over v")


EXPERIMENTS = {"hold": (hold, 3.6), "steps": (steps, 4.2), "trigger": (trigger, 4.2), "plate": (plate, 3.6), "diagram": (diagram, 4.2)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("program")
    parser.add_argument("experiment", choices=list(EXPERIMENTS))
    parser.add_argument("-o", dest="out", default=None)
    arguments = parser.parse_args()
    os.environ["STICKSLIP"] = os.path.abspath(arguments.program)
    out = os.path.abspath(arguments.out or f"memory-{arguments.experiment}.png")
    draw, height = EXPERIMENTS[arguments.experiment]
    picture = Picture(height)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        draw(picture)
        os.chdir("/")
    picture.savefig(out)
    print(out)


if __name__ == "__main__":
    main()
