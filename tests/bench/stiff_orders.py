#!/usr/bin/env python3
"""Orders of fixed steps where friction is stiff: the table of docs/limits.md.

    STICKSLIP=build/stickslip python3 tests/bench/stiff_orders.py

The slow branch of the relaxation oscillation at gamma = 300, where friction acts at 900 per unit time.
"""
import json
import math
import os
import subprocess

PROGRAM = os.path.abspath(os.environ.get("STICKSLIP", "build/stickslip"))
SCENE = ("-model_gamma 300 -model_delta 0 -model_v 0.2 -grid_n 16 -init_psi 2 -init_eta 0.65 -ts_max_time 80 "
         "-progress off -summary -").split()
METHODS = (("arkimex:3:both", 3), ("arkimex:4:both", 4), ("arkimex:5:both", 5), ("arkimex:4:friction", 4), ("arkimex:ars443:both", 3),
           ("arkimex:2e:both", 2), ("arkimex:l2:both", 2), ("rosw:ra34pw2", 3), ("rosw:4l", 4), ("rosw:grk4t", 4), ("rosw:rodas3", 3),
           ("bdf:2", 2), ("theta", 2), ("cn", 2), ("beuler", 1), ("alpha", 2))


def end(method, *more):
    kind, *rest = method.split(":")
    words = ["-ts_type", kind]
    if rest:
        words += ["-ts_bdf_order" if kind == "bdf" else f"-ts_{kind}_type", rest[0]]
    if len(rest) > 1:
        words += ["-imex_implicit", rest[1]]
    done = subprocess.run([PROGRAM, "run", *SCENE, *words, *more], check=False, capture_output=True, text=True)
    if done.returncode:
        return math.nan, math.nan
    summary = json.loads(done.stdout)
    return summary["psi_mean"], summary["eta_mean"]


def main():
    exact = end("arkimex:5:both", "-ts_rtol", "1e-12", "-ts_atol", "1e-12")
    steps = (8, 4, 2, 1, 0.5)
    print("| method | order | dt 8 to 4 | 4 to 2 | 2 to 1 | 1 to 0.5 | error of ψ and η at dt = 1 |\n|---|---|---|---|---|---|---|")
    for method, order in METHODS:
        adapt = () if method.split(":")[0] in ("theta", "cn", "beuler", "alpha") else ("-ts_adapt_type", "none")
        ends = [end(method, "-ts_dt", str(dt), *adapt) for dt in steps]
        errors = [max(abs(psi - exact[0]), abs(eta - exact[1])) for psi, eta in ends]
        orders = ["fails" if math.isnan(a) else f"{math.log2(a / b):.1f}" for a, b in zip(errors, errors[1:])]
        print(f"| {method} | {order} | {' | '.join(orders)} | {errors[3]:.1e} |")


if __name__ == "__main__":
    main()
