"""The mirror image of a scene (v, loads, held values, starts negated) has the mirror image of every result.

psi, eta, chi and what is made of them change sign, least and largest of them change places; states, energies, rates,
times and all that is said stays. A scene that forbids slip backwards (friction_back_slip false) has no mirror image:
its lower limit is -infinity, and no option makes that of the upper limit.
"""
import json
import os
import re
import time

import h5py
import numpy as np

from calls import call, data, tool

# Options that change sign; of those that name what is varied.
ODD = {"model_v", "bc_left_value", "bc_right_value", "init_psi", "init_eta", "init_amplitude",
       "load_sine_amplitude", "load_force_sine_amplitude"}
VARIED = {"boundary": "boundary_parameter", "sweep": "sweep_parameter1", "wave": "wave_continue",
          "cycle": "cycle_continue"}
# What is not a result: the command line, and what differs from one time to the next.
NO_RESULT = {"options", "wall_s", "seconds", "events_per_s", "files", "processor_s", "best"}
# Results that change sign; least and largest of psi change places too.
ODD_RESULTS = {"model_v", "psi", "eta", "psi_mean", "psi_loaded_mean", "eta_mean", "maxima", "chi", "steady_eta", "v",
               "direction", "height", "probes_psi", "probes_eta", "before", "behind", "z"}
ROUNDED = ("growth_rate", "wave_speed")  # of a matrix whose blocks have other signs; of a phase half a turn on
PAIRS = {"psi_min": "psi_max", "psi_max": "psi_min", "psi_low": "psi_high", "psi_high": "psi_low"}


def mirrored(options):
    """The options of the mirror image: a list of (name, value)."""
    def turned(name, value):
        if name in ODD and value != "steady":
            return -value
        if name == "load_v":
            return ",".join(f"{t}:{-float(v)!r}" for t, v in (pair.split(":") for pair in value.split(",")))
        if name == "friction_table":
            points = [tuple(map(float, pair.split(":"))) for pair in value.split(",")]
            if points[0][0] >= 0:  # odd
                return value
            return ",".join(f"{-x!r}:{-y!r}" if x else f"0:{y!r}" for x, y in reversed(points))
        if name == "init_file":
            columns = np.loadtxt(value, ndmin=2)
            columns[:, 1:4 if bristles(options) else 3] *= -1
            np.savetxt("mirrored.txt", columns, fmt="%.17g")
            return "mirrored.txt"
        for ranged in ("boundary_from", "boundary_to", "sweep_from1", "sweep_to1", "wave_to", "cycle_to"):
            if name == ranged and varied(options, ranged) in ODD:
                return -value
        return value
    return {name: turned(name, value) for name, value in options.items()}


def bristles(options):
    """Laws whose state changes sign as psi does."""
    return options.get("friction_law") in ("lugre", "dahl")


def varied(options, name):
    return options.get(VARIED[name.split("_")[0]])


def mirror_of(result, odd_value=False):
    """The mirror image of a summary, or of one value in it."""
    if isinstance(result, list):
        return [mirror_of(x, odd_value) for x in result]
    if not isinstance(result, dict):
        return result
    found = {}
    for name, value in result.items():
        if name in NO_RESULT:
            continue
        odd = name in ODD_RESULTS or name in PAIRS or (odd_value and name in ("value", "next_value"))
        turned = negated(value) if odd and not isinstance(value, dict) else mirror_of(value, odd_value)
        found[PAIRS.get(name, name)] = turned
    return found


def negated(value):
    if isinstance(value, list):
        return [negated(x) for x in value]
    return -value if isinstance(value, (int, float)) else mirror_of(value)


def words_of(text):
    """A text without its numbers, which may have other signs."""
    text = re.sub(r"-?\d[\d.e+-]*", "#", text).replace("below", "above")
    return text.replace("mirrored.txt", "start.txt").replace("other.h5", "one.h5")


