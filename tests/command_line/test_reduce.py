"""scene_reduce as a user meets it: the reduced run is the whole one on any number of ranks, in every output; what
breaks the symmetry by one bit is not reduced; a restart keeps the reduction; unstable symmetry is warned of."""
import os
import subprocess

import h5py
import numpy as np
import pytest

from calls import PROGRAM, check, data, run


FIXED = " -ts_adapt_type none -ts_dt 0.01"
# options, unknowns solved for; adaptive steps pass their round-off on to t, so those have a wider bound (an estimate of
# order 7 is more round-off than one of order 5)
SCENES = [
    ("-grid_n 60 -ts_max_time 12 -ts_type rk -ts_rk_type 5dp", 2),
    ("-grid_n 60 -ts_max_time 12" + FIXED, 2),
    ("-grid_n 60 -grid_order 8 -bc_left free -ts_max_time 8 -out_displacement" + FIXED, 2),
    ("-grid_n 41 -model_form chain -bc_left free -model_zeta paper -ts_max_time 8 -out_displacement" + FIXED, 2),
    ("-grid_n 40 -model_form chain -friction_law carlson-langer -friction_stick regularised -friction_eps 0.05"
     " -state_law healing -ts_max_time 8", 3),
    ("-grid_n 40 -friction_law rate-and-state -ts_max_time 3", 3),
    ("-grid_n 96 -init_type sine -init_mode 4 -ts_max_time 6", 48),
    ("-grid_n 96 -init_type sine -init_mode 3 -ts_max_time 3 -out_displacement" + FIXED, 64),
    ("-grid_n 96 -init_type sine -init_mode 48 -grid_order 8 -ts_max_time 3" + FIXED, 4),
    ("-grid_n 96 -init_type pulses -init_pulses 32 -grid_order 8 -ts_max_time 3" + FIXED, 6),
    ("-grid_n 256 -init_type wave -init_pulses 2 -model_v 0.5 -ts_max_time 8 -ts_type arkimex"
     " -imex_implicit wave", 256),
    ("-grid_n 60 -init_type sine -init_mode 5 -ts_max_time 2 -ts_type arkimex -imex_implicit both", 24),
]


@pytest.mark.ranks
@pytest.mark.parametrize("scene, unknowns", SCENES)
def test_same_answer(scene, unknowns):
    bound = 1e-12 if FIXED in scene else 1e-9
    whole, error = run(scene + " -scene_reduce off -out_file whole.h5 -out_probes 0,0.37,7.21,23.4")
    check(whole["reduced"] is None and "scene_reduce" not in error, "off is off: " + scene)
    reference = data("whole.h5")
    for ranks in (1, 3):
        got, error = run(scene + " -out_file cell.h5 -out_probes 0,0.37,7.21,23.4", ranks)
        check(got["unknowns"] == unknowns and got["reduced"], f"{got['unknowns']} {got['reduced']}: {scene}")
        check(got["steps"] == whole["steps"], f"steps {got['steps']} {whole['steps']}: {scene}")
        for key in ("psi_min", "psi_max", "psi_mean", "eta_mean", "amplitude", "wave_speed"):
            a, b = got[key], whole[key]
            own = bound if key != "amplitude" else 10 * bound  # turning points between steps: round-off in slopes
            check(a == b if a is None or b is None else abs(a - b) < own, f"{key} {a} {b}: {scene}")
        for key in ("regime", "pulses", "method", "implicit", "t_end"):
            check(got[key] == whole[key], f"{key} {got[key]} {whole[key]}: {scene}")
        for a, b in zip(got["probes"], whole["probes"]):
            check(abs(a["psi"] - b["psi"]) + abs(a["eta"] - b["eta"]) < 10 * bound, f"probe {a} {b}: {scene}")
        cell = data("cell.h5")
        check(cell.keys() == reference.keys(), f"datasets: {scene}")
        for name, values in reference.items():
            if name in ("series/dt", "series/t", "probes/t"):
                continue
            # rows of every step carry the round-off of the step control, times the slope of psi
            own = bound if "/" not in name or FIXED in scene else 1e-6
            size = 1 + np.abs(values).max()
            difference = np.abs(cell[name] - values).max()
            check(cell[name].shape == values.shape and difference < own * size,
                  f"{name} differs by {difference} on {ranks} ranks: {scene}")


