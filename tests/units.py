"""The dimensions of options and results, and scenes in other units.

Lengths are of two kinds: of slip (psi times time), and of place along the medium, which a chain counts in blocks. A scene
is rescaled by factors of place, slip, time and force, all powers of two, so that its numbers keep their digits. What may be
rescaled: in the chain slip, time and force; in the continuum, whose force unit and time unit are those of the equations
(A K0 = 1), place and slip. Where friction has no velocity of its own to rescale (cubic, carlson-langer) slip goes with
time.
"""
import functools
import json
import os
import re

import numpy as np

from calls import SOURCE, call

PLACES = {"model_c", "grid_length", "friction_spread_length", "init_width", "init_noise_length", "out_probes", "out_maxima",
          "wave_length", "wave_speed"}  # options whose length is one of place
PLACE_KEYS = {"x", "speed", "wave_speed", "length", "shortest_pulse", "wavenumber", "wavenumber_continuum", "diffusion",
              "front_speed", "from", "to"}  # results likewise
CHAIN = {"model_m": (0, -1, 2, 1), "model_k0": (0, -1, 0, 1), "model_k1": (0, -1, 0, 1), "model_f0": (0, 0, 0, 1),
         "model_zeta": (0, -1, 1, 1), "model_nu": (0, -1, 1, 1)}  # powers of place, slip, time, force
CONTINUUM = {"model_gamma": (0, 1, -1, 0), "model_nu": (2, 0, -1, 0)}
STATES = {"ageing": (0, 0, 1, 0), "slip": (0, 0, 1, 0), "prz": (0, 0, 1, 0), "contact-age": (0, 0, 1, 0),
          "ageing-cutoff": (0, 0, 1, 0), "healing": (0, 0, 0, 0), "slip-memory": (0, 1, 0, 0), "bristles": (0, 1, 0, 0)}
BY_DEFAULT = {"rate-and-state": "ageing", "dieterich": "ageing", "n-shaped": "ageing-cutoff", "slip-weakening": "slip-memory",
              "lugre": "bristles", "dahl": "bristles"}
OF_OTHERS = {"boundary_from": "boundary_parameter", "boundary_to": "boundary_parameter",
             "boundary_from2": "boundary_parameter2", "boundary_to2": "boundary_parameter2", "cycle_to": "cycle_continue", "wave_to": "wave_continue",
             "sweep_from1": "sweep_parameter1", "sweep_to1": "sweep_parameter1", "sweep_from2": "sweep_parameter2",
             "sweep_to2": "sweep_parameter2"}

VARIED = {*OF_OTHERS.values(), "fit_parameters"}  # options whose value is another's name


def powers(unit, place=False):
    """Of place, slip, time and force in a unit as the pages write it: length^2/time, 1/(time velocity^2)."""
    above, _, below = unit.replace("(", "").replace(")", "").partition("/")
    found = np.zeros(4, int)
    for part, sign in ((above, 1), (below, -1)):
        for word in re.findall(r"[a-z]+(?:\^\d)?", part):
            name, _, power = word.partition("^")
            step = {"length": (1, 0, 0, 0) if place else (0, 1, 0, 0), "time": (0, 0, 1, 0),
                    "velocity": (1, 0, -1, 0) if place else (0, 1, -1, 0)}.get(name)
            if step is None:
                return None
            found += sign * int(power or 1) * np.array(step)
    return tuple(found)


def rows(page):
    with open(os.path.join(SOURCE, "docs", page), encoding="utf-8") as file:
        for line in file:
            line = re.sub("[²³⁴]", lambda power: "^" + str("²³⁴".index(power[0]) + 2), line)
            yield [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] if line.startswith("| `") else line


@functools.lru_cache(None)
def option_units():
    """The unit of every option that has one."""
    found = {}
    for row in rows("options.md"):
        if isinstance(row, list):
            unit = re.search(r"\(([a-z0-9/^ ]+)\)$", row[2])
            if unit and unit[1] not in ("1", "GB"):
                found[row[0].strip("`")] = unit[1]
    return found


