"""Pictures of what is computed about sliding and waves: spectra, trains, laws, stability diagrams."""
import textwrap

import numpy as np
from matplotlib.figure import Figure

from figures import COLOURS, draw_nullclines, legend_below, legend_beside, set_title
from stickslip import SYMBOL, Unusable, differing, options, scene_title, shown_name, text, told_apart


# ---- spectrum -------------------------------------------------------------------------------------------------------

def draw_spectrum(file, args):
    """The eigenvalues in the complex plane; steady sliding and the rightmost resolved eigenvector over x."""
    re, im, resolved = file["re"][...], file["im"][...], file["resolved"][...] > 0
    if len(re) == 0:
        raise Unusable("holds no eigenvalue")
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    # J is real: with an eigenvalue its conjugate is one, whether it is listed or not
    for sign in (1, -1):
        for chosen, face, name in ((resolved, COLOURS[0], "resolved by the grid"), (~resolved, "w", "not resolved")):
            if chosen.any():
                left.plot(re[chosen], sign * im[chosen], "o", ms=5, mec=COLOURS[0] if face != "w" else "0.5", mfc=face,
                          label=name if sign == 1 else None)
    least = 0.05 * max(1e-12, np.abs(im).max(), np.abs(re).max())
    middle = (min(re.min(), 0) + max(re.max(), 0)) / 2
    half = max(0.6 * (max(re.max(), 0) - min(re.min(), 0)), least)
    left.set_xlim(middle - half, middle + half)
    edge = file["pseudo_re"][-1] if "pseudo_re" in file else middle + half
    left.axvspan(0, edge, color=COLOURS[1], alpha=0.08, lw=0, label="growing")
    left.axvline(0, color="0.4", lw=0.8)
    left.set(xlabel="Re λ   (growth rate)", ylabel="Im λ   (frequency)")
    if "log10_resolvent" in file:
        z, w, level = file["pseudo_re"][...], file["pseudo_im"][...], file["log10_resolvent"][...]
        lines = left.contour(z, w, level, levels=np.arange(np.floor(level.min() * 4) / 4, level.max() + 0.25, 0.25),
                             cmap="viridis", linewidths=0.8)
        figure.colorbar(lines, ax=left, label="log10 of the resolvent norm (energy)")
        left.set(xlim=(z[0], z[-1]), ylim=(w[0], w[-1]))
        left.locator_params(axis="x", nbins=5)
    legend_below(left, 3)
    x = file["x"][...]
    first = max(range(len(re)), key=lambda k: (bool(resolved[k]), re[k]))
    vector = file["psi_re"][first] + 1j * file["psi_im"][first]
    size = np.abs(vector).max()
    if size > 0:
        vector = vector * np.exp(-1j * np.angle(vector[np.argmax(np.abs(vector))])) / size
    right.plot(x, file["steady_psi"][...], color="0.55", lw=1.1, label="steady ψ")
    right.plot(x, vector.real, color=COLOURS[0], lw=1.1, label="Re")
    right.plot(x, vector.imag, color=COLOURS[1], lw=1.1, label="Im")
    right.plot(x, np.abs(vector), color="k", lw=1.2, ls=":", label="modulus")
    right.set(xlabel="x", ylabel="ψ")
    right.margins(x=0)
    imaginary = f" ± {abs(im[first]):.6g} i" if im[first] != 0 else ""
    right.set_title(f"Eigenvector of λ = {re[first]:.6g}{imaginary}", fontsize=10)
    legend_below(right, 4)
    figure.suptitle(textwrap.fill(scene_title(file), 110), fontsize=10)
    return figure


# ---- wave -----------------------------------------------------------------------------------------------------------

def draw_branch(axes, group, attrs):
    """The extremes of psi and the speed or length along a branch of trains, folds marked."""
    value = group["value"][...]
    name = text(attrs["branch_parameter"])
    for key, colour in (("psi_max", COLOURS[0]), ("psi_min", COLOURS[5])):
        axes.plot(value, group[key][...], color=colour, marker=".", ms=3, lw=1,
                  label=SYMBOL["psi"] + key[3:].replace("_", " "))
    folds = np.flatnonzero(group["fold"][...])
    axes.plot(value[folds], group["psi_min"][...][folds], "s", mfc="none", mec="k", ls="none", label="fold")
    axes.set(xlabel=shown_name(name), ylabel=SYMBOL["psi"])
    other = "speed" if np.ptp(group["speed"][...]) > 0 and name != "wave_speed" else "length"
    twin = axes.twinx()
    twin.spines["right"].set_visible(True)
    twin.plot(value, group[other][...], color=COLOURS[1], lw=1, ls="--", label=other)
    twin.set_ylabel(other)
    lines = axes.get_lines() + twin.get_lines()
    axes.legend(lines, [line.get_label() for line in lines], fontsize=8, loc="upper center", ncols=4,
                bbox_to_anchor=(0.5, 0), borderaxespad=4)
    axes.set_title(text(attrs["branch_end"]), fontsize=8)


