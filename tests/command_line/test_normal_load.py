"""A normal load N(t), by which friction and its threshold are multiplied, and what it does to the state of ageing and slip: against
scipy, piece by piece; orders at fixed steps across corners; slips that a falling load sets off, in closed form; energy and events."""
import math
import os

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from calls import check, data, refused, run
from reference import Stick, System, options, read

# a ramp, a hold, a step down, a ramp up, and a sine on top
NORMAL = "-load_normal 0.37:1,1.1:1.4,2.03:1.4,2.03:0.7,3.3:1.2 -load_normal_sine_amplitude 0.15 -load_normal_sine_period 1.7 "
STRICT = "-ts_rtol 1e-10 -ts_atol 1e-11"
RATE = ("-model_form chain -bc_left free -grid_n 3 -model_k0 0.3 -model_k1 0.7 -model_zeta 0.1 -model_v 0.3 -friction_law rate-and-state "
        "-friction_a 0.3 -friction_b 0.5 -friction_D 0.4 ")


def exact_end(scene, end):
    return System(scene).follow(np.repeat([0.4, 0.5, np.log(0.7)], 3), 0, end)


METHODS = ["", "-ts_type rk", "-ts_type arkimex -imex_implicit friction", "-ts_type arkimex -imex_implicit wave",
           "-ts_type arkimex -imex_implicit both", "-ts_type bdf"]


@pytest.mark.parametrize("state", ["ageing", "slip"])
def test_against_scipy(state):
    scene = f"{RATE} -state_law {state} {NORMAL} -state_linker_dieterich 0.2"
    exact, load = exact_end(scene, 4), System(scene).loads.normal
    for method in METHODS if state == "ageing" else METHODS[:1]:
        run(f"{scene} -init_psi 0.4 -init_eta 0.5 -init_state 0.7 -ts_max_time 4 {method} -ts_rtol 1e-9 -ts_atol 1e-9 "
            "-out_file run.h5 -out_frames 2")
        found = data("run.h5")
        error = abs(read(found, -1) - exact).max()
        check(error < 1e-6, f"{method}: {error}")
        times, N = found["series/t"], found["series/normal"]
        check(all(np.min(abs(times - t)) == 0 for t in (0.37, 1.1, 2.03, 3.3)), f"{method}: no step ends at a corner")
        for t, value in zip(times, N):  # at a corner that of the piece that ends
            begin = max([0.0] + [c for c in (0.37, 1.1, 2.03, 3.3) if c < t])
            check(abs(value - load.after(begin)(t)) < 1e-13, f"N({t}) = {value}")


