"""Random use of the program, good and bad, from a seed: options, values, scenes with damaged bytes, checkpoints and
results with damaged bytes, ranks.

    STICKSLIP=build/stickslip python3 tests/fuzz.py --seed 1 --cases 1000     all cases of a seed
    STICKSLIP=build/stickslip python3 tests/fuzz.py --seed 1 --only 17        one of them, with what it printed

There is no table of right answers. What must hold of every case, whatever it asks for:
  - it ends, with exit code 0, 1 or 2, and never by a signal;
  - standard error has warnings and, unless the code is 0, one error, each one line; no internal error, no dump;
  - with code 2 no file is made or changed; a file that is not the program's never is;
  - with code 0 or 1 the summary is there, parses, tells the status, and shows every option as it was given;
  - HDF5 files that are left can be opened;
  - options in a scene do what they do on the command line.
The options and what they take come from the program's own -help.
"""
import argparse
import concurrent.futures
import functools
import json
import os
import random
import re
import shlex
import subprocess
import sys
import tempfile

from calls import checkpoint_block

PROGRAM = os.path.abspath(os.environ.get("STICKSLIP", "build/stickslip"))
NOTES = "mine, not the program's\n"

# Values that keep a valid case short. Everything else is drawn from what -help says.
SMALL = {
    "grid_n": lambda r: str(r.choice([1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 31, 64, 100])),
    "grid_length": lambda r: r.choice(["60", "1", "7.5", "1e3", "31", "63"]),
    "ts_max_time": lambda r: r.choice(["0", "0.05", "0.3", "1e-9", "1"]),
    "ts_max_steps": lambda r: str(r.choice([0, 1, 5, 50])),
    "out_frames": lambda r: str(r.choice([2, 3, 10])),
    "out_every": lambda r: r.choice(["0.1", "0.05", "100"]),
    "out_times": lambda r: r.choice(["0,0.1,0.2", "0.05", "0.1,0.1", "0.2,0.1", "1e9"]),
    "out_probes": lambda r: r.choice(["0", "0,0.5,60", "3.3,1.1,3.3", "1e9"]),
    "out_checkpoint_every": lambda r: r.choice(["1", "10", "30s", "10m"]),
    "wave_length": lambda r: r.choice(["40", "100", "1", "1e4"]),
    "wave_speed": lambda r: r.choice(["2", "-3", "1.01", "0.5", "1"]),
    "wave_pulses": lambda r: r.choice(["1", "2", "3", "50"]),
    "spectrum_count": lambda r: r.choice(["1", "4", "12", "1000"]),
    "boundary_points": lambda r: r.choice(["2", "5"]),
    "boundary_verify": lambda r: "0",
    "wave_steps": lambda r: r.choice(["1", "3"]),
    "accuracy": lambda r: r.choice(["1e-2", "1e-3"]),
    "chart_methods": lambda r: r.choice(["rk:3bs", "rk", "arkimex:3:both", "rk:4,cn", "rosw:ra34pw2", "rk:5dp:wave"]),
    "chart_tolerances": lambda r: r.choice(["1e-2", "1e-3,1e-1", "1"]),
    "chart_steps": lambda r: r.choice(["0.01", "0.1,0.05", "1e3"]),
    "chart_orders": lambda r: r.choice(["2", "2,4", "8", "3"]),
    "chart_grids": lambda r: r.choice(["16", "9,17,12", "4", "32"]),
    "chart_repeats": lambda r: r.choice(["1", "2"]),
    "chart_row_seconds": lambda r: r.choice(["0.01", "0.1"]),
    "chart_reference_seconds": lambda r: "0.1",
}
TEXTS = {"out_file": ["new.h5", "notes.txt", "no/such/folder/a.h5", ".", "sub/new.h5", "ring space.h5", "é.h5"],
         "summary": ["new.json", "notes.txt", "no/such/folder/a.json", "."],
         "restart": ["notes.txt", "missing.h5", "."], "init_file": ["notes.txt", "missing.h5", "."],
         "chart_reference": ["auto", "missing.h5"]}
