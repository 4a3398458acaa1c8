"""Every command gives the same answer on one rank and on two, three or four, over scenes of runs/: eigenvalues, roots, speeds and
tables to 1e-9 (an eigensolver's tolerance), runs to 1e-10 after a short time. (test_run.py: frames to 1e-12.)"""
import itertools
import math

import numpy as np
import pytest

from calls import check, data, run, scene_file

RANKS = (2, 3, 4)


def numbers(value, name=""):
    """Every number in a summary, by its place."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, f"{name}/{key}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from numbers(inner, f"{name}/{index}")
    else:
        yield name, value


def compare(command, arguments, keys, tolerance, ranks):
    one, _ = run(arguments, 1, command=command)
    reference = dict(numbers({key: one[key] for key in keys}))
    check(any(isinstance(value, float) for value in reference.values()), f"{command} {arguments}: no number in {keys}")
    other, _ = run(arguments, ranks, command=command)
    found = dict(numbers({key: other[key] for key in keys}))
    check(set(found) == set(reference), f"{command} {arguments}: other keys on {ranks} ranks")
    for name, value in reference.items():
        if isinstance(value, float):
            near = math.isclose(value, found.get(name, math.nan), rel_tol=tolerance, abs_tol=tolerance)
        else:
            near = value == found.get(name)
        check(near, f"{command} {arguments}: {name} is {value} on 1 rank and {found.get(name)} on {ranks}")
    check(one["warnings"] == other["warnings"], f"{command} {arguments}: warnings on {ranks} ranks")


FIELDS = ["t_end", "psi_min", "psi_max", "psi_mean", "eta_mean", "probes", "regime", "steps"]
TRAIN = ["speed", "length", "period", "psi_max", "psi_min"]
LINE = "-grid_n 32 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5 "
CASES = [
    *(("run", f"{scene_file(name)} -ts_max_time 1 -out_probes 2.5", FIELDS, 1e-10)
      for name in ("pacemaker", "chain-damped", "ring", "spread-continuum")),
    ("spectrum", "-grid_n 60 -model_v 0.95", ["growth_rate", "stable", "complete", "frequency"], 1e-9),
    ("spectrum", "-grid_n 64 -bc_left velocity -bc_left_value -1.5 -friction_spread 0.3 -spectrum_refine off",
     ["growth_rate", "frequency", "stable", "complete"], 1e-9),
    ("spectrum", "-model_form chain -grid_n 23 -bc_left free -model_zeta paper", ["growth_rate", "stable"], 1e-9),
    ("boundary", LINE, ["points"], 1e-9),
    ("boundary", LINE + "-boundary_parameter2 model_delta -boundary_from2 0.1 -boundary_to2 0.5 -boundary_points 4",
     ["points"], 1e-8),
    ("wave", "-model_delta 0 -model_v 0.5 -wave_pulses 4 -wave_length 100", TRAIN, 1e-9),
    ("laws", "-laws_points 7", ["psi", "cubic", "carlson-langer"], 0)]


@pytest.mark.ranks
@pytest.mark.parametrize("case, ranks", zip(CASES, itertools.cycle(RANKS)))  # each number of ranks in turn
def test_same_on_any_ranks(case, ranks):
    compare(*case, ranks)


@pytest.mark.ranks
@pytest.mark.parametrize("method", ["", "-ts_type arkimex -imex_implicit both"])
def test_exact_stick_has_the_same_bits(method):
    """Steps are held by the largest error, which does not depend on the order of a sum."""
    found = {}
    for ranks in (1, *RANKS):
        run(f"{scene_file('catalogue')} -grid_n 12 -ts_max_time 300 {method} -out_frames 4 -out_file r.h5", ranks)
        found[ranks] = data("r.h5")
    check(len(found[1]["events/t"]) > 5, f"{method}: events that begin and end")
    for ranks in RANKS:
        for name in ("psi", "eta", "events/t", "events/begin"):
            check(np.array_equal(found[1][name], found[ranks][name]), f"{method}: {name} on {ranks} ranks")
