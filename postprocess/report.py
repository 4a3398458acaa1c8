#!/usr/bin/python3
"""One page about a scene, from the commands that each of its parts is named after.

    report.py SCENE.yaml [-o report.pdf] [--seconds 60] [-- OPTIONS]

The friction curve with the point of steady sliding (laws); whether sliding is stable there, how fast perturbations grow and with
which frequency (spectrum); the motion from the scene's start (run); the oscillation and its amplitude over the velocity of
the plate (cycle); where sliding and stick-slip end over that velocity, and so what coexists (boundary); the map of velocity
against damping or stiffness with the scene's point in it (boundary in two options); for catalogues of events their statistics.
The numbers stand in a JSON file beside the page. What does not apply to the scene, or takes longer than --seconds, is named
with the reason. OPTIONS are added to every command, as they are typed.
"""
import argparse
import json
import os
import re
import sys
import tempfile

import stickslip  # first: it says which Python to take

import h5py
import numpy as np

import style
from catalogue import WIDTH, draw_density, magnitudes, read, statistics
from events import draw_regions
from figures_run import fill_xt, is_block
from style import BLACK, BLUE, GREY, RED, REFERENCE, Picture, draw_branch, logarithmic, name_axes, stability_words

WORDS = {"sliding": ("sliding gains or loses its stability at", "sliding keeps its stability"),
         "stick-slip": ("stick-slip ends at", "stick-slip does not end")}
RANGE = 5.  # the velocity is varied down and up by this factor


class Scene:
    """A scene to which commands are put; keeps why one gave no answer."""

    def __init__(self, path, more, seconds, folder):
        self.path, self.more, self.seconds, self.folder = path, more, seconds, folder
        self.refused = {}
        self.options = {}  # of the commands that gave an answer: the defaults, too

    @property
    def attrs(self):
        """As an open file has them."""
        return {"options": json.dumps(self.options), "option_units": json.dumps(style.UNITS)}

    def ask(self, part, command, **settings):
        """The summary of a command and its file, or two times None; `part` says for what it was."""
        file = os.path.join(self.folder, part.replace(" ", "-") + ".h5")
        settings = {name: value for name, value in settings.items() if "-" + name not in self.more}  # the user's own hold
        print(f"report.py: {part} ...", file=sys.stderr)
        try:
            summary = stickslip.run(command, self.path, *self.more, out_file=file, timeout=self.seconds, **settings)
        except stickslip.Failed as error:
            self.refused[part] = str(error)
            return None, None
        self.options |= summary["options"]
        if os.path.exists(file):
            with h5py.File(file) as results:
                style.take_names(results)
        return summary, file

    def value(self, name):
        return float(self.options[name])


def numbers(summary, *names):
    return {name: summary.get(name) for name in names}


# ---- what is asked -----------------------------------------------------------------------------------------------------

def sliding(scene, found):
    summary, _ = scene.ask("sliding", "spectrum")
    if summary:
        found["sliding"] = numbers(summary, "stable", "growth_rate", "growth_rate_error", "frequency", "steady")


def motion(scene, found):
    summary, file = scene.ask("motion", "run")
    if summary:
        found["motion"] = numbers(summary, "regime", "regime_reason", "t_end", "period", "amplitude", "psi_low", "psi_high",
                                  "rest_fraction", "wave_speed")
    return file


def oscillation(scene, found):
    """The cycle, followed along the velocity of the plate to either side where it can be."""
    v = scene.value("model_v")
    summary, file = scene.ask("oscillation", "cycle")
    if not summary:
        return None
    stable = summary["stable"] if summary["stable"] is not None else summary["stable_alike"]
    found["oscillation"] = {**numbers(summary, "period", "amplitude", "psi_min", "psi_max", "rest_fraction", "force_drop", "displacement",
                                      "acceleration", "error_estimate"), "frequency": 1 / summary["period"], "stable": stable,
                            "alike": scene.options["cycle_cell"] == "1" != scene.options["grid_n"]}
    branch = []
    for part, to in (("amplitude upwards", RANGE * v), ("amplitude downwards", v / RANGE)):
        along, _ = scene.ask(part, "cycle", cycle_continue="model_v", cycle_to=to)
        if along:
            points = along["branch"]["points"]
            branch += points if part.endswith("upwards") else points[::-1]
    found["amplitude"] = sorted(branch, key=lambda point: point["value"])
    return file


def ends(scene, found):
    v = scene.value("model_v")
    low, high = sorted((v / RANGE, v * RANGE))
    summary, of = both(scene, "end", boundary_parameter="model_v", boundary_from=low, boundary_to=high,
                       boundary_parameter2="none", boundary_from2="none", boundary_to2="none")
    if summary:
        found["ends"] = {"parameter": "model_v", "from": scene.value("boundary_from"), "to": scene.value("boundary_to"), "of": of,
                         "points": [numbers(point, "value", "of", "kind", "frequency") for point in summary["points"]]}


