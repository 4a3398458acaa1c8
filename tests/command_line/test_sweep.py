"""The command sweep: every point is the command alone; tables, samples, refinement, following, what stops and fails."""
import csv
import glob
import json
import os
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest
import xarray
from scipy.stats import qmc

from calls import SANITIZED, SOURCE, call, check, data, line, refused, run, same, scene_file

BLOCK = "-model_form chain -grid_n 1 -model_zeta paper -friction_law carlson-langer -ts_max_time 60"
OVER_V = " -sweep_parameter1 model_v -sweep_from1 0.5 -sweep_to1 3"


def sweep(arguments, ranks=1, code=0):
    return run(arguments, ranks, code, command="sweep")[0]


def rows(path):
    """The CSV without the time that each point took."""
    with open(path, encoding="utf-8") as file:
        return [{key: value for key, value in row.items() if key != "wall_s"} for row in csv.DictReader(file)]


def table(path):
    return xarray.load_dataset(path, engine="h5netcdf")


def test_every_point_is_the_command_alone():
    laws = "-model_form chain -grid_n 1 -model_zeta paper -ts_max_time 30"
    axes = (" -sweep_parameter1 model_v -sweep_values1 0.3,0.9 -sweep_parameter2 friction_law"
            " -sweep_values2 cubic,carlson-langer,coulomb -out_maxima 0")
    s = sweep(laws + axes + " -out_file all.h5")
    check((s["points"], s["done"], s["failed"]) == (6, 6, 0), s)
    d = table("all.h5")
    check(dict(d.sizes)["model_v"] == 2 and list(d.friction_law.values) == ["cubic", "carlson-langer", "coulomb"], str(d))
    for v in (0.3, 0.9):
        for law in ("cubic", "carlson-langer", "coulomb"):
            alone, _ = run(f"{laws} -model_v {v} -friction_law {law} -out_maxima 0")
            here = d.sel(model_v=v, friction_law=law)
            for key in ("steps", "psi_mean", "eta_mean", "amplitude", "growth_rate"):
                mine = np.nan if alone[key] is None else alone[key]
                check(np.array_equal(float(here[key]), mine, equal_nan=True), f"{key} at {v}, {law}")
            check(str(here.regime.values) == alone["regime"], "texts")
            maxima = [] if alone["maxima"] is None else alone["maxima"]
            check(list(here.maxima.values[:len(maxima)]) == maxima, "lists")
            check(np.isnan(here.maxima.values[len(maxima):]).all(), "and nothing behind them")
    check([row["number"] for row in rows("all.csv")] == list("012345"), "CSV in the order of points")


def test_other_commands_and_lists():
    scene = "-grid_n 32 -grid_length 20 -model_delta 0"
    sweep(scene + " -sweep_command boundary -boundary_parameter model_v -boundary_from 0.2 -boundary_to 2 -sweep_sample list"
          " -sweep_parameter1 model_gamma -sweep_values1 2,3 -sweep_parameter2 model_delta -sweep_values2 0.5,0.2"
          " -out_file boundary.h5")
    d = table("boundary.h5")
    check(d.points_value.dims[0] == "point" and "model_gamma" in d.coords, str(d))
    exact = np.sqrt(1 - np.array([0.5 / 2, 0.2 / 3]))  # of the cubic: sqrt(1 - delta/gamma)
    check(np.allclose(d.points_value[:, 0], exact, rtol=1e-8), str(d.points_value.values))
    sweep(scene + " -sweep_command spectrum" + OVER_V + " -sweep_points1 3 -out_file spectrum.h5")
    d = table("spectrum.h5")
    check(list(d.stable.values) == [0, 1, 1], "unstable at 0.5, stable at 1.75 and 3")
    # the uniform mode of lambda^2 - gamma (1 - v^2) lambda + 1 = 0
    check(abs(float(d.eigenvalues_re[0, 0]) - (1.125 + np.sqrt(1.125**2 - 1))) < 1e-8, str(d.eigenvalues_re.values))