PARAMETERS = ["model_v", "model_gamma", "friction_law", "no_such", "model_delta"]
BAD = ["nan", "NaN", "inf", "-inf", "1e999", "", "abc", "1,2", "--", "-", "0x1", "1e", "+", ".", "9" * 400, " 1", "1 ",
       "1.5", "-1", "0", "10000000000", "4294967297", "18446744073709551617", "2147483648", "1e-999", "é", "\x01",
       "a\nb", "%s%n", "$HOME", "true", "none", "scene.yaml", "1;2", "[1]", "{}", "'", '"', "#", "~", "null"]
LIBRARY = [["-ts_type", "rk"], ["-ts_type", "arkimex"], ["-ts_type", "bdf"], ["-ts_type", "rosw"], ["-ts_type", "cn"],
           ["-ts_type", "eimex"], ["-ts_type", "ssp"], ["-ts_type", "euler"], ["-ts_type", "beuler"],
           ["-ts_rk_type", "4"], ["-ts_rk_type", "8vr"], ["-ts_arkimex_type", "4"], ["-ts_arkimex_type", "ars443"],
           ["-ts_adapt_type", "none"], ["-ts_adapt_type", "dsp"], ["-ts_rtol", "1e-6"], ["-ts_atol", "0"],
           ["-ts_dt", "1e-3"], ["-ts_dt", "1e6"], ["-ts_monitor"], ["-ts_view"], ["-snes_type", "ksponly"],
           ["-snes_max_it", "1"], ["-pc_type", "none"], ["-ksp_type", "gmres"], ["-pc_type", "jacobi"],
           ["-ts_max_reject", "0"], ["-ts_max_snes_failures", "-1"], ["-eps_ncv", "30"], ["-eps_tol", "1e-6"],
           ["-log_view", ":log.txt"], ["-snes_monitor"], ["-ts_adapt_monitor"], ["-ts_bdf_order", "3"],
           ["-ts_theta_theta", "0.7"], ["-options_left"], ["-malloc_debug"], ["-fp_trap"], ["-ts_rtol", "tight"],
           ["-ts_typ", "rk"], ["-ts_type", "rkk"], ["-ksp_no_such", "3"], ["-ts_view", "asci"], ["-mat_type", "x"],
           ["-snes_test_jacobian"], ["-ts_error_if_step_fails", "0"], ["-ts_adapt_dt_max", "1e-3"]]


class Option:
    def __init__(self, name, default, takes):
        self.name, self.default, self.takes = name, default, takes

    def good(self, r):
        """A value that the option takes by itself; whether the scene as a whole takes it is another matter."""
        if self.name in SMALL:
            return SMALL[self.name](r)
        if self.name in TEXTS:
            return r.choice(TEXTS[self.name])
        if self.name.startswith("boundary_parameter") or self.name == "wave_continue":
            return r.choice(PARAMETERS)
        if self.takes.startswith("one of "):
            return r.choice(self.takes[7:].split(", "))
        if self.takes == "true or false":
            return r.choice(["true", "false", "yes", "off", "1"])
        if self.takes.startswith("an integer"):
            low = int(re.search(r"from (\d+)", self.takes).group(1))
            return str(low + r.choice([0, 1, 2, 5, 1000]))
        if "number" in self.takes:
            if ", or " in self.takes and r.random() < 0.3:
                return self.takes.split(", or ")[1]
            value = r.choice([0.0, 1.0, 0.5, 2.0, r.uniform(0, 3), 10 ** r.uniform(-3, 3), 10 ** r.uniform(-12, 12)])
            if r.random() < 0.03:
                value = r.choice([1e300, 1e-300, 5e-324, 1.7976931348623157e308])
            if ">" not in self.takes and r.random() < 0.5:
                value = -value
            return repr(value)
        return r.choice(["1", "2,4", "rk:5dp"])


