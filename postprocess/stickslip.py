"""Results of stickslip in Python: run a command, open any file that it wrote.

    import stickslip

    summary = stickslip.run("run", "runs/ring.yaml", ts_max_time=10, out_file="ring.h5")
    summary["regime"], summary["wave_speed"]
    ring = stickslip.open("ring.h5")               # an xarray.Dataset with units and labels
    ring.psi.sel(t=5, method="nearest").plot()
    stickslip.open("ring.h5", "series").psi_max    # groups: series, probes, events, ...
    stickslip.options(ring)["model_gamma"]         # what made it, defaults included
    stickslip.run("cycle", {"model": {"form": "chain"}}, friction_law="table", friction_table=(v, mu))

What Python's users have in hand is taken as it is: numbers and truth values of numpy, paths, a scene as a dict, measured
columns (arrays, lists, Series, DataFrames) as a tuple of columns or a table. The program is that of STICKSLIP in the
environment, else `stickslip` of the PATH, else build/stickslip of this source tree. Files are read with h5py by the
scripts beside this one: `reading`, `text`, `scene_title`.
"""
import contextlib
import io
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile

try:
    import h5py
    import numpy as np
except ImportError as error:
    LACKS = f"{sys.executable} has no {error.name}; take that of the system, /usr/bin/python3 (docs/install.md names its packages)"
    if os.path.dirname(os.path.abspath(sys.argv[0])) == os.path.dirname(os.path.abspath(__file__)):
        sys.exit(f"{os.path.basename(sys.argv[0])}: error: {LACKS}")  # a script beside this one
    raise ImportError(LACKS) from None

SYMBOL = {"psi": "ψ", "eta": "η", "tau": "τ", "theta": "θ", "chi": "χ"}
GREEK = {"model_gamma": "γ", "model_delta": "δ", "model_zeta": "ζ", "model_f0": "f₀", "model_k0": "k₀",
         "model_k1": "k₁", "model_c": "c", "model_m": "m", "model_v": "v", "model_nu": "ν"}


class Unusable(Exception):
    """A file that cannot be read; the text is one line for the user, to stand after the file's name."""


class Failed(Exception):
    """A command that did not end with code 0: what the program said of it in one line, and `code`."""

    def __init__(self, message, code):
        super().__init__(message)
        self.code = code


def program():
    """The path of the program."""
    beside = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "build", "stickslip")
    return os.environ.get("STICKSLIP") or shutil.which("stickslip") or os.path.normpath(beside)


def scene(settings, before=""):
    """Options by name from a dict that is a scene as YAML has it: {"model": {"form": "chain", "v": 0.5}, "grid_n": 1}."""
    flat = {}
    for name, value in settings.items():
        flat.update(scene(value, f"{before}{name}_") if isinstance(value, dict) else {before + name: value})
    return flat


def word_of(value, between=","):
    """A value as it is typed: numbers of Python, numpy and xarray alike; a list or array joined by commas, pairs in it
    (times and values, places and values) by colons."""
    if hasattr(value, "__array__"):
        value = np.asarray(value).tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple, range)):
        return between.join(word_of(one, ":") for one in value)
    return str(value)


READ_FROM_FILES = ("fit_data", "init_file")  # options whose value is a file's name in any case
LONGEST_WORD = 2000                          # a longer list is handed over in a file, too


def columns_of(value):
    """The table behind columns (a tuple of at least two of one length) or rows (a DataFrame, an array of two dimensions), as an
    array of rows; None where it is neither."""
    if isinstance(value, tuple) and len(value) > 1 and all(np.ndim(column) == 1 for column in value):
        if len({len(column) for column in value}) > 1:
            raise Unusable(f"has columns of {', '.join(str(len(column)) for column in value)} rows")
        return np.column_stack([np.asarray(column, float) for column in value])
    if np.ndim(value) == 2 and hasattr(value, "__array__"):
        return np.asarray(value, float)
    return None


def words_of(settings, before=""):
    """Options of a command line: ts_max_time=10 is -ts_max_time 10, None is left out. Columns are typed as pairs where they are
    two and short, else written to a file, whose name begins with `before`."""
    words = []
    for name, value in settings.items():
        if value is None:
            continue
        try:
            table = columns_of(value)
        except (Unusable, ValueError) as error:
            raise Unusable(f"{name}: {error}") from error
        word = word_of(value if table is None else table)
        if table is not None and (name in READ_FROM_FILES or table.shape[1] != 2 or len(word) > LONGEST_WORD):
            word = f"{before}{name}.txt"
            np.savetxt(word, table, "%.17g")
        words += ["-" + name, word]
    return words


