"""Pictures of a cycle: one period in time, its phase portrait, waves on it, its branch."""
import textwrap

import numpy as np
from matplotlib.figure import Figure

from figures import COLOURS, draw_nullclines, legend_below
from stickslip import SYMBOL, scene_title, shown_name, text

MARKS = {"fold": "s", "flip": "D", "torus": "o", "hopf": "*", "branch": "P", "infinite-period": "X", "long-wave": "v",
         "wave": "^"}


def draw_time_series(axes, file, name, colour):
    """All nodes of the cell, the first one strong; stretches of rest of the first grey."""
    t, values = file["t"][...], file[name][...]
    for node in range(values.shape[1] - 1, -1, -1):
        axes.plot(t, values[:, node], color=colour, lw=1.4 if node == 0 else 0.7, alpha=1 if node == 0 else 0.45)
    if "rest_begin" in file:
        first = file["rest_x"][...] == file["x"][0]
        for begin, end in zip(file["rest_begin"][...][first], file["rest_end"][...][first]):
            for shift in (0, -t[-1]):
                if end + shift > 0:
                    axes.axvspan(max(begin + shift, 0), min(end + shift, t[-1]), color="0.88", lw=0, zorder=0)
    axes.set_ylabel(SYMBOL[name])
    axes.margins(x=0)


def draw_phase(axes, file):
    psi, eta = file["psi"][...], file["eta"][...]
    for node in range(psi.shape[1] - 1, -1, -1):
        axes.plot(psi[:, node], eta[:, node], color=COLOURS[0], lw=1.3 if node == 0 else 0.6,
                  alpha=1 if node == 0 else 0.45, zorder=3, label="the cycle" if node == 0 else None)
    if "rest_begin" in file and psi.shape[1] == 1:
        still = psi[:, 0] == 0
        axes.plot(psi[still, 0], eta[still, 0], color=COLOURS[1], lw=3.5, solid_capstyle="butt", zorder=4, label="at rest")
    axes.margins(0.08)
    low, high = axes.get_xlim()
    axes.set_ylim(axes.get_ylim())
    draw_nullclines(axes, file, low, high, uniform=psi.shape[1] == 1)
    axes.set(xlabel="ψ", ylabel="η", xlim=(low, high))
    legend_below(axes, 2)


def draw_waves(axes, file):
    """The largest growth rate over the wavenumber."""
    k, growth = file["spectrum/wavenumber"][...], file["spectrum/growth_rate"][...]
    axes.axhline(0, color="0.5", lw=0.8)
    axes.plot(k, growth, color=COLOURS[0], lw=1.2)
    top, at = file.attrs["growth_rate"], file.attrs["growth_wavenumber"]
    if top > 0:
        axes.fill_between(k, 0, np.maximum(growth, 0), color=COLOURS[1], alpha=0.25, lw=0)
        axes.plot(at, top, "o", ms=5, color=COLOURS[1], )
        axes.set_title(f"fastest: {top:.6g} at k = {at:.6g}", fontsize=8)
        last = k[np.flatnonzero(growth > 0)[-1]] if (growth > 0).any() else k[-1]
        axes.set_xlim(0, min(k[-1], 4 * last))
        axes.set_ylim(max(growth[k <= 4 * last].min(), -2 * top), 1.25 * top)
    else:
        axes.set_xlim(0, k[-1])
    axes.set(xlabel="wavenumber k", ylabel="largest growth rate")


def draw_cycle_branch(axes, file):
    """The extremes of psi along the branch, thin where it is not stable, with the special points; the period dashed."""
    group, name = file["branch"], text(file.attrs["branch_parameter"])
    value, stable = group["value"][...], group["stable"][...] > 0
    for key, colour in (("psi_max", COLOURS[0]), ("psi_min", COLOURS[5])):
        values = group[key][...]
        axes.plot(value, values, color=colour, lw=0.8, ls=":")
        axes.plot(np.where(stable, value, np.nan), np.where(stable, values, np.nan), color=colour, lw=1.8,
                  label=SYMBOL["psi"] + key[3:].replace("_", " "))
    if "special" in file:
        kinds = [text(kind) for kind in file["special/kind"][...]]
        for kind in dict.fromkeys(kinds):
            at = [v for v, this in zip(file["special/value"][...], kinds) if this == kind]
            height = [group["psi_max"][...][np.argmin(np.abs(value - v))] for v in at]
            axes.plot(at, height, MARKS.get(kind, "d"), mfc="none", mec="k", ls="none", label=kind)
    axes.set(xlabel=shown_name(name), ylabel=SYMBOL["psi"])
    twin = axes.twinx()
    twin.spines["right"].set_visible(True)
    twin.plot(value, group["period"][...], color=COLOURS[1], lw=1, ls="--", label="period")
    twin.set_ylabel("period")
    lines = [one for one in axes.get_lines() + twin.get_lines() if not one.get_label().startswith("_")]
    axes.legend(lines, [one.get_label() for one in lines], fontsize=8, loc="upper center", ncols=4,
                bbox_to_anchor=(0.5, 0), borderaxespad=4)
    axes.set_title(text(file.attrs["branch_end"]), fontsize=8)


def draw_cycle(file, args):
    """psi and eta over one period and the phase portrait; waves and the branch where the file holds them."""
    more = [name for name in ("branch", "spectrum") if name in file]
    figure = Figure(figsize=(10.5, 9.0 if more else 5.0), layout="constrained")
    grid = figure.add_gridspec(3 if more else 2, 2, width_ratios=[1.25, 1], height_ratios=[1, 1, 1.6] if more else None)
    for k, name in enumerate(more):
        below = figure.add_subplot(grid[2, k] if len(more) > 1 else grid[2, :])
        (draw_cycle_branch if name == "branch" else draw_waves)(below, file)
    for k, name in enumerate(("psi", "eta")):
        axes = figure.add_subplot(grid[k, 0])
        draw_time_series(axes, file, name, COLOURS[k])
        if k == 0:
            axes.tick_params(labelbottom=False)
    axes.set_xlabel("t")
    draw_phase(figure.add_subplot(grid[:2, 1]), file)
    nodes = len(file["x"])
    figure.suptitle(f"cycle of {nodes} node{'s' if nodes > 1 else ''}, period {file.attrs['period']:.10g}\n"
                    + textwrap.fill(scene_title(file), 110), fontsize=10)
    return figure
