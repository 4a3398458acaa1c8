"""`fit`: the shipped scene, ways to say the same data, what the data leave open, ranges, ranks, the picture. What was put in
comes back: tests/audit/test_fit.py."""
import os
import sys

import h5py
import numpy as np
import pytest

from calls import SOURCE, call, check, data, refused, run, scene_file, tool

BLOCK = "-model_form chain -grid_n 1 -bc_left free -model_k0 1 -model_v 0.9 -init_psi 1.2 -init_eta 0.5 -ts_max_time 12 -friction_law tanh " \
        "-model_zeta 0.1 "


def course(more="", of="eta"):
    """A run of the block, its frames."""
    run(f"{BLOCK}{more} -ts_rtol 1e-10 -ts_atol 1e-10 -out_file r.h5 -out_frames 61 -out_displacement")
    file = data("r.h5")
    return file["t"], file[of][:, 0]


def fit(more, **how):
    return run(BLOCK + more, command="fit", **how)[0]


def fit_of(words):
    return run(words, command="fit")[0]


def values(summary):
    return np.array([p["value"] for p in summary["parameters"]])


def test_the_shipped_scene():
    s = run(scene_file("fit-steps") + " -out_file f.h5", command="fit")[0]
    off = np.abs(values(s) - [0.012, 0.016, 8]) / [p["error"] for p in s["parameters"]]
    check(np.all(off < 3) and s["starts"] == 4 and not s["warnings"], f"{s['parameters']} {s['warnings']}")
    file = data("f.h5")
    check(np.allclose(file["left"], file["data"] - file["fit"]) and abs(np.sqrt(np.mean(file["left"]**2)) - s["residual"]) < 1e-12, "what is left")
    done = tool("plot.py", "f.h5", "-o", "f.png")
    check(done.returncode == 0, done.stderr)


@pytest.mark.parametrize("of", ["force", "psi", "displacement"])
def test_without_noise_all_digits_come_back(of):
    t, y = course("-friction_fc 0.45", {"force": "eta", "psi": "psi", "displacement": "chi"}[of])
    np.savetxt("d.txt", np.c_[t[1:], (y - y[0])[1:] if of == "displacement" else y[1:]], fmt="%.15g")
    s = fit(f"-fit_data d.txt -fit_of {of} -fit_parameters friction_fc,model_m -fit_starts 2")
    check(np.allclose(values(s), [0.45, 1], rtol=1e-5, atol=0) and s["residual"] < 1e-6, f"{of}: {s['parameters']} {s['residual']}")
    if of == "force":  # the load point goes 0.9 in a unit of time
        np.savetxt("d.txt", np.c_[0.9 * t[1:], y[1:]], fmt="%.15g")
        again = fit("-fit_data d.txt -fit_against displacement -fit_parameters friction_fc,model_m -fit_starts 2")
        check(np.allclose(values(again), values(s), rtol=1e-6), f"{again['parameters']} {s['parameters']}")


def test_what_only_takes_the_run_along_other_steps_has_no_effect():
    # the velocity to which friction_a refers shifts friction by a constant, which a velocity does not show
    scene = ("-model_form chain -grid_n 1 -bc_left free -friction_law rate-and-state -state_law ageing -friction_a 0.01 -friction_b 0.012 "
             "-friction_D 0.05 -friction_psi0 1 -model_v 0.1 -model_k0 1 -model_m 0.01 -init_psi 0.1 -init_eta steady "
             "-load_v 0:0.1,5:0.1,5:0.5,12:0.5,12:0.2 -ts_max_time 20 ")
    run(scene + "-out_file a.h5 -out_every 0.2")
    file = data("a.h5")
    np.savetxt("d.txt", np.c_[file["t"], file["psi"][:, 0]])
    asked = scene + "-fit_of psi -fit_data d.txt -fit_starts 1 -fit_parameters friction_a"
    refused(asked + ",friction_psi0", 2, "friction_psi0: it has no effect on these data", command="fit")
    found, _ = run(asked, command="fit")
    check(abs(values(found)[0] / 0.01 - 1) < 1e-2, found["parameters"])