def run(command, *words, ranks=1, timeout=None, **settings):
    """Runs a command and returns its summary as a dict: a scene (a file, or a dict) and further words as they are typed,
    options by name; of two values of one option the later holds. Columns that need a file are kept beside out_file under
    its name, and without one for as long as the command runs. Raises Failed where the exit code is not 0, or the command
    takes more seconds than `timeout`."""
    settings = {name: value for part in [*(scene(word) for word in words if isinstance(word, dict)), settings]
                for name, value in part.items()}
    with tempfile.TemporaryDirectory() as folder:
        summary = os.path.join(folder, "summary.json")
        line = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        line += [program(), command, *(word_of(word) for word in words if not isinstance(word, dict))]
        out = settings.get("out_file")
        before = os.path.splitext(out)[0] + "-" if out else os.path.join(folder, "")
        line += [*words_of(settings, before), "-progress", "off", "-summary", summary]
        try:
            done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=timeout)
        except subprocess.TimeoutExpired:
            raise Failed(f"took longer than {timeout:g} s", None) from None
        if done.returncode != 0:
            said = re.search(r"^stickslip: error: (.*)", done.stderr, re.MULTILINE)
            raise Failed(said[1] if said else done.stderr.strip(), done.returncode)
        with io.open(summary, encoding="utf-8") as file:  # `open` is that of results here
            return json.load(file)


def open(path, group=None):  # as xarray.open_dataset is meant: stickslip.open
    """The file, or one group of it, as an xarray.Dataset: coordinates x, t, mode, ...; `units` and `long_name` of each
    variable are used by its plots; the attributes of the file say what made it."""
    import xarray
    with reading(path) as file:
        if group is not None and group not in file:
            groups = [name for name, item in file.items() if isinstance(item, h5py.Group)]
            raise Unusable(f"has no group '{group}' (it has {', '.join(groups) or 'none'})")
        attributes = dict(file.attrs)
    dataset = xarray.load_dataset(path, group=group, engine="h5netcdf")
    dataset.attrs = {**attributes, **dataset.attrs}
    return dataset


def options(file):
    """The options behind a Dataset or an open file, name without dash to text."""
    return json.loads(text(file.attrs["options"]))


# ---- for the scripts beside this one --------------------------------------------------------------------------------

@contextlib.contextmanager
def reading(path):
    """The open h5py.File of a result; raises Unusable."""
    if not os.path.exists(path):
        raise Unusable("does not exist")
    if not os.path.isfile(path):
        raise Unusable("is not a file")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise Unusable(f"is not a readable HDF5 file ({str(error).splitlines()[0]})") from error
    with file:
        if text(file.attrs.get("program", "")) != "stickslip":
            raise Unusable("was not written by stickslip")
        yield file


class Plate:
    """How far the driving plate of a run has gone, under a load v(t) or at model_v, from its open file. Nothing before t = 0."""

    def __init__(self, file, end):
        every = options(file)
        self.amplitude = float(every.get("load_sine_amplitude") or 0)
        self.period = float(every.get("load_sine_period") or 0)
        if every.get("load_v") and "load" not in file:
            raise Unusable("does not hold its load: it was written by an earlier revision")
        table = [file["load"][name][:] for name in ("t", "before", "behind")] if "load" in file else [np.empty(0)] * 3
        corners, before, behind = table[0], *(v - self.sine(table[0]) for v in table[1:])
        # w, v without the sine, at the ends of straight pieces from 0 to the end
        inside = (corners > 0) & (corners < end)
        edges = np.r_[0, corners[inside], end]
        w = self.straight(corners, before, behind, float(every["model_v"]))
        pieces = [(a, b, w((a + b) / 2, a), w((a + b) / 2, b)) for a, b in zip(edges, edges[1:])]
        self.edges, self.pieces = edges, pieces
        self.shifts = np.cumsum([0] + [(b - a) * (v + u) / 2 for a, b, v, u in pieces])
        # the way it goes, forth and back: in stretches so short that v turns at most once in one
        turns = 256 * (1 + end / self.period) if self.period > 0 else 1
        self.times = np.unique(np.concatenate([np.linspace(a, b, 2 + int(min(1e6, turns) * (b - a) / end + 64))
                                               for a, b in zip(edges, edges[1:])]))
        self.ways = np.r_[0, np.cumsum(np.abs(np.diff(self.shift(self.times))))]

    def sine(self, t):
        return self.amplitude * np.sin(2 * np.pi * t / self.period) if self.period > 0 else 0 * t

    @staticmethod
    def straight(corners, before, behind, v):
        """w(within, t): the value at t of the piece in which the time `within` lies."""
        def value(within, t):
            i = np.searchsorted(corners, within)
            if len(corners) == 0 or i == 0 or i == len(corners):
                return v if len(corners) == 0 else before[0] if i == 0 else behind[-1]
            part = (t - corners[i - 1]) / (corners[i] - corners[i - 1])
            return behind[i - 1] + part * (before[i] - behind[i - 1])
        return value

    def shift(self, t):
        """The integral of v(t) from 0, at each of some times."""
        t = np.clip(np.asarray(t, float), 0, self.edges[-1])
        i = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.pieces) - 1)
        a, b, v, u = np.array(self.pieces).T[:, i]
        since = t - a
        straight = self.shifts[i] + since * (v + (u - v) * since / (2 * (b - a)))
        if self.period <= 0:
            return straight
        return straight + self.amplitude * self.period / np.pi * np.sin(np.pi * t / self.period)**2

    def way(self, t):
        """The integral of |v(t)|."""
        i = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 1)
        return self.ways[i] + np.abs(self.shift(t) - self.shift(self.times[i]))

    def time_of(self, way):
        """When it has gone so far; infinite where it does not."""
        return float(np.interp(way, self.ways, self.times)) if way <= self.ways[-1] else np.inf


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def shown_name(option):
    """An option as it is called in a picture: its symbol, or its name with blanks."""
    return GREEK.get(option, option.replace("_", " "))


