"""Pictures of a run."""
import h5py
import numpy as np
from matplotlib.figure import Figure

from figures import COLOURS, draw_nullclines, legend_below, legend_beside, set_title
from figures_chaos import draw_lyapunov
from stickslip import SYMBOL, Unusable, differing, label, options, scene_title, text, told_apart


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


def is_block(file):
    """Does every node do the same? Then there is nothing to see along x."""
    return len(file["x"]) == 1 or "one node" in text(file.attrs.get("reduced", ""))


def passages(t, psi, v):
    """When psi passes v as it speeds up towards it, in the second half of the run, counted as for the summary's period: after it
    was short of v by a hundredth of it. Between rows by the polynomial through six of them, all from behind a
    rest."""
    side = -1 if v < 0 else 1
    short, times, armed = side * (psi - v), [], False
    depth = 0.01 * abs(v) or 1e-3
    for k in range(max(1, np.searchsorted(t, t[-1] / 2)), len(t)):
        armed = armed or short[k - 1] < -depth
        if not (armed and short[k - 1] < 0 <= short[k]):
            continue
        armed = False
        first = max(k - 3, 0)
        while first < k - 1 and psi[first] == 0:
            first += 1
        near = slice(min(first, max(len(t) - 6, 0)), first + 6)
        low, high = t[k - 1], t[k]
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if lagrange(t[near], short[near], middle) < 0 else (low, middle)
        times.append(high)
    return np.array(times)


def lagrange(at, values, t):
    weights = [np.prod([(t - b) / (a - b) for b in at if b != a]) for a in at]
    return float(np.dot(weights, values))


def draw_block(file, args):
    """One block, or a medium that moves as one: psi and eta against time, and the orbit in their plane."""
    count = complete_frames(file)
    t, psi, eta = file["t"][:count], file["psi"][:count, 0], file["eta"][:count, 0]
    if "series" in file and len(file["series/t"]) > count:  # a row for every step
        series = file["series"]
        rows = min(len(series[name]) for name in ("t", "psi_mean", "eta_mean"))
        t, psi, eta = (series[name][:rows] for name in ("t", "psi_mean", "eta_mean"))
    figure = Figure(figsize=(9.6, 4.8), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=[1.3, 1], height_ratios=[1, 1, 0.25])
    for k, (name, values) in enumerate((("psi", psi), ("eta", eta))):
        axes = figure.add_subplot(grid[k, 0])
        axes.plot(t, values, color=COLOURS[k], lw=1.1)
        axes.set_ylabel(SYMBOL[name])
        axes.margins(x=0)
        if name == "psi" and "v" in file.attrs:
            axes.axhline(file.attrs["v"], color="0.55", lw=0.9, ls="--")
            axes.annotate("v", (1.0, file.attrs["v"]), xycoords=("axes fraction", "data"), xytext=(3, -3),
                          textcoords="offset points", color="0.4")
        if k == 0:
            axes.tick_params(labelbottom=False)
    axes.set_xlabel("t")
    phase = figure.add_subplot(grid[:2, 1])
    times = passages(t, psi, file.attrs["v"]) if "v" in file.attrs else []
    if len(times) < 2:
        loop, before, name = (psi, eta), None, "from beginning to end"
    else:  # closed: from one passage to the next, both ends between rows
        begin, end = times[-2:]
        inside = (t > begin) & (t < end)
        loop = [np.concatenate([[np.interp(begin, t, y)], y[inside], [np.interp(end, t, y)]]) for y in (psi, eta)]
        before, name = t <= begin, f"last period, {(times[-1] - times[0]) / (len(times) - 1):.4g}"
        phase.plot(psi[before], eta[before], color="0.75", lw=0.8, label="before")
    phase.plot(*loop, color=COLOURS[0], lw=1.4, zorder=3, label=name)
    phase.margins(0.1)
    low, high = phase.get_xlim()
    phase.set_ylim(phase.get_ylim())
    draw_nullclines(phase, file, low, high)
    phase.set(xlabel="ψ", ylabel="η", xlim=(low, high))
    key = figure.add_subplot(grid[2, :])
    key.set_axis_off()
    key.legend(*phase.get_legend_handles_labels(), loc="center", ncols=3, fontsize=9)
    figure.suptitle(scene_title(file), fontsize=10)
    return figure


def draw_xt(file, args):
    if is_block(file) and not args.field:
        return draw_block(file, args)
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
    axes.set(xlabel="block, by its place x" if chain else "x", ylabel="t")
    axes.locator_params(axis="y", nbins=8)
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
    closed = options(file).get("bc_left", "") in ("", "periodic")
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
        axes.locator_params(axis="x", nbins=10)
        axes.margins(x=0)
        if len(panel) > 1:
            axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
        if panel is panels[0]:
            set_title(axes, scene_title(file))
    axes.set_xlabel("t")
    return figure


