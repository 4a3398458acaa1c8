"""Prints the map of stable and unstable trains in docs/waves.md from the file of a sweep of `wave` over model_v and wave_length.

train_map.py FILE: a cell has the growth rate of one pulse alone on a ring of that length / of the infinite train.
"""
import sys

import h5py
import numpy as np


def cell(point):
    if point["status"] == "failed":
        return "none fits" if "none fits" in point["reason"] else "sliding stable" if "nothing oscillates" in point["reason"] else "?"
    rates = []
    for name in ("", "endless_"):
        stable, rate = point[name + "stable"], point[name + "growth_rate"]
        rates.append("?" if np.isnan(stable) or not point["complete"] else
                     "stable" if stable else f"{rate:.4f}" if rate > 1e-4 else f"{rate:.0e}")
    return "**stable**" if rates == ["stable", "stable"] else "?" if "?" in rates else " / ".join(rates)


def main():
    with h5py.File(sys.argv[1]) as file:
        names = [side + key for side in ("", "endless_") for key in ("stable", "growth_rate")] + ["complete"]
        values = {name: file[name][...] for name in names} | {name: file[name].asstr()[...] for name in ("status", "reason")}
        v, length = file["model_v"][...], file["wave_length"][...]
    print("| v | " + " | ".join(f"L/n = {each:g}" for each in length) + " |")
    print("|" + "---|" * (len(length) + 1))
    for i, each in enumerate(v):
        print(f"| {each:g} | " + " | ".join(cell({name: rows[i, j] for name, rows in values.items()}) for j in range(len(length))) + " |")


if __name__ == "__main__":
    main()