def test_dynamic_friction_stays_below_static_friction():
    """Where it may pass it, searches that begin between the right place and there go astray: all of four ended at friction that
    rises with velocity, 32 times the noise off."""
    scene = ("-model_form chain -grid_n 1 -bc_left free -friction_law coulomb -model_v 0.1 -model_k0 1 -init_psi 0 -ts_max_time 30 "
             "-friction_fs 1 ")
    run(scene + "-friction_fd 0.6 -ts_rtol 1e-10 -ts_atol 1e-10 -out_file r.h5 -out_frames 61")
    file = data("r.h5")
    np.savetxt("d.txt", np.c_[file["t"][1:], file["eta"][1:, 0]], fmt="%.15g")
    s = fit_of(scene + "-friction_fs 1.05 -friction_fd 1.04 -fit_data d.txt -fit_parameters friction_fs,friction_fd")
    check(np.allclose(values(s), [1, 0.6], rtol=1e-4), f"{s['parameters']} {s['residual']}")
    # one of the two alone is bounded by the other, and says so
    s = fit_of(scene + "-friction_fs 0.5 -friction_fd 0.4 -fit_data d.txt -fit_parameters friction_fd -fit_starts 2")
    check(values(s)[0] <= 0.5 and any("end of the range" in w for w in s["warnings"]), f"{s['parameters']} {s['warnings']}")


def test_what_has_no_effect_is_said_where_other_values_fail():
    # nothing slips at these loads, and beside the scene's values dynamic friction would exceed static friction
    scene = ("-model_form chain -grid_n 1 -bc_left free -friction_law coulomb -model_v 0.01 -model_k0 1 -init_psi 0 -init_eta 0 -ts_max_time 10 "
             "-friction_fs 1 -friction_fd 0.99 -fit_data 1:0.01,2:0.02,5:0.05 -fit_parameters ")
    refused(scene + "friction_fd", 2, "friction_fd: it has no effect on these data", command="fit")


def test_what_the_data_leave_open():
    # at m = 1 only f0/m, zeta/f0 and k0/f0 say where the block goes: f0, m and zeta, k0 together change nothing
    t, y = course("-friction_fc 0.45", "psi")
    np.savetxt("d.txt", np.c_[t[1:], y[1:]], fmt="%.15g")
    s = fit("-model_zeta 0 -fit_data d.txt -fit_of psi -fit_parameters model_f0,model_m,model_k0,model_zeta -model_zeta 0.1 -fit_starts 1")
    check(any("do not tell" in w and "model_f0" in w and "model_m" in w for w in s["warnings"]), s["warnings"])
    check(all(p["error"] is None for p in s["parameters"]), s["parameters"])
    # mu0 and the logarithm of psi0 are one constant
    s = run(scene_file("fit-steps") + " -fit_parameters friction_mu0,friction_psi0,friction_a,friction_b -friction_D 8 -fit_starts 1", command="fit")[0]
    check(any("do not tell" in w and "mu0" in w and "psi0" in w for w in s["warnings"]), s["warnings"])
    s = fit("-fit_data d.txt -fit_of psi -fit_parameters friction_fc -friction_fc 5e-5 -fit_starts 1")
    check(any("end of the range" in w for w in s["warnings"]), s["warnings"])


@pytest.mark.ranks
def test_the_same_on_two_ranks():
    scene = "-grid_n 8 -grid_length 8 -init_type sine -init_psi 1.1 -model_v 1.1 -ts_max_time 6 "
    run(scene + "-model_gamma 2.5 -out_file r.h5 -out_frames 41")
    file = data("r.h5")
    np.savetxt("d.txt", np.c_[file["t"][1:], file["eta"].mean(axis=1)[1:]], fmt="%.15g")
    one, two = (run(scene + "-fit_data d.txt -fit_parameters model_gamma -fit_starts 1", command="fit", ranks=ranks)[0] for ranks in (1, 2))
    check(np.allclose(values(one), 2.5, rtol=1e-4) and np.allclose(values(one), values(two), rtol=1e-6), f"{one['parameters']} {two['parameters']}")