@functools.lru_cache(None)
def key_units():
    """The unit of every key, by its own name: those of one name have one unit but for `length`, `residual`."""
    found = {}
    for row in rows("summary.md"):
        if isinstance(row, list):
            found.setdefault(row[0].strip("`"), row[1])
    return found


def state_of(options):
    return STATES.get(options.get("state_law", BY_DEFAULT.get(options.get("friction_law"), "none")), (0, 0, 0, 0))


def dimension(name, options):
    """Powers of place, slip, time, force of an option's value."""
    chain = options.get("model_form") == "chain"
    if name in OF_OTHERS:
        return dimension(options[OF_OTHERS[name]], options)
    if name in (CHAIN if chain else CONTINUUM):
        return (CHAIN if chain else CONTINUUM)[name]
    if name == "init_state":
        return state_of(options)
    if name == "init_noise" and options.get("init_noise_of") == "eta":
        return (0, 0, 0, 0)
    unit = option_units().get(name)
    found = powers(unit, name in PLACES) if unit else None
    if found is None or (chain and found[0]):  # a chain's places are numbers of blocks
        return (0, 0, 0, 0) if not found else (0, *found[1:])
    return found


def scaled(value, exponent):
    return float(value) * 2.0 ** int(exponent)


class Rescaling:
    """Factors 2^powers of place, slip, time, force."""

    def __init__(self, random, options, most=40, factors=None):
        if factors is not None:
            self.factors = np.array(factors)
            return
        place, slip, time, force = (int(random.integers(-most, most + 1)) for _ in range(4))
        # an error that is asked for or listed is the larger of that of psi and of eta, a number: psi keeps its unit
        fixed = (options.get("friction_law", "cubic") in ("cubic", "carlson-langer") or "accuracy" in options
                 or "chart_methods" in options)
        if options.get("model_form") == "chain":
            place, slip = 0, time if fixed else slip
        else:
            time = force = 0
            slip = 0 if fixed else slip
        self.factors = np.array([place, slip, time, force])

    def exponent(self, dimension):
        return int(np.dot(self.factors, dimension))

    def option(self, name, value, options):
        if name == "fit_data":
            times, forces = value
            return [times * 2.0 ** self.exponent((0, 0, 1, 0)), forces]
        exponent = self.exponent(dimension(name, options))
        if name.endswith("_profile") or name in ("load_v", "load_normal", "friction_table"):
            first = {"load_v": (0, 0, 1, 0), "load_normal": (0, 0, 1, 0),
                     "friction_table": (0, 1, -1, 0)}.get(name, (1, 0, 0, 0))
            second = {"load_v": (0, 1, -1, 0)}.get(name, (0, 0, 0, 0))
            if name.endswith("_profile"):
                second = dimension(name[:-len("_profile")], options)
                first = (0, 0, 0, 0) if options.get("model_form") == "chain" else first
            pairs = (pair.split(":") for pair in value.split(","))
            return ",".join(f"{scaled(x, self.exponent(first))!r}:{scaled(y, self.exponent(second))!r}" for x, y in pairs)
        if exponent == 0 or (isinstance(value, str) and not re.fullmatch(r"[-+.\deE,]+", value)):
            return value
        if isinstance(value, str):
            return ",".join(repr(scaled(x, exponent)) for x in value.split(","))
        return repr(scaled(value, exponent))

    def options(self, options):
        return {name: self.option(name, value, options) for name, value in options.items()}

    def key(self, name, options):
        """The exponent of a result of that name."""
        if name in ("value", "value2", "next_value", "error", "error2") and any(o in options for o in VARIED):
            number = "2" if name.endswith("2") else ""
            of = next((options[o] for o in ("boundary_parameter" + number, "cycle_continue", "wave_continue" + number,
                                            "sweep_parameter1", "fit_parameters") if o in options), None)
            return self.exponent(dimension(of, options)) if of else 0
        if name == options.get("fit_parameters"):
            return self.exponent(dimension(name, options))
        if name == "state":
            return self.exponent(state_of(options))
        if name == "largest_moment":  # slip summed over place
            return self.exponent((1, 1, 0, 0))
        unit = key_units().get(name, {"psi": "length/time", **dict.fromkeys(("x", "chi", "from", "to"), "length")}.get(name, ""))
        found = powers(unit, name in PLACE_KEYS) or (0, 0, 0, 0)
        return self.exponent((0, *found[1:]) if options.get("model_form") == "chain" else found)


