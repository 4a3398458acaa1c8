"""What a motion settles on: random chains of one to four unlike blocks with smooth friction, and what of their cycles SciPy says:
that the motion comes back after the period and after no part of it, the multipliers, the extremes, and, where the program
finds none, that the motion is at its sliding."""
import json

import numpy as np
from scipy.integrate import solve_ivp

from calls import call, check, data
from reference import System, read, words

LAWS = ("cubic", "carlson-langer", "coulomb", "stribeck", "rate-and-state", "dieterich", "n-shaped", "lugre")
OWN_AGE = ("rate-and-state", "dieterich", "n-shaped")


def scene(random):
    """Options by name; profiles are arrays."""
    n, law = int(random.integers(1, 5)), str(random.choice(LAWS))
    p = {"model_form": "chain", "grid_n": n, "model_f0": random.uniform(0.5, 1.5), "model_v": np.exp(random.uniform(np.log(0.05), 0)),
         "model_m": random.uniform(0.5, 2), "model_k0": random.uniform(0.1, 0.6), "model_zeta": random.uniform(0, 0.15),
         "friction_law": law, "init_psi": random.uniform(0.4, 1), "init_noise": 0.1, "init_seed": int(random.integers(1000)),
         "cycle_cell": 0}
    if n > 1:
        p |= {"bc_left": "free", "model_k1": random.uniform(0.05, 1.2)}
        for name in ("model_m", "model_k0", "model_zeta"):
            if random.random() < 0.4:
                p[name] = p[name] * random.uniform(0.6, 1.4, n)
        if random.random() < 0.5:
            p["friction_amplitude"] = random.uniform(0.7, 1.3, n)
    if law in ("carlson-langer", "coulomb", "stribeck"):
        p |= {"friction_stick": "regularised", "friction_eps": np.exp(random.uniform(np.log(0.005), np.log(0.2)))}
    if law == "carlson-langer":
        p |= {"friction_alpha": random.uniform(0.2, 1), "friction_sigma": random.uniform(0, 0.3)}
    if law == "coulomb":
        p |= {"friction_fd": random.uniform(0.5, 0.9), "friction_slip_velocity": random.uniform(0.05, 0.5)}
    if law == "stribeck":
        p |= {"friction_fs": 1, "friction_fc": random.uniform(0.4, 0.8), "friction_vs": random.uniform(0.1, 1)}
    if law == "lugre":
        p |= {"friction_fc": random.uniform(0.4, 0.8), "friction_fs": random.uniform(0.9, 1.2), "friction_vs": random.uniform(0.1, 1),
              "friction_sigma0": random.uniform(5, 60), "friction_sigma1": random.uniform(0, 0.5), "friction_sigma2": 0}
    if law in OWN_AGE:
        a, D = random.uniform(0.02, 0.15), random.uniform(0.2, 1.5)
        b = a * random.uniform(1.3, 2.5)
        p |= {"friction_a": a, "friction_b": b, "friction_D": D, "friction_mu0": 0.6, "friction_psi0": 1, "model_zeta": 0,
              "model_k0": (b - a) / D * p["model_f0"] * random.uniform(0.5, 1.1)}
        if law == "dieterich" and random.random() < 0.4:
            p["state_law"] = "prz"
    return p


def carried(system, u, period):
    """System.carried, by a method that stiff friction does not slow down."""
    N = len(u)

    def together(t, z):
        return np.concatenate([system.rates(t, z[:N]), (system.jacobian(z[:N], None, t) @ z[N:].reshape(N, N)).ravel()])
    start = np.concatenate([u, np.eye(N).ravel()])
    end = solve_ivp(together, (0, period), start, method="LSODA", rtol=1e-10, atol=1e-12).y[:, -1]
    return end[:N], end[N:].reshape(N, N)


def compare(p, what, multipliers=True):
    """Whether a cycle was found; what is said holds."""
    done = call(words(p) + ["-out_file", "c.h5", "-summary", "s.json"], command="cycle")
    what = f"{what}: {p}"
    check(done.returncode in (0, 1, 2), f"{what}: {done.stderr}")
    if done.returncode == 2:  # laws that hold for psi > 0 alone
        check("holds for psi > 0 alone" in done.stderr, f"{what}: {done.stderr}")
        return False
    if done.returncode == 1:
        known = ("settles on steady sliding", "comes to rest", "never repeats", "has not settled", "grows without bound")
        check(any(word in done.stderr for word in known), f"{what}: {done.stderr}")
        if known[0] in done.stderr:
            rates = System(p).eigenvalues()
            check(rates.real.max() < 1e-6, f"{what}: sliding that is unstable ({rates.real.max()}): {done.stderr}")
        return False
    with open("s.json", encoding="utf-8") as file:
        found = json.load(file)
    file, T, system = data("c.h5"), found["period"], System(p)
    size = np.maximum(1e-9, np.ptp(np.array([read(file, k) for k in range(len(file["t"]))]), axis=0))
    start = read(file, 0)
    course = solve_ivp(system.rates, (0, T), start, method="LSODA", rtol=1e-10, atol=1e-12, dense_output=True).sol
    missed = (abs(course(T) - start) / size).max()
    check(missed < 1e-4, f"{what}: misses by {missed}")
    if multipliers:
        end, matrix = carried(system, start, T)
        known = np.linalg.eigvals(matrix)
        mine = np.array([z["re"] + 1j * z["im"] for z in found["multipliers"]])
        grown = max(1, abs(known).max())
        check((abs(end - start) / size).max() < 1e-6 * grown, f"{what}: misses by {(abs(end - start) / size).max()}")
        d = abs(mine[:, None] - known[None, :])
        check(max(d.min(axis=0).max(), d.min(axis=1).max()) < 2e-4 * grown, f"{what}: multipliers {mine} instead of {known}")
    # the shortest period; the largest psi between the points that are stored
    for part in range(2, 13):
        gone = abs(course(T / part) - start) / size
        check(gone.max() > 1e-5, f"{what}: T is {part} times the period")
    psi = course(np.linspace(0, T, 40001))[:system.n]
    for value, sign in (("psi_max", 1), ("psi_min", -1)):
        seen = sign * (sign * psi).max()
        check(abs(found[value] - seen) < 1e-5 * np.ptp(psi), f"{what}: {value} {found[value]} instead of {seen}")
    return True