def labels(known):
    """What the scene calls its options, {name: words}, from these."""
    return {name.strip(): words.strip() for name, _, words in (label.partition(":") for label in known.get("labels", "").split(","))
            if words.strip()}


def shown_words(words):
    """A message of the program with its options called as in pictures."""
    return re.sub(r"\b[a-z]+_[a-z0-9_]+\b", lambda name: shown_name(name[0]), words)


def scene_title(file, varied=()):
    """Says which scene this is, from the options in the file, those in `varied` left out; with the scene's units and labels."""
    every = options(file)
    units, labelled = json.loads(text(file.attrs.get("option_units", "{}"))), labels(every)
    known = {name: value for name, value in every.items() if name not in varied}
    form = known.get("model_form", "")
    names = {"continuum": ["gamma", "delta", "c", "nu", "v"], "chain": ["m", "k0", "k1", "f0", "zeta", "nu", "v"]}.get(form, [])
    names = [name for name in names if acts(name, known)]
    parts = [form] if form else []
    law, state = known.get("friction_law", ""), known.get("state_law", "")
    parts += [law] if law else []
    parts += [f"state law {state}"] if state not in ("", "none") else []
    for name in names:
        value, unit = known.get("model_" + name, ""), units.get("model_" + name, "")
        called = " ".join(filter(None, (labelled.get("model_" + name), GREEK["model_" + name])))
        if value == "":
            continue
        if known.get(f"model_{name}_profile", "none") not in ("", "none"):
            parts.append(f"{called} along x")
            continue
        if name == "zeta" and value == "paper":
            value = "√(0.1 m k₁)"
            if not {"model_m", "model_k1"} & set(varied):
                value += f" = {math.sqrt(0.1 * float(every['model_m']) * float(every['model_k1'])):.4g}"
        parts.append(f"{called} = {value}{' ' + unit if unit and value[0] != '√' else ''}")
        if name == "delta" and float(value) != 0:
            parts[-1] += f" ({known.get('model_delta_sign', 'derived')})"
    if "model_delta" in varied and form == "continuum":
        parts.append(f"sign of δ {every.get('model_delta_sign', 'derived')}")
    if known.get("friction_spread", "0") not in ("", "0"):
        parts.append(f"spread {known['friction_spread']}")
    return ", ".join(part.replace(" ", "\u00a0") for part in parts)


def acts(name, known):
    """Whether an option of the model has a part in a scene: one node has no neighbours, and a damping of 0 is none."""
    value = known.get("model_" + name, "")
    if name in ("c", "k1", "nu") and known.get("grid_n") == "1":
        return False
    return name not in ("delta", "zeta", "nu") or known.get(f"model_{name}_profile", "none") not in ("", "none") or \
        value == "paper" or float(value or 0) != 0


def differing(files):
    """The options in which open files differ, output aside."""
    every = [options(file) for file in files]
    names = [name for name in every[0] if len({o.get(name, "") for o in every}) > 1 and
             not name.startswith(("out_", "summary", "progress", "boundary_"))]
    follow = ("bc_left_value", "bc_right_value") if "model_v" in names else ()  # by default
    return [name for name in names if not (name in follow and all(o[name] == o["model_v"] for o in every))]


def told_apart(files):
    """A name for each of several open files: the options in which they differ, else the file's name."""
    every, names = [options(file) for file in files], differing(files)
    if not names or len(names) > 3:
        return [os.path.splitext(os.path.basename(file.filename))[0] for file in files]
    return [", ".join(f"{shown_name(name)} = {o[name]}" if name in GREEK else o.get(name, "") if
                      name in ("friction_law", "state_law") else f"{shown_name(name)} {o.get(name, '')}"
                      for name in names) for o in every]
