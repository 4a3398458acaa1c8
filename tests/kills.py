"""Kills runs at random moments, some of them inside a write, and shows that nothing is lost.

    STICKSLIP=build/stickslip python3 tests/kills.py --cases 100 [--seed 1]     (or ./check kills)

Of each case, on 1 or 2 ranks (every second time with -out_writers root), of a scene with frames, probes and series:
  - kill -9 at a random moment, or, in every second case, inside a write: of all calls by which the program changes
    files (pwrite, rename, ftruncate, fsync, unlink, posix_fallocate) a random one is the last, and of a pwrite only a
    part of the bytes arrives;
  - from the first frame on the HDF5 file opens; its frames, probes and series are a beginning of those of a run that
    nobody killed, to the last bit; no fewer than a reader saw before the kill;
  - the newest checkpoint is whole, whatever was being written;
  - a restart from it, some of them killed inside a write and repeated, completes the file, which then equals that of
    the run that nobody killed, to the last bit.
"""
import argparse
import glob
import os
import random
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np
import xarray

from calls import PROGRAM, check, data, line, ranks_of, run, same

# rk:3bs goes on bitwise from any checkpoint, whether or not the uninterrupted run has one there
SCENE = ("-grid_n 300 -init_type sine -ts_max_time 12 -ts_type rk -ts_rk_type 3bs -out_frames 601 "
         "-out_probes 0,10.3,45 -out_checkpoint_every 60")


def beginning(path, reference, text):
    """The file holds a beginning of the reference; how many frames."""
    now = data(path)
    frames = len(now["t"])
    for name, values in now.items():
        if name in ("x", "probes/x") or name.startswith("friction/"):
            check(np.array_equal(values, reference[name]), f"{text}: {name}")
            continue
        group = name.rpartition("/")[0]
        rows = len(now[f"{group}/t" if group else "t"])
        check(len(values) >= rows and np.array_equal(values[:rows], reference[name][:rows]),
              f"{text}: {name} is no beginning of the uninterrupted run's")
    return frames


def kill_ranks(process, ranks, pids):
    """Kills the program on all ranks."""
    for pid in ranks_of(process, ranks, pids):
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    process.wait()


def at_random(case, rng, ranks, duration):
    """A kill at a random moment; returns what a reader saw before it."""
    process = subprocess.Popen(line(f"{SCENE} -out_file {case}.h5", ranks, pids=f"{case}.pids"), stderr=subprocess.DEVNULL)
    begin, end = time.monotonic(), rng.uniform(0, 1) * duration
    seen = 0
    while time.monotonic() - begin < end and process.poll() is None:
        time.sleep(0.002)
    if os.path.exists(f"{case}.h5"):
        seen = len(data(f"{case}.h5")["t"])
        with xarray.open_dataset(f"{case}.h5", engine="h5netcdf") as read:  # as its user does, while it is written
            check(read.psi.shape[1] == 300, "xarray opens it")
    kill_ranks(process, ranks, f"{case}.pids")
    return seen


