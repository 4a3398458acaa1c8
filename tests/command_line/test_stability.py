"""The commands spectrum and boundary from outside: keys, files, pictures, exit codes."""
import os

import numpy as np
import pytest

from calls import call, check, data, refused, run, scene_file, tool


def drawn(path):
    """plot.py makes a picture of the file."""
    done = tool("plot.py", path)
    assert done.returncode == 0 and os.path.getsize(path[:-3] + ".png") > 5000, done.stderr


def test_spectrum():
    summary, _ = run("-model_v 1 -grid_n 128 -out_file s.h5", command="spectrum")
    check(abs(summary["growth_rate"] + 0.1) < 1e-9 and summary["stable"] is True, "growth rate -delta/2 at v = 1")
    check(summary["complete"] is True and summary["dispersion_error"] < 1e-10, "complete, and on the dispersion relation")
    check(len(summary["eigenvalues"]) >= 12, "twelve eigenvalues")
    file = data("s.h5")
    check(file["psi_re"].shape[1] == 128 and np.all(np.isfinite(file["eta_im"])), "eigenvectors in the file")
    drawn("s.h5")


def test_an_eigenvector_as_a_start():
    # it decays at its growth rate
    run("-model_v 1 -grid_n 128 -out_file s.h5", command="spectrum")
    run("-model_v 1 -grid_n 128 -init_type file -init_file s.h5 -init_amplitude 1e-4 -ts_max_time 20 -ts_rtol 1e-9 "
        "-ts_atol 1e-12 -out_file r.h5")
    energy = np.hypot(data("r.h5")["psi"] - 1, 3 * (data("r.h5")["eta"] + 2 / 3)).max(axis=1)
    check(0.8 < energy[-1] / energy[0] / np.exp(-0.1 * 20) < 1.25, "the eigenvector decays like exp(-0.1 t)")


def test_a_run_follows_a_mode_of_spread_friction():
    # with spread friction: the run follows exp(lambda t), rate and frequency
    scene = "-model_form chain -grid_n 60 -model_v 0.7 -friction_spread 0.3 -model_zeta 0.2 -bc_left free "
    run(scene + "-out_file e.h5", command="spectrum")
    run(scene + "-init_type file -init_file e.h5 -init_amplitude 1e-6 -ts_max_time 10 -ts_rtol 1e-10 -ts_atol 1e-15 -out_file er.h5")
    e, file = data("e.h5"), data("er.h5")
    shape, value = e["psi_re"][0] + 1j * e["psi_im"][0], complex(e["re"][0], e["im"][0])
    expected = 1e-6 * np.real(np.exp(value * file["t"])[:, None] * shape[None, :])
    error = np.abs(file["psi"] - e["steady_psi"] - expected).max() / np.abs(expected).max()
    check(error < 2e-3, f"the run leaves exp(lambda t) by {error}")


def test_figure_6_against_its_closed_form():
    run(scene_file("figure6-carlson-langer") + " -grid_n 16 -boundary_of sliding -boundary_points 20 -out_file b.h5",
        command="boundary")
    value, value2, closed = (data("b.h5")[name] for name in ("value", "value2", "closed_form_v"))
    error, small = np.abs(value2 / closed - 1), value < 3e-3
    check(len(error) > 15 and error.max() < 1e-8, "figure 6 agrees with its closed form to 1e-8")
    slope = np.polyfit(np.log(value[small]), np.log(value2[small]), 1)[0]
    check(-0.3 < slope < -0.2, "slope about -1/4 at small k1")
    drawn("b.h5")


@pytest.mark.parametrize("words, code, part", [
    ("-boundary_parameter modl_v", 2, "model_v"), ("-boundary_parameter grid_n", 2, "grid_n"),
    ("-boundary_parameter ts_max_time", 1, "does not enter"), ("-boundary_parameter friction_b", 1, "does not enter"),
    ("-boundary_parameter model_k1", 1, "growth rate"), ("-boundary_parameter model_v -boundary_from 1.5", 1, "no boundary"),
    ("-boundary_parameter model_v -boundary_to 0.5", 2, "boundary_to"), ("", 2, "boundary_parameter")])
