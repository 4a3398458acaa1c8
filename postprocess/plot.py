#!/usr/bin/python3
"""Draws a result file of stickslip as PNG.

    plot.py FILE [-o OUT.png] [--what WHAT] [--frame N]

The kind of the file decides what is drawn; for the file of a run, WHAT is one of
    xt       psi over x and t (default); --field names another field
    profile  psi, eta (and the state) against x at one frame
    phase    eta against psi at one frame, with the nullclines and the fixed point of uniform sliding
    probes   psi and eta of the probes against time
    series   means, extremes, steps, ... against time
"""
import argparse
import json
import os
import sys
import textwrap

os.environ.setdefault("MPLBACKEND", "Agg")

import h5py  # noqa: E402
import matplotlib  # noqa: E402
import numpy as np  # noqa: E402

matplotlib.use("Agg")
from matplotlib.figure import Figure  # noqa: E402

matplotlib.rcParams.update({
    "font.size": 10, "axes.titlesize": 10, "axes.grid": False, "axes.spines.top": False, "axes.spines.right": False,
    "lines.linewidth": 1.4, "legend.frameon": False, "savefig.dpi": 160, "axes.formatter.useoffset": False})

COLOURS = ["#0b5394", "#cc4125", "#38761d", "#8e44ad", "#b7791f", "#138d90", "#7f6000", "#444444"]
SYMBOL = {"psi": "ψ", "eta": "η", "tau": "τ", "theta": "θ", "chi": "χ"}
GREEK = {"model_gamma": "γ", "model_delta": "δ", "model_zeta": "ζ", "model_f0": "f₀", "model_k0": "k₀",
         "model_k1": "k₁", "model_c": "c", "model_m": "m", "model_v": "v"}


class Unusable(Exception):
    """The file cannot be drawn; the text is one line for the user."""


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def label(name, dataset=None):
    """Axis label of a dataset: its symbol and what it is."""
    symbol = SYMBOL.get(name, name.replace("_", " "))
    words = text(dataset.attrs.get("long_name", "")) if dataset is not None else ""
    return f"{symbol}   ({words})" if words and words != symbol else symbol


def scene_title(file, varied=()):
    """Says which scene this is, from the options in the file, those in `varied` left out."""
    options = json.loads(text(file.attrs["options"]))
    options = {name: value for name, value in options.items() if name not in varied}
    form = options.get("model_form", "")
    names = {"continuum": ["gamma", "delta", "c", "v"], "chain": ["m", "k0", "k1", "f0", "zeta", "v"]}.get(form, [])
    parts = [form] if form else []
    law, state = options.get("friction_law", ""), options.get("state_law", "")
    parts += [law] if law else []
    parts += [f"state law {state}"] if state not in ("", "none") else []
    for name in names:
        value = options.get("model_" + name, "")
        if value == "":
            continue
        parts.append(f"{GREEK['model_' + name]} = {value}")
        if name == "delta" and float(value) != 0:
            parts[-1] += f" ({options.get('model_delta_sign', 'derived')})"
    if options.get("friction_spread", "0") not in ("", "0"):
        parts.append(f"spread {options['friction_spread']}")
    return ", ".join(part.replace(" ", "\u00a0") for part in parts)


def set_title(axes, words):
    """A title that fits the width of the figure, in two lines where it must."""
    axes.set_title(textwrap.fill(words, int(11.5 * axes.figure.get_figwidth())))


def complete_frames(file):
    """Number of leading frames that are there in t and in every field (a reader may come while one is written)."""
    t = file["t"][...]
    count = int(np.argmax(np.isnan(t))) if np.isnan(t).any() else len(t)
    for name in ("psi", "eta"):
        count = min(count, file[name].shape[0])
    if count == 0:
        raise Unusable("holds no frame yet")
    return count


def fields_of(file):
    """Names of the datasets of (t, x), psi and eta first."""
    n = len(file["x"])
    names = [k for k, v in file.items() if isinstance(v, h5py.Dataset) and v.ndim == 2 and v.shape[1] == n]
    order = ["psi", "eta", "tau", "theta", "chi"]
    return sorted(names, key=lambda k: (order.index(k) if k in order else len(order), k))