def differences(one, other, tolerance, path=""):
    """Places at which two results differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in sorted(set(one) | set(other)):
            if name not in NO_RESULT:
                yield from differences(one.get(name), other.get(name), tolerance, f"{path}/{name}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, (a, b) in enumerate(zip(one, other)):
            yield from differences(a, b, tolerance, f"{path}[{k}]")
    elif isinstance(one, str) and isinstance(other, str):
        if words_of(one) != words_of(other):
            yield f"{path}: {one!r}, {other!r}"
    elif isinstance(one, float) or isinstance(other, float):
        if path.endswith(ROUNDED):
            tolerance = max(tolerance, 1e-10)
        if one != one and other != other:
            return
        if one is None or other is None or not abs(one - other) <= tolerance * max(1, abs(one), abs(other)):
            yield f"{path}: {one!r}, {other!r}"
    elif one != other:
        yield f"{path}: {one!r}, {other!r}"


def words_for(options):
    return [str(word) for name, value in options.items() for word in ("-" + name, value)]


def run_both(command, options):
    """Summaries (None if there is none), exit codes and what stands on standard error, of both."""
    found = []
    for name, o in (("one", options), ("other", mirrored(options))):
        for old in (f"{name}.json", f"{name}.h5"):
            if os.path.exists(old):
                os.remove(old)
        words = words_for(o)
        files = ["-summary", f"{name}.json"] + (["-out_file", f"{name}.h5"] if command in WITH_FILE else [])
        done = call(words + files, 1, command)
        summary = json.load(open(f"{name}.json")) if os.path.exists(f"{name}.json") else None
        found.append((done.returncode, summary, done.stderr, words))
    return found


WITH_FILE = ("run", "sweep")


def compare(command, options, tolerance=0.):
    one, other = run_both(command, options)
    report = []
    if one[0] != other[0]:
        report.append(f"exit codes {one[0]}, {other[0]}: {one[2][-300:]} {other[2][-300:]}")
    elif (one[1] is None) != (other[1] is None):
        report.append("summary")
    elif one[1] is not None:
        odd_value = any(options.get(name) in ODD for name in VARIED.values())
        report += list(differences(one[1], mirror_of(other[1], odd_value), tolerance))
    if words_of(one[2]) != words_of(other[2]):
        report.append(f"stderr {one[2]!r} {other[2]!r}")
    if not report and command in WITH_FILE and one[0] == 0:
        a, b = data("one.h5"), data("other.h5")
        report += list(files_differ(a, b, tolerance))
    return one[0], report, one[3]


def files_differ(a, b, tolerance):
    for name in sorted(set(a) | set(b)):
        if name.startswith("friction/"):
            continue
        last = name.split("/")[-1]
        partner = "/".join(name.split("/")[:-1] + [PAIRS.get(last, last)])
        if name not in a or partner not in b:
            yield f"dataset {name} in one only"
            continue
        x, y = np.asarray(a[name]), np.asarray(b[partner])
        if x.dtype.kind not in "fi" or last in NO_RESULT:
            continue
        y = -y if last in ODD_RESULTS or last in PAIRS else y
        if x.shape != y.shape:
            yield f"dataset {name}: shapes {x.shape}, {y.shape}"
        elif x.size:
            within = max(tolerance, 1e-10) if last in ROUNDED else tolerance
            with np.errstate(invalid="ignore"):
                off = np.abs(x - y) > within * np.maximum(1, np.abs(x))
            off |= np.isnan(x) != np.isnan(y)
            if off.any():
                yield f"dataset {name}: {off.sum()} values, by up to {np.nanmax(np.abs(x - y)):.2g}"


# ---- scenes ----

LAWS = ("cubic", "carlson-langer", "coulomb", "rate-and-state", "n-shaped", "table", "stribeck", "tanh", "slip-weakening", "lugre",
        "dahl")
WITH_THRESHOLD = ("carlson-langer", "coulomb", "table", "stribeck", "slip-weakening")


def draw_law(random, o, smooth=False):
    """Dieterich's plain logarithm, which holds for psi > 0 alone, has no mirror image."""
    law = str(random.choice(LAWS))
    o["friction_law"] = law
    if law in WITH_THRESHOLD and (smooth or random.random() < 0.4):
        o.update(friction_stick="regularised", friction_eps=random.uniform(0.02, 0.1))
        if law == "coulomb":
            o["friction_slip_velocity"] = random.uniform(0.02, 0.3)
    if law in ("carlson-langer", "coulomb", "table", "stribeck") and random.random() < 0.4:
        o["state_law"] = str(random.choice(["healing", "contact-age"]))
    if law in ("rate-and-state", "n-shaped"):
        o.update(friction_a=random.uniform(0.05, 0.2), friction_b=random.uniform(0.1, 0.4),
                 friction_D=random.uniform(0.3, 1), friction_psi0=random.uniform(0.3, 1.5))
        if law == "rate-and-state":
            o["state_law"] = str(random.choice(["ageing", "slip", "prz"]))
    if law == "table":
        o.update(friction_table=draw_table(random), friction_table_beyond=str(random.choice(["constant", "constant", "slope"])))
    if law in ("stribeck", "lugre"):
        o.update(friction_fc=random.uniform(0.3, 0.8), friction_vs=random.uniform(0.1, 1))
    if law == "stribeck":
        o.update(friction_p=random.uniform(1, 3), friction_viscous=random.uniform(0, 0.2))
    if law == "slip-weakening":
        o.update(friction_Dc=random.uniform(0.1, 1), state_t_h=random.uniform(0.5, 5),
                 friction_weakening=str(random.choice(["exponential", "linear"])))
    if law in ("lugre", "dahl"):
        o["friction_sigma0"] = random.uniform(2, 40)
    if law == "lugre":
        o.update(friction_sigma1=random.uniform(0, 1), friction_sigma2=random.uniform(0, 0.2))
    if random.random() < 0.15:
        o["model_drag"] = random.uniform(0.01, 0.3)
    return o