def test_a_scene_that_fails_is_an_error():
    done = call(BLOCK + "-friction_law dieterich -friction_fc 0.45", command="fit")
    check(done.returncode == 2, done.stderr)
    scene = BLOCK.replace("-friction_law tanh", "-friction_law cubic") + "-model_m 1e-4 -ts_type rk -ts_dt 1 -ts_adapt_type none "
    done = call(scene + "-fit_data 1:0.1,2:0.1 -fit_parameters model_m", command="fit")
    check(done.returncode == 1 and done.stderr.count("error:") == 1, done.stderr)


def test_the_laboratory_s_picture():
    sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
    import stickslip
    scene = scene_file("fit-steps")
    run(f"{scene} -load_v 0:10,3:12,3:5,9:5,9:0,15:0,15:2 -load_sine_amplitude 1 -load_sine_period 7 -ts_max_time 20 -out_file r.h5 -out_frames 41")
    with h5py.File("r.h5") as file:
        t, v = file["series/t"][...], file["series/v"][...]
        way = stickslip.Plate(file, t[-1]).shift(t)
    # from row to row a trapezium, at a corner with v before it
    off = np.abs(np.diff(way) - np.diff(t) * (v[1:] + v[:-1]) / 2)
    check(np.quantile(off, 0.95) < 1e-2 and abs(way[-1] - (33 + 30 + 0 + 10 + 7 / (2 * np.pi) * (1 - np.cos(40 * np.pi / 7)))) < 1e-9, f"{way[-1]} {np.max(off)}")
    run(scene + " -out_file f.h5", command="fit")
    run(f"{scene} -friction_D 8 -out_file s.h5 -out_frames 41")
    for files, code in ((["s.h5", "f.h5"], 0), (["r.h5"], 0), (["f.h5"], 2)):
        done = tool("plot.py", "--lab", *files, "-o", "l.png")
        check(done.returncode == code, f"{files}: {done.stderr}")


def test_a_sweep_of_fits():
    run(scene_file("fit-steps") + " -sweep_command fit -sweep_parameter1 fit_seed -sweep_values1 1,2 -fit_starts 2 -out_file s.h5", command="sweep")
    check(np.all(np.abs(data("s.h5")["residual"] - 0.000983) < 1e-6), "both are the shipped one")


def noisy(seed, correlation, rows=400):
    """A block's course with noise of 0.01 of its scatter, each row as far as `correlation` that of the one before."""
    run(f"{BLOCK} -friction_fc 0.45 -ts_rtol 1e-9 -out_file r.h5 -out_frames {rows + 1}")
    file, generator = data("r.h5"), np.random.default_rng(seed)
    noise = np.zeros(rows + 1)
    for k in range(1, rows + 1):
        noise[k] = correlation * noise[k - 1] + np.sqrt(1 - correlation ** 2) * generator.normal()
    return np.c_[file["t"], file["eta"][:, 0] + 0.01 * np.std(file["eta"]) * noise][1:]


def test_correlated_residuals_are_told_of():
    # noise of an autoregression: n rows are as much as n (1 - r)/(1 + r)
    words = "-fit_data d.txt -fit_parameters friction_fc,model_m -fit_starts 1"
    for correlation in (0.9, 0.0):
        np.savetxt("d.txt", noisy(5, correlation))
        s = fit(words)
        told = [w for w in s["warnings"] if "errors are too small" in w]
        check(len(told) == (correlation > 0) and abs(s["residual_correlation"] - correlation) < 0.1, f"{s['warnings']} {s['residual_correlation']}")
        factor = np.sqrt(400 / s["independent_rows"])
        check(0.5 < factor / np.sqrt((1 + correlation) / (1 - correlation)) < 2, f"{correlation}: {factor}")


