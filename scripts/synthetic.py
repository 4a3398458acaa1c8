"""Makes the measurement that runs/lab-steps.yaml is shipped with: computed, with noise of a seed, so that what is behind it
is known.

usage: scripts/synthetic.py build/stickslip FOLDER

lab-steps.csv: velocity steps of a laboratory, rate-and-state friction with a = 0.011, b = 0.016, D = 7 um on a spring of
0.003/um, noise of 0.0005 and a drift of 2e-6/um.
"""
import os
import subprocess
import sys
import tempfile

import numpy as np

BLOCK = {"model_form": "chain", "grid_n": 1, "bc_left": "free", "model_m": 1e-6, "model_k0": 3e-3, "model_v": 10,
         "load_v": "0:10,15:10,15:30,25:30,25:10,40:10", "friction_law": "rate-and-state", "state_law": "ageing",
         "friction_mu0": 0.6, "friction_psi0": 10, "friction_a": 0.011, "friction_b": 0.016, "friction_D": 7,
         "init": "sliding", "ts_max_time": 40, "ts_rtol": 1e-9}
TIMES = np.arange(0.1, 40, 0.1)
DRIFT, NOISE = 2e-6, 5e-4


def steps(program, folder):
    import h5py
    with tempfile.TemporaryDirectory() as own:
        path = os.path.join(own, "steps.h5")
        words = [word for name, value in BLOCK.items() for word in (f"-{name}", str(value))]
        subprocess.run([program, "run", *words, "-progress", "off", "-out_file", path,
                        "-out_times", ",".join(f"{t:.1f}" for t in TIMES)], check=True)
        with h5py.File(path) as file:
            friction = file["eta"][:, 0]
    load = np.where(TIMES < 15, 10 * TIMES, np.where(TIMES < 25, 150 + 30 * (TIMES - 15), 450 + 10 * (TIMES - 25)))
    rate = np.where((TIMES >= 15) & (TIMES < 25), 30, 10)
    mu = friction + DRIFT * load + NOISE * np.random.default_rng(2).normal(size=len(TIMES))
    with open(os.path.join(folder, "lab-steps.csv"), "w", encoding="ascii") as file:
        file.write("Time (s),Load point (um),Velocity (um/s),Shear stress (MPa),mu\n")
        file.writelines(f"{t:.1f},{x:.1f},{v:g},{10 * f:.4f},{f:.5f}\n" for t, x, v, f in zip(TIMES, load, rate, mu))


if __name__ == "__main__":
    steps(sys.argv[1], sys.argv[2])
