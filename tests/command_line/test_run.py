"""The command run as a user meets it: the same answer on any number of ranks, restart, failure with results kept,
measurements, warnings."""
import itertools
import os

import h5py
import numpy as np
import pytest

from calls import check, data, run


@pytest.mark.ranks
def test_same_on_any_ranks():
    # Short scenes of every end, form and method: round-off alone separates the ranks.
    held = "-bc_left velocity -bc_left_value -1.5 -init_type layer"
    scenes = [
        "-init_type sine -grid_n 97 -grid_order 8 -ts_max_time 2",
        held + " -grid_n 60 -ts_max_time 2",
        held + " -grid_n 60 -grid_order 6 -bc_right velocity -ts_type arkimex -imex_implicit wave -ts_max_time 1",
        held + " -grid_n 40 -grid_order 2 -ts_type arkimex -imex_implicit friction -ts_max_time 1",
        "-init_type sine -grid_n 40 -ts_type arkimex -imex_implicit both -ts_max_time 1 -friction_spread 0.3",
        "-model_form chain -grid_n 31 -bc_left free -init_noise 0.5 -model_zeta paper -friction_spread 0.2"
        " -friction_law carlson-langer -friction_stick regularised -friction_eps 0.05 -ts_max_time 3",
        "-model_form chain -grid_n 31 -bc_left free -init_noise 0.5 -model_zeta paper -friction_spread 0.2"
        " -friction_law carlson-langer -state_law healing -ts_max_time 3",
        "-model_form chain -grid_n 5 -init_noise 0.5 -bc_left velocity -bc_right velocity -ts_max_time 3",
    ]
    for scene, ranks in zip(scenes, itertools.cycle((3, 2, 4))):
        one, _ = run(scene + " -out_file one.h5 -out_probes 0.3,1")
        reference = data("one.h5")
        other, _ = run(scene + " -out_file other.h5 -out_probes 0.3,1", ranks)
        check(one["steps"] == other["steps"], f"steps on {ranks} ranks: {scene}")
        for name in ("psi", "eta"):  # frames; the steps' own times carry the round-off of the step control
            difference = np.abs(reference[name] - data("other.h5")[name]).max()
            check(difference < 1e-12, f"{name} differs by {difference} on {ranks} ranks: {scene}")


