"""Pictures of a run."""
import textwrap

import h5py
import numpy as np
from matplotlib.colors import CenteredNorm

from figures_chaos import draw_lyapunov
from figures_portrait import Portrait, draw_loop, draw_nullclines, room
from stickslip import Unusable, differing, options, scene_title, text, told_apart
from style import BLUE, GREY, NAMES, REFERENCE, Picture, axis_name, course, name_axes, typeset


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
    """When psi passes v as it speeds up towards it, in the second half of the run, counted as for the summary's period:
    after it was short of v by a hundredth of it. Between rows by the polynomial through six of them, all from behind a
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


def is_chain(file):
    return text(file.attrs.get("model_form", "")) == "chain"


def place_name(file):
    return "block, by its place x" if is_chain(file) else "x"


def mark_velocity(picture, axes, file):
    """The plate's velocity, a level to compare psi with."""
    if "v" in file.attrs:
        axes.axhline(file.attrs["v"], **REFERENCE)
        axes.text(1.01, file.attrs["v"], typeset("v"), transform=axes.get_yaxis_transform(), va="center", color=GREY)


def draw_block(file, args):
    """One block, or a medium that moves as one: psi and eta against time, and the orbit in their plane."""
    count = complete_frames(file)
    t, psi, eta = file["t"][:count], file["psi"][:count, 0], file["eta"][:count, 0]
    if "series" in file and len(file["series/t"]) > count:  # a row for every step
        series = file["series"]
        rows = min(len(series[name]) for name in ("t", "psi_mean", "eta_mean"))
        t, psi, eta = (series[name][:rows] for name in ("t", "psi_mean", "eta_mean"))
    portrait = Portrait("t")
    portrait.draw_curves(t, psi, eta)
    mark_velocity(portrait.picture, portrait.curves["psi"], file)
    times = passages(t, psi, file.attrs["v"]) if "v" in file.attrs else []
    if len(times) < 2:
        draw_loop(portrait, (psi, eta), "from beginning to end")
    else:  # closed: from one passage to the next, both ends between rows
        begin, end = times[-2:]
        inside, before = (t > begin) & (t < end), t <= begin
        loop = [np.concatenate([[np.interp(begin, t, y)], y[inside], [np.interp(end, t, y)]]) for y in (psi, eta)]
        draw_loop(portrait, loop, f"last period, {(times[-1] - times[0]) / (len(times) - 1):.4g}", (psi[before], eta[before]))
    portrait.nullclines(file)
    portrait.picture.title(scene_title(file))
    return portrait.picture


def fill_xt(picture, axes, file, name):
    """A field over place and time, with its bar."""
    count = complete_frames(file)
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
    centre = float(file.attrs.get("v", 0)) if name == "psi" else 0.0
    settings, words = {"cmap": "viridis", "vmin": low, "vmax": high}, axis_name(name)
    if min(centre - low, high - centre) > 0.1 * (high - low):  # on both sides of it
        settings = {"cmap": "RdBu_r", "norm": CenteredNorm(centre, max(centre - low, high - centre))}
        words += f"; white: the plate's, v = {centre:g}" if name == "psi" else ""
    outside = (good < low).any(), (good > high).any()
    if len(rows) == 1:
        field, edges = np.repeat(field, 2, axis=0), np.array([t[0], t[0] + 1e-3])
    else:
        edges = t[rows]
    places = x[columns]
    if len(places) == 1:
        places, field = np.array([places[0], places[0] + 1]), np.repeat(field, 2, axis=1)
    drawn = axes.pcolormesh(places, edges, field, rasterized=True, **settings,  # blocks are shown as blocks
                            shading="nearest" if is_chain(file) or field.size > 4e5 else "gouraud")
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(outside, "neither")
    bar = picture.colorbar(drawn, ax=axes, label=typeset(words), extend=extend)
    bar.ax.set_ylim(low, high)
    name_axes(axes, place_name(file), "t")
    axes.locator_params(axis="y", nbins=8)


def draw_xt(file, args):
    if is_block(file) and not args.field:
        return draw_block(file, args)
    picture = Picture(4.6)
    fill_xt(picture, picture.subplots(), file, args.field or "psi")
    picture.title(scene_title(file))
    return picture


