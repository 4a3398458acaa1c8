"""Random use of the program, good and bad, from seeds: options, values, scenes with damaged bytes, checkpoints, results,
sweeps' tables and columns with damaged bytes, ranks (the cases: fuzz_cases.py).

    STICKSLIP=build/stickslip python3 tests/fuzz.py --seed 1 --cases 1000     all cases of a seed
    STICKSLIP=build/stickslip python3 tests/fuzz.py --seed 1 --only 17        one of them, with what it printed
    STICKSLIP=build/stickslip python3 tests/fuzz.py --seeds 10 --cases 10000 --state fuzz.json     goes on where it was

There is no table of right answers. What must hold of every case, whatever it asks for:
  - it ends, with exit code 0, 1 or 2, and never by a signal;
  - standard error has warnings and, unless the code is 0, one error, each one line; no internal error, no dump;
  - with code 2 no file is made or changed; a file that is not the program's never is;
  - with code 0 or 1 the summary is there, parses, tells the status, and shows every option as it was given;
  - HDF5 files that are left can be opened;
  - options in a scene do what they do on the command line.
What is refused is asked for again without the option that the error names, until it does some work. A use that takes
more than --budget seconds of processor time is cut and counted; one that waits without using any is a failure.
The options and what they take come from the program's own -help. On one rank the program is forked rather than started
(served.py); every 97th case is started, too, and must do the same.
"""
import argparse
import concurrent.futures
import datetime
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile

import h5py

from calls import PROGRAM
from fuzz_cases import NOTES, case_of, commands
from served import Server
from volume import Kept

PATIENCE = 180


class Uses:
    """Starts the program, in a folder of its own each time, and tells all that can be seen. One rank is served (see
    served.py) unless `plain`; the budget is in seconds of processor time, the wall clock has PATIENCE times that,
    so that a machine that is busy with other things makes nothing a hang."""

    def __init__(self, budget, plain):
        self.budget, self.plain = budget, plain
        self.server = None if plain else Server(PROGRAM, budget, PATIENCE * budget)
        self.table = commands()

    def close(self):
        if self.server:
            self.server.close()

    def begin(self, words, folder, ranks, plain):
        """Exit code, standard output and error."""
        out, err = os.path.join(folder, "..", "out"), os.path.join(folder, "..", "err")
        if ranks == 1 and self.server and not plain:
            code, _ = self.server.run(words, folder, out, err)
        else:
            session = os.path.join(folder, "..", "t")  # two Open MPI programs at a time must not share a folder
            os.mkdir(session)
            launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
            seconds = self.budget * ranks  # a rank that waits for another uses time, too
            with open(out, "wb") as to, open(err, "wb") as complaints_to:
                code = subprocess.run(
                    ["prlimit", f"--cpu={seconds}:{seconds + 5}", "timeout", "--kill-after=9", str(PATIENCE * self.budget), *launcher,
                     PROGRAM, *words], cwd=folder, env={**os.environ, "OMPI_MCA_orte_tmpdir_base": session},
                    stdin=subprocess.DEVNULL, stdout=to, stderr=complaints_to, check=False).returncode
            code = -signal.SIGALRM if code in (124, 137) else 128 - code if code > 128 else code
        said = []
        for path in (out, err):
            with open(path, "rb") as file:
                said.append(file.read().decode(errors="replace"))
        if ranks > 1 and "exited on signal 24" in said[1]:
            code = -signal.SIGXCPU
        return code, *said

    def see(self, words, scene, ranks, inputs, plain=False):
        with tempfile.TemporaryDirectory() as top:
            folder = os.path.join(top, "work")
            os.makedirs(os.path.join(folder, "sub"))
            with open(os.path.join(folder, "notes.txt"), "w") as file:
                file.write(NOTES)
            for name, content in {**inputs, **({} if scene is None else {"scene.yaml": scene})}.items():
                with open(os.path.join(folder, name), "wb") as file:
                    file.write(content)
            code, out, err = self.begin(words, folder, ranks, plain)
            seen = {"code": code, "out": out, "err": err, "files": {}, "hdf5": []}
            seen["hangs"], seen["cut"] = code == -signal.SIGALRM, code == -signal.SIGXCPU
            for path, _, names in os.walk(folder):
                for name in names:
                    look_at(os.path.join(path, name), os.path.relpath(os.path.join(path, name), folder), inputs, seen)
            return seen


def look_at(path, name, inputs, seen):
    with open(path, "rb") as file:
        data = file.read()
    seen["files"][name] = data
    if data[:4] == b"\x89HDF" and inputs.get(name) != data:
        try:
            with h5py.File(path, "r") as file:
                file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)
        except (OSError, RuntimeError, KeyError, ValueError) as trouble:
            seen["hdf5"].append(f"{name}: {trouble}")