def chosen_frame(count, frame):
    if frame is None:
        return count - 1
    if not -count <= frame < count:
        raise Unusable(f"has frames 0 to {count - 1}, not {frame}")
    return frame % count


def legend_below(axes, columns):
    count = len(axes.get_legend_handles_labels()[1])
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0), borderaxespad=4.5, fontsize=9,
                ncols=max(1, min(columns, count)))


# ---- run ------------------------------------------------------------------------------------------------------------

def draw_xt(file, args):
    count, name = complete_frames(file), args.field or "psi"
    if name not in fields_of(file):
        raise Unusable(f"has no field '{name}' (it has {', '.join(fields_of(file))})")
    t, x, data = file["t"][:count], file["x"][...], file[name]
    # no more points than the picture can show; each row is read whole, which is how it lies in the file
    columns = np.unique(np.linspace(0, len(x) - 1, min(len(x), 2400)).astype(int))
    rows = np.unique(np.linspace(0, count - 1, min(count, 1600)).astype(int))
    field = np.stack([data[r][columns] for r in rows])
    good = field[np.isfinite(field)]
    if good.size == 0:
        raise Unusable(f"has no finite value of {name}")
    low, high = np.percentile(good, [0.2, 99.8])
    if high - low < 1e-12 * max(1.0, abs(low)):
        low, high = low - 0.5e-3, high + 0.5e-3
    if low < 0 < high and min(-low, high) > 0.2 * max(-low, high):
        high = max(-low, high)
        low, colours = -high, "RdBu_r"
    else:
        colours = "viridis"
    outside = (good < low).any(), (good > high).any()
    figure = Figure(figsize=(7.2, 5.4), layout="constrained")
    axes = figure.subplots()
    if len(rows) == 1:
        field, rows = np.repeat(field, 2, axis=0), np.array([0, 0])
        edges = np.array([t[0], t[0] + 1e-3])
    else:
        edges = t[rows]
    chain = text(file.attrs.get("model_form", "")) == "chain"  # blocks are shown as blocks
    places = x[columns]
    if len(places) == 1:
        places, field = np.array([places[0], places[0] + 1]), np.repeat(field, 2, axis=1)
    picture = axes.pcolormesh(places, edges, field, cmap=colours, vmin=low, vmax=high, rasterized=True,
                              shading="nearest" if chain or field.size > 4e5 else "gouraud")
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(outside, "neither")
    figure.colorbar(picture, ax=axes, label=label(name, data), extend=extend)
    axes.set(xlabel="x", ylabel="t")
    set_title(axes, scene_title(file))
    return figure


def draw_profile(file, args):
    frame = chosen_frame(complete_frames(file), args.frame)
    names = fields_of(file)
    figure = Figure(figsize=(7.2, 1.2 + 1.9 * len(names)), layout="constrained")
    x = file["x"][...]
    for k, (name, axes) in enumerate(zip(names, np.atleast_1d(figure.subplots(len(names), sharex=True)))):
        axes.plot(x, file[name][frame], color=COLOURS[k % len(COLOURS)], marker="." if len(x) <= 100 else None, ms=4)
        if name == "psi" and "v" in file.attrs:
            axes.axhline(file.attrs["v"], color="0.55", lw=0.9, ls="--")
            axes.annotate("v", (1.0, file.attrs["v"]), xycoords=("axes fraction", "data"), xytext=(3, -3),
                          textcoords="offset points", color="0.4")
        if name == "theta" and np.all(file[name][frame] > 0):
            axes.set_yscale("log")
        else:
            # no picture of rounding errors
            low, high = axes.get_ylim()
            least = 1e-6 * max(1e-30, float(np.abs(file[name][frame]).max()))
            if high - low < least:
                axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)
        axes.set_ylabel(SYMBOL.get(name, name))
        axes.margins(x=0)
        if k == 0:
            set_title(axes, f"t = {file['t'][frame]:.6g}: {scene_title(file)}")
    axes.set_xlabel("x")
    return figure


