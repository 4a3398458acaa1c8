"""The module postprocess/stickslip.py: the session of docs/python.md runs; what it refuses; pictures made through it."""
import contextlib
import io
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray

from calls import PROGRAM, SOURCE, check, run

sys.path.insert(0, os.path.join(SOURCE, "postprocess"))


@pytest.fixture(autouse=True)
def program(monkeypatch):
    monkeypatch.setenv("STICKSLIP", PROGRAM)


def test_session_of_the_page():
    with open(os.path.join(SOURCE, "docs", "python.md"), encoding="utf-8") as page:
        blocks = re.findall(r"```python\n(.*?)```", page.read(), re.DOTALL)
    check(len(blocks) >= 5, f"{len(blocks)} blocks")
    names = {}
    for name in ("measured-curve.txt", "catalogue.yaml"):  # as seen from docs
        os.makedirs("runs", exist_ok=True)
        shutil.copy(os.path.join(SOURCE, "runs", name), "runs")
    os.makedirs("docs")
    os.chdir("docs")
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), names)
    check(names["ring"]["regime"] == "stick-slip" and names["swing"] >= 0, names["ring"]["regime"])


def test_what_it_refuses():
    import stickslip
    for path, part in (("nowhere.h5", "does not exist"), (".", "is not a file"), (__file__, "not a readable HDF5")):
        with pytest.raises(stickslip.Unusable, match=part):
            stickslip.open(path)
    run("-grid_n 8 -ts_max_time 1 -out_file a.h5")
    with pytest.raises(stickslip.Unusable, match="no group 'probes' .it has .*series"):
        stickslip.open("a.h5", "probes")


def test_values_of_numpy_and_xarray():
    import stickslip
    typed = [(np.float64(0.1), "0.1"), (np.float32(0.5), "0.5"), (np.int64(7), "7"), (np.bool_(True), "true"), (False, "false"),
             (np.linspace(0, 1, 3), "0.0,0.5,1.0"), ([np.float64(0.1), 2], "0.1,2"), (np.array(3), "3"), ("steady", "steady"),
             (np.array([[0, 1], [2.5, 3]]), "0.0:1.0,2.5:3.0"), ([(0, 1), (2, 3)], "0:1,2:3"), (range(3), "0,1,2"),
             (xarray.DataArray(0.25), "0.25"), (xarray.DataArray([1, 2]), "1,2"), (np.str_("rk:5dp"), "rk:5dp")]
    for value, word in typed:
        check(stickslip.words_of({"x": value}) == ["-x", word], f"{value!r}: {stickslip.words_of({'x': value})}")
    check(stickslip.words_of({"x": None}) == [], "None is left out")
    draw = np.random.default_rng(2026)
    for kind in (np.float64, np.float32, np.float16, np.int32, np.uint8):
        values = (draw.uniform(-1, 1, 40) * 10.0**draw.integers(-4, 3, 40)).astype(kind)
        check(all(kind(stickslip.word_of(one)) == one for one in values), f"{kind}: every bit")
        check(np.array_equal(np.array(stickslip.word_of(values).split(","), kind), values), f"{kind}: an array")
    block = {"model_form": "chain", "grid_n": np.int64(1), "bc_left": "free", "ts_max_time": np.float32(1.5)}
    check(stickslip.run("run", load_v=np.array([[0, 0.5], [1, 0.75]]), out_displacement=np.bool_(True), **block)["t_end"] == 1.5,
          "a run")