def test_boundary_refuses(words, code, part):
    refused("-grid_n 32 -boundary_from 0.5 -boundary_to 2 " + words, code, part, command="boundary")


def test_a_list_that_is_shorter_than_asked_for_says_so():
    # SLEPc's search about a few places reaches 22 of these 28 eigenvalues; none is missing among those
    scene = ("-model_form chain -grid_n 14 -model_v 0.318 -model_k0 0.773 -model_k1 1.47 -friction_spread 0.3 -spectrum_count 28 "
             "-spectrum_method ")
    some, all_of_them = (run(scene + method, command="spectrum")[0] for method in ("krylov", "dense"))
    listed = sum(1 + (e["im"] > 0) for e in some["eigenvalues"] if e["im"] >= 0)
    check((listed == 28) == (not some["warnings"]), some["warnings"])
    check(listed == 28 or f"{listed} of the 28 eigenvalues asked for" in some["warnings"][0], some["warnings"])
    values = np.array([[e["re"], e["im"]] for e in all_of_them["eigenvalues"]])
    found = np.array([[e["re"], e["im"]] for e in some["eigenvalues"]])
    check(some["list_complete"] and np.allclose(found, values[:len(found)], atol=1e-8), "the rightmost")


def test_a_curve_that_is_flat_over_most_of_the_range_has_its_point():
    # a brake, in its own units: friction falls up to 2 m/s and is flat from there on
    found, _ = run("-model_form chain -grid_n 1 -bc_left free -model_k0 4e4 -model_f0 1e3 -model_zeta 20 -friction_law table -friction_table "
                   "0:0.5,0.5:0.45,1:0.4,2:0.35,5:0.35 -boundary_parameter model_v -boundary_from 0.01 -boundary_to 50 -boundary_of sliding",
                   command="boundary")
    check([p["kind"] for p in found["points"]] == ["hopf"] and 1 < found["points"][0]["value"] < 2, found["points"])


def test_a_growth_rate_that_is_zero_throughout_has_no_boundary():
    # Neighbours with viscosity but no spring: short waves neither grow nor decay, at any velocity.
    words = ("-grid_n 32 -friction_stick regularised -friction_law coulomb -model_nu 2 -model_c 0 -bc_left free "
             "-boundary_of sliding -boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5 ")
    refused(words, 1, "growth rate 0 at model_v 0.5, 0 at 1.5", command="boundary")
    refused(words + "-boundary_parameter2 model_gamma -boundary_from2 1 -boundary_to2 4", 1, "between 0 and 0",
            command="boundary")


def test_a_jump_is_no_root():
    # A mode that leaves what the grid resolves makes the growth rate jump: no root; the true ones are counted at.
    found, said = run("-boundary_parameter grid_length -boundary_from 1 -boundary_to 100 -grid_n 100 -bc_left velocity "
                      "-bc_left_value 0.5 -bc_right free -model_v 1.05", command="boundary")
    points = found["points"]
    check("jumps through zero" in said and len(points) == 2, f"a jump is no root: {said}")
    check(all(abs(p["growth_rate"]) < 1e-9 for p in points), "the growth rate vanishes at every root")


def test_a_curve_along_which_the_leading_mode_changes():
    # A curve along which the leading mode changes many times: no growing mode is missed at any point.
    found, said = run("-boundary_parameter model_delta -boundary_from 0 -boundary_to 1 -boundary_parameter2 model_v "
                      "-boundary_from2 0.7 -boundary_to2 1.1 -grid_n 128 -boundary_points 12 -bc_left velocity "
                      "-bc_left_value 0.5 -bc_right free", command="boundary")
    complete = [p["complete"] for p in found["points"]]
    check(len(complete) >= 12 and all(one is True for one in complete), f"curve with a held end: {said}, {complete}")