def draw_nullclines(axes, file, low, high, uniform=True):
    """Nullclines in the (psi, eta) plane and the fixed point, filled where sliding there is stable; that of eta for a
    uniform state, else the line psi = v."""
    if "friction" not in file or "A" not in file.attrs:
        return
    B, K0, s_delta, v = (float(file.attrs[k]) for k in ("B", "K0", "s_delta", "v"))
    psi, F = file["friction/psi"][...], file["friction/F"][...]
    inside = (psi >= low) & (psi <= high)
    psi, F = psi[inside], F[inside]
    if len(psi) > 1:
        balance = "η = F(ψ)" if B == 0 else "η = Bψ + F(ψ)"
        axes.plot(psi, B * psi + F, color="0.45", lw=1.1, label=f"ψ at rest: {balance}", zorder=1)
        if s_delta != 0 and uniform:
            ends = axes.get_ylim()
            axes.plot(psi, F + K0 * (v - psi) / s_delta, color="0.45", lw=1.1, ls="--", zorder=1,
                      label="η at rest: K₀(v − ψ) = sδ(η − F(ψ))")
            axes.set_ylim(ends)
        else:
            axes.axvline(v, color="0.45", lw=1.1, ls="--", zorder=1, label="η at rest: ψ = v" if uniform else "ψ = v")
    if "steady_eta" in file.attrs:
        stable = bool(file.attrs["steady_stable"])
        axes.plot([v], [file.attrs["steady_eta"]], "o", ms=7, mec="k", mfc="k" if stable else "w", ls="none", zorder=5,
                  label=f"uniform sliding, {'stable' if stable else 'unstable'}")


def draw_phase(file, args):
    frame = chosen_frame(complete_frames(file), args.frame)
    psi, eta = file["psi"][frame], file["eta"][frame]
    figure = Figure(figsize=(6.0, 5.6), layout="constrained")
    axes = figure.subplots()
    v = float(file.attrs.get("v", psi.mean()))
    steady = float(file.attrs.get("steady_eta", eta.mean()))

    def span(values, point):
        """Both ends of an axis that holds the values and the point, with room, and never just one spot."""
        low, high = min(values.min(), point), max(values.max(), point)
        room = max(0.13 * (high - low), 0.5 * max(abs(point), 1e-9) if high - low < 0.1 * abs(point) else 0)
        return low - room, high + room if high + room > low - room else low + 1

    axes.set_xlim(span(psi, v))
    axes.set_ylim(span(eta, steady))
    closed = json.loads(text(file.attrs["options"])).get("bc_left", "") in ("", "periodic")
    if closed:
        psi, eta = np.append(psi, psi[0]), np.append(eta, eta[0])
    chain = text(file.attrs.get("model_form", "")) == "chain"  # neighbours need not be alike
    axes.plot(psi, eta, "-", color=COLOURS[0], lw=0.7 if chain else 1.1, alpha=0.35 if chain else 1, zorder=3,
              marker="." if len(psi) <= 2000 else None, ms=3.5,
              label=f"the {'blocks' if chain else 'nodes'}, in order of x")
    if chain:
        axes.plot(psi, eta, ".", color=COLOURS[0], ms=4, zorder=4)
    draw_nullclines(axes, file, *axes.get_xlim())
    axes.set(xlabel="ψ", ylabel="η")
    set_title(axes, f"t = {file['t'][frame]:.6g}: {scene_title(file)}")
    legend_below(axes, 2)
    return figure


def draw_probes(file, args):
    if "probes" not in file:
        raise Unusable("has no probes (option out_probes)")
    group = file["probes"]
    count = min(len(group["t"]), group["psi"].shape[0], group["eta"].shape[0])
    if count == 0:
        raise Unusable("holds no row of its probes yet")
    t, x = group["t"][:count], group["x"][...]
    figure = Figure(figsize=(7.2, 5.0), layout="constrained")
    for name, axes in zip(("psi", "eta"), figure.subplots(2, sharex=True)):
        for k, position in enumerate(x[:12]):
            axes.plot(t, group[name][:count, k], color=COLOURS[k % len(COLOURS)], label=f"x = {position:g}",
                      ls="-" if k < len(COLOURS) else "--")
        axes.set_ylabel(SYMBOL[name])
        axes.margins(x=0)
        if name == "psi":
            set_title(axes, scene_title(file) + (f"; the first 12 of {len(x)} probes" if len(x) > 12 else ""))
    axes.set_xlabel("t")
    legend_below(axes, 6)
    return figure