def both(scene, part, **settings):
    """What boundary says of sliding and stick-slip, or of sliding alone, and of which it is."""
    summary, _ = scene.ask(part + " of stick-slip", "boundary", boundary_of="both", **settings)
    if summary:
        return summary, ["sliding", "stick-slip"]
    summary, _ = scene.ask(part + " of sliding", "boundary", boundary_of="sliding", **settings)
    if not summary:  # said once
        del scene.refused[part + " of stick-slip"]
        scene.refused[part] = scene.refused.pop(part + " of sliding")
    return summary, ["sliding"]


def across(options):
    """The second option of the map, the damping where there is one, else the stiffness, and its value; None where neither is."""
    damping = {"continuum": "model_delta", "chain": "model_zeta"}[options["model_form"]]
    stiffness = {"continuum": "model_gamma", "chain": "model_k0"}[options["model_form"]]
    for name in (damping, stiffness):
        value = options.get(name, "0")
        if value != "paper" and float(value or 0) > 0 and options.get(name + "_profile", "none") in ("", "none"):
            return name, float(value)
    return None, None


def chart(scene, found):
    v, (name, value) = scene.value("model_v"), across(scene.options)
    if name is None:
        scene.refused["map"] = "neither damping nor stiffness is one number above 0"
        return
    summary, _ = both(scene, "map", boundary_parameter="model_v", boundary_from=min(v / RANGE, v * RANGE),
                      boundary_to=max(v / RANGE, v * RANGE), boundary_parameter2=name, boundary_from2=value / RANGE,
                      boundary_to2=value * RANGE)
    if summary:
        found["map"] = {"parameters": ["model_v", name], "at": [v, value],
                        "points": [numbers(point, "value", "value2", "of", "kind", "piece") for point in summary["points"]]}


def events(scene, file, found):
    """The catalogue of the motion, where it has one."""
    with h5py.File(file) as run:
        if "events" not in run:
            return None
    try:
        run = read(file, 0)
        row = statistics([run])
    except stickslip.Unusable as error:
        scene.refused["catalogue"] = str(error)
        return None
    found["catalogue"] = numbers(row, "events", "b", "b_interval", "p", "fit", "in_fit", "largest_extent")
    return run


# ---- the page ------------------------------------------------------------------------------------------------------------

def measured(value, name, digits=4):
    """A number with its unit, where the scene has units: of a dataset or an option by name, else of what changes in time."""
    time, of = style.UNITS.get("t"), style.UNITS.get(name, "")
    if time and name in ("displacement", "acceleration"):
        of = style.UNITS.get("friction_D", "") + (f"/{time}^2" if name == "acceleration" else "")
    if time and name in ("rate", "angular", "frequency"):
        of = "Hz" if (name, time) == ("frequency", "s") else ("rad/" if name == "angular" else "1/") + time
    return f"{value:.{digits}g} {of}".rstrip().replace("^2", "²")


def listed(words):
    """"a, b and c"; of many the first and the last."""
    words = words if len(words) < 8 else [words[0], "...", words[-1]]
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1]))) if words else ""


def shown(name):
    """An option in a sentence: by its label, else its words and symbol."""
    label = style.NAMES.get(name, name)
    return label if style.SYMBOLS.get(name) == "" else style.axis_name(name).split(" (")[0]


def without_effect(chart_found):
    """Of a map: for which of sliding and stick-slip its second option does not matter, and that option."""
    if chart_found:
        for of in ("sliding", "stick-slip"):
            own = np.array([(point["value"], point["value2"]) for point in chart_found["points"] if point["of"] == of])
            if len(own) > 2 and np.ptp(own[:, 1]) > 0 and np.ptp(own[:, 0]) < 1e-5 * np.abs(own[:, 0]).max():
                yield of, chart_found["parameters"][1]


