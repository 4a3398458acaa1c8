"""Pictures as a laboratory draws them: a fit (what was measured, the best run, and what is left), and friction over the way
of the load point."""
import numpy as np
from matplotlib.figure import Figure

from figures import COLOURS
from stickslip import Unusable, options, scene_title, text

QUANTITY = {"force": "spring force η", "psi": "slip velocity ψ", "displacement": "displacement χ"}
PLACE = {"time": "time t", "displacement": "displacement of the load point"}


def draw_fit(file, args):
    asked = options(file)
    figure = Figure(figsize=(8, 5.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    place, data, fit = (file[name][...] for name in ("place", "data", "fit"))
    above.plot(place, data, ".", ms=3, color="0.6", label="data")
    above.plot(place, fit, color=COLOURS[0], lw=1.4, label="best fit")
    above.set_ylabel(QUANTITY[asked["fit_of"]])
    above.legend(frameon=False, ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    found = (f"{text(name)} = {value:.5g}" + ("" if error != error else f" ± {error:.2g}") for name, value, error in
             zip(*(file["parameters/" + name][...] for name in ("name", "value", "error"))))
    above.set_title("\n".join(found), fontsize=10, loc="right")
    below.axhline(0, color="0.5", lw=0.8)
    below.plot(place, file["left"][...], ".", ms=2, color=COLOURS[1])
    below.set(xlabel=PLACE[asked["fit_against"]], ylabel="data less fit")
    return figure


def way_of_load(settings, t):
    """How far the load point has come: the integral of load_v (straight between its points) and of the sine on top."""
    pairs = settings.get("load_v") or f"0:{settings['model_v']}"
    points = np.array([pair.split(":") for pair in pairs.split(",")], float)
    at = np.r_[min(0, points[0, 0]), points[:, 0], max(t[-1], points[-1, 0])]
    v = np.r_[points[0, 1], points[:, 1], points[-1, 1]]
    way = np.r_[0, np.cumsum(np.diff(at) * (v[1:] + v[:-1]) / 2)]

    def base(time):
        k = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
        length = np.where(at[k + 1] > at[k], at[k + 1] - at[k], 1)
        part = time - at[k]
        return way[k] + part * v[k] + (v[k + 1] - v[k]) * part**2 / (2 * length)
    a, period = (float(settings.get("load_sine_" + name, 0) or 0) for name in ("amplitude", "period"))
    sine = a * period / (2 * np.pi) * (1 - np.cos(2 * np.pi * t / period)) if a else 0
    return base(t) - base(np.zeros(1)) + sine


def draw_lab(file, fits=()):
    """Friction, velocity and state (means over the nodes) over the displacement of the load point; fits of the force."""
    if "series" not in file:
        raise Unusable("has no series (out_series), which this picture is of")
    settings = options(file)
    t, psi, eta = (file["series/" + name][...] for name in ("t", "psi_mean", "eta_mean"))
    states = [name for name in ("theta", "tau", "slip", "z") if name in file]
    figure = Figure(figsize=(8, 6.4 if states else 5.2), layout="constrained")
    panels = figure.subplots(2 + len(states), 1, sharex=True, height_ratios=[2.2] + [1] * (1 + len(states)))
    way = way_of_load(settings, t)
    for fit in fits:
        asked = options(fit)
        if asked["fit_of"] != "force":
            raise Unusable(f"is drawn with fits of force, not of {asked['fit_of']}")
        place = fit["place"][...]
        place = place if asked["fit_against"] == "displacement" else way_of_load(options(fit), place)
        panels[0].plot(place, fit["data"][...], ".", ms=3, color="0.65", label="data")
        panels[0].plot(place, fit["fit"][...], color=COLOURS[1], lw=1.4, label="best fit")
    panels[0].plot(way, eta, color=COLOURS[0], lw=1.2, label="run")
    if fits:
        panels[0].legend(frameon=False, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    panels[0].set_ylabel("friction η")
    panels[1].plot(way, psi, color=COLOURS[0], lw=1.2)
    panels[1].set_ylabel("slip velocity ψ")
    if psi.min() > 0 and psi.max() > 30 * psi.min():
        panels[1].set_yscale("log")
    for axes, name in zip(panels[2:], states):
        axes.plot(way_of_load(settings, file["t"][...]), file[name][...].mean(axis=1), color=COLOURS[0], lw=1.2)
        axes.set_ylabel({"theta": "contact age θ", "tau": "strength τ", "slip": "slip", "z": "deflection z"}[name])
    for axes in panels:
        axes.margins(x=0.01)
    panels[-1].set_xlabel("displacement of the load point")
    figure.align_ylabels(panels)
    figure.suptitle(scene_title(file), fontsize=10)
    return figure