def options_of(command):
    text = subprocess.run([PROGRAM, command, "-help"], stdout=subprocess.PIPE, check=True).stdout.decode()
    return [Option(*match) for match in re.findall(r"^  -(\w+) \[(.*)\]: (.*?)(?: \([a-z/1]+\))?$", text, re.M)]


def commands():
    text = subprocess.run([PROGRAM, "--help"], stdout=subprocess.PIPE, check=True).stdout.decode()
    listed = text.split("commands:\n")[1].split("\n\n")[0]
    return {line.split()[0]: options_of(line.split()[0]) for line in listed.splitlines()}


def as_yaml(pairs, r):
    """The pairs as a scene, in one of the many ways of writing it; None where they do not fit into one."""
    names = [name.lower() for name, _ in pairs]
    if not pairs or len(set(names)) < len(names) or any("\n" in v or "\x01" in v or v == "" for _, v in pairs):
        return None

    def scalar(value):
        if re.fullmatch(r"[\w.+-][\w.+:/-]*", value) and value.lower() not in ("null",) and not value.endswith(":") \
                and value not in ("-", ".") and r.random() < 0.7:
            return value
        if "," in value and re.fullmatch(r"[\w.+,:-]+", value) and ",," not in value and value.strip(",") == value:
            return "[" + ", ".join(value.split(",")) + "]"
        return "'" + value.replace("'", "''") + "'"

    groups = {}
    for name, value in pairs:
        head, _, tail = name.partition("_")
        groups.setdefault(head if tail and r.random() < 0.8 else "", []).append((name, tail, value))
    lines = []
    for head, members in groups.items():
        if head and len(members) == 1 and r.random() < 0.3:
            lines.append(f"{members[0][0]}: {scalar(members[0][2])}")
        elif head and r.random() < 0.5:
            lines.append(head + ": {" + ", ".join(f"{tail}: {scalar(value)}" for _, tail, value in members) + "}")
        elif head:
            lines.append(f"{head}:  # group")
            lines += [f"  {tail}: {scalar(value)}" for _, tail, value in members]
        else:
            lines += [f"{name}: {scalar(value)}" for name, _, value in members]
    if r.random() < 0.2:
        lines.insert(0, "---")
    return ("\n".join(lines) + "\n").encode()


def damage(text, r):
    text = bytearray(text)
    for _ in range(r.choice([1, 1, 1, 2, 5])):
        at = r.randrange(len(text) + 1)
        kind = r.randrange(6)
        if kind == 0 and text:
            del text[at:at + r.randrange(1, 8)]
        elif kind == 1:
            some = b"\0\t\n {}[],:#&*!|>-'\"%@`\xff\xc3\r~?=.0aA"
            text[at:at] = bytes(r.choice(some) for _ in range(r.randrange(1, 4)))
        elif kind == 2 and text:
            text[at % len(text)] = r.randrange(256)
        elif kind == 3:
            text = text[:at]
        elif kind == 4:
            lines = bytes(text).split(b"\n")
            lines.insert(r.randrange(len(lines) + 1), r.choice(lines))
            text = bytearray(b"\n".join(lines))
        else:
            text[at:at] = r.choice([b"\n---\n", b"\n...\n", b"{" * 50, b"a: " * 30, b"\n\t", b"- ", b"\xef\xbb\xbf"])
    return bytes(text)


