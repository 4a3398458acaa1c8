"""Trains with a contact state, against a computation of its own that shares nothing with the program.

With psi(x, t) = f(t - x/V) and r2 = 1 - c^2/V^2

    r2 f' = gamma [z - (s delta/gamma) f - F(f, s)],   z' = (v - f)/gamma,   s' = g(f, s)

is integrated by LSODA from slips of several sizes until it repeats itself. What the program solves for must be one of the
cycles found, and what it refuses must have none.
"""
import h5py
import numpy as np
from scipy.integrate import LSODA
from scipy.optimize import root

from calls import errors, run


def rate_and_state(a, b, D, law, mu0=0.6):
    """F = a asinh[(psi/2) exp((mu0 + b (s - ln D))/a)], s = ln theta."""
    def friction(f, s):
        return a * np.arcsinh(f / 2 * np.exp((mu0 + b * (s - np.log(D))) / a))

    def ageing(f, s):
        return np.exp(-s) - abs(f) / D

    def slip(f, s):
        return -abs(f) / D * (np.log(abs(f) / D) + s) if f else 0.
    return friction, {"ageing": ageing, "slip": slip}[law], lambda v: np.log(D / abs(v))


def carlson_langer(eps, alpha, law, D, strength, time):
    """phi = tanh(psi/eps)/(1 + 2 alpha |psi|) with |psi| = psi tanh(psi/eps), times tau or 1 + b ln(1 + theta)."""
    def phi(f):
        sign = np.tanh(f / eps)
        return sign / (1 + 2 * alpha * f * sign)
    if law == "healing":
        return (lambda f, s: s * phi(f), lambda f, s: (strength - s) / time - abs(f) / D * (s - 1),
                lambda v: (strength / time + abs(v) / D) / (1 / time + abs(v) / D))
    return (lambda f, s: (1 + strength * np.log1p(np.exp(s) / time)) * phi(f), lambda f, s: np.exp(-s) - abs(f) / D,
            lambda v: np.log(D / abs(v)))


def draw(rng):
    gamma, v, delta = rng.uniform(0.7, 3), rng.uniform(0.3, 1.3), rng.choice([0, rng.uniform(0, 0.1)])
    speed = 1 + np.exp(rng.uniform(np.log(0.05), np.log(10)))
    options = f"-model_gamma {gamma!r} -model_v {v!r} -model_delta {float(delta)!r} -wave_speed {speed!r}"
    D = rng.uniform(0.2, 0.8)
    if rng.random() < 0.5:
        law, a = rng.choice(["ageing", "slip"]), rng.uniform(0.05, 0.2)
        b = a * rng.uniform(1.2, 4)
        parts = rate_and_state(a, b, D, law)
        options += f" -friction_law rate-and-state -state_law {law} -friction_a {a!r} -friction_b {b!r} -friction_D {D!r}"
    else:
        law, eps, alpha = rng.choice(["contact-age", "healing"]), rng.uniform(0.1, 0.4), rng.uniform(0.3, 1)
        options += (f" -friction_law carlson-langer -friction_stick regularised -friction_eps {eps!r} -friction_sigma 0 "
                    f"-friction_alpha {alpha!r} -state_law {law} -state_D {D!r}")
        strength, time = (rng.uniform(1.2, 2.5), rng.uniform(0.3, 3)) if law == "healing" else (rng.uniform(0.1, 0.5), 1)
        options += (f" -state_tau_inf {strength!r} -state_t_h {time!r}" if law == "healing" else
                    f" -state_b {strength!r} -state_theta0 1")
        parts = carlson_langer(eps, alpha, law, D, strength, time)
    return {"gamma": gamma, "v": v, "delta": float(delta), "r2": 1 - 1 / speed**2, "parts": parts, "options": options}


