"""The equations of model.md in numpy and scipy, for tests: friction and state laws, the chain and the continuum, ends, loads,
viscosity between neighbours, profiles, and exact stick from start to stop. Nothing here is shared with the program.

A scene is a command line, or options by name (`friction_a`: a number, or an array with a value for each node; `model_k1` and
`model_c`: for each link behind a node). Unknowns stand kind behind kind, psi, eta and, with a state law, s: tau for healing, ln theta for the others. Axes before the last one are
batches. Functions of one node are analytic where it does not pass rest: slopes come of complex steps.
"""
import shlex
from functools import cached_property
from types import SimpleNamespace

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from differences import bloch, d2, linked  # noqa: F401: others take them from here
from loads import Loads, Plate  # noqa: F401: likewise

DEFAULTS = {"model_form": "continuum", "model_gamma": 3, "model_delta": 0.2, "model_delta_sign": "derived", "model_c": 1,
            "model_m": 1, "model_k0": 0.2, "model_k1": 0.2, "model_f0": 1, "model_zeta": 0, "model_nu": 0, "model_drag": 0, "model_v": 0.2,
            "grid_n": 512, "grid_length": 60, "grid_order": 4, "friction_law": "cubic", "friction_stick": "exact",
            "friction_eps": 1e-3, "friction_sigma": 0, "friction_alpha": 0.5, "friction_fs": 1, "friction_fd": 0.5,
            "friction_slip_velocity": 1e-2, "friction_a": 0.05, "friction_b": 0.1, "friction_mu0": 0.6, "friction_psi0": 1,
            "friction_fc": 0.5, "friction_vs": 1, "friction_p": 2, "friction_viscous": 0, "friction_Dc": 1,
            "friction_weakening": "exponential", "friction_sigma0": 100, "friction_sigma1": 1, "friction_sigma2": 0,
            "friction_table": "", "friction_table_beyond": "constant", "friction_psi_s": 1, "friction_amplitude": 1,
            "friction_back_slip": "true", "state_t_h": 1, "state_tau_inf": 2, "state_b": 0.1,
            "state_theta0": 1, "state_psi_h": 0.001, "load_v": "", "load_sine_amplitude": 0, "load_sine_period": 1,
            "load_force_sine_amplitude": 0, "load_force_sine_period": 1, "load_normal": "", "load_normal_sine_amplitude": 0,
            "load_normal_sine_period": 1, "state_linker_dieterich": 0}
STATE_LAWS = {"rate-and-state": "ageing", "n-shaped": "ageing-cutoff", "dieterich": "ageing", "slip-weakening": "slip-memory",
              "lugre": "bristles", "dahl": "bristles"}  # that go with a law unless another is named
OWN_STATE = ("rate-and-state", "n-shaped", "dieterich")  # with a, b, D
STORED = {"tau": np.array, "theta": np.log, "slip": np.array, "z": np.array}  # states of files
STEP = 1e-30  # of derivatives by complex steps


# ---- scenes ----

def options(words):
    """Options by name of a command line. Profiles become arrays over the blocks of a chain."""
    words, p = shlex.split(words) if isinstance(words, str) else [str(word) for word in words], {}
    for name, value in zip(words, words[1:] + [""]):
        if name[0] == "-" and name[1:2].isalpha():
            try:
                p[name[1:]] = float(value) if "." in value or "e" in value else int(value)
            except ValueError:
                p[name[1:]] = value
    for name in [name for name in p if name.endswith("_profile")]:
        x, values = np.array([pair.split(":") for pair in p.pop(name).split(",")], float).T
        name = name.removesuffix("_profile")
        of_springs = name == "model_k1"
        ring = not {"bc_left", "bc_right"} & p.keys() or p.get("bc_left") == "periodic"
        p[name] = np.interp(np.arange(p["grid_n"] - (of_springs and not ring)) + 0.5 * of_springs, x, values)
    return p


def words(p):
    """The command line of options by name: an array is the profile of a chain."""
    text = []
    for name, value in p.items():
        if isinstance(value, np.ndarray):
            first = 0.5 if name == "model_k1" else 0
            name, value = name + "_profile", ",".join(f"{i + first}:{float(at)!r}" for i, at in enumerate(value))
        text += ["-" + name, str(value)]
    return text


