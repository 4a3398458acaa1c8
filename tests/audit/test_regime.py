"""The word for the motion of a run against what the scene does in truth: random blocks, small chains and small rings
near their threshold, integrated by scipy three times as long as the run. A definite word (sliding, stick-slip, stuck)
must never be contradicted by what comes later, what decays must not be larger later, and the linear
growth rate must be that of the dispersion relation."""

import numpy as np
from scipy.integrate import solve_ivp

from calls import data, run
from reference import Stick, System, read, words

from . import sliding

LATER = 3


def draw(generator):
    """A scene with the damping C = A (B + phi'(v)) + s delta of its sliding drawn, either sign, over three decades, from
    psi = v (1 + size), everything else steady: options, size, C."""
    kind = generator.choice(["block", "chain", "ring", "sticking"])
    C, size = generator.choice([-1, 1]) * 10 ** generator.uniform(-2.7, -0.3), 10 ** generator.uniform(-2.5, 0.2)
    n = {"block": 1, "sticking": 1, "chain": int(generator.integers(2, 7)), "ring": int(generator.integers(9, 17))}[kind]
    k0, k1, seed = generator.uniform(0.1, 1), generator.uniform(0.1, 1), int(generator.integers(1, 99))
    p = {"grid_n": n, "scene_reduce": "off"}
    if kind == "ring":  # gamma (v^2 - 1) + delta
        gamma, delta = generator.uniform(0.3, 3), generator.uniform(0, 0.2)
        v = np.sqrt(max(0.05, 1 + (C - delta) / gamma))
        C = gamma * (v**2 - 1) + delta
        p |= {"model_gamma": gamma, "model_delta": delta, "grid_length": n / 2, "grid_order": 2, "init_type": "sine",
              "init_amplitude": 0.3 * size * v}
    else:  # carlson-langer: phi' = -1/(1 + v)^2
        v = 10 ** generator.uniform(-1.5, 0.3) if kind == "sticking" else generator.uniform(0.3, 1.4)
        slope = -1 / (1 + v)**2 if kind == "sticking" else v**2 - 1
        zeta = max(0., C - slope)
        C = zeta + slope
        p |= {"model_form": "chain", "bc_left": "free", "model_zeta": zeta, "model_k0": k0, "model_k1": k1,
              "friction_law": "carlson-langer" if kind == "sticking" else "cubic", "init_noise": 0.1 * size * v, "init_seed": seed}
    p |= {"model_v": float(v), "init_psi": float(v + size * v)}
    # ten to fifteen turns of the slowest mode, and half of the scenes four times that
    system = System(p)
    turns = generator.uniform(10, 15) * generator.choice([1, 1, 4])
    p |= {"init_eta": float(system.steady[n]), "ts_max_time": float(min(turns * 2 * np.pi / np.sqrt(system.A * system.K0), 120))}
    return p, size, C


def truth(p, u):
    """Times LATER times as long as the run, and the largest |psi - v|/v then."""
    system, end = System(p), LATER * p["ts_max_time"]
    t = np.linspace(0, end, int(6 * end))
    if not system.law.sticks:
        psi = solve_ivp(system.rates, (0, end), u, t_eval=t, method="DOP853", rtol=1e-7, atol=1e-9).y[:system.n]
    else:
        motion = Stick(system, u, rtol=1e-8, atol=1e-11, max_step=0.5)
        motion.advance(end)
        t, psi = (np.array([segment[k] for segment in motion.segments]) for k in (1, 4))
        psi = psi[:, :system.n].T
    return t, np.abs(psi / system.p["model_v"] - 1).max(axis=0)


def growth(p, C):
    """Of sliding: lambda^2 + C lambda + A (K0 + K1 kappa^2), over all wavenumbers of the grid."""
    n, system = p["grid_n"], System(p)
    kappa2 = (16 * np.sin(np.pi * np.arange(n) / n) ** 2 if "grid_length" in p else
              4 * np.sin(np.pi * np.arange(n) / (2 * n)) ** 2)
    return max(np.roots([1, C, system.A * (system.K0 + system.K1 * k)]).real.max() for k in kappa2)


