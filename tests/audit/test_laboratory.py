"""Rate-and-state sliders with what laboratories and faults have, without mass and with, against laboratory.cpp in ln psi and ln
theta."""
import numpy as np
import pytest

from calls import check, data, run
from laboratory import draw, passages
from reference import words



def start(p, index):
    """The options with psi of each block at the start, and what the program is to be told beside them."""
    noise = [] if p["grid_n"] == 1 else ["-init_noise", str(0.1 * p["init_psi"]), "-init_seed", str(index + 1)]
    run(words(p | {"ts_max_time": p["friction_D"] / p["model_v"]}) + noise + ["-out_file", "start.h5", "-out_times", "0"])
    return p | {"init_psi": data("start.h5")["psi"][0]}, noise


def massive(generator):
    """A scene with mass: what draw() has without one is drawn again."""
    while True:
        p = draw(generator)
        if p["model_m"] > 0:
            return p


@pytest.mark.parametrize("drawn, short", ((lambda generator: draw(generator, with_mass=False), 1), (massive, 1)), ids=("none", "mass"))
def test_period_of_stick_slip(scenes, drawn, short):
    """A slip drops the force by some 20 f0 (b - a), and the plate loads it with k0 v. An error in ln psi of a step, 1e-6, is one
    of 1e-6 a in a force that moves by 20 (b - a): where the reference repeats, the period is right to 1e-5. psi at the
    reference's passages tells how much earlier or later the program passes."""
    compared = 0
    for index, p in scenes(drawn, salt=131, short=short):
        p["ts_max_time"] = 160 * p["model_f0"] * (p["friction_b"] - p["friction_a"]) / (p["model_k0"] * p["model_v"])
        exact, noise = start(p, index)
        repeats = passages(exact, p["ts_max_time"], 1e-9)
        if repeats is None:
            continue
        late, rise = repeats
        compared += 1
        times = ",".join(repr(float(t)) for t in late)
        run(words(p) + noise + ["-out_file", "s.h5", "-out_times", times])
        early = np.log(data("s.h5")["psi"][:, 0] / p["model_v"]) / rise
        off = (early[-1] - early[0]) / (late[-1] - late[0])
        check(abs(off) < 1e-5, f"scene {index}: the period is {off} of it too short, {p}")
    check(compared > 0, "no scene repeats")