# ---- results ----

# What is round-off or an estimate, or is no result.
NO_RESULT = {"options", "wall_s", "seconds", "choosing_seconds", "run_seconds", "step_seconds", "events_per_s", "files",
             "processor_s", "residual", "error_estimate", "best", "dispersion_error", "translation_error", "multiplier_error",
             "growth_rate_error", "completeness_check", "reason", "warnings", "version", "git", "stopped_at", "clock",
             "correlation", "mesh_intervals", "evaluations", "runs"}


# Powers of two change no digit, so what a scene is computed by does the same operations with the same bits: results are
# equal. Not so where a number with a unit meets a logarithm, as ln theta: there round-off differs, and steps that hang on
# it may err elsewhere, each by its own tolerance, `ts_rtol` (two runs for `accuracy` by that). And not what comes of
# eigenvalues.
RTOL, ROUND_OFF = 1e-6, 1e-10
OF_EIGENVALUES = {"growth_rate", "frequency"}
OF_STEPS = {"steps", "rejections", "rhs_evaluations", "error", "error_time", "attempts", "trials", "tolerance", "reference_error",
            "regime_rate", "time_to_decide"}


def has_logarithms(options):
    return options.get("friction_law") in ("rate-and-state", "dieterich", "n-shaped") or options.get("state_law") == "contact-age"


def with_multiplier(row):
    """Of a cycle exp(growth_rate period), which is what is computed: a rate of a strong decay has few digits."""
    if not row.get("growth_rate") or not row.get("period") or "force_drop" not in row:
        return row
    return row | {"multiplier": float(np.exp(row["growth_rate"] * row["period"]))}


def decimals(row, name):
    """How far, relative, a number may lie beside itself that is rounded to decimal digits, which are others in other units:
    the error of a period to two digits, the period to the error's fourth."""
    if not row.get("period") or not row.get("period_error") or name not in ("period", "period_error"):
        return 0
    return 0.1 if name == "period_error" else 1e-3 * row["period_error"] / row["period"]


def ordered(values):
    """Numbers re + i im by size to nine digits and imaginary part, as a list may have those alike in any order."""
    size = max(abs(complex(z["re"], z["im"])) for z in values) or 1
    return sorted(values, key=lambda z: (round(z["im"] / size, 7), round(z["re"] / size, 7)))