def test_trapped_modes_of_many_nodes():
    # A mode trapped at the held end, in a medium of many nodes: found, and nothing further right.
    for form, expected in (("chain -model_zeta 0.3", 0.00056084), ("continuum -grid_order 2", 0.29984)):
        large, _ = run(f"-model_form {form} -model_v 0.9 -grid_n 9000 -bc_left velocity -bc_left_value 0.5 -bc_right free "
                       "-friction_spread 0.2", command="spectrum")
        check(large["complete"] is True and abs(large["growth_rate"] - expected) < 1e-4,
              f"trapped mode of the {form}: {large['growth_rate']}, {large['completeness_check']}")


def test_no_steady_sliding():
    refused("-model_v 0 -friction_law carlson-langer -grid_n 32", 1, "no steady sliding", command="spectrum")


@pytest.mark.parametrize("scene", ["-model_nu 1e300", "-model_nu 1e100", "-model_gamma 1e150 -model_nu 1"])
def test_rates_that_overflow(scene):
    """Where cubes of rates are not numbers, signs of growth rates would be wrong (all `unstable`, or `stable` in pieces)."""
    scene += " -friction_law rate-and-state -grid_n 32"
    for command, more in (("spectrum", ""), ("boundary", " -boundary_of sliding -boundary_parameter model_v -boundary_from 0.5 "
                                             "-boundary_to 1.5")):
        done = call(scene + more, command=command)
        check(done.returncode == 1 and "are too large to be computed with" in done.stderr and
              "stable" not in done.stdout + done.stderr, f"{done}")


def test_verified_on_both_sides():
    # Time integration on both sides; a damping method with long steps is not used, and the user is told.
    found, said = run("-grid_n 32 -grid_length 20 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 2 "
                      "-boundary_verify 1 -ts_type beuler -ts_dt 5", command="boundary")
    verified = found["verified"]
    check(len(verified) == 2 and [v["from_sliding"] for v in verified] == ["stick-slip", "sliding"],
          f"verified on both sides: {verified}")
    check("would hide the instability" in said, f"backward Euler is warned of: {said}")


IN_V = "-model_form chain -boundary_parameter model_v -boundary_from 0.05 -boundary_to 2 -model_zeta 0.3 -grid_n "


@pytest.mark.parametrize("stable_side, words", [
    ("sliding", "-model_delta_sign printed -grid_n 32 -grid_length 20 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 2"),
    ("sliding", IN_V + "16"), ("sliding", IN_V + "16 -bc_left velocity -bc_left_value 1.1 -bc_right free"),
    ("bistable", IN_V + "4 -friction_law carlson-langer"), ("bistable", IN_V + "4 -friction_law coulomb -state_law healing"),
    ("sliding", "-model_form chain -grid_n 8 -friction_law rate-and-state -model_v 0.1 -boundary_parameter model_k0 "
                "-boundary_from 0.01 -boundary_to 10 -boundary_log true")])
def test_verified_scenes(stable_side, words):
    # What the unstable and the stable side come to, from perturbed sliding and from large stick-slip. A law with a threshold
    # keeps its stick-slip where sliding is stable again (hysteresis).
    found, said = run(words + " -boundary_of sliding -boundary_verify 1", command="boundary")
    sides = [(v["from_sliding"], v["regime"]) for v in found["verified"]]
    check(sides == [("stick-slip", "stick-slip"), ("sliding", stable_side)], f"beside the boundary: {said}, {sides}")


def test_diagrams_against_their_closed_forms():
    # Every diagram of runs/ against its closed form. At v = 0 the curve v^2 = a^2 is vertical: there round-off of size e in
    # the other option, or in a^2, is sqrt(e) in v, so v^2 is what can be compared.
    for name in ("figure6-cubic", "figure6-carlson-langer", "figure6-equal-springs", "stability-gamma-v-derived",
                 "stability-gamma-v-printed", "stability-delta-v-derived", "stability-delta-v-printed"):
        _, said = run(scene_file(name) + " -boundary_of sliding -grid_n 16 -out_file d.h5", command="boundary")
        check(not said, f"{name}: {said}")
        v, closed = data("d.h5")["value2"], np.abs(data("d.h5")["closed_form_v"])
        error = np.minimum(np.abs(np.abs(v) - closed) / np.maximum(1, closed), 1e4 * np.abs(v**2 - closed**2))
        check(len(v) > 50 and np.all(error < 1e-8), f"{name} leaves its closed form by {np.max(error)}")


