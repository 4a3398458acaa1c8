"""Friction that the user brings: measured curves (friction_law table), and laws by the names of their fields: Stribeck,
tanh, slip weakening, Dieterich's logarithm, Perrin, Rice and Zheng's state law, LuGre and Dahl. Each against SciPy on random
scenes, and against closed forms."""
import glob
import json
import math
import subprocess

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import reference
from calls import PROGRAM, refused, run, scene_file
from reference import Curve, System, options

BLOCK = "-model_form chain -grid_n 1 -bc_left free"
STRICT = "-ts_rtol 1e-10 -ts_atol 1e-11"


def curve_text(points):
    return ",".join(f"{v!r}:{f!r}" for v, f in np.asarray(points, float).tolist())


def random_curve(rng, both=False, rest=True):
    """Points of random friction that rises and falls; of both directions, unlike each other."""
    speeds = np.concatenate([[0.] if rest else [], np.sort(rng.uniform(0.05, 3, rng.integers(2, 9)))])
    points = np.column_stack([speeds, rng.uniform(0.3, 1, len(speeds))])
    if both:
        speeds = -np.sort(-rng.uniform(0.05, 3, rng.integers(1, 9)))
        points = np.vstack([np.column_stack([-speeds, -rng.uniform(0.3, 1, len(speeds))]), points])
    return points


# ---- measured curves ----

def test_curves_are_scipys():
    """Between the points SciPy's monotone cubics, beside them what the option says, odd or of both directions."""
    rng = np.random.default_rng(3)
    for case in range(12):
        both, rest = case % 3 == 0, case % 3 != 1
        points = random_curve(rng, both, rest or both)
        beyond = "slope" if case % 2 else "constant"
        s, _ = run(f"-friction_law table -friction_table {curve_text(points)} -friction_table_beyond {beyond} -laws_from -4 "
                   "-laws_to 4 -laws_points 801", command="laws")
        psi, F = np.array(s["psi"]), np.array(s["table"])
        way = np.sign(psi)
        back = Curve(points * (-1 if both else 1), beyond == "slope")
        want = way * np.where(way < 0, back(-psi), Curve(points, beyond == "slope")(psi))
        np.testing.assert_allclose(F, want, rtol=1e-13, atol=1e-14)
        threshold = float(Curve(points, False)(0.))
        assert s["stick"] == {"table": [-threshold, threshold]}


def test_runs_with_random_curves():
    """A chain that slides both ways over random curves: eigenvalues, and the motion itself, with SciPy."""
    rng = np.random.default_rng(5)
    for both in (False, True):
        points = random_curve(rng, both)
        scene = (f"-model_form chain -grid_n 5 -model_k1 0.7 -model_zeta 0.3 -model_v {rng.uniform(0.5, 1.5)} -friction_law table "
                 f"-friction_stick regularised -friction_eps 0.3 -friction_table {curve_text(points)}")
        system = System(options(scene))
        got = run(scene + " -spectrum_count 10", command="spectrum")[0]["eigenvalues"]
        want = system.eigenvalues()
        for value in got:
            assert np.abs(want - complex(value["re"], value["im"])).min() < 1e-9 * np.abs(want).max()
        run(f"{scene} -init_psi -0.6 -init_noise 1 -ts_max_time 6 -out_frames 2 -out_file run.h5 {STRICT}")
        with h5py.File("run.h5") as f:
            fields = {name: f[name][:] for name in ("psi", "eta")}
        end = system.follow(reference.read(fields, 0), 0, 6, rtol=1e-11, atol=1e-12)
        assert np.abs(end - reference.read(fields, 1)).max() < 1e-7


def sampled(name, count):
    """Points of (1 + psi)^-1 up to psi = 4."""
    psi = np.linspace(0, 4, count)
    with open(name, "w", encoding="ascii") as file:
        file.write("# velocity, friction\n" + "".join(f"{v!r} {1 / (1 + v)!r}\n" for v in psi.tolist()))
    return f"-friction_law table -friction_table {name}"


