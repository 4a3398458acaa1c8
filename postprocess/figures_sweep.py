"""Pictures of sweeps: maps of regimes over two options, diagrams over one."""
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from figures import COLOURS, legend_beside, set_title
from stickslip import SYMBOL, Unusable, options, scene_title, shown_name, text

# In the order of the key of a picture.
KINDS = {"sliding": "#dce9f7", "stable": "#dce9f7", "stuck": "#b9b9b9", "decaying": "#c5dfd0", "growing": "#f6ddb5",
         "stick-slip": "#f2b8a8", "unstable": "#f2b8a8", "waves": "#a9c9a4", "chaos": "#8e44ad",
         "both live": "#f7e08a", "up and down differ": "#fdf3cf", "undecided": "#efefef", "other": "#d8cfe8", "failed": "#444444",
         "not computed": "#ffffff"}


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
    """Up and down in one: `both live` where one ends in sliding, or decays to it, and the other in an oscillation. What grows
    has left sliding, so that it does not differ from an oscillation."""
    def one(up, down):
        pair = {up, down}
        if len(pair) == 1 or "not computed" in pair:
            return up if len(pair) == 1 else "not computed"
        oscillates, slides = pair & {"stick-slip", "waves", "chaos"}, pair & {"sliding", "decaying"}
        if oscillates and slides:
            return "both live"
        if oscillates and "growing" in pair:
            return oscillates.pop()
        return "sliding" if pair == {"sliding", "decaying"} else "up and down differ"
    return np.vectorize(one, otypes=[object])(kinds[..., 0], kinds[..., 1])


# ---- boundaries drawn over ------------------------------------------------------------------------------------------

def draw_boundaries(axes, files, names):
    """The curves, or in one option the points, of files of `boundary`: those of sliding drawn through, those of stick-slip
    dashed."""
    for k, file in enumerate(files):
        given = [text(file.attrs["parameter"])] + ([text(file.attrs["parameter2"])] if "parameter2" in file.attrs else [])
        if sorted(given) != sorted(names):
            raise Unusable("has a boundary drawn over it that varies other options: " + ", ".join(given))
        value = file["value"][...]
        of = words_in_list(file, "of", len(value))
        for which in dict.fromkeys(of):
            mine = of == which
            style = {"color": "k" if k == 0 else COLOURS[k], "ls": "--" if which == "stick-slip" else "-", "lw": 1.6,
                     "label": f"boundary of {which or 'sliding'}"}
            if len(names) == 1:
                for at in value[mine]:
                    axes.axvline(at, **style)
                    style["label"] = None
                continue
            value2, piece = file["value2"][...], file["piece"][...]
            for number in np.unique(piece[mine]):
                chosen = mine & (piece == number)
                x, y = (value, value2) if given[0] == names[0] else (value2, value)
                axes.plot(x[chosen], y[chosen], **style)
                style["label"] = None


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


def scale_axis(axis_setter, label_setter, tick_setter, name, words, log):
    label_setter(shown_name(name))
    if words:
        tick_setter(range(len(words)), words)
    elif log:
        axis_setter("log")


def draw_map(file, args, over, names):
    settings = options(file)
    logs = [settings.get(f"sweep_log{k}", "false") == "true" for k in (1, 2)]
    kinds = kinds_of(file)
    (x, x_words), (y, y_words) = (values_of(file, name) for name in names)
    scattered = None
    if is_grid(file):
        if "direction" in file:
            kinds = both_ways(kinds)
    else:
        scattered = (x, y)
        x, y, kinds = on_a_grid(x, y, kinds, logs)
    figure = Figure(figsize=(7.8, 5.0), layout="constrained")
    axes = figure.subplots()
    if args.key:
        draw_field(figure, axes, file, args.key, x, y, logs)
    else:
        order = list(KINDS)
        numbers = np.vectorize(order.index)(kinds)
        axes.pcolormesh(edges(x, logs[0]), edges(y, logs[1]), numbers.T, cmap=ListedColormap(list(KINDS.values())), vmin=-0.5,
                        vmax=len(order) - 0.5, rasterized=True)
    if scattered:
        axes.plot(*scattered, ".", color="k", ms=1.5, alpha=0.5, label="runs")
    limits = axes.get_xlim(), axes.get_ylim()
    draw_boundaries(axes, over, names)
    axes.set(xlim=limits[0], ylim=limits[1])
    scale_axis(axes.set_xscale, axes.set_xlabel, axes.set_xticks, names[0], x_words, logs[0])
    scale_axis(axes.set_yscale, axes.set_ylabel, axes.set_yticks, names[1], y_words, logs[1])
    present = [] if args.key else [kind for kind in KINDS if (kinds == kind).any()]
    handles = [Patch(fc=KINDS[kind], ec="0.6", label=kind) for kind in present] + axes.get_legend_handles_labels()[0]
    if handles:
        axes.legend(handles=handles, fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))
    set_title(axes, scene_title(file, names))
    return figure


