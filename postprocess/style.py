"""How every picture looks, in one place: one width and one size of type, so that they are alike on a page; colours, styles of
lines, tints of regions; names of axes in words with symbols; and the figure that places its labels (placing.py)."""
import io
import json
import os
import re
import textwrap

os.environ.setdefault("MPLBACKEND", "Agg")

import matplotlib  # noqa: E402
import matplotlib.style  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator  # noqa: E402

from placing import Placing  # noqa: E402
from stickslip import GREEK, SYMBOL, labels, options, text  # noqa: E402

OWN = {
    "figure.figsize": [7.2, 4.8], "font.size": 9, "figure.dpi": 150, "savefig.dpi": 150, "mathtext.default": "it",
    **{name: "medium" for name in ("axes.titlesize", "axes.labelsize", "xtick.labelsize", "ytick.labelsize", "legend.fontsize",
                                   "figure.titlesize")},
    "axes.spines.top": False, "axes.spines.right": False, "axes.formatter.useoffset": False, "axes.linewidth": 0.7,
    "lines.linewidth": 1.3, "lines.markersize": 4, "legend.frameon": False, "hatch.linewidth": 0.6}
# A matplotlibrc of the user's own holds where it says something else than matplotlib does.
matplotlib.rcParams.update({name: value for name, value in OWN.items()
                            if matplotlib.rcParams[name] == matplotlib.rcParamsDefault[name]})
UNITS = {}         # of quantities and options, where the scene says some: {name: "m/s"}
as_given = set()   # words that stand as the user gave them
given_size = None  # width and height in inches, in place of the width of rcParams and each picture's height


def choose(style=None, size=None, names=()):
    """What the user wants instead: a style sheet of matplotlib, a size in inches, names of quantities or options as
    {name: words} for axes and labels."""
    global given_size
    if style:
        matplotlib.style.use(style)
    given_size = size
    for name, words in dict(names).items():
        NAMES[name], SYMBOLS[name] = words, ""
        as_given.add(words)


def take_names(file):
    """The units and labels of a file's scene."""
    if "option_units" in file.attrs:
        UNITS.update(json.loads(text(file.attrs["option_units"])))
        def note(name, dataset):
            unit = text(dataset.attrs.get("units", ""))
            if unit not in ("", "1"):
                UNITS.setdefault(name.rsplit("/", 1)[-1], unit)
        file.visititems(note)
    for name, words in labels(options(file)).items():
        if NAMES.get(name) not in as_given:
            NAMES[name], SYMBOLS[name] = words, ""
            as_given.add(with_unit(words, name))


def with_unit(words, name):
    return f"{words} ({UNITS[name]})" if name in UNITS and words not in as_given else words


# Told apart by readers who see fewer colours, too (tests/command_line/test_plot.py). The last is for what is only compared.
BLUE, RED, GREEN, VIOLET, OCHRE, SLATE, BLACK = COLOURS = ["#0b3f8a", "#b03800", "#10a878", "#b04fd8", "#c99500", "#5a7f9a",
                                                           "#222222"]
GREY, FAINT = "0.45", "0.78"
STABLE, UNSTABLE = "-", "--"      # of what may be either; nothing else is dashed
STABILITY = "solid: stable, dashed: unstable"
REFERENCE = {"color": GREY, "lw": 0.8, "ls": ":", "zorder": 1}  # a level to compare with
# What is stable in a region, in pictures of boundaries and of sweeps.
SLIDES, STICKS, BOTH = "#dbe8f5", "#f6dccf", "#fbf0bf"

NAMES = {"psi": "slip velocity", "eta": "spring force", "tau": "contact strength", "theta": "contact age", "chi": "displacement",
         "model_v": "plate velocity", "model_gamma": "friction amplitude", "model_delta": "damping", "model_c": "speed of sound",
         "model_m": "mass of a block", "model_k0": "stiffness to the plate", "model_k1": "stiffness between neighbours",
         "model_f0": "friction amplitude", "model_zeta": "viscosity", "model_nu": "viscosity between neighbours",
         "t": "time", "x": "place", "period": "period", "speed": "wave speed", "length": "length of the ring",
         "wave_speed": "wave speed", "wave_length": "length of the ring", "amplitude": "amplitude of", "growth_rate": "growth rate",
         "frequency": "frequency", "k": "wavenumber", "F": "friction over its amplitude", "slip": "slip", "z": "deflection",
         "init_pulses": "number of pulses", "grid_n": "number of nodes", "grid_length": "length of the medium"}
SYMBOLS = {**SYMBOL, **GREEK, "period": "T", "speed": "V", "wave_speed": "V", "length": "L", "wave_length": "L", "amplitude": "ψ",
           "growth_rate": "Re λ", "frequency": "Im λ", "F": "F", "grid_n": "n", "grid_length": "L", "slip": "s",
           **{name: name for name in ("t", "x", "k", "z")}}
LETTER = re.compile(r"(?<![\w.:'\\$^-])(?:[b-zB-Z]|a(?=[ \u00a0]=)|[α-ωΔ])[₀₁₂]?(?![\w:'-])")
SUBSCRIPTS = {"₀": "_0", "₁": "_1", "₂": "_2"}


def typeset(words):
    """Words with their symbols in italics: Greek letters, and Latin ones that stand alone; units stay upright."""
    def italic(match):
        return "$" + "".join(SUBSCRIPTS.get(letter, letter) for letter in match[0]) + "$"
    if words in as_given:
        return words
    units = {*UNITS.values(), *(of + UNITS["t"] for of in ("1/", "rad/") if "t" in UNITS)}
    unit = "|".join(re.escape(name).replace(r"\ ", "[ \u00a0]") for name in sorted(units, key=len, reverse=True))
    stays = r"(\$[^$]*\$" + (rf"|\((?:{unit})\)|(?<=\d[ \u00a0])(?:{unit})(?![\w/^])" if units else "") + ")"
    parts = re.split(stays, str(words))  # what is typeset already, and units in brackets or behind a number
    parts[::2] = [LETTER.sub(italic, part) for part in parts[::2]]
    return "".join(parts)


