"""What the cases of kills.py share: a library put before the C library that ends a program inside a write, kills of
ranks, scenes without which nothing could be compared (they are computed once)."""
import functools
import os
import signal
import subprocess
import time

from calls import PROGRAM, data, gone, line, ranks_of, run

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
  FILE* file = path && count > 10 ? fopen(path, "w") : NULL;
  if (file) { fprintf(file, "%ld", count); fclose(file); }
}
"""


def with_shim(words, **settings):
    """A command line whose program starts with the shim before the C library."""
    at = words.index(PROGRAM)
    preload = [f"LD_PRELOAD={os.path.abspath('kill.so')}", "ASAN_OPTIONS=detect_leaks=0:verify_asan_link_order=0"]
    return words[:at] + ["env", *preload, *(f"{name}={value}" for name, value in settings.items())] + words[at:]


@functools.lru_cache(None)
def calls_of(arguments, ranks, command):
    """How many of its calls change files (of the rank that tells last)."""
    if not os.path.exists("kill.so"):
        with open("kill.c", "w", encoding="ascii") as file:
            file.write(SHIM)
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", "kill.so", "kill.c", "-ldl"], check=True)
    subprocess.run(with_shim(line(f"{arguments} -out_file counted.h5", ranks, command), STICKSLIP_KILL_COUNT="count"),
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=600)
    with open("count", encoding="ascii") as file:
        return int(file.read())


@functools.lru_cache(None)
def reference(arguments, ranks, command="run"):
    """What a command that nobody killed has written, and the seconds that it took."""
    begin = time.monotonic()
    name = f"reference-{command}-{ranks}-{abs(hash(arguments))}.h5"
    run(f"{arguments} -out_file {name}", ranks, command=command)
    return data(name), time.monotonic() - begin


def kill(process, ranks, pids, number=signal.SIGKILL, one=None):
    """Sends a signal to all ranks, or to one of them, and waits for the end; the exit code."""
    numbers = ranks_of(process, ranks, pids)
    for pid in [numbers[one % len(numbers)]] if one is not None and numbers else numbers:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass
    try:
        return process.wait(timeout=60)
    except subprocess.TimeoutExpired:  # mpirun may miss that one of its ranks has ended when all do at once
        if not all(gone(pid) for pid in numbers):
            raise
        process.kill()
        return process.wait()


def begun(arguments, ranks, name, command="run", seconds=0.0, **settings):
    """A command under way for so long."""
    process = subprocess.Popen(line(f"{arguments} -out_file {name}.h5", ranks, command, pids=f"{name}.pids"),
                               stdout=subprocess.DEVNULL, **{"stderr": subprocess.DEVNULL, **settings})
    begin = time.monotonic()
    while time.monotonic() - begin < seconds and process.poll() is None:
        time.sleep(0.002)
    return process


def ended_inside_a_write(words, at):
    subprocess.run(with_shim(words, STICKSLIP_KILL_AT=at), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                   timeout=600, check=False)
