"""The module postprocess/stickslip.py: the session of docs/python.md runs; what it refuses; pictures made through it."""
import contextlib
import io
import os
import re
import sys

import pytest

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
