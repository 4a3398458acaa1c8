"""Runs the test suite under valgrind, on 1 and 2 ranks, and goes on where it was interrupted.

    STICKSLIP=build/stickslip python3 tests/valgrind.py --jobs 2 --minutes 40 --state valgrind.json    (or ./check valgrind)

Memory that is read before it is written, used after it is freed, or lost; what is not in valgrind.supp is a finding.
In this order:
  - COMMANDS, a command of each kind;
  - the short unit tests on 1 rank and, unless they are [serial], on 2; several to a process, since to start one takes
    some 4 s;
  - one test of each file of tests of the command line and of audits, these with two scenes: whatever they call is started
    under valgrind (but for LEFT_OUT). A test that fails there is counted, not a finding: valgrind makes everything some
    40 times slower, and some tests are about time and memory;
  - the long unit tests; the second test of each file, the third ...
A process that takes more than --budget seconds of processor time is cut, and a test that takes five times as long by the
clock, which is counted and listed: until then it was looked at, what it had lost at its end is unknown. No case begins
after --minutes; the next call goes on from there.
"""
import argparse
import concurrent.futures
import datetime
import glob
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

from calls import PROGRAM, SOURCE
from volume import Kept

UNIT = os.path.join(os.path.dirname(PROGRAM), "tests", "unit")
VALGRIND = ["valgrind", "-q", "--leak-check=full", "--show-leak-kinds=definite,possible", "--num-callers=25",
            "--errors-for-leak-kinds=definite,possible", "--gen-suppressions=all",
            f"--suppressions={os.path.join(SOURCE, 'tests', 'valgrind.supp')}"]
SLOWER = 50  # times as long as without valgrind, at most as a rule
TESTS = os.path.join(SOURCE, "tests")
PYTEST = ["/usr/bin/python3", "-B", "-m", "pytest", "-c", os.path.join(TESTS, "pytest.ini"), "-q", "--scenes=2"]
KINDS = ["command", "unit on 1 rank", "unit on 2 ranks", "test"]
LEFT_OUT = re.compile(r"test_(fuzz|hostile|kills)\.py")  # hundreds of programs each, forked and killed in a hurry
# Its reference is computed with a long double, which is a double under valgrind.
LONG_DOUBLE = "friction with a direct effect is its formula over all that a normal double holds"
# How a test ends a program; also the end of one whose time is over.
ENDED = re.compile(r"Process terminating with default action of signal (?:1|2|9|13|15|24|25) \(")

COMMANDS = [
    "1 run -grid_n 24 -grid_length 12 -ts_max_time 1 -init_type sine -out_file a.h5 -out_checkpoint_every 4"
        " -out_probes 3 -out_displacement -summary a.json then run -restart a.chk-000004.h5 -out_file a.h5 -summary a.json",
    "1 run -grid_n 24 -grid_length 12 -ts_max_time 0.5 -init_type sine -ts_type arkimex -imex_implicit both",
    "1 run -grid_n 24 -grid_length 12 -ts_max_time 0.5 -init_type sine -ts_type arkimex -imex_implicit friction"
        " -friction_law carlson-langer -friction_stick regularised -friction_eps 0.1 -state_law healing",
    "1 run -grid_n 24 -grid_length 12 -ts_max_time 0.5 -init_type sine -ts_type arkimex -imex_implicit friction -bc_left velocity"
        " -friction_spread 0.3 -friction_law coulomb -state_law healing -state_D 0.3 -state_t_h 2 -state_tau_inf 1.5",
    "1 run -model_form chain -grid_n 9 -bc_left free -friction_law rate-and-state -ts_max_time 0.2 -init_noise 0.01",
    "1 run -grid_n 24 -grid_length 12 -ts_type bdf -ts_max_time 0.1 -bc_left velocity -init_type layer",
    "1 run -grid_n 24 -ts_rtol 0 -ts_dt 0.9 -ts_type rk -ts_rk_type 4 -init_type sine",  # explodes: exit code 1
    "1 run -grid_n -4",
    "1 spectrum -grid_n 24 -bc_left velocity -out_file s.h5 -summary s.json",
    "1 boundary -grid_n 16 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5 -summary b.json",
    "1 wave -wave_pulses 2 -wave_length 60 -out_file w.h5",
    "1 laws -out_file l.h5 -laws_points 11",
    "1 fit -model_form chain -grid_n 1 -bc_left free -ts_max_time 5 -fit_data 1:0.1,2:0.2,3:0.1,4:0.2 -fit_parameters model_k0,model_m"
        " -fit_starts 2 -out_file f.h5",
    "1 run -model_form chain -grid_n 2 -bc_left free -friction_law rate-and-state -friction_a 0.02 -friction_b 0.03 -friction_D 0.01"
        " -model_k0 0.5 -model_m 1e-2 -model_v 0.01 -friction_psi0 1e-2 -init_psi 0.012 -init_eta steady -ts_max_time 5 -lyapunov_count 3",
    "1 run -grid_length 12 -init_type sine -ts_max_time 0.3 -accuracy 1e-2",
    "2 run -model_form chain -grid_n 9 -bc_left free -friction_law carlson-langer -init_psi 0 -init_noise 0.3"
        " -ts_max_time 3 -out_events -out_file e.h5",
    "2 run -grid_n 24 -grid_length 12 -ts_max_time 1 -init_type sine -out_file c.h5 -out_checkpoint_every 4"
        " -out_probes 3",
    "2 run -grid_n 24 -grid_length 12 -ts_max_time 0.3 -init_type sine -ts_type arkimex -imex_implicit wave",
    "2 spectrum -grid_n 24",
]


