"""Pictures of sweeps: maps of regimes over two options, diagrams over one, joined with boundaries and branches of cycles."""
import numpy as np
from matplotlib.colors import ListedColormap

from figures_cycle import mark_specials
from stickslip import Unusable, options, scene_title, text
from style import (BLACK, BLUE, BOTH, COLOURS, RED, SLIDES, STICKS, Picture, axis_name, draw_branch, logarithmic, name_axes,
                   stability_words, typeset)

KINDS = {"sliding": SLIDES, "stable": SLIDES, "stuck": "#c4c4c4", "decaying": "#cfe6da", "growing": "#f3d3a6", "stick-slip": STICKS,
         "unstable": STICKS, "waves": "#b7d8b0", "chaos": "#ebdff3", "bistable": BOTH, "up and down differ": "#fdf8e4",
         "undecided": "#efefef", "other": "#ded3ea", "failed": "#777777", "not computed": "#ffffff"}
ENDS = {"": "sliding loses stability", "sliding": "sliding loses stability", "stick-slip": "stick-slip ends"}


# ---- what stands in the file ----------------------------------------------------------------------------------------

def axes_of(file):
    """The options varied, in their order."""
    settings = options(file)
    names = [settings.get(f"sweep_parameter{k}", "").split(",")[0].strip().lower() for k in range(1, 5)]
    return [name for name in names if name]


def is_grid(file):
    return "point" not in file


def values_of(file, name):
    """The values of an option as numbers (words are counted), and the words."""
    data = file[name][...]
    if data.dtype.kind == "f":
        return data, None
    words = [text(value) for value in data]
    places = sorted(set(words), key=words.index)
    return np.array([places.index(word) for word in words], float), places


def column(file, name, missing=np.nan):
    return file[name][...] if name in file else np.full(file["number"].shape, missing)


def words_in(file, name):
    if name not in file:
        return np.full(file["number"].shape, "", object)
    data = file[name][...]
    if data.dtype.kind == "f":
        stable = {1: "stable", 0: "unstable"} if name == "stable" else {}
        return np.vectorize(lambda x: "" if np.isnan(x) else stable.get(x, f"{x:g}"), otypes=[object])(data)
    return np.vectorize(text, otypes=[object])(data)


def kinds_of(file):
    """What each point is, as a word of KINDS. Waves are stick-slip with pulses on the way, chaos what has a first Lyapunov
    exponent above three of its errors."""
    status = words_in(file, "status")
    kinds = words_in(file, text(file.attrs["key"]))
    pulses, speed = column(file, "pulses"), column(file, "wave_speed")
    kinds[(kinds == "stick-slip") & (pulses > 0) & np.isfinite(speed)] = "waves"
    kinds[column(file, "lyapunov_largest") > 3 * column(file, "lyapunov_largest_error")] = "chaos"
    kinds[status == "failed"] = "failed"
    kinds[status == ""] = "not computed"
    kinds[~np.isin(kinds, list(KINDS))] = "other"
    return kinds


def both_ways(kinds):
    """Up and down in one: `bistable` where one ends in sliding, or decays to it, and the other in an oscillation. What grows
    has left sliding, so that it does not differ from an oscillation."""
    def one(up, down):
        pair = {up, down}
        if len(pair) == 1 or "not computed" in pair:
            return up if len(pair) == 1 else "not computed"
        oscillates, slides = pair & {"stick-slip", "waves", "chaos"}, pair & {"sliding", "decaying"}
        if oscillates and slides:
            return "bistable"
        if oscillates and "growing" in pair:
            return oscillates.pop()
        return "sliding" if pair == {"sliding", "decaying"} else "up and down differ"
    return np.vectorize(one, otypes=[object])(kinds[..., 0], kinds[..., 1])


# ---- boundaries drawn over ------------------------------------------------------------------------------------------

def draw_boundaries(picture, axes, files, names):
    """The curves, or in one option the points, of files of `boundary`, each labelled by whose end it is."""
    for k, file in enumerate(files):
        given = [text(file.attrs["parameter"])] + ([text(file.attrs["parameter2"])] if "parameter2" in file.attrs else [])
        if sorted(given) != sorted(names):
            raise Unusable("has a boundary drawn over it that varies other options: " + ", ".join(given))
        value = file["value"][...]
        of = words_in_list(file, "of", len(value))
        for which in dict.fromkeys(of):
            mine = of == which
            style = {"color": BLACK if k == 0 else COLOURS[k], "lw": 0.9 if which == "stick-slip" else 1.8}
            words, lines = ENDS.get(which, f"{which} end"), []
            if len(names) == 1:
                lines = [axes.axvline(at, **style) for at in value[mine]]
                words += f": {value[mine][0]:.5g}" if len(lines) == 1 else ""
            else:
                value2, piece = file["value2"][...], file["piece"][...]
                x, y = (value, value2) if given[0] == names[0] else (value2, value)
                for number in np.unique(piece[mine]):
                    lines += axes.plot(x[mine & (piece == number)], y[mine & (piece == number)], **style)
            picture.label(axes, words, lines[0])