def test_restart():
    scene = "-bc_left velocity -bc_left_value -1.5 -init_type layer -grid_n 120 -out_probes 5 -ts_max_time 6"
    methods = ["", "-ts_type arkimex -imex_implicit wave"]  # of all others test_restart.py
    for method in methods:
        for old in os.listdir("."):
            if old.startswith("whole"):
                os.remove(old)
        whole, _ = run(f"{scene} {method} -out_file whole.h5 -out_checkpoint_every 20 -out_checkpoint_keep 100")
        reference = data("whole.h5")
        checkpoint = sorted(f for f in os.listdir(".") if f.startswith("whole.chk"))[0]
        for file in ("whole.h5", "elsewhere.h5"):
            again, _ = run(f"-restart {checkpoint} -out_file {file}")
            for key in ("psi_mean", "eta_mean", "probes", "steps", "rhs_evaluations", "rejections", "amplitude"):
                check(whole[key] == again[key], f"{key} after restart: {method}: {whole[key]} {again[key]}")
        final = data("whole.h5")
        for name, values in reference.items():
            check(np.array_equal(values, final[name], equal_nan=True), f"{name} after restart: {method}")
        other, _ = run(f"-restart {checkpoint} -out_file elsewhere.h5", ranks=2)
        check(abs(other["psi_mean"] - whole["psi_mean"]) < 1e-12, f"restart on 2 ranks: {method}")
    stick = ("-model_form chain -model_v 0.05 -friction_law carlson-langer -friction_spread 0.1 -init_noise 0.2 -grid_n 40"
             " -out_probes 5 -ts_max_time 40 -state_law healing")
    run(f"{stick} -out_file stick.h5 -out_checkpoint_every 10 -out_checkpoint_keep 1000")
    checkpoints = sorted(f for f in os.listdir(".") if f.startswith("stick.chk"))
    reference = data("stick.h5")
    for checkpoint in checkpoints[::len(checkpoints) // 4]:
        run(f"-restart {checkpoint} -out_file stick.h5")
        for name, values in data("stick.h5").items():
            check(np.array_equal(reference[name], values, equal_nan=True), f"{name} after {checkpoint}")
    checkpoint = sorted(f for f in os.listdir(".") if f.startswith("whole.chk"))[0]
    longer, _ = run(f"-restart {checkpoint} -out_file whole.h5 -ts_max_time 7")
    times = data("whole.h5")["t"]
    check(longer["t_end"] == 7 and times[-1] == 7 and (np.diff(times) > 0).all(), "a run extended by a restart")
    run(f"-restart {checkpoint} -model_gamma 4 -out_file whole.h5", code=2)


def test_explosion():
    summary, error = run("-init_type sine -grid_n 200 -ts_type rk -ts_rk_type 4 -ts_dt 0.9 -out_file boom.h5", code=1)
    check(error.count("error:") == 1 and "finite" in error, "one line tells of the explosion: " + error)
    check(summary["status"] == "failed" and summary["t_end"] < 60, "summary of an explosion")
    psi = data("boom.h5")["psi"]
    check(len(psi) > 0 and np.isfinite(psi).all(), "what was computed before the explosion is on disk")
    run("-init_type sine -grid_n 64 -ts_type rk -ts_rk_type 4 -ts_dt 0.9", ranks=2, code=1)


def test_measurements():
    # A train on a ring moves at L/(n T); model.md's values 5.22294 for two pulses. The train of the uniform
    # oscillation's orbit settles; order 4 on 1024 points leaves 1e-4.
    train = "-init_type pulses -init_pulses 2 -model_v 0.5 -model_delta 0 -grid_length 100 -grid_n 1024 -ts_max_time 60"
    right, _ = run(train)
    check(abs(right["wave_speed"] - 5.22294) < 2e-3 and right["pulses"] == 2, f"speed {right['wave_speed']}")
    check(right["regime"] == "stick-slip" and 1.9 < right["amplitude"] < 2.2, "regime of a train")
    left, _ = run(train + " -init_direction left")
    check(abs(left["wave_speed"] + right["wave_speed"]) < 1e-6, "to the left the speed is negative")
    still, _ = run("-model_v 1.2 -init_noise 0.01 -init_psi 1.2 -init_eta steady -grid_n 64")
    check(still["regime"] == "sliding" and still["wave_speed"] is None, "sliding above v_c")


def test_warnings():
    _, error = run("-bc_left velocity -bc_left_value -1.5 -ts_max_time 1 -grid_n 64")
    check("does not fit the held end" in error and "jump" in error, "a jump is told: " + error)
    _, error = run("-bc_left velocity -bc_left_value 0.1 -ts_max_time 1 -grid_n 64")
    check("does not fit the held end" in error and "corner" in error, "a corner is told: " + error)
    _, error = run("-bc_left velocity -bc_left_value -1.5 -init_type layer -ts_max_time 1 -grid_n 512")
    check("fit" not in error, "a layer fits: " + error)
    for method in ("-ts_type bdf", "-ts_type alpha", "-ts_type arkimex -imex_implicit wave"):
        _, error = run("-friction_law carlson-langer " + method, code=2)
        check("friction_stick exact" in error, f"{method} cannot hold a block at rest: " + error)
    _, error = run("-out_times 1,70 -out_file late.h5", code=2)
    check("out_times" in error and "70" in error, "a frame after the end is refused: " + error)


def test_noise_is_by_length():
    # a ring of 25: every fourth node of the fine grid stands where one of the coarse does
    for n in (50, 200):
        run(f"-grid_n {n} -grid_length 25 -init_noise 0.1 -init_seed 5 -ts_max_time 0 -out_file noise{n}.h5")
    coarse, fine = (data(f"noise{n}.h5")["psi"][0] for n in (50, 200))
    check(np.abs(fine[::4] - coarse).max() < 1e-14, "noise is by length, not by node")
    check(np.ptp(coarse) > 0.05, "there is noise")


def test_no_energy_balance_with_a_held_end():
    _, said = run("-grid_n 32 -bc_left velocity -bc_left_value 0.1 -ts_max_time 0.5 -out_displacement true -out_file h.h5")
    check("no energies" in said and "held end" in said, said)
    check("energy_elastic" not in h5py.File("h.h5")["series"], "no series of energies")
    _, said = run("-grid_n 32 -bc_left free -ts_max_time 0.5 -out_displacement true -out_file f.h5")
    check("no energies" not in said and "energy_elastic" in h5py.File("f.h5")["series"], said)
