"""Profiles along x from the command line: against a solver of its own in numpy and scipy, which knows nothing of the
program; closed limits; bits where a profile is constant; files, restart and what is refused."""
import math
import os

import numpy as np
import pytest
from scipy.optimize import brentq

from calls import check, data, refused, run
from reference import System, options, read, words

RATE = "-friction_law rate-and-state "
LINE = "-model_form chain -bc_left free -model_k0 0.3 -model_k1 0.7 -model_zeta 0.1 "


def pairs(x, values):
    return ",".join(f"{float(a)!r}:{float(b)!r}" for a, b in zip(x, values))


def matched(found, exact):
    """The largest distance of an eigenvalue found to the nearest of the exact ones that are left."""
    left, worst = list(exact), 0.0
    for z in found:
        k = int(np.argmin(np.abs(np.array(left) - z)))
        worst = max(worst, abs(left.pop(k) - z))
    return worst


def random_chain(seed, n=7, **more):
    """Rate-and-state friction between free ends with parameters of every block, as options by name."""
    draw = np.random.default_rng(seed).uniform
    drawn = [draw(low, high, n) for low, high in ((0.1, 0.9), (0.3, 0.6), (0.2, 0.4), (0.5, 1.5))]
    p = options(LINE + RATE + f"-grid_n {n} -model_v {float(draw(0.3, 0.8))!r}") | more
    return p | dict(zip(("friction_b", "friction_D", "friction_a", "friction_amplitude"), drawn))


@pytest.mark.parametrize("seed", (1, 2))
def test_spectrum_is_the_dense_matrix(seed):
    # every parameter at once; the condition of these matrices is below 1e3, so that 1e-10 is far above round-off
    p = random_chain(seed)
    s, _ = run(words(p | {"spectrum_count": 21, "spectrum_method": "dense"}), command="spectrum")
    found, exact = [complex(e["re"], e["im"]) for e in s["eigenvalues"]], System(p).eigenvalues()
    check(len(found) == 21, f"{len(found)} eigenvalues of 21")
    worst = matched(found, exact)
    check(worst < 1e-10, f"eigenvalues differ by {worst}")
    check(abs(s["growth_rate"] - exact[0].real) < 1e-10, "growth rate")
    check(abs(s["steady"]["psi_min"] - p["model_v"]) < 1e-14 and abs(s["steady"]["psi_max"] - p["model_v"]) < 1e-14,
          "steady sliding is not uniform in psi")


def test_blocks_alone():
    # without coupling every block is a uniform scene of its own: the spectrum is the union of theirs
    p = random_chain(3, 4, model_k1=0)
    s, _ = run(words(p | {"spectrum_count": 12, "spectrum_method": "dense"}), command="spectrum")
    exact = []
    for i in range(4):
        one = {name: float(value[i]) if isinstance(value, np.ndarray) else value for name, value in p.items()}
        exact += list(System(one | {"grid_n": 1}).eigenvalues())
    worst = matched([complex(e["re"], e["im"]) for e in s["eigenvalues"]], exact)
    check(worst < 1e-10, f"not the union of the blocks' own: {worst}")


def test_boundary_with_a_factor():
    # the factor on b at which the largest real part of the matrix passes zero
    drawn = random_chain(4)
    p = drawn | {"friction_D": float(drawn["friction_D"][0]), "friction_a": float(drawn["friction_a"][0]), "friction_amplitude": 1.}

    def growth(factor):
        return System(p | {"friction_b": factor * p["friction_b"]}).eigenvalues()[0].real
    exact = brentq(growth, 0.2, 4, xtol=1e-12)
    del p["friction_amplitude"]
    s, _ = run([*words(p), "-boundary_parameter", "friction_b_factor", "-boundary_from", 0.2, "-boundary_to", 4], command="boundary")
    check(len(s["points"]) == 1 and abs(s["points"][0]["value"] - exact) < 1e-7 * exact, f"{s['points']}, by numpy {exact}")


