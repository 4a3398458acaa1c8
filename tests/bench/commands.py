"""Where the time of the commands goes that compute rather than step: the share of each command's processor time that is
the computation itself, by samples of perf (Linux; package linux-perf), at a small and a large size. Run by hand:

    ninja -C build stickslip
    python3 tests/bench/commands.py [--commands spectrum,boundary,...] [--build build]      # some three minutes

A sample belongs to
    computation   a function of the layers stability, waves, cycles or study that the command is for (COMPUTES below), or
                  the steps of a run, of a chart and of a trial (Integrator, Model)
    files         HDF5, summaries, provenance
    start         what is outside the command's own function: the dynamic linker, the start and end of MPI and PETSc, the
                  check of options
    rest          anything else of the command
and to the first of them in the order files, computation, rest, start. Processor time is that of the command without perf.
"""
import argparse
import os
import re
import resource
import subprocess
import tempfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
STEPS = r"Integrator::|TiledStep|Model::rhs|TSStep|SNESSolve|KSPSolve"
COMPUTES = {
    "spectrum": r"compute_spectrum|SteadySliding::SteadySliding",
    "boundary": r"boundary_points|boundary_curve|GrowthRate::|stick_slip_end|criticality|verify",
    "wave": r"solve_train|continue_train|train_spectrum|infinite_train_stability|growing_modes|shortest_pulse|train_limit",
    "cycle": r"uniform_cycle|solve_cycle|settled_cycle|continue_cycle|bloch_spectrum|uniform_orbit|stick_",
    "chart": STEPS + r"|limit_of|Ladder|work_precision",
    "laws": r"Friction::|law_traits|steady_state|force",
    "run": STEPS,
    "sweep": STEPS + r"|uniform_orbit",
}
FILES = r"stickslip::h5::|RunFile::|ResultFile|SweepTable|Summary::write|Summary::end|paths::|H5[A-Z]|write_checkpoint"
CASES = [
    ("spectrum", "200 nodes", "spectrum -grid_n 200 -grid_length 10"),
    ("spectrum", "20 000 nodes, file", "spectrum -grid_n 20000 -grid_length 1000 -out_file s.h5"),
    ("boundary", "points", "boundary -boundary_parameter model_v -boundary_from 0.1 -boundary_to 2"),
    ("boundary", "figure 6", "boundary runs/figure6-cubic.yaml -out_file b.h5"),
    ("wave", "one train", "wave -model_delta 0 -model_v 0.5 -wave_pulses 4 -wave_length 100"),
    ("wave", "branch", "wave runs/train-branch.yaml -out_file w.h5"),
    ("cycle", "one node", "cycle"),
    ("cycle", "branch", "cycle runs/cycle-canard.yaml -out_file c.h5"),
    ("chart", "uniform", "chart runs/chart-uniform.yaml -out_file t.h5"),
    ("chart", "smooth pulses", "chart runs/chart-smooth.yaml -out_file t.h5 -chart_methods rk:5dp,rk:7vr"),
    ("laws", "all", "laws runs/laws.yaml"),
    ("run", "-accuracy, 1 node", "run -accuracy 1e-6 -init_type uniform -out_file a.h5"),
    ("run", "-accuracy, ring", "run runs/chart-smooth.yaml -accuracy 1e-6 -grid_n auto -out_file a.h5"),
    ("sweep", "100 blocks", "sweep -model_form chain -grid_n 1 -bc_left free -bc_right free -ts_max_time 200 -sweep_parameter1 model_v "
                            "-sweep_from1 0.1 -sweep_to1 0.9 -sweep_points1 100 -out_file m.h5"),
    ("sweep", "2000 blocks", "sweep -model_form chain -grid_n 1 -bc_left free -bc_right free -ts_max_time 200 -sweep_parameter1 model_v "
                             "-sweep_from1 0.1 -sweep_to1 0.9 -sweep_points1 2000 -out_file m.h5"),
]


def seconds(words):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(words, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise SystemExit(" ".join(words) + "\n" + done.stderr)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def shares(command, words, took):
    """Of the samples: files, computation, rest, start; and what the rest consists of."""
    rate = int(min(2000, max(50, 3000 / took)))
    with tempfile.TemporaryDirectory() as folder:
        data = os.path.join(folder, "perf.data")
        subprocess.run(["perf", "record", "-F", str(rate), "--call-graph", "dwarf,16384", "-o", data, *words],
                       capture_output=True, check=True)
        script = subprocess.run(["perf", "script", "-i", data, "--no-inline", "-F", "comm,ip,sym"], capture_output=True,
                                text=True, check=True).stdout
    kinds = {"files": 0, "computation": 0, "rest": 0, "start": 0}
    rest = {}
    for sample in script.split("\n\n"):
        if not sample.startswith("stickslip"):
            continue
        functions = [line.split(None, 1)[1] for line in sample.splitlines()[1:] if len(line.split(None, 1)) > 1]
        chain = "\n".join(functions)
        kind = ("files" if re.search(FILES, chain) else "computation" if re.search(COMPUTES[command], chain)
                else "rest" if re.search(rf"::{command}(\(|$)", chain, re.M) else "start")
        kinds[kind] += 1
        if kind == "rest":
            for function in {f for f in functions if "stickslip::" in f and "::main(" not in f}:
                rest[function] = rest.get(function, 0) + 1
    total = max(1, sum(kinds.values()))
    return {kind: count / total for kind, count in kinds.items()}, {f: count / total for f, count in rest.items()}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", default=os.path.join(ROOT, "build"), help="the folder of the programs")
    parser.add_argument("--commands", default=",".join(COMPUTES))
    parser.add_argument("--rest", action="store_true", help="name the functions that the rest consists of")
    asked = parser.parse_args()
    program = os.path.abspath(os.path.join(asked.build, "stickslip"))
    runs = os.path.abspath(os.path.join(ROOT, "runs"))
    print("| command | size | processor time, s | computation | files | rest | start |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for command, size, line in CASES:
            if command not in asked.commands.split(","):
                continue
            words = [program, *line.replace("runs/", runs + "/").split(), "-progress", "off"]
            took = seconds(words)
            parts, rest = shares(command, words, took)
            print(f"| {command} | {size} | {took:.2f} | " +
                  " | ".join(f"{100 * parts[k]:.0f} %" for k in ("computation", "files", "rest", "start")) + " |", flush=True)
            if asked.rest:
                for function, share in sorted(rest.items(), key=lambda item: -item[1])[:8]:
                    print(f"      {100 * share:.0f} %  {function[:140]}")


if __name__ == "__main__":
    main()
