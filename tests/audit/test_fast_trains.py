"""Stability of trains at every speed, against a computation of its own that shares nothing with the program.

The train by LSODA; its perturbations u = exp(Lambda x) Q(t - x/V), Lambda = lambda/V, as solutions of

    r2 Q' = W - C Q - 2 c^2 (Lambda/V) Q,   W' = (c^2 Lambda^2 - 1) Q,   C = gamma (f^2 - 1) + s delta

which is u_tt + (C u)_t + u = c^2 u_xx, by Radau IIA of order 5 on LSODA's own steps, for many Lambda at once.
"""
import re

import numpy as np
from scipy.integrate import LSODA

from calls import run

ROOT6 = np.sqrt(6)
RADAU_C = np.array([(4 - ROOT6) / 10, (4 + ROOT6) / 10, 1])
RADAU_A = np.array([[(88 - 7 * ROOT6) / 360, (296 - 169 * ROOT6) / 1800, (-2 + 3 * ROOT6) / 225],
                    [(296 + 169 * ROOT6) / 1800, (88 + 7 * ROOT6) / 360, (-2 - 3 * ROOT6) / 225],
                    [(16 - ROOT6) / 36, (16 + ROOT6) / 36, 1 / 9]])
RADAU_A2 = RADAU_A @ RADAU_A


class Train:
    """f of r2 f'' + C(f) f' + f = v by integration: period, steps, and f at Radau points of the steps."""

    def __init__(self, gamma, s_delta, c, v, speed):
        self.c, self.speed, self.r2 = c, speed, (speed - c) * (speed + c) / speed**2
        self.damping = lambda f: gamma * (f**2 - 1) + s_delta
        force = lambda f: gamma * (f**3 / 3 - f) + s_delta * f
        rhs = lambda t, y: [(y[1] - force(y[0])) / self.r2, v - y[0]]
        jacobian = lambda t, y: [[-self.damping(y[0]) / self.r2, 1 / self.r2], [-1, 0]]
        state, self.period = np.array([v, force(v) + 0.3]), np.inf
        for _ in range(200):  # turns, each to the next passage of f = v upwards
            before = self.period
            state, self.period, steps = self.turn(rhs, jacobian, state, v)
            if abs(self.period / before - 1) < 2e-9:
                break
        self.h, self.f = steps

    def turn(self, rhs, jacobian, state, v):
        solver = LSODA(rhs, 0, state, 1e6, rtol=3e-12, atol=1e-13, jac=jacobian, first_step=1e-7 * self.r2)
        times, dense, below = [0.], [], False
        while True:
            solver.step()
            below = below or solver.y[0] < v
            times.append(solver.t)
            dense.append(solver.dense_output())
            if below and solver.y[0] >= v:
                break
        low, high = times[-2], times[-1]
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if dense[-1](middle)[0] < v else (low, middle)
        times[-1] = high
        starts, h = np.array(times[:-1]), np.diff(times)
        points = [[d(t + step * c)[0] for c in RADAU_C] for d, t, step in zip(dense, starts, h)]
        return dense[-1](high), high, (h, np.array(points))

    def log_multipliers(self, lam):
        """ln of the larger multiplier of Q over a period, for an array of lambda."""
        lam = np.atleast_1d(np.asarray(lam, complex))
        parts = max(1, int(np.ceil(np.max(np.abs(lam)) / self.speed * self.c * np.max(self.h) / 0.3)))
        product, log = (1, 0, 0, 1), 0
        for h, f in self.divided(parts):
            product = multiply(whole_product(self.step_matrices(lam, h, f)), product)
            size = np.max(np.abs(product), axis=0)
            product, log = [entry / size for entry in product], log + np.log(size)
        trace, det = product[0] + product[3], product[0] * product[3] - product[1] * product[2]
        root = np.sqrt(trace**2 / 4 - det)
        larger = np.where(np.abs(trace / 2 + root) > np.abs(trace / 2 - root), trace / 2 + root, trace / 2 - root)
        return np.log(larger) + log

    def divided(self, parts):
        h, f = self.h, self.f
        if parts > 1:  # quadratic through the three points of a step: only where steps are far shorter than waves
            at = (np.arange(parts)[:, None] + RADAU_C[None, :]).ravel() / parts
            factor = lambda i, j: (at - RADAU_C[j]) / (RADAU_C[i] - RADAU_C[j])
            basis = np.array([np.prod([factor(i, j) for j in range(3) if j != i], axis=0) for i in range(3)])
            f = (f @ basis).reshape(-1, 3)
            h = np.repeat(h / parts, parts)
        for k in range(0, len(h), 256):
            yield h[k:k + 256], f[k:k + 256]

    def step_matrices(self, lam, h, f):
        """The matrices (Q, W) -> (Q, W) of the steps, each for all lambda: the four entries, step by lambda.

        With W' = k Q put into its stages, those of Q are the solution of [1 - h A a - h^2 (k/r2) A^2] Q = q + h (w/r2) A 1
        with a = -(C + 2 c^2 lambda/V^2)/r2 at the stages: three equations, by Cramer's rule.
        """
        k = (self.c * lam / self.speed)**2 - 1
        slope = -(self.damping(f)[:, :, None] + 2 * lam * (self.c / self.speed)**2) / self.r2
        h = h[:, None]
        product = h**2 / self.r2 * k
        row = [[(i == j) - h * RADAU_A[i, j] * slope[:, j] - product * RADAU_A2[i, j] for j in range(3)] for i in range(3)]
        minor = lambda i, j: (row[(i + 1) % 3][(j + 1) % 3] * row[(i + 2) % 3][(j + 2) % 3]
                              - row[(i + 1) % 3][(j + 2) % 3] * row[(i + 2) % 3][(j + 1) % 3])
        cofactor = [[minor(i, j) for j in range(3)] for i in range(3)]
        det = sum(row[0][j] * cofactor[0][j] for j in range(3))
        by_q = [sum(cofactor[i][j] for i in range(3)) / det for j in range(3)]
        by_w = [sum(cofactor[i][j] * RADAU_C[i] for i in range(3)) * (h / self.r2) / det for j in range(3)]
        grown = [h * k * sum(RADAU_A[2, j] * by[j] for j in range(3)) for by in (by_q, by_w)]
        return by_q[2], by_w[2], grown[0], 1 + grown[1]