def differences(one, other, units, options, tolerance, path="", inherited=0, absolute=0):
    """Places at which two results differ by more than their units."""
    if isinstance(one, dict) and isinstance(other, dict):
        one, other = with_multiplier(one), with_multiplier(other)
        # of eigenvalues of a train and multipliers of a cycle by themselves
        stated = 10 * max(row.get(error) or 0 for row in (one, other) for error in ("translation_error", "multiplier_error"))
        for name in sorted(set(one) | set(other)):
            if name in NO_RESULT or (name == "growth_rate" and "multiplier" in one):
                continue
            if name == "error" and "fit_parameters" in options:
                continue  # by differences of runs, which corners of friction leave few digits
            exponent = units.key(name, options) or inherited
            if name in ("count", "variation", "wavenumber"):
                exponent = units.key(name, options)
            if "/multipliers" in path:  # re and im of numbers
                exponent = 0
            if name in OF_STEPS and tolerance >= RTOL:
                continue
            if name == "multiplier" and "/branch/points" in path and options.get("friction_law") == "lugre":
                continue  # a kink at rest, where meshes of a branch have no node, leaves it one digit
            allowed = max(tolerance, decimals(one, name), ROUND_OFF if name in OF_EIGENVALUES else 0)
            if name in ("displacement", "acceleration"):  # as their page says
                allowed = max(allowed, 1e-3)
            if "accuracy" not in options:  # of a train or cycle, whose meshes round-off makes others
                allowed = max([allowed, *(10 * (row.get("error_estimate") or 0) for row in (one, other))])
            # a profile is known in parts of its range
            profile = allowed * (one["psi_max"] - one["psi_min"]) if name == "psi_min" and one.get("mesh_intervals") else 0
            yield from differences(one.get(name), other.get(name), units, options, allowed, f"{path}/{name}", exponent,
                                   max(absolute, profile, stated * (name in OF_EIGENVALUES | {"eigenvalues", "multipliers", "multiplier"})))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        if "multipliers" in path or "eigenvalues" in path:  # of equal size in any order
            one, other = ordered(one), ordered(other)
        for k, (a, b) in enumerate(zip(one, other)):
            yield from differences(a, b, units, options, tolerance, f"{path}[{k}]", inherited, absolute)
    elif isinstance(one, str) and isinstance(other, str):
        number = r"-?\d[\d.]*(?:e[-+]?\d+)?"
        if re.sub(number, "#", one) != re.sub(number, "#", other):
            yield f"{path}: {one!r}, {other!r}"
    elif isinstance(one, (int, float)) and isinstance(other, (int, float)) and not isinstance(one, bool):
        if "/branch/points" in path:  # where on the branch steps end, which is no result
            tolerance = max(tolerance, 1e-3)
        if "/endless" in path:  # a place of a flat maximum: the root of what the value is known to
            tolerance = max(tolerance, 3e-5)
        back = other * 2.0 ** -inherited
        size = max(abs(one), abs(back), 1e-3)  # of scenes whose numbers are near 1
        if path.endswith("amplitude"):  # of psi about v
            size = max(size, options.get("model_v", 1))
        if not abs(one - back) <= max(absolute, tolerance * size):
            yield f"{path}: {one!r}, {back!r} ({other!r})"
    elif one != other:
        yield f"{path}: {one!r}, {other!r}"


def words_for(options):
    return [str(word) for name, value in options.items() for word in ("-" + name, value)]


def with_file(options, name):
    """Columns of data in a file."""
    if "fit_data" not in options:
        return options
    np.savetxt(f"{name}.txt", np.stack(options["fit_data"], axis=1), fmt="%.17g")
    return options | {"fit_data": f"{name}.txt"}


def answer(command, options, name):
    if os.path.exists(f"{name}.json"):
        os.remove(f"{name}.json")
    done = call(words_for(options) + ["-summary", f"{name}.json"], 1, command)
    summary = json.load(open(f"{name}.json", encoding="utf-8")) if os.path.exists(f"{name}.json") else None
    return done, summary


def compare(command, options, units, tolerance):
    done, one = answer(command, with_file(options, "one"), "one")
    if done.returncode == 2 or one is None:
        return done.returncode, [f"refused: {done.stderr[-300:]}"] if done.returncode == 2 else [], [], []
    other_options = units.options(options)  # a scene's draw sets every option that has a unit and an effect
    again, other = answer(command, with_file(other_options, "other"), "other")
    words = words_for(options), words_for(other_options)
    if done.returncode != again.returncode:
        return done.returncode, [f"exit codes {done.returncode}, {again.returncode}: {done.stderr[-300:]} "
                                 f"{again.stderr[-300:]}"], *words
    if one is None or other is None:
        return done.returncode, ["summary"] * ((one is None) != (other is None)), *words
    return done.returncode, list(differences(one, other, units, options, tolerance)), *words


# ---- scenes ----

