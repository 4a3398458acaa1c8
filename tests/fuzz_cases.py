"""The cases of fuzz.py, drawn from a seed: command lines, scenes, damaged files."""
import functools
import os
import random
import re
import subprocess
import tempfile

from calls import PROGRAM, checkpoint_block

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
    "sweep_points1": lambda r: r.choice(["1", "2", "3"]),
    "sweep_points2": lambda r: r.choice(["1", "2"]),
    "sweep_count": lambda r: r.choice(["1", "3", "5"]),
    "sweep_command": lambda r: r.choice(["run", "run", "spectrum", "wave", "cycle", "boundary", "laws", "sweep"]),
    "sweep_values1": lambda r: r.choice(["1", "0.2,0.5", "cubic,coulomb", "0.1,,2"]),
    "sweep_group_ranks": lambda r: r.choice(["1", "2"]),
    "sweep_key": lambda r: r.choice(["regime", "stable", "t_end", "no_such"]),
    "load_v": lambda r: r.choice(["0:0.2,1:0.5", "0:1,0.05:1,0.05:2", "1:0,0:1", "columns.txt"]),
    "load_sine_period": lambda r: r.choice(["1", "0.1", "30"]),
    "accuracy_of": lambda r: r.choice(["fields", "speed", "period", "amplitude", "probe:3", "probe:"]),
    "accuracy_seconds": lambda r: "0.1",
    "out_maxima": lambda r: r.choice(["0", "1", "1e9"]),
    "lyapunov_count": lambda r: r.choice(["0", "1", "3", "1000"]),
    "cycle_wavenumbers": lambda r: r.choice(["2", "7"]),
    "cycle_steps": lambda r: r.choice(["1", "3"]),
    "cycle_cell": lambda r: r.choice(["0", "1", "2", "3"]),
}
TEXTS = {"out_file": ["new.h5", "notes.txt", "no/such/folder/a.h5", ".", "sub/new.h5", "ring space.h5", "é.h5"],
         "summary": ["new.json", "notes.txt", "no/such/folder/a.json", "."],
         "restart": ["notes.txt", "missing.h5", "."], "init_file": ["notes.txt", "missing.h5", ".", "columns.txt"],
         "chart_reference": ["auto", "missing.h5"]}
COLUMNS = b"0 0.1\n10 0.5  # two columns\n60 0.2\n"
STARTS = b"0 0.1 0\n10 0.5 0.2\n60 0.2 0\n"
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
        if re.match(r"(boundary|sweep)_parameter|(wave|cycle)_continue", self.name):
            return r.choice(PARAMETERS)
        if self.takes.startswith("one of "):
            return r.choice(self.takes[7:].split(", "))
        if self.name.endswith("_profile"):
            return r.choice(["0:1,30:2", "0:0.5,10:0.5,10:1.5", "columns.txt", "0:1", "5:1,4:2", "notes.txt"])
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
    table = {line.split()[0]: options_of(line.split()[0]) for line in listed.splitlines()}
    own = {option.name for option in table["sweep"]}
    table["sweep"] += [option for option in table["run"] if option.name not in own]
    return table


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
    """A checkpoint and the result that it belongs to, of a short run; a sweep's table; modes of a spectrum."""
    with tempfile.TemporaryDirectory() as folder:
        for words in (f"sweep {SWEEP} -out_file table.h5", "spectrum -grid_n 16 -out_file modes.h5"):
            subprocess.run([PROGRAM, *words.split()], cwd=folder, check=True, stderr=subprocess.DEVNULL)
        scene = "-grid_n 16 -init_type sine -ts_max_time 0.5 -out_frames 3 -out_checkpoint_every 4 -out_probes 1"
        subprocess.run([PROGRAM, "run", *scene.split(), "-out_file", "in.h5"], cwd=folder, check=True,
                       stderr=subprocess.DEVNULL)
        files = {}
        for name in sorted(os.listdir(folder)):
            with open(os.path.join(folder, name), "rb") as file:
                files["in.chk.h5" if "chk" in name else name] = file.read()
        files["columns.txt"] = STARTS
        return files


SWEEP = "-sweep_parameter1 model_v -sweep_values1 0.5,0.7,0.9 -grid_n 8 -ts_max_time 0.1"
MORE = ["-ts_max_time 0.7", "-ts_max_time 0.01", "-ts_max_steps 30", "-ts_dt 0.1", "-model_gamma 2", "-out_every 0.1",
        "-out_probes 2"]


