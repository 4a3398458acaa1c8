"""Every kind of picture by what is drawn: one size of type, labels clear of curves and of each other, nothing cropped, names of
axes in words with symbols, what is unstable dashed and nothing else; colours that colour-blind readers can tell apart."""
import itertools
import os
import sys
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from calls import SOURCE, check, run, scene_file

sys.path.insert(0, os.path.join(SOURCE, "postprocess"))

BLOCK = "-model_form chain -grid_n 1 -friction_law carlson-langer -model_zeta paper "
SMOOTH = BLOCK + "-friction_stick regularised -friction_eps 0.05 "
OVER_V = "-{0}_parameter{1} model_v -{0}_from{1} 1.4 -{0}_to{1} 2.6 "
CHAIN = "-model_form chain -grid_n 12 -bc_left free -friction_law carlson-langer -model_v 0.05 -init_noise 0.1 "
FILES = {
    "ring": ("run", "-grid_n 32 -init_type sine -ts_max_time 8 -out_probes 0,30 -out_frames 41"),
    "other": ("run", "-grid_n 32 -init_type sine -ts_max_time 8 -model_v 0.5 -out_frames 41"),
    "block": ("run", BLOCK + "-model_v 1 -ts_max_time 100 -bc_left free"),
    "lyapunov": ("run", CHAIN + "-lyapunov_count 8 -ts_max_time 60"),
    "steps": ("run", scene_file("velocity-steps")),
    "hold": ("run", scene_file("slide-hold-slide")),
    "healing": ("run", scene_file("hold-healing")),
    "spectrum": ("spectrum", "-grid_n 32"),
    "wave": ("wave", "-wave_pulses 1 -wave_length 25 -wave_continue model_v -wave_to 0.3 -wave_steps 4"),
    "laws": ("laws", ""),
    "cycle": ("cycle", SMOOTH + "-model_v 1.4 -cycle_continue model_v -cycle_to 2.6 -cycle_steps 200"),
    "line": ("boundary", BLOCK + OVER_V.format("boundary", "")),
    "diagram": ("boundary", BLOCK + OVER_V.format("boundary", "") + "-boundary_parameter2 model_k0 -boundary_from2 0.1 "
                "-boundary_to2 1 -boundary_points 8"),
    "sweep": ("sweep", SMOOTH + OVER_V.format("sweep", 1) + "-sweep_points1 9 -sweep_follow -ts_max_time 100"),
    "map": ("sweep", BLOCK + OVER_V.format("sweep", 1) + "-sweep_points1 4 -ts_max_time 60 -sweep_parameter2 model_k0 "
            "-sweep_from2 0.1 -sweep_to2 1 -sweep_points2 3"),
    "chart": ("chart", "-grid_n 32 -grid_length 8 -ts_max_time 2 -init_type sine -chart_methods rk:3bs,rk:5dp -chart_repeats 1 "
              "-chart_tolerances 1e-3,1e-5 -chart_orders 4 -chart_grids 32"),
    "many": ("chart", "-grid_n 16 -grid_length 8 -ts_max_time 1 -init_type sine -chart_repeats 1 -chart_tolerances 1e-3,1e-5 "
             "-chart_orders 4 -chart_grids 16 -chart_row_seconds 0.1 -chart_methods rk:3bs,rk:5dp,rk:7vr,rk:8vr,rk:4,rk:5f,ssp:rks2,"
             "arkimex:3:both,arkimex:4:friction,arkimex:4:wave,rosw:ra34pw2,bdf,theta,cn,beuler,euler"),
    "squeal": ("cycle", scene_file("brake") + " -cycle_continue model_v -cycle_to 1 -cycle_steps 6"),
    "limits": ("chart", "-chart_kind limits -grid_n 16 -grid_length 8 -ts_max_time 20 -chart_methods rk:4,cn"),
    "fit": ("fit", scene_file("fit-steps"))}
ALWAYS = ["ring", "ring --phase", "lyapunov --lyapunov", "hold --lab", "wave", "cycle", "squeal", "diagram", "sweep cycle", "chart",
          "many", "limits", "limits --fails", "laws"]