def multiply(later, earlier):
    """Products of matrices of two rows, by their entries."""
    a, b, c, d = later
    p, q, r, s = earlier
    return a * p + b * r, a * q + b * s, c * p + d * r, c * q + d * s


def whole_product(steps):
    while len(steps[0]) > 1:
        odd = [entry[-1:] if len(entry) % 2 else entry[:0] for entry in steps]
        pairs = len(steps[0]) // 2 * 2
        joined = multiply([entry[1:pairs:2] for entry in steps], [entry[0:pairs:2] for entry in steps])
        steps = [np.concatenate([entry, last]) for entry, last in zip(joined, odd)]
    return [entry[0] for entry in steps]


def draw(rng):
    gamma, c = np.exp(rng.uniform(np.log(0.5), np.log(8))), rng.uniform(0.5, 2)
    delta, sign = rng.uniform(0, 0.3) * gamma / 3, rng.choice(["derived", "printed"])
    s_delta = delta if sign == "derived" else -delta
    v = rng.uniform(0, 0.9) * np.sqrt(1 - s_delta / gamma)
    excess = np.exp(rng.uniform(np.log(1e-7), np.log(1e7)))
    return {"gamma": gamma, "s_delta": s_delta, "c": c, "v": v, "speed": c * (1 + excess),
            "pulses": int(rng.integers(1, 5)),
            "options": f"-model_gamma {gamma!r} -model_c {c!r} -model_delta {delta!r} -model_delta_sign {sign} "
                       f"-model_v {v!r} -wave_speed {c * (1 + excess)!r}"}


def nearest_turn(angle):
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


def along(train, sigma, top):
    """ln of the larger multiplier on Re lambda = sigma, 0 <= Im lambda <= top, as often as it takes to follow it."""
    omega = np.unique(np.concatenate([np.linspace(0, top, 33), top * np.geomspace(1e-6, 1, 41)]))
    log = train.log_multipliers(sigma + 1j * omega)
    while True:
        alive = np.maximum(log.real[1:], log.real[:-1]) > sigma * train.period - 0.3
        moved = np.hypot(np.diff(log.real), nearest_turn(np.diff(log.imag)))
        coarse = np.nonzero(alive & (moved > 0.5) & (np.diff(omega) > 1e-9 * top))[0]
        if len(coarse) == 0:
            return omega, log
        middle = (omega[coarse] + omega[coarse + 1]) / 2
        omega = np.insert(omega, coarse + 1, middle)
        log = np.insert(log, coarse + 1, train.log_multipliers(sigma + 1j * middle))


