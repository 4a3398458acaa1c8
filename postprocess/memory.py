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

os.environ.setdefault("MPLBACKEND", "Agg")

import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

import stickslip  # noqa: E402

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


def hold(axes, healing):
    a, b, D, v, k = 0.02, 0.03, 0.01, 1e-2, 2.0
    times = np.logspace(-1, 4, 11)
    for law, colour in (("ageing", "#0b5394"), ("slip", "#cc4125")):
        peaks = []
        for time in times:
            call("run", "slide-hold-slide.yaml", "-state_law", law, "-load_v",
                 f"0:{v},10:{v},10:0,{10 + time}:0,{10 + time}:{v}", "-ts_max_time", 40 + time, "-out_file", "held.h5",
                 "-out_frames", 2)
            peaks.append(series("held.h5")["eta_mean"].max() - 0.6)
        axes.semilogx(times, peaks, "o", color=colour, label=f"{law} law: runs")
    # At the peak the block moves at about v, its contacts as old as the hold made them: theta = D/v + time, which slip
    # during the pull, (force to be rebuilt)/k, has begun to wear off.
    axes.semilogx(times, b * np.log1p(times * v / D), color="#777777", lw=1,
                  label="b ln(1 + v t/D): ageing at rest, nothing worn off")
    axes.set_xlabel("time held t")
    axes.set_ylabel("peak of friction over steady friction")
    axes.set_title("rate-and-state", fontsize=9)
    axes.legend(fontsize=8)

    times, peaks, t_h, tau_inf = np.logspace(-1, 4, 11), [], 100.0, 2.0
    for time in times:
        call("run", "hold-healing.yaml", "-load_v", f"0:0,{time}:0,{time}:0.1", "-ts_max_time", time + 3,
             "-out_file", "held.h5", "-out_frames", 2)
        peaks.append(series("held.h5")["eta_mean"].max())
    healing.semilogx(times, peaks, "o", color="#38761d", label="Coulomb with healing: runs")
    # The pull from 0.4 to the threshold lasts about 0.6 to 1.6, far less than t_h.
    exact = np.logspace(-1, 4, 200)
    healing.semilogx(exact, tau_inf - (tau_inf - 1) * np.exp(-exact / t_h), color="#777777", lw=1,
                     label="law: tau_inf - (tau_inf - 1) exp(-t/t_h)")
    healing.set_xlabel("time held t")
    healing.set_ylabel("peak of friction (static threshold)")
    healing.set_title("healing", fontsize=9)
    healing.legend(fontsize=8)


def steps(axes):
    a, b, D = 0.02, 0.03, 0.01
    for law, colour in (("ageing", "#0b5394"), ("slip", "#cc4125")):
        call("run", "velocity-steps.yaml", "-state_law", law, "-out_frames", 2, "-out_file", "steps.h5")
        s = series("steps.h5")
        travelled = np.concatenate([[0], np.cumsum(np.diff(s["t"]) * (s["psi_mean"][1:] + s["psi_mean"][:-1]) / 2)])
        axes.plot(travelled / D, s["eta_mean"], color=colour, label=f"{law} law")
    for level, text in ((0.6, "steady at v"), (0.6 + (a - b) * math.log(10), "steady at 10 v"),
                        (0.6 + a * math.log(10), "direct effect a ln 10")):
        axes.axhline(level, color="#777777", lw=0.7, ls=":")
        axes.annotate(text, (24.8, level), ha="right", va="bottom", fontsize=8, color="#555555")
    axes.set_xlabel("slip / D")
    axes.set_ylabel("friction force")
    axes.legend()


