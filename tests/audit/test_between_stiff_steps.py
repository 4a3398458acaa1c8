"""Values between the steps of methods that take stiff friction implicitly, on blocks ever lighter, against SciPy's Radau."""
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
    """A step errs by 1e-6 of psi and of v in the mean over all unknowns, at worst in one of them alone. Before values came from a
    step of their own, a cubic through slopes gave psi of frames any sign, by 1/m."""
    for index, (p, method) in scenes(creeping, salt=132, short=7):
        end = p["ts_max_time"]
        noise = [] if p["grid_n"] == 1 else ["-init_noise", str(0.1 * p["init_psi"]), "-init_seed", str(index + 1)]
        s, _ = run(words(p) + noise + method + ["-ts_atol", str(1e-6 * p["model_v"]), "-out_file", "s.h5", "-out_frames", "40"])
        file = data("s.h5")
        p["init_psi"] = file["psi"][0]
        psi = motion(p, np.r_[file["t"][:-1], end], 1e-9)
        off = np.abs(file["psi"] / psi - 1).max(axis=1)
        allowed = 2e-6 * np.sqrt(3 * p["grid_n"]) * s["steps"]
        check(off.max() < allowed, f"scene {index}: psi off by {off.max()} of it at frame {off.argmax()}, {method}, {p}")
