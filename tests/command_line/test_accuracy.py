"""-accuracy: a few random scenes by accuracy.py, what the user set stays, what cannot be had ends with exit code 1."""
import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from calls import PROGRAM, SOURCE, ran
from reference import System

SCENE = ["-grid_length", 20, "-init_type", "sine", "-ts_max_time", 1]
BLOCK = ["-model_form", "chain", "-grid_n", 1, "-bc_left", "free", "-model_v", 0.2, "-init_eta", "steady",
         "-ts_max_time", 60]
STUCK = ["-model_form", "chain", "-grid_n", 5, "-bc_left", "free", "-friction_law", "carlson-langer",
         "-friction_spread", 0.1, "-model_v", 0.05, "-init_psi", 0.05, "-init_eta", 0.3, "-model_zeta", 0.2, "-ts_max_time", 30,
         "-out_probes", "0,1,2,3,4"]


def run(*words, ranks=1, code=0):
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = launcher + [PROGRAM, "run", *map(str, words), "-summary", "s.json"]
    if os.path.exists("s.json"):
        os.remove("s.json")
    done = ran(command)
    assert done.returncode == code, f"{command}: {done.returncode}\n{done.stderr}"
    if code == 2:
        return done.stderr
    with open("s.json", encoding="utf-8") as file:
        return {**json.load(file), "said": done.stderr}