def test_curves_of_an_analytic_law_converge_to_it():
    """Slopes err like h^2, friction like h^3: so do the boundary of sliding, a run, and a cycle with exact stick."""
    law = "-friction_law carlson-langer"
    scenes = {"boundary": (f"{BLOCK} -model_zeta 0.2 -boundary_parameter model_v -boundary_from 0.8 -boundary_to 2",
                           lambda s: s["points"][0]["value"], 2),
              "run": (f"{BLOCK} -model_v 0.5 -init_psi 1.1 -ts_max_time 1.5 {STRICT}", lambda s: s["psi_max"], 3),
              "cycle": (f"{BLOCK} -model_v 0.2 -model_k0 0.5", lambda s: s["period"], 3)}
    for command, (scene, value, order) in scenes.items():
        exact = value(run(f"{scene} {law}", command=command)[0])
        errors = [abs(value(run(f"{scene} {sampled('points.txt', n)}", command=command)[0]) - exact) for n in (21, 41, 81)]
        # halving h twice divides the error by 4^order; what depends on where points lie in a piece may cost a factor of 3
        assert errors[2] < 3 * errors[0] / 4**order and errors[2] < 1e-3, f"{command}: {errors}"


def test_what_needs_smooth_friction_says_so():
    scene = f"{BLOCK} -model_zeta 0.2 {sampled('points.txt', 30)}"
    s, _ = run(scene + " -boundary_parameter model_v -boundary_from 0.8 -boundary_to 2", command="boundary")
    assert s["points"][0]["criticality"] is None and s["points"][0]["lyapunov_coefficient"] is None
    s, _ = run(scene + " -model_v 0.5 -friction_stick regularised -friction_eps 0.2 -ts_max_time 3 -accuracy 1e-4")
    assert any("order 3" in warning for warning in s["warnings"]), s["warnings"]
    exact, _ = run(scene + f" -model_v 0.5 -friction_stick regularised -friction_eps 0.2 -ts_max_time 3 {STRICT}")
    assert abs(s["psi_mean"] - exact["psi_mean"]) < 1e-4


def test_a_curve_through_zero_has_no_threshold():
    """With force 0 at rest the curve is continuous there: against SciPy, and nothing ever sticks."""
    psi = np.linspace(0, 3, 31)
    points = np.column_stack([psi, 1.5 * psi / (1 + psi**2)])
    scene = f"-model_form chain -grid_n 3 -model_v 0.3 -friction_law table -friction_table {curve_text(points)}"
    run(f"{scene} -init_psi -0.5 -init_noise 0.7 -ts_max_time 8 -out_frames 2 -out_file run.h5 {STRICT}")
    with h5py.File("run.h5") as f:
        fields = {name: f[name][:] for name in ("psi", "eta")}
    end = System(options(scene)).follow(reference.read(fields, 0), 0, 8, rtol=1e-11, atol=1e-12)
    assert np.abs(end - reference.read(fields, 1)).max() < 1e-7
    refused(scene + " -friction_eps 0.1", 2, "friction_eps")


def test_a_curve_from_a_spreadsheet():
    """A byte order mark, commas and lines that end as Windows has them."""
    found = []
    for begin, comma, end in (("", " ", "\n"), ("\ufeff", ",", "\r\n")):
        with open("curve.csv", "w", encoding="utf-8", newline="") as file:
            file.write(begin + "".join(f"{v}{comma}{force}{end}" for v, force in ((0, 1), (1, 0.5), (3, 0.4))))
        found.append(run(f"{BLOCK} -friction_law table -friction_table curve.csv -model_v 0.5 -ts_max_time 3")[0]["psi_mean"])
    assert found[0] == found[1]


def test_a_run_carries_its_curve():
    """A restart needs no file, and refuses another curve."""
    run(f"{BLOCK} {sampled('points.txt', 9)} -ts_max_time 2 -out_file half.h5 -out_checkpoint_every 5")
    with open("points.txt", "w", encoding="ascii") as file:
        file.write("0 1\n1 0.9\n")
    checkpoint = sorted(glob.glob("half.chk-*.h5"))[-1]
    refused(f"-restart {checkpoint} -ts_max_time 3 -friction_table points.txt", 2, "friction_table")
    more, _ = run(f"-restart {checkpoint} -ts_max_time 3")
    at_once, _ = run(f"{BLOCK} {sampled('points.txt', 9)} -ts_max_time 3")
    assert abs(more["psi_mean"] - at_once["psi_mean"]) < 1e-6


