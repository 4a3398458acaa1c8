"""docs/published.md: published results against SciPy and closed forms."""
import json
import math
import os
import subprocess

import h5py
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import iv

from calls import PROGRAM, SOURCE


def stickslip(command, scene, *words):
    """The exit code and, where it is 0, the summary."""
    path = os.path.join(SOURCE, "runs", "published", scene + ".yaml")
    call = [PROGRAM, command, path, *map(str, words), "-summary", "s.json"]
    done = subprocess.run(call, capture_output=True, text=True)
    if done.returncode:
        return done.returncode, done.stderr
    with open("s.json", encoding="utf-8") as file:
        return 0, json.load(file)


def runs_away(push, ageing, a=0.01, b=0.015, k=0.006):
    """The block without mass, by SciPy over its slip s: x = ln psi, q = ln theta, D = v = 1. Slip takes the
    place of time since the rates over s stay bounded. Whoever reaches x = 80 has run away: from x = 40 to 80
    the limit of pushes moves by 1e-7."""
    def rates(_, y):
        x, q = y
        state = math.exp(-x - q) - 1 if ageing else -(x + q)
        return [(k * math.expm1(-x) - b * state) / a, state]

    away, back = lambda _, y: y[0] - 80, lambda _, y: y[0]
    away.terminal = back.terminal = True
    back.direction = -1
    motion = solve_ivp(rates, (0, 1000), [math.log(push), 0], method="DOP853", rtol=1e-12, atol=1e-12,
                       events=(away, back))
    assert motion.status == 1
    return len(motion.t_events[0]) > 0


def test_large_pushes_of_a_block_above_its_critical_stiffness():
    """Slip law: a finite push runs away. The limit is SciPy's to 1e-5: a run ends where psi is
    about 1e15 (x = 35), and SciPy's own limit moves by 7e-6 from x = 30 to 40."""
    low, high = 1.5, 3
    while high / low > 1 + 1e-9:
        middle = math.sqrt(low * high)
        away = runs_away(middle, ageing=False)
        low, high = (low, middle) if away else (middle, high)
    tight = ["-ts_rtol", 1e-10, "-ts_atol", 1e-10]
    assert stickslip("run", "rice-ruina", "-init_psi", high * (1 - 1e-5), *tight)[1]["regime"] == "sliding"
    code, words = stickslip("run", "rice-ruina", "-init_psi", high * (1 + 1e-5), *tight)
    assert code == 1 and "runs away" in words
    for push in (3, 10):
        assert not runs_away(push, ageing=True)
        _, back = stickslip("run", "rice-ruina", "-state_law", "ageing", "-init_psi", push)
        assert back["regime"] == "sliding"


def ends(f0):
    code, found = stickslip("boundary", "belt", "-model_f0", f0, "-model_zeta", 0.1 * f0)
    assert code == 0
    return {(p["of"], p["kind"]): p["value"] for p in found["points"]}


def test_a_brake_of_weak_friction_obeys_its_average():
    """Sliding: exact. Stick-slip: the average is of second order, so that the next term is f0^2 = 0.04 of the
    distance or less."""
    average = brentq(lambda v: iv(1, v) * math.exp(-v) / v - 0.1, 0.1, 10, xtol=1e-14)
    distance = []
    for f0 in (0.2, 0.1, 0.05):
        found = ends(f0)
        assert abs(found["sliding", "hopf"] - math.log(5)) < 1e-9
        distance.append(average - found["stick-slip", "graze"])
    assert distance[0] > 0
    np.testing.assert_allclose(np.divide(distance[:-1], distance[1:]), 4, rtol=0.04)


def rests(v, f0, slips=8):
    """Whether the mass on the belt comes to rest within some slips, either way, from the threshold on."""
    y, side = [0, 1], 1
    for _ in range(slips):
        def rates(_, y, side=side):
            friction = 0.5 + 0.5 * math.exp(-abs(y[0]))
            return [f0 * (y[1] - 0.1 * y[0] - side * friction), (v - y[0]) / f0]

        stop = lambda _, y: y[0]
        stop.terminal, stop.direction = True, -side
        slip = solve_ivp(rates, (0, 100), [side * 1e-14, y[1]], method="DOP853", rtol=1e-11, atol=1e-12,
                         events=stop)
        y = slip.y[:, -1]
        if abs(y[1]) <= 1:
            return True
        side = math.copysign(1, y[1])
    return False


def test_a_brake_of_very_weak_friction_overtakes_the_belt():
    """1e-3 beyond the place eight slips pass without rest, 1e-3 before it one rests."""
    place = ends(0.0125)["stick-slip", "pass"]
    assert rests(place + 1e-3, 0.0125) and not rests(place - 1e-3, 0.0125)


def test_trains_of_the_figures_fit_the_rings_of_a_van_der_pol_oscillator():
    """psi = f(t - x/V): (1 - c²/V²) f'' + [gamma (f² - 1) + delta] f' + f - v = 0, L = n |V| T."""
    for figure, pulses, speed in ((3, 2, 4.88), (4, 4, 2.48), (5, 11, 1.08)):
        r = 1 - 1 / speed**2

        def rates(_, y, r=r):
            return [y[1], -((3 * (y[0]**2 - 1) + 0.2) * y[1] + y[0] - 0.2) / r]

        def up(_, y):
            return y[0]
        up.direction = 1
        course = solve_ivp(rates, (0, 45), [0, 1], method="DOP853", rtol=1e-10, atol=1e-11, events=up)
        period = course.t_events[0][-1] - course.t_events[0][-2]
        _, found = stickslip("wave", f"../figure{figure}", "-out_file", "train.h5")
        assert abs(found["length"] / (pulses * speed * period) - 1) < 1e-7


