"""Pictures of what is computed about sliding and waves: spectra, trains, laws."""
import numpy as np

from figures_cycle import draw_extremes
from figures_portrait import Portrait, draw_loop
from stickslip import Unusable, differing, options, scene_title, shown_words, text, told_apart
from style import (BLACK, BLUE, COLOURS, GREEN, GREY, OCHRE, RED, REFERENCE, STICKS, VIOLET, Picture, course,
                   name_axes)


# ---- spectrum -------------------------------------------------------------------------------------------------------

def draw_modes(axes, re, im, **style):
    """Eigenvalues, and their conjugates, listed or not: J is real."""
    return [axes.plot(re, sign * im, "o", **{"ms": 4, **style})[0] for sign in (1, -1)][0]


def draw_spectrum(file, args):
    """The eigenvalues in the complex plane; steady sliding and the rightmost resolved eigenvector over x."""
    re, im, resolved = file["re"][...], file["im"][...], file["resolved"][...] > 0
    if len(re) == 0:
        raise Unusable("holds no eigenvalue")
    picture = Picture(3.8)
    left, right = picture.subplots(1, 2)
    several = resolved.any() and not resolved.all()
    for chosen, colour, words in ((resolved, BLUE, "resolved by the grid"), (~resolved, GREY, "not resolved")):
        if chosen.any():
            line = draw_modes(left, re[chosen], im[chosen], mec=colour, mfc=colour if words[0] == "r" else "w", color=colour)
            if several or not resolved.all():
                picture.label(left, words, line)
    least = 0.05 * max(1e-12, np.abs(im).max(), np.abs(re).max())
    middle = (min(re.min(), 0) + max(re.max(), 0)) / 2
    half = max(0.6 * (max(re.max(), 0) - min(re.min(), 0)), least)
    left.set_xlim(middle - half, middle + half)
    left.axvspan(0, middle + half, color=STICKS, lw=0, zorder=0)
    left.axvline(0, **REFERENCE)
    name_axes(left, "growth_rate", "frequency")
    picture.label_region(left, "growing", lambda x, y: x > 0, RED)
    x = file["x"][...]
    first = max(range(len(re)), key=lambda k: (bool(resolved[k]), re[k]))
    vector = file["psi_re"][first] + 1j * file["psi_im"][first]
    size = np.abs(vector).max()
    if size > 0:
        vector = vector * np.exp(-1j * np.angle(vector[np.argmax(np.abs(vector))])) / size
    for values, colour, words in ((file["steady_psi"][...], GREY, "steady ψ"), (vector.real, BLUE, "real part"),
                                  (vector.imag, RED, "imaginary part"), (np.abs(vector), BLACK, "modulus")):
        line, = right.plot(x, values, color=colour, lw=1.1, ls=":" if colour == BLACK else "-")
        picture.label(right, words, line)
    name_axes(right, "x", "slip velocity ψ of the leading mode")
    right.margins(x=0, y=0.25)
    imaginary = f" ± {abs(im[first]):.6g} i" if im[first] != 0 else ""
    picture.title(f"{scene_title(file)}\nleading mode: λ = {re[first]:.6g}{imaginary}")
    return picture


# ---- wave -----------------------------------------------------------------------------------------------------------

def draw_train_branch(picture, axes, group, attrs):
    """The extremes of psi and the speed or length along a branch of trains, folds marked."""
    name = text(attrs["branch_parameter"])
    other = "speed" if np.ptp(group["speed"][...]) > 0 and name != "wave_speed" else "length"
    said = draw_extremes(picture, axes, group, name, other)
    for at in np.flatnonzero(group["fold"][...]):
        place = group["value"][at], group["psi_min"][at]
        axes.plot(*place, "s", ms=6, mfc="w", mec=BLACK, ls="none", zorder=6)
        picture.label(axes, "fold", *place)
    return f"the branch ends: {shown_words(text(attrs['branch_end']))}; {said}"


def draw_train_modes(picture, axes, group):
    """The rightmost eigenvalues of a train on its ring: filled where two meshes agree."""
    re, im, good = group["re"][...], group["im"][...], group["resolved"][...] > 0
    axes.axvline(0, **REFERENCE)
    for chosen, colour, words in ((good, BLUE, "resolved"), (~good, GREY, "not resolved")):
        if chosen.any():
            line, = axes.plot(re[chosen], im[chosen], "o", color=colour, mfc=colour if colour == BLUE else "none")
            if not good.all():
                picture.label(axes, words, line)
    name_axes(axes, "growth_rate", "frequency Im λ in the frame of the train")
    axes.margins(0.1)


def draw_wave(file, args):
    """Profile and phase portrait of a train, its eigenvalues and its branch where the file holds them; where it holds
    limits of trains in two options, those."""
    if "curves" in file:
        return draw_train_limits(file)
    x, psi, eta = (file[k][...] for k in ("x", "psi", "eta"))
    more = [name for name in ("branch", "spectrum") if name in file]
    portrait = Portrait("x", len(more))
    picture, lines = portrait.picture, []
    portrait.draw_curves(x, psi, eta)
    draw_loop(portrait, (psi, eta), "the train")
    portrait.nullclines(file, uniform=False)
    for name, axes in zip(more, portrait.below):
        if name == "branch":
            lines.append(draw_train_branch(picture, axes, file["branch"], file.attrs))
        else:
            draw_train_modes(picture, axes, file["spectrum"])
    pulses = int(file.attrs["pulses"])
    picture.title("\n".join([f"{pulses} pulse{'s' if pulses > 1 else ''}, V = {file.attrs['speed']:.8g}, L = "
                             f"{file.attrs['length']:.8g}, period T = {file.attrs['period']:.8g}", scene_title(file), *lines]))
    return picture


