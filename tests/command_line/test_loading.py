"""The plate's velocity as a function of time: against scipy, piece by piece; orders at fixed steps across corners; the
time at which a resting block begins to slip in closed form; displacement; restart; what is refused."""
import math
import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp, trapezoid
from scipy.optimize import brentq

from calls import check, data, refused, run, scene_file
from reference import DEFAULTS, Plate, System, options, read

# ramp, hold, jump, ramp down, and a sine on top
LOAD = "-load_v 0.37:0.5,1.1:0.9,2.03:0.9,2.03:0.3,3.3:0.7 -load_sine_amplitude 0.15 -load_sine_period 1.7 "
PLATE = Plate(DEFAULTS | options(LOAD))
CORNERS = [t for t, _ in PLATE.points]


METHODS = ["", "-ts_type rk", "-ts_type rk -rk_fused false", "-ts_type arkimex -imex_implicit friction -rk_fused false",
           "-ts_type arkimex -imex_implicit wave", "-ts_type arkimex -imex_implicit both", "-ts_type bdf"]


def test_against_scipy():
    scene = ("-model_form chain -bc_left free -grid_n 3 -model_k0 0.3 -model_k1 0.7 -model_zeta 0.1 -friction_law rate-and-state "
             f"-friction_a 0.3 -friction_b 0.5 -friction_D 0.4 {LOAD}")
    exact = System(scene).follow(np.repeat([0.4, 0.5, np.log(0.7)], 3), 0, 4, rtol=1e-13, atol=1e-14)
    for method in METHODS:
        run(f"{scene} -init_psi 0.4 -init_eta 0.5 -init_state 0.7 -ts_max_time 4 {method} -ts_rtol 1e-9 -ts_atol 1e-9 "
            "-out_file run.h5 -out_frames 2")
        found = data("run.h5")
        error = abs(read(found, -1) - exact).max()
        check(error < 1e-6, f"{method}: {error}")
        times = found["series/t"]
        check(all(np.min(abs(times - t)) == 0 for t in CORNERS), f"{method}: no step ends at a corner")


def test_a_belt_whose_speed_varies():
    """A mass on a belt of speed V(t), a spring and a damper to the wall, is the block of a plate at V + (d/k) V' + (M/k) V''."""
    mass, spring, damper, speed, swing, omega = 0.7, 1.3, 0.2, 0.6, 0.25, 2 * math.pi / 3.1
    shift = 1 - mass * omega**2 / spring + 1j * damper * omega / spring  # the plate's sine over the belt's, which lags
    belt = lambda t: speed + (swing / shift * np.exp(1j * omega * t)).imag  # noqa: E731
    end, slope = 7, (swing / shift * 1j * omega * np.exp(1j * omega * np.array([0, 7]))).imag
    friction = lambda psi: 0.8 * np.tanh(psi / 0.3)  # noqa: E731
    u, w = solve_ivp(lambda t, y: [(-spring * y[1] + friction(belt(t) - y[0]) - damper * y[0]) / mass, y[0]], (0, end), [0.1, 0.2],
                     rtol=1e-12, atol=1e-13).y[:, -1]
    begin = belt(0) - 0.1, spring * 0.2 + damper * belt(0) + mass * slope[0]
    run(f"-model_form chain -grid_n 1 -bc_left free -model_m {mass} -model_k0 {spring} -model_zeta {damper} -model_v {speed} "
        f"-load_sine_amplitude {swing} -load_sine_period 3.1 -friction_law tanh -friction_fc 0.8 -friction_vs 0.3 -init_psi {begin[0]!r} "
        f"-init_eta {begin[1]!r} -ts_max_time {end} -ts_rtol 1e-11 -ts_atol 1e-11 -out_file belt.h5 -out_frames 2")
    psi, eta = read(data("belt.h5"), -1)
    exact = belt(end) - u, spring * w + damper * belt(end) + mass * slope[1]
    check(np.allclose((psi, eta), exact, rtol=0, atol=1e-8), f"{psi, eta}, not {exact}")


ORDERS = [("-ts_type rk -ts_rk_type 5dp", 5, 0.1),
          ("-ts_type arkimex -ts_arkimex_type 4 -imex_implicit friction", 4, 0.1),
          ("-ts_type arkimex -ts_arkimex_type 3 -imex_implicit wave", 3, 0.05),
          ("-ts_type bdf -ts_bdf_order 2", 2, 0.02)]


