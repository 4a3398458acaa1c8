"""Pictures of a cycle: one period in time, its phase portrait, waves on it, its branch."""
import numpy as np

from figures_portrait import CURVES, Portrait
from stickslip import scene_title, shown_words, text
from style import BLACK, BLUE, GREEN, RED, REFERENCE, SLATE, STICKS, draw_branch, name_axes, stability_words

MARKS = {"fold": "s", "flip": "D", "torus": "o", "hopf": "*", "branch": "P", "halves": "D", "infinite-period": "X",
         "long-wave": "v", "wave": "^"}
SPELT = {"hopf": "Hopf", "long-wave": "long waves", "wave": "waves"}


def draw_time_series(axes, file, name):
    """All nodes of the cell, the first one strong; stretches of rest of the first grey."""
    t, values = file["t"][...], file[name][...]
    for node in range(values.shape[1] - 1, -1, -1):
        axes.plot(t, values[:, node], color=CURVES[name], lw=1.4 if node == 0 else 0.7, alpha=1 if node == 0 else 0.45)
    if "rest_begin" in file:
        first = file["rest_x"][...] == file["x"][0]
        for begin, end in zip(file["rest_begin"][...][first], file["rest_end"][...][first]):
            for shift in (0, -t[-1]):
                if end + shift > 0:
                    axes.axvspan(max(begin + shift, 0), min(end + shift, t[-1]), color="0.9", lw=0, zorder=0)


def draw_phase(portrait, file):
    psi, eta = file["psi"][...], file["eta"][...]
    axes, picture = portrait.phase, portrait.picture
    for node in range(psi.shape[1] - 1, -1, -1):
        line, = axes.plot(psi[:, node], eta[:, node], color=BLUE, lw=1.4 if node == 0 else 0.6,
                          alpha=1 if node == 0 else 0.45, zorder=3)
    picture.label(axes, "the cycle", line)
    if "rest_begin" in file and psi.shape[1] == 1:
        still = psi[:, 0] == 0
        line, = axes.plot(psi[still, 0], eta[still, 0], color=RED, lw=3.5, solid_capstyle="butt", zorder=4)
        picture.label(axes, "at rest", line)
    axes.margins(0.08)
    portrait.nullclines(file, uniform=psi.shape[1] == 1)


def draw_waves(picture, axes, file):
    """The largest growth rate over the wavenumber."""
    k, growth = file["spectrum/wavenumber"][...], file["spectrum/growth_rate"][...]
    axes.axhline(0, **REFERENCE)
    axes.plot(k, growth, color=BLUE, lw=1.2)
    top, at = file.attrs["growth_rate"], file.attrs["growth_wavenumber"]
    if top > 0:
        axes.fill_between(k, 0, np.maximum(growth, 0), color=STICKS, lw=0)
        axes.plot(at, top, "o", ms=5, color=RED)
        last = k[np.flatnonzero(growth > 0)[-1]] if (growth > 0).any() else k[-1]
        axes.set_xlim(0, min(k[-1], 4 * last))
        axes.set_ylim(max(growth[k <= 4 * last].min(), -2 * top), 1.3 * top)
        picture.label(axes, f"{top:.6g} at k = {at:.6g}", at, top, RED)
    else:
        axes.set_xlim(0, k[-1])
    name_axes(axes, "k", "largest growth rate Re λ")


def specials(file, key):
    """The special points of a branch on the curve of a key: (kind, value, height), each on the sheet where the period is
    its own."""
    if "special" not in file:
        return
    group = file["branch"]
    value, period = group["value"][...], group["period"][...]
    spans = [max(np.ptp(one), 1e-300) for one in (value, period)]
    for kind, at, own in zip(*(file["special/" + name][...] for name in ("kind", "value", "period"))):
        near = np.argmin(np.hypot((value - at) / spans[0], 0 if np.isnan(own) else (period - own) / spans[1]))
        yield text(kind), at, 0. if text(kind) == "hopf" and key == "amplitude" else group[key][near]


