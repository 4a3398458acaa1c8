#!/usr/bin/env python3
"""Whether the method that a run takes by itself costs at most 1.5 times the best one at the same error in time.

    /usr/bin/python3 -B tests/bench/choice.py [build/stickslip] [--scene NAME] [--most 1.5]

For every scene of runs/chart-*.yaml, at its finest grid and highest order: which method `run` chooses at each tolerance
(`run -check`), the scene's chart with these among its own, and for each row of the choice the least processor time of a row with no larger
error (the error in time: the grid's is the same for all). Times are medians; on a busy machine ratios move by a third and
more. Exit code 1 where a ratio is larger than allowed. Rows of which the error is not known are left out, and those beyond
the scene's own range of errors: where the choice is less accurate than 0.1 nobody wants it, and nobody's error is below the
best row's.
"""
import argparse
import glob
import json
import os
import subprocess
import sys
import tempfile

TOLERANCES = "1e-3,1e-4,1e-5,1e-6,1e-7,1e-8"
ROW_SECONDS = "1"  # a slower row is not the best


def output(program, command, scene, *options):
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "summary.json")
        done = subprocess.run([program, command, scene, "-progress", "off", "-summary", path, *options],
                              capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{command} {scene}: {done.stderr}")
        with open(path, encoding="utf-8") as file:
            return json.load(file)


def label(method, implicit):
    return method + (":" + implicit if method.startswith("arkimex") else "")


def judge(program, scene):
    """The rows of the chosen methods as (method, tolerance, error, seconds, best label, its seconds)."""
    chosen = {}
    for tolerance in TOLERANCES.split(","):
        seen = output(program, "run", scene, "-check", "-ts_rtol", tolerance, "-ts_atol", tolerance)
        chosen[float(tolerance)], options = label(seen["method"], seen["implicit"]), seen["options"]
    methods = [m for m in options.get("chart_methods", "").split(",") if m]
    grid = (options.get("chart_grids") or options["grid_n"]).split(",")[-1]
    order = (options.get("chart_orders") or options["grid_order"]).split(",")[-1]
    methods += sorted(set(chosen.values()) - set(methods))
    chart = output(program, "chart", scene, "-chart_methods", ",".join(methods), "-chart_tolerances", TOLERANCES,
                   "-chart_grids", grid, "-chart_orders", order, "-chart_row_seconds", ROW_SECONDS)
    rows = [(label(r["method"], r["implicit"]), r["error_time"], r["seconds"], r["tolerance"]) for r in chart["rows"]
            if r["error_time"] is not None]
    found = []
    for name, error, seconds, tolerance in rows:
        if name == chosen[tolerance] and error < 0.1:
            best = min((r for r in rows if r[1] <= error), key=lambda r: r[2])
            found.append((name, tolerance, error, seconds, best[0], best[2]))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", nargs="?", default="build/stickslip")
    parser.add_argument("--scene", help="one of runs/chart-*.yaml, e.g. train")
    parser.add_argument("--most", type=float, default=1.5)
    given = parser.parse_args()
    worst = 0
    print("| scene | chosen | tolerance | error in time | ms | best | its ms | ratio |\n|---|---|---|---|---|---|---|---|")
    runs = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "runs")
    for scene in sorted(glob.glob(os.path.join(runs, f"chart-{given.scene or '*'}.yaml"))):
        name = os.path.basename(scene)[6:-5]
        for chosen, tolerance, error, seconds, best, least in judge(os.path.abspath(given.program), scene):
            worst = max(worst, seconds / least)
            print(f"| {name} | {chosen} | {tolerance:g} | {error:.1e} | {1e3 * seconds:.3g} | {best} | {1e3 * least:.3g} | "
                  f"{seconds / least:.2f} |", flush=True)
    print(f"\nlargest ratio {worst:.2f}, allowed {given.most:g}")
    return 0 if 0 < worst <= given.most else 1


if __name__ == "__main__":
    sys.exit(main())
