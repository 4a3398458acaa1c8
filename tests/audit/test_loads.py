"""Loads drawn at random, of either direction, with corners, steps and sines: the balance of energy of runs of either kind of
friction, and the order of every method and split against scipy."""
import numpy as np

import calls
from reference import DEFAULTS, Plate, System, options, read


def draw_load(rng, end):
    size = rng.uniform(0.2, 1.5)
    kind = rng.integers(3)
    points = []
    if kind != 0:
        for t in np.sort(rng.uniform(0 if rng.random() < 0.5 else -end / 4, end, rng.integers(1, 6))):
            t = 0.0 if t < 0 else round(float(t), 6)
            points += [(t, round(float(v), 6)) for v in size * rng.uniform(-1, 1, 1 if rng.random() < 0.5 else 2)]
        points = [p for i, p in enumerate(points) if sum(q[0] == p[0] for q in points[:i]) < 2]
    sine = (size * rng.uniform(0.1, 0.8), rng.uniform(0.3, 2) * end) if kind != 1 else (0, 1)
    table = ",".join(f"{t}:{v}" for t, v in points)
    return f"-model_v {rng.uniform(-1, 1) * size} " + (f"-load_v {table} " if table else "") + \
        (f"-load_sine_amplitude {sine[0]} -load_sine_period {sine[1]} " if sine[0] else "")


def draw_balance(rng):
    """Chains and continua without a held end. -> options, end, nodes, what psi adds to the sum of forces"""
    end, n = rng.uniform(4, 10), int(rng.integers(2, 9))
    load = draw_load(rng, end)
    law = rng.choice(["cubic", "coulomb", "regularised", "carlson-langer"])
    friction = {"cubic": "-friction_law cubic", "coulomb": "-friction_law coulomb",
                "regularised": "-friction_law coulomb -friction_stick regularised -friction_eps 0.1",
                "carlson-langer": f"-friction_law carlson-langer -friction_alpha {rng.uniform(0.3, 2)} -friction_sigma 0.1"}[law]
    ends = rng.choice(["-bc_left free -bc_right free", "-bc_left periodic"])
    if rng.random() < 0.6:
        f0 = rng.uniform(0.5, 2)
        medium = f"-model_form chain -model_m {rng.uniform(0.5, 2)} -model_f0 {f0} -model_k0 {rng.uniform(0.2, 1)} " \
                 f"-model_k1 {rng.uniform(0.1, 1)} -model_zeta {rng.uniform(0, 0.4)}"
        damping = 0
    else:
        n, delta, gamma = max(n, 7), rng.uniform(0, 0.5), rng.uniform(1, 4)
        medium = f"-model_gamma {gamma} -model_delta {delta} -model_c {rng.uniform(0.3, 1)} -grid_length {rng.uniform(2, 6)} " \
                 "-grid_order 2"
        ends, damping = "-bc_left periodic", delta / gamma
    return f"{medium} -grid_n {n} {friction} {ends} {load} -init_psi {rng.uniform(-0.5, 0.5)} -init_eta " \
           f"{rng.uniform(-0.5, 0.5)} -init_noise 0.2 -init_seed {rng.integers(1000)} -scene_reduce off", end, n, damping


def test_the_energy_balance(scenes):
    """The work of the plate is the force on all blocks over its way, whatever steps v(t) takes: trapezoids in its way."""
    for index, (scene, end, n, damping) in scenes(draw_balance, 41, 5):
        load = Plate(DEFAULTS | options(scene))
        calls.run(f"{scene} -ts_max_time {end} -ts_type rk -ts_adapt_type none -ts_dt 0.004 -out_displacement -out_frames 2 "
                  "-out_file balance.h5")
        s = {name[7:]: values for name, values in calls.data("balance.h5").items() if name.startswith("series/")}
        t = s["t"]
        force = n * (s["eta_mean"] + damping * s["psi_mean"])
        # each row with the velocity of its own time: of the step that ends there, of the first row that which begins
        inside = [0, *((t[1:] + t[:-1]) / 2)]
        v = np.array([load.after(middle)(at) for middle, at in zip(inside, t)])
        scale = np.abs(force).max() * np.abs(v).max() + 1e-300
        cell = s["power_input"] / np.where(v == 0, 1, v) / np.where(force == 0, 1, force)
        cell = np.median(cell[(np.abs(v) > 1e-3) & (np.abs(force) > 1e-3)])
        off = np.abs(s["power_input"] - cell * v * force).max() / (cell * scale)
        assert off < 1e-9, f"scene {index}: power_input is off by {off} of its size at t = {t[np.argmax(off)]}: {scene}"
        lost = s["power_friction"] + s["power_viscous"]
        energy = s["energy_kinetic"] + s["energy_elastic"]
        size = energy.max() + np.abs(s["power_input"]).max() * end

        def gap(rows):
            """By trapezoids between these rows, whose error is of the square of their distance."""
            way = [load.way(b, a) for a, b in zip(t[rows], t[rows][1:])]
            mean = lambda of: (of[rows][1:] + of[rows][:-1]) / 2  # noqa: E731
            return abs(energy[-1] - energy[0] - cell * np.sum(mean(force) * way) + np.sum(mean(lost) * np.diff(t[rows]))) / size
        whole, half = gap(np.arange(len(t))), gap(np.unique([*range(0, len(t), 2), len(t) - 1]))
        assert whole < max(2e-5, half / 2), f"scene {index}: {whole} of the energy is missing: {scene}"


