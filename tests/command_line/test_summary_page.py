"""docs/summary.md names every key of every command's summary, and no other."""
import os
import re
import subprocess
import sys

import pytest

from calls import PROGRAM, SOURCE, run

# The least that makes each command write a summary.
CALLS = {
    "run": "-grid_n 8 -ts_max_time 0.1",
    "spectrum": "-grid_n 8",
    "boundary": "-grid_n 8 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5",
    "wave": "-model_delta 0 -model_v 0.5 -wave_pulses 1 -wave_length 25 -wave_spectrum -wave_continue model_v -wave_to 0.51 -wave_steps 2",
    "cycle": "-cycle_continue model_v -cycle_to 0.25 -cycle_steps 3",
    "chart": "-grid_n 16 -grid_length 20 -ts_max_time 0.1 -chart_methods rk:3bs -chart_tolerances 1e-3 -chart_orders 2 "
             "-chart_grids 16 -chart_repeats 1",
    "laws": "",
    "sweep": "-model_form chain -grid_n 1 -ts_max_time 1 -sweep_parameter1 model_v -sweep_values1 0.5,1.5 -out_file sweep.h5",
}


def inner(value):
    """The keys of objects within a value."""
    if isinstance(value, list):
        return set().union(*map(inner, value))
    return set(value).union(*map(inner, value.values())) if isinstance(value, dict) else set()


def explained():
    """{section: (the keys in the first column of its table, all words in code style)}."""
    with open(os.path.join(SOURCE, "docs", "summary.md"), encoding="utf-8") as file:
        sections = re.split(r"^## ", file.read(), flags=re.MULTILINE)[1:]
    keys = {}
    for section in sections:
        title, _, text = section.partition("\n")
        # the first table; those of its lists follow
        cells = re.findall(r"^\| (`[^|]*) \|", text.partition("<!-- end -->")[0], re.MULTILINE)
        keys[title.strip()] = ({key for cell in cells for key in re.findall(r"`(\w+)`", cell)},
                               set(re.findall(r"`(\w+)`", text)))
    return keys


@pytest.mark.parametrize("command", CALLS)
def test_every_key_is_explained(command):
    summary = run(CALLS[command], command=command)[0]
    page = explained()
    common, (own, words) = page["Every command"][0], page[command]
    if command == "laws":  # an array for each law, and the page says so in a sentence
        assert set(summary) > common | {"psi", "stick"}
        return
    assert set(summary) == common | own
    assert not set().union(*(inner(summary[key]) for key in own)) - words - page["spectrum"][1] - common


def test_tables_are_fresh():
    """Those of docs/summary.md and docs/files.md, as the program says them."""
    subprocess.run([sys.executable, "-B", os.path.join(SOURCE, "scripts", "tables.py"), PROGRAM, "--check"], check=True)
