"""Kills commands at random moments, some of them inside a write, and shows that nothing is lost.

    STICKSLIP=build/stickslip python3 tests/kills.py --cases 1000 --state kills.json     (or ./check kills)

Of ten cases six are a `run` with frames, probes and series, and one kind of further output, on 1 to 4 ranks:
  - kill -9 of all ranks or of one at a random moment, or inside a write: of all calls by which the program changes
    files (pwrite, rename, ftruncate, fsync, unlink, posix_fallocate) a random one is the last, and of a pwrite only a
    part of the bytes arrives; or SIGTERM, SIGINT, or -ts_max_wall;
  - from the first frame on the HDF5 file opens; its frames, probes and series are a beginning of those of a run that
    nobody killed, to the last bit; no fewer than a reader saw before the kill;
  - the newest checkpoint is whole, whatever was being written;
  - a restart from it, some of them killed inside a write and repeated, completes the file, which then equals that of
    the run that nobody killed, to the last bit.
Four are of kill_others.py: a killed `sweep` goes on to the same table; a killed `chart`, `boundary` or other command
with one result leaves the earlier file or a whole one; a disk that is full or may not be written, or a folder that
goes, is one line of error, and what was kept can be read and gone on from.
A case depends on its number and the seed alone, but for the moments.
"""
import argparse
import concurrent.futures
import datetime
import glob
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile

import numpy as np
import xarray

from calls import PROGRAM, check, data, line, run, same
from kill_others import folder_gone, result_killed, small_disk, sweep_killed
from kill_tools import begun, calls_of, ended_inside_a_write, kill, reference
from volume import Kept

# rk:3bs goes on bitwise from any checkpoint, whether or not the uninterrupted run has one there
SCENE = "-grid_n 300 -init_type sine -ts_type rk -ts_rk_type 3bs -out_probes 0,10.3,45 -out_checkpoint_every 60"
LENGTH = {1: "-ts_max_time 12 -out_frames 601", 2: "-ts_max_time 6 -out_frames 301"}  # by ranks, 2 or more
MORE = ["", "", "-out_displacement true", "-out_events true", "-out_series false",
        "-out_maxima 1", "-friction_law coulomb -friction_stick regularised -friction_eps 0.1"]
# on one rank: only what slides is advanced
CLUSTERS = ("-ts_rk_type 5dp -stick_clusters on -model_form chain -model_m 1 -model_k0 1 -model_k1 4 -model_f0 1 -model_v 0.02"
            " -friction_law carlson-langer -friction_sigma 0.01 -friction_alpha 2 -friction_spread 0.3 -init_type uniform -init_psi 0"
            " -init_eta 0.5 -out_events true -out_rupture true -out_series_every 3 -ts_max_time 60")


class Case:
    def __init__(self, seed, number):
        self.seed, self.number, self.name = seed, number, f"case{number}"
        self.rng = random.Random(f"{seed}/{number}")
        self.ranks = self.rng.choice([1, 1, 1, 1, 1, 2, 2, 3, 4])
        self.counts = []

    def __str__(self):
        return f"case {self.number} of seed {self.seed} on {self.ranks} ranks"

    def count(self, what):
        self.counts.append(what)


def beginning(path, reference, text):
    """The file holds a beginning of the reference; how many frames."""
    now = data(path)
    frames = len(now["t"])
    for name, values in now.items():
        if name in ("x", "probes/x", "friction_amplitude") or name.startswith("friction/"):
            check(np.array_equal(values, reference[name]), f"{text}: {name}")
            continue
        group = name.rpartition("/")[0]
        rows = len(now[f"{group}/t" if group else "t"])
        alike = np.array_equal(values[:rows], reference[name][:rows], equal_nan=values.dtype.kind in "fc")
        check(len(values) >= rows and alike,
              f"{text}: {name} is no beginning of the uninterrupted run's")
    return frames


def at_random(case, scene, wanted, duration):
    """Stops a run at a random moment; what a reader saw before. A signal may come when all is written and nobody waits
    for it any more: then it ends what is left of the program."""
    name, rng = case.name, case.rng
    how = rng.choice(["kill", "kill", "one", "term", "int", "wall"])
    case.count(f"run {how}")
    if how == "wall":
        run(f"{scene} -out_file {name}.h5 -ts_max_wall {rng.uniform(0.01, 1) * duration:.3f}s", case.ranks)
        return 0
    process, seen = begun(scene, case.ranks, name, "run", rng.uniform(0, 1) * duration), 0
    if os.path.exists(f"{name}.h5"):
        seen = len(data(f"{name}.h5")["t"])
        with xarray.open_dataset(f"{name}.h5", engine="h5netcdf") as read:  # as its user does, while it is written
            check(read.psi.shape[1] == 300, "xarray opens it")
    number = {"term": signal.SIGTERM, "int": signal.SIGINT}.get(how, signal.SIGKILL)
    code = kill(process, case.ranks, f"{name}.pids", number, rng.randrange(case.ranks) if how == "one" else None)
    if how in ("term", "int") and case.ranks == 1 and seen:
        complete = len(data(f"{name}.h5")["t"]) == len(wanted["t"])
        check(code in (0, 128 + number) or (code == -number and complete), f"{case}: exit {code} after signal {number}")
    return seen


