"""-accuracy on seeded random smooth scenes: is the error within the request, and the estimate honest?

    accuracy.py [--seed S] [--cases N] [--only K] [--seconds S] [--strict] [--stiff] [--loads]
    accuracy.py --chosen [--accuracies 1e-2,1e-4,1e-6,1e-8]
    accuracy.py --charts FOLDER [--accuracies ...]

Each case runs the program with -accuracy and then once more on a grid four times (from 1000 nodes on: twice, since
round-off grows with 1/h^2) as fine (of the chain: on the same one) at order 8 and tolerance 1e-13, nodes in common; the
difference is the error. Prints a line a case and what does not hold. Choosing may take --seconds of processor time;
answers more than 30 times better than asked are counted, and those among them that nothing cheaper was left for: up to
four steps, the loosest tolerance, or no more nodes than the first two grids of a ladder have.

With --stiff the scenes are those of which the program may take a part implicitly: friction faster than everything else by
30 to 1000 in the continuum and in chains, thresholds smoothed over 1e-2 to 1e-3, and waves of c = 30 to 100.

The second form does so for the six scenes runs/chart-*.yaml, without their grid_n, and prints what was chosen and what it
was worth; the third what it costs: the price of the run, and of everything together, against the best row of the scene's
chart with an error no larger. Both tables are in docs/chart.md. The charts' summaries are FOLDER/smooth.json and so on;
those not there are made (minutes). Prices need the target bench_accuracy beside the program: they are measured as the
chart's are, in a process that has done it all before."""
import argparse
import json
import os
import random
import re
import subprocess
import sys
import tempfile

import h5py
import numpy as np

from calls import PROGRAM, ran

HERE = os.path.dirname(os.path.abspath(__file__))
BENCH = os.path.join(os.path.dirname(PROGRAM), "tests", "bench_accuracy")


def call(*words):
    done = ran([PROGRAM, *words])
    return done.returncode, done.stderr


def last(path):
    with h5py.File(path) as file:
        return np.array([file["psi"][-1], file["eta"][-1]]), json.loads(file.attrs["options"])


def measure(words, accuracy, *extra):
    """What -accuracy gave, and the true error; None for the error where it failed with exit code 1."""
    with tempfile.TemporaryDirectory() as folder:
        out, fine, summary = (os.path.join(folder, name) for name in ("a.h5", "fine.h5", "a.json"))
        code, said = call("run", *words, *extra, "-accuracy", accuracy, "-out_file", out, "-out_frames", 2, "-summary", summary)
        if code not in (0, 1) or not os.path.exists(summary):
            raise SystemExit(f"exit code {code}: {said}")
        with open(summary, encoding="utf-8") as file:
            made = json.load(file)
        if code == 1:
            return made, None
        got, options = last(out)
        n, chain, ring = int(options["grid_n"]), options["model_form"] == "chain", options["bc_left"] == "periodic"
        held = "velocity" in (options["bc_left"], options["bc_right"])
        times = 1 if chain else 4 if n < 1000 else 2
        more = n if chain else times * n if ring else times * (n - 1) + 1
        grid = [] if chain else ["-grid_n", more, "-grid_order", 6 if held else 8]
        stiff = made["accuracy"]["method"].startswith(("rosw", "arkimex")) and chain
        code, said = call("run", *words, *grid, "-ts_type", "rk", "-ts_rk_type", "8vr", "-ts_rtol", 1e-13, "-ts_atol",
                          1e-13, "-out_file", fine, "-out_times", options["ts_max_time"])
        if code:
            raise SystemExit(f"the reference failed ({stiff}): {said}")
        exact, _ = last(fine)
        return made, np.abs(got - exact[:, ::times]).max()


def warm_price(words, accuracy, row):
    """As the chart's rows are timed, in a process that has done all of it before; in turn with the row, if there is one."""
    method = [] if row is None else [row["method"] + (":" + row["implicit"] if row["method"].startswith("arkimex") else ""),
                                     str(row["tolerance"]), str(row["order"]), str(row["n"])]
    done = subprocess.run([BENCH, "run", *map(str, words), "-accuracy", str(accuracy), *(["--row"] if method else []), *method],
                          capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"bench_accuracy: {done.stderr}")
    return json.loads(done.stdout)