@pytest.mark.parametrize("content, parts", [
    ("0 1\n1 0.5\n0.7 0.4\n", (":3", "ascend")), ("0 1\n1e-170 0.9\n1 0.5\n", ("too close together",)),
    ("0 1\n1 0.5\n1 0.4\n", (":3", "each once")), ("# one\n0 1\n", (":2", "one point")),
    ("0 1\n1 nan\n", (":2", "finite")), ("velocity,0\n0,1\n1,0.5\n", (":1, column 1", "words alone is a header")), ("0 1\n\n1 -0.5\n", (":3", "-0.5")), ("0 1\n1 0.5 3\n", (":2", "columns")),
    ("", ("no row has numbers",)), ("\x00\x7f\x01 \x02\n", (":1", "no text")), ("-1 -0.5\n1 0.5\n", (":2", "rest")),
    ("-1 0.5\n0 1\n1 0.5\n", (":1", "sign")), ("-1 -0.5\n0 1\n", (":2", "positive")), (None, ("cannot be read",)),
    ("0 1\n1 0.5\n1.0000000000001 0.4\n2 0.3\n", ("too close",))])
def test_bad_curves(content, parts):
    if content is not None:
        with open("bad.txt", "w", encoding="latin-1") as file:
            file.write(content)
    refused(f"{BLOCK} -friction_law table -friction_table bad.txt", 2, "friction_table", "bad.txt", *parts)


def test_wrong_use():
    refused(f"{BLOCK} -friction_law table", 2, "friction_table", "file of two columns")
    refused(f"{BLOCK} -friction_law table -friction_table 0:1,1:0.4,0.5:2", 2, "friction_table", "ascending")
    refused(f"{BLOCK} -friction_law table -friction_table 0:1,1:-0.4", 2, "friction_table", "point 2", "sign")
    refused(f"{BLOCK} -friction_table 0:1,1:0.4", 2, "friction_table")
    refused(f"{BLOCK} -friction_law stribeck -friction_p 0.5", 2, "friction_p")
    refused(f"{BLOCK} -friction_law slip-weakening -friction_fd 2", 2, "friction_fd")
    refused(f"{BLOCK} -friction_law lugre -friction_fc 0", 2, "friction_fc")
    refused(f"{BLOCK} -friction_law tanh -state_law healing", 2, "state_law")
    refused(f"{BLOCK} -friction_law slip-weakening -state_law ageing", 2, "state_law")


@pytest.mark.parametrize("start, least", [("-init_psi -0.3", "-0.3"), ("-init_psi 0", "0"), ("-init_psi 1 -init_noise 2", "-")])
def test_a_start_beyond_the_plain_logarithm(start, least):
    refused(f"-model_form chain -grid_n 4 -friction_law dieterich -state_law slip {start}", 2, "dieterich", "psi > 0", f"psi = {least}")


def test_the_plain_logarithm_says_where_it_ends():
    """A steady state with eta = 0 pulls no block forwards: psi falls through 0."""
    refused(f"{BLOCK} -friction_law dieterich -init_psi 1 -init_eta -5 -model_k0 1 -model_zeta 0 -ts_type rk -ts_dt 0.1 -ts_adapt_type none",
            1, "dieterich", "psi > 0")


def test_the_scene_of_a_measured_curve():
    """The curve beside the scene is found from any folder; the block sticks and slips."""
    s, _ = run(scene_file("measured-curve") + " -out_file run.h5")
    assert s["regime"] == "stick-slip"


# ---- laws by name ----

def random_scene(law, rng, n):
    """A chain with random parameters of the law, without exact stick."""
    a, b = 10**rng.uniform(-1.5, -0.7, 2)
    of = {"stribeck": {"fc": rng.uniform(0.2, 0.8), "fs": rng.uniform(0.8, 1.4), "vs": rng.uniform(0.3, 1.5), "p": rng.uniform(1, 3),
                       "viscous": rng.uniform(0, 0.2), "stick": "regularised", "eps": rng.uniform(0.1, 0.4)},
          "tanh": {"fc": rng.uniform(0.2, 0.8), "vs": rng.uniform(0.3, 1.5)},
          "slip-weakening": {"fs": rng.uniform(0.8, 1.4), "fd": rng.uniform(0.2, 0.7), "Dc": rng.uniform(0.5, 2),
                             "stick": "regularised", "eps": rng.uniform(0.1, 0.4)},
          "dieterich": {"a": a, "b": b, "D": rng.uniform(0.3, 1)},
          "lugre": {"fc": rng.uniform(0.3, 0.8), "fs": rng.uniform(0.8, 1.4), "vs": rng.uniform(0.3, 1.5),
                    "sigma0": rng.uniform(3, 20), "sigma1": rng.uniform(0, 0.4), "sigma2": rng.uniform(0, 0.2)},
          "dahl": {"fc": rng.uniform(0.3, 0.8), "sigma0": rng.uniform(3, 20)}}[law]
    scene = {"model_form": "chain", "grid_n": n, "model_m": rng.uniform(0.5, 2), "model_k0": rng.uniform(0.2, 1),
             "model_k1": rng.uniform(0.2, 1), "model_zeta": rng.uniform(0, 0.3), "model_v": rng.uniform(0.3, 1.5),
             "friction_law": law} | {f"friction_{name}": value for name, value in of.items()}
    if law == "slip-weakening":
        scene["state_t_h"] = rng.uniform(0.5, 3)
    if law == "dieterich":
        scene["state_law"] = str(rng.choice(["ageing", "slip", "prz"]))
    return scene