def complaints(case, seen, words):
    if seen["hangs"] or seen["cut"]:
        return ["hangs"] if seen["hangs"] else []
    found = []
    code, err = seen["code"], seen["err"]
    lines = err.splitlines()
    if case.ranks > 1:  # mpirun adds lines of its own
        lines = [line for line in lines if re.match("stickslip:|terminate called", line) or "PETSC" in line]
    errors = [line for line in lines if line.startswith("stickslip: error: ")]
    quiet = code != 0 or dict(case.pairs).get("progress") == "off"  # else it closes with lines on the results
    others = [line for line in lines if not re.match("stickslip: (error|warning): " if quiet else "stickslip: ", line)]
    if code not in (0, 1, 2):
        found.append(f"exit code {code}")
    if others:
        found.append(f"other lines on standard error: {others[0][:200]}")
    if len(errors) != (code != 0):
        found.append(f"{len(errors)} errors with exit code {code}")
    if any("internal error" in line for line in errors):
        found.append("internal error")
    if any(len(line) > 700 for line in lines):
        found.append("a line of more than 700 characters")
    if seen["files"].get("notes.txt") != NOTES.encode():
        found.append("notes.txt was changed")
    if case.scene is not None and seen["files"].get("scene.yaml") != case.scene:
        found.append("the scene was changed")
    found += [trouble for trouble in seen["hdf5"] if code != 2 and trouble.split(":")[0] not in case.files]
    changed = {name for name in case.files if seen["files"].get(name) != case.files[name]}
    if changed - {"in.h5", "table.h5", "table.csv"} or (code == 2 and changed):
        found.append(f"changed: {sorted(changed)}")
    made = set(seen["files"]) - {"notes.txt", "scene.yaml", "log.txt", *case.files}
    if code == 2 and made:
        found.append(f"exit code 2 and yet files: {sorted(made)}")
    if any(os.path.basename(name).startswith(".") for name in made):
        found.append(f"a temporary file is left: {sorted(made)}")
    if code in (0, 1) and case.wants_summary and not (code == 1 and "PETSc error" in err):
        try:
            summary = json.loads(seen["files"]["summary.json"])
            if summary["status"] not in {0: ("done", "stopped"), 1: ("failed",)}[code]:
                found.append(f"status {summary['status']} with exit code {code}")
            if not case.damaged:
                shown = {name.lower(): text for name, text in summary["options"].items()}
                for name, value in case.pairs:
                    got = shown.get(name.lower().lstrip("-"))
                    if "-" + name.lower() in case.library:
                        continue  # given again behind it, which counts
                    if value == "columns.txt" or (value == "none" and got == ""):
                        continue  # a file of two columns is shown as the points in it, what is not set as nothing
                    if got != value and not (got and got.replace(" ", "") == value.replace(" ", "")):
                        found.append(f"option {name} {value!r} is shown as {got!r}")
        except (KeyError, ValueError) as trouble:
            found.append(f"summary: {type(trouble).__name__} {trouble}")
    return found


def same(one, other):
    """Two ways of saying the same: the place aside, the same error; the same summary."""
    def plain(seen):
        error = [re.sub(r" \(scene\.yaml:\d+\)", "", line) for line in seen["err"].splitlines() if "error:" in line]
        return seen["code"], error
    return plain(one) == plain(other)


def mended(case, words, seen):
    """The words without an option of which the error complains, so that more cases come to do some work; None where it
    names none that may go."""
    error = next((line for line in seen["err"].splitlines() if "error: " in line), "")
    named = [at for at in range(1, len(words)) if words[at][:1] == "-" and words[at][1:] not in case.needed and
             re.search(rf"\b{re.escape(words[at][1:])}\b", error)]
    if not named:
        return None
    at = max(named, key=lambda k: len(words[k]))
    end = at + 1
    while end < len(words) and (words[end][:1] != "-" or re.match(r"-[\d.]", words[end])):
        end += 1
    return words[:at] + words[end:]


def faults(case, words, scene, uses):
    """What one use of the program does wrong, and what was seen."""
    seen = uses.see(words, scene, case.ranks, case.files)
    if seen["cut"] and case.ranks > 1:  # ranks that wait for each other use time, too
        alone = uses.see(words, scene, 1, case.files)
        seen["hangs"] = not alone["cut"]
    return complaints(case, seen, words), seen


