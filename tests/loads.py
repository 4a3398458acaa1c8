"""Loads as functions of time, of model.md: the plate's velocity, a harmonic force, the normal load. Nothing here is shared with the
program."""
import numpy as np

LEGENDRE = np.polynomial.legendre.leggauss(30)


class Plate:
    """v(t): straight from point to point of load_v, a step where a time stands twice, and a sine on top. Or another load."""

    def __init__(self, p, points="load_v", sine="load_sine", constant=None):
        pairs = [pair.split(":") for pair in p[points].split(",") if pair]
        self.points = [(float(t), float(v)) for t, v in pairs] or [(0., p["model_v"] if constant is None else constant)]
        self.height, self.period = p[sine + "_amplitude"], p[sine + "_period"]

    def pieces(self, begin, end):
        """(begin, end) of each part of that time in which v(t) is smooth."""
        times = [begin, *sorted({t for t, _ in self.points if begin < t < end}), end]
        return list(zip(times, times[1:]))

    def after(self, begin):
        """v on the piece that holds that time or begins there, as a function that goes on beyond its ends."""
        before, behind = [p for p in self.points if p[0] <= begin], [p for p in self.points if p[0] > begin]
        (t0, v0), slope = before[-1] if before else self.points[0], 0
        if before and behind:
            slope = (behind[0][1] - v0) / (behind[0][0] - t0)
        return lambda t: v0 + slope * (t - t0) + self.height * np.sin(2 * np.pi * t / self.period)

    def way(self, end, begin=0):
        """The integral of v over that time."""
        x, weights, total = *LEGENDRE, 0
        for a, b in self.pieces(begin, end):
            parts = np.linspace(a, b, 2 + int((b - a) / self.period))
            total += sum((d - c) / 2 * weights @ self.after(a)(c + (d - c) * (1 + x) / 2) for c, d in zip(parts, parts[1:]))
        return total


class Loads:
    """Of a scene's options: v(t), N(t) (`normal`, a function as v is), the harmonic force, the answer alpha of ln theta to ln N."""

    def __init__(self, p):
        self.plate, self.normal = Plate(p), Plate(p, "load_normal", "load_normal_sine", 1.)
        self.force, self.turn = p["load_force_sine_amplitude"], 2 * np.pi / p["load_force_sine_period"]
        self.alpha = p["state_linker_dieterich"]

    def pieces(self, begin, end):
        """(begin, end) of each part of that time in which all are smooth."""
        times = sorted({t for load in (self.plate, self.normal) for piece in load.pieces(begin, end) for t in piece})
        return list(zip(times, times[1:]))

    def push(self, t):
        return self.force * np.sin(self.turn * t)

    @staticmethod
    def log_rate(normal, t):
        """N'/N of a piece, by a complex step."""
        return np.imag(normal(t + 1e-30j)) / 1e-30 / normal(t)