def draw_catalogue(file, args):
    from events import catalogue_figure
    return catalogue_figure([file.filename])


def overlay(files, args):
    """Several runs in one picture: the mean and the extremes of psi against time, or at one frame psi and eta against x
    (--profile) and against each other (--phase)."""
    names = told_apart(files)
    what = args.what or "series"
    if what not in ("series", "profile", "phase"):
        raise Unusable(f"is one of several: of them there is --series, --profile and --phase, not --{what}")
    if what == "phase":
        figure = Figure(figsize=(7.6, 5.2), layout="constrained")
        panels = [figure.subplots()]
        panels[0].set(xlabel="ψ", ylabel="η")
    else:
        figure = Figure(figsize=(8.4, 6.0), layout="constrained")
        panels = figure.subplots(3 if what == "series" else 2, sharex=True)
        panels[-1].set_xlabel("t" if what == "series" else "x")
    for k, (file, name) in enumerate(zip(files, names)):
        style = {"color": COLOURS[k % len(COLOURS)], "ls": "-" if k < len(COLOURS) else "--", "lw": 1.2, "label": name}
        if what == "series":
            group = file["series"]
            curves = ["psi_max", "psi_mean", "psi_min"]
            rows = min(len(group[one]) for one in ["t", *curves])
            data = [(group["t"][:rows], group[one][:rows]) for one in curves]
            titles = ["largest ψ", "mean ψ", "least ψ"]
        else:
            frame = chosen_frame(complete_frames(file), args.frame)
            x, psi, eta = file["x"][...], file["psi"][frame], file["eta"][frame]
            data = [(psi, eta)] if what == "phase" else [(x, psi), (x, eta)]
            titles = ["η"] if what == "phase" else ["ψ", "η"]
        for axes, (across, up), title in zip(panels, data, titles):
            axes.plot(across, up, **style)
            axes.set_ylabel(title)
            axes.margins(x=0.02 if what == "phase" else 0)
    legend_beside(panels[0])
    set_title(panels[0], ("" if what == "series" else "the last frames: " if args.frame is None else
                          f"frame {args.frame}: ") + scene_title(files[0], differing(files)))
    return figure


def movie(file, args, output):
    """psi over x, and eta against psi, frame by frame, as GIF or MP4."""
    most_pictures = 120  # eight seconds
    from matplotlib import animation
    count = complete_frames(file)
    t, x = file["t"][:count], file["x"][...]
    chosen = np.unique(np.linspace(0, count - 1, min(count, most_pictures)).astype(int))
    psi, eta = (np.stack([file[name][k] for k in chosen]) for name in ("psi", "eta"))
    figure = Figure(figsize=(9.6, 4.4), layout="constrained", dpi=100)
    left, right = figure.subplots(1, 2, width_ratios=[1.5, 1])
    mark = "." if len(x) <= 100 else None
    profile, = left.plot(x, psi[0], color=COLOURS[0], marker=mark, lw=1.2)
    orbit, = right.plot(psi[0], eta[0], color=COLOURS[0], marker=mark or ".", ms=2.5, lw=0.8, zorder=3)
    for axes, across, up in ((left, x, psi), (right, psi, eta)):
        for values, limits in ((across, axes.set_xlim), (up, axes.set_ylim)):
            room = 0.06 * max(np.ptp(values), 1e-6) if values is not x else 0
            limits(values.min() - room, values.max() + room if len(x) > 1 or values is not x else values.max() + 1)
    draw_nullclines(right, file, *right.get_xlim())
    left.set(xlabel="x", ylabel="ψ")
    right.set(xlabel="ψ", ylabel="η")
    figure.suptitle(scene_title(file), fontsize=10)

    def show(k):
        profile.set_ydata(psi[k])
        orbit.set_data(psi[k], eta[k])
        left.set_title(f"t = {t[chosen[k]]:.4g}")
        return profile, orbit

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    FigureCanvasAgg(figure)
    figure.canvas.draw()
    figure.set_layout_engine("none")  # laid out once
    writer = animation.PillowWriter(fps=15)
    if output.endswith(".mp4"):
        if not animation.FFMpegWriter.isAvailable():
            raise Unusable("as MP4 needs ffmpeg, which is not installed; -o FILE.gif does without")
        writer = animation.FFMpegWriter(fps=15)
    animation.FuncAnimation(figure, show, frames=len(chosen)).save(output, writer=writer)


RUN_PICTURES = {"xt": draw_xt, "profile": draw_profile, "phase": draw_phase, "probes": draw_probes,
                "series": draw_series, "catalogue": draw_catalogue, "lyapunov": draw_lyapunov}


def draw_run(file, args):
    return RUN_PICTURES[args.what or ("catalogue" if "events" in file else "xt")](file, args)