def draw_field(figure, axes, file, key, x, y, logs):
    """A number of the summaries in colours, upwards where there are two directions."""
    if key not in file or file[key].dtype.kind != "f" or not is_grid(file) or file[key].ndim != file["number"].ndim:
        raise Unusable(f"has no number '{key}' on a grid")
    values = file[key][...]
    if "direction" in file:
        values = values[..., 0]
    picture = axes.pcolormesh(edges(x, logs[0]), edges(y, logs[1]), values.T, cmap="viridis", rasterized=True)
    figure.colorbar(picture, ax=axes, label=SYMBOL.get(key, key.replace("_", " ")))


# ---- diagrams over one option ---------------------------------------------------------------------------------------

def bands(axes, x, kinds, log):
    """What each value is as the colour behind it."""
    order = np.argsort(x)
    x, kinds = x[order], kinds[order]
    border = edges(x, log)
    begin = 0
    for k in range(1, len(x) + 1):
        if k < len(x) and kinds[k] == kinds[begin]:
            continue
        axes.axvspan(border[begin], border[k], color=KINDS[kinds[begin]], lw=0, zorder=0)
        begin = k


def draw_values(axes, file, key, x, colour, label):
    """A number, or all of a list, above each value; upwards and downwards where there are two directions."""
    values = file[key][...]
    direction = "direction" in file
    is_list = values.ndim > file["number"].ndim
    for way in range(2 if direction else 1):
        here = values[:, way] if direction else values
        where = np.broadcast_to(x[:, None], here.shape) if is_list else x
        # single points of a list show what repeats; of a number the course
        style = {"marker": ".^v"[way + 1 if direction else 0], "ms": 1.6 if is_list and not direction else 3,
                 "ls": "none" if is_list else "-", "lw": 0.8, "color": colour if way == 0 else COLOURS[1]}
        name = label + ((", up", ", down")[way] if direction else "")
        order = np.argsort(x) if not is_list else slice(None)
        axes.plot(where[order].ravel(), here[order].ravel(), label=name, **style)


def draw_line(file, args, over, name):
    log = options(file).get("sweep_log1", "false") == "true"
    x, words = values_of(file, name)
    kinds = kinds_of(file)
    if is_grid(file) and "direction" in file:
        kinds = both_ways(kinds)
    figure = Figure(figsize=(7.8, 5.0), layout="constrained")
    axes = figure.subplots()
    bands(axes, x, kinds, log)
    if args.key:
        if args.key not in file or file[args.key].dtype.kind != "f":
            raise Unusable(f"has no numbers '{args.key}'")
        draw_values(axes, file, args.key, x, COLOURS[0], args.key.replace("_", " "))
        axes.set_ylabel(args.key.replace("_", " "))
    elif "maxima" in file and np.isfinite(file["maxima"][...]).any():
        draw_values(axes, file, "maxima", x, COLOURS[0], "maxima of ψ")
        axes.set_ylabel("maxima of ψ")
    else:
        shown = next((key for key in ("amplitude", "growth_rate", "period", "speed") if key in file), None)
        if shown is None:
            raise Unusable("has none of the usual numbers; name one with --key")
        draw_values(axes, file, shown, x, COLOURS[0], shown.replace("_", " "))
        axes.set_ylabel(shown.replace("_", " "))
    limits = axes.get_xlim()
    draw_boundaries(axes, over, [name])
    axes.set_xlim(limits)
    scale_axis(axes.set_xscale, axes.set_xlabel, axes.set_xticks, name, words, log)
    handles, labels = axes.get_legend_handles_labels()
    handles += [Patch(fc=KINDS[kind], ec="0.6", label=kind) for kind in KINDS if (kinds == kind).any()]
    legend_beside(axes, handles=handles, labels=labels + [kind for kind in KINDS if (kinds == kind).any()])
    set_title(axes, scene_title(file, [name]))
    return figure


def draw_sweep(file, args, over=()):
    """A map over two options or a diagram over one, with boundaries over it."""
    names = axes_of(file)
    if len(names) == 1:
        return draw_line(file, args, over, names[0])
    if len(names) == 2:
        return draw_map(file, args, over, names)
    raise Unusable(f"varies {len(names)} options; a picture has one or two (xarray: .sel of the others)")
