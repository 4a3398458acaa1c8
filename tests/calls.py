"""Calling the program as a user does, and reading what it leaves: shared by all tests written in Python.

STICKSLIP: the program; STICKSLIP_SOURCE: the source tree. A failed expectation is an AssertionError of the test.
"""
import atexit
import functools
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
import tempfile
import time
import traceback

import h5py
import numpy as np

from served import Server

SOURCE = os.environ.get("STICKSLIP_SOURCE", os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.path.abspath(os.environ.get("STICKSLIP", os.path.join(SOURCE, "build", "stickslip")))
SANITIZED = "build-sanitize" in PROGRAM  # memory is not what it is, and who links the library must know


def scene_file(name):
    """The path of a scene of runs/ as a word of a command line, whatever stands in it."""
    return shlex.quote(os.path.join(SOURCE, "runs", name + ".yaml"))


def words(arguments):
    return shlex.split(arguments) if isinstance(arguments, str) else [str(word) for word in arguments]


def line(arguments, ranks=1, command="run", pids=None):
    """The words of a command line. `pids`: a file to which each rank of several adds its process number."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    if ranks > 1 and pids:
        launcher += ["sh", "-c", 'echo $$ >> "$0"; exec "$@"', os.path.abspath(pids)]
    return launcher + [PROGRAM, command, "-progress", "off", *words(arguments)]


def ranks_of(process, ranks, pids):
    """The process numbers of a program's ranks, which line() was asked to write to `pids`; of those that there are when
    all have begun or the program has ended."""
    if ranks == 1:
        return [process.pid]
    found = []
    while len(found) < ranks and (not found or process.poll() is None):
        if os.path.exists(pids):
            with open(pids, encoding="ascii") as file:
                found = [int(number) for number in file.read().split()]
        elif process.poll() is not None:
            break
        time.sleep(0.002)
    return found


def gone(pid):
    """Whether a process has ended; one that nobody has asked for yet has no program any more."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return os.path.ismount("/proc") and not os.path.exists(f"/proc/{pid}/exe")


def started(arguments, ranks, path, **settings):
    """A run under way, whose file is there, and the process numbers of its ranks."""
    if os.path.exists("pids"):
        os.remove("pids")
    process = subprocess.Popen(line(arguments, ranks, pids="pids"), text=True, **settings)
    while not os.path.exists(path) and process.poll() is None:
        time.sleep(0.002)
    return process, ranks_of(process, ranks, "pids")


def surroundings():
    """The environment as far as it reaches a program: each test has a folder of its own for Open MPI."""
    own = ("PYTEST_CURRENT_TEST", "OMPI_MCA_orte_tmpdir_base")
    return {name: text for name, text in os.environ.items() if name not in own}


@functools.lru_cache(None)
def waiting():
    """The program that forks for the command lines of these tests, and the environment in which it was started."""
    server = Server(PROGRAM, 0, 600)
    atexit.register(server.close)
    return server, surroundings()


def ran(given, folder=None, **settings):
    """The completed process of a command line, words without blanks between them. A line that begins with the program, in
    the environment of all tests, is forked from a program that has started already (served.py); with STICKSLIP_START set
    each is started anew."""
    given = [str(word) for word in given]
    if (given[0] != PROGRAM or settings or SANITIZED or "STICKSLIP_START" in os.environ or waiting()[1] != surroundings()):
        return subprocess.run(given, capture_output=True, text=True, errors="replace", timeout=600, cwd=folder, **settings)
    with tempfile.TemporaryDirectory() as own:
        said = [os.path.join(own, name) for name in ("out", "err")]
        code, _ = waiting()[0].run(given[1:], os.path.abspath(folder or "."), *said)
        texts = []
        for path in said:
            with open(path, encoding="utf-8", errors="replace") as file:
                texts.append(file.read())
    return subprocess.CompletedProcess(given, code, *texts)


def tool(name, *given):
    """The completed process of a script of postprocess/, forked from this process, in which what they all import is loaded."""
    import matplotlib.pyplot  # noqa: F401
    path = os.path.join(SOURCE, "postprocess", name)
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        child = os.fork()
        if child == 0:
            code = 1
            try:
                os.dup2(out.fileno(), 1), os.dup2(err.fileno(), 2)
                sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
                sys.argv, sys.path[:0] = [path, *map(str, given)], [os.path.dirname(path)]
                runpy.run_path(path, run_name="__main__")
                code = 0
            except SystemExit as end:
                code = end.code if isinstance(end.code, int) else int(end.code is not None)
                if isinstance(end.code, str):
                    print(end.code, file=sys.stderr)
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush(), sys.stderr.flush()
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0), err.seek(0)
        return subprocess.CompletedProcess([path, *given], code, out.read(), err.read())