def run_killed(case):
    name, rng, ranks = case.name, case.rng, case.ranks
    scene = f"{SCENE} {LENGTH[min(ranks, 2)]} {rng.choice(MORE + [CLUSTERS] * 2 if ranks == 1 else MORE)}"
    wanted, duration = reference(scene, ranks)
    seen = 0
    if rng.random() < 0.5:
        case.count("run inside")
        ended_inside_a_write(line(f"{scene} -out_file {name}.h5", ranks), rng.randint(1, calls_of(scene, ranks, "run")))
    else:
        seen = at_random(case, scene, wanted, duration)
    checkpoints = sorted(glob.glob(f"{name}.chk-*.h5"))
    if not os.path.exists(f"{name}.h5"):
        case.count("run before the first frame")
        check(not checkpoints, f"{case}: checkpoints without a file")
        return
    check(len(checkpoints) <= 3, f"{case}: {len(checkpoints)} checkpoints, of which two are kept and one may be new")
    shown = beginning(f"{name}.h5", wanted, str(case))
    check(shown >= seen, f"{case}: {shown} frames, a reader saw {seen}")
    if checkpoints and rng.random() < 0.3:  # the restart is killed as well
        case.count("run twice")
        ended_inside_a_write(line(f"-restart {checkpoints[-1]}", ranks), rng.randint(1, calls_of(scene, ranks, "run")))
        beginning(f"{name}.h5", wanted, f"{case}, its restart")
        checkpoints = sorted(glob.glob(f"{name}.chk-*.h5"))
    if checkpoints:
        case.count("run continued")
        run(f"-restart {checkpoints[-1]} -ts_max_wall 10m", ranks)
        same(wanted, data(f"{name}.h5"), str(case))


def one_case(seed, number):
    """What does not hold (or None), and what was counted. Works in the folder in which it stands."""
    case = Case(seed, number)
    kind, trouble = number % 10, None
    try:
        if kind < 6:
            run_killed(case)
        elif kind < 7:
            sweep_killed(case)
        elif kind < 9:
            result_killed(case)
        elif number // 10 % 3 < 2:
            small_disk(case, f"{SCENE} {LENGTH[min(case.ranks, 2)]} {case.rng.choice(MORE)}")
        else:
            folder_gone(case, f"{SCENE} {LENGTH[min(case.ranks, 2)]}")
    except (AssertionError, OSError, KeyError, ValueError, subprocess.SubprocessError) as found:
        trouble = f"{case}: {type(found).__name__} {found}"
    for old in glob.glob(f"{case.name}*") + glob.glob(f".{case.name}*"):
        shutil.rmtree(old, ignore_errors=True)
        if os.path.exists(old):
            os.remove(old)
    return trouble, case.counts


def settle(top):
    """Each worker has a folder of its own, and Open MPI another one there."""
    folder = tempfile.mkdtemp(dir=top)
    os.makedirs(os.path.join(folder, "mpi"))
    os.environ["OMPI_MCA_orte_tmpdir_base"] = os.path.join(folder, "mpi")
    os.chdir(folder)


class State(Kept):
    """How far the cases are."""

    def __init__(self, path, seed):
        super().__init__(path, ["seed"], seed=seed, done=0, failures=[], counts={})

    def add(self, trouble, counts):
        self.now["done"] += 1
        for what in counts:
            self.now["counts"][what] = self.now["counts"].get(what, 0) + 1
        if trouble:
            self.now["failures"].append(trouble)
            print("FAILED", trouble, flush=True)
        self.save()

    def row(self):
        counts = ", ".join(f"{what}: {count}" for what, count in sorted(self.now["counts"].items()))
        return (f"| {datetime.date.today()} | {self.now['git']} | {self.now['seed']} | {self.now['done']} | "
                f"{len(self.now['failures'])} | {counts} |")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--only", type=int, nargs="+", help="these cases alone")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--state", help="file that holds how far they are, to go on from")
    given = parser.parse_args(arguments)
    state = State(None if given.only else given.state, given.seed)
    numbers = given.only or range(state.now["done"], given.cases)
    with tempfile.TemporaryDirectory(prefix="stickslip-", ignore_cleanup_errors=True) as top, \
            concurrent.futures.ProcessPoolExecutor(given.jobs, initializer=settle, initargs=(top,)) as pool:
        for trouble, counts in pool.map(one_case, [given.seed] * len(numbers), numbers):
            state.add(trouble, counts)
    print("| date | revision | seed | kills | failures | of them |\n|---|---|---|---|---|---|")
    print(state.row())
    return 1 if state.now["failures"] else 0


if __name__ == "__main__":
    sys.exit(main())