def draw_train_modes(axes, group):
    """The rightmost eigenvalues of a train on its ring: filled where two meshes agree."""
    re, im, good = group["re"][...], group["im"][...], group["resolved"][...] > 0
    axes.axvline(0, color="0.6", lw=0.9)
    axes.plot(re[good], im[good], "o", ms=5, color=COLOURS[0], label="resolved")
    if not good.all():
        axes.plot(re[~good], im[~good], "o", ms=5, mfc="none", color=COLOURS[1], label="not resolved")
    axes.set(xlabel="Re λ", ylabel="Im λ (frame of the train)")
    axes.margins(0.1)
    axes.legend(fontsize=8)


def draw_wave(file, args):
    """Profile and phase portrait of a train, its eigenvalues and its branch where the file holds them; where it holds
    limits of trains in two options, those."""
    if "curves" in file:
        return draw_train_limits(file)
    x, psi, eta = (file[k][...] for k in ("x", "psi", "eta"))
    more = [name for name in ("branch", "spectrum") if name in file]
    figure = Figure(figsize=(10.5, 9.0 if more else 5.0), layout="constrained")
    grid = figure.add_gridspec(3 if more else 2, 2, width_ratios=[1.25, 1], height_ratios=[1, 1, 1.6] if more else None)
    for k, name in enumerate(more):
        below = figure.add_subplot(grid[2, k] if len(more) > 1 else grid[2, :])
        if name == "branch":
            draw_branch(below, file["branch"], file.attrs)
        else:
            draw_train_modes(below, file["spectrum"])
    for k, (name, values) in enumerate((("psi", psi), ("eta", eta))):
        axes = figure.add_subplot(grid[k, 0])
        axes.plot(x, values, color=COLOURS[k])
        axes.set_ylabel(SYMBOL[name])
        axes.margins(x=0)
        if k == 0:
            axes.tick_params(labelbottom=False)
    axes.set_xlabel("x")
    phase = figure.add_subplot(grid[:2, 1])
    phase.plot(psi, eta, color=COLOURS[0], lw=1.2, zorder=3, label="the train")
    phase.margins(0.08)
    low, high = phase.get_xlim()
    phase.set_ylim(phase.get_ylim())
    draw_nullclines(phase, file, low, high, uniform=False)
    phase.set(xlabel="ψ", ylabel="η", xlim=(low, high))
    legend_below(phase, 2)
    pulses = int(file.attrs["pulses"])
    figure.suptitle(f"{pulses} pulse{'s' if pulses > 1 else ''}, V = {file.attrs['speed']:.8g}, "
                    f"L = {file.attrs['length']:.8g}, period {file.attrs['period']:.8g}\n"
                    + textwrap.fill(scene_title(file), 110), fontsize=10)
    return figure


TRAIN_LIMITS = {"fold": "two trains merge (fold)", "hopf": "a train loses stability, oscillating",
                "zero": "a train loses stability, without oscillating"}


def add_train_limits(axes, file, swapped=False):
    """Curves on which trains merge or their stability changes; dotted where another mode grows on both sides."""
    group = file["curves"]
    x, y = (group[name][...] for name in (("value2", "value") if swapped else ("value", "value2")))
    kinds, pieces, leads = [text(one) for one in group["kind"][...]], group["piece"][...], group["leads"][...] > 0.5
    shown = set()
    for number in np.unique(pieces):
        chosen = np.flatnonzero(pieces == number)
        kind = kinds[chosen[0]]
        colour = COLOURS[5 + list(TRAIN_LIMITS).index(kind)]
        axes.plot(x[chosen], y[chosen], ":", color=colour, lw=1)
        led = np.where(leads[chosen], y[chosen], np.nan)
        axes.plot(x[chosen], led, ".-", color=colour, ms=4, lw=1.5,
                  label=TRAIN_LIMITS[kind] if leads[chosen].any() and kind not in shown else None)
        shown |= {kind} if leads[chosen].any() else set()
        if not leads[chosen].any() and ("dotted", kind) not in shown:
            axes.plot([], [], ":", color=colour, lw=1, label=f"{kind} of trains unstable on both sides")
            shown.add(("dotted", kind))


