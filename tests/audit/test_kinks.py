"""Periods of oscillations that pass rest, where |psi| in the state law turns a corner: against DOP853 from corner to corner, each
side with its own sign, and a fixed point of its return map. The printed error is no smaller than the true one."""
import h5py
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from calls import run
from reference import Law

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
        self.law, self.v, self.gamma, self.delta = Law(p), p["model_v"], p["model_gamma"], p["model_delta"]

    def rates(self, y, side):
        psi, eta, s = map(float, y)
        excess = eta - self.law.force(psi, s, side)
        return np.array([self.gamma * excess, (self.v - psi) / self.gamma - self.delta * excess, self.law.rate(psi, s, side)])

    def turn(self, y, corners, rtol):
        """(eta, s) so many passages of rest later, and how long that took."""
        y, t = np.array([0., *y]), 0.
        for _ in range(corners):
            side = np.sign(self.rates(y, 0)[0])

            def corner(_, z):
                return z[0]
            corner.terminal, corner.direction = True, -side
            done = solve_ivp(lambda _, z, side=side: self.rates(z, side), (0, 1e3), y + 1e-14 * self.rates(y, side),
                             method="DOP853", rtol=rtol, atol=rtol / 10, events=corner, first_step=1e-6)
            if done.status != 1:
                return np.full(2, np.inf), np.inf
            y, t = done.y[:, -1] * [0, 1, 1], t + done.t[-1]
        return y[1:], t


def period_of(p, start, corners):
    """By Newton's method, at last with the slopes of turns that are less exact."""
    oscillator = Oscillator(p)

    def gap(point, rtol=1e-8):
        return oscillator.turn(point, corners, rtol)[0] - point
    found = root(gap, start, options={"eps": 1e-4}).x
    slopes = np.transpose([gap(found + step) - gap(found - step) for step in 1e-4 * np.eye(2)]) / 2e-4
    for _ in range(2):
        found = found - np.linalg.solve(slopes, gap(found, 1e-13))
    end, period = oscillator.turn(found, corners, 1e-13)
    return period if np.max(abs(end - found)) < 1e-10 else None


def compare(p, text):
    words = " ".join(f"-{name} {value}" for name, value in p.items())
    found, _ = run(words + " -out_file c.h5", command="cycle", code=None)
    if found["status"] != "done" or not found["psi_min"] < -1e-3 or not found["psi_max"] > 1e-3:
        return False
    with h5py.File("c.h5") as file:
        psi, eta, s = (file[name][:, 0] for name in ("psi", "eta", "theta"))
    at = np.flatnonzero((psi[:-1] < 0) != (psi[1:] < 0))
    k, part = at[0], psi[at[0]] / (psi[at[0]] - psi[at[0] + 1])
    true = period_of(p, [eta[k] + part * (eta[k + 1] - eta[k]), np.log(s[k] + part * (s[k + 1] - s[k]))], len(at))
    if true is None:
        return False
    off = abs(found["period"] / true - 1)
    assert off < found["error_estimate"] + 3e-12, f"{text}: {found['period']} for {true}, off by {off}, not {found['error_estimate']}"
    assert p["state_law"] == "slip" or off < 1e-11, f"{text}: off by {off}"
    return True


def test_periods_with_corners(scenes):
    drawn = compared = 0
    for index, p in scenes(draw, 343, short=1):
        drawn += 1
        compared += compare(p, f"scene {index}: {p}")
    assert compared > drawn / 5, f"{compared} of {drawn}"


def test_printed_error_of_a_period():
    found, _ = run(FEW_WAVENUMBERS, command="cycle")
    assert abs(found["period"] / 31.28718576415 - 1) < 2e-13 + found["error_estimate"]
    assert found["error_estimate"] < 1e-12 and found["multiplier_error"] < 1e-8


def test_trains_with_corners():
    """The translation mode of a train that turns back is as exact as that of others."""
    found, _ = run("-model_gamma 4 -model_v 0.4 -state_law contact-age -state_D 0.5 -state_b 0.3 -wave_speed 2 -wave_spectrum "
                   "-spectrum_count 2", command="wave")
    assert found["psi_min"] < 0 and found["translation_error"] < 1e-8, found["translation_error"]
