"""Friction that sticks, in the continuum and in chains, against an integration of its own: each node is at rest, or slides
to one side, until it changes, and every change ends a segment of scipy's DOP853."""
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

    def force(self, psi, tau):
        """Of sliding nodes without its sign; `psi` along the motion."""
        if self.s["law"] == "coulomb":
            return self.a * tau * self.s["fd"]
        top = 1 - self.s["sigma"]
        return self.a * tau * top / (1 + 2 * self.s["alpha"] * psi / top)

    def threshold(self, tau):
        return self.a * tau * (self.s["fs"] if self.s["law"] == "coulomb" else 1)

    def parts(self, y):
        psi, eta = y[:self.n], y[self.n:2 * self.n]
        return psi, eta, y[2 * self.n:] if self.healing else np.ones(self.n)

    def rate(self, t, y):
        psi, eta, tau = self.parts(y)
        F = np.where(self.dir == 0, eta, self.dir * self.force(psi * self.dir, tau))
        out = [np.where(self.dir == 0, 0, self.A * (eta - self.B * psi - F)),
               self.K0 * (self.v - psi) + self.D @ psi - self.damping * np.where(self.dir == 0, 0, eta - F)]
        if self.healing:
            out.append((self.s["tau_inf"] - tau) / self.s["t_h"] - np.abs(psi) / self.s["D"] * (tau - 1))
        return np.concatenate(out)

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
                    t, fresh = first
                    y = inside(t)
                    self.change(fresh, y)
                    changes, changed = changes + 1, True
                elif fresh >= 0 and gaps[-1, fresh] > 1e-9:
                    fresh = -1
            if not changed:
                t, y = solver.t, solver.y
        return y, changes


def draw(random):
    chain = bool(random.random() < 0.3)
    s = dict(chain=chain, n=int(random.integers(9, 21)), order=2 if chain else int(random.choice([2, 4, 6, 8])),
             ring=bool(random.random() < 0.5), v=random.uniform(0.02, 0.3), law=str(random.choice(["coulomb", "carlson-langer"])),
             state="healing" if random.random() < 0.3 else "none", seed=int(random.integers(1, 10**6)),
             spread=random.uniform(0.05, 0.3), psi=random.uniform(0, 0.3), amplitude=random.uniform(0.05, 0.6),
             eta=random.uniform(-0.3, 0.6), t_end=random.uniform(2, 5), fs=1., fd=random.uniform(0.4, 1),
             sigma=random.uniform(0, 0.2), alpha=random.uniform(0.2, 1), t_h=random.uniform(1, 5), tau_inf=random.uniform(1.2, 2),
             D=random.uniform(0.3, 2))
    if chain:
        s.update(m=random.uniform(0.5, 2), k0=random.uniform(0.1, 1), k1=random.uniform(0.2, 2), f0=random.uniform(0.5, 1.5),
                 zeta=float(random.choice([0, 0.2])))
    else:
        s.update(gamma=random.uniform(0.5, 2), c=random.uniform(0.5, 1.5), delta=float(random.choice([0, random.uniform(0.05, 0.3)])),
                 sign=str(random.choice(["derived", "printed"])), length=random.uniform(5, 10))
    return s


def options_of(s):
    names = ("m", "k0", "k1", "f0", "zeta") if s["chain"] else ("gamma", "c", "delta")
    words = ["-model_form", "chain" if s["chain"] else "continuum", "-grid_n", s["n"], "-model_v", s["v"]]
    for name in names:
        words += ["-model_" + name, s[name]]
    if not s["chain"]:
        words += ["-grid_length", s["length"], "-grid_order", s["order"], "-model_delta_sign", s["sign"],
                  "-friction_spread_length", s["length"] / 6]
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


def test_motion(scenes):
    total = 0
    for index, s in scenes(draw, salt=610, short=12):
        frames = 5
        calls.run(options_of(s) + ["-init_type", "sine", "-init_psi", s["psi"], "-init_amplitude", s["amplitude"], "-init_eta",
                                   s["eta"], "-ts_max_time", s["t_end"], "-ts_rtol", 1e-11, "-ts_atol", 1e-12,
                                   "-out_frames", frames, "-scene_reduce", "off", "-out_file", "s.h5"])
        with h5py.File("s.h5") as file:
            t, fields = file["t"][:], [file[k][:] for k in (("psi", "eta", "tau") if s["state"] == "healing" else ("psi", "eta"))]
        medium = Medium(s, factors(s))
        y = np.concatenate([f[0] for f in fields])
        psi, eta, tau = medium.parts(y)
        # at the start a node whose psi is 0 rests where the threshold holds it
        medium.dir = np.where(psi != 0, np.sign(psi), np.where(np.abs(eta) > medium.threshold(tau), np.sign(eta), 0))
        for k in range(1, frames):
            y, changes = medium.advance(y, t[k - 1], t[k])
            total += changes
            expected = medium.parts(y)
            for name, values, own in zip(("psi", "eta", "tau"), fields, expected):
                error = np.abs(values[k] - own).max()
                assert error < 1e-6, f"scene {index} {s}: {name} off by {error:.2g} at t = {t[k]}"
            assert ((fields[0][k] == 0) == (medium.dir == 0)).all(), f"scene {index} {s}: who rests at t = {t[k]}"
    print(total, "changes")
    assert total > 20
