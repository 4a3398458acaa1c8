"""Blocks with friction that goes by the logarithm of velocity, in the paper's units and in those of a laboratory, down
to masses that make psi a slave of the force: the largest force and the period against Radau's method for ln psi."""
import math

import h5py
import numpy as np
from scipy.integrate import solve_ivp

import calls


def draw(rng):
    """A block on a spring below the critical stiffness, pulled from a tenth of the plate's velocity, or from a force so
    far below friction's that it all but stands. -> law, state law, numbers of the scene"""
    law = str(rng.choice(["rate-and-state", "dieterich"]))
    state = str(rng.choice(["ageing", "slip", "prz"] if law == "dieterich" else ["ageing", "slip"]))
    part = 10 ** rng.uniform(-1.3, -0.2)  # of the critical stiffness
    if rng.random() < 0.5:  # the paper's
        a, v, f0, D = 10 ** rng.uniform(-3.5, -2), 10 ** rng.uniform(-4, -1), 1.0, 10 ** rng.uniform(-3, -1)
        inertia = 10 ** rng.uniform(-4, 0)  # a natural period over D/v, in parts of 2 pi
    else:
        a, v, f0, D = rng.uniform(0.004, 0.02), 10 ** rng.uniform(-7, -4), 10 ** rng.uniform(3, 7), 10 ** rng.uniform(-6, -4)
        inertia = 10 ** rng.uniform(-6, -2)
    b = a * rng.uniform(1.3, 2.5)
    k0 = part * f0 * (b - a) / D
    # not so low that psi = psi0 exp((eta - mu0)/a) is no number any more
    eta = None if rng.random() < 0.4 else max(rng.uniform(0, 0.6), 0.6 - 600 * a)
    return dict(law=law, eta=eta, state=state, a=a, b=b, D=D, mu0=0.6, psi0=v * 10 ** rng.uniform(-1, 2), v=v, f0=f0, k0=k0,
                m=k0 * (inertia * D / v) ** 2)


def until(p):
    """About five periods: the force falls by 20 (b - a) or less, and rises by k0 v; behind the first rise."""
    rise = 100 * (p["b"] - p["a"]) + (0 if p["eta"] is None else 0.8 - p["eta"])
    return rise * p["f0"] / (p["k0"] * p["v"])


def options(p):
    return (f"-model_form chain -grid_n 1 -bc_left free -friction_law {p['law']} -state_law {p['state']} " +
            " ".join(f"-friction_{k} {p[k]!r}" for k in ("a", "b", "D", "mu0", "psi0")) +
            " " + " ".join(f"-model_{k} {p[k]!r}" for k in ("v", "f0", "k0", "m")) +
            f" -init_psi {0.1 * p['v']!r} -init_eta {'steady' if p['eta'] is None else repr(p['eta'])}")


def reference(p):
    """The same in ln(psi/v) and ln(v theta/D), with theta/2 in place of theta for prz.
    -> times and forces of the steps, times of passage upwards through v; None where scipy gives up"""
    a, b, D, mu0, v, A, K0 = p["a"], p["b"], p["D"], p["mu0"], p["v"], p["f0"] / p["m"], p["k0"] / p["f0"]
    half = 2 if p["state"] == "prz" else 1  # its steady theta is 2 D/v
    regular = p["law"] == "rate-and-state"
    base = mu0 + b * math.log(p["psi0"] / v) - a * math.log(p["psi0"] / v)  # F at psi = v, theta = D/v

    def friction(w, s):
        if not regular:
            return base + a * w + b * s
        l = (mu0 + b * (math.log(p["psi0"] / v) + s)) / a + w + math.log(v / (2 * p["psi0"]))
        return a * (np.arcsinh(np.exp(l)) if l < 30 else l + math.log(2))

    def rate(t, y):  # in units of D/v
        w, eta, s = y
        psi, theta = np.exp(w), np.exp(s)
        g = {"ageing": lambda: 1 / theta - psi, "slip": lambda: -psi * (w + s),
             "prz": lambda: 1 / (half * theta) - psi * psi * theta / half}[p["state"]]()
        # F follows eta within 1e-6 of D/v, though inertia would have it faster
        return [(eta - friction(w, s)) / (psi * v * v / (A * D) + 1e-6 * a), K0 * D * (1 - psi), g]

    def passes(t, y):
        return y[0]
    passes.direction = 1
    start = [math.log(0.1), 0, math.log(10)]
    start[1] = friction(start[0], start[2]) if p["eta"] is None else p["eta"]
    try:
        found = solve_ivp(rate, (0, until(p) * v / D), start, method="Radau", rtol=1e-8, atol=1e-10, events=passes)
    except ValueError:  # psi beyond all numbers
        return None
    if not found.success:  # a fall in velocity that ends within the round-off of the time
        return None
    return found.t * D / v, found.y[1], found.t_events[0] * D / v


def test_force_and_period(scenes):
    for index, p in scenes(draw, 631, 2):
        right = reference(p)
        if right is None:
            continue
        t, eta, passes = right
        text = options(p)
        s, _ = calls.run(f"{text} -ts_max_time {until(p)!r} -out_file creep.h5 -out_frames 2")
        with h5py.File("creep.h5") as f:
            at, force = f["series/t"][:], f["series/eta_mean"][:]
        reached = force[at > 0.3 * at[-1]].max(), eta[t > 0.3 * t[-1]].max()
        # of the range over which the force goes; a step's error of 1e-6 of the force is 1e-6/a of velocity
        off = abs(reached[0] - reached[1]) / np.ptp(eta)
        assert off < 3e-3, f"scene {index}: the largest force is {reached[0]}, right {reached[1]}: {text}"
        if len(passes) < 4 or not s["period"]:
            continue
        intervals = np.diff(passes)[-2:]
        if np.ptp(intervals) < 1e-3 * intervals[-1]:
            off = abs(s["period"] / intervals[-1] - 1)
            assert off < 2e-3, f"scene {index}: the period is {s['period']}, right {intervals}: {text}"
