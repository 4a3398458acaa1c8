"""Methods fail, and the program says so: for each way to fail a run that goes wrong, with a warning or exit code 1; and
sound runs of the same scenes, which stay silent."""
import json
import os
import re
import subprocess
import tempfile

import numpy as np
import pytest

from calls import PROGRAM, SOURCE, call, check, data, scene_file


class Run:
    def __init__(self, arguments):
        done = call(arguments + " -summary -")
        self.arguments, self.code, self.said = arguments, done.returncode, done.stderr
        self.summary = json.loads(done.stdout)
        self.regime, self.speed = self.summary["regime"], self.summary["wave_speed"]
        self.amplitude = self.summary["amplitude"]

    def expect(self, code, *texts):
        check(self.code == code, f"{self.arguments}: exit {self.code}, not {code}: {self.said}")
        for text in texts:
            check(text in self.said, f"{self.arguments}: no '{text}' in: {self.said}")
        if not texts:
            check(self.said == "", f"{self.arguments}: not silent: {self.said}")
        return self


# Four pulses on a ring of 100, V = 2.68955 (docs/waves.md).
TRAIN, SPEED, AMPLITUDE = ("-model_delta 0 -model_v 0.5 -init_type wave -init_pulses 4 -grid_length 100 -grid_n 192 "
                           "-scene_reduce off -ts_max_time 20 "), 2.68955, 2.012
# Sliding with a little noise, unstable below v = 0.966.
SLIDING = "-grid_n 64 -grid_length 20 -init_psi steady -init_eta steady -init_noise 1e-3 -init_noise_length 0 "
NOT_FOLLOWED = "do not follow the motion"


def test_sound_runs():
    for method in ["rk -ts_rk_type 4 -ts_dt 0.1", "rk -ts_rk_type 3bs", "arkimex -imex_implicit both", "rosw", "bdf",
                   "cn -ts_dt 0.05", "leapfrog -ts_dt 0.05", "beuler -ts_dt 0.01", "ssp -ts_dt 0.05"]:
        run = Run(TRAIN + "-ts_type " + method).expect(0)
        check(abs(run.speed / SPEED - 1) < 3e-3, f"{method}: speed {run.speed}")
    # far from sliding, where friction is stiff, long implicit steps are right although sliding is unstable
    Run("-model_gamma 300 -model_delta 0 -grid_n 16 -grid_length 1 -init_psi 2 -init_eta 0.65 -ts_max_time 80 "
        "-scene_reduce off -ts_type arkimex -imex_implicit both").expect(0)
    Run(SLIDING + "-model_v 1.1 -ts_max_time 100").expect(0)
    Run(SLIDING + "-model_v 1.1 -ts_max_time 100 -ts_type arkimex -imex_implicit both").expect(0)


def test_blow_up():
    Run(TRAIN + "-ts_type rk -ts_rk_type 4 -ts_dt 0.6").expect(
        1, "beyond the stability limit of rk:4", "the solution is not finite")
    # friction that the start does not meet yet, up to 900 per unit time: rk:5dp is stable up to 3.3 over that (3.31 on the
    # negative real axis), and both the warning and the message where it ends name that
    run = Run(f"{SOURCE}/runs/chart-stiff-friction.yaml -ts_type rk:5dp -ts_adapt_type none -ts_dt 0.01").expect(
        1, "ts_dt 0.01 is beyond the stability limit of rk:5dp", "the solution is not finite", "where friction is steepest")
    for limit in re.findall(r"(?:here|rk:5dp) is about ([0-9.]+)|which is about ([0-9.]+)", run.said):
        check(abs(float("".join(limit)) - 3.31 / 900) < 1e-4, f"limit {limit}: {run.said}")
    # linearly implicit: no Newton's method that could fail, but the step is as wrong as its one linear solve
    Run(TRAIN + "-ts_type rosw -ts_adapt_type none -ts_dt 2").expect(1, "the solution is not finite")
    # beyond the limit and yet bounded: friction holds the short waves
    run = Run(TRAIN + "-ts_type leapfrog -ts_dt 0.6").expect(0, "beyond the stability limit of leapfrog", NOT_FOLLOWED)
    check(run.amplitude > 1.5 * AMPLITUDE, f"short waves: amplitude {run.amplitude}")
    run = Run(TRAIN + "-ts_type arkimex -ts_adapt_type none -ts_dt 1 -imex_implicit friction -out_file short.h5 "
              "-out_times " + ",".join(map(str, range(21)))).expect(
        0, "beyond the stability limit of arkimex:4", NOT_FOLLOWED, "a front is not resolved")
    # Told by psi where steps end: between steps as long as these it is anyone's guess. Neighbours are further apart than crest and
    # trough of the train, in which they differ by a quarter of that at most; and the amplitude told is no less than there.
    psi = data("short.h5")["psi"]
    apart, at_ends = np.max(np.abs(np.diff(psi[-1]))), np.max(np.ptp(psi[15:], axis=0)) / 2
    check(apart > 2 * AMPLITUDE, f"short waves: neighbours are {apart} apart")
    check(run.amplitude >= at_ends > 1.25 * AMPLITUDE, f"short waves: amplitude {run.amplitude}, {at_ends} where steps end")