def test_orders():
    # the cubic on a ring of four; frames too, between the steps
    scene = f"-model_form chain -grid_n 4 -model_k0 0.5 -model_k1 0.6 {LOAD}"
    start = np.concatenate([0.1 + 0.5 * np.sin(np.pi / 2 * np.arange(4)), np.full(4, 0.1)])
    exact, between = (System(scene).follow(start, 0, end, rtol=1e-13, atol=1e-14) for end in (4, 2.5))
    for method, order, h in ORDERS:
        errors = []
        for step in (h, h / 4):
            run(f"{scene} -init_type sine -scene_reduce off {method} -ts_adapt_type none -ts_dt {step} -ts_max_time 4 -snes_rtol 1e-13 -snes_atol 1e-15 -ts_rtol 1e-11 -ts_atol 1e-11 -out_times 2.5,4 "
                "-out_file run.h5")
            found = data("run.h5")
            errors.append([abs(found["psi"][i] - u[:4]).max() for i, u in ((-1, exact), (0, between))])
        for name, one in zip(("end", "frame"), np.array(errors).T):
            rate = math.log2(one[0] / one[1]) / 2
            check(rate > min(order, 4 if name == "frame" else order) - 0.4, f"{method}: order {rate:.2f} at the {name}, errors {one}")


def first_slip(options):
    s, _ = run("-model_form chain -grid_n 1 -bc_left free -friction_law coulomb -friction_fs 0.6 -friction_fd 0.3 -model_k0 0.4 "
               f"-init_psi 0 -init_eta 0 -ts_max_time 60 -out_file stick.h5 {options}")
    series = data("stick.h5")
    moves = np.flatnonzero(abs(series["series/psi_max"]) > 0)
    return series["series/t"][moves[0] - 1], s


def test_release_under_load():
    # At rest eta = K0 X(t): the block begins to slip where that is its threshold, whatever the load does on the way there.
    exact = brentq(lambda t: 0.4 * PLATE.way(t) - 0.6, 0.1, 4)
    found, s = first_slip(LOAD)
    check(abs(found - exact) < 1e-9, f"{found} for {exact}")
    check(s["regime"] == "undecided" and "load" in s["regime_reason"], f"regime {s['regime']}")
    # an oscillation about rest: nothing for many periods, then the mean has brought it there
    def eta(t):
        return 0.4 * (0.03 * t + 0.5 * 2 / math.pi * math.sin(math.pi * t / 2) ** 2)
    found, _ = first_slip("-model_v 0.03 -load_sine_amplitude 0.5 -load_sine_period 2")
    times = np.linspace(0, 60, 600001)
    first = times[np.argmax(eta_array(times) >= 0.6)]
    exact = brentq(lambda t: eta(t) - 0.6, first - 1e-3, first)
    check(abs(found - exact) < 1e-9, f"{found} for {exact}")
    # a hold, and a threshold that heals meanwhile: the second pull meets more
    found, _ = first_slip("-state_law healing -state_t_h 5 -state_tau_inf 2 -init_state 1 -load_v 0:0.3,3:0.3,3:0,20:0,20:0.3")

    def excess(t):
        pulled = 0.3 * (min(t, 3) + max(t - 20, 0))
        return 0.4 * pulled - 0.6 * (2 - math.exp(-t / 5))
    exact = brentq(excess, 20, 60)
    check(abs(found - exact) < 1e-9, f"healing: {found} for {exact}")


def eta_array(t):
    return 0.4 * (0.03 * t + 0.5 * 2 / np.pi * np.sin(np.pi * t / 2) ** 2)


def test_displacement():
    # f0 eta = k0 (X - chi) of one block, X the integral of v(t)
    run(f"-model_form chain -grid_n 1 -bc_left free -model_k0 0.4 {LOAD} -ts_max_time 4 -out_times 0.2,1,2.03,2.7,4 -out_file chi.h5 "
        "-out_displacement true")
    found = data("chi.h5")
    for i, t in enumerate(found["t"]):
        check(abs(found["chi"][i, 0] - (PLATE.way(t) - found["eta"][i, 0] / 0.4)) < 1e-10, f"chi at {t}")
    times, v = found["series/t"], found["series/v"]
    for t, value in zip(times, v):  # at a corner that of the piece that ends
        begin = max([0.0] + [c for c in CORNERS if c < t])
        check(abs(value - PLATE.after(begin)(t)) < 1e-13, f"v({t}) = {value}")


