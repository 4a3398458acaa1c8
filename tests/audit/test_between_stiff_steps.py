"""Values between the steps of methods that take stiff friction implicitly, on blocks ever lighter, against laboratory.cpp."""
import numpy as np

from calls import check, data, run
from laboratory import draw, motion
from reference import words

METHODS = ["", "-imex_implicit both", "-ts_type arkimex -ts_arkimex_type 4", "-ts_type arkimex -ts_arkimex_type 5", "-ts_type rosw",
           "-ts_type arkimex -snes_max_it 60"]


def creeping(generator):
    """Sliding that a disturbance dies away from, above the critical stiffness, which inertia raises by 1 + m v^2/(f0 a D): psi stays
    near v, and steps are long. The mass is down to 1e-12 of that with which inertia would matter."""
    p = draw(generator, most_blocks=6)
    weakening = p["model_f0"] * (p["friction_b"] - p["friction_a"]) / p["friction_D"]
    mass = 10 ** generator.uniform(-12, 0)
    critical = weakening * (1 + mass * (p["friction_b"] / p["friction_a"] - 1))
    p |= {"model_k0": critical * generator.uniform(1.1, 3), "model_k1": critical * generator.uniform(0.1, 3),
          "model_m": mass * weakening * (p["friction_D"] / p["model_v"]) ** 2,
          "model_zeta": 10 ** generator.uniform(-6, -1) * p["model_f0"] * p["friction_a"] / p["model_v"],
          "init_psi": p["model_v"] * generator.uniform(0.7, 1.3), "ts_max_time": 40 * p["friction_D"] / p["model_v"]}
    return p, str(generator.choice(METHODS)).split()


def test_frames_are_as_good_as_steps(scenes):
    """A step errs by 1e-6 of an unknown, and of v in psi, in the mean over all unknowns, at worst in one of them alone; friction makes
    (mu0 + b)/a times as much in ln psi of what eta or the state is off by. What a step began with may turn in it, by less than 1.7,
    and then be 1.5 times as large in between as at both ends. Before values came from a step of their own, a cubic through slopes gave psi of frames any sign, by 1/m,
    and those of arkimex:5 were off by up to twice what its steps were."""
    for index, (p, method) in scenes(creeping, salt=132, short=12):
        end = p["ts_max_time"]
        noise = [] if p["grid_n"] == 1 else ["-init_noise", str(0.1 * p["init_psi"]), "-init_seed", str(index + 1)]
        s, _ = run(words(p) + noise + method + ["-ts_atol", str(1e-6 * p["model_v"]), "-out_file", "s.h5", "-out_frames", "40",
                                         "-out_probes", ",".join(map(str, range(p["grid_n"])))])
        file = data("s.h5")
        p["init_psi"] = file["psi"][0]
        off, at_ends = (np.abs(psi / motion(p, np.minimum(t, end), 1e-10) - 1).max(axis=1)
                        for t, psi in ((file["t"], file["psi"]), (file["probes/t"], file["probes/psi"])))
        of_step = 2e-6 * np.sqrt(3 * p["grid_n"]) * (1 + (p["friction_mu0"] + p["friction_b"]) / p["friction_a"])
        check(at_ends.max() < of_step * s["steps"], f"scene {index}: psi off by {at_ends.max()} of it at steps, {method}, {p}")
        check(off.max() < 1.5 * at_ends.max() + 2e-6 * np.sqrt(3 * p["grid_n"]),
              f"scene {index}: psi off by {off.max()} of it at frame {off.argmax()}, {at_ends.max()} at steps, {method}, {p}")
