"""Do the tests fail when the program is wrong? Small random changes of the source, one at a time, each built and tested.

    python3 tests/mutants.py --count 20 --seed 1 --state mutants.json     (or ./check mutants [--count N] [--seed S])

A change is a sign, a comparison, an "and" for an "or", a constant times 1.5, a term that is dropped, or an index, in a line of
src/ or include/ drawn at random. Of each is kept:
  no program     it does not compile
  no output      exit codes and summaries of the commands below are what they were: it counts as no change
  found          the unit tests, else those of the command line, fail; the first that does stands beside it
  survived       all pass: a test is missing
The commands (some 200) are random scenes of units.py, run, spectrum, boundary, cycle, wave, sweep, chart and fit, at scales near 1.
Work is done in a clone of the last commit below results/, so that nothing here is touched; the state tells which changes are done,
and the same command goes on where it was. A change depends on the seed and its number alone.
"""
import argparse
import collections
import json
import os
import random
import re
import subprocess
import sys

import numpy as np

SOURCE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
OTHER = {"+": "-", "-": "+", "<": ">=", ">": "<=", "<=": "<", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&"}
NUMBER = r"(?<![\w.])(?:\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+|[2-9]|\d{2,})(?![\w.\]])"
SITES = ((re.compile(r"(?<=[\w)\]] )[+-](?= [\w(])"), lambda at: OTHER[at]),
         (re.compile(r"(?<= )(?:<=|>=|==|!=|<|>)(?= )"), lambda at: OTHER[at]),
         (re.compile(r"(?<= )(?:&&|\|\|)(?= )"), lambda at: OTHER[at]),
         (re.compile(NUMBER), lambda at: repr(1.5 * float(at)) if re.search("[.e]", at) else str(int(1.5 * int(at)))),
         (re.compile(r" [+-] \w+(?:\.\w+|\[\w+\])*(?=[;,)])"), lambda at: ""),
         (re.compile(r"(?<=\[)\w+ - 1(?=\])"), lambda at: at.removesuffix(" - 1")),
         (re.compile(r"(?<=\w\[)[a-z](?=\])"), lambda at: f"{at} > 0 ? {at} - 1 : {at}"))
NO_CODE = re.compile(r'^\s*(?://|#|\*|template|using|static_assert|throw|warn)|"')
NO_RESULT = {"options", "wall_s", "seconds", "events_per_s", "files", "processor_s", "best", "provenance", "commit", "date"}
KINDS = (("run", "draw_run", 60), ("run", "draw_events", 30), ("spectrum", "draw_spectrum", 30), ("boundary", "draw_boundary", 30),
         ("cycle", "draw_cycle", 25), ("wave", "draw_wave", 20), ("sweep", "draw_sweep", 10), ("chart", "draw_chart", 2),
         ("fit", "draw_fit", 8))
SLOWEST = 4  # seconds of a command


def sites(text):
    """(line, begin, end, what stands there then) of all changes of a source."""
    for number, line in enumerate(text.splitlines()):
        if NO_CODE.search(line):
            continue
        code = line.split(" //")[0]
        for pattern, other in SITES:
            for found in pattern.finditer(code):
                yield number, found.start(), found.end(), other(found.group())


class Change:
    def __init__(self, tree, seed, number):
        draw = random.Random(f"{seed}/{number}")
        listed = subprocess.run(["git", "ls-files", "src", "include"], cwd=tree, capture_output=True, text=True, check=True).stdout.split()
        files = [name for name in listed if name.endswith((".cpp", ".hpp"))]
        lines = [len(open(os.path.join(tree, name), encoding="utf-8").readlines()) for name in files]
        while True:
            self.name = draw.choices(files, lines)[0]
            self.path = os.path.join(tree, self.name)
            with open(self.path, encoding="utf-8") as file:
                self.before = file.read()
            found = list(sites(self.before))
            if found:
                break
        self.line, begin, end, other = draw.choice(found)
        lines = self.before.splitlines(keepends=True)
        self.was = lines[self.line].strip()
        lines[self.line] = lines[self.line][:begin] + other + lines[self.line][end:]
        self.now, self.after = lines[self.line].strip(), "".join(lines)

    def write(self, text):
        with open(self.path, "w", encoding="utf-8") as file:
            file.write(text)

    def __enter__(self):
        self.write(self.after)
        return self

    def __exit__(self, *_):
        self.write(self.before)


class Tree:
    """The clone, its program and what the commands answer."""

    def __init__(self, folder):
        self.path, self.commands, self.scratch = (os.path.join(folder, name) for name in ("tree", "commands.json", "scratch"))
        os.makedirs(self.scratch, exist_ok=True)
        if not os.path.isdir(self.path):
            subprocess.run(["git", "clone", "-q", SOURCE, self.path], check=True)
            # a change of a header then builds what includes it and nothing else
            self.shell("cmake --preset release -DSTICKSLIP_TESTS=ON -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON", check=True)
        self.environment = os.environ | {"STICKSLIP": os.path.join(self.path, "build", "stickslip"), "STICKSLIP_SOURCE": self.path}

    def shell(self, command, **more):
        return subprocess.run(["bash", "-c", f". scripts/prepare.sh; {command}"], cwd=self.path, capture_output=True, text=True,
                              errors="replace", **more)

    def build(self):
        return self.shell("cmake --build --preset release --target stickslip unit").returncode == 0

    def drawn(self):
        """Random command lines; columns of data lie in the folder where they are run."""
        os.environ.update(self.environment)
        sys.path.insert(0, os.path.join(self.path, "tests"))
        import units  # the scenes of the clone, with its program
        for command, draw, count in KINDS:
            for index in range(count):
                generator = np.random.default_rng([73, len(command), index])
                options = getattr(units, draw)(generator)
                yield [command, *units.words_for(units.with_file(options, os.path.join(self.scratch, f"data{index}")))]

    def answer(self, words):
        """Exit code and results of a command line."""
        try:
            done = subprocess.run([self.environment["STICKSLIP"], *words, "-progress", "off", "-summary", "s.json"], cwd=self.scratch,
                                  capture_output=True, timeout=SLOWEST, check=False)
        except subprocess.TimeoutExpired:
            return None
        if done.returncode:
            return done.returncode
        with open(os.path.join(self.scratch, "s.json"), encoding="utf-8") as file:
            return results(json.load(file))

    def known(self):
        """Command lines with their answers, made once."""
        if os.path.exists(self.commands):
            with open(self.commands, encoding="utf-8") as file:
                return json.load(file)
        pairs = []
        for words in self.drawn():
            answer = self.answer(words)
            if answer is not None and answer == self.answer(words):  # what differs from one time to the next tells nothing
                pairs.append([words, answer])
        with open(self.commands, "w", encoding="utf-8") as file:
            json.dump(pairs, file)
        return pairs

    def changed(self, pairs):
        return next((index for index, (words, answer) in enumerate(pairs) if self.answer(words) != answer), None)

    def failure(self):
        """The first test that fails; None: all pass."""
        unit = subprocess.run(["./unit", "--abort", "--reporter", "compact"], cwd=os.path.join(self.path, "build", "tests"),
                              env=self.environment, capture_output=True, text=True, errors="replace", timeout=3600, check=False)
        if unit.returncode:
            failed = [line for line in unit.stdout.splitlines() if "failed" in line]
            return "unit: " + (failed[0][-200:] if failed else f"exit {unit.returncode}")
        command = ["/usr/bin/python3", "-B", "-m", "pytest", "-c", "tests/pytest.ini", "-q", "-x", "--numprocesses", "2", "-m", "not ranks",
                   "tests/command_line", "tests/audit"]
        done = subprocess.run(command, cwd=self.path, env=self.environment, capture_output=True, text=True, errors="replace", check=False)
        if not done.returncode:
            return None
        failed = [line for line in done.stdout.splitlines() if line.startswith("FAILED")]
        return failed[0][:200] if failed else f"pytest: exit {done.returncode}"


def results(summary):
    """Without what differs from one time to the next."""
    if isinstance(summary, dict):
        return {name: results(value) for name, value in summary.items() if name not in NO_RESULT}
    return [results(value) for value in summary] if isinstance(summary, list) else summary


def tried(tree, pairs, change):
    with change:
        if not tree.build():
            return "no program", ""
        first = tree.changed(pairs)
        if first is None:
            return "no output", ""
        failure = tree.failure()
        return ("found", failure) if failure else ("survived", " ".join(pairs[first][0]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20, help="changes that an output shows, to be tested")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--state", default=os.path.join(SOURCE, "results", "mutants", "state.json"))
    given = parser.parse_args()
    folder = os.path.dirname(os.path.abspath(given.state))
    os.makedirs(folder, exist_ok=True)
    tree, done = Tree(folder), {}
    if os.path.exists(given.state):
        with open(given.state, encoding="utf-8") as file:
            done = json.load(file)
    if not tree.build():
        sys.exit("the tree without a change does not build")
    pairs = tree.known()
    number, tested = 0, 0
    while tested < given.count:
        key = f"{given.seed}/{number}"
        if key not in done:
            change = Change(tree.path, given.seed, number)
            verdict, why = tried(tree, pairs, change)
            done[key] = {"verdict": verdict, "why": why, "where": f"{change.name}:{change.line + 1}", "was": change.was, "now": change.now}
            with open(given.state, "w", encoding="utf-8") as file:
                json.dump(done, file, indent=1)
            print(key, verdict, done[key]["where"], f"\n    {change.was}\n    {change.now}\n    {why}", flush=True)
        tested += done[key]["verdict"] in ("found", "survived")
        number += 1
    counts = collections.Counter(row["verdict"] for row in done.values())
    print(f"{counts['found'] + counts['survived']} changes that an output shows: {counts['found']} found, {counts['survived']} survived; "
          f"{counts['no output']} show in no output, {counts['no program']} do not compile")
    return 1 if counts["survived"] else 0


if __name__ == "__main__":
    sys.exit(main())