class Case:
    """What is started at once: `names` of one kind, of which more than one only where they are short unit tests."""

    def __init__(self, kind, names):
        self.kind, self.names = kind, names

    def words(self, wrappers, here):
        """To be run in the folder `here`, where the names of unit tests are left."""
        name = self.names[0]
        if self.kind == "command":
            ranks, _, arguments = name.partition(" ")
            started = shlex.join([*launcher(ranks), os.path.join(wrappers, "stickslip")])
            return ["sh", "-c", " && ".join(f"{started} {one}" for one in arguments.split(" then "))]
        if self.kind == "test":
            return [*PYTEST, os.path.join(TESTS, name)]
        with open(os.path.join(here, "names"), "w", encoding="utf-8") as file:
            file.writelines(f'"{name}"\n' for name in self.names)
        return launcher("2" if "2 ranks" in self.kind else "1") + [os.path.join(wrappers, "unit"), "-d", "yes", "-f", "names"]


def launcher(ranks):
    return ["mpirun", "-n", ranks] if ranks != "1" else []


def write_wrapper(path, program, budget):
    """A program that runs another under valgrind, in the same process; what is found goes to $FOUND."""
    with open(path, "w", encoding="utf-8") as file:
        file.write(f'#!/bin/sh\nulimit -St {budget}\n'
                   f'exec {shlex.join(VALGRIND)} --log-file="$FOUND/%p.log" {shlex.quote(program)} "$@"\n')
    os.chmod(path, 0o755)


def found_in(folder):
    """Of the logs of one case: how many processes, how many of them were cut, and what was found."""
    logs, cut, findings = sorted(glob.glob(os.path.join(folder, "*.log"))), 0, []
    for path in logs:
        with open(path, encoding="utf-8", errors="replace") as file:
            text = re.sub(r"^==\d+== ?", "", file.read(), flags=re.MULTILINE)
        cut += "signal 24 (SIGXCPU)" in text
        text = ENDED.split(text)[0].strip()  # what such a program had not freed is not lost
        if text:
            findings.append(text)
    return len(logs), cut, findings


def listed(*words):
    done = subprocess.run(words, capture_output=True, text=True, check=False)  # Catch2 returns how many there are
    return [line for line in done.stdout.splitlines() if line.strip()]


def unit_cases(seconds, budget):
    """The unit tests in processes: the short ones in batches, and those that may need more than a tenth of the budget."""
    cases, long = [], []
    for kind, tests in (("unit on 1 rank", listed(UNIT, "--list-test-names-only")),
                        ("unit on 2 ranks", listed(UNIT, "--list-test-names-only", "~[serial]"))):
        batch, left = [], 0.0
        for name in tests:
            if name == LONG_DOUBLE:
                continue
            needed = SLOWER * seconds.get(name, budget)
            if needed > budget / 10:
                long.append(Case(kind, [name]))
                continue
            if batch and (needed > left or len(batch) == 20):
                batch, left = [], 0.0
            if not batch:
                left = budget / 2
                cases.append(Case(kind, batch))
            batch.append(name)
            left -= needed
    return cases, long


def durations():
    """Seconds that each unit test takes without valgrind."""
    with tempfile.TemporaryDirectory(prefix="stickslip-") as folder:
        done = subprocess.run([UNIT, "-d", "yes"], cwd=folder, capture_output=True, text=True, check=False)
    return {name: float(seconds) for seconds, name in re.findall(r"^([\d.]+) s: (.*)$", done.stdout, re.MULTILINE)}


def test_cases():
    """One test of each file; the second of each, the third ..."""
    folders = [os.path.join(TESTS, folder) for folder in ("command_line", "audit")]
    names = [line for line in listed(*PYTEST, "--collect-only", *folders) if "::" in line and not LEFT_OUT.search(line)]
    turn = {}
    ordered = []
    for name in names:
        file = name.partition("::")[0]
        turn[file] = turn.get(file, 0) + 1
        ordered.append((turn[file], name))
    ordered.sort(key=lambda pair: pair[0])
    return ([Case("test", [name]) for number, name in ordered if number == 1],
            [Case("test", [name]) for number, name in ordered if number > 1])