def draw_table(random):
    """Of both directions, which differ, or of one."""
    threshold = random.uniform(0.7, 1.3)

    def branch():
        speeds = np.cumsum(random.uniform(0.1, 0.8, 5))
        return [(f"{x:.4f}", f"{y:.4f}") for x, y in zip(speeds, threshold * random.uniform(0.3, 0.99, 5))]
    points = ["0:%.4f" % threshold] + [":".join(point) for point in branch()]
    if random.random() < 0.7:
        points = [f"-{x}:-{y}" for x, y in reversed(branch())] + points
    return ",".join(points)


def draw_medium(random, n, ends=True):
    o = {"grid_n": n}
    if random.random() < 0.5:
        o.update(model_form="chain", model_m=random.uniform(0.5, 2), model_k0=random.uniform(0.1, 1),
                 model_k1=random.uniform(0.1, 2), model_f0=random.uniform(0.5, 1.5), model_zeta=random.uniform(0, 0.4))
    else:
        o.update(model_gamma=random.uniform(1, 4), model_delta=random.uniform(0, 0.3), model_c=random.uniform(0.5, 1.5),
                 grid_length=random.uniform(4, 20), grid_order=int(random.choice([2, 4, 6, 8])))
    if random.random() < 0.2:
        o["model_nu"] = random.uniform(0.01, 0.2)
    o["model_v"] = float(random.choice([-1, 1])) * random.uniform(0.05, 1.2)
    if ends:
        for end in ("bc_left", "bc_right"):
            kind = str(random.choice(["free", "velocity", "free"]))
            o[end] = kind
            if kind == "velocity" and random.random() < 0.6:
                o[end + "_value"] = random.uniform(-1, 1)
        if random.random() < 0.4:
            for name in [k for k in o if k.startswith("bc_")]:
                del o[name]
    return o