METHODS = [("rk", name, order, "") for name, order in (("5dp", 5), ("3bs", 3), ("5f", 5), ("5bs", 5), ("6vr", 6), ("2a", 2),
                                                       ("2b", 2), ("3", 3), ("4", 4), ("1fe", 1))]
METHODS += [("ssp", name, order, "") for name, order in (("rks2", 2), ("rks3", 3), ("rk104", 4))]
METHODS += [("arkimex", name, order, split) for name, order in
            (("3", 3), ("4", 4), ("5", 5), ("2c", 2), ("2d", 2), ("2e", 2), ("a2", 2), ("l2", 2), ("ars122", 2), ("1bee", 1),
             ("ars443", 3), ("prssp2", 2)) for split in ("friction", "wave", "both")]
METHODS += [("bdf", name, min(int(name), 2), "") for name in "123456"]
METHODS += [(name, "", order, "") for name, order in (("euler", 1), ("theta", 2), ("cn", 2), ("beuler", 1), ("alpha", 2),
                                                      ("leapfrog", 2))]
SUBTYPES = {"rk": "-ts_rk_type", "ssp": "-ts_ssp_type", "arkimex": "-ts_arkimex_type",
            "bdf": "-ts_bdf_order"}


def method_options(method):
    kind, name, _, split = method
    tight = "-snes_rtol 1e-13 -snes_atol 1e-15" if kind in ("bdf", "theta", "cn", "beuler", "alpha") and not split else ""
    return f"-ts_type {kind} " + (f"{SUBTYPES[kind]} {name} " if name else "") + \
        (f"-imex_implicit {split} " if split else "") + tight


def orders_of(scene, method, h):
    """Orders between steps h, h/2 and h/4, and the errors after 32 steps of h."""
    end, errors, exact = 32 * h, [], None
    for k in range(3):
        calls.run(f"{scene} -ts_max_time {end!r} {method_options(method)} "
                  f"-ts_adapt_type none -ts_dt {h / 2**k!r} -out_frames 2 -out_file order.h5")
        found = calls.data("order.h5")
        if exact is None:
            exact = System(scene).follow(read(found, 0), 0, end, rtol=1e-13, atol=1e-14)
        errors.append(abs(read(found, -1) - exact).max())
    return [np.log2(a / b) for a, b in zip(errors, errors[1:])], errors


def draw_order(rng):
    n = int(rng.integers(2, 5))
    ends = "periodic" if n > 2 and rng.random() < 0.5 else "free"
    k0, k1, zeta, m = *rng.uniform(0.3, 1, 2), rng.uniform(0, 0.4), rng.uniform(0.6, 1.5)
    return f"-model_form chain -grid_n {n} -bc_left {ends} -model_k0 {k0} -model_k1 {k1} -model_zeta {zeta} -model_m {m} " \
        f"-model_v {rng.uniform(-0.8, 0.8)} -load_sine_amplitude {rng.uniform(0.2, 0.5) * rng.choice([-1, 1])} " \
        f"-load_sine_period {rng.uniform(1.5, 4)} -init_psi {rng.uniform(-0.6, 0.6)} -init_eta {rng.uniform(-0.3, 0.3)} " \
        f"-init_noise 0.3 -init_seed {rng.integers(1000)} -scene_reduce off", METHODS[rng.integers(len(METHODS))]


def check_order(index, scene, method):
    order = method[2]
    h = {1: 1 / 64, 2: 1 / 48, 3: 1 / 24, 4: 1 / 16}.get(order, 1 / 8)
    orders, errors = orders_of(scene, method, h)
    if max(orders) <= order - 0.35 and orders[1] > orders[0]:  # on its way there
        orders, errors = orders_of(scene, method, h / 2)
    assert max(orders) > order - 0.35 or errors[-1] < 1e-11, \
        f"scene {index}: {method} has orders {orders} under a load, errors {errors}: {scene}"


def test_orders_of_all_methods(scenes):
    for index, (scene, method) in scenes(draw_order, 43, 4):
        check_order(index, scene, method)