# Put before the C library: counts the calls and ends the process in the one that STICKSLIP_KILL_AT names; with
# STICKSLIP_KILL_COUNT their number is written to that file at the end.
SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
static long count, last = -1;
static int due(void) {
  if (last < 0) {
    const char* at = getenv("STICKSLIP_KILL_AT");
    last = at ? atol(at) : 0;
  }
  return ++count == last;
}
static void die(void) { kill(getpid(), SIGKILL); for (;;) pause(); }
#define CALL(result, name, types, names, before) \
  result name types { static result (*next) types; if (!next) next = dlsym(RTLD_NEXT, #name); \
    if (due()) { before; die(); } return next names; }
CALL(ssize_t, pwrite64, (int fd, const void* data, size_t size, off_t at), (fd, data, size, at),
     next(fd, data, size * (count % 4) / 4, at))
CALL(ssize_t, pwrite, (int fd, const void* data, size_t size, off_t at), (fd, data, size, at),
     next(fd, data, size * (count % 4) / 4, at))
CALL(int, rename, (const char* from, const char* to), (from, to), if (count % 2) next(from, to))
CALL(int, ftruncate64, (int fd, off_t size), (fd, size), if (count % 2) next(fd, size))
CALL(int, ftruncate, (int fd, off_t size), (fd, size), if (count % 2) next(fd, size))
CALL(int, fsync, (int fd), (fd), )
CALL(int, unlink, (const char* path), (path), )
CALL(int, posix_fallocate64, (int fd, off_t at, off_t size), (fd, at, size), next(fd, at, size / 2))
CALL(int, posix_fallocate, (int fd, off_t at, off_t size), (fd, at, size), next(fd, at, size / 2))
__attribute__((destructor)) static void tell(void) {
  const char* path = getenv("STICKSLIP_KILL_COUNT");
  FILE* file = path && count > 100 ? fopen(path, "w") : NULL;
  if (file) { fprintf(file, "%ld", count); fclose(file); }
}
"""


def with_shim(words, **settings):
    """A command line whose program starts with the shim before the C library."""
    at = words.index(PROGRAM)
    preload = [f"LD_PRELOAD={os.path.abspath('kill.so')}", "ASAN_OPTIONS=detect_leaks=0:verify_asan_link_order=0"]
    return words[:at] + ["env", *preload, *(f"{name}={value}" for name, value in settings.items())] + words[at:]


def calls_of_a_run(ranks):
    """How many calls of a run change files."""
    if not os.path.exists("kill.so"):
        with open("kill.c", "w", encoding="ascii") as file:
            file.write(SHIM)
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", "kill.so", "kill.c", "-ldl"], check=True)
    subprocess.run(with_shim(line(f"{SCENE} -out_file counted.h5", ranks), STICKSLIP_KILL_COUNT="count"), check=True,
                   stderr=subprocess.DEVNULL, timeout=300)
    with open("count", encoding="ascii") as file:
        return int(file.read())


def inside_a_write(arguments, rng, ranks, calls):
    words = with_shim(line(arguments, ranks), STICKSLIP_KILL_AT=rng.randint(1, calls))
    subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=300)


def one_case(case, seed, ranks, rng, reference, duration, calls, tally):
    """One kill and what follows it; what does not hold is an AssertionError."""
    text = f"case {case} of seed {seed} on {ranks} ranks"
    scene = SCENE + (" -out_writers root" if case % 8 == 7 else "")  # else each rank writes its nodes
    seen = 0
    if case % 2 == 1:
        tally["inside"] += 1
        inside_a_write(f"{scene} -out_file {case}.h5", rng, ranks, calls)
    else:
        seen = at_random(case, rng, ranks, duration)
    path = f"{case}.h5"
    checkpoints = sorted(glob.glob(f"{case}.chk-*.h5"))
    if not os.path.exists(path):
        tally["bare"] += 1
        check(not checkpoints, f"{text}: checkpoints without a file")
        return
    check(len(checkpoints) <= 3, f"{text}: {len(checkpoints)} checkpoints, of which two are kept and one may be new")
    tally["shown"].append(beginning(path, reference, text))
    check(tally["shown"][-1] >= seen, f"{text}: {tally['shown'][-1]} frames, a reader saw {seen}")
    if checkpoints and rng.random() < 0.3:  # the restart is killed as well
        tally["twice"] += 1
        inside_a_write(f"-restart {checkpoints[-1]}", rng, ranks, calls)
        beginning(path, reference, text + ", its restart")
        checkpoints = sorted(glob.glob(f"{case}.chk-*.h5"))
    if checkpoints:
        tally["continued"] += 1
        run(f"-restart {checkpoints[-1]}", ranks)
        same(reference, data(path), text)


def all_cases(cases, seed):
    """The number of failures. In the folder it stands in."""
    rng = random.Random(seed)
    tally = {"inside": 0, "bare": 0, "continued": 0, "twice": 0, "shown": []}
    references, durations, calls, failures = {}, {}, {}, 0
    for ranks in (1, 2):
        begin = time.monotonic()
        run(f"{SCENE} -out_file reference{ranks}.h5", ranks)
        durations[ranks] = time.monotonic() - begin
        calls[ranks] = calls_of_a_run(ranks)
        references[ranks] = data(f"reference{ranks}.h5")
    for case in range(cases):
        ranks = 1 if case % 4 < 3 else 2
        try:
            one_case(case, seed, ranks, rng, references[ranks], durations[ranks], calls[ranks], tally)
        except AssertionError as trouble:
            failures += 1
            print("FAILED", trouble, flush=True)
        for old in glob.glob(f"{case}.*") + glob.glob(f".{case}.*"):
            os.remove(old)
    print(f"seed {seed}: {cases} kills ({tally['inside']} inside a write), {tally['bare']} before the first frame, "
          f"{tally['continued']} continued from a checkpoint ({tally['twice']} restarts killed, too); frames at the "
          f"kills {sorted(tally['shown'])}; {failures} failures")
    return failures


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=100)
    given = parser.parse_args(arguments)
    before = os.getcwd()
    with tempfile.TemporaryDirectory(prefix="stickslip-") as folder:
        os.chdir(folder)
        try:
            return 1 if all_cases(given.cases, given.seed) else 0
        finally:
            os.chdir(before)


if __name__ == "__main__":
    sys.exit(main())