LAB = {"a": 0.01, "b": 0.015}


def recorded(k0, law, *words):
    """Time, force and slip of a run of the laboratory's block."""
    code, _ = stickslip("run", "laboratory", "-model_k0", k0, "-state_law", law, "-out_file", "lab.h5", "-out_frames",
                        2, *words)
    assert code == 0
    with h5py.File("lab.h5") as file:
        return file["series/t"][:], file["series/eta_mean"][:]


def test_half_of_a_velocity_steps_evolution_takes_the_slip_of_a_rigid_machine():
    """Halving the compliance halves what is left of it; the way to the half is interpolated to 1e-4 or so."""
    half = math.sqrt(10)
    rigid = {"ageing": (math.log(9 / (half - 1)), -math.log((1 - 1 / half) / 0.9)), "slip": (math.log(2),) * 2}
    for law, expected in rigid.items():
        off = []
        for k0 in (5, 10):
            t, force = recorded(k0, law)
            way = np.interp(t, [0, 1, 2, 12], [0, 1, 11, 21]) - force / k0
            for begin, end, sign, steady in ((1, 2, 1, 0.6 - 0.005 * math.log(10)), (2, 12, -1, 0.6)):
                part = (t >= begin) & (t <= end)
                above, slip = sign * (force[part] - steady), way[part]
                peak = above.argmax()
                off.append(np.interp(-LAB["b"] * math.log(10) / 2, -above[peak:], slip[peak:]) - slip[0])
        off = np.array(off).reshape(2, 2) - expected
        assert np.all(np.abs(off[1]) < 2.5e-3), (law, off)
        np.testing.assert_allclose(off[1], off[0] / 2, atol=3e-4)


def peak(k0, ageing, hold):
    """The peak above steady friction after a hold, by SciPy, without mass: x = ln psi, q = ln theta, D = v = 1."""
    a, b = LAB["a"], LAB["b"]

    def motion(v, y, end, events=None):
        def rates(_, y):
            x, q = y
            p = math.exp(x)
            ages = math.exp(-q) - p if ageing else -p * (x + q)
            return [(k0 * (v - p) - b * ages) / a, ages]
        return solve_ivp(rates, (0, end), y, method="Radau", rtol=1e-9, atol=1e-10, events=events)

    def turns(_, y):
        return -y[0]
    turns.terminal, turns.direction = True, -1
    x, q = motion(1, motion(0, [0, 0], hold).y[:, -1], 2, turns).y[:, -1]
    return a * x + b * q


def test_peaks_after_holds():
    """SciPy's in both laws; ageing near b ln(1 + v t/D), slip near a b/(2 k0 D) ln²(1 + k0 v t/a)."""
    for hold in (10, 1000):
        rigid = {"ageing": LAB["b"] * math.log1p(hold),
                 "slip": LAB["a"] * LAB["b"] / 20 * math.log1p(10 * hold / LAB["a"])**2}
        for law, limit in rigid.items():
            load = f"0:1,1:1,1:0,{1 + hold}:0,{1 + hold}:1"
            _, force = recorded(10, law, "-load_v", load, "-ts_max_time", hold + 3)
            assert abs(force.max() - 0.6 - peak(10, law == "ageing", hold)) < 3e-6
            assert abs((force.max() - 0.6) / limit - 1) < 0.025


def test_multipliers_of_a_block_with_the_plain_logarithm():
    """x = ln psi, u, the state: deviations carried round SciPy's cycle, which by then repeats to round-off."""
    stiffness, xi, epsilon = 0.64, 0.5, 1

    def rates(_, y):
        x, u, state = y[:3]
        p = math.exp(x)
        pull, ages = -stiffness * (u + (state + x) / xi) / p, -p * (state + (1 + epsilon) * x)
        J = np.array([[-stiffness / xi / p - pull, -stiffness / p, -stiffness / xi / p], [p, 0, 0],
                      [ages - p * (1 + epsilon), 0, -p]])
        return np.concatenate([[pull, p - 1, ages], (J @ y[3:].reshape(3, -1)).ravel()])

    def passes(_, y):
        return y[0]
    passes.terminal, passes.direction = True, 1
    y = np.array([math.log(1.05), 0, 0])
    for turn in range(7):
        start = np.concatenate([y, np.eye(3).ravel()]) if turn == 6 else y
        course = solve_ivp(rates, (0, 100), start, method="Radau", rtol=1e-9, atol=1e-11, events=passes)
        y = np.array([1e-15, *course.y[1:3, -1]])
    multipliers = sorted(abs(np.linalg.eigvals(course.y[3:, -1].reshape(3, 3))))
    _, found = stickslip("cycle", "erickson-block")
    assert abs(found["period"] / course.t[-1] - 1) < 1e-6
    assert abs(found["multipliers"][1]["re"] / multipliers[1] - 1) < 1e-3
