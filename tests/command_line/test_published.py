"""docs/published.md: published results against SciPy and closed forms."""
import json
import math
import os
import subprocess

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