def coherent(pairs, r):
    """Without what belongs to another form, law or end, so that more cases come to do some work."""
    form, law = pairs.get("model_form", "continuum"), pairs.get("friction_law", "cubic")
    if law != "rate-and-state" and pairs.get("state_law") in ("ageing", "slip"):
        pairs["state_law"] = r.choice(["none", "contact-age"])
    if law == "rate-and-state":
        pairs.pop("state_law", None)
    state = pairs.get("state_law", "none")
    if state == "healing" and law == "cubic":
        del pairs["state_law"]
    drop = {"restart", "init_file", "init_frame", "accuracy"}
    if form == "chain":
        drop |= {"model_gamma", "model_delta", "model_c", "model_delta_sign", "grid_order", "grid_length",
                 "friction_spread_length"}
    else:
        drop |= {"model_m", "model_k0", "model_k1", "model_f0", "model_zeta"}
    if law in ("cubic", "rate-and-state"):
        drop |= {"friction_eps", "friction_back_slip"}
    elif r.random() < 0.5:
        pairs["friction_stick"] = "regularised"
        drop |= {"friction_back_slip"}
    if pairs.get("friction_stick", "exact") == "exact":
        drop |= {"friction_eps", "friction_slip_velocity"}
    if law != "carlson-langer":
        drop |= {"friction_sigma", "friction_alpha"}
    if law != "coulomb":
        drop |= {"friction_fs", "friction_fd", "friction_slip_velocity"}
    if law != "rate-and-state":
        drop |= {"friction_a", "friction_b", "friction_D", "friction_mu0", "friction_psi0"}
    drop |= {"healing": {"state_b", "state_theta0"}, "contact-age": {"state_t_h", "state_tau_inf"}}.get(
        state, {"state_b", "state_theta0", "state_t_h", "state_tau_inf", "state_D"})
    for end, other in (("bc_left", "bc_right"), ("bc_right", "bc_left")):
        if (pairs.get(end) == "periodic") and pairs.get(other, "periodic") != "periodic":
            del pairs[end]
        if pairs.get(end) != "velocity":
            drop.add(end + "_value")
    if r.random() < 0.9:
        for name in ("out_file", "summary"):
            if name in pairs:
                pairs[name] = {"out_file": "sub/new.h5", "summary": "new.json"}[name]
        if "out_every" in pairs or "out_times" in pairs:
            drop |= {"out_frames"} | ({"out_times"} if "out_every" in pairs else set())
    return {name: value for name, value in pairs.items() if name not in drop}


@functools.lru_cache(None)
def sound_files():
    """A checkpoint and the result that it belongs to, of a short run."""
    with tempfile.TemporaryDirectory() as folder:
        scene = "-grid_n 16 -init_type sine -ts_max_time 0.5 -out_frames 3 -out_checkpoint_every 4 -out_probes 1"
        subprocess.run([PROGRAM, "run", *scene.split(), "-out_file", "in.h5"], cwd=folder, check=True,
                       stderr=subprocess.DEVNULL)
        files = {}
        for name in sorted(os.listdir(folder)):
            with open(os.path.join(folder, name), "rb") as file:
                files[name if name == "in.h5" else "in.chk.h5"] = file.read()
        return files


class RestartCase:
    """A restart, or a start, from a file that is damaged or sound; a third of the damaged checkpoints has a checksum
    that fits."""
    scene, in_scene, pairs, stray, damaged, wants_summary = None, [], [], None, True, True

    def __init__(self, r):
        self.command, self.ranks = "run", r.choice([1] * 49 + [2])
        self.files = dict(sound_files())
        self.restart = r.random() < 0.8
        name = "in.chk.h5" if self.restart else "in.h5"
        content = bytearray(self.files[name])
        kind = r.random()
        if kind < 0.2:
            content = content[:r.randrange(len(content) + 1)]
        elif kind < 0.9:
            used = [k for k in range(0, len(content), 64) if any(content[k:k + 64])]  # most of a small file is empty
            for _ in range(r.choice([1, 1, 2, 5, 20])):
                at = r.choice(used) + r.randrange(64)
                if at < len(content):
                    content[at] = r.choice([0, 255, r.randrange(256), content[at] ^ 1 << r.randrange(8)])
            if self.restart and r.random() < 0.7:
                content[:512] = checkpoint_block(bytes(content[512:]))
        self.files[name] = bytes(content)
        start = f"-init_type file -init_file {name} -grid_n 16 -ts_max_time 0.1"
        self.options = ["-restart", name] if self.restart else start.split()
        more = ["-ts_max_time 0.7", "-ts_max_time 0.01", "-ts_max_steps 30", "-ts_dt 0.1", "-model_gamma 2",
                "-out_every 0.1", "-out_probes 2"]
        for words in r.sample(more, r.choice([0, 0, 1, 2])):
            self.options += words.split()
        self.options += ["-out_file", r.choice(["new.h5", "new.h5", "in.h5"])]

    def words(self, flat=False):
        return ["run", *self.options, "-summary", "summary.json"]