PICTURES = ["ring", "ring --profile", "ring --phase", "ring --probes", "ring --series", "ring other", "block", "lyapunov --lyapunov",
            "steps --lab", "hold --lab", "healing --lab", "spectrum", "wave", "laws", "cycle", "squeal", "line", "diagram", "sweep",
            "sweep cycle", "map", "chart", "many", "limits", "limits --fails", "fit"]


def wanted(config):
    """All pictures where --scenes is given, else those that differ most."""
    return PICTURES if config.getoption("--scenes") else ALWAYS


def pytest_generate_tests(metafunc):
    if "words" in metafunc.fixturenames:
        metafunc.parametrize("words", wanted(metafunc.config))


@pytest.fixture(scope="module")
def pictures(tmp_path_factory, request):
    """The pictures, laid out with their labels placed, from one set of files."""
    import drawing
    before, folder = os.getcwd(), tmp_path_factory.mktemp("pictures")
    os.chdir(folder)
    drawn = {}
    for words in wanted(request.config):
        names = [word for word in words.split() if word[0] != "-"]
        asked = [word[2:] for word in words.split() if word[0] == "-"]
        args = SimpleNamespace(what=next((word for word in asked if word != "fails"), None), movie=False, field=None, key=None,
                               frame=None, fails="fails" in asked)
        for name in names:
            command, scene = FILES[name]
            if not os.path.exists(name + ".h5"):
                run(f"{scene} -out_file {name}.h5", command=command)
        files = [h5py.File(name + ".h5") for name in names]
        drawn[words] = drawing.draw(files, args)
        drawn[words].placing.finish()
        drawn[words].draw_without_rendering()
        drawn[words].folder = str(folder)
        for file in files:
            file.close()
    os.chdir(before)
    return drawn


def texts_of(picture):
    """All words that are seen."""
    from matplotlib.text import Text
    off = [axes for axes in picture.axes if not axes.axison]
    hidden = {id(text) for axes in off for axis in (axes.xaxis, axes.yaxis) for text in axis.findobj(Text)}
    return [text for text in picture.findobj(Text) if text.get_visible() and text.get_text().strip() and id(text) not in hidden]


def seen_ticks(picture):
    """Labels of ticks that are drawn: those within the limits."""
    for axes in picture.axes:
        for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            for tick in axis.get_major_ticks() + axis.get_minor_ticks():
                if not min(limits) <= tick.get_loc() <= max(limits):
                    yield from (id(tick.label1), id(tick.label2))


def test_labels(pictures, words):
    import style
    from matplotlib.path import Path
    picture = pictures[words]
    unseen = set(seen_ticks(picture))
    texts = [text for text in texts_of(picture) if id(text) not in unseen]
    sizes = {text.get_size() for text in texts}
    check(sizes == {style.OWN["font.size"]}, f"sizes of type: {sizes}")
    boxes = [text.get_window_extent() for text in texts]
    for axes in picture.axes:
        ticks = [tick.label1 for tick in axes.xaxis.get_major_ticks() if id(tick.label1) not in unseen and tick.label1.get_text()]
        spans = sorted((box.x0, box.x1) for box in (label.get_window_extent() for label in ticks if label.get_visible()))
        check(not axes.axison or all(a[1] < b[0] for a, b in zip(spans, spans[1:])), f"numbers at ticks touch: {spans}")
    for text, box in zip(texts, boxes):
        inside = box.x0 >= -1 and box.y0 >= -1 and box.x1 <= picture.bbox.x1 + 1 and box.y1 <= picture.bbox.y1 + 1
        check(inside, f"'{text.get_text()}' is cropped: {box}")
    labels = [(text, text.get_window_extent()) for axes in picture.axes for text in axes.texts]
    for (a, one), (b, other) in itertools.combinations(labels, 2):
        check(not one.overlaps(other), f"'{a.get_text()}' on '{b.get_text()}'")
    for text, box in labels:
        for axes in picture.axes:
            for line in axes.get_lines():
                joined = line.get_linestyle() not in ("None", "none", "") and line.get_label() != "_leader"
                points = line.get_transform().transform(line.get_xydata())
                points = points[np.isfinite(points).all(axis=1)] if not joined else points
                hit = Path(points).intersects_bbox(box, filled=False) if joined and len(points) > 1 else \
                    any(box.contains(*point) for point in points if line.get_marker() not in ("None", ""))
                check(not hit, f"'{text.get_text()}' on {line.get_label()}")