def test_newton_divergence():
    Run(TRAIN + "-ts_type beuler -ts_dt 1").expect(1, "Newton's method failed in the implicit part")


def test_false_stability():
    # fixed steps
    run = Run(TRAIN + "-ts_max_time 60 -ts_type beuler -ts_dt 5").expect(
        0, "let them decay like exp(", "the regime `sliding` is the method's", NOT_FOLLOWED)
    check(run.regime == "sliding", f"backward Euler: {run.regime}")
    # Adaptive ones: an instability below the tolerance is not seen by the error estimate.
    calm = SLIDING.replace("1e-3", "1e-7") + "-model_v 0.95 -ts_max_time 1000 "
    for method in ["rosw", "bdf", "cn -ts_adapt_type basic", "arkimex -imex_implicit both"]:
        run = Run(calm + "-ts_type " + method).expect(0, "steady sliding is unstable here", "the method's, not")
        check(run.regime == "sliding" and run.summary["steps"] < 50, f"{method}: {run.regime}")
    # An explicit step is bounded by stability, and the instability grows as it should.
    run = Run(calm + "-ts_max_time 300 -ts_type rk -ts_rk_type 3bs -grid_n 16")
    growing = Run(calm + "-ts_max_time 400 -ts_type rk -ts_rk_type 3bs -grid_n 16")
    check(growing.amplitude > 50 * run.amplitude and "method's" not in growing.said, "explicit steps let it grow")


def test_slow_growth():
    # Sliding that is left at 0.046 per unit time: what is seen after 100 hangs on the growth rate.
    slow = SLIDING + "-model_v 0.95 -ts_max_time 100 "
    grows = "perturbations of steady sliding grow like exp(0.0463 t)"
    true = Run(slow).expect(0, "a front is not resolved")  # the noise is as short as the grid, and has grown
    check(true.regime == "growing" and grows not in true.said, f"{true.regime}: {true.said}")
    for method, amplitude in [("euler -ts_dt 0.0017", 2), ("arkimex -imex_implicit friction -ts_adapt_type none "
                                                            "-ts_dt 0.19", 2)]:
        run = Run(slow + "-ts_type " + method).expect(0, grows)
        check(run.amplitude > amplitude > 10 * true.amplitude, f"{method}: amplitude {run.amplitude}")
    # from where it starts is no longer seen once stick-slip has lasted
    run = Run(slow + "-ts_max_time 300 -ts_type rk -ts_rk_type 4 -ts_dt 0.1")
    check(grows not in run.said, "stick-slip has lasted")


def test_short_slips():
    # Slips that last a thousandth of the window: amplitude and regime come from the steps, not from samples between
    # which they pass. Windows that end elsewhere see the same.
    plate = scene_file("plate")
    runs = [Run(f"{plate} -out_frames 2 -ts_max_time {end}").expect(0) for end in (1000, 1002, 1005)]
    check(all(run.regime == "stick-slip" for run in runs), f"plate: {[run.regime for run in runs]}")
    check(max(run.amplitude for run in runs) < 1.002 * min(run.amplitude for run in runs),
          f"plate: amplitudes {[run.amplitude for run in runs]}")


def test_no_one_speed():
    # The nodes oscillate nearly as one when the first pulse enters: passage times, all alike, make no speed.
    scene = scene_file("pacemaker")
    run = Run(f"{scene} -out_frames 2 -grid_n 201 -ts_max_time 20").expect(0, "a front is not resolved")
    check(run.speed is None, f"pacemaker: speed {run.speed}")