@pytest.mark.parametrize("number", range(4))
def test_random_chains_under_all_loads(number):
    """A table and a sine of the plate, a force, a table and a sine of the normal load, against SciPy: of smooth friction, and of exact
    stick from change to change; eta is that of the springs."""
    r = np.random.default_rng(number)
    n = int(r.integers(2, 7))
    v, N = [f"0.3:{r.uniform(0.2, 0.5):.3f},1.2:{r.uniform(0.2, 0.5):.3f},1.2:0.3,3:0.5", f"0.7:1,1.9:{r.uniform(0.7, 1.3):.3f},1.9:1.1,4:0.9"]
    scene = (f"-model_form chain -bc_left free -grid_n {n} -model_k0 {r.uniform(0.3, 0.8):.3f} -model_k1 {r.uniform(0.3, 0.8):.3f} "
             f"-model_zeta {r.uniform(0.1, 0.3):.3f} -model_v 0.3 -load_v {v} -load_sine_amplitude 0.1 -load_sine_period 2.3 -load_normal {N} "
             "-load_normal_sine_amplitude 0.1 -load_normal_sine_period 1.7 -load_force_sine_amplitude 0.2 -load_force_sine_period 1.9 ")
    psi, eta = r.uniform(0.1, 0.5, n), r.uniform(0.2, 0.6, n)
    sticks = number % 2 == 1
    scene += "-friction_law carlson-langer " if sticks else "-friction_law rate-and-state -friction_a 0.3 -friction_b 0.4 -friction_D 0.4 "
    start = [psi, eta] if sticks else [psi, eta, np.full(n, np.log(0.4 / 0.3))]
    if not sticks:
        scene += f"-state_linker_dieterich {r.uniform(0.1, 0.3):.3f} -init_state {0.4 / 0.3!r} "
    np.savetxt("start.txt", np.column_stack([np.arange(n), psi, eta]), fmt="%.17g")
    run(f"{scene} -init_type text -init_file start.txt -ts_max_time 6 {STRICT} -out_frames 2 -out_probes 1 -out_displacement -out_file run.h5")
    found = data("run.h5")
    system = System(scene)
    exact = Stick(system, np.concatenate(start)).advance(6) if sticks else system.follow(np.concatenate(start), 0, 6)
    check(abs(read(found, -1) - exact).max() < 2e-7, f"{read(found, -1)} for {exact}")
    check(abs(found["probes/eta"][-1, 0] - exact[n + 1]) < 2e-7, "eta at a probe")
    # (k0 - k1 D2) chi = k0 (how far the plate has come) - eta, with the plate's own way
    chi = found["chi"][-1]
    check(abs(system.K0 * chi - system.K1 * system.D @ chi - system.K0 * system.plate.way(6) + exact[n:2 * n]).max() < 1e-6, "chi")


@pytest.mark.parametrize("text", ["", "-bc_left free -friction_law rate-and-state -friction_a 0.3 -friction_b 0.5 -friction_D 0.4 "
                                      "-state_linker_dieterich 0.2 -model_nu 0.05",
                                  "-bc_left velocity -bc_left_value 0.5 -bc_right free"])
def test_a_continuum_under_all_loads(text):
    """With damping, viscosity and a held end, at the nodes that are not held."""
    scene = (f"-grid_n 12 -grid_length 12 {text} {NORMAL} -load_force_sine_amplitude 0.1 -load_force_sine_period 2 -load_v 0:0.2,1:0.4 ")
    run(f"{scene} -init_psi 0.4 -init_eta 0.2 -init_type sine -scene_reduce off {STRICT} -ts_max_time 2.2 -out_frames 2 -out_file run.h5")
    found, system = data("run.h5"), System(scene)
    exact = system.follow(read(found, 0), 0, 2.2)
    check(abs(read(found, -1) - exact)[system.unknowns()].max() < 1e-8, "the last frame")


def test_energy_under_a_force():
    """What plate and force give is what friction takes and the blocks keep."""
    run("-model_form chain -bc_left free -grid_n 3 -model_k1 0.4 -model_v 0.3 -init_noise 0.2 -load_force_sine_amplitude 0.3 "
        f"-load_force_sine_period 2 -load_normal_sine_amplitude 0.2 -load_normal_sine_period 3 -ts_max_time 8 {STRICT} -out_displacement "
        "-ts_dt 0.01 -ts_adapt_type none -out_frames 2 -out_file run.h5")
    series = {name.split("/")[-1]: values for name, values in data("run.h5").items() if name.startswith("series/")}
    energy = series["energy_kinetic"] + series["energy_elastic"]
    power = series["power_input"] - series["power_friction"] - series["power_viscous"]
    gained = np.sum((power[1:] + power[:-1]) / 2 * np.diff(series["t"]))
    check(abs(energy[-1] - energy[0] - gained) < 1e-4, f"{energy[-1] - energy[0]} for {gained}")


