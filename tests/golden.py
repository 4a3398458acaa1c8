"""Golden outputs: what one build of the program gives on every scene of golden_scenes.py, held against another build's.

    python3 tests/golden.py make --program build/stickslip OUT       exit codes, words, summaries and files, in OUT/SCENE
    python3 tests/golden.py compare BEFORE OUT                       by key and by field
    python3 tests/golden.py turns PROGRAM OTHER [--rounds 5]         processor time of the quick scenes, in turn

Equal means to the last bit, of what both have of options. What may differ, and by how much, stands in BOUNDS with its reason; what always does (times,
revisions) in NEVER. While the source is rebuilt, "before" is the revision BEFORE, built beside it on the same machine (git
worktree add ../before REVISION); the outputs stay outside the tree.
"""
import argparse
import concurrent.futures
import csv
import glob
import json
import os
import re
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import time

import h5py
import numpy as np

from golden_scenes import scenes

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
BEFORE = "afad5df366fc"  # before-house: what a rebuilt program has to equal
NEVER = re.compile(r"(^|/)(wall_s|\w*seconds|events_per_s|git|version|date|command_line|cost|revision)(/\d+)?$")
BOUNDS = [  # (scene, field, relative bound, reason): regular expressions
    (r"^chart$", r"/(best|recommended|cost)\b", np.inf, "which row is fastest is measured"),
    (r"", r"(/summary|^/\d+|^)/(psi_low|psi_high|largest_moment|largest_extent|b|b_error|clusters|clusters_reason|node_steps|psi_loaded_mean|recurrence)(@/\w+)?\b", np.inf, "added"),
    (r"", r"(^|/)(rest_fraction|plate_time|forcing_periods|chi)(@/\w+)?$", np.inf, "added"),
    (r"", r"@/long_name$", np.inf, "reworded"),
    (r"^cycle-massless$", r"/err/0$", np.inf, "reworded"),
    (r"^load", r"/regime_reason$", np.inf, "names the load of the normal force, too"),
    (r"^sticks-states$", r"/friction_work$", 1e-3, "of fourth order in the steps, of second before"),
    (r"", r"(^|/)events[./](magnitude10|recurrence|recurrence_of_nodes|last_of_nodes)(@|/|$)", np.inf, "added"),
    (r"^(?!cycle|wave)", r"(/summary|^/\d+|^)/period$", np.inf, "given without probes too"),
    (r"^help$", r"/out/", np.inf, "one line for the profiles, which come last; laws were added"),
    (r"^refusals$", r"^step-0.json|/err/0$", np.inf, "the command `fit` was added to the usage"),
    (r"^laws$", r"", np.inf, "laws were added: a table of all of them"),
    (r"^exponents$", r"lyapunov", 1e-12, "stages lie where the rows of the tableau say, to the last bit"),
    (r"^accuracy$", r"/chosen$", np.inf, "says `error predicted` where it said `error foreseen`"),
    (r"^signal$", r"options", np.inf, "at which checkpoint the signal comes is chance"),
    (r"^wave", r"/psi_(min|max)\b", 1e-15, "the extremum of a train is evaluated within its interval, without going by the phase"),
    (r"^boundary-stick-slip$", r"/frequency$", 1e-10, "of the place of a graze itself, not 1e-10 of the box beside it"),
    (r"^boundary-stick-slip$", r"/(evaluations|out/1)$", np.inf, "a graze is placed by fewer evaluations; its line has the frequency"),
    (r"^wave-(branch|limits)$", r"/(branch|curves|special)\b", 1e-12, "places of trains are scaled before the arclength is summed"),
    (r"^(cycle|wave)", r"", 1e-9, "small dense systems are solved by Eigen, in another order of operations"),
    (r"^(cycle|wave)", r"/(error_estimate|multiplier_error|translation_error|residual)\b", np.inf, "sizes of round-off"),
    (r"^(cycle|wave)", r"/(multiplier_im|(spectrum|eigenvalues/\d+)/im)$", 2.1, "which of a conjugate pair is named first"),
    (r"^(cycle-state|wave-viscous)$", r"^/(psi|eta|theta|t|x)$", 1e-8, "nodes follow fifth differences, in which round-off grows"),
    (r"^wave-limits$", r"/curves/(\d+/points/[1-9]|\w+$)", np.inf, "points are spread evenly over the curve"),
    (r"^cycle-pair$", r"/multipliers/[23]/re$", 1e-6, "1e-9 beside 1"),
    (r"^cycle-state$", r"/multipliers/2/re$", np.inf, "0 but for round-off"),
    (r"^wave-spectrum$", r"/eigenvalues/4/", np.inf, "of the translation, 0 but for round-off"),
    (r"^cycle-branch$", r"/wavenumber$", 1e-6, "the place of a maximum is known to the square root of round-off"),
    (r"^wave-(spectrum|viscous)$", r"/endless/", 1e-6, "the place of a maximum is known to the square root of round-off"),
    (r"^wave-viscous$", r"/endless/", 3e-5, "a growth rate of 0.02 is known to 1e-12, its place to the square root of their ratio"),
    (r"^(boundary-(bautin|point|viscous)|sweep-boundary)$", r"lyapunov_coefficient|/special/", 1e-13,
     "systems of a wave's block by Eigen's elimination"),
    (r"^(fixed|method)-leapfrog$", r"", 1e-13, "u + dt g in place of 2 y - z: other round-off in some hundred steps"),
    (r"^((fixed|method)-leapfrog|fixed-rk-[78]vr)$", r"/rhs_evaluations$", 0.5,
     "stages of the estimate alone are not taken at fixed steps; f and g of leapfrog are counted as of arkimex"),
]
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "LC_ALL": "C.UTF-8", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
               "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
               "OMPI_MCA_hwloc_base_binding_policy": "none", "OMPI_MCA_ess_singleton_isolated": "1"}


