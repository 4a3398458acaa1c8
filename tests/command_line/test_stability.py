"""The commands spectrum and boundary from outside: keys, files, pictures, exit codes."""
import json
import os
import subprocess

import h5py
import numpy as np
import pytest

from calls import PROGRAM, SOURCE, check


def call(*args):
    done = subprocess.run([PROGRAM, *args, "-progress", "off"], capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout, done.stderr


def drawn(path):
    """plot.py makes a picture of the file."""
    done = subprocess.run(["/usr/bin/python3", os.path.join(SOURCE, "postprocess", "plot.py"), path], capture_output=True,
                          text=True)
    assert done.returncode == 0 and os.path.getsize(path[:-3] + ".png") > 5000, done.stderr


def test_spectrum():
    code, out, err = call("spectrum", "-model_v", "1", "-grid_n", "128", "-summary", "s.json", "-out_file", "s.h5")
    check(code == 0, f"spectrum ends with {code}: {err}")
    summary = json.load(open("s.json"))
    check(abs(summary["growth_rate"] + 0.1) < 1e-9 and summary["stable"] is True, "growth rate -delta/2 at v = 1")
    check(summary["complete"] is True and summary["dispersion_error"] < 1e-10, "complete, and on the dispersion relation")
    check(len(summary["eigenvalues"]) >= 12, "twelve eigenvalues")
    with h5py.File("s.h5") as file:
        check(file["psi_re"].shape[1] == 128 and np.all(np.isfinite(file["eta_im"][...])), "eigenvectors in the file")
    drawn("s.h5")


def test_non_normality():
    # non-normality: what grows for a while though sliding is stable, and the resolvent norm drawn
    scene = ("-model_form", "chain", "-grid_n", "400", "-model_v", "1.2", "-bc_left", "velocity", "-bc_left_value", "0.8",
             "-model_k1", "4")
    code, out, err = call("spectrum", *scene, "-spectrum_transient", "true", "-spectrum_pseudo", "8", "-summary", "n.json",
                          "-out_file", "n.h5")
    check(code == 0 and not err, f"transient growth ends with {code}: {err}")
    summary = json.load(open("n.json"))
    transient = summary["transient"]
    check(transient["method"] == "iteration" and transient["growth_is"] == "the maximum over time" and
          transient["growth"] > 1.4 and transient["numerical_abscissa"] > 0.2, f"transient growth: {transient}")
    check(0 < summary["kreiss"] <= transient["growth"], f"Kreiss's lower bound {summary['kreiss']}")
    with h5py.File("n.h5") as file:
        distance = np.abs(file["pseudo_re"][...][None, :, None] + 1j * file["pseudo_im"][...][:, None, None] -
                          (file["re"][...] + 1j * file["im"][...])[None, None, :]).min(axis=2)
        norm = 10 ** file["log10_resolvent"][...]
        check(norm.shape == (8, 8) and np.all(norm * distance > 0.999), "the resolvent norm is at least 1/distance")
    drawn("n.h5")


def test_an_eigenvector_as_a_start():
    call("spectrum", "-model_v", "1", "-grid_n", "128", "-out_file", "s.h5")
    # an eigenvector as a start: it decays at its growth rate
    code, out, err = call("run", "-model_v", "1", "-grid_n", "128", "-init_type", "file", "-init_file", "s.h5",
                          "-init_amplitude", "1e-4", "-ts_max_time", "20", "-ts_rtol", "1e-9", "-ts_atol", "1e-12",
                          "-summary", "r.json", "-out_file", "r.h5")
    check(code == 0, f"run from an eigenvector ends with {code}: {err}")
    with h5py.File("r.h5") as file:
        energy = np.hypot(file["psi"][...] - 1, 3 * (file["eta"][...] + 2 / 3)).max(axis=1)
        check(0.8 < energy[-1] / energy[0] / np.exp(-0.1 * 20) < 1.25, "the eigenvector decays like exp(-0.1 t)")


def test_a_run_follows_a_mode_of_spread_friction():
    # with spread friction: the run follows exp(lambda t), rate and frequency
    scene = ("-model_form", "chain", "-grid_n", "60", "-model_v", "0.7", "-friction_spread", "0.3", "-model_zeta", "0.2",
             "-bc_left", "free")
    call("spectrum", *scene, "-out_file", "e.h5")
    code, out, err = call("run", *scene, "-init_type", "file", "-init_file", "e.h5", "-init_amplitude", "1e-6",
                          "-ts_max_time", "10", "-ts_rtol", "1e-10", "-ts_atol", "1e-15", "-out_file", "er.h5")
    check(code == 0, f"run from an eigenvector of spread friction ends with {code}: {err}")
    with h5py.File("e.h5") as e, h5py.File("er.h5") as file:
        shape, value = e["psi_re"][0] + 1j * e["psi_im"][0], complex(e["re"][0], e["im"][0])
        expected = 1e-6 * np.real(np.exp(value * file["t"][...])[:, None] * shape[None, :])
        error = np.abs(file["psi"][...] - e["steady_psi"][...] - expected).max() / np.abs(expected).max()
        check(error < 2e-3, f"the run leaves exp(lambda t) by {error}")


def test_figure_6_against_its_closed_form():
    code, out, err = call("boundary", os.path.join(SOURCE, "runs", "figure6-carlson-langer.yaml"), "-grid_n", "16",
                          "-boundary_of", "sliding", "-boundary_points", "20", "-out_file", "b.h5", "-summary", "b.json")
    check(code == 0, f"boundary ends with {code}: {err}")
    with h5py.File("b.h5") as file:
        error = np.abs(file["value2"][...] / file["closed_form_v"][...] - 1)
        check(len(error) > 15 and error.max() < 1e-8, "figure 6 agrees with its closed form to 1e-8")
        small = file["value"][...] < 3e-3
        slope = np.polyfit(np.log(file["value"][...][small]), np.log(file["value2"][...][small]), 1)[0]
        check(-0.3 < slope < -0.2, "slope about -1/4 at small k1")
    drawn("b.h5")


def test_boundary_refuses():
    one = ("-grid_n", "32", "-boundary_from", "0.5", "-boundary_to", "2")
    for args, expected, words in (
            (("-boundary_parameter", "modl_v"), 2, "model_v"), (("-boundary_parameter", "grid_n"), 2, "grid_n"),
            (("-boundary_parameter", "ts_max_time"), 1, "does not enter"),
            (("-boundary_parameter", "friction_b"), 1, "does not enter"),
            (("-boundary_parameter", "model_k1"), 1, "growth rate"),
            (("-boundary_parameter", "model_v", "-boundary_from", "1.5"), 1, "no boundary"),
            (("-boundary_parameter", "model_v", "-boundary_to", "0.5"), 2, "boundary_to"), ((), 2, "boundary_parameter")):
        code, out, err = call("boundary", *one, *args)
        check(code == expected and words in err and err.count("\n") == 1, f"{args}: exit {code}, {err}")


def test_a_jump_is_no_root():
    # A mode that leaves what the grid resolves makes the growth rate jump: no root; the true ones are counted at.
    code, out, err = call("boundary", "-boundary_parameter", "grid_length", "-boundary_from", "1", "-boundary_to", "100",
                          "-grid_n", "100", "-bc_left", "velocity", "-bc_left_value", "0.5", "-bc_right", "free",
                          "-model_v", "1.05", "-summary", "j.json")
    points = json.load(open("j.json"))["points"]
    check(code == 0 and "jumps through zero" in err and len(points) == 2, f"a jump is no root: {code}, {err}")
    check(all(abs(p["growth_rate"]) < 1e-9 for p in points), "the growth rate vanishes at every root")


def test_a_curve_along_which_the_leading_mode_changes():
    # A curve along which the leading mode changes many times: no growing mode is missed at any point.
    code, out, err = call("boundary", "-boundary_parameter", "model_delta", "-boundary_from", "0", "-boundary_to", "1",
                          "-boundary_parameter2", "model_v", "-boundary_from2", "0.7", "-boundary_to2", "1.1", "-grid_n",
                          "128", "-boundary_points", "12", "-bc_left", "velocity", "-bc_left_value", "0.5", "-bc_right",
                          "free", "-summary", "c.json")
    points = json.load(open("c.json"))["points"]
    check(code == 0 and len(points) >= 12 and all(p["complete"] is True for p in points),
          f"curve with a held end: {code}, {err}, {[p['complete'] for p in points]}")


def test_trapped_modes_of_many_nodes():
    # A mode trapped at the held end, in a medium of many nodes: found, and nothing further right.
    for form in ("chain", "continuum"):
        code, out, err = call("spectrum", "-model_form", form, "-model_v", "0.9", "-grid_n", "9000", "-bc_left", "velocity",
                              "-bc_left_value", "0.5", "-bc_right", "free", "-friction_spread", "0.2",
                              *(("-model_zeta", "0.3") if form == "chain" else ("-grid_order", "2")), "-summary", "l.json")
        large = json.load(open("l.json"))
        expected = 0.00056084 if form == "chain" else 0.29984
        check(code == 0 and large["complete"] is True and abs(large["growth_rate"] - expected) < 1e-4,
              f"trapped mode of the {form}: {large['growth_rate']}, {large['completeness_check']}")


def test_no_steady_sliding():
    code, out, err = call("spectrum", "-model_v", "0", "-friction_law", "carlson-langer", "-grid_n", "32")
    check(code == 1 and "no steady sliding" in err, f"no steady sliding at v = 0 with a threshold: {code}, {err}")


@pytest.mark.parametrize("scene", ["-model_nu 1e300", "-model_nu 1e100", "-model_gamma 1e150 -model_nu 1"])
def test_rates_that_overflow(scene):
    """Where cubes of rates are not numbers, signs of growth rates would be wrong (all `unstable`, or `stable` in pieces)."""
    scene = [*scene.split(), "-friction_law", "rate-and-state", "-grid_n", "32"]
    for command in (["spectrum"], ["boundary", "-boundary_of", "sliding", "-boundary_parameter", "model_v",
                                   "-boundary_from", "0.5", "-boundary_to", "1.5"]):
        code, out, err = call(*command, *scene)
        check(code == 1 and "are too large to be computed with" in err and "stable" not in out + err, f"{code}, {out}{err}")


def test_verified_on_both_sides():
    # Time integration on both sides; a damping method with long steps is not used, and the user is told.
    code, out, err = call("boundary", "-grid_n", "32", "-grid_length", "20", "-boundary_parameter", "model_v",
                          "-boundary_from", "0.5", "-boundary_to", "2", "-boundary_verify", "1", "-ts_type", "beuler",
                          "-ts_dt", "5", "-summary", "v.json")
    check(code == 0, f"verify ends with {code}: {err}")
    verified = json.load(open("v.json"))["verified"]
    check(len(verified) == 2 and [v["from_sliding"] for v in verified] == ["stick-slip", "sliding"],
          f"verified on both sides: {verified}")
    check("would hide the instability" in err, f"backward Euler is warned of: {err}")


def test_verified_scenes():
    # More scenes: what the unstable and the stable side come to, from perturbed sliding and from large stick-slip. A law
    # with a threshold keeps its stick-slip where sliding is stable again (hysteresis).
    chain = ("-model_form", "chain", "-boundary_parameter", "model_v", "-boundary_from", "0.05", "-boundary_to", "2",
             "-model_zeta", "0.3")
    held = ("-bc_left", "velocity", "-bc_left_value", "1.1", "-bc_right", "free")
    for words, stable_side, args in (
            ("printed sign", "sliding", ("-model_delta_sign", "printed", "-grid_n", "32", "-grid_length", "20",
                                         "-boundary_parameter", "model_v", "-boundary_from", "0.5", "-boundary_to", "2")),
            ("chain", "sliding", (*chain, "-grid_n", "16")), ("held end", "sliding", (*chain, "-grid_n", "16", *held)),
            ("hysteresis", "both live", (*chain, "-grid_n", "4", "-friction_law", "carlson-langer")),
            ("healing", "both live", (*chain, "-grid_n", "4", "-friction_law", "coulomb", "-state_law", "healing")),
            ("rate-and-state", "sliding", ("-model_form", "chain", "-grid_n", "8", "-friction_law", "rate-and-state",
                                           "-model_v", "0.1", "-boundary_parameter", "model_k0", "-boundary_from", "0.01",
                                           "-boundary_to", "10", "-boundary_log", "true"))):
        code, out, err = call("boundary", *args, "-boundary_of", "sliding", "-boundary_verify", "1", "-summary", "v.json")
        sides = json.load(open("v.json"))["verified"] if code == 0 else []
        check([(v["from_sliding"], v["regime"]) for v in sides] == [("stick-slip", "stick-slip"), ("sliding", stable_side)],
              f"time integration beside the boundary, {words}: {code}, {err}, {sides}")


def test_diagrams_against_their_closed_forms():
    # Every diagram of runs/ against its closed form. At v = 0 the curve v^2 = a^2 is vertical: there round-off of size e in
    # the other option, or in a^2, is sqrt(e) in v, so v^2 is what can be compared.
    for name in ("figure6-cubic", "figure6-carlson-langer", "figure6-equal-springs", "stability-gamma-v-derived",
                 "stability-gamma-v-printed", "stability-delta-v-derived", "stability-delta-v-printed"):
        code, out, err = call("boundary", os.path.join(SOURCE, "runs", name + ".yaml"), "-boundary_of", "sliding", "-grid_n", "16",
                              "-out_file", "d.h5")
        check(code == 0 and not err, f"{name} ends with {code}: {err}")
        with h5py.File("d.h5") as file:
            v, closed = file["value2"][...], np.abs(file["closed_form_v"][...])
            error = np.minimum(np.abs(np.abs(v) - closed) / np.maximum(1, closed), 1e4 * np.abs(v**2 - closed**2))
            check(len(v) > 50 and np.all(error < 1e-8), f"{name} leaves its closed form by {np.max(error)}")


def test_plain_models():
    # The plain models (1)-(3), without viscosity or damping: unstable for every |v| < 1 whatever the springs with the cubic
    # law, at every velocity with the other. There uniform stick-slip ends all the same, at a velocity that k1 does not change,
    # since its slip swings back through psi = 0 and then never rests; one warning says so of the whole curve.
    undamped = (os.path.join(SOURCE, "runs", "figure6-carlson-langer.yaml"), "-grid_n", "16", "-model_zeta", "0",
                "-summary", "p.json")
    code, out, err = call("boundary", *undamped, "-boundary_of", "sliding")
    low = float(err.split("stays between ")[-1].split()[0]) if "stays between" in err else -1
    check(code == 1 and low > 0, f"plain chain, Carlson-Langer: {code}, {err}")
    code, out, err = call("boundary", *undamped)
    points = json.load(open("p.json"))["points"]
    check(code == 0 and len(points) == 60, f"its stick-slip: {code}, {err}")
    check(all((p["of"], p["kind"]) == ("stick-slip", "pass") and abs(p["value2"] - 10.1166986) < 1e-6 for p in points),
          f"where its slips no longer rest: {points}")
    check(err.count("stickslip: warning:") == 1 and "goes on without rest" in err and "model_k1 = 1e-04 to " in err,
          f"one warning: {err}")
    for args in ((os.path.join(SOURCE, "runs", "figure6-cubic.yaml"), "-grid_n", "16", "-model_zeta", "0"),
                 (os.path.join(SOURCE, "runs", "stability-gamma-v-derived.yaml"), "-grid_n", "16", "-model_delta", "0")):
        code, out, err = call("boundary", *args, "-summary", "p.json", "-out_file", "p.h5")
        points = json.load(open("p.json"))["points"]
        check(code == 0 and len(points) > 20 and all(abs(p["value2"] - 1) < 1e-10 for p in points),
              f"plain model, cubic law: {code}, {err}")


def test_verified_with_stick():
    # A law with a threshold, blocks that stick: v_c = sqrt(f0/zeta) - 1, zeta = sqrt(0.1 m k1); above it both live
    code, out, err = call("boundary", "-model_form", "chain", "-model_zeta", "paper", "-friction_law", "carlson-langer",
                          "-grid_n", "16", "-boundary_parameter", "model_v", "-boundary_from", "0.5", "-boundary_to", "3",
                          "-boundary_of", "sliding", "-boundary_verify", "1", "-summary", "v.json")
    check(code == 0, f"verify with stick ends with {code}: {err}")
    found = json.load(open("v.json"))
    critical = (0.1 * 0.2) ** -0.25 - 1
    check(abs(found["points"][0]["value"] - critical) < 1e-9, f"v_c {found['points'][0]['value']}, not {critical}")
    check([v["from_sliding"] for v in found["verified"]] == ["stick-slip", "sliding"] and
          [v["from_stick_slip"] for v in found["verified"]] == ["stick-slip", "stick-slip"],
          f"verified with stick: {found['verified']}")


@pytest.mark.ranks
def test_small_grids_are_verified_without_messages():
    # Blocks that stick: a step of so small a grid is much shorter than the messages of one, of which these runs took 150000,
    # minutes where cores are shared. Every rank follows them on its own: some messages a point, and the same words.
    words = ["boundary", "-model_form", "chain", "-model_k0", "0.2", "-model_k1", "0.2", "-model_zeta", "paper",
             "-friction_law", "carlson-langer", "-grid_n", "16", "-boundary_parameter", "model_v", "-boundary_from", "0.1",
             "-boundary_to", "5", "-boundary_verify", "1", "-boundary_of", "sliding", "-summary", "v.json"]
    code, _, err = call(*words)
    check(code == 0, f"verify on one rank ends with {code}: {err}")
    one = json.load(open("v.json"))["verified"]
    done = subprocess.run(["mpirun", "-n", "2", PROGRAM, *words, "-log_view", ":log.txt"], capture_output=True, text=True)
    check(done.returncode == 0, f"verify on two ranks ends with {done.returncode}: {done.stderr}")
    check(json.load(open("v.json"))["verified"] == one, "the same on two ranks")
    reductions = [float(line.split()[2]) for line in open("log.txt") if line.startswith("MPI Reductions:")]
    check(len(reductions) == 1 and 0 < reductions[0] < 1000, f"reductions over two ranks: {reductions}")
