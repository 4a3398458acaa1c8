"""Trains with a contact state, against a computation of its own that shares nothing with the program.

With psi(x, t) = f(t - x/V) and r2 = 1 - c^2/V^2

    r2 f' = gamma [z - (s delta/gamma) f - F(f, s)],   z' = (v - f)/gamma,   s' = g(f, s)

is integrated by LSODA from slips of several sizes until it repeats itself. What the program solves for must be one of the
cycles found, and what it refuses must have none.
"""
import numpy as np
from scipy.integrate import LSODA
from scipy.optimize import root

from calls import data, errors, run
from reference import Law, words


def draw(rng):
    speed = 1 + np.exp(rng.uniform(np.log(0.05), np.log(10)))
    p = {"model_gamma": rng.uniform(0.7, 3), "model_v": rng.uniform(0.3, 1.3), "wave_speed": speed,
         "model_delta": float(rng.choice([0, rng.uniform(0, 0.1)]))}
    if rng.random() < 0.5:
        a = rng.uniform(0.05, 0.2)
        return p | {"friction_law": "rate-and-state", "state_law": str(rng.choice(["ageing", "slip"])), "friction_a": a,
                    "friction_b": a * rng.uniform(1.2, 4), "friction_D": rng.uniform(0.2, 0.8)}
    p |= {"friction_law": "carlson-langer", "friction_stick": "regularised", "friction_eps": rng.uniform(0.1, 0.4),
          "friction_sigma": 0, "friction_alpha": rng.uniform(0.3, 1), "state_D": rng.uniform(0.2, 0.8)}
    return p | ({"state_law": "healing", "state_tau_inf": rng.uniform(1.2, 2.5), "state_t_h": rng.uniform(0.3, 3)}
                if rng.random() < 0.5 else {"state_law": "contact-age", "state_b": rng.uniform(0.1, 0.5), "state_theta0": 1})


class Oscillator:
    def __init__(self, p):
        gamma, delta, v, law = p["model_gamma"], p["model_delta"], p["model_v"], Law(p)
        r2 = self.r2 = 1 - 1 / p["wave_speed"]**2
        self.v, self.law = v, law
        self.rhs = lambda t, y: [(gamma * (y[1] - law.force(y[0], y[2])) - delta * y[0]) / r2, (v - y[0]) / gamma,
                                 law.rate(y[0], y[2])]
        self.sliding = np.array([v, delta / gamma * v + law.force(v, law.steady(v)), law.steady(v)])

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

    def returns(self, p):
        run([*words(p), "-out_file", "train.h5"], command="wave")
        file = data("train.h5")
        eta, s = file["eta"][0], file["tau"][0] if "tau" in file else np.log(file["theta"][0])
        fall = p["model_gamma"] * (eta - self.law.force(self.v, s))  # f'
        z = eta - (1 - self.r2) / p["model_gamma"] * fall + p["model_delta"] / p["model_gamma"] * self.v
        turn = self.turn(np.array([self.v, z, s]), 1e-11)
        return [turn[1:]] if turn and np.max(np.abs(turn[0][1:] - [z, s])) < 1e-6 else []


def check(scene, text):
    oscillator = Oscillator(scene)
    summary, said = run(words(scene), command="wave", code=None)
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
    for index, scene in scenes(draw, 202, short=2):
        check(scene, f"scene {index}: {' '.join(words(scene))}")