def draw_series(file, args):
    if "series" not in file:
        raise Unusable("has no series")
    group = file["series"]
    names = [k for k, v in group.items() if isinstance(v, h5py.Dataset) and v.ndim == 1 and k != "t"]
    together = [k for k in ("psi_min", "psi_mean", "psi_max") if k in names]
    panels = ([together] if together else []) + [[k] for k in names if k not in together]
    count = min([len(group["t"])] + [len(group[k]) for k in names])
    if not panels or count == 0:
        raise Unusable("holds no row of its series yet")
    t = group["t"][:count]
    figure = Figure(figsize=(7.2, 0.8 + 1.5 * len(panels)), layout="constrained")
    for panel, axes in zip(panels, np.atleast_1d(figure.subplots(len(panels), sharex=True))):
        for k, name in enumerate(panel):
            axes.plot(t, group[name][:count], color=COLOURS[k % len(COLOURS)], lw=1.2,
                      label={"psi_min": "least", "psi_mean": "mean", "psi_max": "largest"}.get(name))
        axes.set_ylabel("ψ" if panel is together else panel[0].replace("_", " "), fontsize=9)
        axes.margins(x=0)
        if len(panel) > 1:
            axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
        if panel is panels[0]:
            set_title(axes, scene_title(file))
    axes.set_xlabel("t")
    return figure


RUN_PICTURES = {"xt": draw_xt, "profile": draw_profile, "phase": draw_phase, "probes": draw_probes,
                "series": draw_series}


def draw_run(file, args):
    return RUN_PICTURES[args.what or "xt"](file, args)


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
    axes.set(xlabel=GREEK.get(name, name.replace("_", " ")), ylabel=SYMBOL["psi"])
    other = "speed" if np.ptp(group["speed"][...]) > 0 and name != "wave_speed" else "length"
    twin = axes.twinx()
    twin.spines["right"].set_visible(True)
    twin.plot(value, group[other][...], color=COLOURS[1], lw=1, ls="--", label=other)
    twin.set_ylabel(other)
    lines = axes.get_lines() + twin.get_lines()
    axes.legend(lines, [line.get_label() for line in lines], fontsize=8, loc="center left")
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
    """Profile and phase portrait of a train; its eigenvalues and its branch where the file holds them."""
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
        style = {"color": COLOURS[k % len(COLOURS)], "ls": "--" if name == "cubic" else "-"}
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
    axes.legend(fontsize=9, loc="upper left")
    return figure


# ---- boundary --------------------------------------------------------------------------------------------------------