LAWS = ("stribeck", "tanh", "slip-weakening", "dieterich", "lugre", "dahl")


@pytest.mark.parametrize("law", LAWS)
def test_laws_by_name_agree_with_scipy(law):
    """Eigenvalues of sliding, and a motion; friction that starts again from other values in between."""
    rng = np.random.default_rng([7, LAWS.index(law)])
    for _ in range(3):
        scene = random_scene(law, rng, 4)
        system, words = System(scene), " ".join(reference.words(scene))
        got = run(words + " -spectrum_count 12", command="spectrum")[0]["eigenvalues"]
        want = system.eigenvalues()
        for value in got:
            assert np.abs(want - complex(value["re"], value["im"])).min() < 1e-9 * np.abs(want).max(), words
        start = "" if law == "dieterich" else " -init_psi -0.4"  # the logarithm knows psi > 0 alone
        run(f"{words}{start} -init_eta steady -init_noise {0.1 if law == 'dieterich' else 0.5} -ts_max_time 5 -out_frames 2 -out_file run.h5 {STRICT}")
        with h5py.File("run.h5") as f:
            fields = {name: f[name][:] for name in f if name in ("psi", "eta", *reference.STORED)}
        end = system.follow(reference.read(fields, 0), 0, 5, rtol=1e-11, atol=1e-12)
        assert np.abs(end - reference.read(fields, 1)).max() < 1e-6, words


WEAKENING = {"stribeck": ("model_v", 0.2, 3), "slip-weakening": ("model_v", 0.05, 3), "dieterich": ("model_k0", 1e-3, 1),
             "lugre": ("model_v", 0.05, 3)}  # the laws that let sliding become unstable, and an option that does it


@pytest.mark.parametrize("law", WEAKENING)
def test_boundaries_of_laws_by_name_agree_with_scipy(law):
    """Of random chains: where the rightmost eigenvalue of a dense matrix passes zero."""
    rng = np.random.default_rng([11, LAWS.index(law)])
    option, low, high = WEAKENING[law]
    values, met = np.geomspace(low, high, 25), 0
    while met < 2:
        scene = random_scene(law, rng, 4)

        def growth(value, scene=scene):
            return System(scene | {option: float(value)}).eigenvalues()[0].real
        signs = np.sign([growth(value) for value in values])
        changes = np.flatnonzero(signs[1:] != signs[:-1])
        if len(changes) == 0:
            continue
        met += 1
        got, _ = run(f"{' '.join(reference.words(scene))} -boundary_parameter {option} -boundary_from {low} -boundary_to {high} -boundary_of sliding",
                     command="boundary")
        want = [brentq(growth, values[i], values[i + 1], xtol=1e-14) for i in changes]
        # an error of 1e-12 in an eigenvalue of order 1, over its slope in the option
        np.testing.assert_allclose([point["value"] for point in got["points"]], want, rtol=1e-8, err_msg=str(scene))