def draw_law(random, o, smooth=False):
    laws = ["cubic", "carlson-langer", "coulomb", "stribeck", "tanh", "table", "rate-and-state", "dieterich", "n-shaped",
            "slip-weakening", "lugre", "dahl"]
    law = str(random.choice([name for name in laws if not (smooth and name in ("slip-weakening", "dahl"))]))
    o["friction_law"] = law
    u = random.uniform
    if law in ("carlson-langer", "coulomb", "stribeck", "table"):
        if smooth:
            o |= {"friction_stick": "regularised", "friction_eps": u(0.02, 0.1), "friction_slip_velocity": u(0.05, 0.3)}
        if law != "table" and random.random() < 0.3:
            o["state_law"] = str(random.choice(["healing", "contact-age"]))
            o |= {"state_D": u(0.3, 2)}
            o |= {"state_t_h": u(0.5, 3)} if o["state_law"] == "healing" else {"state_theta0": u(0.3, 2)}
    if law == "coulomb" and o.get("friction_stick") != "regularised":
        o.pop("friction_slip_velocity", None)
    if law != "coulomb":
        o.pop("friction_slip_velocity", None)
    if law == "stribeck":
        o |= {"friction_fc": u(0.3, 0.6), "friction_fs": u(0.7, 1.2), "friction_vs": u(0.2, 1.5),
              "friction_viscous": u(0, 0.2)}
    if law == "tanh":
        o |= {"friction_vs": u(0.2, 1.5)}
    if law == "table":
        v = np.cumsum(u(0.1, 0.6, 5)) - 0.1
        o["friction_table"] = "0:1," + ",".join(f"{x!r}:{y!r}" for x, y in zip(v, u(0.4, 0.9, 5)))
    if law in ("rate-and-state", "n-shaped", "dieterich"):
        o |= {"friction_a": u(0.05, 0.2), "friction_b": u(0.1, 0.3), "friction_D": u(0.3, 1), "friction_psi0": u(0.3, 1.5)}
        if law == "n-shaped":
            o |= {"friction_psi_s": u(0.5, 2), "state_psi_h": u(0.01, 0.1)}
        else:
            o["state_law"] = str(random.choice(["ageing", "slip"]))
    if law == "slip-weakening":
        o |= {"friction_Dc": u(0.2, 1), "state_t_h": u(0.5, 3)}
    if law in ("lugre", "dahl"):
        o |= {"friction_sigma0": u(3, 30)}
    if law == "lugre":
        o |= {"friction_vs": u(0.2, 1), "friction_sigma1": u(0.1, 1), "friction_sigma2": u(0, 0.3)}
    return o


def draw_medium(random, n):
    u = random.uniform
    o = {"grid_n": n, "model_v": u(0.1, 1.2)}
    if random.random() < 0.75 or n < 9:
        o |= {"model_form": "chain", "model_m": u(0.5, 2), "model_k0": u(0.1, 1), "model_k1": u(0.1, 2),
              "model_f0": u(0.5, 1.5), "model_zeta": random.choice([0., u(0, 0.4)])}
        if random.random() < 0.1:
            o["model_k0"] = 0.
    else:
        o |= {"model_gamma": u(1, 4), "model_delta": u(0, 0.3), "model_c": u(0.5, 1.5), "grid_length": u(4, 20),
              "grid_order": int(random.choice([2, 4, 6]))}
    if random.random() < 0.2 and n > 1:
        o["model_nu"] = u(0.01, 0.2)
    if n == 1:
        o["bc_left"] = "free"
    elif random.random() < 0.5:
        for end in ("bc_left", "bc_right"):
            o[end] = str(random.choice(["free", "free", "velocity"]))
            if o[end] == "velocity" and random.random() < 0.5:
                o[end + "_value"] = u(0.1, 1)
    return o


def add_spread(random, o):
    if random.random() < 0.4 and o["grid_n"] > 1:
        o |= {"friction_spread": random.uniform(0.02, 0.4), "friction_seed": int(random.integers(1000))}
        if o.get("model_form") != "chain":
            o["friction_spread_length"] = random.uniform(0.3, 2)
    if random.random() < 0.2 and o["grid_n"] > 3 and o.get("model_form") == "chain" and "model_nu" not in o:
        name = str(random.choice(["model_m", "model_k0", "model_zeta", "model_k1"]))
        o[name + "_profile"] = f"0:{random.uniform(0.5, 1.5)!r},3:{random.uniform(0.5, 1.5)!r}"
        o.pop(name)
    return o


