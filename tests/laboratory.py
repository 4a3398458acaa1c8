"""Rate-and-state sliders as laboratories and faults have them, drawn at random, and their motion by SciPy's Radau in ln psi and
ln theta, in which psi of any number of decades is one smooth function."""
import numpy as np
from scipy.integrate import solve_ivp


def draw(generator, most_blocks=20, with_mass=True):
    """Options of a chain whose blocks are alike: a law, a state law, and in metres, seconds and pascals what a machine or a fault
    has. k0 is 0.05 to 0.85 of the critical stiffness. Friction falls by (b - a) for each of some 18 e-folds of psi in a slip: mostly
    it stays above 0 there, and in every fourth scene all or nearly all of it may be lost. A mass is `light` times that with which
    inertia would matter in a slip, (zeta/2)^2/k0: from none to all."""
    a = 10 ** generator.uniform(-2.5, -1.5)
    mu0 = generator.uniform(0.3, 0.8)
    b = a + min(a * generator.uniform(0.2, 1.5), mu0 / 20)
    if generator.random() < 0.25:
        b = a + mu0 / 18 * 10 ** generator.uniform(-0.1, 0.3)
    D, v = 10 ** generator.uniform(-6, -3), 10 ** generator.uniform(-9, -5)
    f0, zeta = 10 ** generator.uniform(5.5, 8), 10 ** generator.uniform(6.3, 6.9)
    k0 = f0 * (b - a) / D * generator.uniform(0.05, 0.85)
    light = generator.choice([0, 10 ** generator.uniform(-6, 0)]) if with_mass else 0
    n = int(generator.choice([1, 1, 2, 5, most_blocks]))
    return {"model_form": "chain", "grid_n": n, "bc_left": "free", "bc_right": "free", "scene_reduce": "off",
            "model_m": float(light * zeta ** 2 / (4 * k0)), "model_k0": k0, "model_k1": k0 * 10 ** generator.uniform(0, 2), "model_f0": f0,
            "model_zeta": zeta, "model_v": v, "friction_law": str(generator.choice(["dieterich", "rate-and-state"])),
            "state_law": str(generator.choice(["ageing", "slip"])), "friction_a": a, "friction_b": b, "friction_D": D,
            "friction_mu0": mu0, "friction_psi0": v, "init_psi": v * generator.uniform(1.01, 1.2),
            "init_state": D / v, "init_eta": "steady"}


def rates(p):
    """x_t of x = ln psi, eta (with mass alone) and ln theta of all blocks, its derivatives by x (with mass alone), and x at the start."""
    n, m, f0, zeta, v = p["grid_n"], p["model_m"], p["model_f0"], p["model_zeta"], p["model_v"]
    a, b, D, mu0, psi0 = (p["friction_" + name] for name in ("a", "b", "D", "mu0", "psi0"))

    def springs(psi):
        beside = np.diff(psi)
        return p["model_k0"] * (v - psi) + p["model_k1"] * (np.r_[beside, 0] - np.r_[0, beside])

    def force(y, s):
        """F, and the share of the regularised law in the slopes a and b of the logarithm."""
        if p["friction_law"] == "dieterich":
            return mu0 + a * (y - np.log(psi0)) + b * (s + np.log(psi0 / D)), 1.
        z = y - np.log(2 * psi0) + (mu0 + b * (s + np.log(psi0 / D))) / a
        near = np.exp(np.minimum(z, 30))
        return a * np.where(z < 30, np.arcsinh(near), z + np.log(2)), near / np.sqrt(1 + near ** 2)

    def ageing(psi, s):
        if p["state_law"] == "ageing":
            return np.exp(-s) - psi / D
        return -psi / D * (np.log(psi / D) + s)

    def massless(_, x):
        y, s = x[:n], x[n:]
        psi, state_t, share = np.exp(y), ageing(np.exp(y), s), force(y, s)[1]
        return np.r_[(springs(psi) - f0 * b * share * state_t) / (f0 * a * share + zeta * psi), state_t]

    def massive(_, x):
        y, eta, s = x[:n], x[n:2 * n], x[2 * n:]
        psi = np.exp(y)
        return np.r_[(f0 * (eta - force(y, s)[0]) - zeta * psi) / (m * psi), springs(psi) / f0, ageing(psi, s)]

    pull = np.array([springs(column) - springs(np.zeros(n)) for column in np.eye(n)]).T

    def slopes(_, x):
        """d massive/dx, without which implicit methods spend their time on differences."""
        y, eta, s = x[:n], x[n:2 * n], x[2 * n:]
        psi, (F, share), i = np.exp(y), force(y, s), np.arange(n)
        J = np.zeros((3 * n, 3 * n))
        J[i, i] = f0 * (F - eta - a * share) / (m * psi)
        J[i, n + i], J[i, 2 * n + i] = f0 / (m * psi), -f0 * b * share / (m * psi)
        J[n:2 * n, :n] = pull * psi / f0
        moved = 1 if p["state_law"] == "ageing" else np.log(psi / D) + s + 1
        J[2 * n + i, i], J[2 * n + i, 2 * n + i] = -psi / D * moved, -np.exp(-s) if p["state_law"] == "ageing" else -psi / D
        return J

    y, s = np.full(n, np.log(p["init_psi"])), np.full(n, np.log(p["init_state"]))
    if m == 0:
        return massless, None, np.r_[y, s]
    return massive, slopes, np.r_[y, force(y, s)[0] + zeta / f0 * np.exp(y), s]


def solved(p, until, rtol, method, **more):
    f, slopes, start = rates(p)

    def passes(_, x):
        return x[0] - np.log(p["model_v"])
    passes.direction = 1
    if slopes is not None and method in ("Radau", "BDF"):
        more["jac"] = slopes
    seen = solve_ivp(f, (0, until), start, method=method, rtol=rtol, atol=rtol, events=passes, **more)
    assert seen.success, seen.message
    return seen


def motion(p, times, rtol, method="Radau"):
    """psi of all blocks at the times."""
    return np.exp(solved(p, times[-1], rtol, method, t_eval=times).y[:p["grid_n"]].T)


def passages(p, until, rtol, method):
    """When psi of the first block rises through v, in the second half of the run, and how fast ln psi rises there; None where
    that does not repeat."""
    seen = solved(p, until, rtol, method, dense_output=True)
    late = seen.t_events[0][seen.t_events[0] > 0.5 * until]
    if len(late) < 3 or np.ptp(np.diff(late)) > 1e-6 * np.diff(late).mean():
        return None
    before = late - 1e-6 * np.diff(late).mean()
    return late, (seen.sol(late)[0] - seen.sol(before)[0]) / (late - before)