def counted_right(train, sigma, top, pulses):
    """Modes of the ring right of Re lambda = sigma: turns of ln y while |y| > 1, on Im lambda from -top to top."""
    period = train.period
    omega, log = along(train, sigma, top)
    size = log.real - sigma * period
    phase = log.imag[0] + np.concatenate([[0], np.cumsum(nearest_turn(np.diff(log.imag)))]) - omega * period
    total, begin, through_zero = 0, None, size[0] > 0
    for k in np.nonzero((size[:-1] > 0) != (size[1:] > 0))[0]:
        low, high = omega[k], omega[k + 1]
        at_low, at_high, phase_at = size[k], size[k + 1], phase[k]
        for _ in range(40):  # false position, the end that stays at half its value
            middle = low + (high - low) * at_low / (at_low - at_high)
            value = train.log_multipliers(sigma + 1j * middle)[0]
            here = value.real - sigma * period
            phase_at = phase[k] + nearest_turn(value.imag - log.imag[k]) - (middle - omega[k]) * period
            if abs(here) < 1e-13:
                break
            if (here > 0) == (at_low > 0):
                low, at_low, at_high = middle, here, at_high / 2
            else:
                high, at_high, at_low = middle, here, at_low / 2
        if begin is None and not through_zero:
            begin = phase_at
            continue
        if through_zero:  # the arc comes from minus its frequency, where the phase is minus that here
            begin = -phase_at
        span = np.floor(begin * pulses / (2 * np.pi)) - np.ceil(phase_at * pulses / (2 * np.pi)) + 1
        total += span if through_zero else 2 * span
        begin, through_zero = None, False
    return total


def check(scene, text):
    summary, _ = run(f"{scene['options']} -wave_pulses {scene['pulses']} -wave_spectrum true", command="wave")
    train = Train(scene["gamma"], scene["s_delta"], scene["c"], scene["v"], scene["speed"])
    period, speed, c = summary["period"], scene["speed"], scene["c"]
    assert abs(train.period / period - 1) < 1e-8, f"{text}: period {period}, not {train.period}"
    assert summary["complete"], f"{text}: {summary['completeness_check']}"

    # every mode listed is one, told from the carrier: its phase over a period
    modes = summary["eigenvalues"]
    lam = np.array([mode["re"] + 1j * mode["im"] for mode in modes])
    theta = 2 * np.pi * np.array([mode["bloch"] for mode in modes]) / scene["pulses"]
    off = train.log_multipliers(lam) - lam * period - 1j * theta
    error = np.hypot(off.real, nearest_turn(off.imag)) / period
    allowed = 2e-6 + 1e-15 * np.abs(lam)  # round-off of lambda T
    assert np.all(error < allowed), f"{text}: {error} at {lam}"

    # and none is missing
    said = re.match(r".*Re = (\S+), \|Im\| up to (\S+): (\d+) eigenvalues", summary["completeness_check"])
    sigma, top, count = said.groups()
    counted = counted_right(train, float(sigma), 1.5 * float(top), scene["pulses"])
    assert abs(counted - int(count)) <= 1e-5 * int(count), f"{text}: {count} right of {sigma}, not {counted}"

    # the infinite train: nothing grows faster, and that growth is reached
    growth, frequency = summary["endless"]["growth_rate"], summary["endless"]["frequency"]
    above = growth + 1e-5 + 1e-3 * growth
    _, log = along(train, above, 8 * speed / c)
    assert np.all(log.real < above * period), f"{text}: waves grow faster than {growth}"
    if growth > 0:
        reached = train.log_multipliers(growth + 1j * frequency)[0].real / period
        assert abs(reached - growth) < 1e-6, f"{text}: {growth} at {frequency} is {reached}"
    else:
        assert summary["endless"]["stable"]


def test_random_trains(scenes):
    for index, scene in scenes(draw, 201, short=2):
        check(scene, f"scene {index}: {scene['options']} -wave_pulses {scene['pulses']}")


def test_fast_trains_become_the_uniform_oscillation():
    """The leading mode of one pulse, whatever V: the Floquet-Bloch growth of the oscillation, at c^2 k^2 = 0.4436."""
    for speed, growth in ((50, 0.0271016), (200, 0.0270977), (2000, 0.0270974), (1e5, 0.0270974), (1e7, 0.0270974)):
        summary, _ = run(f"-wave_speed {speed} -wave_spectrum true", command="wave")
        endless = summary["endless"]
        assert abs(summary["growth_rate"] - growth) < 1e-7 and not summary["stable"]
        assert -1e-7 < endless["growth_rate"] - growth < 3e-6 and not endless["stable"]
        assert abs((endless["frequency"] / speed)**2 - 0.4436) < 1e-4, endless
        assert summary["complete"], summary["completeness_check"]
