"""Rate-and-state sliders as laboratories and faults have them, drawn at random, and their motion by laboratory.cpp in ln psi and
ln theta, in which psi of any number of decades is one smooth function."""
import ctypes
import functools
import os
import subprocess
import tempfile

import numpy as np


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


class Chain(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int) for name in ("n", "regularised", "slip_law")] + \
               [(name, ctypes.c_double) for name in ("m", "k0", "k1", "f0", "zeta", "v", "a", "b", "D", "mu0", "psi0")]


@functools.lru_cache(None)
def compiled():
    with tempfile.TemporaryDirectory() as folder:
        library = os.path.join(folder, "laboratory.so")
        source = os.path.join(os.path.dirname(os.path.abspath(__file__)), "laboratory.cpp")
        subprocess.run(["c++", "-std=c++17", "-O2", "-shared", "-fPIC", "-o", library, source], check=True)
        return ctypes.CDLL(library)


def solved(p, times, rtol):
    """psi of all blocks at the times, and of each passage of the first block's psi up through v its time and d ln psi/dt."""
    n, mass = p["grid_n"], p["model_m"] > 0
    a, b, D, mu0, psi0 = (p["friction_" + name] for name in ("a", "b", "D", "mu0", "psi0"))
    chain = Chain(n, p["friction_law"] == "rate-and-state", p["state_law"] == "slip",
                  *(p["model_" + name] for name in ("m", "k0", "k1", "f0", "zeta", "v")), a, b, D, mu0, psi0)
    y, s = np.full(n, np.log(p["init_psi"])), np.full(n, np.log(p["init_state"]))
    friction = mu0 + a * (y - np.log(psi0)) + b * (s + np.log(psi0 / D))
    if chain.regularised:
        friction = a * np.arcsinh(np.exp(friction / a) / 2)
    start = np.ascontiguousarray(np.transpose([y, s, friction + p["model_zeta"] / p["model_f0"] * np.exp(y)][:3 if mass else 2]))
    times, out, passed = np.array(times, dtype=float), np.empty((len(times), *start.shape)), np.empty((100000, 2))
    pointers = [given.ctypes.data_as(ctypes.c_void_p) for given in (start, times, out, passed)]
    found = compiled().follow(ctypes.byref(chain), ctypes.c_double(rtol), pointers[0], len(times), *pointers[1:3], len(passed), pointers[3])
    assert 0 <= found < len(passed), f"the reference does not get through: {p}"
    return np.exp(out[:, :, 0]), passed[:found]


def motion(p, times, rtol):
    """psi of all blocks at the times."""
    return solved(p, times, rtol)[0]


def passages(p, until, rtol):
    """When psi of the first block rises through v, in the second half of the run, and how fast ln psi rises there; None where
    that does not repeat."""
    late, rise = solved(p, [until], rtol)[1].T
    late, rise = late[late > 0.5 * until], rise[late > 0.5 * until]
    if len(late) < 3 or np.ptp(np.diff(late)) > 1e-6 * np.diff(late).mean():
        return None
    return late, rise