def sentences(found):
    """What was found, a line each."""
    if "sliding" in found:
        one = found["sliding"]
        turn = f", angular frequency {measured(one['frequency'], 'angular')}" if one.get("frequency") else ""
        state = {True: "stable", False: "unstable", None: "of unknown stability"}[one["stable"]]
        rate = "unknown" if one["growth_rate"] is None else measured(one["growth_rate"], "rate")
        yield f"Steady sliding is {state}: growth rate {rate}{turn}."
    if "motion" in found:
        one = found["motion"]
        parts = [f"{words} {measured(one[name], of)}" for name, words, of in (
            ("amplitude", "amplitude", "psi"), ("period", "period", "t"), ("wave_speed", "wave speed", "model_c")) if one[name]]
        yield f"From its start, up to t = {measured(one['t_end'], 't')}: {', '.join([one['regime'] or 'undecided', *parts])}."
    if "oscillation" in found:
        one = found["oscillation"]
        kind = {True: "stable", False: "unstable", None: "of unknown stability"}[one["stable"]]
        rest = f", at rest {one['rest_fraction']:.3%} of the time" if one["rest_fraction"] else ""
        reach = f"; displacement {measured(one['displacement'], 'displacement')} to either side, acceleration up to " \
                f"{measured(one['acceleration'], 'acceleration')}" if style.UNITS.get("psi") else ""
        alike = " of all nodes alike" if one["alike"] else ""
        yield f"The oscillation{alike} is {kind}: period {measured(one['period'], 't', 6)}, frequency " \
              f"{measured(one['frequency'], 'frequency')}, psi from {one['psi_min']:.4g} to {measured(one['psi_max'], 'psi')}{rest}{reach}."
    if "ends" in found:
        one, changes = found["ends"], []
        for of in one["of"]:
            points = sorted((point for point in one["points"] if point["of"] == of), key=lambda point: point["value"])
            at = [f"{measured(point['value'], 'model_v', 5)} ({point['kind']})" for point in points]
            changes.append(f"{WORDS[of][not at]} {listed(at)}".rstrip())
        yield f"Over {shown('model_v')} from {one['from']:.3g} to {measured(one['to'], 'model_v', 3)} {', '.join(changes)}."
    for of, name in without_effect(found.get("map")):
        what = "where stick-slip ends" if of == "stick-slip" else "where sliding changes its stability"
        yield f"{shown(name)[0].upper()}{shown(name)[1:]} does not matter for {what}."
    if "catalogue" in found:
        one = found["catalogue"]
        b = f", b = {one['b']:.3f} ({one['b_interval'][0]:.3f} to {one['b_interval'][1]:.3f})" if np.isfinite(one["b"]) else ""
        yield f"{one['events']} events{b}; the largest reached over {one['largest_extent']:g}."
    reasons = {}  # said once of all parts that have the same; what stands behind is how it was found
    for part, why in found["refused"].items():
        reasons.setdefault(re.sub(r"the command \w+ takes", "these take", why.split("; ")[0]), []).append(part)
    for why, parts in reasons.items():
        why = re.sub(r"\d\.\d{5,}|\d+\.\d{4,}", lambda number: f"{float(number[0]):.4g}", why)
        if why.startswith("no boundary"):  # an answer
            yield f"{listed(parts).capitalize()}: {why}."
        else:
            yield f"No {listed(parts)}: {why}."


def draw_friction(axes, scene, picture):
    """The scene's law, with the point of sliding on it."""
    with h5py.File(scene.laws) as laws:
        psi, force = laws["psi"][...], laws[scene.options["friction_law"]][...]
    for side in (psi < 0, psi > 0):
        axes.plot(psi[side], force[side], color=BLUE)
    v = scene.value("model_v")
    axes.plot(v, np.interp(v, psi, force), "o", color=RED)
    picture.label(axes, "sliding", [v], [np.interp(v, psi, force)], RED)
    axes.axvline(v, **REFERENCE)
    name_axes(axes, "psi", "F")


def draw_course(axes, series, period, picture):
    t, top, mean = (series[name][...] for name in ("t", "psi_max", "psi_mean"))
    if np.array_equal(top, mean):  # of one block they are one
        axes.plot(t, mean, color=BLUE, lw=0.9)
    else:
        picture.label(axes, "largest", *axes.plot(t, top, color=RED, lw=0.9))
        picture.label(axes, "mean", *axes.plot(t, mean, color=BLUE, lw=0.9))
    if period:  # the last of them
        axes.set_xlim(max(t[0], t[-1] - 6 * period), t[-1])
    name_axes(axes, "t", "psi")


def motion_panels(file, catalogue):
    """How many panels draw_motion takes."""
    with h5py.File(file) as run:
        return int("series" in run and len(run["series/t"]) > 0) + (2 if catalogue else 0 if is_block(run) else 1)


def draw_motion(place, file, catalogue, period, picture):
    """The course in time, and where nodes move differently the picture over place and time, or that of the events."""
    with h5py.File(file) as run:
        if "series" in run and len(run["series/t"]):
            draw_course(place(), run["series"], period, picture)
        if catalogue:
            draw_regions(picture, place(), catalogue, "lnM")
            draw_sizes(place(), catalogue)
        elif not is_block(run):
            fill_xt(picture, place(), run, "psi")


def draw_loop(axes, file):
    with h5py.File(file) as cycle:
        axes.plot(cycle["psi"][:, 0], cycle["eta"][:, 0], color=BLUE)
    name_axes(axes, "psi", "eta")