def words(program, step):
    """The command line of a step, its ranks, and whether it is interrupted."""
    given = step.replace("RUNS/", os.path.join(ROOT, "runs", "")).split()
    interrupted = bool(given) and given[-1] == "^C"
    given = given[:-1] if interrupted else given
    ranks = int(given.pop()[1:]) if given and given[-1].startswith("@") else 1
    if "NEWEST" in given:
        kept = sorted(glob.glob("*.chk-*.h5"), key=lambda name: int(re.findall(r"\d+", name)[-2]))
        given[given.index("NEWEST")] = kept[-1] if kept else "none"
    if given and not given[0].startswith("-") and "-help" not in given:
        given += ["-progress", "off", "-summary", "summary.json"]
    return (["mpirun", "-n", str(ranks)] if ranks > 1 else []) + [program, *given], interrupted


def carried_out(program, step, number):
    """Runs one step in this folder; its words, exit code and summary go into step-NUMBER.json."""
    line, interrupted = words(program, step)
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL,
                               env={**os.environ, **ENVIRONMENT})
    if interrupted:
        while not os.path.exists("a.h5") and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=600)
    kept = {"step": step, "exit": process.returncode}
    if not interrupted:  # mpirun adds words of its own
        err = [text for text in err.splitlines() if line[0] != "mpirun" or text.startswith("stickslip: ")]
        kept.update(out=out.splitlines(), err=err)
    if os.path.exists("summary.json"):
        with open("summary.json", encoding="utf-8") as file:
            summary = json.load(file)
        os.remove("summary.json")
        if not interrupted:
            kept["summary"] = summary
    with open(f"step-{number}.json", "w", encoding="utf-8") as file:
        json.dump(kept, file, indent=1)
    for name in glob.glob("*.h5") + glob.glob("*.csv"):  # the next step may replace it
        if not name.startswith("step-") and ".chk-" not in name and not interrupted:
            shutil.copy(name, f"step-{number}-{name}")


def one_scene(program, folder, name, steps):
    os.makedirs(os.path.join(folder, name, "mpi"))
    os.chdir(os.path.join(folder, name))
    os.environ["OMPI_MCA_orte_tmpdir_base"] = os.path.join(os.getcwd(), "mpi")  # which others may not remove
    begin = time.monotonic()
    for number, step in enumerate(steps):
        carried_out(program, step, number)
    return time.monotonic() - begin