def spoilt(content, checkpoint, r):
    """A file cut, or with bytes changed, or sound; most damaged checkpoints get a checksum that fits."""
    content, kind = bytearray(content), r.random()
    if kind < 0.2:
        return bytes(content[:r.randrange(len(content) + 1)])
    if kind < 0.9:
        used = [k for k in range(0, len(content), 64) if any(content[k:k + 64])]  # most of a small file is empty
        for _ in range(r.choice([1, 1, 2, 5, 20])):
            at = r.choice(used) + r.randrange(64)
            if at < len(content):
                content[at] = r.choice([0, 255, r.randrange(256), content[at] ^ 1 << r.randrange(8)])
        if checkpoint and r.random() < 0.7:
            content[:512] = checkpoint_block(bytes(content[512:]))
    return bytes(content)


class FileCase:
    """A restart, or a start, from a file that is damaged or sound."""
    scene, in_scene, pairs, stray, damaged, wants_summary = None, [], [], None, True, True
    needed = ()

    def __init__(self, r):
        self.ranks = ranks_of_case(r)
        self.files = dict(sound_files())
        name, words = r.choice([
            ("in.chk.h5", "run -restart in.chk.h5"), ("in.chk.h5", "run -restart in.chk.h5"),
            ("in.h5", "run -init_type file -init_file in.h5 -grid_n 16 -ts_max_time 0.1"),
            ("modes.h5", "run -init_type file -init_file modes.h5 -grid_n 16 -ts_max_time 0.1"),
            ("columns.txt", "run -init_type text -init_file columns.txt -grid_n 16 -ts_max_time 0.1"),
            ("columns.txt", "run -model_gamma 3 -load_v columns.txt -grid_n 16 -ts_max_time 0.1"),
            ("table.h5", f"sweep -restart table.h5 {SWEEP}"), ("table.h5", "sweep -restart table.h5"),
            ("in.h5", "chart -chart_reference in.h5 -grid_n 16 -ts_max_time 0.5 -init_type sine -chart_methods rk:3bs "
                      "-chart_tolerances 1e-2 -chart_repeats 1")])
        text = name == "columns.txt"
        if text and "load_v" in words:
            self.files[name] = COLUMNS
        self.files[name] = damage(self.files[name], r) if text else spoilt(self.files[name], ".chk" in name, r)
        self.command, *self.options = words.split()
        if self.command == "run":
            for words in r.sample(MORE, r.choice([0, 0, 1, 2])):
                self.options += words.split()
        if self.command != "sweep" or r.random() < 0.3:
            self.options += ["-out_file", r.choice(["new.h5", "new.h5", "in.h5"])]

    def words(self, flat=False):
        return [self.command, *self.options, "-summary", "summary.json"]


def ranks_of_case(r):
    return r.choice([1] * 97 + [2, 3, 4])


def case_of(seed, number, table):
    r = random.Random(f"{seed}/{number}")
    return FileCase(r) if number % 12 == 5 else Case(seed, number, table)


# Without which a command has nothing to do: they stand at their first values, and mending leaves them.
NEEDED = {"wave": {}, "boundary": {"boundary_parameter": "model_v", "boundary_from": "0.5", "boundary_to": "1.5"},
          "sweep": {"sweep_parameter1": "model_v", "sweep_from1": "0.3", "sweep_to1": "1.5", "sweep_points1": "3",
                    "out_file": "sub/new.h5"}}


class Case:
    files = {"columns.txt": COLUMNS}

    def __init__(self, seed, number, table):
        r = random.Random(f"{seed}/{number}")
        self.command = r.choice(list(table) * 2 + ["run"] * 6 + ["spectrum", "cycle", "wave", "laws", "sweep", "sweep"])
        options = table[self.command]
        self.ranks = ranks_of_case(r)
        pairs = {"ts_max_steps": "50"}
        if r.random() < 0.9:
            pairs.update({"grid_n": "32", "ts_max_time": "0.1"})
        if self.command == "wave" and r.random() < 0.9:
            pairs[r.choice(["wave_length", "wave_speed"])] = r.choice(["100", "40", "3"])
        if r.random() < 0.9:
            pairs.update(NEEDED.get(self.command, {}))
        if self.command == "boundary" and r.random() < 0.7:  # the other costs fifty times as much
            pairs["boundary_of"] = "sliding"
        self.needed = {"grid_n", "ts_max_time", "ts_max_steps", "summary", *NEEDED.get(self.command, {})}
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
        self.wants_summary = all(name.lower() != "summary" for name in pairs)
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


