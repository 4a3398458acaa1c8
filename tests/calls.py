"""What the tests of the command line share: calling the program, checking, reading its files."""
import contextlib
import json
import os
import shlex
import subprocess
import sys
import tempfile

import h5py
import numpy as np

PROGRAM = os.path.abspath(os.environ["STICKSLIP"])
SOURCE = os.environ["STICKSLIP_SOURCE"]
FAILURES = []


def check(truth, text):
    if not truth:
        FAILURES.append(text)
        print("FAILED:", text, flush=True)


def finish():
    """The end of a test script: its exit code."""
    print("failures:", len(FAILURES))
    sys.exit(1 if FAILURES else 0)


@contextlib.contextmanager
def scratch():
    """A folder of one's own to work in, gone afterwards."""
    before = os.getcwd()
    with tempfile.TemporaryDirectory(prefix="stickslip-") as folder:
        os.chdir(folder)
        try:
            yield folder
        finally:
            os.chdir(before)


def scene_file(name):
    """The path of a scene of runs/ as a word of a command line, whatever stands in it."""
    return shlex.quote(os.path.join(SOURCE, "runs", name + ".yaml"))


def words(arguments):
    return shlex.split(arguments) if isinstance(arguments, str) else [str(word) for word in arguments]


def line(arguments, ranks=1, command="run"):
    """The words of a command line."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return launcher + [PROGRAM, command, "-progress", "off", *words(arguments)]


def call(arguments, ranks=1, command="run", **settings):
    return subprocess.run(line(arguments, ranks, command), capture_output=True, text=True, timeout=300, **settings)


def run(arguments, ranks=1, code=0, command="run"):
    """Runs a command; returns its summary (None where there is none) and what stood on standard error."""
    summary = "summary.json"
    if os.path.exists(summary):
        os.remove(summary)
    done = call([*words(arguments), "-summary", summary], ranks, command)
    check(done.returncode == code,
          f"exit {done.returncode} instead of {code}: {command} {arguments}\n{done.stderr[-2000:]}")
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
    check(done.returncode == code and len(said) == 1 and all(part in said[0] for part in parts),
          f"exit {done.returncode} instead of {code} or not one line with {parts}: {arguments}\n{done.stderr[-1000:]}")


def data(path):
    """Every dataset of a file."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, o: found.update({name: o[()]}) if isinstance(o, h5py.Dataset) else None)
    return found


def same(one, other, text):
    """Two results of data() are equal to the last bit."""
    check(set(one) == set(other), f"{text}: datasets {sorted(set(one) ^ set(other))}")
    differing = [name for name in one if not np.array_equal(one[name], other.get(name), equal_nan=True)]
    check(not differing, f"{text}: {differing} differ")


def methods():
    """(options, name) of every method of docs/methods.md with every way to split."""
    import re
    kinds = {"rk": "ts_rk_type", "ssp": "ts_ssp_type", "rosw": "ts_rosw_type", "arkimex": "ts_arkimex_type",
             "bdf": "ts_bdf_order"}
    with open(os.path.join(SOURCE, "docs", "methods.md"), encoding="utf-8") as page:
        rows = re.findall(r"^\| ([\w:]+) \| \d \| ([\w, ]+) \|", page.read(), re.MULTILINE)
    for name, splits in rows:
        kind, _, subtype = name.partition(":")
        for split in splits.split(", "):
            yield (f"-ts_type {kind}" + (f" -{kinds[kind]} {subtype}" if subtype else "") +
                   (f" -imex_implicit {split}" if kind == "arkimex" else "")), f"{name} {split}"
