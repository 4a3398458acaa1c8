"""Chains of blocks by scipy, which know nothing of the program: any ends, a plate whose velocity varies,
friction that does not stick and friction that does, in which each block rests or slides to one side until it
changes."""
import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq


class Plate:
    """v(t): straight from point to point of (t, v), steps where a time stands twice, and a sine on top."""

    def __init__(self, v, points=(), sine=None):
        self.points, self.sine = list(points) or [(0, v)], sine

    def corners(self, t_end):
        return sorted({t for t, _ in self.points if 0 < t < t_end}) + [t_end]

    def after(self, begin):
        """v on the piece that begins at this time."""
        before, behind = [p for p in self.points if p[0] <= begin], [p for p in self.points if p[0] > begin]
        (t0, v0), slope = (before or self.points)[-1 if before else 0], 0
        if before and behind:
            slope = (behind[0][1] - v0) / (behind[0][0] - t0)
        height, period = self.sine or (0, 1)
        return lambda t: v0 + slope * (t - t0) + height * np.sin(2 * np.pi * t / period)


class Blocks:
    """`s`: n, m, k0, k1, f0, zeta, left and right (None: a ring, "free", or the velocity that the end is held
    at), law with its parameters, stick ("exact" or the width over which the threshold is smoothed)."""

    def __init__(self, s, plate):
        n = self.n = s["n"]
        self.s, self.plate, self.v, self.exact = s, plate, None, s.get("stick") == "exact"
        self.moves = np.ones(n)
        self.pull = np.zeros((n, n))
        for i in range(n):
            for j in (i - 1, i + 1):
                if s["left"] is None or 0 <= j < n:
                    self.pull[i, i] -= 1
                    self.pull[i, j % n] += 1
        for end, node in ((s["left"], 0), (s["right"], n - 1)):
            if end not in (None, "free"):
                self.moves[node] = 0
        self.direction = np.zeros(n)

    def force(self, psi, state):
        s = self.s
        if s["law"] == "cubic":
            return psi**3 / 3 - psi
        if s["law"] == "rate-and-state":
            return s["a"] * np.arcsinh(psi / (2 * s["psi0"]) * np.exp(
                (s["mu0"] + s["b"] * (np.log(s["psi0"] / s["D"]) + state)) / s["a"]))
        if s["law"] == "coulomb":
            return s["fd"] * np.sign(psi)  # of a block that slides
        sign = self.direction if self.exact else np.tanh(psi / s["stick"])
        top = 1 - s["sigma"]
        return sign * top / (1 + 2 * s["alpha"] * psi * sign / top)

    def sliding_force(self, psi, state):
        return self.direction * self.s["fd"] if self.s["law"] == "coulomb" else self.force(psi, state)

    def threshold(self):
        return self.s["fs"] if self.s["law"] == "coulomb" else 1.

    def rate(self, t, y):
        s, (psi, eta, *state) = self.s, y.reshape(-1, self.n)
        friction = self.sliding_force(psi, state) if self.exact else self.force(psi, *state or [None])
        excess = eta - s["zeta"] / s["f0"] * psi - friction
        if self.exact:
            excess = np.where(self.direction == 0, 0, excess)
        rates = [self.moves * s["f0"] / s["m"] * excess,
                 s["k0"] / s["f0"] * (self.v(t) - psi) + s["k1"] / s["f0"] * (self.pull @ psi)]
        if state:
            rates.append(self.moves * (np.exp(-state[0]) - np.abs(psi) / s["D"]))
        return np.concatenate(rates)

    def gaps(self, y):
        """Positive until a block changes: psi along the motion, or the distance to the threshold."""
        psi, eta = y[:self.n], y[self.n:2 * self.n]
        return np.where(self.moves == 0, 1, np.where(self.direction == 0, self.threshold() - np.abs(eta),
                                                     psi * self.direction))

    def change(self, i, y):
        eta = y[self.n + i]
        if self.direction[i] != 0:
            y[i] = 0
        self.direction[i] = np.sign(eta) if self.direction[i] == 0 or abs(eta) > self.threshold() else 0

    def solution(self, y, t_end, tolerance):
        """y = (psi, eta, ln theta) at the end."""
        psi, eta, t = y[:self.n], y[self.n:2 * self.n], 0
        if self.exact:
            rests = (psi == 0) & (np.abs(eta) <= self.threshold())
            self.direction = np.where(rests, 0, np.sign(np.where(psi != 0, psi, eta)))
        for corner in self.plate.corners(t_end):
            self.v = self.plate.after(t)
            t, y = corner, self.advance(y, t, corner, tolerance)
        return y

    def advance(self, y, t, until, tolerance):
        fresh = -1
        while t < until:
            solver = DOP853(self.rate, t, y, until, rtol=tolerance, atol=tolerance / 10)
            changed = False
            while solver.status == "running" and not changed:
                solver.step()
                assert solver.status != "failed"
                if not self.exact:
                    continue
                inside = solver.dense_output()
                times = np.linspace(solver.t_old, solver.t, 25)[1:]
                gaps = np.array([self.gaps(inside(s)) for s in times])
                if fresh >= 0:  # it begins at 0 and takes some time to leave it by more than round-off
                    gaps[gaps[:, fresh] > -1e-10, fresh] = 1
                bad = np.flatnonzero((gaps < 0).any(axis=1))
                if len(bad):
                    low = solver.t_old if bad[0] == 0 else times[bad[0] - 1]
                    firsts = []
                    for i in np.flatnonzero(gaps[bad[0]] < 0):
                        def gap(s, i=i):
                            return self.gaps(inside(s))[i]
                        at = brentq(gap, low, times[bad[0]], xtol=1e-14) if gap(low) > 0 else low
                        firsts.append((at, i))
                    t, fresh = min(firsts)
                    y = inside(t)
                    self.change(fresh, y)
                    changed = True
                elif fresh >= 0 and gaps[-1, fresh] > 1e-9:
                    fresh = -1
            if not changed:
                t, y = solver.t, solver.y
        return y
