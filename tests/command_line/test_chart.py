"""The command chart: its errors against a Fourier method of another make, wrong use."""
import json
import os
import sys

import h5py
import numpy as np
import xarray

import pytest

from calls import PROGRAM, SOURCE, check, data, ran, refused, run, tool
from reference import System


def chart(*words, ranks=1, code=0):
    command = (["mpirun", "-n", str(ranks)] if ranks > 1 else []) + [PROGRAM, "chart", *map(str, words)]
    done = ran(command)
    assert done.returncode == code, f"{command}: {done.returncode}\n{done.stderr}"
    return done.stderr


def summary(*words, **more):
    chart(*words, "-summary", "s.json", **more)
    with open("s.json", encoding="utf-8") as file:
        return json.load(file)


LENGTH, T = 20, 0.8
SCENE = ["-grid_length", LENGTH, "-grid_n", 64, "-init_type", "sine", "-ts_max_time", T, "-chart_repeats", 1]


def fourier(n):
    """psi and eta at t = T of the scene's differential equation: derivatives by FFT."""
    x = np.arange(n) * LENGTH / n
    start = np.concatenate([0.1 + 0.5 * np.sin(2 * np.pi * x / LENGTH), np.full(n, 0.1)])
    return System({"grid_n": n, "grid_length": LENGTH}).by_fourier().follow(start, 0, T).reshape(2, n)


METHODS = ["rk:3bs", "rk:5dp", "arkimex:3:friction", "rosw:ra34pw2", "rk:4"]
FEW = [*SCENE, "-chart_methods", "rk:3bs,arkimex:3:both", "-chart_tolerances", "1e-3,1e-5", "-chart_orders", "4"]


