"""What the pictures share: fonts and colours, titles that fit, the nullclines of a phase portrait."""
import os
import textwrap

os.environ.setdefault("MPLBACKEND", "Agg")

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402

matplotlib.rcParams.update({
    "font.size": 10, "axes.titlesize": 10, "axes.grid": False, "axes.spines.top": False, "axes.spines.right": False,
    "lines.linewidth": 1.4, "legend.frameon": False, "savefig.dpi": 160, "axes.formatter.useoffset": False})

COLOURS = ["#0b5394", "#cc4125", "#38761d", "#8e44ad", "#b7791f", "#138d90", "#7f6000", "#444444"]


def set_title(axes, words):
    """A title that fits the width of the figure, in two lines where it must."""
    axes.set_title(textwrap.fill(words, int(11.5 * axes.figure.get_figwidth())))


def legend_beside(axes, **settings):
    """The key right of the panel, where no curve runs through it."""
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), **settings)


def legend_below(axes, columns):
    count = len(axes.get_legend_handles_labels()[1])
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0), borderaxespad=4.5, fontsize=9,
                ncols=max(1, min(columns, count)))


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