@pytest.mark.ranks
def test_one_bit_breaks_the_symmetry():
    # one bit of one node
    run("-grid_n 40 -ts_max_time 0.5 -out_file even.h5")
    kept, _ = run("-grid_n 40 -ts_max_time 0.5 -init_type file -init_file even.h5")
    check(kept["unknowns"] == 2, "a uniform file is reduced")
    with h5py.File("even.h5", "r+") as file:
        file["eta"][-1, 17] = np.nextafter(file["eta"][-1, 17], 1)
    for ranks in (1, 3):
        kept, _ = run("-grid_n 40 -ts_max_time 0.5 -init_type file -init_file even.h5", ranks)
        check(kept["unknowns"] == 80 and kept["reduced"] is None, "one bit of one node is kept")
    run("-grid_n 40 -init_type sine -init_mode 5 -ts_max_time 0.5 -out_file cells.h5")
    cells, _ = run("-grid_n 40 -ts_max_time 0.5 -init_type file -init_file cells.h5")
    check(cells["unknowns"] == 16, "a file of five equal cells")
    cells, _ = run("-grid_n 40 -bc_left free -grid_length 58.5 -ts_max_time 0.5 -init_type file -init_file cells.h5")
    check(cells["unknowns"] == 80, "cells between free ends are not reduced")


@pytest.mark.ranks
def test_restart_keeps_the_reduction():
    for scene, unknowns in (("-grid_n 48", 2), ("-grid_n 48 -init_type sine -init_mode 4", 24)):
        whole, _ = run(f"{scene} -ts_max_time 10 -out_probes 3 -out_file r.h5 -out_checkpoint_every 30"
                       " -out_checkpoint_keep 99")
        reference = data("r.h5")
        checkpoint = sorted(f for f in os.listdir(".") if f.startswith("r.chk"))[0]
        again, _ = run(f"-restart {checkpoint} -out_file r.h5")
        check(again["unknowns"] == unknowns and again["reduced"] == whole["reduced"], f"reduced after restart: {scene}")
        final = data("r.h5")
        for name, values in reference.items():
            check(np.array_equal(values, final[name], equal_nan=True), f"{name} after restart: {scene}")
        for key in ("psi_mean", "amplitude", "pulses", "probes", "steps"):
            check(again[key] == whole[key], f"{key} after restart: {scene}")
        for ranks in (2, 4):
            other, _ = run(f"-restart {checkpoint} -out_file s.h5", ranks)
            check(abs(other["psi_mean"] - whole["psi_mean"]) < 1e-12, f"restart on {ranks} ranks: {scene}")
        for old in os.listdir("."):
            if old.startswith("r."):
                os.remove(old)


@pytest.mark.ranks
def test_unstable_symmetry_is_told():
    # 0.03 per unit time (theory.md): a perturbation of 1e-6 takes over after about 460
    _, error = run("-model_v 0 -model_delta 0 -grid_n 64 -ts_max_time 300")
    check("warning" not in error, "a run too short for it is not spoken of: " + error)
    unstable = "-model_v 0 -model_delta 0 -grid_n 64 -ts_max_time 3000"
    got, error = run(unstable + " -progress on")
    check(error.count("unstable to waves") == 1 and "unstable to waves" in got["warnings"][0], "long waves: " + error)
    check("scene_reduce: a uniform scene: one node for 64" in error, "the saving is told with progress: " + error)
    # the ring's longest wave just above the band 0 < c^2 k^2 < 1.122, and just inside
    for square, grows in ((1.13, False), (1.0, True)):
        length = 2 * np.pi / np.sqrt(square)
        _, error = run(f"{unstable} -grid_length {length}")
        check(("unstable" in error) == grows, f"a ring whose longest wave has c2k2 = {square}: {error}")
    _, error = run("-model_v 0.9 -model_delta 0 -grid_n 64")
    check("warning" not in error, "v = 0.9 has no unstable band: " + error)
    _, error = run("-init_psi steady -init_eta steady -grid_n 64 -ts_max_time 10")
    check("uniform sliding" in error and "unstable" in error, "unstable sliding: " + error)
    _, error = run("-init_psi steady -init_eta steady -model_v 1.2 -grid_n 64")
    check("warning" not in error, "stable sliding: " + error)
    train = "-init_type wave -model_delta 0 -grid_n 256"
    _, error = run(train + " -init_pulses 2 -model_v 0.5 -grid_length 50 -ts_max_time 20")
    check("the train on 2 equal cells is unstable" in error, "an unstable train: " + error)
    _, error = run(train + " -model_delta 0.2 -init_pulses 2 -model_v 0.95 -grid_length 30 -ts_max_time 20")
    check("warning" not in error, "a stable train: " + error)
    done = subprocess.run(["mpirun", "-n", "2", PROGRAM, "run", "-ts_max_steps", "3", "-ts_monitor"],
                          capture_output=True, text=True, timeout=60)  # every rank solves, one prints
    check(done.stdout.count("TS dt") == 4, "monitors print once: " + done.stdout)