def words_in_list(file, name, count):
    return np.array([text(one) for one in file[name][...]] if name in file else [""] * count, object)


# ---- maps -----------------------------------------------------------------------------------------------------------

def edges(values, log):
    """Borders of cells about the values."""
    at = np.log(values) if log else np.asarray(values, float)
    if len(at) == 1:
        middle, ends = np.array([]), [at[0] - 0.5, at[0] + 0.5]
    else:
        middle = (at[1:] + at[:-1]) / 2
        ends = [2 * at[0] - middle[0], 2 * at[-1] - middle[-1]]
    all_edges = np.concatenate([[ends[0]], middle, [ends[1]]])
    return np.exp(all_edges) if log else all_edges


def on_a_grid(x, y, kinds, logs):
    """Scattered points as a picture: each pixel is what the nearest point is."""
    scaled = [np.log(v) if log else v for v, log in zip((x, y), logs)]
    spans = [max(np.ptp(v), 1e-300) for v in scaled]
    from scipy.spatial import cKDTree
    tree = cKDTree(np.column_stack([v / s for v, s in zip(scaled, spans)]))
    across, up = (np.linspace(v.min(), v.max(), 401) for v in scaled)
    mesh = np.meshgrid(across / spans[0], up / spans[1])
    nearest = tree.query(np.column_stack([m.ravel() for m in mesh]))[1].reshape(mesh[0].shape)
    across, up = (np.exp(v) if log else v for v, log in zip((across, up), logs))
    return across, up, kinds[nearest].T


def scale_axes(axes, names, words, logs):
    """Names and scales of the axes of the options; words stand as ticks."""
    name_axes(axes, *(axis_name(name) for name in names))
    for which, ticks, log in zip("xy", words, logs):
        if ticks:
            getattr(axes, f"set_{which}ticks")(range(len(ticks)), ticks)
        elif log:
            logarithmic(axes, which)


def logs_of(file):
    settings = options(file)
    return [settings.get(f"sweep_log{k}", "false") == "true" for k in (1, 2)]


def name_kinds(picture, axes, kinds, kind_at):
    """Each kind that there is, in place."""
    for kind in KINDS:
        if (kinds == kind).any():
            picture.label_region(axes, kind, lambda x, y, kind=kind: kind_at(x, y) == kind)


def cell(borders, at):
    """Which cell each place lies in; the nearest one outside."""
    return np.clip(np.searchsorted(borders, at) - 1, 0, len(borders) - 2)


def draw_map(file, args, over, names):
    logs, kinds = logs_of(file), kinds_of(file)
    (x, x_words), (y, y_words) = (values_of(file, name) for name in names)
    scattered = None
    if is_grid(file):
        if "direction" in file:
            kinds = both_ways(kinds)
    else:
        scattered = (x, y)
        x, y, kinds = on_a_grid(x, y, kinds, logs)
    order = [np.argsort(values) for values in (x, y)]
    x, y, kinds = x[order[0]], y[order[1]], kinds[np.ix_(*order)]
    picture = Picture(4.6)
    axes = picture.subplots()
    borders = edges(x, logs[0]), edges(y, logs[1])
    if args.key:
        draw_field(picture, axes, file, args.key, borders, order)
    else:
        numbers = np.vectorize(list(KINDS).index)(kinds)
        axes.pcolormesh(*borders, numbers.T, cmap=ListedColormap(list(KINDS.values())), vmin=-0.5, vmax=len(KINDS) - 0.5,
                        rasterized=True)
    if scattered:
        axes.scatter(*scattered, s=1.5, color=BLACK, alpha=0.4, lw=0)
    limits = axes.get_xlim(), axes.get_ylim()
    draw_boundaries(picture, axes, over, names)
    axes.set(xlim=limits[0], ylim=limits[1])
    scale_axes(axes, names, (x_words, y_words), logs)
    if not args.key:
        name_kinds(picture, axes, kinds, lambda a, b: kinds[cell(borders[0], a), cell(borders[1], b)])
    picture.title(scene_title(file, names))
    return picture


def draw_field(picture, axes, file, key, borders, order):
    """A number of the summaries in colours, upwards where there are two directions."""
    if key not in file or file[key].dtype.kind != "f" or not is_grid(file) or file[key].ndim != file["number"].ndim:
        raise Unusable(f"has no number '{key}' on a grid")
    values = file[key][...]
    if "direction" in file:
        values = values[..., 0]
    drawn = axes.pcolormesh(*borders, values[np.ix_(*order)].T, cmap="viridis", rasterized=True)
    picture.colorbar(drawn, ax=axes, label=typeset(axis_name(key)))


