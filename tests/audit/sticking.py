"""Friction that sticks, integrated by itself: each node is at rest, or slides to one side, until it changes, and every
change ends a segment of scipy's DOP853."""
import h5py
import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

import calls

WEIGHTS = {2: [-2, 1], 4: [-5 / 2, 4 / 3, -1 / 12], 6: [-49 / 18, 3 / 2, -3 / 20, 1 / 90],
           8: [-205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]}


def second_difference(s):
    """Rings, and ends whose mirror images stand beyond them: about the end node, in a chain half a spacing beyond it."""
    n, D = s["n"], np.zeros((s["n"], s["n"]))
    for i in range(n):
        for k, w in enumerate(WEIGHTS[s["order"]]):
            for j in {i + k, i - k}:
                if s["ring"]:
                    j %= n
                elif s["chain"]:
                    j = -1 - j if j < 0 else 2 * n - 1 - j if j >= n else j
                else:
                    j = -j if j < 0 else 2 * (n - 1) - j if j >= n else j
                D[i, j] += w
    h = 1 if s["chain"] else s["length"] / (n if s["ring"] else n - 1)
    return D / h**2


class Medium:
    def __init__(self, s, factor):
        self.n, self.v, self.s = s["n"], s["v"], s
        if s["chain"]:
            self.A, self.B, self.K0, K1, self.damping = s["f0"] / s["m"], s["zeta"] / s["f0"], s["k0"] / s["f0"], \
                s["k1"] / s["f0"], 0
        else:
            self.A, self.B, self.K0, K1 = s["gamma"], 0, 1 / s["gamma"], s["c"]**2 / s["gamma"]
            self.damping = s["delta"] * (1 if s["sign"] == "derived" else -1)
        self.D = K1 * second_difference(s)
        self.a, self.dir = factor, np.zeros(s["n"])
        self.healing = s["state"] == "healing"
        self.segments = []  # of advance(): (begin, end, direction of every node, displacement and eta at the end)

    def force(self, psi, tau):
        """Of sliding nodes without its sign; `psi` along the motion."""
        if self.s["law"] == "coulomb":
            return self.a * tau * self.s["fd"]
        top = 1 - self.s["sigma"]
        return self.a * tau * top / (1 + 2 * self.s["alpha"] * psi / top)

    def threshold(self, tau):
        return self.a * tau * (self.s["fs"] if self.s["law"] == "coulomb" else 1)

    def start(self, psi, eta, tau=None):
        """The unknowns, behind them displacements; a node whose psi is 0 rests where the threshold holds it."""
        held = np.abs(eta) <= self.threshold(np.ones(self.n) if tau is None else tau)
        self.dir = np.where(psi != 0, np.sign(psi), np.where(held, 0, np.sign(eta)))
        return np.concatenate([psi, eta] + ([tau] if self.healing else []) + [np.zeros(self.n)])

    def parts(self, y):
        psi, eta = y[:self.n], y[self.n:2 * self.n]
        return psi, eta, y[2 * self.n:3 * self.n] if self.healing else np.ones(self.n)

    def rate(self, t, y):
        psi, eta, tau = self.parts(y)
        F = np.where(self.dir == 0, eta, self.dir * self.force(psi * self.dir, tau))
        out = [np.where(self.dir == 0, 0, self.A * (eta - self.B * psi - F)),
               self.K0 * (self.v - psi) + self.D @ psi - self.damping * np.where(self.dir == 0, 0, eta - F)]
        if self.healing:
            out.append((self.s["tau_inf"] - tau) / self.s["t_h"] - np.abs(psi) / self.s["D"] * (tau - 1))
        return np.concatenate(out + [psi])

    def gaps(self, y):
        """Positive until a node changes: psi along the motion, or the distance to the threshold."""
        psi, eta, tau = self.parts(y)
        return np.where(self.dir == 0, self.threshold(tau) - np.abs(eta), psi * self.dir)

    def change(self, i, y):
        psi, eta, tau = self.parts(y)
        if self.dir[i] == 0:
            self.dir[i] = np.sign(eta[i])
            return
        y[i] = 0
        self.dir[i] = np.sign(eta[i]) if abs(eta[i]) > self.threshold(tau)[i] else 0

    def advance(self, y, t, t_end):
        """y at t_end, and how many changes there were."""
        changes, fresh = 0, -1
        while t < t_end:
            solver = DOP853(self.rate, t, y, t_end, rtol=3e-12, atol=1e-13)
            changed = False
            while solver.status == "running" and not changed:
                solver.step()
                inside = solver.dense_output()
                times = np.linspace(solver.t_old, solver.t, 25)[1:]
                gaps = np.array([self.gaps(inside(s)) for s in times])
                if fresh >= 0:  # it begins at 0 and takes some time to leave it by more than round-off
                    gaps[gaps[:, fresh] > -1e-10, fresh] = 1
                bad = np.flatnonzero((gaps < 0).any(axis=1))
                if len(bad):
                    k, first = bad[0], (solver.t, None)
                    low = solver.t_old if k == 0 else times[k - 1]
                    for i in np.flatnonzero(gaps[k] < 0):
                        def gap(s, i=i):
                            return self.gaps(inside(s))[i]
                        at = brentq(gap, low, times[k], xtol=1e-14) if gap(low) > 0 else low
                        first = min(first, (at, i)) if first[1] is not None else (at, i)
                    begin, (t, fresh) = t, first
                    y = inside(t)
                    self.note(begin, t, y)
                    self.change(fresh, y)
                    changes, changed = changes + 1, True
                elif fresh >= 0 and gaps[-1, fresh] > 1e-9:
                    fresh = -1
            if not changed:
                self.note(t, solver.t, solver.y)
                t, y = solver.t, solver.y
        return y, changes

    def note(self, begin, end, y):
        self.segments.append((begin, end, self.dir.copy(), y[-self.n:].copy(), self.parts(y)[1].copy()))


def options_of(s):
    names = ("m", "k0", "k1", "f0", "zeta") if s["chain"] else ("gamma", "c", "delta")
    words = ["-model_form", "chain" if s["chain"] else "continuum", "-grid_n", s["n"], "-model_v", s["v"]]
    for name in names:
        words += ["-model_" + name, s[name]]
    if not s["chain"]:
        words += ["-grid_length", s["length"], "-grid_order", s["order"], "-model_delta_sign", s["sign"],
                  "-friction_spread_length", s.get("spread_length", s["length"] / 6)]
    words += ["-bc_left", "periodic" if s["ring"] else "free", "-friction_law", s["law"], "-friction_spread", s["spread"],
              "-friction_seed", s["seed"]]
    words += ["-friction_fs", s["fs"], "-friction_fd", s["fd"]] if s["law"] == "coulomb" else \
        ["-friction_sigma", s["sigma"], "-friction_alpha", s["alpha"]]
    if s["state"] == "healing":
        words += ["-state_law", "healing", "-state_t_h", s["t_h"], "-state_tau_inf", s["tau_inf"], "-state_D", s["D"]]
    return words


def factors(s):
    """The factors of the thresholds, from steady sliding at psi = 1."""
    calls.run(options_of({**s, "state": "none"}) + ["-init_psi", 1, "-init_eta", "steady", "-ts_max_time", 0,
                                                    "-out_file", "a.h5"])
    with h5py.File("a.h5") as file:
        eta = file["eta"][0] - (s["zeta"] / s["f0"] if s["chain"] else 0)
    medium = Medium(s, np.ones(s["n"]))
    return eta / medium.force(np.ones(s["n"]), 1)
