"""The end of stick-slip (boundary_of) in random scenes against runs: one block of every law, started from strong slips 1 % on
either side of each end found and at places between; and cells of two blocks that move alike, whose end is that of one."""
import re

import h5py
import numpy as np

from calls import call, check, run
from reference import Law

FROM, TO = 0.1, 4.0
DEAD = {"sliding", "decaying"}


STICKING = ["carlson-langer", "coulomb", "healing"]
SMOOTH = ["smoothed", "smoothed coulomb", "cubic", "ageing", "slip"]


def draw(generator, kinds=STICKING + SMOOTH):
    kind = generator.choice(kinds)
    s = {"kind": str(kind), "model_m": generator.uniform(0.5, 2), "model_k0": generator.uniform(0.05, 1),
         "model_zeta": generator.uniform(0.05, 0.4), "from": FROM, "to": TO}
    if kind == "healing":
        s |= {"state_law": "healing", "state_t_h": generator.uniform(0.5, 2), "state_tau_inf": generator.uniform(1.2, 2),
              "state_D": generator.uniform(0.5, 2)}
    if kind.startswith("smoothed"):
        s |= {"friction_stick": "regularised", "friction_eps": generator.uniform(0.02, 0.1)}
    if kind in ("ageing", "slip"):  # no viscosity; the ageing law has a fold where the plate is slow
        a = generator.uniform(0.05, 0.1)
        s |= {"friction_law": "rate-and-state", "friction_a": a, "friction_b": a * generator.uniform(1.5, 2.5),
              "friction_D": generator.uniform(0.1, 0.3), "friction_mu0": 0.6, "friction_psi0": 1, "state_law": str(kind),
              "model_m": 1, "model_k0": generator.uniform(0.1, 0.5), "model_zeta": 0, "from": 0.01, "to": 1.0}
    else:
        s["friction_law"] = "coulomb" if "coulomb" in kind else "cubic" if kind == "cubic" else "carlson-langer"
    return s


def words(s):
    options = " ".join(f"-{key} {value}" for key, value in s.items() if "_" in key)
    return f"-model_form chain -grid_n 1 -bc_left free {options} "


def sticks(s):
    return s["kind"] in STICKING


def regime(s, v, lives):
    """Where a strong slip goes in time, from rest where friction sticks, else from ten friction forces above sliding; for longer
    where a motion that lives still loses amplitude, as it does beside a fold."""
    law = Law(s)
    force = law.force(v, law.steady(v))
    start = "-init_psi 0 -init_eta 0 " if sticks(s) else \
        f"-init_psi {v} -init_eta {s['model_zeta'] * v + force + 10 * (abs(force) + 1 / 3)} "
    period = 2 * np.pi * np.sqrt(s["model_m"] / s["model_k0"])
    time = 300 * period + 20 / (s["model_k0"] * v)
    word = run(words(s) + start + f"-model_v {v} -ts_max_time {time}")[0]["regime"]
    if lives and word == "decaying":
        word = run(words(s) + start + f"-model_v {v} -ts_max_time {4 * time}")[0]["regime"]
    return word


def along(s, more=""):
    """The points, and the function whose zeros stick-slip's are, as sampled (negative where it lives); none: no point."""
    done = call((words(s) + f"-boundary_parameter model_v -boundary_from {s['from']} -boundary_to {s['to']} -out_file b.h5 " +
                 more).split(), command="boundary")
    check(done.returncode in (0, 1) and done.stderr.count("\n") < 8, done.stderr)
    if done.returncode == 1:
        check(re.search("does not end|no boundary|nowhere", done.stderr), done.stderr)
        return None
    with h5py.File("b.h5") as file:
        of = [text.decode() for text in file["of"][...]]
        points = list(zip(file["value"][...], of, [text.decode() for text in file["kind"][...]]))
        return points, file["stick_slip_sample"][...], file["stick_slip_distance"][...]


def test_strong_slips_go_where_the_end_says(scenes):
    asked, open_words, ends = 0, 0, 0
    for index, s in scenes(draw, 71, short=1):
        found = along(s)
        if found is None:
            continue
        points, sample, distance = found
        growing = np.array([value for value, of, _ in points if of == "sliding"])
        places = [(v, d < 0) for v, d in list(zip(sample, distance))[3::12] if np.isfinite(d)]
        for value, of, kind in points:
            if of != "stick-slip":
                continue
            ends += 1
            below, above = np.flatnonzero(sample < value * 0.99), np.flatnonzero(sample > value * 1.01)
            check(below.size and below[-1] + 1 < sample.size, f"scene {index}: end at {value}")
            lives = bool(distance[below[-1]] < 0)
            if above.size:  # not so near the border of the range that nothing was looked at beyond
                check(lives != bool(distance[above[0]] < 0), f"scene {index}: {kind} at {value}: {s}")
            places += [(0.99 * value, lives), (1.01 * value, not lives)]
        for v, lives in places:
            if growing.size and np.min(np.abs(growing - v)) < 0.02 * v:
                continue  # so slow there that no run of this length decides
            word = regime(s, v, lives)
            asked += 1
            open_words += word in ("undecided", "growing")
            right = word == "stick-slip" if lives else word in DEAD
            check(right or word in ("undecided", "growing"), f"scene {index}: {word} at v = {v}, lives: {lives}, {points}: {s}")
    check(asked > 4 and ends > 0 and open_words <= 0.1 * asked, f"{asked} runs, {open_words} left open, {ends} ends")