@pytest.mark.ranks
def test_chart_on_ranks():
    # The rows of a chart of limits do not depend on the ranks: steps found by bisection, each to 5 % or better.
    scene = os.path.join(SOURCE, "runs", "limits-train.yaml")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for ranks in (1, 2):
            done = subprocess.run(
                ["mpirun", "-n", str(ranks), PROGRAM, "chart", scene, "-progress", "off", "-summary", "-", "-grid_n",
                 "96", "-ts_max_time", "8", "-chart_methods", "rk:3bs,beuler",
                 "-out_file", os.path.join(folder, "l.h5")],
                capture_output=True, text=True, check=False)
            check(done.returncode == 0, f"chart on {ranks} ranks: {done.stderr}")
            rows.append(json.loads(done.stdout)["rows"])
    check(len(rows[0]) == len(rows[1]) == 2, f"rows: {rows}")
    for one, two in zip(*rows):
        for key in ("method", "how", "wrong", "warned"):
            check(one[key] == two[key], f"{one['method']}: {key} {one[key]} and {two[key]}")
        for key in ("limit", "followed", "theory", "shortest", "damps"):
            same = one[key] == two[key] or (one[key] and two[key] and abs(one[key] / two[key] - 1) < 0.05)
            check(same, f"{one['method']}: {key} {one[key]} on 1 rank, {two[key]} on 2")


def test_false_instability():
    stable = SLIDING + "-model_v 1.1 -ts_max_time 100 "
    run = Run(stable + "-ts_type bdf -ts_bdf_order 4 -ts_adapt_type none -ts_dt 0.3").expect(
        0, "beyond the stability limit of bdf:4", "steady sliding is stable here")
    # the motion is the method's: neither the sliding that it has left nor what it has come to is the scene's
    check(run.regime not in ("sliding", "stick-slip", "stuck"), f"bdf 4: {run.regime}")


def test_spurious_roots():
    # Beyond dt = 0.382 the equations of a step of backward Euler have three solutions at gamma = 3 (test_limits.cpp).
    Run(TRAIN + "-ts_type beuler -ts_dt 0.38").expect(0, NOT_FOLLOWED)
    check("several solutions" not in Run(TRAIN + "-ts_type beuler -ts_dt 0.38").said, "one solution below the bound")
    run = Run(TRAIN + "-ts_type beuler -ts_dt 0.5").expect(0, "have several solutions", "up to about 0.382")
    check(run.speed is None or abs(run.speed / SPEED - 1) > 0.2, f"spurious roots: speed {run.speed}")


def test_wrong_speed():
    for method, wrong in [("cn -ts_dt 0.5", 0.02), ("beuler -ts_dt 0.1", 0.03),
                          ("bdf -ts_adapt_type none -ts_dt 0.5", 0.05), ("bdf -ts_rtol 0.1 -ts_atol 0.1", 0.05)]:
        run = Run(TRAIN + "-ts_max_time 30 -ts_type " + method).expect(0, NOT_FOLLOWED)
        check(abs(run.speed / SPEED - 1) > wrong, f"{method}: speed {run.speed}")
    # in space: eleven pulses at V = 1.21281, near c, whose fronts the grid does not carry
    near = ("-scene_reduce off -model_delta 0 -model_v 0.5 -init_type wave -init_pulses 11 -grid_length 100 "
            "-grid_order 2 -ts_max_time 20 ")
    run = Run(near + "-grid_n 256").expect(0, "a front is not resolved")
    check(abs(run.speed / 1.21281 - 1) > 0.02, f"dispersion: speed {run.speed}")
    run = Run(near + "-grid_n 1024 -grid_order 4").expect(0)
    check(abs(run.speed / 1.21281 - 1) < 1e-3, f"resolved: speed {run.speed}")


def test_a_trend_of_a_scene_too_short_to_decide():
    """One period of a train: steps let its size creep by 0.6 %, which is `growing` and no false regime; they fail by blow-up."""
    done = call(scene_file("limits-near-c") + " -chart_methods rk:5dp -chart_values 11 -summary short.json", command="chart")
    check(done.returncode == 0, done.stderr)
    with open("short.json", encoding="utf-8") as file:
        row = json.load(file)["rows"][0]
    check(row["wrong"] == "blow-up" and row["silent"] == [] and row["followed"] > 0.14, row)


def test_a_motion_that_is_undecided_is_compared_itself():
    # Five periods of 8: no regime to compare, and steps of 4.92 have the amplitude, and nothing else, right.
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [PROGRAM, "chart", "-progress", "off", "-summary", "-", "-model_form", "chain", "-grid_n", "1", "-model_v", "0.5",
             "-model_zeta", "0", "-init_psi", "0.6", "-ts_max_time", "40", "-chart_kind", "limits", "-chart_methods",
             "arkimex:4:both", "-out_file", os.path.join(folder, "l.h5")], capture_output=True, text=True, check=False)
    check(done.returncode == 0, done.stderr)
    row = json.loads(done.stdout)["rows"][0]
    check(row["followed"] < 4 and row["wrong"], f"{row}")