# ---- laws ----

class Curve:
    """SciPy's monotone cubics through the points at velocities >= 0, also for complex steps; what holds beside them: a force
    that falls does so down to 0."""

    def __init__(self, points, straight):
        self.points = np.array(sorted((speed, abs(force)) for speed, force in points.tolist() if speed >= 0))
        self.inside = PchipInterpolator(*self.points.T)
        self.steep = self.inside.derivative()
        self.slope = float(self.steep(self.points[-1, 0])) if straight else 0.

    def __call__(self, speed):
        x, (last, force) = np.real(speed), self.points[-1]
        at = np.clip(x, self.points[0, 0], last)
        beyond = np.maximum(force + self.slope * (x - last), 0)
        value = np.where(x > last, beyond, self.inside(at))
        slope = np.where(x > last, np.where(beyond > 0, self.slope, 0), np.where(x < self.points[0, 0], 0, self.steep(at)))
        return value + 1j * np.imag(speed) * slope if np.iscomplexobj(speed) else value


def straight(s, points):
    """Between the points a straight line, its slope in the imaginary part."""
    x, (at, value) = np.real(s), points.T
    slope = np.append(np.diff(value) / np.diff(at), 0.)[np.clip(np.searchsorted(at, x, "right") - 1, 0, len(at) - 1)]
    found = np.interp(x, at, value)
    return found + 1j * np.imag(s) * np.where(x < at[0], 0, slope) if np.iscomplexobj(s) else found