@pytest.mark.parametrize("law", WEAKENING)
def test_cycles_of_laws_by_name_agree_with_scipy(law):
    """Of random blocks without exact stick: SciPy, from a point of the cycle on, comes back after its period, and the matrix of
    that period has its multipliers."""
    rng = np.random.default_rng([13, LAWS.index(law)])
    option, low, high = WEAKENING[law]
    met = 0
    while met < 2:
        scene = random_scene(law, rng, 1)
        del scene["model_k1"]
        values = np.geomspace(low, high, 25)
        rightmost = [System(scene | {option: float(value)}).eigenvalues()[0] for value in values]
        unstable = [i for i, value in enumerate(rightmost) if value.real > 0 and value.imag != 0]
        if not unstable or unstable[-1] == len(values) - 1:
            continue
        scene[option] = float(values[unstable[-1]])  # just beyond the boundary
        met += 1
        found, _ = run(" ".join(reference.words(scene)) + " -out_file c.h5", command="cycle")
        with h5py.File("c.h5") as f:
            start = reference.read({name: f[name][:] for name in f if name in ("psi", "eta", *reference.STORED)}, 0)
        end, matrix = System(scene).carried(start, found["period"])
        scale = 1 + np.abs(start).max()
        assert np.abs(end - start).max() < 1e-6 * scale, scene
        known = np.linalg.eigvals(matrix)
        for one in found["multipliers"]:
            assert np.abs(known - complex(one["re"], one["im"])).min() < 1e-5, scene


def test_friction_that_only_rises_keeps_sliding_stable():
    for law in ("tanh", "dahl"):
        scene = random_scene(law, np.random.default_rng(17), 4)
        refused(f"{' '.join(reference.words(scene))} -boundary_parameter model_v -boundary_from 0.05 -boundary_to 3 -boundary_of sliding",
                1, "no boundary", command="boundary")
        assert all(System(scene | {"model_v": v}).eigenvalues()[0].real < 1e-12 for v in np.linspace(0.05, 3, 20))


def test_exact_stick_of_laws_by_name():
    """Stick-slip of a block: the slip by SciPy from the threshold to rest, the time at rest in closed form."""
    for law in ("-friction_law stribeck -friction_fs 1.2 -friction_fc 0.4 -friction_vs 0.3 -friction_viscous 0.1",
                "-friction_law stribeck -friction_p 1 -friction_vs 0.5",
                "-friction_law table -friction_table 0:1,0.2:0.8,0.5:0.6,1:0.5,2:0.55",
                "-friction_law slip-weakening -friction_Dc 0.4 -state_t_h 3",
                "-friction_law slip-weakening -friction_Dc 0.4 -state_t_h 3 -friction_weakening linear"):
        scene = f"{BLOCK} -model_v 0.05 -model_k0 0.8 {law}"
        cycle, _ = run(scene, command="cycle")
        system = System(options(scene))
        threshold, v, stiff = system.law.threshold, 0.05, 0.8
        system.going = np.array([1.])
        has_state = system.kinds == 3
        s = 0.
        for _ in range(60 if has_state else 1):  # the slip that contacts remember settles
            slip = solve_ivp(system.rates, (0, 1e3), [0, float(threshold(s)), s][:system.kinds], method="DOP853", rtol=1e-12, atol=1e-13,
                             events=stops, max_step=0.05)
            u, time = slip.y_events[0][1] if slip.t_events[0][0] == 0 else slip.y_events[0][0], slip.t_events[0][-1]
            # at rest eta rises at k0 v until the threshold, which rises as slip is forgotten
            memory = float(u[2]) if has_state else 0.

            def at(t, memory=memory):
                return memory * math.exp(-t / 3)
            rest = brentq(lambda t: u[1] + stiff * v * t - float(threshold(at(t))), 0, 1e3, xtol=1e-13)
            s, before = at(rest), s
            if abs(s - before) < 1e-12:
                break
        assert abs(cycle["period"] - (time + rest)) < 1e-7 * cycle["period"], law


def stops(t, u):
    return u[0] if t > 1e-3 else 1.


stops.terminal, stops.direction = True, -1


def test_boundaries_in_closed_form():
    """Stribeck: B + F'(v) = 0. Rate-and-state: with small m the critical stiffness (b - a)/D, of prz too."""
    s, _ = run(f"{BLOCK} -model_zeta 0.3 -friction_law stribeck -friction_fs 1.1 -friction_fc 0.4 -friction_vs 0.7 -boundary_parameter model_v "
               "-boundary_from 0.6 -boundary_to 3 -boundary_of sliding", command="boundary")
    want = brentq(lambda v: 0.3 - 0.7 * 2 * v / 0.7**2 * math.exp(-(v / 0.7)**2), 0.6, 3, xtol=1e-14)
    assert abs(s["points"][0]["value"] - want) < 1e-9
    for law in ("dieterich", "rate-and-state"):
        for state in ("ageing", "slip", "prz"):
            m, D, a, b, v = 1e-2, 0.5, 0.02, 0.05, 0.3
            s, _ = run(f"{BLOCK} -friction_law {law} -state_law {state} -friction_a {a} -friction_b {b} -friction_D {D} -model_v {v} "
                       f"-model_m {m} -boundary_parameter model_k0 -boundary_from 0.01 -boundary_to 0.2 -boundary_of sliding", command="boundary")
            # Rice and Ruina 1983: (b - a)/D [1 + m v^2/(a D)]; what asinh changes of it is below exp(-2 mu0/a) = 1e-26
            want = (b - a) / D * (1 + m * v**2 / (a * D))
            assert abs(s["points"][0]["value"] - want) < 1e-9 * want, (law, state)