def draw_boundary(file, args):
    """The stability diagram with both regions named, the closed form over it, and what time integration found."""
    name = text(file.attrs["parameter"])
    value, kinds = file["value"][...], [text(kind) for kind in file["kind"][...]]
    closed = file["closed_form_v"][...]
    sample, growth = file["sample"][...], file["growth"][...]
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.subplots()
    if "parameter2" not in file.attrs:
        axes.axhline(0, color="0.6", lw=0.8)
        axes.plot(sample, growth, color=COLOURS[0])
        for v, kind, frequency in zip(value, kinds, file["frequency"][...]):
            axes.plot([v], [0], "o", color=COLOURS[1], label=f"{kind} at {v:.8g}, frequency {frequency:.4g}")
        if file.attrs["log"]:
            axes.set_xscale("log")
        axes.set(xlabel=GREEK.get(name, name), ylabel="growth rate of steady sliding")
        axes.legend(fontsize=8)
    else:
        name2, value2, piece = text(file.attrs["parameter2"]), file["value2"][...], file["piece"][...]
        sample2 = file["sample2"][...]
        far = 1 + 2 * np.nanmax(np.abs(growth))
        axes.contourf(sample, sample2, growth, levels=[-far, 0, far], colors=["#eef4fb", "#fbeeea"])
        for number in np.unique(piece):
            chosen = piece == number
            axes.plot(value[chosen], value2[chosen], ".-", color=COLOURS[0], ms=4,
                      label="computed" if number == 0 else None)
        if name2 == "model_v" and np.isfinite(closed).any():
            axes.plot(value, closed, "--", color=COLOURS[1], lw=1, label="closed form")
        elif name == "model_v" and np.isfinite(closed).any():
            axes.plot(closed, value2, "--", color=COLOURS[1], lw=1, label="closed form")
        switched = file["switched"][...] > 0.5
        if switched.any():
            axes.plot(value[switched], value2[switched], "D", color=COLOURS[4], ms=6, label="another mode leads")
        if file.attrs["log"]:
            axes.set_xscale("log")
        if file.attrs["log2"]:
            axes.set_yscale("log")
        axes.set_xlim(sorted((sample[0], sample[-1])))
        axes.set_ylim(sorted((sample2[0], sample2[-1])))
        # each region is named where it is deepest inside
        for sign, words in ((1, "stick-slip\n(sliding unstable)"), (-1, "stable sliding")):
            inside = np.where(np.isfinite(growth), sign * growth > 0, False)
            if inside.any():
                j, i = deepest(inside)
                x, y = axes.transAxes.inverted().transform(axes.transData.transform((sample[i], sample2[j])))
                x, y = np.clip(x, 0.15, 0.85), np.clip(y, 0.05, 0.95)
                axes.text(x, y, words, ha="center", va="center", fontsize=10, color="0.25", transform=axes.transAxes)
                axes.plot(x + np.linspace(-0.14, 0.14, 9), np.full(9, y), ls="none",
                          transform=axes.transAxes)  # unseen: keeps the legend off the words
        axes.set(xlabel=GREEK.get(name, name), ylabel=GREEK.get(name2, name2))
        axes.legend(fontsize=8, frameon=True, framealpha=0.8)
    if "verified/value" in file:
        group = file["verified"]
        for regime, mark in (("sliding", "o"), ("stick-slip", "^"), ("both live", "s"), ("undecided", "x")):
            chosen = np.array([text(r) == regime for r in group["regime"][...]])
            if chosen.any():
                y = group["value2"][...][chosen] if "parameter2" in file.attrs else np.zeros(chosen.sum())
                axes.plot(group["value"][...][chosen], y, mark, color=COLOURS[2], mfc="none", ls="none",
                          label=f"integrated: {regime}")
        axes.legend(fontsize=8, frameon=True, framealpha=0.8)
    same = [other.strip() for other in json.loads(text(file.attrs["options"])).get("boundary_same", "").split(",")]
    set_title(axes, scene_title(file, [name, text(file.attrs.get("parameter2", "")), *same]))
    return figure


# ---- chart ----------------------------------------------------------------------------------------------------------