def call(arguments, ranks=1, command="run", **settings):
    """Runs a command, whatever comes of it."""
    return ran(line(arguments, ranks, command), **settings)


def run(arguments, ranks=1, code=0, command="run"):
    """Runs a command, which must end with this code (None: with 0 or 1); returns its summary (None where there is none) and what stood on
    standard error."""
    summary = "summary.json"
    if os.path.exists(summary):
        os.remove(summary)
    done = call([*words(arguments), "-summary", summary], ranks, command)
    assert done.returncode in ((0, 1) if code is None else (code,)), \
        f"exit {done.returncode} instead of {code}: {command} {arguments}\n{done.stderr[-2000:]}"
    if not os.path.exists(summary):
        return None, done.stderr
    with open(summary, encoding="utf-8") as file:
        return json.load(file), done.stderr


def errors(stderr):
    """The program's own lines of error; mpirun adds others."""
    return [text for text in stderr.splitlines() if text.startswith("stickslip: error: ")]


def refused(arguments, code, *parts, ranks=1, command="run"):
    """The command ends with this code and one line of error that holds the parts."""
    done = call(arguments, ranks, command)
    said = errors(done.stderr)
    assert done.returncode == code and len(said) == 1 and all(part in said[0] for part in parts), \
        f"exit {done.returncode} instead of {code} or not one line with {parts}: {arguments}\n{done.stderr[-1000:]}"


def data(path):
    """Every dataset of a file."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, o: found.update({name: o[()]}) if isinstance(o, h5py.Dataset) else None)
    return found


def same(one, other, text):
    """Two results of data() are equal to the last bit."""
    assert set(one) == set(other), f"{text}: datasets {sorted(set(one) ^ set(other))}"
    differing = [name for name in one  # texts are objects
                 if not np.array_equal(one[name], other.get(name), equal_nan=np.asarray(one[name]).dtype.kind in "fc")]
    assert not differing, f"{text}: {differing} differ"


def methods():
    """(options, name) of every method of docs/methods.md with every way to split."""
    kinds = {"rk": "ts_rk_type", "ssp": "ts_ssp_type", "rosw": "ts_rosw_type", "arkimex": "ts_arkimex_type",
             "bdf": "ts_bdf_order"}
    with open(os.path.join(SOURCE, "docs", "methods.md"), encoding="utf-8") as page:
        rows = re.findall(r"^\| ([\w:]+) \| \d \| ([\w, ]+) \|", page.read(), re.MULTILINE)
    for name, splits in rows:
        kind, _, subtype = name.partition(":")
        for split in splits.split(", "):
            yield (f"-ts_type {kind}" + (f" -{kinds[kind]} {subtype}" if subtype else "") +
                   (f" -imex_implicit {split}" if kind == "arkimex" else "")), f"{name} {split}"


def check(truth, text):
    """An expectation with its words."""
    assert truth, text


def checkpoint_block(content):
    """The first 512 bytes of a checkpoint that goes on with this content: FNV-1a of 64 bits on eight lanes of words."""
    basis, prime, most = 1469598103934665603, 1099511628211, 0xFFFFFFFFFFFFFFFF
    whole = len(content) // 64 * 64
    lanes = np.full(8, basis, dtype=np.uint64)
    for words_of_lanes in np.frombuffer(content[:whole], "<u8").reshape(-1, 8):
        lanes = (lanes ^ words_of_lanes) * np.uint64(prime)
    lanes = [int(lane) for lane in lanes]
    for byte in content[whole:]:
        lanes[0] = (lanes[0] ^ byte) * prime & most
    value = basis
    for lane in lanes:
        value = (value ^ lane) * prime & most
    return f"stickslip checkpoint\nfnv1a64x8 {value:016x}\nbytes {len(content)}\n".encode().ljust(512, b"\0")