def test_orders():
    scene = f"{RATE} {NORMAL} -state_linker_dieterich 0.2"
    exact = exact_end(scene, 4)
    for method, order, h in (("-ts_type rk -ts_rk_type 5dp", 5, 0.1), ("-ts_type arkimex -ts_arkimex_type 3 -imex_implicit friction", 3, 0.05)):
        errors = []
        for step in (h, h / 4):
            run(f"{scene} -init_psi 0.4 -init_eta 0.5 -init_state 0.7 {method} -ts_adapt_type none -ts_dt {step} -ts_max_time 4 "
                "-snes_rtol 1e-13 -snes_atol 1e-15 -out_frames 2 -out_file run.h5")
            errors.append(abs(read(data("run.h5"), -1) - exact).max())
        check(math.log2(errors[0] / errors[1]) / 2 > order - 0.4, f"{method}: errors {errors}")


def test_a_step_of_the_load_is_one_of_the_state():
    """From N to 2 N theta becomes theta 2^(-alpha/b); the frame at the step is that before it."""
    run(f"{RATE} -load_normal 0:1,1:1,1:2 -state_linker_dieterich 0.3 -init_psi 0.3 -init_eta steady -init_state 1.1 -ts_max_time 2 "
        f"-out_times 1,1.000001 -out_file run.h5 {STRICT}")
    before, behind = data("run.h5")["theta"]
    check(np.abs(behind / before / 2**(-0.3 / 0.5) - 1).max() < 1e-5, f"{behind / before}")


def test_a_step_at_steady_sliding():
    """Right behind the step psi_t = A [N- F_ss - N+ F(v, theta+)], which stands in eta at a stiff spring soon after; in the end eta = N+ F_ss."""
    scene = ("-model_form chain -grid_n 1 -bc_left free -model_k0 100 -model_m 1e-4 -model_v 0.01 -friction_law rate-and-state -friction_a 0.01 "
             "-friction_b 0.015 -friction_D 0.01 -friction_psi0 0.01 -state_linker_dieterich 0.3 -load_normal 0:1,1:1,1:1.05 ")
    law = System(scene).law
    steady = law.friction(0.01, 0.)  # ln(v theta/D) = 0
    run(f"{scene} -init_psi steady -init_eta steady -ts_max_time 30 {STRICT} -out_times 1,1.00000001,30 -out_file run.h5")
    found = data("run.h5")
    rate = (found["psi"][1, 0] - found["psi"][0, 0]) / 1e-8
    exact = 1e4 * (steady - 1.05 * law.friction(0.01, -0.3 / 0.015 * math.log(1.05)))
    check(abs(rate / exact - 1) < 1e-3, f"psi_t = {rate} for {exact}")
    check(abs(found["eta"][2, 0] - 1.05 * steady) < 1e-8, f"eta = {found['eta'][2, 0]}")


def test_a_constant_load_is_an_amplitude():
    for scene in (RATE, "-model_form chain -bc_left free -grid_n 3 -friction_law coulomb -init_psi 0 -init_noise 0.2 ",
                  "-grid_n 40 -grid_length 20 -init_type sine -scene_reduce off "):
        n = 20 if "grid_n 40" in scene else 2
        run(f"{scene} -load_normal 0:1.5 -ts_max_time 5 -out_frames 3 {STRICT} -out_file load.h5")
        run(f"{scene} -friction_amplitude_profile 0:1.5,{n}:1.5 -ts_max_time 5 -out_frames 3 {STRICT} -out_file amplitude.h5")
        one, other = data("load.h5"), data("amplitude.h5")
        check(np.allclose(one["psi"], other["psi"], rtol=0, atol=1e-7), f"{scene}: {np.abs(one['psi'] - other['psi']).max()}")


# ---- exact stick ----

BLOCK = "-model_form chain -grid_n 1 -bc_left free -friction_law coulomb -friction_fs 0.6 -friction_fd 0.3 -model_k0 0.4 -init_psi 0 "


def first_slip(text):
    run(f"{BLOCK} {text} -out_file stick.h5")
    series = data("stick.h5")
    moves = np.flatnonzero(abs(series["series/psi_max"]) > 0)
    return series["series/t"][moves[0] - 1]


