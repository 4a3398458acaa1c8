#!/usr/bin/python3
"""Processor time of `stickslip spectrum` against the number of nodes: the table in docs/developers/algorithms.md.

    STICKSLIP=build/stickslip tests/bench/spectrum_cost.py [N ...] [-- options of stickslip, e.g. -model_v 0.2]
"""
import json
import os
import resource
import subprocess
import sys

SCENES = {
    "uniform": "",
    "spread": "-friction_spread 0.2",
    "held": "-bc_left velocity",
    "held + spread": "-bc_left velocity -friction_spread 0.2",
    "chain, spread": "-model_form chain -model_zeta paper -friction_spread 0.2",
}


def seconds():
    use = resource.getrusage(resource.RUSAGE_CHILDREN)
    return use.ru_utime + use.ru_stime


def main():
    words = sys.argv[1:]
    options = ["-model_v", "0.9"]
    if "--" in words:
        options = words[words.index("--") + 1:]
        words = words[:words.index("--")]
    sizes = [int(w) for w in words] or [1000, 10000, 100000]
    print("| scene | refine | " + " | ".join(f"n = {n}" for n in sizes) + " |")
    print("|---" * (2 + len(sizes)) + "|")
    for name, scene in SCENES.items():
        for refine in ["auto", "off"] if "chain" not in scene else ["auto"]:
            cells = []
            for n in sizes:
                before = seconds()
                run = subprocess.run([os.environ.get("STICKSLIP", "build/stickslip"), "spectrum", "-grid_n", str(n),
                                      "-spectrum_refine", refine, "-summary", "-"] + scene.split() + options,
                                     capture_output=True, text=True, check=False)
                took = seconds() - before
                try:
                    complete = json.loads(run.stdout)["complete"]
                except ValueError:
                    complete = False
                cells.append(f"{took:.2f}" + ("" if complete else " (not complete)"))
            print(f"| {name} | {refine} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