def test_plain_models():
    # The plain models (1)-(3), without viscosity or damping: unstable for every |v| < 1 whatever the springs with the cubic
    # law, at every velocity with the other. There uniform stick-slip ends all the same, at a velocity that k1 does not change,
    # since its slip swings back through psi = 0 and then never rests; one warning says so of the whole curve.
    undamped = scene_file("figure6-carlson-langer") + " -grid_n 16 -model_zeta 0"
    _, err = run(undamped + " -boundary_of sliding", code=1, command="boundary")
    low = float(err.split("stays between ")[-1].split()[0]) if "stays between" in err else -1
    check(low > 0, f"plain chain, Carlson-Langer: {err}")
    found, err = run(undamped, command="boundary")
    points = found["points"]
    check(len(points) == 60, f"its stick-slip: {err}")
    check(all((p["of"], p["kind"]) == ("stick-slip", "pass") and abs(p["value2"] - 10.1166986) < 1e-6 for p in points),
          f"where its slips no longer rest: {points}")
    check(err.count("stickslip: warning:") == 1 and "goes on without rest" in err and "model_k1 = 1e-04 to " in err,
          f"one warning: {err}")
    for name, more in (("figure6-cubic", "-model_zeta 0"), ("stability-gamma-v-derived", "-model_delta 0")):
        found, err = run(f"{scene_file(name)} -grid_n 16 {more} -out_file p.h5", command="boundary")
        points = found["points"]
        check(len(points) > 20 and all(abs(p["value2"] - 1) < 1e-10 for p in points), f"plain model, cubic law: {err}")


def test_verified_with_stick():
    # A law with a threshold, blocks that stick: v_c = sqrt(f0/zeta) - 1, zeta = sqrt(0.1 m k1); above it bistable
    found, _ = run("-model_form chain -model_zeta paper -friction_law carlson-langer -grid_n 16 -boundary_parameter model_v "
                   "-boundary_from 0.5 -boundary_to 3 -boundary_of sliding -boundary_verify 1", command="boundary")
    critical = (0.1 * 0.2) ** -0.25 - 1
    check(abs(found["points"][0]["value"] - critical) < 1e-9, f"v_c {found['points'][0]['value']}, not {critical}")
    check([v["from_sliding"] for v in found["verified"]] == ["stick-slip", "sliding"] and
          [v["from_stick_slip"] for v in found["verified"]] == ["stick-slip", "stick-slip"],
          f"verified with stick: {found['verified']}")


@pytest.mark.ranks
def test_small_grids_are_verified_without_messages():
    # Blocks that stick: a step of so small a grid is much shorter than the messages of one, of which these runs took 150000,
    # minutes where cores are shared. Every rank follows them on its own: some messages a point, and the same words.
    words = ("-model_form chain -model_k0 0.2 -model_k1 0.2 -model_zeta paper -friction_law carlson-langer -grid_n 16 "
             "-boundary_parameter model_v -boundary_from 0.1 -boundary_to 5 -boundary_verify 1 -boundary_of sliding ")
    one, _ = run(words, command="boundary")
    two, _ = run(words + "-log_view :log.txt", ranks=2, command="boundary")
    check(one["verified"] == two["verified"], "the same on two ranks")
    reductions = [float(line.split()[2]) for line in open("log.txt") if line.startswith("MPI Reductions:")]
    check(len(reductions) == 1 and 0 < reductions[0] < 1000, f"reductions over two ranks: {reductions}")