def draw_profile(file, args):
    frame = chosen_frame(complete_frames(file), args.frame)
    names, x = fields_of(file), file["x"][...]
    picture = Picture(1.0 + 1.5 * len(names))
    panels = np.atleast_1d(picture.subplots(len(names), sharex=True))
    for k, (name, axes) in enumerate(zip(names, panels)):
        axes.plot(x, file[name][frame], marker="." if len(x) <= 100 else None, **course(k))
        if name == "psi":
            mark_velocity(picture, axes, file)
        if name == "theta" and np.all(file[name][frame] > 0):
            axes.set_yscale("log")
        else:
            # no picture of rounding errors
            low, high = axes.get_ylim()
            least = 1e-6 * max(1e-30, float(np.abs(file[name][frame]).max()))
            if high - low < least:
                axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)
        name_axes(axes, y=name)
        axes.margins(x=0)
    name_axes(panels[-1], place_name(file))
    picture.align_ylabels(panels)
    picture.title(f"t = {file['t'][frame]:.6g}: {scene_title(file)}")
    return picture


def draw_phase(file, args):
    frame = chosen_frame(complete_frames(file), args.frame)
    psi, eta = file["psi"][frame], file["eta"][frame]
    picture = Picture(4.8)
    axes = picture.subplots()
    axes.set_xlim(room(psi, float(file.attrs.get("v", psi.mean()))))
    axes.set_ylim(room(eta, float(file.attrs.get("steady_eta", eta.mean()))))
    if options(file).get("bc_left", "") in ("", "periodic"):
        psi, eta = np.append(psi, psi[0]), np.append(eta, eta[0])
    chain = is_chain(file)  # neighbours need not be alike
    line, = axes.plot(psi, eta, "-", color=BLUE, lw=0.7 if chain else 1.1, alpha=0.35 if chain else 1, zorder=3,
                      marker="." if len(psi) <= 2000 else None, ms=3.5)
    if chain:
        axes.plot(psi, eta, ".", color=BLUE, ms=4, zorder=4)
    picture.label(axes, f"the {'blocks' if chain else 'nodes'}, in order of x", line)
    draw_nullclines(picture, axes, file)
    name_axes(axes, "psi", "eta")
    picture.title(f"t = {file['t'][frame]:.6g}: {scene_title(file)}")
    return picture


def draw_probes(file, args):
    if "probes" not in file:
        raise Unusable("has no probes (option out_probes)")
    group = file["probes"]
    count = min(len(group["t"]), group["psi"].shape[0], group["eta"].shape[0])
    if count == 0:
        raise Unusable("holds no row of its probes yet")
    t, x = group["t"][:count], group["x"][...]
    picture = Picture(4.8)
    panels = picture.subplots(2, sharex=True)
    for name, axes in zip(("psi", "eta"), panels):
        for k, position in enumerate(x[:12]):
            line, = axes.plot(t, group[name][:count, k], **course(k))
            if axes is panels[-1]:
                picture.label(axes, f"x = {position:g}", line)
        name_axes(axes, y=name)
        axes.margins(x=0)
    name_axes(panels[-1], "t")
    picture.align_ylabels(panels)
    picture.title(scene_title(file) + (f"; the first 12 of {len(x)} probes" if len(x) > 12 else ""))
    return picture


SHARES = {"mean": "mean", "min": "least", "max": "largest"}  # of the nodes, in names of series


def series_name(name):
    """Of a series, in words: psi_mean is the mean slip velocity."""
    base, _, share = name.rpartition("_")
    return f"{SHARES[share]} {axis_name(base)}" if share in SHARES and base in NAMES else \
        axis_name({"v": "model_v"}.get(name, name))


def draw_series(file, args):
    if "series" not in file:
        raise Unusable("has no series")
    group = file["series"]
    names = [k for k, v in group.items() if isinstance(v, h5py.Dataset) and v.ndim == 1 and k != "t"]
    together = [k for k in ("psi_min", "psi_mean", "psi_max") if k in names]
    columns = ([together] if together else []) + [[k] for k in names if k not in together]
    count = min([len(group["t"])] + [len(group[k]) for k in names])
    if not columns or count == 0:
        raise Unusable("holds no row of its series yet")
    t = group["t"][:count]
    picture = Picture(0.8 + 1.3 * len(columns))
    panels = np.atleast_1d(picture.subplots(len(columns), sharex=True))
    for column, axes in zip(columns, panels):
        for k, name in enumerate(column):
            line, = axes.plot(t, group[name][:count], **course(k))
            if column is together:
                picture.label(axes, SHARES[name[4:]], line)
        words = axis_name("psi") if column is together else series_name(column[0])
        axes.set_ylabel(typeset("\n".join(textwrap.wrap(words, 18))))
        axes.locator_params(axis="x", nbins=10)
        axes.margins(x=0)
    name_axes(panels[-1], "t")
    picture.align_ylabels(panels)
    picture.title(scene_title(file))
    return picture


