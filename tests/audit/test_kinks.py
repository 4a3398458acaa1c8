"""Periods of oscillations that pass rest, where |psi| in the state law turns a corner: against DOP853 from corner to corner, each
side with its own sign, and a fixed point of its return map. The printed error is no smaller than the true one."""
import math

import h5py
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from calls import run

FEW_WAVENUMBERS = (  # a cycle that turns back twice a period
    "-model_gamma 9.221509752006487 -model_delta 0 -model_v -0.445817403449582 -friction_law rate-and-state "
    "-friction_a 0.17554001525193386 -friction_b 0.32830284679770366 -friction_D 0.8124353402150759 "
    "-friction_psi0 0.16990940156714296")


def draw(rng):
    def uniform(low, high):
        return float(rng.uniform(low, high))
    p = {"model_gamma": float(np.exp(uniform(0.7, 2.2))), "model_delta": float(rng.choice([0, uniform(0, 0.2)])),
         "model_v": uniform(0.1, 0.6) * float(rng.choice([-1, 1])), "friction_law": str(rng.choice(["cubic", "rate-and-state"]))}
    if p["friction_law"] == "cubic":
        p |= {"state_law": "contact-age", "state_D": uniform(0.2, 1), "state_b": uniform(0.05, 0.4), "state_theta0": uniform(0.3, 2)}
    else:
        a = uniform(0.12, 0.2)
        p |= {"state_law": str(rng.choice(["ageing", "slip"])), "friction_a": a, "friction_b": a * uniform(1.6, 2.2),
              "friction_D": uniform(0.5, 1), "friction_psi0": uniform(0.15, 0.6)}
    return p


class Oscillator:
    def __init__(self, p):
        gamma, delta, v, D = p["model_gamma"], p["model_delta"], p["model_v"], p.get("friction_D", p.get("state_D"))

        def friction(u, s):
            if p["friction_law"] == "cubic":
                return (1 + p["state_b"] * math.log1p(math.exp(s) / p["state_theta0"])) * (u**3 / 3 - u)
            a, psi0 = p["friction_a"], p["friction_psi0"]
            return a * math.asinh(u / (2 * psi0) * math.exp((0.6 + p["friction_b"] * (math.log(psi0 / D) + s)) / a))

        def rates(y, sign):
            u, e, s = map(float, y)
            F, a = friction(u, s), max(sign * u / D, 0)
            aged = (-a * (math.log(a) + s) if a else 0.) if p["state_law"] == "slip" else math.exp(-s) - a
            return [gamma * (e - F), (v - u) / gamma - delta * (e - F), aged]
        self.rates, self.v = rates, v

    def turn(self, y):
        """From psi = v to the next such passage the same way: y there and how long that took."""
        y, t, way = np.array(y, float), 0., np.sign(self.v)
        away = False
        for _ in range(40):
            sign = np.sign(y[0]) or np.sign(self.rates(y, 1)[0])

            def f(_, z, sign=sign):
                return self.rates(z, sign)

            def corner(_, z):
                return z[0]

            def passage(_, z):
                return way * (z[0] - self.v)
            corner.terminal = passage.terminal = True
            corner.direction, passage.direction = -sign, 1
            if y[0] == 0:  # off the corner
                y = y + 1e-14 * np.array(f(0, y))
            done = solve_ivp(f, (0, 1e3), y, method="DOP853", rtol=1e-13, atol=1e-14, events=[corner, passage] if away else [corner],
                             first_step=1e-6, max_step=np.inf if away else 0.05)
            if not away and np.any(way * (done.y[0] - self.v) < -1e-3):
                away = True
            y, t = done.y[:, -1].copy(), t + done.t[-1]
            if done.t_events[0].size:
                y[0] = 0.
                continue
            slope = self.rates(y, sign)
            late = (y[0] - self.v) / slope[0]
            return y - late * np.array(slope), t - late
        return None


def period_of(p, start):
    oscillator = Oscillator(p)

    def gap(point):
        turn = oscillator.turn([p["model_v"], *point])
        return turn[0][1:] - point if turn else np.array([1., 1])
    found = root(gap, start, options={"eps": 1e-7, "xtol": 1e-13})
    return oscillator.turn([p["model_v"], *found.x])[1] if np.max(abs(gap(found.x))) < 1e-10 else None


def compare(p, text):
    words = " ".join(f"-{name} {value}" for name, value in p.items())
    found, _ = run(words + " -out_file c.h5", command="cycle", code=None)
    if found["status"] != "done" or not found["psi_min"] < -1e-3 or not found["psi_max"] > 1e-3:
        return False
    with h5py.File("c.h5") as file:
        psi, eta, s = (file[name][:, 0] for name in ("psi", "eta", "theta"))
    way = np.sign(p["model_v"])
    above = way * (psi - p["model_v"]) >= 0
    k = np.flatnonzero(~above[:-1] & above[1:])
    k = k[0] if len(k) else 0
    part = (p["model_v"] - psi[k]) / (psi[k + 1] - psi[k])
    true = period_of(p, [eta[k] + part * (eta[k + 1] - eta[k]), np.log(s[k] + part * (s[k + 1] - s[k]))])
    if true is None:
        return False
    off = abs(found["period"] / true - 1)
    assert off < found["error_estimate"] + 3e-12, f"{text}: {found['period']} for {true}, off by {off}, not {found['error_estimate']}"
    assert p["state_law"] == "slip" or off < 1e-11, f"{text}: off by {off}"
    return True


def test_periods_with_corners(scenes):
    drawn = compared = 0
    for index, p in scenes(draw, 343, short=4):
        drawn += 1
        compared += compare(p, f"scene {index}: {p}")
    assert compared > drawn / 5, f"{compared} of {drawn}"


def test_printed_error_of_a_period():
    found, _ = run(FEW_WAVENUMBERS, command="cycle")
    assert abs(found["period"] / 31.28718576415 - 1) < 2e-13 + found["error_estimate"]
    assert found["error_estimate"] < 1e-12 and found["multiplier_error"] < 1e-8


def test_trains_with_corners():
    """The translation mode of a train that turns back is as exact as that of others."""
    for viscosity in (0, 0.01):
        found, _ = run("-model_gamma 4 -model_v 0.4 -state_law contact-age -state_D 0.5 -state_b 0.3 -wave_speed 2 -wave_spectrum "
                       f"-spectrum_count 2 -model_nu {viscosity}", command="wave")
        assert found["psi_min"] < 0 and found["translation_error"] < 1e-8, found["translation_error"]