class Law:
    """F(psi, s) with the drag beside it, the rate g(psi, s) of the stored state s, its steady value, the threshold; amplitude
    included."""

    def __init__(self, p):
        self.name, self.state = p["friction_law"], p.get("state_law", STATE_LAWS.get(p["friction_law"], "none"))
        p = DEFAULTS | p
        self.c3, self.dragged = p["model_drag"], np.any(p["model_drag"])
        self.f, self.g = (SimpleNamespace(**{name.removeprefix(family): value for name, value in p.items()
                                             if name.startswith(family)}) for family in ("friction_", "state_"))
        if self.name in OWN_STATE:
            self.f.D = self.g.D = p.get("friction_D", p.get("state_D", 0.1))
        self.g.D = getattr(self.g, "D", 1)
        self.one_way = str(self.f.back_slip).lower() == "false"
        self.sticks = self.name in ("carlson-langer", "coulomb", "table", "stribeck",
                                    "slip-weakening") and self.f.stick == "exact"
        self.slips, self.renewed = self.name == "slip-weakening", self.state == "slip-since-stop"
        if self.slips and self.f.weakening == "table":
            self.points = np.array([pair.split(":") for pair in self.f.strength.split(",")], float)
        if self.name == "dahl":
            self.f.sigma1 = self.f.sigma2 = 0
        if self.name == "table":
            points = np.array([pair.split(":") for pair in self.f.table.split(",")], float)
            self.curve = [Curve(points * way, self.f.table_beyond == "slope") for way in (1, -1 if points[0, 0] < 0 else 1)]

    def sign(self, psi):
        return np.tanh(psi / self.f.eps) if self.f.stick == "regularised" else np.sign(np.real(psi))

    def strength(self, s):
        f = self.f
        if self.state == "healing":
            return s
        if self.slips:
            if f.weakening == "table":
                return straight(s, self.points)
            slid = s / f.Dc
            left = np.exp(-slid) if f.weakening == "exponential" else np.where(np.real(slid) < 1, 1 - slid, 0)
            return f.fd + (f.fs - f.fd) * left
        return 1 + self.g.b * np.log(1 + np.exp(s) / self.g.theta0) if self.state == "contact-age" else 1.

    def drag(self, psi, going=None):
        return 0. if not self.dragged else self.c3 * psi * psi * (np.sign(np.real(psi)) if going is None else going)

    def force(self, psi, s=0., going=None):
        """Of sliding nodes; `going`: the direction of each where psi does not tell."""
        return self.friction(psi, s, going) + self.drag(psi, going)

    def friction(self, psi, s=0., going=None):
        f = self.f
        if self.name == "cubic":
            return f.amplitude * self.strength(s) * (psi * psi * psi / 3 - psi)
        if self.state == "bristles":
            return f.amplitude * (f.sigma0 * s + f.sigma1 * self.rate(psi, s, going) + f.sigma2 * psi)
        if self.name in OWN_STATE:
            age = np.log(f.psi0 / f.D) + s - (np.log(2) if self.state == "prz" else 0)
            if self.name == "dieterich":
                return f.amplitude * (f.mu0 + f.a * np.log(psi / f.psi0) + f.b * age)
            if self.name == "n-shaped":
                age = np.log(np.exp(age) + f.psi0 / f.psi_s)
            return f.amplitude * f.a * np.arcsinh(psi / (2 * f.psi0) * np.exp((f.mu0 + f.b * age) / f.a))
        sign = self.sign(psi) if going is None else going
        if self.name == "tanh":
            phi = f.fc * np.tanh(psi / f.vs)
        elif self.name == "slip-weakening":
            phi = sign + 0 * psi
        elif self.name == "stribeck":
            phi = sign * (f.fc + (f.fs - f.fc) * np.exp(-((psi * sign + 0j) / f.vs)**f.p)) + f.viscous * psi
            phi = phi if np.iscomplexobj(psi) else np.real(phi)
        elif self.name == "table":
            phi = sign * np.where(np.real(sign) < 0, self.curve[1](psi * sign), self.curve[0](psi * sign))
        elif self.name == "carlson-langer":
            phi = sign * (1 - f.sigma) / (1 + 2 * f.alpha / (1 - f.sigma) * psi * sign)
        else:
            drop = np.exp(-psi * sign / f.slip_velocity) if f.stick == "regularised" else 0.
            phi = sign * (f.fd + (f.fs - f.fd) * drop)
        return f.amplitude * self.strength(s) * phi

    def threshold(self, s=0.):
        alone = {"coulomb": self.f.fs, "stribeck": self.f.fs, "table": self.curve[0](0.) if self.name == "table" else 0}
        return self.f.amplitude * self.strength(s) * alone.get(self.name, 1.)

    def rate(self, psi, s, going=None):
        g, slid = self.g, (np.sign(np.real(psi)) if going is None else going) * psi / self.g.D
        if self.state == "healing":
            return (g.tau_inf - s) / g.t_h - slid * (s - 1)
        if self.slips:
            moves = np.abs(np.sign(np.real(psi)) if going is None else going)
            return slid * g.D - s / g.t_h * {"slip-memory": 1, "slip-since-stop": 0, "slip-healed-at-rest": 1 - moves}[self.state]
        if self.state == "bristles":
            return psi - slid * g.D * s / self.bristles(psi)
        if self.state == "prz":
            return np.exp(-s) - (psi / (2 * g.D))**2 * np.exp(s)
        if self.state == "slip":
            return -slid * (np.log(np.where(slid == 0, 1, np.where(np.real(slid) < 0, -slid, slid))) + s)
        return np.exp(-s) - (np.sqrt(psi**2 + g.psi_h**2) / g.D if self.state == "ageing-cutoff" else slid)

    def steady(self, psi):
        g, slid = self.g, np.abs(psi) / self.g.D
        if self.state == "healing":
            return (g.tau_inf / g.t_h + slid) / (1 / g.t_h + slid)
        if self.state == "slip-memory":
            return np.abs(psi) * g.t_h
        if self.state == "bristles":
            return np.sign(psi) * self.bristles(psi)
        if self.state == "prz":
            slid = slid / 2
        return -np.log(np.hypot(psi, g.psi_h) / g.D if self.state == "ageing-cutoff" else slid)

    def bristles(self, psi):
        """The deflection of steady motion."""
        f = self.f
        return (f.fc + (0 if self.name == "dahl" else (f.fs - f.fc) * np.exp(-(psi / f.vs)**2))) / f.sigma0

    def slopes(self, psi, s, going=None):
        """F_psi, F_s, g_psi, g_s."""
        ways = (psi + 1j * STEP, s + 0j), (psi + 0j, s + 1j * STEP)
        rates = [np.imag(self.rate(*way, going)) / STEP for way in ways] if self.state != "none" else [0 * psi, 0 * psi]
        return [np.imag(self.force(*way, going)) / STEP for way in ways] + rates