def check(seed, number, uses, loud=False):
    """What is wrong with a case (None), and how it ended."""
    case = case_of(seed, number, uses.table)
    words, scene = case.words(), case.scene
    found, seen = faults(case, words, scene, uses)
    if loud:
        print(shlex.join(words), "\n", scene, "\n", seen)
    alike = (not case.damaged and not case.stray and "scene.yaml" not in dict(case.pairs).values() and
             not any(name[:1] == "-" for name, _ in case.pairs))  # a dash more is no mistake on the command line
    if scene is not None and alike and not found and not seen["cut"]:
        flat = case.words(flat=True)
        other = uses.see(flat, None, case.ranks, case.files)
        # of several mistakes, another one may be met first
        if not same(seen, other) and seen["code"] != other["code"] and not other["cut"]:
            found.append(f"without the scene: exit code {other['code']}, {other['err'][:200]}")
    if number % 97 == 0 and case.ranks == 1 and not found and not seen["cut"]:  # the price of being served
        other = uses.see(words, scene, 1, case.files, plain=True)
        if not same(seen, other) or set(seen["files"]) != set(other["files"]):
            found.append(f"not served: exit code {other['code']}, {other['err'][:200]}, {sorted(other['files'])}")
    ranks = case.ranks
    for _ in range(8 if not case.stray and not case.damaged else 0):
        if found or seen["code"] != 2:
            break
        following = mended(case, case.words(flat=True) if scene is not None else words, seen)
        if following is None:
            break
        case.pairs = [pair for pair in case.pairs if "-" + pair[0] in following]
        words, scene, case.scene, case.ranks = following, None, None, 1  # what is refused on one rank is refused on several
        found, seen = faults(case, words, None, uses)
    if case.ranks != ranks and not found:
        case.ranks = ranks
        found, seen = faults(case, words, None, uses)
    how = "cut" if seen["cut"] else seen["code"]
    if not found:
        return None, how
    text = f"case {number} of seed {seed}, {case.ranks} ranks: {shlex.join(words)}\n    scene: {scene!r}\n"
    return text + "".join(f"    {one}\n" for one in found) + f"    {seen['err'][:500]!r}", how


class State(Kept):
    """How far the cases of some seeds are."""

    def __init__(self, path, seeds, cases):
        super().__init__(path, ["seeds"], seeds=seeds, cases=cases, done={str(seed): 0 for seed in seeds}, codes={},
                         failures=[], cut=[])
        self.now["cases"] = cases

    def left(self):
        return [(seed, number) for seed in self.now["seeds"] for number in range(self.now["done"][str(seed)], self.now["cases"])]

    def add(self, seed, number, text, how):
        now = self.now
        now["codes"][str(how)] = now["codes"].get(str(how), 0) + 1
        if text:
            print("FAILED", text, flush=True)
            now["failures"].append(text)
        if how == "cut":
            now["cut"].append([seed, number])
        now["done"][str(seed)] = number + 1

    def row(self):
        """A line of a table: date, revision, seeds, cases, failures, how they ended, hours."""
        now = self.now
        codes = ", ".join(f"{code}: {count}" for code, count in sorted(now["codes"].items()))
        return (f"| {datetime.date.today()} | {now['git']} | {now['seeds'][0]} to {now['seeds'][-1]} | "
                f"{sum(now['done'].values())} | {len(now['failures'])} | {codes} | {now['seconds'] / 3600:.2f} |")


worker = None  # the Uses of a process that takes part


def begin_worker(top, budget, plain):
    """A folder of its own, also for Open MPI; all of them go with `top`. Its server ends with it."""
    global worker
    tempfile.tempdir = os.environ["OMPI_MCA_orte_tmpdir_base"] = tempfile.mkdtemp(dir=top)
    worker = Uses(budget, plain)


def one_case(which):
    return check(*which, worker)


def volume(state, jobs, budget, plain):
    left = state.left()
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # folders come and go faster there than on a disk
    with tempfile.TemporaryDirectory(prefix="stickslip-", dir=memory, ignore_cleanup_errors=True) as top, \
            concurrent.futures.ProcessPoolExecutor(jobs, initializer=begin_worker, initargs=(top, budget, plain)) as pool:
        for at, (which, result) in enumerate(zip(left, pool.map(one_case, left, chunksize=5))):
            state.add(*which, *result)
            if at % 200 == 199:
                state.save()
    state.save()


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1, help="the first")
    parser.add_argument("--seeds", type=int, default=1, help="how many, one after the other")
    parser.add_argument("--cases", type=int, default=1000, help="of each seed")
    parser.add_argument("--only", type=int, help="this case alone, with all it printed")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--budget", type=int, default=5, help="seconds of processor time that a use may take")
    parser.add_argument("--plain", action="store_true", help="start the program anew each time")
    parser.add_argument("--state", help="file that holds how far it is, to go on from")
    given = parser.parse_args(arguments)
    if given.only is not None:
        uses = Uses(given.budget, given.plain)
        text, _ = check(given.seed, given.only, uses, loud=True)
        uses.close()
        print("FAILED " + text if text else "passed")
        return 1 if text else 0
    state = State(given.state, list(range(given.seed, given.seed + given.seeds)), given.cases)
    volume(state, given.jobs, given.budget, given.plain)
    print("| date | revision | seeds | cases | failures | exit codes | hours |\n|---|---|---|---|---|---|---|")
    print(state.row())
    return 1 if state.now["failures"] else 0


if __name__ == "__main__":
    sys.exit(main())