# ---- diagrams over one option ---------------------------------------------------------------------------------------

def bands(picture, axes, x, kinds, log):
    """What each value is as the colour behind it."""
    order = np.argsort(x)
    kinds, borders = kinds[order], edges(x[order], log)
    begin = 0
    for k in range(1, len(kinds) + 1):
        if k == len(kinds) or kinds[k] != kinds[begin]:
            axes.axvspan(borders[begin], borders[k], color=KINDS[kinds[begin]], lw=0, zorder=0)
            begin = k
    name_kinds(picture, axes, kinds, lambda a, _: kinds[cell(borders, a)])


def draw_values(picture, axes, file, key, x, words):
    """A number, or all of a list, above each value; upwards and downwards where there are two directions."""
    values = file[key][...]
    direction = "direction" in file
    is_list = values.ndim > file["number"].ndim
    for way in range(2 if direction else 1):
        here = values[:, way] if direction else values
        where = np.broadcast_to(x[:, None], here.shape) if is_list else x
        # single points of a list show what repeats; of a number the course
        style = {"marker": ".^v"[way + 1 if direction else 0], "ms": (1.6 if here.size < 2e4 else 0.9) if is_list and not direction else 3,
                 "ls": "none" if is_list else "-", "lw": 0.8, "color": (BLUE, RED)[way]}
        order = np.argsort(x) if not is_list else slice(None)
        line, = axes.plot(where[order].ravel(), here[order].ravel(), **style)
        if direction:
            picture.label(axes, f"{words}, {('up', 'down')[way]}", line)


def draw_cycles(picture, axes, files, name, key):
    """Branches of cycles over the same option, solid where stable, with their special points."""
    stable = []
    for file in files:
        if "branch" not in file or text(file.attrs["branch_parameter"]) != name:
            raise Unusable(f"has a cycle drawn over it that is not followed in {name} (cycle_continue)")
        key = "psi_max" if key == "maxima" else key
        if key not in file["branch"]:
            raise Unusable(f"shows {key}, which the branch of a cycle does not have")
        group = file["branch"]
        stable.append(group["stable"][...])
        line = draw_branch(axes, group["value"][...], group[key][...], stable[-1], color=BLACK, zorder=4)
        picture.label(axes, "cycle", line)
        mark_specials(picture, axes, file, key)
    return stability_words(np.concatenate(stable))


def draw_line(file, args, over, name):
    log, kinds = logs_of(file)[0], kinds_of(file)
    x, words = values_of(file, name)
    if is_grid(file) and "direction" in file:
        kinds = both_ways(kinds)
    by_kind = {kind: [one for one in over if text(one.attrs["kind"]) == kind] for kind in ("boundary", "cycle")}
    key = args.key
    if key and (key not in file or file[key].dtype.kind != "f"):
        raise Unusable(f"has no numbers '{key}'")
    if not key:
        key = "maxima" if "maxima" in file and np.isfinite(file["maxima"][...]).any() else \
            next((one for one in ("amplitude", "growth_rate", "period", "speed") if one in file), None)
    if key is None:
        raise Unusable("has none of the usual numbers; name one with --key")
    shown = {"maxima": "maxima of slip velocity ψ", "amplitude": "amplitude of slip velocity ψ"}.get(key, axis_name(key))
    picture = Picture(4.6)
    axes = picture.subplots()
    draw_values(picture, axes, file, key, x, key.replace("_", " "))
    limits = axes.get_xlim()
    draw_boundaries(picture, axes, by_kind["boundary"], [name])
    said = draw_cycles(picture, axes, by_kind["cycle"], name, key) if by_kind["cycle"] else ""
    axes.set_xlim(limits)
    if set(kinds) != {"undecided"}:  # as under any load that varies
        bands(picture, axes, x, kinds, log)
    axes.set_xlim(limits)
    scale_axes(axes, [name], [words], [log])
    name_axes(axes, y=shown)
    picture.title("\n".join(filter(None, (scene_title(file, [name]), said))))
    return picture


def draw_sweep(file, args, over=()):
    """A map over two options or a diagram over one, with boundaries over it; over a diagram branches of cycles, too."""
    names = axes_of(file)
    if len(names) == 1:
        return draw_line(file, args, over, names[0])
    if any(text(one.attrs["kind"]) == "cycle" for one in over):
        raise Unusable(f"varies {len(names)} options: a branch of cycles is drawn over a diagram of one")
    if len(names) == 2:
        return draw_map(file, args, over, names)
    raise Unusable(f"varies {len(names)} options; a picture has one or two (xarray: .sel of the others)")