def draw_run(random):
    n = int(random.integers(1, 4) if random.random() < 0.3 else random.integers(10, 40))
    o = draw_law(random, draw_medium(random, max(n, 9)))
    if n < 9 and o.get("model_form") == "chain":
        o["grid_n"] = n
        if n == 1:
            o = {k: v for k, v in o.items() if not k.startswith("bc_")} | {"bc_left": "free"}
    o["ts_max_time"] = random.uniform(5, 40)
    kind = str(random.choice(["uniform", "sine", "text"]))
    if kind == "text":
        points = o["grid_n"]
        x = np.arange(points) * (1. if "model_form" in o else o["grid_length"] / points)
        columns = [x, random.normal(o["model_v"], 0.3, points), random.normal(0, 0.3, points),
                   random.normal(0, 0.02, points) if bristles(o) else random.uniform(0.5, 1.5, points)][:4 if has_state(o) else 3]
        np.savetxt("start.txt", np.stack(columns, axis=1), fmt="%.17g")
        o.update(init_type="text", init_file="start.txt")
    else:
        o.update(init_type=kind, init_psi=random.uniform(-1, 1),
                 init_eta="steady" if random.random() < 0.4 else random.uniform(-1, 1), init_amplitude=random.uniform(-0.5, 0.5))
        if random.random() < 0.2:
            o["init_psi"] = "steady"
        if random.random() < 0.2 and o["friction_law"] in WITH_THRESHOLD:
            o["init_psi"] = 0.
    if random.random() < 0.3:
        times = np.cumsum(random.uniform(0.5, 8, 4))
        o["load_v"] = ",".join(f"{t:.3f}:{random.uniform(-1, 1):.4f}" for t in times)
    if random.random() < 0.2:
        o.update(load_sine_amplitude=random.uniform(-0.5, 0.5), load_sine_period=random.uniform(1, 9))
    if random.random() < 0.15:
        times = np.cumsum(random.uniform(0.5, 8, 3))
        o["load_normal"] = ",".join(f"{t:.3f}:{random.uniform(0.6, 1.4):.4f}" for t in times)
    if random.random() < 0.15:
        o.update(load_normal_sine_amplitude=random.uniform(-0.3, 0.3), load_normal_sine_period=random.uniform(1, 9))
    if random.random() < 0.15:
        o.update(load_force_sine_amplitude=random.uniform(-0.5, 0.5), load_force_sine_period=random.uniform(1, 9))
    if random.random() < 0.1 and o["friction_law"] in WITH_THRESHOLD and "friction_stick" not in o:
        o["load_halt"] = "true"
    middle = o.get("grid_length", o["grid_n"] - 1.) / 2
    if random.random() < 0.5:
        o.update(out_probes=f"{middle / 2!r},{middle!r}")
    if random.random() < 0.5:
        o.update(out_maxima=middle)
    if random.random() < 0.5:
        o["out_events"] = "true"
    if random.random() < 0.4:
        o["out_displacement"] = "true"
    if random.random() < 0.3:
        o["scene_reduce"] = "off"
    if random.random() < 0.1 and not has_state(o):  # tangent vectors begin at random: states' are not turned round
        o["lyapunov_count"] = 2
    if random.random() < 0.3:
        o["ts_type"] = str(random.choice(["rk", "arkimex", "arkimex" if any(k.startswith("load") for k in o) else "rosw", "bdf"]))
    o["out_frames"] = 9
    return o


def draw_other_run(random):
    """Starts from trains and layers."""
    o = {"model_gamma": random.uniform(1, 4), "model_delta": random.uniform(0, 0.2), "grid_n": 48,
         "grid_length": random.uniform(15, 30), "model_v": float(random.choice([-1, 1])) * random.uniform(0.1, 0.7),
         "ts_max_time": random.uniform(2, 5)}
    draw_law(random, o, smooth=True)
    kind = str(random.choice(["wave", "pulses", "layer"]))
    if kind == "layer":
        o.update(bc_left="velocity", bc_left_value=random.uniform(-1, 1), init_psi=random.uniform(-1, 1))
    o.update(init_type=kind)
    if kind != "layer":
        o["init_direction"] = str(random.choice(["left", "right"]))
    return o


def has_state(o):
    return "state_law" in o or o["friction_law"] in ("rate-and-state", "n-shaped", "slip-weakening", "lugre", "dahl")


def explore(scenes, draw, command, salt, short, tolerance):
    answered, bad = 0, []
    for index, options in scenes(draw, salt=salt, short=short):
        code, report, words = compare(command, options, tolerance)
        answered += code == 0
        if report:
            bad.append(f"scene {index}: {command} {' '.join(words)}\n    " + "\n    ".join(r[:600] for r in report[:9]))
    print(command, answered, "answered")
    assert not bad, "\n".join(bad)
    assert answered > 0