def mark_specials(picture, axes, file, key, named=lambda value: True):
    """Marks on the curve of a key; with their names where `named` says so of the value."""
    for kind, at, height in specials(file, key):
        axes.plot(at, height, MARKS.get(kind, "d"), ms=9 if kind == "hopf" else 6, mfc="w", mec=BLACK, ls="none", zorder=6)
        if named(at):
            picture.label(axes, SPELT.get(kind, kind), at, height)


def crowded(group):
    """The range of a branch's option in which nine tenths of what psi does along it happen, where that is a tenth of all values
    at most; or nothing."""
    value = group["value"][...]
    change = sum(np.abs(np.diff(group[key][...])) for key in ("psi_max", "psi_min"))
    middle = (value[1:] + value[:-1]) / 2
    order = np.argsort(middle)
    share = np.cumsum(change[order]) / max(change.sum(), 1e-300)
    low, high = (middle[order][np.searchsorted(share, part)] for part in (0.1, 0.98))
    if not 0 < high - low < 0.1 * np.ptp(value):
        return None
    room = 0.6 * (high - low)
    return max(low - room, value.min()), min(high + room, value.max() + 0.05 * (high - low))


def draw_near_end(picture, axes, group, name):
    """The extremes of psi where most of the branch happens."""
    low, high = crowded(group)
    value = group["value"][...]
    stable = group["stable"][...] if "stable" in group else np.full(len(value), np.nan)
    for key, colour in (("psi_max", BLUE), ("psi_min", SLATE)):
        draw_branch(axes, value, group[key][...], stable, color=colour)
    axes.set_xlim(low, high)
    axes.locator_params(axis="x", nbins=5)
    name_axes(axes, name, "psi")
    picture.title("enlarged", axes)


def draw_extremes(picture, axes, group, name, other):
    """The extremes of psi along a branch of cycles or trains, and on the right another quantity of it."""
    value = group["value"][...]
    stable = group["stable"][...] if "stable" in group else np.full(len(value), np.nan)
    for key, colour, words in (("psi_max", BLUE, "largest ψ"), ("psi_min", SLATE, "least ψ")):
        picture.label(axes, words, draw_branch(axes, value, group[key][...], stable, color=colour))
    twin = axes.twinx()
    twin.spines["right"].set_visible(True)
    picture.label(twin, other, draw_branch(twin, value, group[other][...], stable, color=GREEN, lw=1))
    name_axes(axes, name, "psi")
    name_axes(twin, y=other)
    return stability_words(stable)


def draw_cycle(file, args):
    """psi and eta over one period and the phase portrait; waves and the branch where the file holds them."""
    more = [name for name in ("branch", "spectrum") if name in file]
    near = crowded(file["branch"]) if "branch" in file else None
    more[1:1] = ["enlarged"] if near else []
    portrait = Portrait("t", len(more))
    for name in CURVES:
        draw_time_series(portrait.curves[name], file, name)
    draw_phase(portrait, file)
    nodes, lines = len(file["x"]), []
    for name, axes in zip(more, portrait.below):
        if name == "spectrum":
            draw_waves(portrait.picture, axes, file)
            continue
        parameter = text(file.attrs["branch_parameter"])
        if name == "enlarged":
            draw_near_end(portrait.picture, axes, file["branch"], parameter)
            mark_specials(portrait.picture, axes, file, "psi_max", lambda value: near[0] < value < near[1])
            continue
        said = draw_extremes(portrait.picture, axes, file["branch"], parameter, "period")
        mark_specials(portrait.picture, axes, file, "psi_max", lambda value: not near or not near[0] < value < near[1])
        lines.append(f"the branch ends: {shown_words(text(file.attrs['branch_end']))}\n{said}")
    portrait.picture.title("\n".join([f"cycle of {nodes} node{'s' if nodes > 1 else ''}, period T = {file.attrs['period']:.10g}",
                                      scene_title(file), *lines]))
    return portrait.picture