class Oscillator:
    def __init__(self, scene):
        self.v, (self.friction, rate, steady) = scene["v"], scene["parts"]
        gamma, r2, delta, v = scene["gamma"], scene["r2"], scene["delta"], scene["v"]
        self.rhs = lambda t, y: [(gamma * (y[1] - self.friction(y[0], y[2])) - delta * y[0]) / r2, (v - y[0]) / gamma,
                                 rate(y[0], y[2])]
        self.sliding = np.array([v, delta / gamma * v + self.friction(v, steady(v)), steady(v)])

    def growth(self):
        """Of sliding: the largest real part of the eigenvalues of its Jacobian, by central differences."""
        columns = []
        for k in range(3):
            step = np.zeros(3)
            step[k] = 1e-6
            columns.append((np.array(self.rhs(0, self.sliding + step)) - self.rhs(0, self.sliding - step)) / 2e-6)
        return np.max(np.linalg.eigvals(np.array(columns).T).real)

    def turn(self, state, tolerance):
        """From f = v upwards to the next such passage: where, when, least and largest f. None where none comes in 5000
        steps."""
        solver = LSODA(self.rhs, 0, state, 1e4, rtol=tolerance, atol=tolerance / 10, first_step=1e-6)
        below, least, largest, slope = False, self.v, self.v, 1
        for _ in range(5000):
            solver.step()
            below = below or solver.y[0] < self.v
            dense = solver.dense_output()
            if below and solver.y[0] >= self.v:
                break
            before, slope = slope, self.rhs(0, solver.y)[0]
            if before * slope <= 0:
                inside = dense(np.linspace(solver.t_old, solver.t, 100))[0]
                least, largest = min(least, inside.min()), max(largest, inside.max())
        else:
            return None
        low, high = solver.t_old, solver.t
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if dense(middle)[0] < self.v else (low, middle)
        return dense(high), high, least, largest

    def cycles(self):
        """(period, least f, largest f) of every cycle that slips of several sizes settle on, or that Newton's method
        finds on their way where they do not settle."""
        found, unstable = [], self.growth() > 0
        for distance in (1, 0.1, 3, 0.02):
            state, period, size, change, moves = self.sliding + [0, distance, 0], np.inf, distance, 1, []
            for _ in range(60):
                turn = self.turn(state, 1e-7 if change > 1e-5 else 1e-11)
                if turn is None:
                    break
                moves.append((np.max(np.abs(turn[0] - state)), tuple(state)))
                before, size = size, np.hypot(*(turn[0] - self.sliding)[1:])
                if size < 1e-5 or (not unstable and size < min(before, 1e-2)):  # dies out
                    break
                change, state, period = max(abs(turn[1] / period - 1), abs(size / before - 1)), turn[0], turn[1]
                if change < 1e-8:
                    found.append(turn[1:])
                    break
            else:
                found += [] if found else self.closed_by_newton(np.array(min(moves)[1]))
        return found

    def closed_by_newton(self, state):
        def gap(point):
            turn = self.turn(np.array([self.v, *point]), 1e-11)
            return turn[0][1:] - point if turn else np.array([1., 1])
        solution = root(gap, state[1:], options={"eps": 1e-6, "xtol": 1e-10})
        away = np.hypot(*(solution.x - self.sliding[1:]))
        closed = np.max(np.abs(gap(solution.x))) < 1e-8 and away > 1e-4
        return [self.turn(np.array([self.v, *solution.x]), 1e-11)[1:]] if closed else []


    def returns(self, scene):
        run(scene["options"] + " -out_file train.h5", command="wave")
        with h5py.File("train.h5") as file:
            eta, theta = file["eta"][0], file["tau" if "tau" in file else "theta"][0]
        s = theta if "healing" in scene["options"] else np.log(theta)
        fall = scene["gamma"] * (eta - self.friction(self.v, s))  # f'
        z = eta - (1 - scene["r2"]) / scene["gamma"] * fall + scene["delta"] / scene["gamma"] * self.v
        turn = self.turn(np.array([self.v, z, s]), 1e-11)
        return [turn[1:]] if turn and np.max(np.abs(turn[0][1:] - [z, s])) < 1e-6 else []


def check(scene, text):
    oscillator = Oscillator(scene)
    summary, said = run(scene["options"], command="wave", code=None)
    cycles = oscillator.cycles()
    if summary["status"] != "done":
        assert not cycles, f"{text}: there is {cycles}, but {errors(said)}"
        unstable = oscillator.growth() > 0
        reason = "is unstable to waves of this speed" if unstable else "is stable to waves of this speed"
        assert reason in summary["reason"], f"{text}: {summary['reason']}"
        return
    if not cycles:  # one that repels too strongly to be found: does the program's own return to where it begins?
        cycles = oscillator.returns(scene)
    close = [abs(summary["period"] / period - 1) < 1e-7 and abs(summary["psi_min"] - least) < 1e-5 * largest
             and abs(summary["psi_max"] - largest) < 1e-5 * largest for period, least, largest in cycles]
    assert any(close), f"{text}: {summary['period']}, {summary['psi_min']}, {summary['psi_max']} is none of {cycles}"


def test_random_trains(scenes):
    for index, scene in scenes(draw, 202, short=6):
        check(scene, f"scene {index}: {scene['options']}")