def test_axes_are_named_in_words_with_their_symbol(pictures, words):
    import style
    named = [label for axes in pictures[words].axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
    check(named, "names of axes")
    flat = [" ".join(label.split()) for label in named]
    for name, symbol in style.SYMBOLS.items():
        spoken = style.NAMES.get(name)
        for label in flat:
            if label == spoken:
                check(False, f"'{label}' without its symbol {symbol}")
            check(label != style.typeset(symbol), f"'{label}' without words")


def test_dashed_is_what_is_unstable(pictures):
    for words, picture in pictures.items():
        dashed = [line for axes in picture.axes for line in axes.get_lines() if line.get_linestyle() == "--"]
        check(bool(dashed) == ("cycle" in words), f"{words}: {len(dashed)} dashed lines")
        said = picture._suptitle.get_text() if picture._suptitle else ""
        check(said.count("dashed: unstable") == bool(dashed), f"{words}: {said}")


def test_a_sweep_joined_with_a_branch(pictures):
    with h5py.File(os.path.join(pictures["sweep cycle"].folder, "cycle.h5")) as file:
        special = {kind.decode(): value for kind, value in zip(file["special/kind"][...], file["special/value"][...])}
        value, amplitude, stable = (file["branch/" + name][...] for name in ("value", "amplitude", "stable"))
    axes = pictures["sweep cycle"].axes[0]
    check({"fold", "hopf"} <= set(special), str(special))
    check(abs(special["hopf"] - (np.sqrt(1 / np.sqrt(0.02)) - 1)) < 1e-6, "v_c = sqrt(f0/zeta) - 1")
    marks = {line.get_marker(): line.get_xydata()[0] for line in axes.get_lines() if line.get_marker() in ("s", "*")}
    check(marks["*"][0] == special["hopf"] and marks["*"][1] == 0, f"Hopf point at {marks['*']}")
    check(marks["s"][0] == special["fold"] and abs(marks["s"][1] - amplitude[np.argmax(value)]) < 0.05, f"fold at {marks['s']}")
    for style, where in (("-", stable > 0), ("--", stable == 0)):
        drawn = np.concatenate([line.get_xydata() for line in axes.get_lines() if line.get_linestyle() == style and
                                line.get_color() == "#222222"])
        check(np.isin(amplitude[where], drawn[:, 1]).all(), f"the branch drawn as {style}")


def test_limits_are_two_pictures(pictures):
    right, fails = pictures["limits"], pictures["limits --fails"]
    check("right" in right._suptitle.get_text() and "fail" in fails._suptitle.get_text(), "which is which")
    check(len(right.axes[0].patches) == 2 and len(fails.axes[0].patches) == 0, "bars of steps that are right alone")


def test_a_method_looks_the_same_in_every_chart(pictures):
    """And in each chart of runs/ two methods differ, by colour or by mark."""
    import glob
    import re
    from figures_chart import look
    drawn = {line.get_label(): (line.get_color(), line.get_marker()) for words in ("chart", "many")
             for line in pictures[words].axes[0].lines if line.get_label() in ("rk:3bs", "rk:5dp")}
    check(drawn == {name: tuple(look(name).values()) for name in ("rk:3bs", "rk:5dp")}, str(drawn))
    charts = 0
    for path in glob.glob(os.path.join(SOURCE, "runs", "chart-*.yaml")):
        with open(path, encoding="utf-8") as file:
            listed = re.search(r"methods: \[(.*?)\]", file.read(), re.DOTALL)
        methods = [name.strip(' "') for name in listed[1].split(",")]
        looks = {(lambda parts: tuple(look(":".join(parts[:2]), *parts[2:]).values()))(name.split(":")) for name in methods}
        check(len(looks) == len(methods), f"{path}: {looks}")
        charts += 1
    check(charts >= 7, "charts of runs/")


def test_numbers_at_ticks_do_not_touch():
    """On a short logarithmic axis of long numbers, too."""
    import style
    for high in (0.0007, 0.0011, 0.005):
        picture = style.Picture(2)
        axes = picture.subplots(1, 2)[0]
        axes.plot([0.00052, high], [1, 2])
        style.logarithmic(axes, "x")
        picture.placing.finish()
        picture.draw_without_rendering()
        shown = [tick.label1.get_window_extent() for tick in axes.xaxis.get_major_ticks()
                 if axes.get_xlim()[0] <= tick.get_loc() <= axes.get_xlim()[1]]
        check(shown and all(a.x1 < b.x0 for a, b in zip(shown, shown[1:])), f"{high}: {shown}")


def test_each_law_has_a_panel(pictures):
    """Twelve laws over each other cannot be told apart."""
    shown = [axes for axes in pictures["laws"].axes if axes.axison]
    check(len(shown) > 6 and len({axes.get_title() for axes in shown}) == len(shown), "a panel of its own for each law")
    check(len({axes.get_ylim() for axes in shown}) == 1, "the same axes")


def test_what_happens_at_the_end_of_a_branch_is_enlarged():
    """Where nearly all of it happens in the last tenth of the axis: the range; else nothing."""
    from figures_cycle import crowded
    value = np.concatenate([np.linspace(0, 0.95, 50), np.linspace(0.95, 0.96, 50)])
    fall = {"psi_max": np.concatenate([np.full(50, 2.), np.linspace(2, 1, 50)]), "psi_min": np.full(100, 1.), "value": value}
    low, high = crowded(fall)
    check(0.93 < low < 0.95 and 0.959 < high < 0.97, f"{low} to {high}")
    check(crowded(fall | {"psi_max": 2 - value}) is None, "a branch that changes all along")


def test_the_map_of_a_long_line_is_its_middle():
    """As many nodes as can be told apart; and the line below is the plate less the mean slip."""
    from events import draw_deficit, shown_part
    x = np.arange(10000.)
    low, high = shown_part({"x": x}, 10000., 1.)
    check(high - low == 400 and low < 5000 < high and shown_part({"x": x[:100]}, 100., 1.) == (-np.inf, np.inf), f"{low} to {high}")
    import style
    axes = style.Picture(3).subplots()
    events = {"t": np.array([2., 1.]), "moment": np.array([20., 10.]), "direction": np.array([1., 1.])}
    draw_deficit(axes, {"x": x[:10], "events": events, "begin": 0, "end": 3, "shift": 3.,
                        "plate": SimpleNamespace(shift=lambda t: 3 * t)})
    ahead = axes.lines[0].get_ydata()
    check(np.allclose(ahead, [0, 3, 2, 5, 3, 6]), f"{ahead}")


def test_few_events(capsys):
    import events
    run(CHAIN + "-ts_max_time 30 -out_events -out_file e.h5")
    picture = events.catalogue_figure(["e.h5"])
    said = capsys.readouterr().out
    check("no b: " in said and "b = " not in said, said)
    check(len(picture.axes[0].get_lines()) == 1, "no line of a fit")


def test_colours_are_told_apart():
    """By the matrices of Machado, Oliveira and Fernandes (2009), full severity; distances in CIELAB."""
    import style
    matrices = ([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
                [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
                [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]], np.eye(3))
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    for matrix in matrices:
        seen = []
        for colour in style.COLOURS:
            c = np.array([int(colour[i:i + 2], 16) for i in (1, 3, 5)]) / 255
            linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055)**2.4)
            white = xyz @ np.clip(np.array(matrix) @ linear, 0, 1) / [0.9505, 1, 1.089]
            f = np.where(white > 0.008856, np.cbrt(white), 7.787 * white + 16 / 116)
            seen.append([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])
        least = min(np.hypot(np.hypot(*np.subtract(a, b)[:2]), a[2] - b[2]) for a, b in itertools.combinations(seen, 2))
        check(least > 20, f"two colours {least} apart; 2 is just noticed")


def test_curves_of_the_same_name_that_find_no_place():
    # of a chart two rows of one order and one grid may be the best, and where there is no room both stand in the key
    import matplotlib.pyplot as plt
    from placing import Placing
    figure, axes = plt.subplots(figsize=(2, 1))
    placing, x = Placing(figure, 8), np.linspace(0, 1, 30)
    for k in range(3):
        placing.curve(axes, "the same words, far too long for this picture", x, k * x, "k", axes.plot(x, k * x)[0])
    placing.finish()
    check(len(axes.get_legend().get_texts()) == 3, "all are in the key")
    plt.close(figure)