def test_columns_and_scenes():
    """Short columns are typed as pairs, others stand in a file; a dict is a scene; both give what a file gives."""
    import pandas
    import stickslip
    v, force = np.array([0., 0.1, 0.4, 1]), [1, 0.8, 0.5, 0.6]
    frame = pandas.DataFrame({"v": v, "F": force})
    for value in ((v, force), (frame.v, frame.F), frame, frame.to_numpy(), list(zip(v, force))):
        word = stickslip.words_of({"friction_table": value})[1]
        check([tuple(map(float, pair.split(":"))) for pair in word.split(",")] == list(zip(v, force)), word)
    check(stickslip.scene({"model": {"form": "chain", "k0": {"profile": [(0, 1)]}}, "grid_n": 1}) ==
          {"model_form": "chain", "model_k0_profile": [(0, 1)], "grid_n": 1}, "a scene")
    with pytest.raises(stickslip.Unusable, match="friction_table: has columns of 4, 3 rows"):
        stickslip.words_of({"friction_table": (v, force[:3])})
    block = {"model": {"form": "chain", "v": 0.2}, "bc": {"left": "free"}, "grid": {"n": 1}, "friction": {"law": "table"}}
    long = np.linspace(0, 1, 300), 1 - 0.4 * np.linspace(0, 1, 300)
    found = [stickslip.run("run", block, ts_max_time=5, friction_table=table, out_file=name)["psi_max"]
             for table, name in ((long, "a.h5"), ("a-friction_table.txt", "b.h5"), (pandas.DataFrame(long).T, None))]
    check(found[0] == found[1] == found[2] and os.path.exists("a-friction_table.txt"), f"{found}")
    x = np.arange(2.)
    pair = {**stickslip.scene(block), "grid_n": 2, "model_k1": 0.5}
    start = stickslip.run("run", pair, friction_table=(v, force), init_type="text", init_file=(x, 0.1 * x, 0.2 * x),
                          ts_max_time=1e-9)
    check(abs(start["psi_max"] - 0.1) < 1e-6, f"a start: {start['psi_max']}")
    with pytest.raises(stickslip.Failed, match="^-model_gamma -3: "):
        stickslip.run("run", block, model_gamma=-3)
    with pytest.raises(stickslip.Failed, match="^took longer than 0.01 s$"):
        stickslip.run("run", {**block, "ts_max_time": 1e9}, friction_table=(v, force), timeout=0.01)


def test_a_python_without_h5py_says_which_to_take():
    hide = ("import sys, runpy\nsys.modules['h5py'] = None\nsys.argv[:] = sys.argv[1:]\n"
            "runpy.run_path(sys.argv[0], run_name='__main__')")
    folder = os.path.join(SOURCE, "postprocess")
    for script in ("plot.py", "events.py", "catalogue.py", "memory.py", "xdmf.py"):
        done = subprocess.run([sys.executable, "-B", "-c", hide, os.path.join(folder, script), "a.h5"],
                              capture_output=True, text=True, env={**os.environ, "PYTHONPATH": folder},
                              check=False)
        check(done.returncode != 0 and done.stderr.startswith(f"{script}: error: ") and done.stderr.count("\n") == 1 and
              "has no h5py; take that of the system, /usr/bin/python3" in done.stderr, done.stderr)


def plot(*words, code=0):
    import plot as script
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        got = script.main(list(words))
    check(got == code, f"plot.py {words}: exit {got}, {said.getvalue()}")
    return said.getvalue()


def test_pictures_of_several_of_one_block_and_moving():
    run("-grid_n 32 -init_type sine -ts_max_time 5 -out_frames 6 -out_file a.h5")
    run("-grid_n 32 -init_type sine -ts_max_time 5 -out_frames 6 -model_v 0.5 -out_file b.h5")
    run("-model_form chain -grid_n 1 -bc_left free -ts_max_time 40 -out_file one.h5")
    for v, name in (("1", "p.h5"), ("0.9", "q.h5")):
        run(f"-grid_n 16 -model_v {v} -out_file {name}", command="spectrum")
    for words, name in ((["a.h5", "b.h5"], "a.png"), (["a.h5", "b.h5", "--profile"], "a-profile.png"),
                        (["a.h5", "b.h5", "--phase"], "a-phase.png"), (["one.h5"], "one.png"),
                        (["p.h5", "q.h5"], "p.png"), (["a.h5", "--movie"], "a.gif")):
        plot(*words)
        check(os.path.getsize(name) > 5000, name)
    check("--series" in plot("a.h5", "b.h5", "--probes", code=2), "what several runs can be drawn as")
    check("drawn together" in plot("a.h5", "p.h5", code=2), "files of two kinds")
    check("--movie" in plot("p.h5", "--movie", code=2), "a movie of a spectrum")
    check("no catalogue" not in plot("a.h5", "--catalogue", code=2), "no events")


def test_names_and_titles():
    import h5py
    import stickslip
    run("-model_form chain -grid_n 8 -model_zeta paper -ts_max_time 1 -out_file z.h5")
    run("-model_form chain -grid_n 8 -model_v 0.5 -model_zeta paper -ts_max_time 1 -out_file y.h5")
    with h5py.File("z.h5") as one, h5py.File("y.h5") as other:
        title = stickslip.scene_title(one).replace("\u00a0", " ")
        check("ζ = √(0.1 m k₁) = 0.1414" in title, title)
        check(stickslip.told_apart([one, other]) == ["v = 0.2", "v = 0.5"], stickslip.told_apart([one, other]))
