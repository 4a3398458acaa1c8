#!/usr/bin/env python3
"""Time to accuracy of this program, SUNDIALS and SciPy on the same systems, as one table.

    ninja -C build bench_peers && python3 tests/bench/peers.py build/tests/bench_peers [-peers_repeat 5] [-peers_scene 3]

bench_peers does the first two and leaves starts and solutions for the third: solve_ivp with a right-hand side in
numpy, as one writes it first, by each of SciPy's methods that suits the scene (banded Jacobians told by their
sparsity where the method takes that; LSODA, which would take a dense one, is left out). Every method goes down in
tolerance by factors of sqrt(10) until it has each accuracy; the processor time of that run counts. A run of three times the
best at an accuracy, or of LONGEST seconds, ends what is asked of a method. Beside times stand steps (rejected ones
included for this program), so that a ratio of times is one of steps and one of the price of a step.
"""
import collections
import os
import subprocess
import sys
import tempfile
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import bmat, diags, identity

TARGETS = [1e-4, 1e-6, 1e-9]
LONGEST = 4  # seconds of one run, after which a method goes no further
IMPLICIT = ["DOP853", "Radau", "RK45", "BDF"]
# as in peers_system.hpp: name, gamma, delta, c, v, end (ring, free, held), t_end, methods
SCENES = [("smooth ring", 3.0, 0.2, 1.0, 0.2, "ring", 10.0, ["DOP853", "RK45"]),
          ("stiff friction, gamma 300", 300.0, 0.2, 1.0, 0.2, "free", 60.0, IMPLICIT),
          ("stiff friction, gamma 10000", 1e4, 0.2, 1.0, 0.2, "free", 5.0, IMPLICIT),
          ("stiff coupling", 3.0, 0.2, 100.0, 0.2, "free", 10.0, IMPLICIT),
          ("pacemaker", 3.0, 0.2, 1.0, 0.2, "held", 20.0, ["DOP853", "RK45"]),
          ("rate-and-state", 5.0, 0.0, 1.0, 1.0, "free", 20.0, IMPLICIT)]
LENGTH = {"ring": 60.0, "free": 60.0, "held": 24.0}


def second_difference(psi, end, h):
    """Order 4; even reflection at free ends; beyond a held one the cubic through the nodes beside it."""
    if end == "ring":
        near, far = np.roll(psi, 1) + np.roll(psi, -1), np.roll(psi, 2) + np.roll(psi, -2)
    else:
        left = psi[2:0:-1] if end == "free" else [0, 4 * psi[0] - 6 * psi[1] + 4 * psi[2] - psi[3]]
        wide = np.concatenate([left, psi, psi[-2:-4:-1]])
        near, far = wide[1:-3] + wide[3:-1], wide[:-4] + wide[4:]
    return (-2.5 * psi + 4 / 3 * near - far / 12) / h**2


def system(scene, n):
    """The right-hand side for u = (psi, eta[, ln theta]), and the sparsity of its Jacobian."""
    name, gamma, delta, c, v, end, *_ = scene
    h = LENGTH[end] / (n if end == "ring" else n - 1)
    with_state = name == "rate-and-state"
    a, b, mu0, psi0, D = 0.05, 0.07, 0.6, 1.0, 0.1

    def rhs(_, u):
        psi, eta = u[:n], u[n:2 * n]
        if with_state:
            state = u[2 * n:]
            force = a * np.arcsinh(psi / (2 * psi0) * np.exp((mu0 + b * (np.log(psi0 / D) + state)) / a))
        else:
            force = psi**3 / 3 - psi
        excess = eta - force
        f = [gamma * excess, (v - psi) / gamma + c**2 / gamma * second_difference(psi, end, h) - delta * excess]
        if end == "held":
            f[0][0] = f[1][0] = 0
        if with_state:
            f.append(np.exp(-state) - np.abs(psi) / D)
        return np.concatenate(f)

    band, one = diags([np.ones(n)] * 5, [-2, -1, 0, 1, 2], shape=(n, n)), identity(n)
    blocks = [[one, one, one], [band, one, one], [one, None, one]] if with_state else [[one, one], [band, one]]
    return rhs, bmat(blocks)


def by_unknown(path, unknowns):
    return np.fromfile(path).reshape(-1, unknowns).T.ravel()


def scipy_rows(number, folder):
    scene = SCENES[number]
    name, t_end, methods = scene[0], scene[6], scene[7]
    unknowns = 3 if name == "rate-and-state" else 2
    start, end = (by_unknown(os.path.join(folder, f"{number}.{part}"), unknowns) for part in ("start", "end"))
    rhs, sparsity = system(scene, len(start) // unknowns)
    best = dict.fromkeys(TARGETS, np.inf)
    for method in methods:
        settings = {"jac_sparsity": sparsity} if method in ("BDF", "Radau") else {}
        tolerance = 1e-2
        for target in TARGETS:
            error, seconds, steps = np.inf, 0, 0
            while error > target and tolerance > 2.3e-14 and seconds < min(LONGEST, 3 * best[target]):
                begin = time.process_time()
                result = solve_ivp(rhs, (0, t_end), start, method, rtol=tolerance, atol=tolerance, **settings)
                seconds = time.process_time() - begin
                error, steps = np.inf, len(result.t) - 1
                if result.success:
                    error = np.abs(result.y[:, -1] - end).max()
                tolerance /= np.sqrt(10)
            if error > target:
                print(f"# SciPy {method}, {name}: not to {target:g} (stopped after a run of {seconds:.1f} s)")
                break
            tolerance *= np.sqrt(10)
            best[target] = min(best[target], seconds)
            yield number, "SciPy", method, target, error, seconds, steps


def main():
    np.seterr(all="ignore")  # a step that overflows is rejected
    arguments = sys.argv[1:]
    chosen = int(arguments[arguments.index("-peers_scene") + 1]) if "-peers_scene" in arguments else None
    numbers = range(len(SCENES)) if chosen is None else [chosen]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(arguments + ["-peers_out", folder], check=True)
        rows = []
        with open(os.path.join(folder, "rows.tsv"), encoding="utf-8") as file:
            for line in file:
                number, library, method, target, error, seconds, steps = line.rstrip("\n").split("\t")
                rows.append((int(number), library, method, float(target), float(error), float(seconds), int(steps)))
        for number in numbers:
            for row in scipy_rows(number, folder):
                rows.append(row)
                print("SciPy %-20s %8.0e error %8.1e %8d steps %10.1f ms" % (*row[2:5], row[6], 1e3 * row[5]), flush=True)
    best = collections.defaultdict(lambda: (np.inf, "", 0))
    for number, library, method, target, _, seconds, steps in rows:
        best[number, target, library] = min(best[number, target, library], (seconds, method, steps))
    print("\n| scene | error | this program, ms | SUNDIALS, ms | SciPy, ms | SUNDIALS/ours | SciPy/ours |")
    print("|---|---|---|---|---|---|---|")
    for number in numbers:
        for target in TARGETS:
            cells, ours = [], best[number, target, "stickslip"][0]
            for library in ("stickslip", "SUNDIALS", "SciPy"):
                seconds, method, steps = best[number, target, library]
                cells.append(f"{1e3 * seconds:.3g} ({method}, {steps} steps)" if method else "-")
            for library in ("SUNDIALS", "SciPy"):
                ratio = best[number, target, library][0] / ours
                cells.append(f"{ratio:.2g}" if ratio < np.inf else "-")
            print(f"| {SCENES[number][0]} | {target:.0e} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