def scene(seed, number):
    r = random.Random(f"{seed}/{number}")
    words = ["-model_gamma", round(10 ** r.uniform(-0.3, 1), 3), "-model_delta", r.choice([0, 0.1, 0.2]), "-model_v",
             round(r.uniform(-1.2, 1.2), 3), "-model_c", round(10 ** r.uniform(-0.3, 0.5), 3)]
    if r.random() < 0.25:
        words = ["-model_form", "chain", "-grid_n", r.choice([5, 20, 50]), "-model_k1", round(10 ** r.uniform(-1, 1), 3),
                 "-model_zeta", r.choice([0, 0.1]), "-model_v", round(r.uniform(-1.2, 1.2), 3)]
        length = 30
    else:
        length = round(r.uniform(10, 40), 2)
        words += ["-grid_length", length]
    words += ["-init_type", "sine", "-init_amplitude", round(r.uniform(0.1, 0.6), 3), "-init_mode", r.choice([1, 1, 2]),
              "-init_psi", round(r.uniform(-0.5, 0.5), 3), "-ts_max_time", round(r.uniform(0.3, 2.5), 3)]
    if r.random() < 0.3:
        words += ["-bc_left", "free"]
        words[words.index("-init_type") + 1] = "uniform"
        if "-grid_length" in words:
            words += ["-friction_spread", 0.1, "-friction_spread_length", round(length / 4, 3)]
        for name in ("-init_amplitude", "-init_mode"):
            at = words.index(name)
            del words[at:at + 2]
    return words, 10 ** r.uniform(-8, -2)


def stiff_scene(seed, number):
    r = random.Random(f"stiff/{seed}/{number}")
    kind = number % 4
    gamma = ["-model_gamma", round(10 ** r.uniform(1.5, 3), 1), "-model_delta", 0]
    if kind == 0:
        words = gamma + ["-model_v", round(r.uniform(-0.5, 0.5), 3), "-grid_length", round(r.uniform(10, 60), 2), "-init_type",
                         "sine", "-init_psi", round(r.uniform(0.9, 1.3), 3), "-init_amplitude", round(r.uniform(0.01, 0.1), 3),
                         "-init_eta", "steady", "-ts_max_time", round(r.uniform(1, 20), 2)]
    elif kind == 1:
        words = ["-model_form", "chain", "-model_f0", round(10 ** r.uniform(1.5, 3), 1), "-grid_n", r.choice([5, 10]),
                 "-model_k1", round(10 ** r.uniform(-1, 0.5), 3), "-model_v", round(r.uniform(-0.5, 0.5), 3), "-init_type", "sine",
                 "-init_psi", round(r.uniform(-0.5, 1.2), 3), "-init_amplitude", round(r.uniform(0.05, 0.3), 3),
                 "-ts_max_time", round(r.uniform(1, 20), 2)]
    elif kind == 2:
        words = ["-model_form", "chain", "-model_m", 1, "-model_k0", round(r.uniform(0.2, 1), 3), "-model_k1",
                 round(r.uniform(0.2, 2), 3), "-model_f0", 1, "-model_zeta", round(r.uniform(0, 0.2), 3), "-model_v",
                 round(10 ** r.uniform(-2, -0.5), 4), "-friction_law", "carlson-langer", "-friction_stick", "regularised",
                 "-friction_eps", round(10 ** r.uniform(-3, -2), 5), "-friction_spread", round(r.uniform(0, 0.2), 3), "-grid_n",
                 r.choice([5, 10, 20]), "-bc_left", "free", "-init_psi", 0.001, "-init_eta", round(r.uniform(-0.5, 0.9), 3),
                 "-ts_max_time", round(r.uniform(5, 60), 1)]
    else:
        words = ["-model_gamma", 3, "-model_delta", 0.2, "-model_c", round(r.uniform(30, 100), 1), "-model_v",
                 round(r.uniform(1.2, 1.8), 3), "-grid_length", round(r.uniform(10, 40), 2), "-init_type", "sine", "-init_psi",
                 round(r.uniform(0.2, 0.8), 3), "-init_amplitude", round(r.uniform(0.05, 0.3), 3), "-ts_max_time",
                 round(r.uniform(1, 6), 2)]
    return words, 10 ** r.uniform(-7, -2)


def load(seed, number, words):
    """The plate's velocity: a sine, straight lines with a step, or both."""
    r = random.Random(f"load/{seed}/{number}")
    t_end = words[words.index("-ts_max_time") + 1]
    chosen = []
    if r.random() < 0.7:
        chosen = ["-load_sine_amplitude", round(r.uniform(0.05, 0.5), 3), "-load_sine_period",
                  round(10 ** r.uniform(-0.3, 0.7), 3)]
    if not chosen or r.random() < 0.5:
        at = [round(r.uniform(0, t_end), 3) for _ in range(2)]
        times = (0, min(at), min(at), max(at))
        chosen += ["-load_v", ",".join(f"{t}:{round(r.uniform(-1.2, 1.2), 3)}" for t in times)]
    return chosen


CHARTS = ("smooth", "train", "uniform", "slow-driving", "stiff-coupling", "stiff-friction")


def chart_rows(folder, name):
    path = os.path.join(folder, name + ".json")
    if not os.path.exists(path):
        code, said = call("chart", os.path.join(HERE, "..", "runs", f"chart-{name}.yaml"), "-summary", path)
        if code:
            raise SystemExit(f"chart {name}: {said}")
    with open(path, encoding="utf-8") as file:
        return [row for row in json.load(file)["rows"] if row["error"] is not None]