def draw_train_limits(file):
    names = [text(file.attrs[one]) for one in ("branch_parameter", "branch_parameter2")]
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.subplots()
    add_train_limits(axes, file)
    axes.set(xlabel=shown_name(names[0]), ylabel=shown_name(names[1]))
    axes.legend(fontsize=8)
    pulses, length, speed = int(file.attrs["pulses"]), file.attrs["length"], file.attrs["speed"]
    what = f"L = {length:.6g}" if "wave_length" in options(file) else f"V = {speed:.6g}"
    set_title(axes, f"trains of {pulses} pulse{'s' if pulses > 1 else ''}, {what}; {scene_title(file, names)}")
    return figure


# ---- laws -----------------------------------------------------------------------------------------------------------

def draw_laws(file, args):
    psi = file["psi"][...]
    stick = {text(name): (low, high) for name, low, high in
             zip(file["stick/name"][...], file["stick/low"][...], file["stick/high"][...])}
    laws = {name: file[name][...] for name in stick}
    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    axes = figure.subplots()
    axes.axhline(0, color="0.8", lw=0.8, zorder=0)
    axes.axvline(0, color="0.8", lw=0.8, zorder=0)

    # a law that runs off at the ends must not flatten the others, nor cut a threshold off
    values = np.abs(np.concatenate(list(laws.values())))
    top = max([2 * np.percentile(values[np.isfinite(values)], 80)] +
              [1.35 * high for _, high in stick.values() if np.isfinite(high)])
    axes.set_ylim(-top, top)
    width = 5.0
    for k, (name, force) in enumerate(laws.items()):
        low, high = stick[name]
        style = {"color": COLOURS[k % len(COLOURS)],
                 "ls": "--" if name == "cubic" else ("-", ":", "-.")[k // len(COLOURS) % 3]}
        words = name + (", steady state" if "steady" in text(file[name].attrs.get("long_name", "")) else "")
        if np.isnan(high):
            axes.plot(psi, force, label=words, **style)
            continue
        # sliding on either side of the stick range, which is the vertical at psi = 0, up to the threshold
        axes.plot(psi[psi < 0], force[psi < 0], label=f"{words}, threshold {high:g}", **style)
        axes.plot(psi[psi > 0], force[psi > 0], **style)
        axes.plot([0, 0], [max(low, -2 * top), min(high, 2 * top)], lw=width, solid_capstyle="butt", **style)
        ends = [end for end in (low, high) if np.isfinite(end)]
        axes.plot(np.zeros(len(ends)), ends, "o", ms=width + 3, color=style["color"])
        width *= 0.5  # what is drawn later lies on top
    axes.set(xlabel="ψ   (sliding velocity)", ylabel="F   (friction over its amplitude)")
    axes.margins(x=0)
    axes.set_title("Friction laws")
    if len(laws) > 6:  # no room inside
        figure.set_size_inches(8.8, 4.6)
        axes.legend(fontsize=9, loc="center left", bbox_to_anchor=(1, 0.5))
    else:
        axes.legend(fontsize=9, loc="upper left")
    return figure


# ---- several spectra --------------------------------------------------------------------------------------------------

def overlay_spectra(files, args):
    """The eigenvalues of several scenes in one plane."""
    figure = Figure(figsize=(7.6, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.axvline(0, color="0.4", lw=0.8)
    for k, (file, shown) in enumerate(zip(files, told_apart(files))):
        re, im, good = file["re"][...], file["im"][...], file["resolved"][...] > 0
        for sign in (1, -1):  # J is real: with an eigenvalue its conjugate is one
            axes.plot(re[good], sign * im[good], "o", ms=5, mfc="none", color=COLOURS[k % len(COLOURS)],
                      label=shown if sign == 1 else None)
    axes.margins(0.1)
    axes.set(xlabel="Re λ   (growth rate)", ylabel="Im λ   (frequency)")
    legend_beside(axes)
    set_title(axes, scene_title(files[0], differing(files)))
    return figure
