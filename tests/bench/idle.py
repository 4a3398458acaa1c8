#!/usr/bin/env python3
"""Every table of docs/methods.md and docs/developers/peers.md that holds seconds, and the prices of a stage in docs/developers/performance.md, as
Markdown rows: to be run on an idle machine, some 15 minutes of it; on a busy one the two ranks of `ranks` wait for each other.

    ninja -C build stickslip bench_imex bench_peers && /usr/bin/python3 -B tests/bench/idle.py build [--only stages,creep]

Parts: stages, ranks, creep, coupling, choice, peers. Each is printed as soon as it is done, with its heading and the seconds
that it took. Times are medians; those of methods that are compared were taken in turn."""
import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
RUNS = os.path.join(HERE, "..", "..", "runs")
UNBOUND = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_hwloc_base_binding_policy": "none"}
STAGE = re.compile(r"^(?P<law>.*?)\s+(?P<implicit>friction|wave|both)\s+dt .*: rk:5dp (?P<explicit>[\d.]+), "
                   r"arkimex:3 (?P<three>[\d.]+) \(.*?\), arkimex:4 (?P<four>[\d.]+) \(")


def stages(build, n, ranks=1, options=()):
    """{(law, implicit): (explicit, arkimex:3, arkimex:4)} in ns a node and stage."""
    start = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = start + [os.path.join(build, "tests", "bench_imex"), "-bench_n", str(n), "-bench_repeat",
                       str(max(2, 200000 // n)), *options]
    text = subprocess.run(command, capture_output=True, text=True, check=True, env={**UNBOUND, **os.environ}).stdout
    return {(m["law"], m["implicit"]): tuple(float(m[k]) for k in ("explicit", "three", "four"))
            for m in map(STAGE.match, text.splitlines()) if m}


def row(*cells):
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)


def head(*cells):
    row(*cells)
    print("|" + "---|" * len(cells))


def print_stages(build):
    found = {n: stages(build, n, options=("-bench_clock", "cpu")) for n in (10000, 100000)}
    laws = list(dict.fromkeys(law for law, _ in found[10000]))
    for implicit in ("friction", "wave", "both"):
        print(f"\n{implicit} implicit, one rank, a stage in explicit ones of rk:5dp")
        head("law", "n = 1e4, arkimex:3", "arkimex:4", "n = 1e5, arkimex:3", "arkimex:4")
        for law in laws:
            row(law, *(f"{t / of[0]:.1f}" for of in (found[n][law, implicit] for n in found) for t in of[1:]))
    cubic = found[10000]["cubic", "friction"][0]
    print("\nan explicit stage, ns a node at n = 1e4 (over that of the cubic law)")
    for law in laws:
        explicit = found[10000][law, "friction"][0]
        row(law, f"{explicit:.2f} ({explicit / cubic:.1f})")


def print_ranks(build):
    print("\ntwo ranks, wall time: how many times as fast as one (cubic law, gamma 300)")
    head("n", "implicit", "explicit stage", "arkimex:3", "arkimex:4")
    for n in (10000, 100000):
        of = [stages(build, n, ranks, ("-bench_laws", "1", "-bench_clock", "wall")) for ranks in (1, 2)]
        for (law, implicit), one in of[0].items():
            two = of[1][law, implicit]
            row(f"{n:.0e}", implicit, *(f"{a / b:.2f}" for a, b in zip(one, two)))


def chart(build, scene, *options):
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "s.json")
        subprocess.run([os.path.join(build, "stickslip"), "chart", os.path.join(RUNS, scene), "-progress", "off", "-summary",
                        path, *options], capture_output=True, check=True)
        with open(path, encoding="utf-8") as file:
            return json.load(file)["rows"]


def cell(rows, method, implicit, tolerance):
    for r in rows:
        if (r["method"], r["tolerance"]) == (method, tolerance) and (not implicit or r["implicit"] == implicit):
            if r["error_time"] is not None:
                return f"{1e3 * r['seconds']:.2g} ({r['error_time']:.0e})".replace("e-0", "e-")
    return "-"


def print_creep(build):
    tolerances = (1e-4, 1e-6, 1e-8)
    print("\nchart-stiff-friction, 64 nodes: ms (error)")
    head("gamma", *(f"{m}, {t:.0e}".replace("e-0", "e-") for m in ("rk:5dp", "arkimex:4") for t in tolerances))
    for gamma in (30, 60, 100, 150):
        rows = chart(build, "chart-stiff-friction.yaml", "-model_gamma", str(gamma), "-chart_methods",
                     "rk:5dp,arkimex:4:friction", "-chart_grids", "64", "-chart_orders", "4", "-chart_tolerances",
                     "1e-4,1e-6,1e-8")
        row(gamma, *(cell(rows, m, i, t) for m, i in (("rk:5dp", ""), ("arkimex:4", "friction")) for t in tolerances))


def print_coupling(build):
    print("\nchart-stiff-coupling, 128 nodes, order 4: ms (error)")
    methods = (("rk:7vr", ""), ("arkimex:4", "wave"), ("arkimex:4", "both"))
    head("tolerance", *(f"{m}, {i}" if i else m for m, i in methods))
    rows = chart(build, "chart-stiff-coupling.yaml", "-chart_methods", "rk:7vr,arkimex:4:wave,arkimex:4:both",
                 "-chart_grids", "128", "-chart_orders", "4", "-chart_tolerances", "1e-3,1e-4,1e-5,1e-6,1e-7")
    for t in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        row(f"{t:.0e}".replace("e-0", "e-"), *(cell(rows, m, i, t) for m, i in methods))


def print_other(*command):
    subprocess.run([sys.executable, "-B", *command], check=False)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build")
    parser.add_argument("--only", default="stages,ranks,creep,coupling,choice,peers")
    given = parser.parse_args()
    build = os.path.abspath(given.build)
    parts = {"stages": lambda: print_stages(build), "ranks": lambda: print_ranks(build),
             "creep": lambda: print_creep(build), "coupling": lambda: print_coupling(build),
             "choice": lambda: print_other(os.path.join(HERE, "choice.py"), os.path.join(build, "stickslip")),
             "peers": lambda: print_other(os.path.join(HERE, "peers.py"), os.path.join(build, "tests", "bench_peers"))}
    for name in given.only.split(","):
        begin = time.monotonic()
        print(f"\n## {name}", flush=True)
        parts[name]()
        print(f"\n({name}: {time.monotonic() - begin:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
