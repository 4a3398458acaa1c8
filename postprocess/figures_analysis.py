"""Pictures of what is computed about sliding and waves: spectra, trains, laws."""
import numpy as np

from figures_cycle import crowded, draw_extremes, draw_near_end
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

def draw_train_branch(picture, axes, group, attrs, enlarged=None):
    """The extremes of psi and the speed or length along a branch of trains, folds marked."""
    name = text(attrs["branch_parameter"])
    other = "speed" if np.ptp(group["speed"][...]) > 0 and name != "wave_speed" else "length"
    said = draw_extremes(picture, axes, group, name, other)
    near = crowded(group)
    for at in np.flatnonzero(group["fold"][...]):
        for panel, here in ((axes, near is None), (enlarged, True)):
            if panel is not None:
                place = group["value"][at], group["psi_max"][at]
                panel.plot(*place, "s", ms=6, mfc="w", mec=BLACK, ls="none", zorder=6)
                if here:
                    picture.label(panel, "fold", *place)
    if enlarged is not None:
        draw_near_end(picture, enlarged, group, name)
    return f"the branch ends: {shown_words(text(attrs['branch_end']))}\n{said}"


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
    more[1:1] = ["enlarged"] if "branch" in file and crowded(file["branch"]) else []
    portrait = Portrait("x", len(more))
    picture, lines = portrait.picture, []
    portrait.draw_curves(x, psi, eta)
    draw_loop(portrait, (psi, eta), "the train")
    portrait.nullclines(file, uniform=False)
    for name, axes in zip(more, portrait.below):
        if name == "branch":
            enlarged = portrait.below[1] if "enlarged" in more else None
            lines.append(draw_train_branch(picture, axes, file["branch"], file.attrs, enlarged))
        elif name == "spectrum":
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
    if len(laws) > 6:
        return draw_each_law(file, psi, laws, stick)
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


def draw_each_law(file, psi, laws, stick):
    """Many laws, each in a panel of its own, on the same axes; those with a threshold first."""
    columns = 4
    names = sorted(laws, key=lambda name: (not np.isfinite(stick[name][1]), name == "cubic"))
    rows = -(-len(names) // columns)
    picture = Picture(0.9 + 1.5 * rows)
    panels = picture.subplots(rows, columns, sharex=True, sharey=True)
    top = 1.25 * max(np.nanmax(np.abs([high for _, high in stick.values()])), 1)
    for name, axes in zip(names, panels.flat):
        low, high = stick[name]
        for line in (axes.axhline, axes.axvline):
            line(0, color="0.8", lw=0.8, zorder=0)
        for side in ((psi, np.full(len(psi), True)),) if np.isnan(high) else ((psi, psi < 0), (psi, psi > 0)):
            axes.plot(psi[side[1]], laws[name][side[1]], color=BLUE, lw=1.4)
        if np.isfinite(high):
            axes.plot([0, 0], [low, high], color=RED, lw=1.4)
        steady = "steady" in text(file[name].attrs.get("long_name", ""))
        axes.set_title(name + (" *" if steady else ""), fontsize="medium")
    for axes in panels.flat[len(names):]:
        axes.set_axis_off()
    for axes in panels[:, 0]:
        name_axes(axes, y="F(ψ)")
    for column in range(columns):
        name_axes(panels[(len(names) - 1 - column) // columns, column], "psi")
        panels[(len(names) - 1 - column) // columns, column].tick_params(labelbottom=True)
    panels[0, 0].set(xlim=(psi[0], psi[-1]), ylim=(-top, top))
    picture.title("friction over its amplitude F; red: forces that hold a contact at rest; *: with its state steady")
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