def case_of(seed, number, table):
    r = random.Random(f"{seed}/{number}")
    return RestartCase(r) if number % 12 == 5 else Case(seed, number, table)


class Case:
    files = {}

    def __init__(self, seed, number, table):
        r = random.Random(f"{seed}/{number}")
        self.command = r.choice(list(table) + ["run", "run"])
        options = table[self.command]
        self.ranks = r.choice([1] * 49 + [2])
        pairs = {"ts_max_steps": "50"}
        if r.random() < 0.9:
            pairs.update({"grid_n": "32", "ts_max_time": "0.1"})
        if self.command == "wave" and r.random() < 0.9:
            pairs[r.choice(["wave_length", "wave_speed"])] = r.choice(["100", "40", "3"])
        if self.command == "boundary" and r.random() < 0.9:
            pairs.update({"boundary_parameter": "model_v", "boundary_from": "0.5", "boundary_to": "1.5"})
        pairs.update({"chart_methods": "rk:3bs,arkimex:4", "chart_tolerances": "1e-2", "chart_repeats": "1",
                      "chart_row_seconds": "0.1", "chart_reference_seconds": "0.2"})
        pairs = {name: value for name, value in pairs.items() if any(o.name == name for o in options)}
        # mostly of one law and one form, so that many cases are consistent
        laws = {"model_form": ["continuum", "continuum", "chain"],
                "friction_law": ["cubic", "cubic", "carlson-langer", "coulomb", "rate-and-state"],
                "bc_left": [None, None, "free", "velocity"], "bc_right": [None, None, "free", "velocity"],
                "init_type": ["uniform", "sine", "layer", "pulses", "wave"]}
        for name, words in laws.items():
            word = r.choice(words)
            if word and any(o.name == name for o in options) and r.random() < 0.5:
                pairs[name] = word
        for option in r.sample(options, min(len(options), r.choice([0, 1, 2, 3, 6]))):
            pairs[option.name] = option.good(r)
        if r.random() < 0.8:
            pairs = coherent(pairs, r)
        self.library = []
        for _ in range(r.choice([0, 0, 0, 1, 2])):
            self.library += r.choice(LIBRARY)
        spoil = r.random()
        if spoil < 0.25:  # one value that may be bad
            pairs[r.choice(options).name] = r.choice(BAD)
        elif spoil < 0.35:  # one name that may be bad
            name = list(r.choice(options).name)
            at = r.randrange(len(name))
            name[at:at + r.randrange(2)] = r.choice(["", "x", "_", "A", "-", "=", name[at] * 2])
            pairs["".join(name) or "x"] = r.choice(["1", "x"])
        self.pairs = list(pairs.items())
        r.shuffle(self.pairs)
        self.scene, self.damaged = None, False
        moved = [pair for pair in self.pairs if r.random() < 0.7] if r.random() < 0.5 else []
        scene = as_yaml(moved, r)
        self.in_scene = []
        if scene:
            self.in_scene, self.scene = moved, scene
            if r.random() < 0.4:
                self.scene, self.damaged = damage(scene, r), True
        self.wants_summary = "summary" not in pairs
        self.stray = r.choice(["stray", "3", "scene.yaml", "-", "--", "-1"]) if r.random() < 0.03 else None

    def words(self, flat=False):
        """The command line; flat: with the scene's options on it too."""
        words = [self.command]
        rest = [pair for pair in self.pairs if flat or pair not in self.in_scene]
        if self.scene is not None and not flat:
            words.append("scene.yaml")
        if flat:  # the scene stands below
            rest = self.in_scene + [pair for pair in rest if pair not in self.in_scene]
        for name, value in rest:
            words += ["-" + name, value]
        words += self.library
        if self.wants_summary:
            words += ["-summary", "summary.json"]
        return words + ([self.stray] if self.stray else [])


