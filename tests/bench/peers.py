#!/usr/bin/env python3
"""Time to accuracy of this program, SUNDIALS and SciPy on the same systems, as one table.

    ninja -C build bench_peers && python3 tests/bench/peers.py build/tests/bench_peers [-peers_repeat 5]

bench_peers does the first two and leaves starts and solutions for the third: solve_ivp with a right-hand side in
numpy, as one writes it first, by each of SciPy's methods that suits the scene (banded Jacobians told by their
sparsity where the method takes that; LSODA, which would take a dense one, is left out). Every method goes down in
tolerance by factors of sqrt(10) until it has each accuracy; the processor time of that run counts (the median of
three where it is short).
"""
import collections
import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import diags, bmat, identity

TARGETS = [1e-4, 1e-6, 1e-9]
LONGEST = 15  # seconds of one run, after which a method goes no further
SCENES = [  # as in bench_peers.cpp: name, gamma, c, ring, t_end, methods
    ("smooth ring", 3.0, 1.0, True, 10.0, ["RK45", "DOP853"]),
    ("stiff friction", 300.0, 1.0, False, 60.0, ["RK45", "DOP853", "BDF", "Radau"]),
    ("stiff coupling", 3.0, 100.0, False, 10.0, ["RK45", "DOP853", "BDF", "Radau"]),
]
DELTA, V, LENGTH = 0.2, 0.2, 60.0


def system(gamma, c, ring, n):
    """The right-hand side for u = (psi, eta), and the sparsity of its Jacobian."""
    h = LENGTH / (n if ring else n - 1)

    def second_difference(psi):  # order 4; even reflection at free ends
        if ring:
            near, far = np.roll(psi, 1) + np.roll(psi, -1), np.roll(psi, 2) + np.roll(psi, -2)
        else:
            wide = np.concatenate([psi[2:0:-1], psi, psi[-2:-4:-1]])
            near, far = wide[1:-3] + wide[3:-1], wide[:-4] + wide[4:]
        return (-2.5 * psi + 4 / 3 * near - far / 12) / h**2

    def rhs(t, u):
        psi, eta = u[:n], u[n:]
        excess = eta - (psi**3 / 3 - psi)
        return np.concatenate([gamma * excess,
                               (V - psi) / gamma + c**2 / gamma * second_difference(psi) - DELTA * excess])

    band = diags([np.ones(n)] * 5, [-2, -1, 0, 1, 2], shape=(n, n))
    return rhs, bmat([[identity(n), identity(n)], [band, identity(n)]])


def interleaved(path):
    u = np.fromfile(path)
    return np.concatenate([u[::2], u[1::2]])


def scipy_rows(number, folder):
    name, gamma, c, ring, t_end, methods = SCENES[number]
    start, end = (interleaved(os.path.join(folder, f"{number}.{part}")) for part in ("start", "end"))
    rhs, sparsity = system(gamma, c, ring, len(start) // 2)
    for method in methods:
        settings = {"jac_sparsity": sparsity} if method in ("BDF", "Radau") else {}
        tolerance, seconds = 1e-2, 0
        for target in TARGETS:
            error = np.inf
            while error > target and tolerance > 2.3e-14 and seconds < LONGEST:
                begin = time.process_time()
                result = solve_ivp(rhs, (0, t_end), start, method, [t_end], rtol=tolerance, atol=tolerance, **settings)
                seconds = time.process_time() - begin
                error = np.abs(result.y[:, -1] - end).max() if result.success else np.inf
                tolerance /= np.sqrt(10)
            if error > target:
                print(f"# SciPy {method}, {name}: not to {target:g} (stopped after a run of {seconds:.0f} s)")
                break
            tolerance *= np.sqrt(10)
            times = [seconds]
            while len(times) < 3 and seconds < 2:
                begin = time.process_time()
                solve_ivp(rhs, (0, t_end), start, method, [t_end], rtol=tolerance, atol=tolerance, **settings)
                times.append(time.process_time() - begin)
            yield number, "SciPy", method, target, error, statistics.median(times)


def main():
    np.seterr(all="ignore")  # a step that overflows is rejected
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(sys.argv[1:] + ["-peers_out", folder], check=True)
        rows = []
        with open(os.path.join(folder, "rows.tsv")) as file:
            for line in file:
                number, library, method, target, error, seconds = line.rstrip("\n").split("\t")
                rows.append((int(number), library, method, float(target), float(error), float(seconds)))
        for number in range(len(SCENES)):
            for row in scipy_rows(number, folder):
                rows.append(row)
                print("SciPy %-20s %8.0e error %8.1e %10.1f ms" % (row[2], row[3], row[4], 1e3 * row[5]), flush=True)
    best = collections.defaultdict(lambda: (np.inf, ""))
    for number, library, method, target, error, seconds in rows:
        best[number, target, library] = min(best[number, target, library], (seconds, method))
    print("\n| scene | error | stickslip, ms | SUNDIALS, ms | SciPy, ms | SUNDIALS/ours | SciPy/ours |")
    print("|---|---|---|---|---|---|---|")
    for number, scene in enumerate(SCENES):
        for target in TARGETS:
            cells, ours = [], best[number, target, "stickslip"][0]
            for library in ("stickslip", "SUNDIALS", "SciPy"):
                seconds, method = best[number, target, library]
                cells.append(f"{1e3 * seconds:.3g} ({method})" if method else "-")
            for library in ("SUNDIALS", "SciPy"):
                cells.append(f"{best[number, target, library][0] / ours:.1f}")
            print(f"| {scene[0]} | {target:.0e} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