@pytest.mark.parametrize("more", [["--cases", "10"], ["--cases", "6", "--loads"]])
def test_random_scenes(more):
    done = subprocess.run([sys.executable, "-B", os.path.join(SOURCE, "tests", "accuracy.py"), "--seed", "2", *more],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    print(done.stdout.splitlines()[-1])
    assert "0 not reached" in done.stdout


@pytest.mark.ranks
def test_answer_within_the_request():
    made = run(*SCENE, "-accuracy", 1e-5, "-progress", "on", "-out_probes", "3.3,10")
    how = made["accuracy"]
    assert made["error_estimate"] <= 1e-5 and "accuracy: " + how["method"] in made["said"], made["said"]
    assert how["choosing_seconds"] > 0 and how["run_seconds"] >= how["step_seconds"] > 0
    # on several ranks the same answer to that accuracy, at the probes too
    two = run(*SCENE, "-accuracy", 1e-5, "-out_probes", "3.3,10", ranks=2)
    assert all(how[name] == two["accuracy"][name] for name in ("method", "order", "n")), two["accuracy"]
    # out of differences of 1e-5 between runs that differ by round-off
    assert abs(two["accuracy"]["tolerance"] / how["tolerance"] - 1) < 1e-8
    for a, b in zip(made["probes"], two["probes"]):
        assert abs(a["psi"] - b["psi"]) < 1e-8 and abs(a["eta"] - b["eta"]) < 1e-8, (a, b)
    # and a tenth of it is a better one
    strict = run(*SCENE, "-accuracy", 1e-8, "-out_probes", "3.3,10")
    for a, b in zip(made["probes"], strict["probes"]):
        assert abs(a["psi"] - b["psi"]) < 1e-5 and abs(a["eta"] - b["eta"]) < 1e-5, (a, b)


def test_what_the_user_set_stays():
    # what the user set stays
    kept = run(*SCENE, "-accuracy", 1e-4, "-ts_type", "rosw", "-ts_rosw_type", "ra34pw2", "-grid_order", 4)
    assert kept["method"] == "rosw:ra34pw2" and kept["accuracy"]["order"] == 4 and kept["error_estimate"] <= 1e-4
    kept = run(*SCENE, "-accuracy", 1e-3, "-grid_n", 300)
    assert kept["unknowns"] == 600 and kept["error_estimate"] <= 1e-3
    said = run(*SCENE, "-accuracy", 1e-8, "-grid_n", 40, code=1)
    assert "grid_n 40 as set" in said["reason"] and said["status"] == "failed", said["reason"]
    said = run(*SCENE, "-accuracy", 1e-8, "-ts_rtol", 1e-3, "-ts_atol", 1e-3, code=1)
    assert "out of reach" in said["reason"], said["reason"]


def test_stiff_parts_are_taken_implicitly():
    """By the rule of runs that name no method; beside explicit steps as short as the threshold asks for."""
    slow = ["runs/chart-slow-driving.yaml", "-ts_max_time", 60, "-out_probes", "0,7,19"]
    slow[0] = os.path.join(SOURCE, slow[0])
    made = run(*slow, "-accuracy", 1e-4)
    assert made["method"] == run(*slow)["method"] == "arkimex:4" and made["implicit"] == "friction", made["said"]
    exact = run(*slow, "-ts_type", "rk", "-ts_rk_type", "8vr", "-ts_rtol", 1e-10, "-ts_atol", 1e-10)
    error = max(abs(a[name] - b[name]) for a, b in zip(made["probes"], exact["probes"]) for name in ("psi", "eta"))
    assert error <= 1e-4 and error / 3 <= made["error_estimate"] <= 1e-4, (error, made["error_estimate"])
    # what the user named stays, and what explicit steps do in less time than an implicit ladder takes stays theirs
    assert run(*slow, "-accuracy", 1e-2, "-imex_implicit", "both")["implicit"] == "both"
    assert run(*slow, "-ts_max_time", 0.5, "-accuracy", 1e-4)["method"] == "rk:7vr"


def test_friction_that_becomes_stiff_on_the_way():
    """Blocks that slide at the start ask for few explicit steps; while they rest, rate-and-state friction asks for a hundred
    thousand times as many. Explicit steps are given up then, and the same request ends in a tenth of a second."""
    blocks = ["-model_form", "chain", "-grid_n", 4, "-bc_left", "free", "-friction_law", "rate-and-state", "-state_law", "ageing",
              "-friction_a", 0.0786, "-friction_D", 0.1027, "-friction_psi0", 0.065333, "-model_v", 0.065333, "-model_m", 0.0456,
              "-model_k0", 0.4112, "-model_k1", 0.1687, "-model_zeta", 0.5, "-init_psi", 0.080534, "-init_eta", "steady",
              "-init_noise", 0.001307, "-friction_b", 0.3217, "-ts_max_time", 116.453, "-out_probes", "0,1,2,3"]
    made = run(*blocks, "-accuracy", 2.7e-4)
    assert made["method"].startswith("arkimex") and made["rhs_evaluations"] < 1e5, made["said"]
    exact = run(*blocks, "-ts_rtol", 1e-10, "-ts_atol", "auto:1e-10")
    error = max(abs(a[name] - b[name]) for a, b in zip(made["probes"], exact["probes"]) for name in ("psi", "eta"))
    assert error <= made["error_estimate"] <= 2.7e-4, (error, made["error_estimate"])


JUMP = ["-bc_left", "velocity", "-bc_left_value", -1.5, "-bc_right", "free", "-grid_length", 24]
GAMMA, DELTA, V, HELD, BEGIN = 3, 0.2, 0.2, -1.5, 0.1
POINT = System({"grid_n": 1, "grid_order": 2, "model_gamma": GAMMA, "model_delta": DELTA, "model_v": V})  # all alike
cubic = POINT.law.force


def along_characteristics(t_end, n, length=24):
    """psi of the paper's own data (c = 1) on n + 1 nodes, at steps h: Riemann's variables psi -+ c chi_x go from node to
    node, trapezoidal rule, and the node at the jump has two values. Returns psi and those two, both of second and of
    first order."""
    h = length / n
    dt = h

    def source(psi, chi, t):
        return -(chi - V * t) - DELTA * psi - GAMMA * cubic(psi)

    def implicit(psi, ingoing, chi, t):
        for _ in range(8):
            f = psi - ingoing - dt / 2 * source(psi, chi + dt / 2 * psi, t)
            psi = psi - f / (1 + dt / 2 * (dt / 2 + DELTA + GAMMA * POINT.law.slopes(psi, 0 * psi)[0]))
        return psi

    psi = np.full(n + 1, BEGIN)
    right, left, chi = psi.copy(), psi.copy(), np.full(n + 1, -GAMMA * BEGIN - DELTA * BEGIN)
    behind, right_behind = HELD, 2 * HELD - BEGIN
    for k in range(round(t_end / dt)):
        t = k * dt
        rate, rate_behind = source(psi, chi, t), source(behind, chi[k], t)
        to_right, to_left = np.empty(n + 1), np.empty(n + 1)
        to_right[1:] = right[:-1] + dt / 2 * rate[:-1]
        to_left[:-1] = left[1:] + dt / 2 * rate[1:]
        if k:
            to_left[k - 1] = left[k] + dt / 2 * rate_behind
        passed = psi.copy()
        passed[k] = behind
        moved = chi + dt / 2 * passed
        new = np.empty(n + 1)
        new[1:-1] = implicit(psi[1:-1], (to_right + to_left)[1:-1] / 2, moved[1:-1], t + dt)
        new[0], new[n] = HELD, implicit(psi[n], to_right[n], moved[n], t + dt)
        right_behind += dt / 2 * rate_behind
        behind = implicit(behind, (right_behind + to_left[k + 1]) / 2, moved[k + 1], t + dt)
        right_behind += dt / 2 * source(behind, moved[k + 1] + dt / 2 * behind, t + dt)
        chi = moved + dt / 2 * new
        rate = source(new, chi, t + dt)
        right, left = to_right + dt / 2 * rate, to_left + dt / 2 * rate
        right[0], left[n] = 2 * HELD - left[0], right[n]
        psi = new
    return psi, behind - psi[round(t_end / dt)]


def test_jump():
    """The answer holds beside x = c t, for psi; there it jumps, by what the relation along it says."""
    t_end = 3
    made = run(*JUMP, "-ts_max_time", t_end, "-accuracy", 0.03, "-out_file", "jump.h5", "-out_frames", 2)
    jump = made["jump"]
    assert jump["x"] == t_end and made["error_estimate"] <= 0.03, made
    assert jump["x"] - jump["from"] == t_end / 4 and 0 < jump["to"] - jump["x"] < t_end / 4, jump
    (coarse, low), (fine, high) = (along_characteristics(t_end, n) for n in (960, 1920))
    exact = fine[::2] + (fine[::2] - coarse) / 3
    with h5py.File("jump.h5") as file:
        x, psi = file["x"][:], file["psi"][-1]
    node = np.linspace(0, 24, 961)
    error = 0
    for side in (x < jump["from"], x > jump["to"]):
        own = node < t_end - 1e-9 if x[side][0] < t_end else node > t_end + 1e-9
        error = max(error, np.abs(psi[side] - CubicSpline(node[own], exact[own])(x[side])).max())
    assert error <= 0.03 and error / 3 <= made["error_estimate"], error

    def along(t, y):
        psi, _, height = y
        return [*POINT.rates(t, y[:2]), -(GAMMA * (cubic(psi + height) - cubic(psi)) + DELTA * height) / 2]
    relation = solve_ivp(along, (0, t_end), [BEGIN, BEGIN, HELD - BEGIN], rtol=1e-11, atol=1e-12).y[2, -1]
    assert abs(jump["height"] - relation) < 1e-8 * abs(relation), (jump, relation)
    assert abs(jump["height"] - (2 * high - low)) < 3 * (high - low)**2 + 1e-3, (jump, low, high)
    # from the right end alike; and what no finite difference can follow is refused soon, and told
    mirrored = run("-bc_right", "velocity", "-bc_right_value", -1.5, "-bc_left", "free", "-grid_length", 24,
                   "-ts_max_time", t_end, "-accuracy", 0.03)["jump"]
    assert mirrored["x"] == 24 - t_end and abs(mirrored["height"] - relation) < 1e-8 * abs(relation)
    refused = run(*JUMP, "-ts_max_time", t_end, "-accuracy", 1e-6, code=1)
    assert "out of reach" in refused["reason"] and "jumps" in refused["reason"], refused["reason"]
    assert abs(refused["jump"]["height"] - relation) < 1e-8 * abs(relation) and refused["error_estimate"] > 1e-6


def test_jump_in_a_medium():
    """A state law, friction spread along x and a start that is not uniform: psi, the state and a ahead of the jump come from
    the same scene with a free end. Against psi of a fine run on both sides, extrapolated to x = c t."""
    words = ["-bc_left", "velocity", "-bc_left_value", 0.6, "-bc_right", "free", "-grid_length", 3, "-ts_max_time", 0.8,
             "-model_gamma", 0.5, "-friction_law", "carlson-langer", "-friction_stick", "regularised", "-friction_eps", 0.3, "-state_law",
             "healing", "-init_type", "sine", "-init_amplitude", 0.2, "-init_psi", 1.2, "-friction_spread", 0.2,
             "-friction_spread_length", 1]
    height = run(*words, "-accuracy", 0.15)["jump"]["height"]
    run(*words, "-grid_n", 1601, "-grid_order", 2, "-out_file", "fine.h5", "-out_frames", 2)
    with h5py.File("fine.h5") as file:
        x, psi = file["x"][:], file["psi"][-1]
    # the front is some 6 (h^2 c t)^(1/3) wide; on 401 to 3201 nodes the difference comes from 10 % to 0.2 % off, here to 0.9 %
    sides = [np.polyfit(x[part] - 0.8, psi[part], 3)[3] for part in ((x > 0.2) & (x < 0.75), (x > 0.825) & (x < 1.2))]
    assert abs(height - (sides[0] - sides[1])) < 0.02 * abs(height), (height, sides)


# ---- numbers ----

TRAIN = ["-init_type", "wave", "-init_pulses", 4, "-grid_length", 100, "-model_v", 0.5, "-model_delta", 0]


def asked_of(quantity, accuracy, *words):
    made = run(*words, "-accuracy", accuracy, "-accuracy_of", quantity)
    assert made["accuracy"]["of"] == quantity and made["error_estimate"] <= accuracy
    return made, made["accuracy"]["value"]


def test_speed_and_amplitude_of_a_train():
    command = [PROGRAM, "wave", "-wave_pulses", 4, "-wave_length", 100, "-model_v", 0.5, "-model_delta", 0, "-summary", "-"]
    wave = json.loads(ran(command).stdout)
    made, (speed,) = asked_of("speed", 1e-6, *TRAIN, "-ts_max_time", 4)
    assert speed == made["wave_speed"] and abs(speed - wave["speed"]) <= 1e-6, (speed, wave["speed"])
    made, (amplitude,) = asked_of("amplitude", 1e-4, *TRAIN, "-ts_max_time", 40)  # a quarter of it: longer than one pulse takes
    exact = (wave["psi_max"] - wave["psi_min"]) / 2
    assert amplitude == made["amplitude"] and abs(amplitude - exact) <= 1e-4, (amplitude, exact)


UNIFORM = ["-model_form", "chain", "-grid_n", 1, "-bc_left", "free", "-model_v", 0.2, "-ts_max_time", 120, "-out_probes", 0]


def test_period_of_a_cycle():
    words = ["-model_form", "chain", "-grid_n", "1", "-bc_left", "free", "-model_v", "0.2", "-summary", "-"]
    cycle = json.loads(ran([PROGRAM, "cycle", *words]).stdout)
    made, (period,) = asked_of("period", 1e-7, *UNIFORM)
    assert period == made["period"] and abs(period - cycle["period"]) <= 1e-7, (period, cycle["period"])
    # a plain run has it too, as good as its steps
    assert abs(run(*UNIFORM)["period"] - cycle["period"]) < 1e-3
    _, (amplitude,) = asked_of("amplitude", 1e-7, *UNIFORM)
    assert abs(amplitude - cycle["amplitude"]) <= 1e-7


@pytest.mark.parametrize("seed", range(3))
def test_numbers_of_random_chains(seed):
    """Blocks on springs against SciPy: mean period and amplitude by their definitions in docs/summary.md."""
    r = np.random.default_rng(seed)
    n, v, k1, zeta, t_end = int(r.integers(2, 5)), r.uniform(-0.6, 0.6), 10**r.uniform(-1, 0.5), r.uniform(0, 0.1), 100
    start = r.uniform(-0.5, 0.5)
    words = ["-model_form", "chain", "-grid_n", n, "-bc_left", "free", "-model_v", v, "-model_k1", k1, "-model_zeta", zeta,
             "-init_type", "sine", "-init_psi", start, "-init_amplitude", 0.4, "-ts_max_time", t_end, "-out_probes", 0]

    system = System(words)

    def passes(_, u):
        return u[0] - v
    passes.direction = np.copysign(1, v)  # in the plate's direction
    x = np.arange(n) / max(1, n - 1)
    begin = np.concatenate([start + 0.4 * np.sin(2 * np.pi * x), np.full(n, 0.1)])
    turns = [lambda t, u, i=i: system.rates(t, u)[i] for i in range(n)]
    exact = solve_ivp(system.rates, (0, t_end), begin, method="DOP853", rtol=1e-11, atol=1e-12, events=[passes, *turns],
                      dense_output=True)
    times = exact.t_events[0][exact.t_events[0] >= t_end / 2]
    period = (times[-1] - times[0]) / (len(times) - 1)
    _, (found,) = asked_of("period", 1e-6, *words)
    assert abs(found - period) <= 1e-6, (found, period, words)
    quarter = np.array([0.75 * t_end, t_end])
    ranges = []
    for i in range(n):
        late = np.concatenate([quarter, exact.t_events[1 + i][exact.t_events[1 + i] > quarter[0]]])
        ranges.append(np.ptp(exact.sol(late)[i]) / 2)
    _, (found,) = asked_of("amplitude", 1e-6, *words)
    assert abs(found - max(ranges)) <= 1e-6, (found, ranges, words)


def test_probe():
    strict = run(*SCENE, "-accuracy", 1e-9, "-out_probes", 3.3)["probes"][0]
    made, (psi, eta) = asked_of("probe:3.3", 1e-5, *SCENE)
    error = max(abs(psi - strict["psi"]), abs(eta - strict["eta"]))
    assert error <= 1e-5 and error / 3 <= made["error_estimate"], (error, made["error_estimate"])


def test_period_without_probes():
    """That of the middle block, which here is the only one: the period of its cycle."""
    block = ["-model_form", "chain", "-grid_n", 1, "-bc_left", "free", "-model_v", 0.3]
    cycle = json.loads(ran([PROGRAM, "cycle", *block, "-summary", "-"]).stdout)
    made, (period,) = asked_of("period", 1e-5, *block, "-ts_max_time", 60)
    assert abs(period - cycle["period"]) <= 1e-5 and made["period"] == period


def test_numbers_that_are_not_there():
    said = run(*SCENE, "-accuracy", 1e-3, "-accuracy_of", "speed", "-accuracy_seconds", 2, "-bc_left", "free", "-init_type",
               "uniform", code=1)
    assert "no wave_speed to measure" in said["reason"], said["reason"]
    assert "accuracy_of" in run(*SCENE, "-accuracy", 1e-3, "-accuracy_of", "probe:30", code=2)
    assert "accuracy_of" in run(*SCENE, "-accuracy", 1e-3, "-accuracy_of", "length", code=2)
    assert "-accuracy" in run(*SCENE, "-accuracy_of", "speed", code=2)


PACEMAKER = ["-bc_left", "velocity", "-bc_left_value", -1.5, "-bc_right", "free", "-init_type", "layer", "-ts_max_time", 5]


def test_fronts_thinner_than_the_first_grids():
    """On 2881 nodes the error is 0.44 and hardly falls; four grids further the front is resolved."""
    assert run(*PACEMAKER, "-accuracy", 1e-4)["error_estimate"] <= 1e-4
    # what was reached is told with its error
    said = run(*PACEMAKER, "-accuracy", 1e-4, "-accuracy_seconds", 0.05, code=1)
    assert "accuracy_seconds 0.05" in said["reason"] and said["status"] == "failed", said["reason"]
    assert said["error_estimate"] > 1e-4 and said["psi_max"] is not None, said


def test_corner():
    # corners: no order to speak of; ends soon
    corner = run("-bc_left", "velocity", "-bc_left_value", -0.5, "-bc_right", "free", "-init_type", "layer", "-grid_length", 20,
                 "-ts_max_time", 2, "-model_gamma", 1, "-accuracy", 1e-5, "-accuracy_seconds", 1, code=1)
    assert "out of reach" in corner["reason"] and "corners" in corner["reason"], corner["reason"]


def test_what_the_motion_amplifies():
    # A start 1e-13 off unstable sliding at 0.2: rounding of 0.2 itself, 3e-17, is a part of 3e-4 of that distance, and both
    # grow alike until stick-slip is reached, so that no answer is good to 1e-6. 1e-2 off, the part is 3e-15.
    lost = run(*BLOCK, "-init_psi", 0.2 + 1e-13, "-accuracy", 1e-6, code=1)
    assert "out of reach" in lost["reason"] and "amplifies" in lost["reason"] and lost["status"] == "failed", lost["reason"]
    assert lost["error_estimate"] > 1e-6
    found = run(*BLOCK, "-init_psi", 0.21, "-accuracy", 1e-6)
    assert found["error_estimate"] <= 1e-6


def test_one_block():
    # one block: an ordinary differential equation
    block = run("-model_form", "chain", "-grid_n", 1, "-bc_left", "free", "-ts_max_time", 10, "-accuracy", 1e-7)
    assert block["error_estimate"] <= 1e-7 and block["unknowns"] == 2


def test_steps_that_hardly_depend_on_the_tolerance():
    """Four steps at 4e-6 as at 1e-6: the distance of the two runs is a fifth of their errors, which a stricter one shows."""
    words = ["-model_form", "chain", "-grid_n", 5, "-model_k1", 0.864, "-model_zeta", 0, "-model_v", 0.097, "-init_psi",
             0.195, "-ts_max_time", 2.32, "-bc_left", "free", "-out_probes", 0]
    made = run(*words, "-accuracy", 1.2e-5)

    exact = System(words).follow(np.repeat([0.195, 0.1], 5), 0, 2.32)
    error = max(abs(made["probes"][0][name] - exact[i]) for i, name in ((0, "psi"), (5, "eta")))
    assert error <= 1.2e-5 and error / 3 <= made["error_estimate"] <= 1.2e-5, (error, made["error_estimate"])


def test_chain_that_sticks():
    # a chain that sticks exactly has a ladder of tolerances
    stuck = run(*STUCK, "-accuracy", 1e-6)
    exact = run(*STUCK, "-ts_type", "rk", "-ts_rk_type", "5dp", "-ts_rtol", 1e-12, "-ts_atol", 1e-12)
    error = max(abs(a[name] - b[name]) for a, b in zip(stuck["probes"], exact["probes"]) for name in ("psi", "eta"))
    assert error <= 1e-6 and error / 3 <= stuck["error_estimate"] <= 1e-6, (error, stuck["error_estimate"])


@pytest.mark.parametrize("words, names", [
    (["-ts_type", "rk", "-ts_rk_type", "4"], "ts_type"), (["-ts_rk_type", "3bs"], "ts_rk_type"),
    (["-ts_adapt_type", "none"], "ts_adapt_type"), (["-friction_law", "coulomb"], "friction_stick"),
    (["-ts_type", "irk"], "irk")])
def test_wrong_use(words, names):
    said = run(*SCENE, "-accuracy", 1e-4, *words, code=2)
    assert names in said and said.count("error:") == 1, said


def test_probe_on_the_right_end():
    """13 times 30/13 is not 30, and 30 is a probe all the same."""
    made = run("-grid_length", 30, "-grid_n", 14, "-bc_left", "free", "-out_probes", "0,30", "-ts_max_time", 0)
    assert [p["psi"] for p in made["probes"]] == [0.1, 0.1]
    assert "out_probes" in run("-grid_length", 30, "-grid_n", 14, "-bc_left", "free", "-out_probes", 30.0001, code=2)