def test_run(scenes):
    explore(scenes, draw_run, "run", 801, 4, 0.)


def test_other_runs(scenes):
    explore(scenes, draw_other_run, "run", 809, 4, 0.)


def draw_spectrum(random):
    o = draw_law(random, draw_medium(random, int(random.integers(9, 40))), smooth=True)
    if random.random() < 0.3:
        o["friction_amplitude_profile"] = f"0:{random.uniform(0.5, 1.5):.3f},3:{random.uniform(0.5, 1.5):.3f}"
    o["spectrum_count"] = 6
    return o


def test_spectrum(scenes):
    explore(scenes, draw_spectrum, "spectrum", 802, 4, 1e-6)


def draw_cycle(random):
    o = draw_law(random, draw_medium(random, int(random.choice([1, 1, 9])), ends=False))
    if o["grid_n"] == 1:
        for k in ("model_gamma", "model_delta", "model_c", "grid_length", "grid_order"):
            o.pop(k, None)
        o.update({"model_form": "chain", "bc_left": "free"})
    if random.random() < 0.5:
        o.update(cycle_spectrum="true", cycle_wavenumbers=12)
    if random.random() < 0.3:
        o.update(cycle_continue="model_v", cycle_to=o["model_v"] * random.uniform(0.5, 1.4), cycle_steps=6)
    o["model_v"] *= 0.6
    return o


def test_cycle(scenes):
    explore(scenes, draw_cycle, "cycle", 803, 3, 1e-9)


def draw_wave(random):
    o = {"model_gamma": random.uniform(1, 4), "model_delta": random.uniform(0, 0.3), "model_c": random.uniform(0.5, 1.5)}
    if random.random() < 0.4:
        draw_law(random, o, smooth=True)
    o["model_v"] = float(random.choice([-1, 1])) * random.uniform(0.05, 0.8)
    o.update(wave_speed=float(random.choice([-1, 1])) * o["model_c"] * random.uniform(1.3, 4), wave_pulses=1)
    which = random.random()
    if which < 0.4:
        o.update(wave_spectrum="true", spectrum_count=8)
    elif which < 0.8:
        o.update(wave_continue="model_v", wave_to=o["model_v"] * random.uniform(0.3, 1.5), wave_steps=6)
    return o


def test_wave(scenes):
    explore(scenes, draw_wave, "wave", 804, 3, 1e-6)


def draw_boundary(random):
    o = draw_law(random, draw_medium(random, int(random.integers(9, 20)), ends=bool(random.random() < 0.3)))
    chain = "model_form" in o
    kind = random.random()
    if kind < 0.5:
        side = float(random.choice([-1, 1]))
        o.update(boundary_parameter="model_v", boundary_from=side * 0.1, boundary_to=side * 2.5)
    elif chain:
        o.update(boundary_parameter="model_zeta", boundary_from=0.01, boundary_to=2.)
    else:
        o.update(boundary_parameter="model_gamma", boundary_from=0.3, boundary_to=4.)
    if random.random() < 0.3:
        name, low, high = ("model_k1", 0.1, 1.) if chain else ("model_c", 0.5, 1.5)
        o.update(boundary_parameter2=name, boundary_from2=low, boundary_to2=high, boundary_points=4)
    if random.random() < 0.5:
        o["boundary_of"] = "sliding"
    return o


def test_boundary(scenes):
    explore(scenes, draw_boundary, "boundary", 805, 3, 1e-9)


def draw_sweep(random):
    o = draw_run(random)
    while o["init_type"] == "text":
        o = draw_run(random)
    o.update(ts_max_time=random.uniform(3, 10), sweep_parameter1="model_v", sweep_from1=random.uniform(-1, 1),
             sweep_to1=random.uniform(-1, 1), sweep_points1=4)
    return o


def test_sweep(scenes):
    explore(scenes, draw_sweep, "sweep", 806, 3, 0.)