def test_a_drift_is_sought_beside_the_parameters():
    rows = noisy(6, 0)
    rows[:, 1] += 0.003 * rows[:, 0]
    np.savetxt("d.txt", rows)
    words = "-fit_data d.txt -fit_parameters friction_fc,model_m -fit_starts 1"
    with_drift, without = fit(words + " -fit_trend linear"), fit(words)
    trend = with_drift["trend"]
    check(abs(trend["value"] - 0.003) < 3.5 * trend["error"] and without["trend"] is None, trend)
    off = np.abs(values(with_drift) - [0.45, 1]) / [p["error"] for p in with_drift["parameters"]]
    check(np.all(off < 3.5), f"{off}")
    far = np.abs(values(without) - [0.45, 1]) / [p["error"] for p in without["parameters"]]
    check(np.max(far) > 5 and with_drift["residual"] < 0.5 * without["residual"], f"{far}")


def test_weights_by_a_column():
    # rows of weight 0 might as well not be there; weights alike change nothing
    rows = noisy(7, 0)
    weight = (np.arange(len(rows)) % 3 > 0).astype(float)
    wrong = rows.copy()
    wrong[weight == 0, 1] += 5
    np.savetxt("w.csv", np.c_[wrong, weight, 0 * weight + 2], delimiter=",", header="time,force,weight,two", comments="")
    np.savetxt("kept.txt", rows[weight > 0])
    words = " -fit_parameters friction_fc,model_m -fit_starts 1"
    weighted, kept = fit("-fit_data w.csv:time,force -fit_weights weight" + words), fit("-fit_data kept.txt" + words)
    for a, b in zip(weighted["parameters"], kept["parameters"]):
        # the search ends where the gradient is small, far below an error
        check(abs(a["value"] - b["value"]) < 1e-2 * b["error"] and abs(a["error"] / b["error"] - 1) < 1e-2, f"{a} {b}")
    np.savetxt("all.csv", np.c_[rows, 0 * weight + 2])
    alike, plain = fit("-fit_data all.csv:1,2 -fit_weights 3" + words), fit("-fit_data all.csv:1,2" + words)
    check(np.allclose(values(alike), values(plain), rtol=1e-9), f"{values(alike)} {values(plain)}")
    refused(BLOCK + "-fit_data w.csv:time,force -fit_weights wieght" + words, 2, "no column", "weight", command="fit")


def test_stiffness_and_friction_at_the_reference_are_fitted():
    scene = "-model_form chain -grid_n 1 -bc_left free -friction_law rate-and-state -model_m 1e-4 -model_v 1 -friction_psi0 1 " \
            "-friction_a 0.012 -friction_b 0.015 -friction_D 2 -init sliding -load_v 0:1,10:1,10:3,30:3 -ts_max_time 30 "
    run(scene + "-model_k0 0.03 -friction_mu0 0.62 -ts_rtol 1e-9 -out_file r.h5 -out_frames 101")
    np.savetxt("d.txt", np.c_[data("r.h5")["t"][1:], data("r.h5")["eta"][1:, 0]], fmt="%.15g")
    s = fit_of(scene + "-model_k0 0.04 -friction_mu0 0.6 -fit_data d.txt -fit_parameters model_k0,friction_mu0 -fit_starts 1")
    check(np.allclose(values(s), [0.03, 0.62], rtol=1e-4), f"{s['parameters']}")


def test_errors_count_the_parameters():
    """Each of N rows twice: squares of residuals and J^T J double, so that with n parameters errors fall by
    sqrt((N - n)/(2 N - n)); a billionth of time between two rows moves that by as much."""
    t = np.array([0.5, 1.2, 2, 3, 4.1, 5])
    y, errors = 0.4 + 0.1 * np.sin(t), []
    for times in (t, np.sort(np.concatenate([t, t + 1e-9]))):
        np.savetxt("rows.txt", np.stack([times, np.repeat(y, len(times) // len(t))], axis=1), fmt="%.17g")
        found, _ = run("-model_form chain -grid_n 1 -bc_left free -model_k0 0.5 -model_zeta 0.3 -model_v 0.5 -init_psi 0.2 -init_eta 0"
                       " -ts_max_time 6 -fit_data rows.txt -fit_of psi -fit_parameters model_zeta,model_k0 -fit_starts 1", command="fit")
        errors.append(np.array([p["error"] for p in found["parameters"]]))
    assert np.allclose(errors[1] / errors[0], np.sqrt((6 - 2) / (12 - 2)), rtol=1e-4)