def draw_amplitude(axes, points, v):
    value, top, stable = (np.array([point[name] if point[name] is not None else np.nan for point in points], float)
                          for name in ("value", "psi_max", "stable"))
    draw_branch(axes, value, top, stable, color=BLUE)
    axes.axvline(v, **REFERENCE)
    title = stability_words(stable)
    if title:
        axes.set_title(title, color=GREY)
    name_axes(axes, "model_v", style.with_unit("largest ψ of the oscillation", "psi"))


def draw_map(axes, chart_found, picture):
    points = chart_found["points"]
    for of, colour in (("sliding", BLUE), ("stick-slip", RED)):
        own = [point for point in points if point["of"] == of]
        for piece in sorted({point["piece"] for point in own}):
            line, = axes.plot(*np.array([[point["value"], point["value2"]] for point in own if point["piece"] == piece]).T,
                              color=colour)
            if piece == own[0]["piece"]:
                picture.label(axes, of, line)
    axes.plot(*chart_found["at"], "o", color=BLACK)
    picture.label(axes, "the scene", *([value] for value in chart_found["at"]), BLACK)
    v, other = chart_found["at"]
    axes.set(xlim=sorted((v / RANGE, v * RANGE)), ylim=(other / RANGE, other * RANGE))
    if v > 0:
        logarithmic(axes, "x")
    logarithmic(axes, "y")
    name_axes(axes, *chart_found["parameters"])
    axes.set_title("where sliding changes its stability, stick-slip ends", color=GREY)


def draw_sizes(axes, run):
    draw_density(axes, [magnitudes(run)], run["way"] * WIDTH, BLUE)
    axes.set_yscale("log")
    name_axes(axes, "magnitude ln M", "events per displacement and magnitude")


def page(path, more=(), seconds=60.):
    """The picture and the numbers of a scene; no picture where no command gives an answer."""
    with tempfile.TemporaryDirectory() as folder:
        scene, found = Scene(path, list(more), seconds, folder), {"scene": path}
        found["refused"] = scene.refused
        sliding(scene, found)
        course = motion(scene, found)
        if not scene.options:  # nothing but what a check of the scene knows
            scene.seconds = max(seconds, 20)
            scene.ask("check", "run", check=True)
            scene.seconds = seconds
            if not scene.options:
                return None, found
        cycle = oscillation(scene, found)
        ends(scene, found)
        chart(scene, found)
        catalogue = course and events(scene, course, found)
        _, scene.laws = scene.ask("friction", "laws")

        draw = []  # of each panel, or of what takes several: how many, and what is given where the next one stands
        if scene.laws:
            draw.append((1, lambda place: draw_friction(place(), scene, picture)))
        if course:
            panels = motion_panels(course, catalogue)
            draw.append((panels, lambda place: draw_motion(place, course, catalogue, found["motion"]["period"], picture)))
        if cycle:
            draw.append((1, lambda place: draw_loop(place(), cycle)))
        if found.get("amplitude"):
            draw.append((1, lambda place: draw_amplitude(place(), found["amplitude"], scene.value("model_v"))))
        if found.get("map", {}).get("points"):
            draw.append((1, lambda place: draw_map(place(), found["map"], picture)))
        panels = sum(count for count, _ in draw)
        rows, columns = (panels + 1) // 2, min(panels, 2)
        picture = Picture(1.2 + 2.5 * rows)
        grid = picture.add_gridspec(max(rows, 1), max(columns, 1))
        cells = [grid[divmod(k, 2)] for k in range(panels)]
        if panels % 2 == 1:  # the last one is as wide as the page
            cells[-1] = grid[rows - 1, :]
        places = (picture.add_subplot(cell) for cell in cells)
        for _, one in draw:
            one(lambda: next(places))
        words = [f"{os.path.basename(path)}: {stickslip.scene_title(scene)}", *sentences(found)]
        picture.title("\n".join(words), x=0.01, ha="left")
    return picture, found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("-o", "--output", default="report.pdf")
    parser.add_argument("--seconds", type=float, default=60., help="for each command (60)")
    given = sys.argv[1:]
    end = given.index("--") if "--" in given else len(given)
    arguments = parser.parse_args(given[:end])
    picture, found = page(arguments.scene, given[end + 1:], arguments.seconds)
    if picture is None:
        sys.exit(f"report.py: error: {next(iter(found['refused'].values()))}")
    table = os.path.splitext(arguments.output)[0] + ".json"
    with open(table, "w", encoding="utf-8") as file:
        json.dump(found, file, indent=1)
    picture.savefig(arguments.output)
    print("\n".join(sentences(found)), arguments.output, table, sep="\n")


if __name__ == "__main__":
    main()