def test_several_options_and_files_of_seeds():
    chain = ("-model_form chain -grid_n 12 -model_zeta paper -friction_law carlson-langer -friction_spread 0.2"
             " -init_noise 0.1 -ts_max_time 10 -out_frames 5")
    sweep(chain + " -sweep_parameter1 friction_seed,init_seed -sweep_values1 4,5 -sweep_files -out_file many.h5")
    run(chain + " -friction_seed 5 -init_seed 5 -out_file alone.h5")
    same(data("alone.h5"), data("many-000001.h5"), "a seed among others")
    check(not np.array_equal(data("alone.h5")["psi"], data("many-000000.h5")["psi"]), "another seed")
    check(list(table("many.h5").friction_seed.values) == [4, 5], "the first option names the dimension")


def test_options_of_the_library():
    sweep(BLOCK + " -sweep_parameter1 ts_rtol -sweep_values1 1e-4,1e-6,1e-8 -out_file rtol.h5")
    steps = table("rtol.h5").steps.values
    alone = [run(BLOCK + f" -ts_rtol {rtol}")[0]["steps"] for rtol in ("1e-4", "1e-6", "1e-8")]
    check(list(steps) == alone and steps[0] < steps[2], "each tolerance its own steps")
    sweep("-grid_n 32 -ts_type rk -ts_adapt_type none -ts_max_time 1 -sweep_parameter1 ts_dt -sweep_values1 0.1,0.01 -out_file dt.h5")
    check(list(table("dt.h5").steps.values) == [10, 100], "each step its own steps")  # PETSc 3.25 renames this option


def test_samples():
    laws = ("-sweep_command laws -laws_points 2 -sweep_parameter1 friction_a -sweep_from1 1 -sweep_to1 3 -friction_law"
            " rate-and-state -sweep_parameter2 laws_to -sweep_from2 1 -sweep_to2 100 -sweep_log2 -sweep_parameter3 laws_points"
            " -sweep_from3 2 -sweep_to3 5 -sweep_count 32 -out_file sample.h5 -sweep_sample ")
    sweep(laws + "sobol")
    d = table("sample.h5")
    u = qmc.Sobol(3, scramble=False).random(32)
    check(np.array_equal(d.friction_a, 1 + 2 * u[:, 0]), "Sobol's points as scipy has them")
    check(np.allclose(d.laws_to, 100 ** u[:, 1], rtol=1e-14), "equal ratios")
    check(np.array_equal(d.laws_points, 2 + np.floor(4 * u[:, 2])), "integers, each alike")
    shifted = [sweep(laws + "sobol -sweep_seed 7") and table("sample.h5").friction_a.values for _ in (1, 2)]
    check(np.array_equal(*shifted) and not np.array_equal(shifted[0], d.friction_a), "a seed moves them, always alike")
    # one in each of 32 intervals still
    check(sorted(np.floor((shifted[0] - 1) * 16)) == list(range(32)), "evenly as before")
    sweep(laws + "random -sweep_seed 3")
    r = table("sample.h5")
    check(len(set(r.friction_a.values)) == 32 and ((r.friction_a >= 1) & (r.friction_a <= 3)).all(), "draws in the range")
    check(abs(np.corrcoef(r.friction_a, np.log(r.laws_to))[0, 1]) < 0.6, "each option its own draws")


def test_failed_points_have_their_reason():
    state = "-model_form chain -grid_n 1 -friction_law rate-and-state -init_psi 0.3 -init_state steady -ts_max_time 5"
    s = sweep(state + " -sweep_parameter1 init_psi -sweep_values1 0.3,0,0.2 -model_v 0 -out_file some.h5")
    reason = call(state + " -init_psi 0 -model_v 0").stderr.strip()
    check(s["failed"] == 1 and reason.endswith(s["first_failure"]), f"{s['first_failure']} / {reason}")
    d = table("some.h5")
    check(list(d.status.values) == ["done", "failed", "done"] and str(d.reason.values[1]) == s["first_failure"], "in the table")
    check(np.isnan(d.psi_mean.values[1]) and np.isfinite(d.psi_mean.values[[0, 2]]).all(), "and no other is harmed")
    refused(BLOCK + " -ts_type rk -ts_adapt_dt_min 1 -ts_rtol 1e-12" + OVER_V + " -sweep_points1 2 -out_file none.h5", 1,
            "no point could be computed", "its floor", command="sweep")