@pytest.mark.parametrize("method", ("", "-ts_type rk", "-ts_type arkimex -imex_implicit both", "-ts_type bdf -ts_rtol 1e-11 -ts_atol 1e-11", "-rk_fused false"))
def test_run_against_scipy(method):
    p = random_chain(5)
    run(words(p | {"init_psi": 0.4, "init_eta": 0.5, "init_state": 0.7, "ts_max_time": 8}) +
        f"-ts_rtol 1e-9 -ts_atol 1e-9 -out_file run.h5 -out_frames 2 {method}".split())
    found = data("run.h5")
    exact = System(p).follow(np.repeat([0.4, 0.5, np.log(0.7)], 7), 0, 8, rtol=1e-11, atol=1e-12)
    error = np.abs(read(found, -1) - exact).max()
    check(error < 2e-6, f"{method}: {error}")
    for name in ("friction_a", "friction_b", "friction_D", "friction_amplitude"):
        check(np.allclose(found[name], p[name], rtol=1e-14), f"{name} is not in the file")


CONSTANT = {"rate-and-state": (RATE + "-model_v 0.5 -init_type sine", "friction_b", "0.1"),
            "slip, implicit": (RATE + "-state_law slip -init_type sine -ts_type arkimex", "state_D", "0.1"),
            "exact stick": ("-model_form chain -friction_law coulomb -grid_n 24 -init_noise 0.3", "friction_fd", "0.5"),
            "stick with healing": ("-friction_law carlson-langer -state_law healing -init_noise 0.3", "state_t_h", "1"),
            "regularised, implicit": ("-friction_law carlson-langer -friction_stick regularised -init_type sine "
                                      "-ts_type arkimex -imex_implicit friction", "friction_alpha", "0.5"),
            "library's steps": (RATE + "-rk_fused false -ts_type rk -friction_a 0.3 -friction_D 1 -init_type sine", "friction_b", "0.1")}


@pytest.mark.parametrize("name", CONSTANT)
def test_constant_profile_is_none(name):
    # the same bits from other loops
    options, parameter, value = CONSTANT[name]
    options = f"-grid_n 40 {options} -ts_max_time 1.5 -scene_reduce off -out_frames 4 "
    run(options + "-out_file none.h5")
    run(options + f"-{parameter}_profile 0:{value} -out_file constant.h5")
    one, other = data("none.h5"), data("constant.h5")
    for field in set(one) & {"t", "psi", "eta", "theta", "tau"}:
        check(np.array_equal(one[field], other[field]), f"{name}: {field} differs")


def test_a_cycle_is_what_scipy_integrates():
    # three unlike blocks, collocation against DOP853 and its variational equations
    scene = (LINE.replace("-model_k0 0.3 -model_k1 0.7", "-model_k0 2.5 -model_k1 0.5") + RATE + "-grid_n 3 -model_v 0.5 "
             "-friction_a_profile 0:0.3,1:0.25,2:0.3 -friction_b_profile 0:0.9,1:0.8,2:0.95 "
             "-friction_D_profile 0:0.5,1:0.4,2:0.45 -friction_amplitude_profile 0:1,1:0.8,2:1.2 ")
    found, _ = run(scene + "-cycle_cell 0 -init_psi 0.5 -init_eta steady -init_noise 0.2 -out_file cycle.h5", command="cycle")
    # the motion comes near itself after seven turns first: that is seven times the cycle
    check(abs(found["period"] - 5.599934880) < 1e-8, f"period {found['period']}")
    start = read(data("cycle.h5"), 0)
    end, matrix = System(scene).carried(start, found["period"], rtol=1e-7, atol=1e-9)
    check(np.abs(end - start).max() < 1e-5, f"the cycle misses itself by {np.abs(end - start).max()}")
    worst = matched([complex(m["re"], m["im"]) for m in found["multipliers"]], np.linalg.eigvals(matrix))
    check(worst < 1e-4, f"multipliers differ by {worst}")
    refused(scene, 2, "cycle_cell 1", "no cell repeats", command="cycle")


