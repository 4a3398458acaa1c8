"""Picture of a fit: what was measured, the best run, and what is left."""
from matplotlib.figure import Figure

from figures import COLOURS
from stickslip import options, text

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