def test_refinement_in_one_option():
    s = sweep(BLOCK + OVER_V + " -ts_max_time 200 -sweep_points1 6 -sweep_refine 0.008 -out_file fine.h5")
    full = sweep(BLOCK + OVER_V + " -ts_max_time 200 -sweep_points1 161 -out_file full.h5")
    check(s["points"] + s["saved"] == s["full_grid"] == 161, f"{s['points']} {s['saved']} {s['full_grid']}")
    check(s["changes"] == full["changes"] and s["points"] < 60, "the same changes from fewer runs")
    check(all(abs(one["next_value"] - one["value"] - 2.5 / 160) < 1e-12 for one in s["changes"]), "to the width")
    d = table("fine.h5")
    check(bool((np.diff(d.model_v) > 0).all()) and "model_v" in d.coords, "in the order of the option")


def test_refinement_in_two_options():
    # spectrum of the cubic block: stable beyond v_c = sqrt(1 - zeta/f0)
    scene = "-model_form chain -grid_n 1 -sweep_command spectrum -spectrum_refine off"
    s = sweep(scene + " -sweep_parameter1 model_v -sweep_from1 0.2 -sweep_to1 1.2 -sweep_points1 5 -sweep_parameter2 model_zeta"
              " -sweep_from2 0 -sweep_to2 0.8 -sweep_points2 4 -sweep_refine 0.021 -out_file curve.h5")
    d = table("curve.h5")
    stable, v, zeta = d.stable.values > 0.5, d.model_v.values, d.model_zeta.values
    check(np.array_equal(stable, v > np.sqrt(1 - zeta)), "each point on its side of the curve")
    check(s["points"] < s["full_grid"] / 4, f"{s['points']} of {s['full_grid']}")
    widths = [min(v[stable & (zeta == z)]) - max(v[~stable & (zeta == z)]) for z in set(zeta)
              if z in zeta[stable] and np.any(~stable & (zeta == z))]
    check(min(widths) <= 1 / 64 + 1e-12, "enclosed to the width")


def test_following_shows_hysteresis():
    # One Carlson-Langer block: between the linear boundary 1.6591479485 and grazing 2.4047128309 it is bistable.
    block = BLOCK.replace("60", "300") + " -sweep_follow -sweep_parameter1 model_v"
    s = sweep(block + " -sweep_values1 1.5,1.6,1.8,2.3,2.5,2.7 -out_file follow.h5")
    regime = table("follow.h5").regime
    check(list(regime.sel(direction=1).values[:4]) == ["stick-slip"] * 4, "up: stick-slip up to grazing")
    check(regime.sel(direction=-1).values[2] in ("sliding", "decaying") and regime.sel(direction=-1).values[3] == "sliding",
          "down: sliding down to the linear boundary")
    check(set(regime.sel(direction=-1).values[4:]) == {"sliding"} and s["differing"] >= 2, str(regime.values))
    check(not glob.glob(".follow*"), "nothing is left of the lines")
    # the second point is a run from the end of the first
    run(BLOCK.replace("60", "300") + " -model_v 1.5 -out_file first.h5 -out_times 300")
    second, _ = run(BLOCK.replace("60", "300") + " -model_v 1.6 -init_type file -init_file first.h5")
    check(float(table("follow.h5").psi_mean.sel(model_v=1.6, direction=1)) == second["psi_mean"], "to the last bit")


