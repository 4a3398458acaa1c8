#!/usr/bin/env python3
"""Step control on six stiff scenes: what the library's adaptors cost at equal error, and how many steps they reject.

    adaptors.py PROGRAM [--scenes 1,2,...]

Every scene is run by arkimex at tolerances 1e-5 to 1e-8 with each control. Cost: steps and rejections, as attempted steps;
error: the largest of psi at the end over 15 places, against a run at 1e-11. The cost of a control at the error that the
first one, the default, has at 1e-6 and at 1e-7 is read off its own line of log cost against log error; the table holds
its ratio to the default's (geometric mean) and the share of rejected steps at 1e-6."""
import json, math, os, subprocess, sys, tempfile

RUNS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "runs")
FRICTION = "-ts_type arkimex -imex_implicit friction"
SCENES = [
    ("creep, gamma 300", "chart-stiff-friction.yaml", FRICTION + " -grid_n 64", 60),
    ("ring, gamma 10000", "chart-stiff-friction.yaml", FRICTION + " -grid_n 64 -model_gamma 10000", 10),
    ("smoothed threshold", "chain-carlson-langer-damped.yaml",
     FRICTION + " -friction_stick regularised -grid_n 40 -ts_max_time 30", 39),
    ("slow driving", "chart-slow-driving.yaml", FRICTION + " -ts_max_time 600", 19),
    ("stiff coupling", "chart-stiff-coupling.yaml", "-ts_type arkimex -imex_implicit wave -ts_max_time 2", 18),
    ("everything stiff", "chart-stiff-coupling.yaml",
     "-ts_type arkimex -imex_implicit both -model_gamma 300 -ts_max_time 2", 18),
]
CONTROLS = [
    ("default", ""),
    ("growth up to 2, safety 0.8", "-ts_adapt_clip 0.1,2 -ts_adapt_safety 0.8"),
    ("growth up to 5", "-ts_adapt_clip 0.1,5"),
    ("growth up to 1.5, safety 0.7", "-ts_adapt_clip 0.1,1.5 -ts_adapt_safety 0.7"),
    ("growth up to 1.3, safety 0.6", "-ts_adapt_clip 0.1,1.3 -ts_adapt_safety 0.6"),
    ("dsp PI42", "-ts_adapt_type dsp -ts_adapt_dsp_filter PI42"),
    ("dsp PI30", "-ts_adapt_type dsp -ts_adapt_dsp_filter PI30"),
    ("dsp H211PI", "-ts_adapt_type dsp -ts_adapt_dsp_filter H211PI"),
]
TOLERANCES = [1e-5, 1e-6, 1e-7, 1e-8]


def run(program, scene, options, tolerance, places):
    with tempfile.TemporaryDirectory() as folder:
        summary = os.path.join(folder, "s.json")
        probes = ",".join(repr(places * i / 15) for i in range(15))
        command = [program, "run", os.path.join(RUNS, scene), *options.split(), "-progress", "off", "-scene_reduce", "off",
                   "-ts_rtol", repr(tolerance), "-ts_atol", repr(tolerance), "-out_probes", probes, "-summary", summary]
        found = subprocess.run(command, capture_output=True, text=True, timeout=300)
        if not os.path.exists(summary):
            raise SystemExit(" ".join(command) + "\n" + found.stderr)
        with open(summary) as file:
            s = json.load(file)
    if s["status"] != "done":
        return None
    return s["steps"], s["rejections"], [p["psi"] for p in s["probes"]]


def cost_at(points, error):
    """On the line through the points (error, cost) in logarithms."""
    points = sorted(points)
    x = [math.log(max(e, 1e-15)) for e, _ in points]
    y = [math.log(c) for _, c in points]
    n, mx, my = len(x), sum(x) / len(x), sum(y) / len(y)
    slope = sum((a - mx) * (b - my) for a, b in zip(x, y)) / sum((a - mx) ** 2 for a in x)
    return math.exp(my + slope * (math.log(error) - mx)) if n > 1 else float("nan")


def main():
    program, chosen = sys.argv[1], range(len(SCENES))
    if "--scenes" in sys.argv:
        chosen = [int(i) - 1 for i in sys.argv[sys.argv.index("--scenes") + 1].split(",")]
    print("| scene | " + " | ".join(name for name, _ in CONTROLS) + " |")
    print("|---|" + "---|" * len(CONTROLS))
    for i in chosen:
        name, scene, options, places = SCENES[i]
        exact = run(program, scene, options + " -ts_arkimex_type 5", 1e-11, places)[2]
        cells, targets, base = [], [], []
        for _, control in CONTROLS:
            points, share = [], None
            for tolerance in TOLERANCES:
                found = run(program, scene, options + " " + control, tolerance, places)
                if found is None:
                    continue
                steps, rejected, psi = found
                points.append((max(abs(a - b) for a, b in zip(psi, exact)), steps + rejected))
                if tolerance == 1e-6:
                    share = 100 * rejected / (steps + rejected)
                if not control and tolerance in (1e-6, 1e-7):
                    targets.append(points[-1][0])
            costs = [cost_at(points, e) for e in targets]
            base = base or costs
            ratio = math.exp(sum(math.log(c / b) for c, b in zip(costs, base)) / len(base))
            cells.append(f"{ratio:.2f} ({share:.0f} %)")
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
