"""What pictures of an oscillation share: psi and eta over time or place, and the orbit in their plane with its nullclines."""
import numpy as np

from style import BLACK, BLUE, GREY, RED, REFERENCE, Picture, name_axes

CURVES = {"psi": BLUE, "eta": RED}


class Portrait:
    """psi and eta, one above the other, with their orbit beside them, and below them room for `more` panels."""

    def __init__(self, across, more=0):
        rows = (more + 1) // 2
        self.picture = Picture(3.7 + 2.7 * rows)
        grid = self.picture.add_gridspec(2 + rows, 2, width_ratios=[1.15, 1], height_ratios=[1, 1] + [1.75] * rows)
        self.curves = {name: self.picture.add_subplot(grid[k, 0]) for k, name in enumerate(CURVES)}
        self.phase = self.picture.add_subplot(grid[:2, 1])
        self.below = [self.picture.add_subplot(grid[2 + k // 2, slice(None) if k % 2 == 0 and k == more - 1 else k % 2])
                      for k in range(more)]
        self.curves["psi"].tick_params(labelbottom=False)
        for name, axes in self.curves.items():
            axes.margins(x=0)
            name_axes(axes, y=name)
            axes.locator_params(axis="x", nbins=6)
        name_axes(self.curves["eta"], x=across)
        name_axes(self.phase, "psi", "eta")
        self.picture.align_ylabels(list(self.curves.values()))

    def draw_curves(self, across, psi, eta):
        for name, values in (("psi", psi), ("eta", eta)):
            self.curves[name].plot(across, values, color=CURVES[name], lw=1.2)

    def nullclines(self, file, uniform=True):
        """Behind the orbit, once that is drawn."""
        draw_nullclines(self.picture, self.phase, file, uniform)


def draw_nullclines(picture, axes, file, uniform=True):
    """Nullclines in the (psi, eta) plane and the fixed point, filled where sliding there is stable; that of eta for a
    uniform state, else the line psi = v."""
    low, high = axes.get_xlim()
    axes.set(xlim=(low, high), ylim=axes.get_ylim())
    if "friction" in file and {"A", "B", "K0", "s_delta"} <= set(file.attrs):
        B, K0, s_delta, v = (float(file.attrs[k]) for k in ("B", "K0", "s_delta", "v"))
        psi, F = file["friction/psi"][...], file["friction/F"][...]
        inside = (psi >= low) & (psi <= high)
        psi, F = psi[inside], F[inside]
        if len(psi) > 1:
            line, = axes.plot(psi, B * psi + F, color=GREY, lw=0.9, zorder=1)
            picture.label(axes, "ψ steady: " + ("η = F(ψ)" if B == 0 else "η = B ψ + F(ψ)"), line)
            if s_delta != 0 and uniform:
                line, = axes.plot(psi, F + K0 * (v - psi) / s_delta, **REFERENCE, scalex=False, scaley=False)
                picture.label(axes, "η steady", line)
            else:
                line = axes.axvline(v, **REFERENCE)
                picture.label(axes, "η steady: ψ = v" if uniform else "ψ = v", [v, v], axes.get_ylim(), GREY, drawn=line)
    if "steady_eta" in file.attrs:
        stable, at = bool(file.attrs["steady_stable"]), (float(file.attrs["v"]), float(file.attrs["steady_eta"]))
        mark, = axes.plot(*at, "o", ms=6, mec=BLACK, mfc=BLACK if stable else "w", ls="none", zorder=5)
        picture.label(axes, f"sliding, {'' if stable else 'un'}stable", *at, drawn=mark)


def draw_loop(portrait, loop, words, before=None):
    """An orbit in the plane of psi and eta, what came before it faint."""
    axes = portrait.phase
    if before is not None:
        axes.plot(*before, color="0.8", lw=0.7, zorder=2)
    line, = axes.plot(*loop, color=BLUE, lw=1.4, zorder=3)
    axes.margins(0.1)
    portrait.picture.label(axes, words, line)
    return line


def room(values, point):
    """Both ends of an axis that holds the values and the point, with room, and never just one spot."""
    low, high = min(np.min(values), point), max(np.max(values), point)
    more = max(0.13 * (high - low), 0.5 * max(abs(point), 1e-9) if high - low < 0.1 * abs(point) else 0)
    return low - more, high + more if high + more > low - more else low + 1