def test_words(scenes):
    """Every scene's word against the years after it."""
    for index, (p, begin, C) in scenes(draw, 161, short=5):
        out, _ = run([*words(p), "-out_file", "run.h5", "-out_frames", 2])
        t, size = truth(p, read(data("run.h5"), 0))  # from the program's own first frame: the start is not what is tested
        word, end, rate = out["regime"], p["ts_max_time"], growth(p, C)
        said = f"scene {index}: {word}, rate {out['regime_rate']}, growth {out['growth_rate']}: {p}"
        last = size[t > (LATER - 0.25) * end].max()
        during = size[(t > 0.75 * end) & (t <= end)].max()
        np.testing.assert_allclose(out["growth_rate"], rate, rtol=1e-9, atol=1e-12, err_msg=said)
        if word == "sliding":
            assert last < 0.015 and during < 0.06, f"{said}: {during}, later {last}"
        elif word == "stick-slip":
            assert last > 0.04, f"{said}: {during}, later {last}"
        elif word == "decaying":  # against where it came from; what grew may have arrived, and swing there
            before, soon = size[(t > end / 4) & (t <= end / 2)].max(), size[(t > 1.5 * end) & (t <= 2 * end)].max()
            assert soon < 1.02 * before, f"{said}: {before}, later {soon}"
        # Where the linear rate leads from the start to within 1 % and on by three e-foldings in half of the run, and
        # that is where it goes in truth, the word is there; an unstable block likewise, left by all but its cycle.
        foldings = abs(rate) * end / 2 - abs(np.log(begin / 0.01)) - 3
        if rate < 0 < foldings and last < 1e-3:
            assert word == "sliding", f"{said}: {during}, later {last}"
        if rate > 0 and p["grid_n"] == 1 and foldings > np.log(100):
            assert word == "stick-slip", f"{said}: {during}, later {last}"
        assert (out["time_to_decide"] is None) == (word in ("sliding", "stick-slip", "stuck")), said
        if out["time_to_decide"] is not None:
            assert out["time_to_decide"] > end, said


def draw_short_line(random):
    """A few nodes of any law and state law, regularised thresholds among them, most beside held ends or spread, to the left
    or to the right, from near sliding or far off, for five to thirty turns of the slowest mode."""
    nodes = int(random.integers(3, 9))
    p = sliding.scene(random, least=nodes, most=nodes + 1, form=("chain", "chain", "continuum")[random.integers(3)])
    if p["model_form"] == "continuum":
        p |= {"grid_length": random.uniform(2, 8), "grid_n": 2 * p["grid_order"] + int(random.integers(2, 12))}
    if random.random() < 0.3:
        p |= {name: -p[name] for name in p if name == "model_v" or name.startswith("bc_") and name.endswith("value")}
    if p["friction_law"] in ("coulomb", "carlson-langer") and random.random() < 0.7:
        p |= {"friction_stick": "regularised", "friction_eps": random.uniform(0.02, 0.2)}
        if p["friction_law"] == "coulomb":
            p["friction_slip_velocity"] = random.uniform(0.1, 1)
    if random.random() < 0.3:
        p["model_nu"] = 10**random.uniform(-2, -0.3)
    turn = 2 * np.pi / np.sqrt(p["model_k0"] / p["model_m"] if "model_m" in p else 1)
    start = {"init_psi": float(p["model_v"] * random.uniform(0.3, 2.5)), "init_eta": "steady",
             "init_noise": float(abs(p["model_v"]) * 10**random.uniform(-3, -0.5)), "init_seed": int(random.integers(999)),
             "scene_reduce": "off"}
    return p, start, float(turn * random.choice([5, 12, 30]) * random.uniform(0.7, 1.3))


def test_words_of_short_lines(scenes):
    """What slides or decays is not larger in a run four times as long, and does so beside sliding from which no wave of the
    scene grows: by every eigenvalue of its matrix."""
    looked_at = 0
    for index, (p, start, end) in scenes(draw_short_line, 162, short=5):
        scene = words(p | start)
        out, _ = run(["-ts_max_time", end, *scene])
        if out["regime"] not in ("sliding", "decaying"):
            continue
        looked_at += 1
        said = f"scene {index}: {out['regime']}, rate {out['regime_rate']}: {' '.join(scene)} -ts_max_time {end}"
        later, _ = run(["-ts_max_time", 4 * end, *scene])
        near = 0.01 * abs(p["model_v"]) if out["regime"] == "sliding" else 0
        assert later["amplitude"] <= max(near, 1.02 * out["amplitude"]), f"{said}: later {later['amplitude']}"
        matrix, _ = run(["-spectrum_refine", "off", *words(p)], command="spectrum", code=None)
        assert not matrix or matrix["growth_rate"] is None or matrix["growth_rate"] < 1e-9, f"{said}: {matrix['growth_rate']}"
    assert looked_at > 0