def test_first_to_slip():
    # all at rest without force: a block begins to slip when K0 v t is its own threshold, the weakest first
    thresholds = [0.9, 0.7, 0.5, 0.8]
    run("-model_form chain -bc_left free -grid_n 4 -friction_law coulomb -friction_fd 0.3 -model_k0 0.4 -model_v 0.1 "
        f"-friction_fs_profile {pairs(range(4), thresholds)} -init_psi 0 -init_eta 0 -ts_max_time 13 "
        "-out_times 12.4,12.6 -out_file stick.h5")
    found = data("stick.h5")
    moving = found["series/t"][np.argmax(found["series/psi_max"] > 0) - 1]
    check(abs(moving - 0.5 / (0.4 * 0.1)) < 1e-9, f"slips at {moving}")
    check(not found["psi"][0].any() and list(np.flatnonzero(found["psi"][1])) == [2], f"another slips: {found['psi']}")


def test_kinds_and_file():
    # linear, smooth and step at the nodes, from a file of two columns; a restart does not read the file again
    x = np.arange(0, 60, 60 / 48)
    values = {"linear": np.interp(x, [10, 20, 35], [0.1, 0.3, 0.2]), "step": np.where((x >= 20) & (x < 35), 0.3, 0.2)}
    values["step"][(x >= 10) & (x < 20)] = 0.1
    wrap = (x < 10) | (x > 35)  # a ring: from the last point round to the first
    values["linear"][wrap] = 0.2 + (0.1 - 0.2) * (((x[wrap] - 35) % 60) / 35)
    s = np.clip((x - 10) / 10, 0, 1)
    smooth = 0.1 + 0.2 * s ** 3 * (10 - 15 * s + 6 * s * s)
    with open("b.txt", "w", encoding="ascii") as file:
        file.write("# x b\n10 0.1\n20,\t0.3  # a comment\n\n35 0.2\n")
    for kind in ("linear", "smooth", "step"):
        run(RATE + f"-grid_n 48 -friction_b_profile b.txt -profile_kind {kind} -ts_max_time 0.2 -out_file k.h5 "
            "-out_checkpoint_every 3 -out_frames 2")
        found = data("k.h5")["friction_b"]
        if kind == "smooth":
            inside = (x >= 10) & (x <= 20)
            check(np.allclose(found[inside], smooth[inside], rtol=1e-13), "smooth")
        else:
            check(np.allclose(found, values[kind], rtol=1e-13), f"{kind}: {found} for {values[kind]}")
    whole = data("k.h5")
    os.remove("b.txt")
    checkpoint = sorted(name for name in os.listdir() if name.startswith("k.chk"))[0]
    run(f"-restart {checkpoint} -out_file again.h5")
    check(np.array_equal(data("again.h5")["psi"][-1], whole["psi"][-1]), "a restart ends elsewhere")


def test_thin_layers():
    # Layers of amplitude 0.5 and 1.5 much thinner than a wave: the long waves see the mean, which is that of a uniform
    # medium. With C(x) of layers of thickness d the growth of the longest wave misses -<C>/2 by O(d^2).
    def growth(layers):
        text = "-model_form chain -grid_n 96 -model_k0 0.02 -model_k1 40 -model_v 0.8 -model_zeta 0.2 "
        width = 96 // layers
        points = ",".join(f"{i * width}:{0.5 if i % 2 == 0 else 1.5}" for i in range(layers))
        s, _ = run(text + f"-friction_amplitude_profile {points} -profile_kind step -spectrum_method dense "
                   "-spectrum_count 192 -spectrum_refine off", command="spectrum")
        # shorter waves than the layers are no waves of the mean medium
        return min((e["im"], e["re"]) for e in s["eigenvalues"] if e["im"] > 0)[1]
    uniform = -(0.2 + 0.8 ** 2 - 1) / 2
    misses = [abs(growth(layers) - uniform) for layers in (16, 32)]
    check(misses[1] < 2e-3 and math.log2(misses[0] / misses[1]) > 1.6, f"misses {misses}")