def draw_limits(file):
    """For each method the steps that are right, those that end all the same, and the limits of theory."""
    method, implicit, how = ([text(value) for value in file[name][...]] for name in ("method", "implicit", "how"))
    groups = list(dict.fromkeys(zip(file["value"][...], file["order"][...].astype(int), file["n"][...].astype(int))))
    names = [m + (f" ({i})" if m.startswith("arkimex") else "") for m, i in zip(method, implicit)]
    rows = list(dict.fromkeys(names))
    value = {name: file[name][...] for name in ("theory", "limit", "followed", "damps", "damps_theory", "shortest",
                                                "shortest_theory", "longest")}
    finite = np.concatenate([v[np.isfinite(v)] for v in value.values()])
    low, high = finite.min() / 2, finite.max() * 1.6
    columns = min(len(groups), 4)
    lines = -(-len(groups) // columns)
    figure = Figure(figsize=(3.2 + 3.4 * columns if columns > 1 else 8.6, lines * (0.6 + 0.25 * len(rows)) + 1.2),
                    layout="constrained")
    height = 0.6 + 0.25 * len(rows)
    grid = figure.add_gridspec(lines + 1, columns, height_ratios=[height] * lines + [0.8])
    panels = np.array([[figure.add_subplot(grid[i, j]) for j in range(columns)] for i in range(lines)])
    parameter = text(file.attrs["parameter"])
    for panel, group in zip(panels.flat, groups):
        for k, key in enumerate(zip(file["value"][...], file["order"][...].astype(int), file["n"][...].astype(int))):
            if key != group:
                continue
            y = len(rows) - 1 - rows.index(names[k])
            followed = value["followed"][k] if np.isfinite(value["followed"][k]) else low
            ends = value["limit"][k] if np.isfinite(value["limit"][k]) else value["longest"][k]
            panel.barh(y, np.log(followed / low), left=0, height=0.62, color="#0b5394")
            panel.barh(y, np.log(max(ends, followed) / followed), left=np.log(followed / low), height=0.62,
                       color="#cfe2f3")
            if how[k]:
                panel.plot(np.log(ends / low), y, "x" if how[k] == "blow-up" else "+", color="#cc4125", ms=7, mew=1.6)
            for name, mark, fill in (("theory", "|", True), ("damps", "D", True), ("damps_theory", "D", False),
                                     ("shortest", "^", True), ("shortest_theory", "^", False)):
                if np.isfinite(value[name][k]):
                    big = 12 if mark == "|" else 7 if not fill else 4
                    panel.plot(np.log(value[name][k] / low), y, mark, ms=big, mew=1.3, zorder=3,
                               color={"|": "0.1", "D": "#b7791f", "^": "#38761d"}[mark],
                               mfc={"D": "#b7791f", "^": "#38761d"}.get(mark, "none") if fill else "none")
        title = [] if not parameter else [f"{GREEK.get(parameter, parameter)} = {group[0]:g}"]
        if len({g[1:] for g in groups}) > 1:
            title.append(f"order {group[1]}, n = {group[2]}")
        panel.set_title(", ".join(title))
        panel.set_yticks(range(len(rows)), rows[::-1] if panel in panels[:, 0] else [""] * len(rows), fontsize=8)
        ticks = [10.0 ** e for e in range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)]
        ticks = [t for t in ticks if low <= t <= high]
        panel.set_xticks([np.log(t / low) for t in ticks], [f"{t:g}" for t in ticks])
        panel.set_xlim(0, np.log(high / low))
        panel.tick_params(axis="y", length=0)
    for panel in panels.flat[len(groups):]:
        panel.set_axis_off()
    for panel in panels[-1]:
        panel.set_xlabel("fixed step")
    keys = [("s", "#0b5394", "#0b5394", "regime, amplitude and speed right"),
            ("s", "#cfe2f3", "#cfe2f3", "ends, but wrong"),
            ("x", "#cc4125", "none", "blow-up"), ("+", "#cc4125", "none", "Newton fails, or ψ out of bounds"),
            ("|", "0.1", "none", "theory: waves on steepest friction explode"),
            ("^", "#38761d", "#38761d", "shortest wave grows falsely (hollow: theory)"),
            ("D", "#b7791f", "#b7791f", "unstable sliding comes out stable (hollow: theory)")]
    handles = [panels.flat[0].plot([], [], mark, color=colour, mfc=fill, label=label, ls="none", mew=1.5)[0]
               for mark, colour, fill, label in keys]
    keys_below = figure.add_subplot(grid[-1, :])
    keys_below.set_axis_off()
    keys_below.legend(handles=handles, loc="center", ncol=2 if columns < 3 else 3, fontsize=8)
    varied = GREEK.get(parameter, parameter) + " ="
    parts = [part for part in scene_title(file).split(", ") if not part.startswith(varied)]
    figure.suptitle(", ".join(parts), fontsize=10)
    return figure


