"""Pictures as a laboratory draws them: a fit (what was measured, the best run, and what is left), and friction over the way
of the load point."""
import numpy as np

from stickslip import Plate, Unusable, options, scene_title, shown_name, text
from style import BLUE, GREY, RED, REFERENCE, Picture, axis_name, name_axes

QUANTITY = {"force": "eta", "psi": "psi", "displacement": "chi"}
WAY = "displacement of the load point"


def draw_fit(file, args):
    asked = options(file)
    picture = Picture(4.6)
    above, below = picture.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    place, data, fit = (file[name][...] for name in ("place", "data", "fit"))
    dots, = above.plot(place, data, ".", ms=3, color="0.6")
    line, = above.plot(place, fit, color=BLUE)
    picture.label(above, "best fit", line)
    picture.label(above, "data", dots, colour=GREY)
    name_axes(above, y=QUANTITY[asked["fit_of"]])
    below.axhline(0, **REFERENCE)
    below.plot(place, file["left"][...], ".", ms=2, color=RED)
    name_axes(below, {"time": "t", "displacement": WAY}[asked["fit_against"]], "data less fit")
    picture.align_ylabels()
    picture.title(",  ".join(f"{shown_name(text(name))} = {value:.5g}" + ("" if error != error else f" ± {error:.2g}") for name, value, error
                            in zip(*(file["parameters/" + name][...] for name in ("name", "value", "error")))))
    return picture


def draw_lab(file, fits=()):
    """Friction, velocity and state (means over the nodes) over the displacement of the load point; fits of the force."""
    if "series" not in file:
        raise Unusable("has no series (out_series), which this picture is of")
    t, psi, eta = (file["series/" + name][...] for name in ("t", "psi_mean", "eta_mean"))
    states = [name for name in ("theta", "tau", "slip", "z") if name in file]
    picture = Picture(5.6 if states else 4.6)
    panels = picture.subplots(2 + len(states), 1, sharex=True, height_ratios=[2.2] + [1] * (1 + len(states)))
    plate = Plate(file, max([t[-1], *(fit["t"][-1] for fit in fits)]))
    way = plate.shift(t)
    for fit in fits:
        asked = options(fit)
        if asked["fit_of"] != "force":
            raise Unusable(f"is drawn with fits of force, not of {asked['fit_of']}")
        place = fit["place"][...] if asked["fit_against"] == "displacement" else plate.shift(fit["t"][...])
        dots, = panels[0].plot(place, fit["data"][...], ".", ms=3, color="0.65")
        line, = panels[0].plot(place, fit["fit"][...], color=RED, lw=2.4)
        picture.label(panels[0], "best fit", line)
        picture.label(panels[0], "data", dots, colour=GREY)
    line, = panels[0].plot(way, eta, color=BLUE, lw=1.2)
    if fits:
        picture.label(panels[0], "run", line)
    panels[1].plot(way, psi, color=BLUE, lw=1.2)
    if psi.min() > 0 and psi.max() > 30 * psi.min():
        panels[1].set_yscale("log")
    for axes, name in zip(panels[2:], states):
        axes.plot(plate.shift(file["t"][...]), file[name][...].mean(axis=1), color=BLUE, lw=1.2)
    for axes, name in zip(panels, ["friction η", "psi", *states]):
        name_axes(axes, y=name)
        axes.margins(x=0.01)
    name_axes(panels[-1], WAY)
    picture.align_ylabels()
    picture.title(scene_title(file))
    return picture
