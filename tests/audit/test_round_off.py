"""Implicit-explicit steps, short and many: what they gather is the round-off of as many sums, not that of differences
divided by the step. Against scipy, for every split, in chains drawn at random."""
from calls import data, run
from reference import System, read

SPLITS = ("wave", "both", "friction")


def draw(rng):
    """-> options of a run to t = 1, method, split, whether friction has a state"""
    n, v = int(rng.integers(2, 45)), rng.uniform(-1, 1)
    method = rng.choice(["3", "4", "5", "ars443", "l2"])
    split = SPLITS[rng.integers(3)]
    steep = split != "wave" and rng.random() < 0.4  # a law which the wave alone implicit leaves explicit
    options = f"-model_form chain -grid_n {n} -scene_reduce off -model_k0 {rng.uniform(0.2, 1)} -model_k1 {rng.uniform(0.2, 2)} "
    if steep:
        v = abs(v) + 0.1
        options += "-bc_left free -model_zeta 0.1 -friction_law rate-and-state -friction_a 0.3 -friction_b 0.5 -friction_D 0.4 " \
                   "-init_state 0.7 "
    else:
        ends = "periodic" if n > 2 and rng.random() < 0.5 else "free"
        options += f"-bc_left {ends} -model_zeta {rng.uniform(0, 0.4)} -model_m {rng.uniform(0.5, 2)} "
    start = f"-init_psi {0.6 if v > 0 else -0.6} -init_eta 0.1 -init_noise 0.2 -init_seed {rng.integers(1000)}"
    return f"{options} {start} -model_v {v}", method, split, steep


def end_of(options, frame=-1):
    run(f"{options} -ts_max_time 1 -out_frames 2 -out_series false -out_file round_off.h5")
    return read(data("round_off.h5"), frame)


def test_short_steps(scenes):
    """From 300 to 10 000 steps the error falls with the order of the method, to what so many roundings leave."""
    for index, (options, method, split, state) in scenes(draw, 51, 3):
        how = f"{options} -ts_type arkimex -ts_arkimex_type {method} -imex_implicit {split}"
        exact = System(options).follow(end_of(options + " -ts_max_steps 1", 0), 0, 1, rtol=1e-13, atol=1e-15)
        size = abs(exact).max()
        errors = {}
        for steps in (300, 10000):
            errors[steps] = abs(end_of(f"{how} -ts_adapt_type none -ts_dt {1 / steps!r}") - exact).max() / size
        order = 2 if method == "l2" else 3
        # a steep law's equations are solved to 1e-13 a step
        expected = errors[300] / 30**order + (2e-9 if state and split == "both" else 2e-11)
        assert errors[10000] < 3 * expected, f"scene {index}: errors {errors}, at most {expected} was due: {how}"
        if method in ("ars443", "l2"):
            continue
        found = {t: abs(end_of(f"{how} -ts_rtol {t} -ts_atol {t}") - exact).max() / size for t in (1e-12, 1e-13)}
        assert found[1e-13] < max(1.05 * found[1e-12], 5e-12), f"scene {index}: errors by tolerance {found}: {how}"