def draw_spectrum(random):
    o = add_spread(random, draw_law(random, draw_medium(random, int(random.choice([1, 2, 5, 20, 40, 110]))), smooth=True))
    o["spectrum_count"] = 6
    if o["grid_n"] > 100 and random.random() < 0.5:
        o["spectrum_method"] = "krylov"
    return o


def draw_boundary(random):
    o = add_spread(random, draw_law(random, draw_medium(random, int(random.choice([1, 3, 20]))), smooth=True))
    name = "model_v" if "model_form" not in o else str(random.choice(["model_v", "model_zeta"]))
    o |= {"boundary_parameter": name, "boundary_from": random.uniform(0.05, 0.2), "boundary_to": random.uniform(1, 3),
          "boundary_of": "sliding"}
    o.pop(name, None)
    o.pop(name + "_profile", None)
    if random.random() < 0.3 and "model_form" in o and not any(x.endswith("_profile") for x in o):
        o |= {"boundary_parameter2": "model_k0", "boundary_from2": 0.1, "boundary_to2": 2., "boundary_points": 8}
        o.pop("model_k0", None)
    return o


def draw_cycle(random):
    o = draw_law(random, draw_medium(random, int(random.choice([1, 1, 3]))), smooth=random.random() < 0.5)
    if o["model_k0"] == 0:
        o["model_k0"] = 0.3
    if o["grid_n"] == 3:
        o |= {"cycle_cell": 0, "init_psi": random.uniform(0.05, 1), "init_eta": random.uniform(-0.5, 0.9)}
    o["model_v"] *= 0.6
    if random.random() < 0.3:
        o |= {"cycle_continue": "model_v", "cycle_to": o["model_v"] * random.uniform(0.5, 1.4), "cycle_steps": 5}
    return o


def draw_wave(random):
    o = {"model_gamma": random.uniform(1, 4), "model_delta": random.uniform(0, 0.2), "model_c": random.uniform(0.5, 1.5),
         "model_v": random.uniform(0.05, 0.6)}
    draw_law(random, o, smooth=True)
    given = "wave_length" if random.random() < 0.5 else "wave_speed"
    o[given] = random.uniform(10, 40) if given == "wave_length" else o["model_c"] * random.uniform(1.2, 4)
    if random.random() < 0.3:
        o["wave_spectrum"] = "true"
    return o


def draw_start(random, o):
    o |= {"init_psi": random.uniform(0.05, 1), "init_eta": random.uniform(-0.5, 0.9)}
    if o["grid_n"] > 1:
        o |= {"init_noise": random.uniform(0.01, 0.2), "init_seed": int(random.integers(1000))}
        if o.get("model_form") != "chain":
            o["init_noise_length"] = random.uniform(0.5, 2)
    if o["friction_law"] in ("coulomb", "stribeck", "slip-weakening") and random.random() < 0.5:
        o["init_psi"] = 0.
        if o["grid_n"] > 1:
            o["init_noise_of"] = "eta"
    return o


def draw_run(random):
    massless = random.random() < 0.1
    o = draw_law(random, draw_medium(random, int(random.choice([1, 1, 3, 12, 30]))), smooth=massless)
    massless = massless and "model_form" in o
    if random.random() < 0.1 and not massless:  # what moves then is a held end, or a motion that dies
        o["model_v"] = 0.
    draw_start(random, add_spread(random, o))
    if massless:  # psi follows from the force, or this from psi
        o |= {"model_m": 0.}
        for name in ("init_eta", "model_nu", "init_noise_of"):
            o.pop(name, None)
    o["ts_max_time"] = random.uniform(5, 30)
    kind = random.random() * (1 if not massless else 0.15)
    if kind < 0.15:
        o |= {"load_sine_amplitude": random.uniform(0.05, 0.5), "load_sine_period": random.uniform(1, 9)}
    elif kind < 0.3:
        o |= {"load_normal_sine_amplitude": random.uniform(0.05, 0.4), "load_normal_sine_period": random.uniform(1, 9)}
    elif kind < 0.4 and o.get("model_k0") != 0:
        o |= {"load_force_sine_amplitude": random.uniform(0.05, 0.4), "load_force_sine_period": random.uniform(1, 9)}
    elif kind < 0.5:
        times = np.cumsum(random.uniform(0.5, 8, 4))
        o["load_v"] = ",".join(f"{t!r}:{random.uniform(0.1, 1)!r}" for t in times.tolist())
    if o["grid_n"] > 1 and random.random() < 0.5:
        o["out_probes"] = repr(random.uniform(0, 1) * float(o.get("grid_length", o["grid_n"] - 1)) * 0.9)
    return o