def test_no_end_lies_on_the_border_of_the_range(request):
    # between the last two values that are asked the longest slip comes to graze rest otherwise, and stick-slip goes on
    table = ("-2.6183:-0.5593,-2.21:-0.529,-1.6375:-0.4511,-1.0725:-0.4784,-0.3683:-0.627,0.0:1.012,0.3683:0.7838,1.0725:0.598,"
             "1.6375:0.5639,2.21:0.6613,2.6183:0.6991")
    block = ("-model_form chain -grid_n 1 -bc_left free -model_m 1.195988 -model_k0 1.303791 -model_f0 0.607392 -model_zeta 0.213762 "
             f"-friction_law table -friction_table {table} -friction_table_beyond constant -state_law contact-age -state_D 1.559632 "
             "-state_theta0 1.571325 -model_v 0.490615 -boundary_parameter state_b -boundary_log true -boundary_of stick-slip ")
    ranges = ((0.5, 3.3), (3, 3.3), (0.5, 3.6))  # in the audit alone: 16 s each
    for begin, end in ranges if request.config.getoption("--scenes") else ():
        found, _ = run(block + f"-boundary_from {begin} -boundary_to {end}", code=None, command="boundary")
        assert all(p["residual"] < 1e-6 for p in found["points"] or []), found["points"]


def test_two_blocks_alike_end_as_one(scenes):
    """A cell of two coupled blocks from a start that is alike: where the end is that of the motion itself, not of its
    symmetry, it is the end of one block."""
    drawn, compared = 0, 0
    for index, s in scenes(lambda generator: draw(generator, STICKING), 72, short=0):  # in the audit alone: a few seconds each
        drawn += 1
        one = along(s, "-boundary_of stick-slip")
        if one is None:
            continue
        cell = words(s).replace("-grid_n 1 -bc_left free", "-grid_n 2 -model_k1 1e-3") + "-init_psi 0 -init_eta 0 -cycle_cell 2 "
        done, _ = run(cell + f"-boundary_of stick-slip -boundary_parameter model_v -boundary_from {s['from']} "
                      f"-boundary_to {s['to']}", code=None, command="boundary")
        for point in done["points"] or []:
            if point["kind"] in ("graze", "fold"):
                near = min(abs(value - point["value"]) for value, _, _ in one[0])
                check(near < 1e-6 * (s["to"] - s["from"]), f"scene {index}: {point} and {one[0]}: {s}")
                compared += 1
    check(compared > 0 or not drawn, f"an end of the motion itself among {drawn} scenes: draw more")


HEAVY = {
    "exact stick and viscosity": "-grid_n 4 -model_k0 0.3 -model_k1 0.4 -model_zeta 0.05 -model_nu 0.1 -friction_law carlson-langer "
                                 "-friction_alpha 0.5 -friction_sigma 0.1 -friction_spread 0.2 -friction_seed 3 -boundary_from 0.1 -boundary_to 1.2",
    "lugre": "-grid_n 3 -model_k0 0.2 -model_k1 0.6 -model_zeta 0.05 -friction_law lugre -friction_fc 0.7 -friction_fs 1 -friction_vs 0.1 "
             "-friction_sigma0 13 -friction_sigma1 0.3 -friction_spread 0.1 -boundary_from 0.05 -boundary_to 0.6",
    "rate and state": "-grid_n 4 -model_k0 0.2 -model_k1 0.4 -friction_law rate-and-state -friction_a 0.05 -friction_b 0.1 -friction_D 0.2 "
                      "-friction_mu0 0.6 -friction_spread 0.1 -boundary_from 0.1 -boundary_to 1"}


def test_searches_end_where_their_work_is_done(request):
    """They went on for minutes, or for ever. In the audit alone: 8 to 18 s each; with less work tests/test_budget.cpp."""
    for name, words in HEAVY.items() if request.config.getoption("--scenes") else ():
        done = call("-model_form chain -bc_left free -model_m 1 -model_f0 1 -init_psi 0.3 -init_noise 0.1 -model_v 0.2 "
                    f"-boundary_parameter model_v -boundary_of stick-slip -cycle_cell 0 {words}", command="boundary")
        check(done.returncode in (0, 1) and "ended by its budget of 3e+08 evaluations" in done.stderr, f"{name}: {done.stderr}")