def test_errors_against_a_fourier_method():
    exact = fourier(256)
    doubt = np.abs(exact[:, ::2] - fourier(384)[:, ::3]).max()
    assert doubt < 1e-8, doubt

    made = summary(*SCENE, "-chart_methods", ",".join(METHODS), "-chart_tolerances", "1e-3,1e-5,1e-7", "-chart_orders",
                   "2,4,8", "-chart_grids", "64,128", "-out_file", "c.h5")
    rows = made["rows"]
    assert len(rows) == 5 * 3 * 3 * 2 and made["warnings"] == [], made["warnings"]
    reference_error = made["reference_error"]
    assert 0 < reference_error < 1e-6

    # Each row's error is what one finds by running the row and comparing with the Fourier solution, as far as the chart's
    # reference can tell.
    told = 0
    for row in rows:
        if row["method"] not in ("rk:5dp", "arkimex:3") or row["tolerance"] == 1e-5:
            continue
        method, _, subtype = row["method"].partition(":")
        implicit = ["-imex_implicit", row["implicit"]] if method == "arkimex" else []
        ran([PROGRAM, "run", *SCENE[:2] + SCENE[4:8], "-grid_n", row["n"], "-grid_order", row["order"], "-ts_type", method,
             f"-ts_{method}_type", subtype, "-ts_rtol", row["tolerance"], "-ts_atol", row["tolerance"], *implicit, "-out_times", T,
             "-out_file", "row.h5"]).check_returncode()
        with h5py.File("row.h5") as file:
            own = np.array([file["psi"][-1], file["eta"][-1]])
        error = np.abs(own - exact[:, ::256 // row["n"]]).max()
        if row["failed"] is None:
            assert abs(row["error"] - error) <= reference_error + doubt + 1e-12, (row, error)
            assert row["error"] >= 100 * reference_error
            told += 1
        else:
            assert "reference" in row["failed"] and error < 110 * reference_error, (row, error)
    assert told >= 12, told

    # The two parts of the error: their sum bounds it, and each falls as it should.
    for row in rows:
        if row["failed"] is None and row["error_time"] is not None and row["error_space"] is not None:
            assert row["error"] <= 1.001 * (row["error_time"] + row["error_space"]), row
            assert row["error"] >= 0.999 * abs(row["error_time"] - row["error_space"]), row


    def find(**wanted):
        return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


    for order, least in ((2, 1.5), (4, 3), (8, 5)):
        coarse, fine = (find(method="rk:5dp", order=order, n=n, tolerance=1e-7)[0]["error_space"] for n in (64, 128))
        assert np.log2(coarse / fine) > least, (order, coarse, fine)
    for method in ("rk:3bs", "rk:5dp", "arkimex:3", "rosw:ra34pw2"):
        errors = [find(method=method, order=4, n=128, tolerance=tolerance)[0]["error_time"] for tolerance in (1e-3, 1e-5)]
        assert errors[0] > 10 * errors[1], (method, errors)
    fixed = find(method="rk:4", order=4, n=128)  # order four: a tenth of the tolerance is a tenth of the error
    assert all(row["tolerance"] is None and row["step"] > 0 for row in fixed)
    ratio = fixed[0]["error_time"] / fixed[1]["error_time"]
    assert 30 < ratio < 300, ratio

    # best: by seconds, each better than the one before, none beaten
    best = made["best"]
    assert all(a["seconds"] <= b["seconds"] and a["error"] > b["error"] for a, b in zip(best, best[1:]))
    for one in best:
        assert not any(row["failed"] is None and row["error"] < one["error"] and row["seconds"] < one["seconds"]
                       for row in rows), one

    # the file and its picture
    with xarray.open_dataset("c.h5", engine="h5netcdf") as data:
        assert data.sizes["row"] == len(rows) and data.attrs["kind"] == "chart"
        assert np.array_equal(data["error"], [np.nan if r["error"] is None else r["error"] for r in rows], equal_nan=True)
        assert int(data["best"].sum()) == len(best)
    assert tool("plot.py", "c.h5").returncode == 0 and os.path.getsize("c.png") > 10000


@pytest.mark.ranks
def test_same_on_two_ranks():
    # any number of ranks: the same errors to round-off
    one, two = summary(*FEW), summary(*FEW, ranks=2)
    for a, b in zip(one["rows"], two["rows"]):
        assert abs(a["error"] - b["error"]) < 1e-9 and a["steps"] == b["steps"], (a, b)


def test_a_run_as_the_reference():
    # a solution of `run` as the reference: its error is not known
    ran([PROGRAM, "run", *SCENE[:2] + SCENE[4:8], "-grid_n", 256, "-grid_order", 8, "-ts_rtol", 1e-11, "-ts_atol", 1e-11,
         "-out_file", "fine.h5", "-out_frames", 2]).check_returncode()
    one = summary(*FEW)
    by_file = summary(*FEW, "-chart_reference", "fine.h5")
    assert by_file["reference_error"] is None and "not known" in by_file["warnings"][0]
    for a, b in zip(one["rows"], by_file["rows"]):
        assert abs(a["error"] - b["error"]) < 1e-6, (a, b)
    assert "fine.h5" in chart(*FEW, "-ts_max_time", 2, "-chart_reference", "fine.h5", code=2)
    assert "length" in chart(*FEW, "-grid_length", 30, "-chart_reference", "fine.h5", code=2)
    assert "missing.h5" in chart(*FEW, "-chart_reference", "missing.h5", code=2)


def test_chain_and_rows_that_fail():
    # the chain has no space error; rows that fail do not end the chart
    chain = summary("-model_form", "chain", "-grid_n", 8, "-init_type", "sine", "-ts_max_time", 10, "-chart_repeats", 1,
                    "-chart_methods", "rk:5dp,rk:1fe", "-chart_tolerances", "1e-3", "-chart_steps", "1e-4,0.5", "-model_k1", 100)
    good, small, huge = chain["rows"]
    assert good["error"] == good["error_time"] and good["error_space"] is None
    assert small["failed"] is None and "finite" in huge["failed"] and huge["error"] is None, chain["rows"]
    slow = summary(*SCENE, "-chart_methods", "rk:1fe,rk:3bs", "-chart_steps", "1e-7,1e-8", "-chart_row_seconds", 0.05,
                   "-chart_tolerances", "1e-3", "-chart_orders", 4, "-chart_grids", 32)
    assert slow["rows"][0]["failed"].startswith("stopped") and "not run" in slow["rows"][1]["failed"], slow["rows"]
    assert slow["rows"][2]["failed"] is None and len(slow["best"]) == 1


@pytest.mark.parametrize("words, names", [
    (["-chart_methods", "rk:9"], "chart_methods"), (["-chart_methods", "rk:5dp:wave"], "chart_methods"),
    (["-chart_methods", "rk:5dp,,rk:3bs"], "chart_methods"), (["-chart_orders", "3"], "chart_orders"),
    (["-chart_tolerances", "0"], "chart_tolerances"), (["-chart_grids", "4"], "grid_n"),
    (["-chart_tolerances", "1e-3,x"], "chart_tolerances"), (["-chart_steps", "-1"], "chart_steps"),
    (["-chart_orders", "8", "-bc_left", "velocity"], "chart_orders"), (["-ts_type", "rk"], "ts_type"),
    (["-ts_rtol", "1e-3"], "ts_rtol"), (["-model_form", "chain", "-chart_grids", "8,16"], "chart_grids"),
    (["-init_noise", "0.1", "-init_noise_length", "0", "-chart_grids", "16,32"], "chart_grids"), (["-ts_max_time", "0"], "ts_max_time"),
    (["-chart_smoothing", "1e-3"], "chart_smoothing"),
    (["-chart_kind", "error2"], "chart_kind"), (["-chart_repeats", "0"], "chart_repeats")])
def test_wrong_use(words, names):
    """Exit code 2, one line that names the option, no file."""
    said = chart("-chart_methods", "rk:3bs", "-grid_n", 32, *words, "-out_file", "no.h5", code=2)
    lines = [line for line in said.splitlines() if "error" in line]
    assert len(lines) == 1 and names in lines[0], (words, said)
    assert not os.path.exists("no.h5")


def test_exact_stick_and_smoothing():
    rows = summary(os.path.join(SOURCE, "runs", "chart-stick.yaml"), "-chart_methods", "rk:7vr,arkimex:4:friction", "-chart_tolerances",
                   "1e-5,1e-8", "-chart_smoothing", "1e-4,1e-5", "-chart_repeats", 1, "-chart_row_seconds", 0.1)["rows"]
    error = {(r["method"], r["eps"], r["tolerance"]): r["error"] for r in rows}
    for method in ("rk:7vr", "arkimex:4"):  # a thousandth of the tolerance: fourth order and more divide by 100 at least
        assert error[method, 0, 1e-8] < 0.01 * error[method, 0, 1e-5] < 1e-3, error
    smoothed = [error[f"arkimex:4, smoothed over {eps}", float(eps), 1e-8] for eps in ("1e-04", "1e-05")]
    assert 5 < smoothed[0] / smoothed[1] < 15 and smoothed[1] > 1e3 * error["arkimex:4", 0, 1e-8], smoothed
    # in the continuum, with a state
    rows = summary("-friction_law", "stribeck", "-friction_stick", "exact", "-state_law", "healing", "-model_gamma", 3, "-grid_length", 10,
                   "-grid_n", 21, "-init_type", "sine", "-init_psi", 0.2, "-init_amplitude", 0.3, "-ts_max_time", 1, "-chart_methods", "rk:7vr",
                   "-chart_tolerances", "1e-4,1e-7", "-chart_orders", 2, "-chart_grids", 21, "-chart_repeats", 1, "-chart_reference_seconds", 0.1)["rows"]
    assert rows[1]["error_time"] < 0.1 * rows[0]["error_time"], rows


def test_limits_are_drawn_in_one_panel():
    chart("-chart_kind", "limits", "-grid_n", 16, "-grid_length", 8, "-ts_max_time", 20, "-chart_methods", "rk:4,cn", "-out_file", "l.h5")
    sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
    from figures_chart import draw_limits
    with h5py.File("l.h5") as file:
        bars = [len(panel.patches) for panel in draw_limits(file).axes]
    assert bars == [2, 0]  # one of each method, and the key


def test_errors_of_events():
    """Errors are of when events begin and end; rows of other events have none. The strictest row's events are those that a stricter
    run writes, to the error that the chart states."""
    scene = ("-model_form chain -grid_n 12 -model_k0 1 -model_k1 4 -model_v 0.02 -bc_left free -friction_law carlson-langer "
             "-friction_sigma 0.01 -friction_alpha 1.5 -init_psi 0 -init_eta 0.5 -init_noise 0.4 -init_noise_of eta -ts_max_time 50")
    found, _ = run(scene + " -chart_of events -chart_methods rk:5dp -chart_tolerances 1e-2,1e-5,1e-7 -chart_repeats 1", command="chart")
    check(found["of"] == "events", found["of"])
    loose, middle, strict = found["rows"]
    check(strict["error"] < 0.1 * middle["error"], f"{middle['error']}, {strict['error']}")
    check(loose["error"] is None and "events in place of" in loose["failed"] or loose["error"] > middle["error"], loose)
    times = []
    for tolerance in ("-ts_type rk:5dp -ts_rtol 1e-7 -ts_atol auto:1e-7", "-ts_type rk:8vr -ts_rtol 1e-13 -ts_atol 1e-13"):
        run(f"{scene} {tolerance} -stick_clusters off -out_events -out_file e.h5")
        file = data("e.h5")
        times.append(np.array(sorted(zip(file["events/begin"], file["events/t"]))))
    check(times[0].shape == times[1].shape, "as many events")
    off = np.abs(times[0] - times[1]).max()
    check(abs(off - strict["error"]) < 0.02 * strict["error"], f"{off}, the chart says {strict['error']}")
    refused(scene + " -chart_of events -chart_reference e.h5", 2, "chart_of events", command="chart")


def test_a_row_without_the_number_says_so():
    """Long implicit steps damp the oscillation away, whose period is asked for."""
    found, _ = run("-model_form chain -grid_n 1 -bc_left free -model_v 0.3 -model_k0 0.5 -init_psi 0.2 -init_eta 0 -ts_max_time 80 "
                   "-chart_of period -chart_methods beuler -chart_steps 20,0.02 -chart_repeats 1", command="chart")
    long, short = found["rows"]
    check(long["error"] is None and long["failed"] == "the motion has no period to measure", long["failed"])
    check(0 < short["error"] < 1, short)