# ---- the system ----

class System:
    """A scene's equations. `amplitude` of friction: of each node, where it is spread."""

    def __init__(self, scene, amplitude=None):
        given = dict(scene) if isinstance(scene, dict) else options(scene)
        p = self.p = DEFAULTS | given
        if amplitude is not None:
            p["friction_amplitude"] = np.asarray(amplitude)
        n, chain = self.n, chain = p["grid_n"], p["model_form"] == "chain"
        self.ends = ends = [p.get(f"bc_{end}", "free" if f"bc_{other}" in p and p[f"bc_{other}"] != "periodic" else "periodic")
                            for end, other in (("left", "right"), ("right", "left"))]
        if chain:
            f0, order, self.h = p["model_f0"], 2, 1.
            zeta = np.sqrt(0.1 * p["model_m"] * p["model_k1"]) if isinstance(p["model_zeta"], str) else p["model_zeta"]
            self.B, self.K0, self.K1, self.N = (x / f0 for x in (zeta, p["model_k0"], p["model_k1"], p["model_nu"]))
            self.A, self.sd = f0 / p["model_m"] if np.all(p["model_m"]) else np.inf, 0.
        else:
            gamma, order, self.B = p["model_gamma"], p["grid_order"], 0.
            self.A, self.K0, self.K1, self.N = gamma, 1 / gamma, p["model_c"]**2 / gamma, p["model_nu"] / gamma
            self.sd = p["model_delta"] * (1 if p["model_delta_sign"] == "derived" else -1)
            self.h = p["grid_length"] / (n if ends[0] == "periodic" else n - 1)
        self.D = d2(n, self.h, order, *ends, p["model_form"])
        if np.ndim(self.K1):  # unequal links, which stand in the matrix
            self.D, self.K1 = linked(self.K1 / self.h**2, n, ends, p["model_form"]), 1.
        self.held = {node: p.get(f"bc_{end}_value", p["model_v"]) for node, kind, end in
                     ((0, ends[0], "left"), (n - 1, ends[1], "right")) if kind == "velocity"}
        self.free = np.array([i for i in range(n) if i not in self.held])
        self.moves = np.isin(np.arange(n), self.free)  # not held
        self.law, self.loads = Law(p), Loads(p)
        self.plate, self.damped = self.loads.plate, np.any(self.B)
        self.kinds = 2 if self.law.state == "none" else 3
        self.v, self.normal, self.push = self.plate.after(0), self.loads.normal.after(0), self.loads.push
        self.going = None  # exact stick: the direction of each node, 0 at rest

    def split(self, u):
        parts = [u[..., k * self.n:(k + 1) * self.n] for k in range(self.kinds)]
        return parts if self.kinds == 3 else [*parts, np.zeros(self.n)]

    def second(self, psi):
        return psi @ self.D.T

    def by_fourier(self):
        """With derivatives of a ring by Fourier's method in place of the stencil."""
        wave = 2 * np.pi * np.fft.rfftfreq(self.n, self.h)
        self.second = lambda psi: np.fft.irfft(-wave**2 * np.fft.rfft(psi), self.n)
        return self

    def pull(self, u):
        """What friction is held against: eta + N D2 psi."""
        psi, eta, _ = self.split(u)
        return eta + self.N * self.second(psi) if self.N else eta

    def begin_piece(self, t, u=None):
        """Loads are from now on those behind t; the unknowns there, with the step of the state."""
        before, self.v, self.normal = self.normal(t), self.plate.after(t), self.loads.normal.after(t)
        if u is not None and self.kinds == 3 and self.loads.alpha:
            u = np.array(u)
            u[2 * self.n:] -= self.loads.alpha / self.law.f.b * np.log(self.normal(t) / before)
        return u

    def slides(self):
        return np.ones(self.n, bool) if self.going is None else self.going != 0

    def rates(self, t, u):
        u = np.asarray(u)
        psi, _, s = self.split(u)
        excess, moves = self.pull(u) - self.law.drag(psi, self.going), self.moves
        excess = excess + (self.push(t) - self.normal(t) * self.law.friction(psi, s, self.going))
        if self.going is not None:
            excess, moves = np.where(self.slides(), excess, 0), self.slides() & moves
        psi_t = self.A * (excess - self.B * psi if self.damped else excess)
        out = [psi_t if self.going is None and not self.held else np.where(moves, psi_t, 0),
               self.K0 * (self.v(t) - psi) + self.K1 * self.second(psi) - self.sd * excess]
        if self.kinds == 3:
            answer = self.loads.alpha / self.law.f.b * self.loads.log_rate(self.normal, t) if self.loads.alpha else 0
            out.append(self.law.rate(psi, s, self.going) - answer)
        return np.concatenate(out, axis=-1)

    def jacobian(self, u, D=None, t=0.):
        """d rates/du over all nodes; D: another matrix in place of D2, or several of them."""
        psi, _, s = self.split(np.real(u))
        D, n, i = self.D if D is None else np.asarray(D), self.n, np.arange(self.n)
        F_psi, F_s, g_psi, g_s = self.law.slopes(psi, s, self.going)
        F_psi, F_s = self.normal(t) * F_psi, self.normal(t) * F_s  # without drag, where N is not 1
        slide = 1. * self.slides()
        A, sd = self.A * slide * self.moves, self.sd * slide
        J = np.zeros((*D.shape[:-2], self.kinds, n, self.kinds, n), D.dtype)
        J[..., 0, :, 0, :], J[..., 1, :, 0, :] = (A * self.N)[:, None] * D, (self.K1 - sd * self.N)[:, None] * D
        diagonals = [[-A * (self.B + F_psi), A, -A * F_s], [sd * F_psi - self.K0, -sd, sd * F_s], [g_psi, 0, g_s]]
        for of, row in enumerate(diagonals[:self.kinds]):
            for by, values in enumerate(row[:self.kinds]):
                J[..., of, i, by, i] += values
        return J.reshape(*D.shape[:-2], self.kinds * n, self.kinds * n)

    def steady_psi(self):
        """K0 (v - psi) + K1 D2 psi = 0 between the held ends."""
        v, psi, free = self.p["model_v"], np.full(self.n, float(self.p["model_v"])), self.free
        for node, value in self.held.items():
            psi[node] = value
        rest = self.K1 * self.D @ (psi - v)
        if np.any(rest):
            psi[free] += np.linalg.solve((np.eye(self.n) * self.K0 - self.K1 * self.D)[np.ix_(free, free)], rest[free])
        return psi

    def at(self, psi):
        """The unknowns that go with psi where nothing changes but eta."""
        s = self.law.steady(psi) if self.kinds == 3 else np.zeros(self.n)
        eta = self.B * psi - self.N * self.D @ psi + self.law.force(psi, s)
        return np.concatenate([psi, eta, s][:self.kinds])

    @cached_property
    def steady(self):
        return self.at(self.steady_psi())

    def unknowns(self):
        """The indices of those that are solved for: none at held ends."""
        return np.concatenate([self.free + k * self.n for k in range(self.kinds)])

    def operator(self, D=None):
        """The Jacobian of steady sliding over the nodes that are not held."""
        at = self.unknowns()
        return self.jacobian(self.steady, D)[..., at[:, None], at]

    def eigenvalues(self):
        """Rightmost first."""
        values = np.linalg.eigvals(self.operator())
        return values[np.argsort(-values.real)]

    def follow(self, u, begin, end, method="DOP853", rtol=1e-12, atol=1e-13, **more):
        """The unknowns at the end, from corner to corner of the load."""
        self.begin_piece(begin)
        for a, b in self.loads.pieces(begin, end):
            u = self.begin_piece(a, u)
            u = solve_ivp(self.rates, (a, b), u, method=method, rtol=rtol, atol=atol, **more).y[:, -1]
        return u

    def carried(self, u, period, D=None, rtol=1e-11, atol=1e-12, begin=0.):
        """The end of the motion, and the matrix that takes deviations there: of each of the matrices D in place of D2."""
        D, N = np.asarray(self.D if D is None else D), len(u)
        shape = (*D.shape[:-2], N, N)

        def together(t, z):
            Y = z[N:].reshape(shape)
            return np.concatenate([self.rates(t, z[:N].real), (self.jacobian(z[:N], D, t) @ Y).ravel()])
        start = np.concatenate([u, np.broadcast_to(np.eye(N), shape).ravel()]).astype(D.dtype)
        end = solve_ivp(together, (begin, begin + period), start, method="DOP853", rtol=rtol, atol=atol).y[:, -1]
        return end[:N].real, end[N:].reshape(shape)


