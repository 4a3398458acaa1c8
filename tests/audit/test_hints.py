"""What `boundary` says of an option along which the growth rate of sliding jumps to 0, or changes elsewhere only: blocks without
damping and random measured curves with flat parts, in any units. Sliding grows where the curve falls (its slope by SciPy's
PchipInterpolator), and is neither stable nor unstable where it is flat. No hint contradicts itself or points the wrong way."""
import json
import os
import re

import numpy as np
from scipy.interpolate import PchipInterpolator

from calls import call, check


def scene(random):
    """Velocities and forces of the curve, the options, the range."""
    unit = 10 ** random.uniform(-6, 3)  # of velocities
    v = unit * np.concatenate([[0], np.cumsum(random.uniform(0.3, 2, random.integers(4, 8)))])
    force = [random.uniform(0.5, 1)]
    for _ in v[1:]:
        force.append(force[-1] if random.random() < 0.35 else random.uniform(0.2, 1))
    force = np.array(force) * 10 ** random.uniform(-2, 4)
    words = (f"-model_form chain -grid_n 1 -bc_left free -model_m {10 ** random.uniform(-3, 3):.6g} -model_zeta 0 "
             f"-model_k0 {10 ** random.uniform(-3, 6):.6g} -model_f0 1 -friction_law table -friction_table_beyond constant "
             "-friction_table " + ",".join(f"{a:.12g}:{b:.12g}" for a, b in zip(v, force)))
    low, high = np.sort(random.uniform(0.02, 1.6, 2)) * v[-1]
    return v, force, words, low, max(high, 1.1 * low)


def compare(drawn, what):
    v, force, words, low, high = drawn
    what = f"{what}: {words} from {low} to {high}"
    curve = PchipInterpolator(v, force).derivative()
    scale = np.ptp(force) / v[-1] + 1e-300

    def sign(at):
        at = np.asarray(at, float)
        slope = np.where(at < v[-1], curve(np.minimum(at, v[-1])), 0)
        return np.where(abs(slope) < 1e-9 * scale, 0, -np.sign(slope))
    if os.path.exists("s.json"):
        os.remove("s.json")
    done = call(words.split() + ["-boundary_of", "sliding", "-boundary_parameter", "model_v", "-boundary_from", repr(float(low)),
                                 "-boundary_to", repr(float(high)), "-summary", "s.json"], command="boundary")
    text = done.stderr
    check(done.returncode in (0, 1), f"{what}: {text}")
    near = 1e-6 * (high - low)
    inside = np.linspace(low, high, 4001)
    signs = sign(inside)
    with open("s.json", encoding="utf-8") as file:
        points = [point["value"] for point in json.load(file).get("points") or []]
    for at in points:  # sliding changes there, or the growth rate is 0 at one alone of the 33 samples
        if not sign(at):
            continue
        check(len(set(sign([at - 100 * near, at - near, at + near, at + 100 * near]).tolist())) > 1, f"{what}: {at} is none: {text}")
    strict = [k for k in range(4000) if signs[k] * signs[k + 1] < 0]
    for k in strict:
        check(any(inside[k] - near <= at <= inside[k + 1] + near for at in points),
              f"{what}: nothing between {inside[k]} and {inside[k + 1]}: {points}, {text}")
    flat = [(float(a), float(b)) for a, b in re.findall(r"growth rate is 0 from model_v (\S+) to (\S+):", text)]
    for a, b in flat:
        check(not sign(np.linspace(a + 10 * near, b - 10 * near, 50)).any(), f"{what}: not 0 from {a} to {b}: {text}")
    runs = np.flatnonzero(signs == 0)
    for run in np.split(runs, np.flatnonzero(np.diff(runs) > 1) + 1):
        if len(run) > 400 and len(runs) < 4001:  # three samples at least
            check(any(a - 10 * near <= inside[run[200]] <= b + 10 * near for a, b in flat),
                  f"{what}: flat from {inside[run[0]]} to {inside[run[-1]]}: {text}")
    if "does not enter" in text:
        check(not signs.any() and "growth rate 0 at" in text, f"{what}: {text}")
    throughout = re.search(r"sliding is (\w+) throughout", text)
    if throughout:
        check(set(signs.tolist()) <= {1 if throughout[1] == "unstable" else -1, 0}, f"{what}: {text}")
    for a, b in re.findall(r"between (\S+) and ([^\s;,]+)(?=[;,\n ]|$)", text.split("it changes")[1] if "it changes" in text else ""):
        beyond = sign(np.linspace(float(a), float(b), 401))
        check(len(set(beyond.tolist())) > 1, f"{what}: no change between {a} and {b}: {text}")
    return len(strict), len(flat)


def test_hints_where_the_growth_rate_jumps(scenes):
    found = [compare(drawn, f"scene {index}") for index, drawn in scenes(scene, 6713, short=12)]
    check(any(a for a, _ in found) and any(b for _, b in found), "no change, or nothing flat, was drawn")