def test_long_patch_has_the_critical_stiffness():
    # A weakening patch of W blocks between strengthening ends. Rice and Ruina's critical stiffness with inertia holds for
    # K0 + K1 kappa^2, and the patch's longest wave has kappa about pi/W: the critical K0 rises to theirs like 1/W^2.
    a, b, D, v, K1, m = 0.05, 0.1, 0.2, 1.0, 0.5, 1e-3
    T = math.tanh((0.6 + b * math.log(1 / v)) / a)
    closed = (b - a) * T / D * (1 + m * v * v / (a * D * T))

    def critical(W):
        n = W + 40
        text = (RATE + f"-model_form chain -bc_left free -grid_n {n} -model_k1 {K1} -model_m {m} -model_v {v} -friction_a {a} -friction_D {D} "
                f"-friction_b_profile 0:0.01,20:{b},{20 + W}:0.01 -profile_kind step -boundary_parameter model_k0 "
                f"-boundary_from {0.5 * closed} -boundary_to {1.05 * closed}")
        s, _ = run(text, command="boundary")
        check(len(s["points"]) == 1, f"W = {W}: {s['points']}")
        return s["points"][0]["value"]
    gaps = [closed - critical(W) for W in (20, 40)]
    check(all(0 < gap < K1 * (math.pi / W) ** 2 for gap, W in zip(gaps, (20, 40))), f"gaps {gaps} below {closed}")
    check(math.log2(gaps[0] / gaps[1]) > 1.8, f"gaps {gaps} do not close like 1/W^2")


STRICT = "-ts_type rk -ts_rk_type 7vr -ts_rtol 1e-10 -ts_atol 1e-11"


def drawn_medium(seed):
    """A patch of a ring, or between free ends, that differs in three parameters; corners at quarters of the length."""
    draw = np.random.default_rng(seed).uniform
    low, high = sorted(draw(0.05, 0.3, 2))
    text = RATE + f"-grid_length 10 -ts_max_time {draw(0.8, 1.5)!r} -init_eta steady -init_state steady "
    text += "-bc_left free -init_psi 0.3 " if seed % 2 else "-init_type sine -init_amplitude 0.05 "
    for name, inside, outside in (("b", high, low), ("D", draw(0.08, 0.15), 0.1), ("amplitude", draw(0.8, 1.2), 1.0)):
        text += f"-friction_{name}_profile 0:{outside!r},2.5:{inside!r},5:{inside!r},7.5:{outside!r} "
    return text + "-out_probes 1.13,2.49,2.51,4.97,5.02,6.6 "


# the run's own estimate, against a grid so much finer; there jumps at quarters lie between cells, where they do no harm
@pytest.mark.parametrize("seed, kind, wanted, nodes, falls", [(1, "smooth", 1e-4, 301, "order 8"), (2, "smooth", 1e-6, 300, "h^4"),
                                                              (3, "linear", 1e-4, 801, "h^2, as friction bends"), (4, "step", 2e-2, 602, "h^1, as friction jumps")])
def test_accuracy_of_a_medium(seed, kind, wanted, nodes, falls):
    text = drawn_medium(seed) + f"-profile_kind {kind} "
    s, _ = run(text + f"-accuracy {wanted}")
    exact, _ = run(text + f"-grid_n {nodes} -grid_order {6 if kind == 'step' else 8} " + STRICT)
    worst = max(abs(p[name] - q[name]) for p, q in zip(s["probes"], exact["probes"]) for name in ("psi", "eta"))
    check(worst < s["error_estimate"] <= wanted, f"{kind}: errs by {worst}, estimate {s['error_estimate']}")
    check(falls in s["accuracy"]["chosen"], s["accuracy"]["chosen"])