def make(asked):
    shutil.rmtree(asked.out, ignore_errors=True)
    os.makedirs(asked.out)
    program, out = os.path.abspath(asked.program), os.path.abspath(asked.out)
    chosen = [scene for scene in scenes() if re.search(asked.only, scene[0])]
    with concurrent.futures.ProcessPoolExecutor(asked.jobs) as pool:
        tasks = {pool.submit(one_scene, program, out, *scene): scene[0] for scene in chosen}
        for task in concurrent.futures.as_completed(tasks):
            print(f"{task.result():6.1f} s  {tasks[task]}", flush=True)
    print(f"{len(chosen)} scenes, {sum(len(steps) for _, steps in chosen)} commands")
    return 0


def flat(value, prefix=""):
    """The leaves of a JSON value by path."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from flat(inner, f"{prefix}/{key}")
    elif isinstance(value, list) and not all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value):
        yield f"{prefix}/length", len(value)
        for index, inner in enumerate(value):
            yield from flat(inner, f"{prefix}/{index}")
    else:
        yield prefix, value


def number_or_text(text):
    try:
        return float(text)
    except ValueError:
        return text


def fields(path):
    """Everything in a file of a scene by path."""
    found = {}
    if path.endswith(".json"):
        with open(path, encoding="utf-8") as file:
            found.update(flat(json.load(file)))
    elif path.endswith(".csv"):
        with open(path, newline="", encoding="utf-8") as file:
            for number, row in enumerate(csv.DictReader(file)):
                found.update({f"/{number}/{key}": number_or_text(value) for key, value in row.items()})
    else:
        with h5py.File(path) as file:
            def take(name, item):
                if isinstance(item, h5py.Dataset):
                    found["/" + name] = item[()]
                for key, value in item.attrs.items():
                    if key not in ("REFERENCE_LIST", "DIMENSION_LIST", "CLASS", "NAME"):
                        found[f"/{name}@/{key}"] = value
            file.visititems(take)
            found.update({f"@/{key}": value for key, value in file.attrs.items()})
    return found


def apart(one, other):
    """0 where they are equal to the last bit, else their relative difference (inf: in kind or shape)."""
    a, b = np.asarray(one), np.asarray(other)
    if a.dtype.kind in "fciub" and b.dtype.kind in "fciub":
        if a.shape != b.shape:
            return np.inf
        if np.array_equal(a, b, equal_nan=a.dtype.kind in "fc" and b.dtype.kind in "fc"):
            return 0.0
        if a.dtype.kind == b.dtype.kind == "b" or not np.array_equal(np.isfinite(a), np.isfinite(b)):
            return np.inf
        scale = np.nanmax(np.abs(a), initial=0.0)
        return float(np.nanmax(np.abs(a - b)) / scale) if scale else np.inf
    return 0.0 if a.shape == b.shape and np.array_equal(a, b) else np.inf


def plain(value):
    """A text without what names the machine or the moment."""
    if isinstance(value, bytes):
        value = value.decode(errors="replace")
    if isinstance(value, str):
        value = re.sub(r"/\S*/", "", re.sub(r"\bgit \S+", "git #", value))
        value = value.replace(": neither this program nor PETSc or SLEPc reads it", "")  # is said of no unknown option now
        value = re.sub(r"(must be one of|it belongs to) [^;]*", r"\1 #", value)  # laws may be added
        value = re.sub(r"\d+(\.\d+)? (s|ms|MB|GB)\b", "# s", value)
    return value


def differences(before, now, within):
    """(file, field, how far apart, the bound) of all that is not equal in two folders of one scene; `within`: any bound at least."""
    scene = os.path.basename(now)
    names = {os.path.basename(p) for folder in (before, now) for p in glob.glob(os.path.join(folder, "step-*"))}
    for name in sorted(names):
        paths = [os.path.join(folder, name) for folder in (before, now)]
        missing = [path for path in paths if not os.path.exists(path)]
        if missing:
            yield name, "not there in", missing[0], 0.0
            continue
        one, other = (fields(path) for path in paths)
        for key in sorted(set(one) | set(other)):
            if NEVER.search(key):
                continue
            bound = max([within, *(b for s, f, b, _ in BOUNDS if re.search(s, scene) and re.search(f, key))])
            if bound == np.inf:
                continue
            if key not in one and "options/" in key:
                continue  # an option that the earlier program did not have
            if key not in one or key not in other:
                yield name, key, "new" if key not in one else "gone", 0.0
                continue
            if key.endswith("@/options"):
                first, second = (json.loads(value) for value in (one[key], other[key]))
                one[key], other[key] = (json.dumps([side.get(name) for name in first]) for side in (first, second))
            far = apart(plain(one[key]), plain(other[key]))
            if far > bound:
                yield name, key, f"{far:.1e}" if far < np.inf else f"{plain(one[key])!s:.60} -> {plain(other[key])!s:.60}", bound


def made_by(folder):
    """The revision that made these outputs."""
    for path in glob.glob(os.path.join(folder, "*", "step-*.json")):
        with open(path, encoding="utf-8") as file:
            git = json.load(file).get("summary", {}).get("git")
        if git:
            return git
    return "of an unknown revision"


def compare(asked):
    bad = 0
    names = sorted(os.listdir(asked.now))
    for name in names:
        found = list(differences(os.path.join(asked.before, name), os.path.join(asked.now, name), asked.within))
        bad += bool(found)
        for file, key, how, bound in found[:asked.most]:
            print(f"{name}: {file} {key}: {how}" + (f" (bound {bound:.0e})" if bound else ""))
        if len(found) > asked.most:
            print(f"{name}: and {len(found) - asked.most} more")
    gone = sorted(set(os.listdir(asked.before)) - set(names))
    print(f"before: {made_by(asked.before)} (BEFORE is {BEFORE}); now: {made_by(asked.now)}")
    print(f"{len(names) - bad} scenes equal, {bad} not" + (f", not made: {', '.join(gone)}" if gone else ""))
    return 1 if bad or gone else 0


def cpu(line):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False, env={**os.environ, **ENVIRONMENT})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def turns(asked):
    """Processor time of one program over that of the other, by scene, each pair of runs one after the other."""
    ratios = {}
    folder = os.path.abspath(asked.out)
    os.makedirs(folder, exist_ok=True)
    os.chdir(folder)
    for name, steps in scenes():
        if not re.search(asked.only, name) or any(step.endswith("^C") or "NEWEST" in step for step in steps):
            continue
        lines = [[words(os.path.abspath(program), step)[0] for step in steps] for program in (asked.one, asked.other)]
        pairs = [[sum(cpu(line) for line in of_one) for of_one in lines] for _ in range(asked.rounds)]
        ratios[name] = statistics.median(one / other for one, other in pairs)
        print(f"{ratios[name]:.3f}  {statistics.median(other for _, other in pairs):8.3f} s  {name}", flush=True)
    print(f"median of {len(ratios)} scenes {statistics.median(ratios.values()):.3f}, largest {max(ratios.values()):.3f}")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="scenes whose name has this")
    kinds = parser.add_subparsers(required=True)
    making = kinds.add_parser("make")
    making.add_argument("--program", default=os.path.join(ROOT, "build", "stickslip"))
    making.add_argument("--jobs", type=int, default=1)
    making.add_argument("out")
    making.set_defaults(call=make)
    comparing = kinds.add_parser("compare")
    comparing.add_argument("before")
    comparing.add_argument("now")
    comparing.add_argument("--most", type=int, default=6, help="lines a scene")
    comparing.add_argument("--within", type=float, default=0.0, help="the least bound: round-off, of programs of two systems")
    comparing.set_defaults(call=compare)
    timing = kinds.add_parser("turns")
    timing.add_argument("one")
    timing.add_argument("other")
    timing.add_argument("--rounds", type=int, default=5)
    timing.add_argument("--out", default="/tmp/stickslip-turns")
    timing.set_defaults(call=turns)
    asked = parser.parse_args()
    return asked.call(asked)


if __name__ == "__main__":
    sys.exit(main())
