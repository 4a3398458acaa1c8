#!/usr/bin/env python3
"""How grids converge where regions stick: the table of docs/motion.md.

    STICKSLIP=build/stickslip python3 tests/bench/stick_grids.py

Differences between grids of 100, 200, 400 and 800 points on a ring of 10, mean over nodes and times or the largest; the order
is that by which two neighbouring differences fall.
"""
import os
import subprocess
import tempfile

import h5py
import numpy as np

PROGRAM = os.path.abspath(os.environ.get("STICKSLIP", "build/stickslip"))
RING = ("-grid_length 10 -grid_order 2 -model_gamma 1 -model_delta 0 -ts_rtol 1e-9 -ts_atol 1e-9 -out_series false "
        "-progress off").split()
REST = "-model_v 0 -init_type sine -init_psi 0 -init_amplitude 1 -init_eta 0 -ts_max_time 3 -friction_law coulomb -friction_fs 0.3 " \
       "-friction_fd 0.3"
LOAD = "-model_v 0.2 -init_psi 0 -init_eta 0.5 -friction_spread 0.3 -friction_spread_length 2.5 -ts_max_time 6 "
SCENES = (("regions spread (a sine comes to rest, fs = fd)", REST),
          ("regions shrink (loading of spread thresholds, fs = fd)", LOAD + "-friction_law coulomb -friction_fs 1 -friction_fd 1"),
          ("the same, fs = 1, fd = 0.9", LOAD + "-friction_law coulomb -friction_fs 1 -friction_fd 0.9"),
          ("the same, `carlson-langer`", LOAD + "-friction_law carlson-langer"))
GRIDS = (100, 200, 400, 800)


def fields(scene, n, folder):
    path = os.path.join(folder, "grid.h5")
    subprocess.run([PROGRAM, "run", *RING, *scene.split(), "-grid_n", str(n), "-out_frames", "61", "-out_file", path], check=True,
                   capture_output=True)
    with h5py.File(path) as file:
        return {name: file[name][:, ::n // GRIDS[0]] for name in ("psi", "eta")}


def main():
    print("| | ψ, mean | ψ, largest | η, mean | η, largest |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in SCENES:
            found = [fields(scene, n, folder) for n in GRIDS]
            cells = []
            for field in ("psi", "eta"):
                gaps = [abs(a[field] - b[field]) for a, b in zip(found, found[1:])]
                for measure in (np.mean, np.max):
                    errors = [measure(gap) for gap in gaps]
                    cells.append(", ".join(f"{order:.1f}" for order in np.log2(np.array(errors[:-1]) / errors[1:])))
            print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
