#!/usr/bin/env python3
"""The table of docs/published.md: speed over c of the first pulse that the held end of runs/published/excitable.yaml sends
into the chain, from block 100 to block 180, by when psi first passes 0 there.  STICKSLIP: the program."""
import os
import sys

import numpy as np

SOURCE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
sys.path.insert(0, os.path.join(SOURCE, "postprocess"))

import stickslip  # noqa: E402

STIFFNESS = ("0.1", "0.2", "0.3", "1", "3", "10", "100")


def speed(v, k1):
    """None where no pulse comes."""
    stickslip.run("run", os.path.join(SOURCE, "runs", "published", "excitable.yaml"), "-model_v", v, "-init_psi", v,
                  "-model_k1", k1, "-ts_max_time", 20 + 190 / float(k1)**0.5, "-out_frames", 2, "-out_file", "pulse.h5")
    group = stickslip.open("pulse.h5", "probes")
    t, psi = group["t"].values, group["psi"].values
    if np.any(psi.min(axis=0) > 0):
        return None
    passed = np.argmax(psi <= 0, axis=0)
    first, last = (np.interp(0, -psi[i - 1:i + 1, j], t[i - 1:i + 1]) for j, i in enumerate(passed))
    return 80 / (last - first) / float(k1)**0.5


if __name__ == "__main__":
    print("| v | k1 = " + " | ".join(STIFFNESS) + " |\n" + "|---" * (1 + len(STIFFNESS)) + "|")
    for plate in ("1.05", "1.2", "1.5"):
        found = (speed(plate, k1) for k1 in STIFFNESS)
        print(f"| {plate} | " + " | ".join("none" if V is None else f"{V:.3f}" for V in found) + " |")