@pytest.mark.ranks
def test_same_on_any_ranks():
    chain = "-model_form chain -grid_n 6 -model_zeta paper -init_noise 0.1 -ts_max_time 20"
    for wanted in (OVER_V + " -sweep_points1 7", OVER_V + " -sweep_points1 3 -sweep_follow",
                   OVER_V + " -sweep_points1 3 -sweep_refine 0.1"):
        sweep(chain + wanted + " -out_file one.h5")
        sweep(chain + wanted + " -out_file three.h5", 3)
        check(rows("one.csv") == rows("three.csv"), "one group and three: " + wanted)
    sweep(chain + OVER_V + " -sweep_points1 4 -sweep_group_ranks 2 -out_file pair.h5", 2)
    sweep(chain + OVER_V + " -sweep_points1 4 -sweep_group_ranks 2 -out_file pairs.h5", 4)
    check(rows("pair.csv") == rows("pairs.csv"), "groups of two")
    alone, _ = run(chain + " -model_v 0.5", 2)
    check(float(table("pair.h5").eta_mean[0]) == alone["eta_mean"], "as on two ranks alone")
    refused(chain + OVER_V + " -sweep_group_ranks 2 -out_file x.h5", 2, "3 ranks cannot be shared out", ranks=3,
            command="sweep")


def stopped_midway(arguments, how, ranks=1, rows_before=20):
    """A sweep that `how` ended after so many points; how many rows it left."""
    process = subprocess.Popen(line(arguments, ranks, "sweep"), stderr=subprocess.DEVNULL)
    out_file = arguments.split("-out_file ")[1].split()[0]

    def noted():
        return sum(open(path, "rb").read().count(b"\n") for path in glob.glob(out_file + ".points-*"))
    while noted() < rows_before and process.poll() is None:
        time.sleep(0.002)
    process.send_signal(how)
    process.wait()
    return noted(), process.returncode


@pytest.mark.ranks
def test_stopped_and_continued():
    whole = BLOCK + OVER_V + " -sweep_points1 150 -out_file whole.h5"
    sweep(whole)
    for name, how, code in (("killed", signal.SIGKILL, -9), ("asked", signal.SIGTERM, 143)):
        count, ended = stopped_midway(whole.replace("whole", name), how)
        check(20 <= count < 150 and ended == code, f"{name}: {count} rows, exit code {ended}")
        if name == "killed":  # in the middle of a row
            with open("killed.h5.points-0", "ab") as file:
                file.write(b'{"point":149,"row":{"status":"do')
        before = {}
        for path in glob.glob(name + ".h5.points-*"):
            for text in open(path, encoding="utf-8"):
                if text.endswith("\n"):
                    entry = json.loads(text)
                    before[entry["point"]] = entry["row"]["wall_s"]
        s = sweep(f"-restart {name}.h5", 1 if name == "killed" else 2)
        check(s["done"] == 150 and rows(name + ".csv") == rows("whole.csv"), name + ": none lost")
        seconds = table(name + ".h5").wall_s.values
        check(all(seconds[point] == took for point, took in before.items()), name + ": none computed twice")
        check(not glob.glob(name + ".h5.points-*"), "journals are gone")
    done = call("-restart killed.h5", command="sweep")
    check(done.returncode == 0 and "nothing is left to do" in done.stderr, done.stderr)


def test_followed_line_continues():
    scene = BLOCK + OVER_V + " -sweep_points1 12 -sweep_follow -out_file "
    sweep(scene + "whole.h5")
    count, _ = stopped_midway(scene + "cut.h5", signal.SIGKILL, rows_before=5)
    check(5 <= count < 24, f"{count} rows")
    sweep("-restart cut.h5")
    check(rows("cut.csv") == rows("whole.csv"), "from where it stood")