def test_restart():
    # from checkpoints before, at and behind corners, to the last bit
    scenes = {"steps": LOAD + "-init_type sine -grid_n 40 -model_form chain -ts_rtol 1e-4 -ts_atol 1e-4",
              "stick": LOAD + "-friction_law coulomb -grid_n 12 -model_form chain -init_psi 0 -init_noise 0.2",
              "fixed": LOAD + "-ts_type rk -ts_adapt_type none -ts_dt 0.07 -init_type sine -grid_n 20 -model_form chain"}
    for name, options in scenes.items():
        run(options + f" -ts_max_time 4 -out_checkpoint_every 3 -out_checkpoint_keep 1000 -out_frames 9 -out_file {name}.h5")
        whole = data(f"{name}.h5")
        points = sorted(one for one in os.listdir() if one.startswith(f"{name}.chk"))
        for checkpoint in points[1:-1:max(1, len(points) // 3)]:
            run(f"-restart {checkpoint} -out_file again-{checkpoint}")
            again = data(f"again-{checkpoint}")
            kept = len(again["t"])
            check(np.array_equal(again["psi"], whole["psi"][-kept:]) and np.array_equal(again["eta"], whole["eta"][-kept:]),
                  f"{name}: other bits from {checkpoint}")


@pytest.mark.ranks
def test_ranks():
    for options in ("-grid_n 40 -model_form chain -friction_law coulomb -init_noise 0.3 ",):
        run(options + LOAD + "-ts_max_time 3 -out_frames 3 -out_series false -out_file one.h5")
        run(options + LOAD + "-ts_max_time 3 -out_frames 3 -out_series false -out_file three.h5", ranks=3)
        one, three = data("one.h5"), data("three.h5")
        for name in one:
            check(np.allclose(one[name], three[name], rtol=1e-9, atol=1e-9), f"{options}: {name} differs")


def test_slide_hold_slide():
    # the scene of runs/: the peak of the force against a direct solution
    run(scene_file("slide-hold-slide") + " -ts_max_time 125 -ts_rtol 1e-8 -ts_atol 1e-8 -out_file hold.h5 -out_frames 2")
    block = System("-model_form chain -grid_n 1 -friction_law rate-and-state -friction_a 0.02 -friction_b 0.03 -friction_D 0.01 "
                   "-friction_psi0 0.01 -model_k0 2 -model_m 1e-4 -model_v 0.01")
    u, peak = block.steady, 0
    for begin, end, v in ((0, 10, 1e-2), (10, 110, 0), (110, 125, 1e-2)):
        block.v = lambda _, v=v: v
        piece = solve_ivp(block.rates, (begin, end), u, method="Radau", rtol=1e-7, atol=1e-10)
        u, peak = piece.y[:, -1], max(peak, piece.y[1].max())
    found = data("hold.h5")["series/eta_mean"].max()
    check(abs(found - peak) < 2e-5 and peak > 0.6 + 0.02, f"peak {found} for {peak}")


def test_sweep_of_a_load():
    text = "-grid_n 1 -model_form chain -load_v 0:0.2,3:0.2,3:0.5 -load_sine_period 4 -ts_max_time 6 "
    run(text + "-sweep_parameter1 load_sine_amplitude -sweep_values1 0.1,0.3 -out_file table.h5", command="sweep")
    means = data("table.h5")["psi_mean"]
    alone = [run(text + f"-load_sine_amplitude {a}")[0]["psi_mean"] for a in (0.1, 0.3)]
    check(np.array_equal(means, alone), f"{means} {alone}")


REFUSED = [("-load_v 0:1,2", "load_v"), ("-load_v -1:1,2:1", "load_v"), ("-load_v 2:1,1:1", "ascending"),
           ("-load_sine_amplitude 0.1", "load_sine_period"), ("-load_sine_period 3", "load_sine_amplitude"),
           ("-load_v nowhere.txt", "nowhere.txt")]


@pytest.mark.parametrize("options, part", REFUSED)
def test_refused(options, part):
    refused(options, 2, part)


@pytest.mark.parametrize("command", ("spectrum", "boundary -boundary_parameter model_v -boundary_from 0.1 -boundary_to 2",
                                     "wave -wave_length 60", "chart"))
def test_run_alone_knows_loads(command):
    name, _, options = command.partition(" ")
    refused(options + " -load_v 0:1,2:1", 2, "load_v", name, command=name)




def test_the_last_frame_is_the_end():
    # Where the steps' sum misses the end by round-off, as here: a frame there is no value between steps.
    for load in ("", "-load_v 0:-0.3344,1.0811:-0.835"):
        s, _ = run("-model_form chain -grid_n 5 -model_v -0.07209 -scene_reduce off -ts_max_time 3.155 -model_m 2.069 "
                   "-model_k0 0.4592 -model_k1 0.1609 -model_f0 0.5191 -init_psi -0.302 -init_eta 0.4617 -init_noise 0.1472 "
                   "-init_seed 375 -ts_type rk -ts_rk_type 7vr -ts_rtol 0.03 -ts_atol 0.03 -out_probes 2 -out_frames 2 "
                   f"-out_file end.h5 {load}")
        check(data("end.h5")["psi"][-1, 2] == s["probes"][0]["psi"], f"{load}: {s['probes']}")


def test_the_mean_over_a_period_of_the_load():
    # out of the forces at the period's ends, in place of the velocities between them
    scenes = ["-model_form chain -grid_n 1 -bc_left free -model_k0 1 -friction_law carlson-langer -model_v 0.1 -init_psi 0",
              "-model_form chain -grid_n 5 -model_zeta 0.3 -init_noise 0.2 -model_v 0.8",
              "-grid_n 32 -bc_left free -grid_length 10 -init_noise 0.3 -model_v 0.9", "-grid_n 16 -grid_length 10 -model_nu 0.1 -model_v 1.1"]
    for scene in scenes:
        s, _ = run(f"{scene} -load_sine_amplitude 0.05 -load_sine_period 7 -ts_max_time 33 -ts_rtol 1e-9 -ts_atol 1e-9 -out_file m.h5 -out_frames 6601")
        file = data("m.h5")
        weight = np.ones(file["psi"].shape[1])
        if "-grid_n 32" in scene:
            weight[[0, -1]] = 0.5
        mean = file["psi"] @ weight / weight.sum()
        within = (file["t"] > 21 - 1e-6) & (file["t"] < 28 + 1e-6)
        check(abs(s["psi_loaded_mean"] - trapezoid(mean[within], file["t"][within]) / 7) < 2e-5, f"{scene}: {s['psi_loaded_mean']}")
    whole, _ = run(f"{scenes[0]} -load_sine_amplitude 0.05 -load_sine_period 7 -ts_max_time 33 -out_file w.h5 -out_checkpoint_every 60 -out_checkpoint_keep 99")
    first = sorted(name for name in os.listdir(".") if name.startswith("w.chk"))[0]
    again, _ = run(f"-restart {first} -out_file a.h5")
    check(again["psi_loaded_mean"] == whole["psi_loaded_mean"], "behind a restart")
    held, _ = run("-grid_n 16 -grid_length 5 -bc_left velocity -load_sine_amplitude 0.05 -load_sine_period 7 -ts_max_time 15")
    check(held["psi_loaded_mean"] is None, "not with a held end")


def test_none_takes_away_what_the_scene_sets():
    with open("s.yaml", "w", encoding="utf-8") as file:
        file.write("model: {form: chain, v: 0.3}\nload_v: '0:0.3,1:2'\nfriction_amplitude_profile: '0:1,3:2'\naccuracy: 1e-3\n"
                   "ts_max_steps: 3\ngrid_n: 4\nbc_left: free\nts_max_time: 2\n")
    words = "-load_v none -friction_amplitude_profile none -accuracy none -ts_max_steps unlimited"
    without, _ = run(f"s.yaml {words}")
    plain, _ = run("-model_form chain -model_v 0.3 -grid_n 4 -bc_left free -ts_max_time 2")
    for key in set(plain) - {"wall_s"}:
        assert without[key] == plain[key], key
    check(without["options"]["load_v"] == "", "the summary knows none")
    refused("-load_v nothing -ts_max_time 1", 2, "load_v", "nothing")