def draw_catalogue(file, args):
    from events import catalogue_figure
    return catalogue_figure([file.filename])


def overlay(files, args):
    """Several runs in one picture: the mean and the extremes of psi against time, or at one frame psi and eta against x
    (--profile) and against each other (--phase)."""
    what = args.what or "series"
    if what not in ("series", "profile", "phase"):
        raise Unusable(f"is one of several: of them there is --series, --profile and --phase, not --{what}")
    picture = Picture(4.8)
    panels = np.atleast_1d(picture.subplots({"series": 3, "profile": 2, "phase": 1}[what], sharex=True))
    names = {"series": [series_name(one) for one in ("psi_max", "psi_mean", "psi_min")], "profile": ["psi", "eta"],
             "phase": ["eta"]}[what]
    for axes, name in zip(panels, names):
        name_axes(axes, y=name)
    name_axes(panels[-1], {"series": "t", "profile": place_name(files[0]), "phase": "psi"}[what])
    for k, (file, words) in enumerate(zip(files, told_apart(files))):
        if what == "series":
            group = file["series"]
            curves = ["psi_max", "psi_mean", "psi_min"]
            rows = min(len(group[one]) for one in ["t", *curves])
            data = [(group["t"][:rows], group[one][:rows]) for one in curves]
        else:
            frame = chosen_frame(complete_frames(file), args.frame)
            x, psi, eta = file["x"][...], file["psi"][frame], file["eta"][frame]
            data = [(psi, eta)] if what == "phase" else [(x, psi), (x, eta)]
        for axes, (across, up) in zip(panels, data):
            line, = axes.plot(across, up, **course(k))
            axes.margins(x=0.02 if what == "phase" else 0)
            if axes is panels[-1]:
                picture.label(axes, words, line)
    picture.align_ylabels(panels)
    picture.title(("" if what == "series" else "the last frames: " if args.frame is None else f"frame {args.frame}: ")
                  + scene_title(files[0], differing(files)))
    return picture


def movie(file, args, output):
    """psi over x, and eta against psi, frame by frame, as GIF or MP4."""
    most_pictures = 120  # eight seconds
    from matplotlib import animation
    count = complete_frames(file)
    t, x = file["t"][:count], file["x"][...]
    chosen = np.unique(np.linspace(0, count - 1, min(count, most_pictures)).astype(int))
    psi, eta = (np.stack([file[name][k] for k in chosen]) for name in ("psi", "eta"))
    figure = Picture(3.4)
    left, right = figure.subplots(1, 2, width_ratios=[1.5, 1])
    mark = "." if len(x) <= 100 else None
    profile, = left.plot(x, psi[0], color=BLUE, marker=mark, lw=1.2)
    orbit, = right.plot(psi[0], eta[0], color=BLUE, marker=mark or ".", ms=2.5, lw=0.8, zorder=3)
    for axes, across, up in ((left, x, psi), (right, psi, eta)):
        for values, limits in ((across, axes.set_xlim), (up, axes.set_ylim)):
            more = 0.06 * max(np.ptp(values), 1e-6) if values is not x else 0
            limits(values.min() - more, values.max() + more if len(x) > 1 or values is not x else values.max() + 1)
    draw_nullclines(figure, right, file)
    name_axes(left, place_name(file), "psi")
    name_axes(right, "psi", "eta")
    figure.title(scene_title(file))

    def show(k):
        profile.set_ydata(psi[k])
        orbit.set_data(psi[k], eta[k])
        left.set_title(typeset(f"t = {t[chosen[k]]:.4g}"))
        return profile, orbit

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    FigureCanvasAgg(figure)
    show(0)
    figure.canvas.draw()
    figure.placing.finish()
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