def test_wrong_use():
    scene = BLOCK + " -out_file wrong.h5 "
    over = "-sweep_parameter1 model_v -sweep_from1 0 -sweep_to1 1 "
    for words, *parts in (
            ("", "needs sweep_parameter1"),
            ("-sweep_parameter1 model_w -sweep_values1 1", "model_w", "did you mean model_"),
            (over + "-sweep_values1 1", "either"),
            ("-sweep_parameter1 model_m -sweep_values1 1,-1", "-model_m", "-1"),
            ("-sweep_parameter1 grid_n -sweep_from1 1 -sweep_to1 3 -sweep_points1 11", "twice"),
            ("-sweep_parameter1 grid_n -sweep_from1 1.5 -sweep_to1 3", "integers"),
            (over + "-sweep_log1", "above 0"),
            (over + "-sweep_parameter3 model_k0 -sweep_values3 1", "without sweep_parameter2"),
            (over + "-sweep_parameter2 MODEL_V -sweep_values2 1", "varied twice"),
            (over + "-sweep_sample sobol", "sweep_count"),
            (over + "-sweep_command spektrum", "did you mean spectrum"),
            (over + "-sweep_command spectrum -sweep_follow", "sweep_follow"),
            (over + "-sweep_follow -sweep_files -out_every 1", "out_frames"),
            (over + "-sweep_refine 0.1 -sweep_follow", "sweep_refine"),
            (over + "-sweep_refine 1e-300", "points are more than 1e+08"),
            ("-sweep_parameter1 out_file -sweep_values1 a.h5,b.h5", "out_file"),
            (over + "-sweep_group_ranks 2", "1 rank"),
            (over + "-friction_fs 2", "friction_fs"),
            (over + "-check", "check"),
            (over + "-restart no.h5", "no.h5")):
        refused(scene + words, 2, *parts, command="sweep")
    check(not glob.glob("*wrong*"), "no file is left: " + str(glob.glob("*wrong*")))
    refused(BLOCK + " " + over, 2, "out_file", command="sweep")
    with open("kept.csv", "w", encoding="utf-8") as file:
        file.write("my notes\n")
    refused(BLOCK + " -out_file kept.h5 " + over, 2, "kept.csv", command="sweep")
    check(open("kept.csv", encoding="utf-8").read() == "my notes\n", "a file of another kind stays")
    run(BLOCK + " -out_file run.h5")
    refused("-restart run.h5", 2, "not of a sweep", command="sweep")
    sweep(BLOCK + " -out_file last.h5 -sweep_points1 2 " + over)
    with h5py.File("last.h5", "r+") as file:
        file.attrs["complete"] = 0.0
    refused("-restart last.h5", 2, "rows of 2 points are missing", command="sweep")
    refused("-restart last.h5 -model_k0 3", 2, "model_k0", command="sweep")


@pytest.mark.skipif(SANITIZED, reason="the sanitizers keep what is freed")
def test_memory_stays_flat():
    def largest(points):
        done = subprocess.run(["/usr/bin/python3", "-c", "import resource, subprocess, sys; subprocess.run(sys.argv[1:], "
                               "check=True); print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)",
                               *line(BLOCK.replace("60", "1") + OVER_V + f" -sweep_points1 {points} -out_file m.h5", 1, "sweep")],
                              capture_output=True, text=True, check=True)
        return int(done.stdout)
    # a row takes some kilobytes in the table and its text; one vector of PETSc that is not freed as much again
    check(largest(600) - largest(100) < 500 * 6, "kilobytes for 500 points more")


def test_pictures():
    sweep(BLOCK + OVER_V + " -sweep_points1 4 -sweep_parameter2 model_k0 -sweep_from2 0.1 -sweep_to2 1 -sweep_points2 3"
          " -out_file map.h5")
    sweep(BLOCK + OVER_V + " -sweep_points1 3 -sweep_follow -out_maxima 0 -out_file lines.h5")
    sweep(BLOCK + OVER_V + " -sweep_points1 3 -sweep_refine 0.2 -out_file fine.h5")
    over = BLOCK + " -boundary_parameter model_v -boundary_from 0.5 -boundary_to 3 "
    run(over + "-out_file b1.h5", command="boundary")
    run(over + "-boundary_parameter2 model_k1 -boundary_from2 0.1 -boundary_to2 1 -boundary_points 5 -out_file b2.h5",
        command="boundary")
    cases = (("map.h5", 0), ("lines.h5 b1.h5", 0), ("fine.h5 b1.h5", 0), ("map.h5 --key amplitude", 0),
             ("lines.h5 --key psi_mean", 0), ("map.h5 --key regime", 2), ("map.h5 b2.h5", 2), ("map.h5 lines.h5", 2),
             ("b1.h5 --key value", 2))
    # all in one process: what takes time is the start
    program = "import sys, plot; print([plot.main(words.split() + ['-o', 'out.png']) for words in sys.argv[1:]])"
    done = subprocess.run(["/usr/bin/python3", "-B", "-c", program, *(words for words, _ in cases)], capture_output=True,
                          text=True, env={**os.environ, "PYTHONPATH": os.path.join(SOURCE, "postprocess")})
    check(done.stdout.splitlines()[-1] == str([code for _, code in cases]), done.stdout + done.stderr)
    check(done.stderr.count("plot.py: error: ") == 4, done.stderr)