def waves(p, kappa2):
    """The operators of waves exp(ikx) on uniform sliding, D2 being -kappa2 (an array) on them."""
    one = {name: value for name, value in p.items() if not name.startswith(("bc_", "grid_"))} | {"grid_n": 1, "grid_order": 2}
    return System(one).operator(-np.asarray(kappa2, float)[:, None, None])


def read(fields, frame):
    """The unknowns of a frame of a file's fields (a dictionary)."""
    parts = [fields["psi"][frame], fields["eta"][frame]]
    parts += [stored(fields[name][frame]) for name, stored in STORED.items() if name in fields]
    return np.concatenate(parts)


def multipliers(found):
    """Those of a summary of cycle."""
    return np.array([m["re"] + 1j * m["im"] for m in found["multipliers"]])


def near(known, found, tolerance):
    """Each of the known numbers is found, and no others beside them."""
    assert len(known) == len(found)
    for one in known:
        assert np.abs(found - one).min() < tolerance * max(1, abs(one)), (one, found)


def amplitudes(p, psi, eta):
    """The amplitudes of friction that the program drew, out of its steady sliding."""
    system = System(p)
    s = system.law.steady(psi) if system.kinds == 3 else 0.
    return (eta - system.B * psi + system.N * system.D @ psi - system.law.drag(psi)) / system.law.friction(psi, s)


