"""What a run measures between its steps (amplitude, extremes of psi, rest_fraction, period) against scipy's Radau with values at
ten thousand times: random blocks of every smooth law under plates of either direction."""
import numpy as np
from scipy.integrate import solve_ivp

from calls import run
from reference import System, words

from . import test_mirror

LAWS = ("carlson-langer", "coulomb", "stribeck", "table", "lugre", "dahl", "tanh", "cubic")
PARTS = 40000  # of the last quarter


def draw(random):
    while True:
        o = test_mirror.draw_law(random, {}, smooth=True)
        if o["friction_law"] in LAWS and "state_law" not in o:
            break
    o |= {"model_form": "chain", "grid_n": 1, "bc_left": "free", "model_m": random.uniform(0.5, 2),
          "model_k0": random.uniform(0.2, 1), "model_f0": random.uniform(0.5, 1.5), "model_zeta": random.uniform(0, 0.2),
          "model_v": float(random.choice([-1, 1])) * random.uniform(0.05, 0.8)}
    o |= {"init_psi": 0.5 * o["model_v"], "init_eta": 0., "ts_max_time": random.uniform(60, 150)}
    return o


def measured(o):
    """Extremes and rest of the last quarter, and times of passage forwards through v in the second half."""
    system, end, v = System(o), o["ts_max_time"], o["model_v"]
    kinds = [o["init_psi"], o["init_eta"]]
    if system.kinds == 3:
        kinds.append(float(system.law.steady(np.array([o["init_psi"]]))[0]))
    done = solve_ivp(system.rates, (0, end), kinds, method="Radau", rtol=1e-9, atol=1e-11, dense_output=True)
    psi = done.sol(np.linspace(0.75 * end, end, PARTS))[0]
    t = np.linspace(end / 2, end, PARTS)
    way = np.sign(v) * (done.sol(t)[0] - v)
    ups = np.flatnonzero((way[:-1] < 0) & (way[1:] >= 0))
    passed = t[ups] + (t[ups + 1] - t[ups]) * way[ups] / (way[ups] - way[ups + 1])
    slow = 4 * o["friction_eps"] if "friction_eps" in o else 0
    at_rest = np.abs(psi) <= slow if slow else np.zeros(1, bool)
    return (psi.max() - psi.min()) / 2, at_rest.mean(), passed


def test_between_steps(scenes):
    """Of a run with steps a thousand times finer in their errors than what is asked of the measures: extremes and passages lie on
    the cubic of a step, whose error the steps' own tolerance of 1e-7 keeps far below 1e-4; samples of the reference are a few
    thousandths of a period apart, and miss a maximum by the square of that."""
    bad, periods = [], 0
    for index, o in scenes(draw, salt=811, short=1):
        s, _ = run([*words(o), "-ts_rtol", 1e-7, "-ts_atol", 1e-8])
        amplitude, rest, passed = measured(o)
        text = " ".join(map(str, words(o)))
        scale = max(abs(o["model_v"]), amplitude)
        if abs(s["amplitude"] - amplitude) > 1e-4 * scale:
            bad.append(f"scene {index}: amplitude {s['amplitude']}, {amplitude}: {text}")
        if abs((s["rest_fraction"] or 0) - rest) > 2e-4:
            bad.append(f"scene {index}: rest_fraction {s['rest_fraction']}, {rest}: {text}")
        gaps = np.diff(passed)
        if s["period"] is not None:
            periods += 1
            if abs(s["period"] - gaps.mean()) > 1e-5 * s["period"]:
                bad.append(f"scene {index}: period {s['period']}, {gaps.mean()}: {text}")
        elif len(gaps) >= 4 and np.ptp(gaps) < 1e-4 * gaps.mean() and amplitude > 0.05 * abs(o["model_v"]):
            bad.append(f"scene {index}: no period, {gaps.mean()} +- {np.ptp(gaps)}: {text}")
    print(periods, "periods")
    assert not bad, "\n".join(bad)
