#!/usr/bin/env python3
"""Order of convergence where the start does not fit a held end: the table of docs/theory.md.

    STICKSLIP=build/stickslip python3 tests/bench/held_end.py
"""
import math
import os
import subprocess
import tempfile

import h5py
import numpy as np

PROGRAM = os.path.abspath(os.environ.get("STICKSLIP", "build/stickslip"))
SCENE = ("-model_gamma 3 -model_delta 0.2 -model_v 0.2 -bc_left velocity -bc_left_value -1.5 -bc_right free -grid_length 8 "
         "-ts_max_time 2 -ts_rtol 1e-9 -ts_atol 1e-9 -out_frames 2 -progress off").split()


def psi(start, order, cells, folder):
    path = os.path.join(folder, "end.h5")
    subprocess.run([PROGRAM, "run", *SCENE, *start.split(), "-grid_order", str(order), "-grid_n", str(cells + 1),
                    "-out_file", path], check=True, capture_output=True)
    with h5py.File(path) as file:
        return file["psi"][-1]


def rate(start, order, reference, grids, measure, folder):
    """How often an error is halved when the grid is doubled, over all of `grids`."""
    def error(cells):
        off = abs(psi(start, order, cells, folder) - reference[::(len(reference) - 1) // cells])
        return measure(np.linspace(0, 8, cells + 1), off)
    return math.log2(error(grids[0]) / error(grids[1])) / math.log2(grids[1] / grids[0])


def main():
    rows = (("corner (`layer`)", "largest at 1 < x < 3, 64 to 256 cells", "-init_type layer -init_psi 0.1", 4, (64, 256), (2, 4, 6),
             lambda x, error: error[(x > 1) & (x < 3)].max(), "4/3, 8/5, 12/7"),
            ("jump (uniform start)", "mean over all x, 32 to 256 cells", "-init_psi 0.1 -init_eta 0.1", 2, (32, 256), (2, 4, 6),
             lambda x, error: error.mean(), "2/3, 4/5, 6/7"))
    print("| data | error | p = 2 | p = 4 | p = 6 | expected |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, what, start, order, grids, orders, measure, expected in rows:
            reference = psi(start, order, 2048, folder)
            rates = [f"{rate(start, p, reference, grids, measure, folder):.2f}" for p in orders]
            print(f"| {name} | {what} | {' | '.join(rates)} | {expected} |")


if __name__ == "__main__":
    main()