class State(Kept):
    """What is done."""

    def __init__(self, path):
        self.lock = threading.Lock()
        super().__init__(path, programs=(PROGRAM, UNIT), durations={}, processes=0, findings=[], done={kind: {} for kind in KINDS})
        if not self.now["durations"]:
            self.now["durations"] = durations()
            self.save()

    def add(self, case, outcomes, processes, findings):
        with self.lock:
            self.now["done"][case.kind].update(outcomes)
            self.now["processes"] += processes
            for text in findings:
                print(f"FOUND {case.kind}: {'; '.join(case.names)}\n{text[:6000]}", flush=True)
                self.now["findings"].append([case.kind, case.names, text])
            for name, outcome in outcomes.items():
                print(f"{'found' if findings else 'clean'}, {outcome}; {case.kind}: {name}", flush=True)
            self.save()

    def row(self, cases):
        """A line of a table: date, revision, of each kind how many of how many with their ends, processes, findings, hours."""
        columns = []
        for kind in KINDS:
            names = {name for case in cases for name in case.names if case.kind == kind}
            outcomes = [outcome for name, outcome in self.now["done"][kind].items() if name in names]
            ends = [f"{outcomes.count(word)} {word}" for word in ("cut", "failed") if word in outcomes]
            columns.append(f"{len(outcomes)} of {len(names)}" + (f" ({', '.join(ends)})" if ends else ""))
        return (f"| {datetime.date.today()} | {self.now['git']} | {' | '.join(columns)} | {self.now['processes']} | "
                f"{len(self.now['findings'])} | {self.now['seconds'] / 3600:.2f} |")


def look_at(case, wrappers, budget):
    """Runs a case; how each of its names ended (done, cut, failed), processes, findings."""
    with tempfile.TemporaryDirectory(dir=wrappers, ignore_cleanup_errors=True) as here:
        for name in ("found", "mpi"):
            os.mkdir(os.path.join(here, name))
        environment = {**os.environ, "FOUND": os.path.join(here, "found"), "STICKSLIP": os.path.join(wrappers, "stickslip"),
                       "OMPI_MCA_orte_tmpdir_base": os.path.join(here, "mpi"), "TMPDIR": here,
                       "HWLOC_COMPONENTS": "-x86"}  # which says on stderr that valgrind hinders it
        words = case.words(wrappers, here)
        process = subprocess.Popen(words, cwd=here, env=environment, text=True, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, start_new_session=True)
        late = False
        try:
            output, _ = process.communicate(timeout=5 * budget)
        except subprocess.TimeoutExpired:
            late = True
            os.killpg(process.pid, signal.SIGTERM)  # which mpirun passes on
            try:
                output, _ = process.communicate(timeout=10)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                output, _ = process.communicate()
        processes, cut, findings = found_in(environment["FOUND"])
    if len(case.names) > 1 and process.returncode and not findings:  # by which of them?
        alone = [look_at(Case(case.kind, [name]), wrappers, budget) for name in case.names]
        return ({name: outcome for outcomes, _, _ in alone for name, outcome in outcomes.items()},
                sum(number for _, number, _ in alone), [text for _, _, texts in alone for text in texts])
    good = (0, 1, 2) if case.kind == "command" else (0, 5) if case.kind == "test" else (0,)
    outcome = "cut" if cut or late else "done" if process.returncode in good else "failed"
    if outcome == "failed" and case.kind != "test":
        findings.append(f"exit code {process.returncode}\n{output[-3000:]}")
    return {name: outcome for name in case.names}, processes, findings


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="no case begins later")
    parser.add_argument("--budget", type=int, default=120, help="seconds of processor time that a process may take")
    parser.add_argument("--only", help="cases whose name holds this text")
    parser.add_argument("--state", help="file that holds how far they are, to go on from")
    given = parser.parse_args()
    if not shutil.which("valgrind"):
        sys.exit("valgrind is not installed")
    state = State(given.state)
    (short, long), (first, more) = unit_cases(state.now["durations"], given.budget), test_cases()
    cases = [Case("command", [name]) for name in COMMANDS] + short + first + long + more
    end = time.monotonic() + 60 * given.minutes
    with tempfile.TemporaryDirectory(prefix="stickslip-", ignore_cleanup_errors=True) as wrappers, \
            concurrent.futures.ThreadPoolExecutor(given.jobs) as pool:
        write_wrapper(os.path.join(wrappers, "stickslip"), PROGRAM, given.budget)
        write_wrapper(os.path.join(wrappers, "unit"), UNIT, given.budget)

        def take(case):
            names = [name for name in case.names if name not in state.now["done"][case.kind] and (given.only or "") in name]
            if names and time.monotonic() < end:
                state.add(case, *look_at(Case(case.kind, names), wrappers, given.budget))
        list(pool.map(take, cases))
    print("| date | revision | commands | unit, 1 rank | unit, 2 ranks | tests of the command line | processes | findings |"
          " hours |\n|---|---|---|---|---|---|---|---|---|")
    print(state.row(cases))
    return 1 if state.now["findings"] else 0


if __name__ == "__main__":
    sys.exit(main())