def draw_chart(random):
    """A handful of blocks: a chart is long. From kinks and jumps a reference refines until its clock ends: drawn again."""
    while True:
        o = draw_law(random, draw_medium(random, 9), smooth=True)
        o.update(init_type="sine", init_psi=random.uniform(-1, 1), init_eta=random.uniform(-1, 1), chart_repeats=1,
                 init_amplitude=random.uniform(-0.5, 0.5), ts_max_time=random.uniform(0.2, 0.4),
                 chart_methods="rk:5dp,arkimex:3:friction", chart_tolerances="1e-3,1e-5", chart_grids=9, chart_orders=2)
        begin = time.monotonic()
        call(words_for({**o, "chart_reference_seconds": 3}), 1, "chart")
        if time.monotonic() - begin < 3:
            return {**o, "chart_reference_seconds": 600}  # no clock decides how fine the reference is


def test_chart(scenes):
    explore(scenes, draw_chart, "chart", 807, 1, 1e-9)


def test_laws(scenes):
    """The table of the steady forces is odd."""
    for index, o in scenes(lambda random: draw_law(random, {}), salt=808, short=4):
        low, high = -2.5, 1.75
        found = []
        for start, end in ((low, high), (-high, -low)):
            table = {"laws_from": start, "laws_to": end, "laws_points": 18, "out_file": "laws.h5"}
            done = call(words_for({**o, **table}), 1, "laws")
            assert done.returncode == 0, f"scene {index} {o}: {done.stderr}"
            found.append(data("laws.h5"))
            os.remove("laws.h5")
        assert set(found[0]) == set(found[1])
        bounds = {"stick/low": "stick/high", "stick/high": "stick/low"}  # of what holds a node at rest
        for name, values in found[0].items():
            other = found[1][bounds.get(name, name)]
            if np.asarray(values).dtype.kind == "f" and np.shape(values):
                assert np.array_equal(values, -other[::-1], equal_nan=True), f"scene {index} {o}: {name}"


def said_by(name, *words):
    done = tool(name, *words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_tools():
    """What a catalogue is said to hold its mirror image holds, in files of before there was a direction too."""
    options = {"model_form": "chain", "grid_n": 20, "model_k1": 0.2, "bc_left": "free", "model_v": 0.02,
               "friction_law": "coulomb", "friction_spread": 0.3, "init_psi": 0., "init_eta": 0.3, "ts_max_time": 900.,
               "out_events": "true", "scene_reduce": "off"}
    code, report, _ = compare("run", options)
    assert code == 0 and not report, report
    with h5py.File("other.h5") as file:
        events = {name: values[:] for name, values in file["events"].items()}
    assert len(events["t"]) > 30 and (events["direction"] == -1).mean() > 0.9 and (events["slip"] > 0).all()
    assert np.allclose(events["magnitude"], np.log(events["moment"]))
    # as it was written before there was a direction
    with h5py.File("other.h5") as file, h5py.File("earlier.h5", "w") as earlier:
        for name in file:
            file.copy(name, earlier)
        for name, value in file.attrs.items():
            earlier.attrs[name] = value
        e = earlier["events"]
        e["moment"][:] *= e["direction"][:]
        e["stress_drop"][:] *= e["direction"][:]
        e["magnitude"][:] = np.where(e["moment"][:] > 0, e["magnitude"][:], np.nan)
        del e["direction"]
    said, tables = set(), []
    for name in ("one", "other", "earlier"):
        said_by("catalogue.py", f"{name}.h5", "--from", "0.5", "--fit", "-1", "3", "--json", "table.json")
        tables.append(json.load(open("table.json")))
    for name in ("one", "other"):
        text = said_by("events.py", f"{name}.h5", "--from", "0.5", "--fit", "-1", "3", "-o", "picture.png")
        assert "no events" not in text
        said.add(text.split(": ", 1)[1])
    assert "no events" not in said_by("plot.py", "earlier.h5", "-o", "plot.png")
    assert len(said) == 1, said
    for table in tables[1:]:
        assert not list(differences(tables[0], table, 1e-9))
    assert abs(tables[0]["all"]["moment_per_node_and_way"] - 1) < 0.2, tables[0]