def plate(left, right):
    def swing(*options):
        call("run", "plate.yaml", *options, "-out_file", "plate.h5", "-out_frames", 2)
        s = series("plate.h5")
        late = s["t"] > 0.7 * s["t"][-1]
        return s["psi_max"][late].max(), s["psi_min"][late].min()

    for axes, name, values, title in (
            (left, "model_v", np.geomspace(5e-3, 0.2, 16), "plate velocity v"),
            (right, "model_k0", np.geomspace(0.02, 10, 16), "spring stiffness k0")):
        extremes = np.array([swing("-" + name, x) for x in values])
        v = values if name == "model_v" else np.full(len(values), 0.02)
        axes.loglog(values, extremes[:, 0] / v, "^", color="#cc4125", label="largest velocity / v")
        axes.loglog(values, np.maximum(extremes[:, 1] / v, 1e-6), "v", color="#0b5394", label="least velocity / v (from 1e-6)")
        found = call("boundary", "plate.yaml", "-boundary_of", "sliding", "-boundary_parameter", name, "-boundary_from", values[0], "-boundary_to",
                     values[-1], "-boundary_log")["points"]
        for point in found:
            axes.axvline(point["value"], color="#777777", lw=0.8, ls=":")
        axes.set_xlabel(title)
    left.legend(fontsize=8)
    left.set_title("stick-slip left of the dotted line, sliding right of it", fontsize=9)


def diagram(axes):
    def curve(*options):
        points = call("boundary", "memory-diagram.yaml", "-boundary_of", "sliding", *options)["points"]
        points = sorted((p["value2"], p["value"]) for p in points)
        return np.array(points)

    for options, colour, name in ((("-state_tau_inf", 4), "#38761d", "healing to 4"),
                                  ((), "#0b5394", "healing to 2"),
                                  (("-state_tau_inf", 1.2), "#8e44ad", "healing to 1.2")):
        points = curve(*options)
        axes.loglog(points[:, 0], points[:, 1], ".-", color=colour, label=name)
    k1 = np.geomspace(1e-3, 9.99, 200)
    axes.loglog(k1, (0.1 * k1) ** -0.25 - 1, color="#777777", label="no state: sqrt(f0/zeta) - 1 (figure 6)")
    axes.set_ylim(1e-2, 1e2)
    axes.set_xlabel("k1")
    axes.set_ylabel("v")
    axes.set_title("sliding is stable above the curves", fontsize=9)
    axes.legend(fontsize=8)


def trigger(axes):
    v, D, own = 1e-2, 0.01, math.sqrt(0.5)  # own: frequency of the block's own oscillation times D/v, sqrt((b - a)/a)
    frequencies, amplitudes = np.geomspace(0.25, 2.2, 19), np.geomspace(0.02, 0.9, 11)
    fastest = np.empty((len(amplitudes), len(frequencies)))
    for i, amplitude in enumerate(amplitudes):
        for j, frequency in enumerate(frequencies):
            s = call("run", "triggering.yaml", "-load_sine_amplitude", amplitude * v, "-load_sine_period",
                     2 * math.pi * D / (frequency * v), "-out_file", "trigger.h5", "-out_frames", 2)
            fastest[i, j] = series("trigger.h5")["psi_max"].max() / v if s["status"] == "done" else math.nan
    picture = axes.pcolormesh(frequencies, amplitudes, np.log10(fastest), shading="nearest", cmap="viridis")
    axes.figure.colorbar(picture, label="largest velocity / v, log10")
    axes.axvline(own, color="white", lw=1, ls=":")
    axes.annotate("  the block's own", (own, amplitudes[-1]), color="white", fontsize=8, va="top")
    axes.set_xscale("log")
    axes.set_yscale("log")
    ticks = [0.25, 0.35, 0.5, 0.71, 1, 1.41, 2]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("frequency of the load, omega D/v")
    axes.set_ylabel("amplitude of the load / v")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("program")
    parser.add_argument("experiment", choices=["hold", "steps", "trigger", "plate", "diagram"])
    parser.add_argument("-o", dest="out", default=None)
    arguments = parser.parse_args()
    os.environ["STICKSLIP"] = os.path.abspath(arguments.program)
    out = os.path.abspath(arguments.out or f"memory-{arguments.experiment}.png")
    figure = Figure(figsize=(9, 4) if arguments.experiment in ("plate", "hold") else (6.4, 4.4), layout="constrained")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        if arguments.experiment in ("plate", "hold"):
            globals()[arguments.experiment](*figure.subplots(1, 2))
        else:
            globals()[arguments.experiment](figure.subplots())
        os.chdir("/")
    figure.savefig(out, dpi=160)
    print(out)


if __name__ == "__main__":
    main()