def test_steady_friction():
    psi = np.linspace(0.1, 3, 9)
    a, b, mu0 = 0.05, 0.1, 0.6
    laws = {"stribeck -friction_viscous 0.1": 0.5 + 0.5 * np.exp(-psi**2) + 0.1 * psi, "tanh": 0.5 * np.tanh(psi),
            "dieterich": mu0 + (a - b) * np.log(psi), "dieterich -state_law prz": mu0 + (a - b) * np.log(psi),
            "lugre -friction_sigma2 0.2": 0.5 + 0.5 * np.exp(-psi**2) + 0.2 * psi, "dahl": np.full(9, 0.5),
            "slip-weakening -state_t_h 2": 0.5 + 0.5 * np.exp(-2 * psi)}
    for law, want in laws.items():
        s, _ = run(f"-friction_law {law} -laws_from 0.1 -laws_to 3 -laws_points 9", command="laws")
        np.testing.assert_allclose(s[law.split()[0]], want, rtol=1e-13)


def test_dahls_loop():
    """A block led to and fro by a stiff spring: F along the path is fc (1 - (1 + F0/fc) exp(-sigma0 x/fc)), of each branch."""
    fc, sigma0, period, reach = 0.6, 15., 40., 0.2
    scene = (f"{BLOCK} -friction_law dahl -friction_fc {fc} -friction_sigma0 {sigma0} -model_m 1e-3 -model_k0 500 -model_zeta 1 -model_v 0 "
             f"-load_sine_amplitude {reach * 2 * math.pi / period} -load_sine_period {period} -ts_max_time {3 * period} -ts_rtol 1e-9 -ts_atol 1e-12 "
             "-init_psi 0 -init_eta 0 -out_frames 1201 -out_file loop.h5")
    run(scene)
    with h5py.File("loop.h5") as f:
        t, psi, z = f["t"][:], f["psi"][:, 0], f["z"][:, 0]
    F = sigma0 * z
    # along each stretch of one direction ln(1 -+ F/fc) falls by sigma0/fc times the path
    for begin in range(len(t) - 400, len(t) - 1):
        way = np.sign(psi[begin])
        if way == 0 or np.sign(psi[begin + 1]) != way:
            continue
        # path from one frame to the next by the mean and the trapezoid's correction (Simpson needs a midpoint): of order dt^3
        path = abs(psi[begin] + psi[begin + 1]) / 2 * (t[begin + 1] - t[begin])
        want = way * fc * (1 - (1 - way * F[begin] / fc) * math.exp(-sigma0 / fc * path))
        assert abs(F[begin + 1] - want) < 2e-4
    assert F[-400:].max() < fc and F[-400:].max() > 0.97 * fc and abs(F[-400:].max() + F[-400:].min()) < 1e-3


def test_a_fall_that_is_all_but_over_at_the_end_of_a_table():
    """It is none: neither the motion nor the memory differ from those of a force that stays (both are of buckets as narrow as what
    they tell apart)."""
    found = []
    for beyond in ("constant", "slope"):
        command = [PROGRAM, *f"run {BLOCK} -friction_law table -friction_table 0:1,1:0.5,2:1e-9 -friction_table_beyond {beyond} -model_v 0.5 "
                   "-ts_max_time 20 -summary s.json -progress off".split()]
        done = subprocess.run(["bash", "-c", 'ulimit -v 4000000; exec "$@"', "-", *command], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        with open("s.json", encoding="utf-8") as file:
            found.append(json.load(file))
    assert found[0]["steps"] == found[1]["steps"] and found[0]["psi_mean"] == found[1]["psi_mean"]