def axis_name(name):
    """A quantity or an option in words with its symbol; an option that has none by its name with blanks."""
    words = " ".join(filter(None, (NAMES.get(name, "" if name in SYMBOLS else name.replace("_", " ")), SYMBOLS.get(name))))
    return with_unit(words, name)


def name_axes(axes, x=None, y=None):
    """Of quantities, options, or other words."""
    for words, setter in ((x, axes.set_xlabel), (y, axes.set_ylabel)):
        if words is not None:
            setter(typeset(axis_name(words) if words in NAMES or words in SYMBOLS or words in UNITS else words))


def logarithmic(axes, which):
    """A logarithmic axis: decades, as numbers where they are near 1; on a short one 2 and 5 besides."""
    getattr(axes, f"set_{which}scale")("log")
    low, high = sorted(getattr(axes, f"get_{which}lim")())
    decades = np.log10(high / low)
    axis = getattr(axes, which + "axis")
    subs = (1, 2, 3, 5) if decades < 1 else (1, 2, 5) if decades < 2 else (1,)
    axis.set_major_locator(MaxNLocator(5) if decades < 0.5 else LogLocator(subs=subs, numticks=9))
    if decades < 2:
        axis.set_minor_locator(NullLocator())
    if low > 5e-4 and high < 2e4:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


class Picture(Figure):
    """A figure of the one width. Labels are asked for as it is drawn, and placed when all of it is there: clear of curves
    and of each other, whole inside their axes; what finds no place there stands in a key below."""

    def __init__(self, height, **settings):
        width = matplotlib.rcParams["figure.figsize"][0]
        super().__init__(figsize=given_size or (width, height), layout="constrained", **settings)
        self.placing = Placing(self, matplotlib.rcParams["font.size"])

    def grow(self, height):
        """Higher by so much, unless the user gave the size."""
        if not given_size:
            self.set_figheight(self.get_figheight() + height)

    def title(self, words, axes=None, **settings):
        """Above all, or above one panel; in as many lines as it takes."""
        letters = self.get_figwidth() * 130 / matplotlib.rcParams["font.size"]  # about two letters in the height of one
        width = max(8, int(letters * (axes.get_position().width if axes else 1)))
        lines = "\n".join(line for part in words.split("\n") for line in textwrap.wrap(part, width))
        (axes.set_title if axes else self.suptitle)(typeset(lines), **settings)

    def label(self, axes, words, x, y=None, colour=None, **settings):
        """Words beside a curve (a line, or places of the data): where=0 to 1 says where along it they would stand best; drawn
        is the line that is meant, for the key where they find no place."""
        line = settings.pop("drawn", None)
        if y is None:
            line, (x, y) = x, x.get_data()
            colour = colour or line.get_color()
            line.set_label(words)
        self.placing.curve(axes, typeset(words), x, y, colour or BLACK, line, **settings)

    def label_region(self, axes, words, inside, colour=None):
        """Words inside a region: inside(x, y) says which places of the data belong to it."""
        self.placing.region(axes, typeset(words), inside, colour or "0.2")

    def savefig(self, target, **settings):
        drawn = matplotlib.rcParams["lines.linewidth"]
        for line in (line for axes in self.axes for line in axes.lines):  # their widths are meant beside our own
            if line.get_linewidth() != drawn:
                line.set_linewidth(line.get_linewidth() * drawn / OWN["lines.linewidth"])
        self.placing.finish()
        if not (isinstance(target, (str, os.PathLike)) and os.fspath(target).endswith(".png")):
            return super().savefig(target, **settings)
        from PIL import Image  # what matplotlib writes PNG with
        buffer = io.BytesIO()
        super().savefig(buffer, format="png", **settings)
        picture = Image.open(buffer).convert("RGB")
        if buffer.tell() > 120e3:  # of many colours: 24 steps of each from black to white make it a third as large
            picture = picture.point([round(round(value / 255 * 24) * 255 / 24) for value in range(256)] * 3)
        picture.save(target, optimize=True)
        return None


def course(k):
    """The style of the k-th of several curves alike."""
    return {"color": COLOURS[k % len(COLOURS)], "lw": 1.2 if k < len(COLOURS) else 0.7}


def draw_branch(axes, x, y, stable, **style):
    """A branch of solutions, in pieces: 1 where it is stable, 0 where not, nan (thin) where that is not known. Returns the
    longest piece, to be labelled."""
    state = np.where(np.isfinite(stable), stable, -1)
    ends = [0, *(np.flatnonzero(np.diff(state)) + 1), len(x)]
    pieces = []
    for begin, end in zip(ends, ends[1:]):
        known = state[begin] >= 0
        pieces += axes.plot(x[begin:end + 1], y[begin:end + 1], ls=UNSTABLE if state[begin] == 0 else STABLE,
                            **{"lw": 1.6 if known else 0.9, **style})
    return max(pieces, key=lambda line: len(line.get_xdata()))


def stability_words(stable):
    """What a title says of the lines of a branch; this is said once in a picture."""
    known, unstable = np.isfinite(stable), np.asarray(stable) == 0
    if not known.any():
        words = []
    elif unstable.any():
        words = ["dashed: unstable"] if unstable[known].all() else [STABILITY]
    else:
        words = ["all of the branch is stable"]
    return ", ".join(words + ([] if known.all() else ["thin: stability not known"]))