def with_accuracies(accuracies):
    """(name, a copy of the scene without its grid_n, accuracy) of all that the tables hold."""
    for name in CHARTS:
        with open(os.path.join(HERE, "..", "runs", f"chart-{name}.yaml"), encoding="utf-8") as file:
            text = re.sub(r"(grid: \{.*?), n: \d+", r"\1", file.read())
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as copy:
            copy.write(text)
            copy.flush()
            yield from ((name, copy.name, accuracy) for accuracy in accuracies)


def table_of_choices(accuracies):
    """Whether something was not reached, or its estimate false."""
    print("| scene | wanted | chosen | error/wanted | estimate/error |\n|---|---|---|---|---|")
    failures = 0
    for name, path, accuracy in with_accuracies(accuracies):
        made, error = measure([path], accuracy)
        if error is None:
            print(f"| {name} | {accuracy:.0e} | {made['reason']} |||", flush=True)
            continue
        how, estimate = made["accuracy"], made["error_estimate"]
        grid = f", n = {how['n']}" if how["n"] and name not in ("uniform", "slow-driving") else ""
        tries = f", attempt {how['attempts']}" if how["attempts"] > 1 else ""
        print(f"| {name} | {accuracy:.0e} | {how['method']} at {how['tolerance']:.0e}{grid}{tries} | {error / accuracy:.3f} | "
              f"{estimate / max(error, 1e-300):.2f} |", flush=True)
        failures += not (error <= accuracy and error / 3 <= estimate <= accuracy)
    return failures > 0


def table_of_prices(folder, accuracies):
    print("| scene | wanted | best row | run/row | all/row |\n|---|---|---|---|---|")
    rows = {name: chart_rows(folder, name) for name in CHARTS}
    for name, path, accuracy in with_accuracies(accuracies):
        best = min((row for row in rows[name] if row["error"] <= accuracy), key=lambda row: row["seconds"], default=None)
        cost = warm_price([path], accuracy, best)
        prices = (f"{1e3 * cost['row']:.3g} ms | {cost['run_over_row']:.2f} | {cost['all_over_row']:.2f}" if best else
                  f"none | ({1e3 * cost['run']:.3g} ms) | ({1e3 * sum_of(cost):.3g} ms)")
        print(f"| {name} | {accuracy:.0e} | {prices} |", flush=True)


def sum_of(cost):
    return cost["run"] + cost["choosing"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--only", type=int)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--chosen", action="store_true")
    parser.add_argument("--charts", metavar="FOLDER")
    parser.add_argument("--accuracies", default="1e-2,1e-4,1e-6,1e-8")
    parser.add_argument("--stiff", action="store_true", help="scenes with stiff parts")
    parser.add_argument("--loads", action="store_true", help="under a plate whose velocity varies")
    parser.add_argument("--strict", action="store_true", help="better than 30 times the request counts as a failure")
    given = parser.parse_args()
    accuracies = [float(a) for a in given.accuracies.split(",")]
    if given.chosen:
        return table_of_choices(accuracies)
    if given.charts:
        return table_of_prices(given.charts, accuracies)
    numbers = range(given.cases) if given.only is None else [given.only]
    cases = [(stiff_scene if given.stiff else scene)(given.seed, number) for number in numbers]
    if given.loads:
        cases = [(words + load(given.seed, number, words), accuracy) for number, (words, accuracy) in zip(numbers, cases)]
    failures, refused, generous, cheapest = 0, 0, 0, 0
    for number, (words, accuracy) in enumerate(cases):
        made, error = measure(words, accuracy, "-accuracy_seconds", given.seconds)
        if error is None:
            refused += 1
            print(f"{number:3d} {accuracy:.1e} not reached: {made['reason']}   {' '.join(map(str, words))}", flush=True)
            continue
        estimate, how = made["error_estimate"], made["accuracy"]
        wrong = []
        if error > accuracy:
            wrong.append("ERROR ABOVE THE REQUEST")
        if not error / 3 <= estimate <= accuracy:
            wrong.append("ESTIMATE")
        if error < accuracy / 30:
            generous += 1
            first_nodes = 48 if "-model_form" not in words else 0
            cheapest += made["steps"] <= 4 or how["tolerance"] >= 0.02 or how["n"] <= first_nodes
            if given.strict:
                wrong.append("TOO GOOD")
        print(f"{number:3d} {accuracy:.1e} error {error:.1e} = {error / accuracy:.3f} of it, estimate/error "
              f"{estimate / max(error, 1e-300):.2f}, choosing/run {how['choosing_seconds'] / how['run_seconds']:.2f}; "
              f"{how['method']} {how['tolerance']:.0e} n {how['n']} x{how['attempts']} {' '.join(wrong)}", flush=True)
        if wrong:
            failures += 1
            print("    ", " ".join(map(str, words)), flush=True)
    print(f"seed {given.seed}: {len(cases)} cases, {failures} failures, {refused} not reached, {generous} more than 30 "
          f"times better than asked, {cheapest} of them as cheap as can be")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