TRAIN_LIMITS = {"fold": (OCHRE, "two trains merge (fold)"), "hopf": (VIOLET, "a train loses stability, oscillating"),
                "zero": (GREEN, "a train loses stability, without oscillating")}


def add_train_limits(picture, axes, file, swapped=False):
    """Curves on which trains merge or their stability changes; dotted where another mode grows on both sides."""
    group = file["curves"]
    x, y = (group[name][...] for name in (("value2", "value") if swapped else ("value", "value2")))
    kinds, pieces, leads = [text(one) for one in group["kind"][...]], group["piece"][...], group["leads"][...] > 0.5
    shown = set()
    for number in np.unique(pieces):
        chosen = np.flatnonzero(pieces == number)
        colour, words = TRAIN_LIMITS[kinds[chosen[0]]]
        both, = axes.plot(x[chosen], y[chosen], ":", color=colour, lw=0.9)
        led, = axes.plot(x[chosen], np.where(leads[chosen], y[chosen], np.nan), color=colour, lw=1.6)
        for line, said, here in ((led, words, leads[chosen].any()), (both, "trains unstable on both sides", not leads[chosen].any())):
            if here and said not in shown:
                picture.label(axes, said, line)
                shown.add(said)


def draw_train_limits(file):
    names = [text(file.attrs[one]) for one in ("branch_parameter", "branch_parameter2")]
    picture = Picture(4.6)
    axes = picture.subplots()
    add_train_limits(picture, axes, file)
    name_axes(axes, *names)
    pulses, length, speed = int(file.attrs["pulses"]), file.attrs["length"], file.attrs["speed"]
    what = f"L = {length:.6g}" if "wave_length" in options(file) else f"V = {speed:.6g}"
    picture.title(f"trains of {pulses} pulse{'s' if pulses > 1 else ''}, {what}; {scene_title(file, names)}")
    return picture


# ---- laws -----------------------------------------------------------------------------------------------------------

def draw_laws(file, args):
    psi = file["psi"][...]
    stick = {text(name): (low, high) for name, low, high in
             zip(file["stick/name"][...], file["stick/low"][...], file["stick/high"][...])}
    laws = {name: file[name][...] for name in stick}
    picture = Picture(4.6)
    axes = picture.subplots()
    for line in (axes.axhline, axes.axvline):
        line(0, color="0.8", lw=0.8, zorder=0)

    # a law that runs off at the ends must not flatten the others, nor cut a threshold off
    values = np.abs(np.concatenate(list(laws.values())))
    top = max([2 * np.percentile(values[np.isfinite(values)], 80)] +
              [1.35 * high for _, high in stick.values() if np.isfinite(high)])
    axes.set_ylim(-top, top)
    width, steady = 5.0, []
    for k, (name, force) in enumerate(laws.items()):
        low, high = stick[name]
        style = course(k)
        steady += [name] if "steady" in text(file[name].attrs.get("long_name", "")) else []
        if np.isnan(high):
            line, = axes.plot(psi, force, **style)
        else:  # sliding on either side of the stick range, which is the vertical at psi = 0, up to the threshold
            axes.plot(psi[psi < 0], force[psi < 0], **style)
            line, = axes.plot(psi[psi > 0], force[psi > 0], **style)
            style["lw"] = width
            axes.plot([0, 0], [max(low, -2 * top), min(high, 2 * top)], solid_capstyle="butt", **style)
            ends = [end for end in (low, high) if np.isfinite(end)]
            axes.plot(np.zeros(len(ends)), ends, "o", ms=width + 2, color=style["color"])
            width *= 0.6  # what is drawn later lies on top
        end = np.flatnonzero(np.abs(force) < 0.95 * top)[-1]
        picture.label(axes, name + ("" if np.isnan(high) else f", threshold {high:g}"), psi[end], force[end], style["color"])
    name_axes(axes, "psi", "F")
    axes.set_xlim(psi[0], psi[-1] + (0.06 + 0.04 * min(len(laws), 9)) * np.ptp(psi))  # names right of the curves
    axes.set_xticks([tick for tick in axes.get_xticks() if psi[0] <= tick <= psi[-1]])
    picture.title("friction laws" + (f"; of the steady state of the contact: {', '.join(steady)}" if steady else ""))
    return picture


# ---- several spectra --------------------------------------------------------------------------------------------------

def overlay_spectra(files, args):
    """The eigenvalues of several scenes in one plane."""
    picture = Picture(4.6)
    axes = picture.subplots()
    axes.axvline(0, **REFERENCE)
    for k, (file, shown) in enumerate(zip(files, told_apart(files))):
        good = file["resolved"][...] > 0
        line = draw_modes(axes, file["re"][good], file["im"][good], mfc="none", color=COLOURS[k % len(COLOURS)])
        picture.label(axes, shown, line)
    axes.margins(0.1)
    name_axes(axes, "growth_rate", "frequency")
    picture.title(scene_title(files[0], differing(files)))
    return picture