# ---- exact stick ----

class Stick:
    """A motion with exact stick: each node rests or slides to one side, until it starts or stops; each change ends a segment
    of DOP853 and is found by Brent's method. Deviations Y pass a change g = 0 as Y + (f' - f) (grad g . Y)/(grad g . f).
    With load_halt the plate stands, and its clock `plate` with it, while any node slides."""

    def __init__(self, system, u, t=0., Y=None, **settings):
        self.system, self.n, self.t, self.settings = system, system.n, t, {"rtol": 3e-12, "atol": 1e-13} | settings
        if float(system.p.get("load_normal_sine_amplitude", 0)):  # of which a resting node's rates know nothing
            self.settings = {"max_step": float(system.p["load_normal_sine_period"]) / 4} | self.settings
        self.u, self.slip, self.changes, self.fresh = np.array(u, float), np.zeros(self.n), 0, None
        self.plate, self.halts = t, str(system.p.get("load_halt", "false")).lower() != "false"
        self.Y = np.zeros((len(self.u), 0)) if Y is None else np.array(Y, float)
        system.begin_piece(t)
        psi, pull = self.u[:self.n], system.pull(self.u) + system.push(t)
        holds = self.below(self.u, t) >= 0
        system.going = np.where(psi != 0, np.sign(psi), np.where(holds, 0, np.sign(pull)))
        self.Y[:self.n][system.going == 0] = 0
        self.segments = []  # (begin, end, direction of every node, slip and unknowns at the end)

    @property
    def rests(self):
        return self.system.going == 0

    @property
    def halted(self):
        return self.halts and not self.rests.all()

    def below(self, u, t):
        """The distance to the threshold, without slip back to that ahead."""
        pull, law = self.system.pull(u) + self.system.push(t), self.system.law
        return self.system.normal(t) * law.threshold(self.system.split(u)[2]) - pull * (1 if law.one_way else np.sign(np.real(pull)))

    def gaps(self, u, t):
        """Positive until a node changes: psi along the motion, or the distance to the threshold. t: a number, or a column."""
        psi = self.system.split(u)[0]
        return np.where(self.system.moves, np.where(self.rests, self.below(u, t), psi * self.system.going), 1)

    def rate(self, t, z):
        N = len(self.u)
        Y = z[N + self.n:].reshape(N, -1)
        grown = (self.system.jacobian(z[:N], t=t) @ Y).ravel() if Y.size else Y.ravel()
        return np.concatenate([self.system.rates(t, z[:N]), z[:self.n], grown])

    def take(self, t, z):
        N = len(self.u)
        self.u, self.slip = z[:N].copy(), z[N:N + self.n].copy()
        self.Y = z[N + self.n:].reshape(N, -1).copy()
        self.segments.append((self.t, t, self.system.going.copy(), self.slip, self.u.copy()))
        self.plate += 0 if self.halted else t - self.t
        self.t = t

    def first_change(self, solver):
        """(time, node, the motion within the step) of the first change in a step; None."""
        inside, N = solver.dense_output(), len(self.u)
        times = np.linspace(solver.t_old, solver.t, 25)[1:]
        gaps = self.gaps(inside(times)[:N].T, times[:, None])
        if self.fresh is not None:  # it begins at 0 and takes some time to leave it by more than round-off
            gaps[gaps[:, self.fresh] > -1e-10, self.fresh] = 1
        bad = np.flatnonzero((gaps < 0).any(axis=1))
        if not len(bad):
            self.fresh = None
            return None
        low, high = solver.t_old if bad[0] == 0 else times[bad[0] - 1], times[bad[0]]

        def root(i):
            def gap(t):
                return self.gaps(inside(t)[:N], t)[i]
            return brentq(gap, low, high, xtol=1e-14) if gap(low) > 0 else low
        return (*min((root(i), i) for i in np.flatnonzero(gaps[bad[0]] < 0)), inside)

    def change(self, i):
        """Node i starts, stops, or turns."""
        system, before = self.system, self.system.rates(self.t, self.u)
        if self.Y.size:
            gradient = np.imag(self.gaps(self.u + 1j * STEP * np.eye(len(self.u)), self.t)[:, i]) / STEP
            by_time = np.imag(self.gaps(self.u, self.t + 1j * STEP)[i]) / STEP
        renewed = system.law.renewed and not self.rests[i]
        if not self.rests[i]:
            self.u[i] = 0
        if renewed:
            self.u[2 * self.n + i] = 0
        system.going = system.going.astype(float)
        turns = self.rests[i] or self.below(self.u, self.t)[i] < 0
        system.going[i] = np.sign(system.pull(self.u)[i] + system.push(self.t)) if turns else 0
        if self.Y.size:
            jump = system.rates(self.t, self.u) - before
            self.Y = self.Y + np.outer(jump, gradient @ self.Y) / (gradient @ before + by_time)
            if renewed:
                self.Y[2 * self.n + i] = 0
        self.fresh, self.changes = i, self.changes + 1

    def advance(self, end, on_change=None, most=None, plate=np.inf):
        """To that time, or that of the plate, or until so many changes; the unknowns there. on_change(self): after each."""
        while self.t < end and plate - self.plate > 1e-12 and (most is None or self.changes < most):
            until = self.system.loads.pieces(self.t, end)[0][1]
            self.u = self.system.begin_piece(self.t, self.u)
            if self.halted:
                self.system.v = lambda t: 0.
            until = until if self.halted else min(until, self.t + plate - self.plate)
            start = np.concatenate([self.u, self.slip, self.Y.ravel()])
            solver, found = DOP853(self.rate, self.t, start, until, **self.settings), None
            while solver.status == "running" and found is None:
                solver.step()
                assert solver.status != "failed", f"scipy stops at {solver.t}"
                found = self.first_change(solver)
                if found:
                    self.take(found[0], found[2](found[0]))
                    self.change(found[1])
                    if on_change:
                        on_change(self)
                else:
                    self.take(solver.t, solver.y)
        return self.u