@pytest.mark.parametrize("text, eta, N, low, high", [
    # nothing pulls any more, and the load falls
    ("-model_v 0 -init_eta 0.3 -load_normal 0:1,10:0.1", lambda t: 0.3, lambda t: 1 - 0.09 * t, 0, 10),
    # both change
    ("-model_v 0.01 -init_eta 0.2 -load_normal_sine_amplitude 0.4 -load_normal_sine_period 7", lambda t: 0.2 + 0.004 * t,
     lambda t: 1 + 0.4 * math.sin(2 * math.pi * t / 7), None, None),
    # two sines of which none brings it there alone at once
    ("-model_v 0.005 -load_sine_amplitude 0.1 -load_sine_period 3 -init_eta 0.1 -load_normal_sine_amplitude 0.5 -load_normal_sine_period 5.3",
     lambda t: 0.1 + 0.4 * (0.005 * t + 0.1 * 3 / math.pi * math.sin(math.pi * t / 3)**2),
     lambda t: 1 + 0.5 * math.sin(2 * math.pi * t / 5.3), None, None)])
def test_a_falling_load_sets_off_slip(text, eta, N, low, high):
    """At rest the block lets go where its force is the threshold N(t) fs."""
    def excess(t):
        return eta(t) - 0.6 * N(t)
    if low is None:
        times = np.linspace(0, 100, 200001)
        high = next(t for t in times if excess(t) >= 0)
        low = high - 1e-3
    exact, found = brentq(excess, low, high, xtol=1e-14), first_slip(f"{text} -ts_max_time {high + 2}")
    check(abs(found - exact) < 1e-9, f"{found} for {exact}")


def test_a_step_down_lets_go_at_once():
    found = first_slip("-model_v 0 -init_eta 0.5 -load_normal 0:1,3:1,3:0.7 -ts_max_time 5")
    check(found == 3, f"slips at {found}")


def friction_work(stick, force):
    """Of Coulomb friction fd N(t), by the slips of SciPy's steps: trapezia over its own short segments."""
    work, slip = 0, np.zeros(stick.n)
    for begin, end, _, now, _ in stick.segments:
        work += np.sum(np.abs(now - slip)) * (force(begin) + 4 * force((begin + end) / 2) + force(end)) / 6
        slip = now
    return work


def test_slips_energy_and_events():
    """Two blocks under a load that goes up and down: the motion, the energy that friction takes, and the events."""
    k0, k1, v, fs, fd = 0.3, 0.5, 0.2, 0.8, 0.5
    text = (f"-model_form chain -grid_n 2 -bc_left free -friction_law coulomb -friction_fs {fs} -friction_fd {fd} -model_k0 {k0} -model_k1 {k1} "
            f"-model_v {v} -init_psi 0 -init_type text -init_file start.txt -load_normal_sine_amplitude 0.3 -load_normal_sine_period 4.1 "
            f"-ts_max_time 30 -out_frames 2 {STRICT} -out_displacement -out_events -out_file run.h5")
    np.savetxt("start.txt", [[0, 0, 0.1], [1, 0, 0.35]])
    s, _ = run(text)
    fields = data("run.h5")
    stick = Stick(System(text), [0, 0, 0.1, 0.35], max_step=0.02)
    end = stick.advance(30)
    check(stick.changes >= 8, f"only {stick.changes} changes")
    work = friction_work(stick, lambda t: fd * (1 + 0.3 * np.sin(2 * np.pi * t / 4.1)))
    check(np.abs(np.concatenate([fields["psi"][-1], fields["eta"][-1]]) - end).max() < 1e-6, f"{fields['psi'][-1]} {fields['eta'][-1]} for {end}")
    check(s["clusters"] is None and s["regime"] == "undecided" and "normal load" in s["regime_reason"], s["regime_reason"])
    series = {name.split("/")[-1]: values for name, values in fields.items() if name.startswith("series/")}
    energy = series["energy_kinetic"] + series["energy_elastic"]
    power = series["power_input"] - series["power_friction"]
    # what friction takes jumps where a block starts or stops: no trapezium there, but with psi = 0 at either end little is lost
    gained = np.sum((power[1:] + power[:-1]) / 2 * series["dt"][1:])
    check(abs(energy[-1] - energy[0] - gained) < 1e-2 * work, f"{energy[-1] - energy[0]} for {gained}")
    ended = fields["events/friction_work"].sum()
    moving = np.abs(fields["psi"][-1]).max() > 0
    check(moving or abs(ended - work) < 3e-5 * work, f"events take {ended} of {work}")