def execute(words, scene, ranks, inputs):
    """Runs the program in a folder of its own; returns all that can be seen."""
    with tempfile.TemporaryDirectory() as top:
        folder = os.path.join(top, "work")
        os.makedirs(os.path.join(folder, "sub"))
        with open(os.path.join(folder, "notes.txt"), "w") as file:
            file.write(NOTES)
        for name, content in {**inputs, **({} if scene is None else {"scene.yaml": scene})}.items():
            with open(os.path.join(folder, name), "wb") as file:
                file.write(content)
        command = (["mpirun", "-n", str(ranks)] if ranks > 1 else []) + [PROGRAM] + words
        session = os.path.join(top, "t")  # two Open MPI programs at a time must not share a session folder
        os.mkdir(session)
        try:
            done = subprocess.run(command, cwd=folder, env={**os.environ, "OMPI_MCA_orte_tmpdir_base": session}, stdin=subprocess.DEVNULL,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=300)
        except subprocess.TimeoutExpired:
            return {"hangs": True}
        seen = {"code": done.returncode, "out": done.stdout.decode(errors="replace"),
                "err": done.stderr.decode(errors="replace"), "files": {}, "hdf5": []}
        for path, _, names in os.walk(folder):
            for name in names:
                full = os.path.join(path, name)
                with open(full, "rb") as file:
                    data = file.read()
                seen["files"][os.path.relpath(full, folder)] = data
                if data[:4] == b"\x89HDF" and inputs.get(name) != data:
                    try:
                        import h5py
                        with h5py.File(full, "r") as file:
                            file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)
                    except (OSError, RuntimeError, KeyError, ValueError) as trouble:
                        seen["hdf5"].append(f"{name}: {trouble}")
        return seen


def complaints(case, seen, words):
    if seen.get("hangs"):
        return ["hangs"]
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
    if "in.chk.h5" in changed or (code == 2 and changed):
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
    if one.get("hangs") or other.get("hangs"):
        return True
    return plain(one) == plain(other)


def check(seed, number, table, loud=False):
    case = case_of(seed, number, table)
    words = case.words()
    seen = execute(words, case.scene, case.ranks, case.files)
    found = complaints(case, seen, words)
    if case.scene is not None and not case.damaged and not case.stray and not found:
        flat = case.words(flat=True)
        other = execute(flat, None, case.ranks, {})
        # of several mistakes, another one may be met first
        if not same(seen, other) and seen["code"] != other.get("code"):
            found.append(f"without the scene: exit code {other.get('code')}, {other.get('err', '')[:200]}")
    if loud:
        print(shlex.join(words), "\n", case.scene, "\n", seen)
    if not found:
        return None, seen.get("code")
    text = f"case {number} of seed {seed}, {case.ranks} ranks: {shlex.join(words)}\n    scene: {case.scene!r}\n"
    return text + "".join(f"    {one}\n" for one in found) + f"    {seen.get('err', '')[:500]!r}", seen.get("code")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--only", type=int, help="this case alone, with all it printed")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(arguments)
    table = commands()
    numbers = range(given.cases) if given.only is None else [given.only]
    failures, codes = 0, {}
    with concurrent.futures.ThreadPoolExecutor(given.jobs) as pool:
        for text, code in pool.map(lambda n: check(given.seed, n, table, given.only is not None), numbers):
            codes[code] = codes.get(code, 0) + 1
            if text:
                failures += 1
                print("FAILED", text, flush=True)
    codes = dict(sorted(codes.items(), key=str))
    print(f"seed {given.seed}: {len(numbers)} cases, {failures} failures, exit codes {codes}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
