"""Some cases of kills.py, always the same but for the moment in which they come: two runs, on one rank and on two, a
sweep, a command with one result, a small disk. And the end of a sweep, call by call."""
import glob

import pytest

import kills
from calls import call, check, line
from kill_others import SWEEP
from kill_tools import calls_of, ended_inside_a_write


@pytest.mark.ranks
@pytest.mark.parametrize("seed, case", [(88, 0), (12, 1), (12, 6), (15, 7), (2, 9)])
def test_kills(seed, case):
    assert kills.main(["--seed", str(seed), "--only", str(case)]) == 0


def test_sweep_killed_at_its_end(scratch):
    """At each of the last calls that change files: a table that says it is whole has all its rows beside it, and no journal
    is left."""
    words = SWEEP.replace("-sweep_points1 24", "-sweep_points1 3")
    last = calls_of(words, 1, "sweep")
    with open("counted.csv", encoding="utf-8") as file:
        rows = len(file.readlines())
    for at in range(last - 20, last + 1):
        ended_inside_a_write(line(f"{words} -out_file killed.h5", 1, "sweep"), at)
        done = call("-restart killed.h5", 1, "sweep")
        with open("killed.csv", encoding="utf-8") as file:
            check(done.returncode == 0 and len(file.readlines()) == rows, f"call {at} of {last}: {done.stderr}")
        check(not glob.glob("killed.h5.points-*"), f"call {at} of {last}: journals are left")