def draw_events(random):
    o = draw_run(random)
    o |= {"out_events": "true", "out_file": "e.h5"}
    if o["friction_law"] not in ("coulomb", "carlson-langer", "stribeck", "slip-weakening"):
        o["out_events_velocity"] = (o["model_v"] or 0.2) * 1.5
    return o


def draw_accuracy(random):
    o = draw_law(random, draw_medium(random, int(random.choice([1, 3, 12]))))
    return draw_start(random, o) | {"ts_max_time": random.uniform(3, 10), "accuracy": float(random.choice([1e-4, 1e-6])),
                                    "accuracy_seconds": 20}


def draw_sweep(random):
    o = draw_law(random, draw_medium(random, int(random.choice([1, 3]))), smooth=True)
    draw_start(random, o)
    name = "model_v"
    o.pop(name)
    return o | {"sweep_parameter1": name, "sweep_from1": random.uniform(0.1, 0.3), "sweep_to1": random.uniform(0.5, 1.),
                "sweep_points1": 3, "ts_max_time": random.uniform(3, 10), "out_file": "s.h5"}


def draw_chart(random):
    o = draw_law(random, draw_medium(random, int(random.choice([3, 12]))), smooth=True)
    draw_start(random, o)
    return o | {"ts_max_time": random.uniform(1, 3), "chart_methods": "rk:5dp,rk:3bs", "chart_tolerances": "1e-4,1e-6",
                "chart_repeats": 1, "chart_reference_seconds": 5}


def draw_fit(random):
    """A scene and points of its own course, moved off a little: the file is written in both units (see compare)."""
    o = {"model_form": "chain", "grid_n": 1, "bc_left": "free", "model_m": random.uniform(0.5, 2),
         "model_k0": random.uniform(0.2, 1), "model_zeta": random.uniform(0.2, 0.6), "model_f0": 1.,
         "model_v": random.uniform(0.3, 1), "init_psi": random.uniform(0.1, 0.5), "init_eta": random.uniform(-0.2, 0.2)}
    draw_law(random, o, smooth=True)
    t = np.linspace(0.5, 8, 16)
    o |= {"ts_max_time": 8., "fit_parameters": str(random.choice(["model_zeta", "model_m", "model_k0"])), "fit_starts": 1,
          "fit_data": [t, 0.5 + 0.3 * np.sin(t * random.uniform(0.3, 0.8))]}
    return o


def explore(scenes, draw, command, salt, short, tolerance=None):
    """`tolerance`: of what the command solves for; without it results are those of steps."""
    answered, bad, refused = 0, [], 0
    for index, (options, random) in scenes(lambda random: (draw(random), random), salt=salt, short=short):
        allowed = tolerance if tolerance is not None else max(RTOL, 2 * options.get("accuracy", 0)) * has_logarithms(options)
        code, report, one, other = compare(command, options, Rescaling(random, options), allowed)
        answered += code == 0
        refused += code == 2
        if report and code != 2:
            bad.append(f"scene {index}: stickslip {command} {' '.join(one)}\n  and {' '.join(other)}\n    " +
                       "\n    ".join(r[:400] for r in report[:6]))
        elif report and os.environ.get("UNITS_SHOW"):
            print(index, report, " ".join(words_for(options)))
    print(command, answered, "answered,", refused, "refused,", len(bad), "differ")
    assert not bad, "\n".join(bad)
    assert answered > 0