def test_maxima():
    # one block repeats after one maximum
    s, _ = run(BLOCK.replace("60", "300") + " -model_v 1 -out_maxima 0 -ts_rtol 1e-9 -ts_atol 1e-9")
    check(s["maxima_period"] == 1 and len(s["maxima"]) >= 8, str(s["maxima"]))
    check(np.ptp(s["maxima"]) < 1e-4, "the same maximum each time")
    run(BLOCK.replace("60", "300") + " -model_v 1 -ts_rtol 1e-9 -ts_atol 1e-9 -out_file run.h5 -out_frames 20001")
    psi = data("run.h5")["psi"][10000:, 0]
    check(abs(max(psi) - max(s["maxima"])) < 2e-5, f"{max(psi)} as frames have it: {max(s['maxima'])}")
    slides, _ = run(BLOCK + " -model_v 3 -init_psi 3 -init_eta steady -out_maxima 0")
    check(slides["maxima_period"] is None, "no maxima of a motion that is steady")


@pytest.mark.parametrize("tolerance", ["1e-4", "1e-6", "1e-8"])
def test_ripples_are_no_maxima(tolerance):
    # a block with rate-and-state friction rests between its slips at some 1e-8, up and down by the tolerance
    s, _ = run("-model_form chain -grid_n 1 -friction_law rate-and-state -model_v 0.1 -model_k0 0.02 -friction_a 0.01 "
               "-friction_b 0.03 -friction_D 0.5 -init_psi 0.1 -init_eta 0.7 -ts_max_time 4000 -out_maxima 0 "
               f"-ts_rtol {tolerance} -ts_atol {tolerance}")
    check(min(s["maxima"]) > 0.8, str(s["maxima"]))  # which errors of 1e-4 a step let differ by 2e-3
    check(s["maxima_period"] == 1 or tolerance == "1e-4", str(s["maxima"]))
    check(5e-4 < s["maxima_prominence"] < max(2e-3, 30 * float(tolerance)), str(s["maxima_prominence"]))


def test_periods_double():
    # Two blocks: doublings at 0.0846 and 0.0583 (docs/oscillations.md); a period has two maxima of the first block
    for spread, period in ((0.095, 2), (0.07, 4), (0.056, 8)):
        s, _ = run(f"{scene_file('sweep-doubling')} -friction_spread {spread}")
        check(s["maxima_period"] == period, f"{s['maxima_period']} at {spread}")


def test_what_accuracy_chooses_for_a_point_is_for_that_point_alone():
    """Of an explicit point and a stiff one behind it: the second has the method and the steps of a command of its own."""
    scene = ("-model_form chain -grid_n 3 -bc_left free -model_k1 0.6 -friction_law rate-and-state -friction_a 0.2 -friction_b 0.4 "
             "-friction_D 0.8 -init_psi 0.3 -init_eta 0.2 -init_noise 0.1 -ts_max_time 30 -accuracy 1e-4 ")
    run(scene + "-sweep_parameter1 model_v -sweep_values1 1,1e-3 -out_file s.h5", command="sweep")
    alone = [run(scene + f"-model_v {v}")[0] for v in (1, 1e-3)]
    with h5py.File("s.h5") as file:
        assert [one.decode() for one in file["accuracy_method"]] == [one["accuracy"]["method"] for one in alone]
        assert list(file["steps"]) == [one["steps"] for one in alone]
    assert alone[0]["accuracy"]["method"] != alone[1]["accuracy"]["method"]