def time_of(checkpoint):
    with h5py.File(checkpoint) as file:
        return file.attrs["t"]


@pytest.mark.parametrize("text", [
    "-model_form chain -grid_n 12 -bc_left free -friction_law coulomb -init_psi 0 -init_noise 0.2 -out_events",
    f"{RATE} -state_linker_dieterich 0.3"])
def test_restart(text):
    run(f"{text} {NORMAL} -ts_max_time 3 -out_checkpoint_every 1 -out_checkpoint_keep 1000 -out_frames 9 -out_file whole.h5")
    whole = data("whole.h5")
    points = sorted(one for one in os.listdir() if one.startswith("whole.chk"))
    at_step = [one for one in points if abs(time_of(one) - 2.03) < 1e-12]
    check(len(at_step) == 1, "no checkpoint where the load steps down")
    for checkpoint in [*points[1:-1:max(1, len(points) // 2)], *at_step]:
        run(f"-restart {checkpoint} -out_file again.h5")
        again = data("again.h5")
        kept = len(again["t"])
        check(all(np.array_equal(again[name], whole[name][-kept:]) for name in ("psi", "eta")), f"other bits from {checkpoint}")


@pytest.mark.ranks
def test_ranks():
    text = f"-model_form chain -grid_n 40 -bc_left free -friction_law coulomb -init_psi 0 -init_noise 0.3 {NORMAL} -ts_max_time 3 -out_frames 3 "
    run(text + "-out_file one.h5")
    run(text + "-out_file three.h5", ranks=3)
    check(np.allclose(data("one.h5")["psi"], data("three.h5")["psi"], rtol=1e-9, atol=1e-9), "ranks differ")


def test_accuracy_on_request():
    """Of rate-and-state friction, whose first method is implicit: what is taken in its place has the error asked for."""
    run(RATE + NORMAL + "-ts_max_time 4 -init_psi 0.4 -init_eta 0.5 -accuracy 1e-8 -out_file a.h5 -out_frames 2")
    scene = options(RATE + NORMAL)
    wanted = System(scene).follow(read(data("a.h5"), 0), 0, 4)
    assert np.abs(read(data("a.h5"), -1) - wanted)[:6].max() < 1e-8


def test_a_fit():
    """Of a friction that the steps of the load alone tell from another: the sine and the steps are those of the runs of the fit."""
    scene = RATE.replace("-grid_n 3", "-grid_n 1") + NORMAL + "-ts_max_time 6 -init_psi 0.4 -init_eta 0.5 "
    run(scene + "-out_file r.h5 -out_frames 121 -ts_rtol 1e-11")
    with h5py.File("r.h5") as file:
        np.savetxt("r.txt", np.c_[file["t"][1:], file["eta"][1:, 0]])
    found, _ = run(scene.replace("friction_a 0.3", "friction_a 0.36") + "-fit_data r.txt -fit_parameters friction_a -fit_starts 1",
                   command="fit")
    # a load held constant, or a step left out, changes eta by 0.1; steps of the fit err by some 1e-7
    assert abs(found["parameters"][0]["value"] - 0.3) < 1e-5 and found["residual"] < 1e-6


CHAIN = "-model_form chain -bc_left free -grid_n 4 "
REFUSED = [("run", "-load_normal 0:1,5:0", ("load_normal", "> 0")),
           ("run", "-load_normal 0:1,5:-1,6:1", ("load_normal", "> 0")),
           ("run", "-load_normal_sine_amplitude 1.2 -load_normal_sine_period 3", ("load_normal_sine_amplitude", "> 0")),
           ("run", "-load_normal_sine_amplitude 0.2", ("load_normal_sine_period",)),
           ("run", "-load_normal=-1:1", ("load_normal",)),
           ("run", "-load_normal 0:2 -model_drag 1", ("load_normal", "model_drag")),
           ("run", CHAIN + "-model_m 0 -model_zeta 3 -load_normal 0:2", ("load_normal", "model_m")),
           ("run", CHAIN + "-friction_law coulomb -load_normal 0:2 -load_halt", ("load_normal", "load_halt")),
           ("run", CHAIN + "-friction_law coulomb -load_normal 0:2 -stick_clusters on", ("stick_clusters", "normal load")),
           ("run", CHAIN + "-friction_law coulomb -load_normal 1:1,1:2 -lyapunov_count 1", ("load_normal", "lyapunov_count")),
           ("run", "-load_normal 0:2 -ts_type rosw", ("rosw", "load_normal")),
           ("run", "-load_normal 0:2 -ts_type leapfrog", ("leapfrog", "load_normal")),
           ("run", "-load_normal 0:2 -state_linker_dieterich 0.1", ("state_linker_dieterich", "ageing and slip")),
           ("run", "-friction_law carlson-langer -state_law healing -load_normal 0:2 -state_linker_dieterich 0.1",
            ("state_linker_dieterich", "healing")),
           ("run", "-friction_law rate-and-state -state_linker_dieterich 0.1", ("state_linker_dieterich", "load_normal")),
           ("spectrum", "-load_normal 0:2", ("load_normal", "spectrum"))]


def test_exponents_under_a_table():
    """Of a block under a load that goes up and down by straight pieces: those of SciPy's matrix, carried along and made orthogonal."""
    teeth = ",".join(f"{0.85 * k:.2f}:{1.3 if k % 2 else 0.8}" for k in range(60))
    one = RATE.replace("-grid_n 3", "-grid_n 1").replace("-model_k1 0.7 ", "")
    scene = f"{one} -state_law ageing -load_normal {teeth} -state_linker_dieterich 0.2"
    s, _ = run(f"{scene} -init_psi 0.4 -init_eta 0.5 -init_state 0.7 -ts_max_time 50 -lyapunov_count 2 -lyapunov_from 20 {STRICT}")
    system = System(scene)
    u, Y, logs = np.repeat([0.4, 0.5, np.log(0.7)], 1), np.eye(3)[:, :2], np.zeros(2)

    def rate(t, z):
        return np.concatenate([system.rates(t, z[:3]), (system.jacobian(z[:3], t=t) @ z[3:].reshape(3, 2)).ravel()])
    for begin, end in system.loads.pieces(0, 50):
        u = system.begin_piece(begin, u)
        z = solve_ivp(rate, (begin, end), np.concatenate([u, Y.ravel()]), method="LSODA", rtol=1e-10, atol=1e-12).y[:, -1]
        u, (Y, R) = z[:3], np.linalg.qr(z[3:].reshape(3, 2))
        if begin >= 20:
            logs += np.log(np.abs(np.diag(R)))
    for one, exact in zip(s["lyapunov"], logs / (50 - 20)):
        assert abs(one["value"] - exact) < 4 * one["error"] + 1e-3, (s["lyapunov"], logs / 30)


@pytest.mark.parametrize("command, text, parts", REFUSED)
def test_refused(command, text, parts):
    refused(text.replace("-load_normal=-1:1", "-load_normal -1:1"), 2, *parts, command=command)