def draw_chart(file, args):
    """Error against processor time, the front of best choices marked."""
    if text(file.attrs.get("chart_kind", "")) == "limits":
        return draw_limits(file)
    if "cost" not in file:
        raise Unusable("is a chart of another kind, of which there is no picture")
    error, seconds = file["error"][...], file["cost"][...]
    order, n, best = (file[name][...].astype(int) for name in ("order", "n", "best"))
    method, implicit = ([text(value) for value in file[name][...]] for name in ("method", "implicit"))
    names = [m + ("" if i in ("none", "auto") or not m.startswith("arkimex") else f", {i} implicit")
             for m, i in zip(method, implicit)]
    figure = Figure(figsize=(8.6, 5.4), layout="constrained")
    axes = figure.subplots()
    marks = dict(zip(sorted(set(order)), "osD^"))
    grids = sorted(set(n))
    colours = {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(dict.fromkeys(names))}
    drawn = np.isfinite(error) & np.isfinite(seconds) & (error > 0)
    for k in np.flatnonzero(drawn):
        axes.plot(seconds[k], error[k], marks[order[k]], ms=4 + 5 * (grids.index(n[k]) + 1) / len(grids), ls="none",
                  color=colours[names[k]], mfc=colours[names[k]] if best[k] else "none", alpha=1 if best[k] else 0.6)
    front = np.flatnonzero(best & drawn)
    front = front[np.argsort(seconds[front])]
    axes.plot(seconds[front], error[front], color="0.25", lw=1, zorder=0, drawstyle="steps-post")
    axes.set(xscale="log", yscale="log", xlabel="processor time in seconds, median of the repetitions",
             ylabel="largest error of ψ and η at the end")
    for name, colour in colours.items():
        if any(drawn[k] and names[k] == name for k in range(len(names))):
            axes.plot([], [], "o", color=colour, label=name)
    for value, mark in marks.items():
        axes.plot([], [], mark, color="0.4", mfc="none", label=f"order {value} in x")
    if len(grids) > 1:
        axes.plot([], [], "o", color="0.4", mfc="none", ms=6, label=f"size: n = {', '.join(map(str, grids))}")
    axes.plot([], [], color="0.25", lw=1, label="best choices (filled)")
    reference = float(file.attrs["reference_error"])
    if np.isfinite(reference) and drawn.any() and reference * 100 > error[drawn].min() / 30:
        axes.axhline(100 * reference, color="0.6", lw=0.8, ls=":", label="100 times the reference's error")
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    dropped = int((~drawn).sum())
    if dropped:
        axes.text(0.01, 0.01, f"{dropped} of {len(error)} rows have no error to draw", transform=axes.transAxes,
                  fontsize=8, color="0.4")
    set_title(axes, scene_title(file))
    return figure


def deepest(inside):
    """Row and column of the True entry farthest from every False one and from the rim."""
    layer, last = np.pad(inside, 1), None
    while layer.any():
        last = layer
        layer = layer[1:-1, 1:-1] & layer[:-2, 1:-1] & layer[2:, 1:-1] & layer[1:-1, :-2] & layer[1:-1, 2:]
        layer = np.pad(layer, 1)
    rows, columns = np.nonzero(last[1:-1, 1:-1])
    middle = len(rows) // 2
    return rows[middle], columns[middle]


KINDS = {"run": draw_run, "laws": draw_laws, "spectrum": draw_spectrum, "wave": draw_wave, "boundary": draw_boundary,
         "chart": draw_chart}


def draw(path, args):
    """The figure for one file."""
    if not os.path.exists(path):
        raise Unusable("does not exist")
    if not os.path.isfile(path):
        raise Unusable("is not a file")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise Unusable(f"is not a readable HDF5 file ({str(error).splitlines()[0]})") from error
    with file:
        if text(file.attrs.get("program", "")) != "stickslip":
            raise Unusable("was not written by stickslip")
        kind = text(file.attrs.get("kind", ""))
        if kind not in KINDS:
            raise Unusable(f"holds a {kind}, of which there is no picture")
        if args.what and kind != "run":
            raise Unusable(f"holds the result of {kind}: --what is for the file of a run")
        try:
            return KINDS[kind](file, args)
        except (KeyError, OSError, RuntimeError) as error:
            raise Unusable(f"is damaged or incomplete: {str(error).splitlines()[0]}") from error


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", metavar="FILE", help="HDF5 file that stickslip wrote")
    parser.add_argument("-o", "--output", metavar="OUT.png", help="default: FILE with .png (and -WHAT before it)")
    parser.add_argument("--what", choices=sorted(RUN_PICTURES), help="picture of a run")
    for name in ("profile", "phase", "probes", "series"):
        parser.add_argument("--" + name, dest="what", action="store_const", const=name, help=f"short for --what {name}")
    parser.add_argument("--field", metavar="NAME", help="xt: field to draw (psi)")
    parser.add_argument("--frame", type=int, metavar="N", help="profile, phase: frame, from 0 (the last)")
    args = parser.parse_args(arguments)
    output = args.output
    if not output:
        output = os.path.splitext(args.file)[0] + (f"-{args.what}" if args.what not in (None, "xt") else "") + ".png"
    try:
        figure = draw(args.file, args)
    except Unusable as error:
        print(f"plot.py: error: '{args.file}' {error}", file=sys.stderr)
        return 2
    try:
        figure.savefig(output)
    except (OSError, ValueError) as error:
        print(f"plot.py: error: cannot write '{output}': {error}", file=sys.stderr)
        return 2
    print(output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