def test_chart_of_a_medium():
    # what the chart calls a row's error, and the same from two runs; the reference's own psi and theta are read from its file
    text = drawn_medium(5) + "-profile_kind linear "
    for n, order, name in ((81, 4, "row.h5"), (641, 8, "fine.h5")):
        run(text + f"-grid_n {n} -grid_order {order} -out_frames 2 -out_file {name} " + STRICT)
    s, _ = run(text + "-grid_n 81 -chart_reference fine.h5 -chart_methods rk:7vr -chart_tolerances 1e-9 -chart_orders 4 "
               "-chart_grids 81 -chart_repeats 1", command="chart")
    row, = s["rows"]
    own, fine = data("row.h5"), data("fine.h5")
    error = max(np.max(np.abs(own[name][-1] - fine[name][-1][::8])) for name in ("psi", "eta"))
    check(abs(row["error"] / error - 1) < 1e-3, f"chart: {row['error']}, runs: {error}")


@pytest.mark.ranks
def test_ranks():
    for options in ("-grid_n 601 -init_type sine -friction_law carlson-langer -friction_alpha_profile 5:0.3,20:1 "
                    "-friction_stick regularised -friction_eps 0.3",
                    "-model_form chain -grid_n 30 -friction_law coulomb -friction_fs_profile 0:1,15:0.8 -init_noise 0.3"):
        options += " -ts_max_time 0.5 -out_frames 3 -out_series false -out_file "
        run(options + "one.h5")
        run(options + "three.h5", ranks=3)
        one, three = data("one.h5"), data("three.h5")
        for name in one:  # sums over nodes, of which steps are made, are rounded by the number of ranks
            check(np.allclose(one[name], three[name], rtol=1e-10, atol=1e-10), f"{options}: {name} differs")


REFUSED = [("run", RATE + "-friction_a 0.1 -friction_a_profile 0:0.1", ("friction_a", "not both")),
           ("run", RATE + "-friction_a_factor 2", ("friction_a_factor", "friction_a_profile")),
           ("run", RATE + "-friction_a_profile 0:-1", ("friction_a_profile", "> 0")),
           ("run", RATE + "-friction_a_profile 2:1,1:1", ("friction_a_profile", "ascending")),
           ("run", RATE + "-friction_a_profile 0:1,99:1", ("friction_a_profile", "outside")),
           ("run", RATE + "-friction_a_profile nowhere.txt", ("nowhere.txt", "cannot be read")),
           ("run", "-friction_a_profile 0:1", ("friction_a_profile", "another law")),
           ("run", RATE + "-friction_D_profile 0:1 -state_D_profile 0:1", ("state_D_profile", "same quantity")),
           ("run", "-friction_law coulomb -friction_fs_profile 0:1,5:0.2 -friction_fd 0.5", ("friction_fd", "x = 5")),
           ("wave", RATE + "-friction_b_profile 0:0.1,9:0.2 -wave_length 60", ("friction_b_profile",)),
           ("wave", "-friction_amplitude_profile 0:0.5,9:1 -wave_length 60", ("friction_amplitude_profile",)),
           ("run", RATE + "-friction_b_profile 0:0.1,30:0.2 -profile_kind step -accuracy 1e-2", ("init_eta 0", "steady")),
           ("run", RATE + "-friction_b_profile 0:0.1,9.0123:0.2 -profile_kind step -accuracy 1e-2", ("jumps", "smooth")),
           ("run", RATE + "-friction_b_profile 0:0.1,30:0.2 -profile_kind step -accuracy 1e-2 -grid_n 63", ("grid_n 63", "of 2 cells")),
           ("run", RATE + "-friction_b_profile 0:0.1,9:0.2 -init_type pulses", ("friction_b_profile",))]


@pytest.mark.parametrize("command, options, parts", REFUSED)
def test_refused(command, options, parts):
    refused(options, 2, *parts, command=command)
