"""Friction that remembers, from the command line: ten decades of velocity in one run, orders in time, steady friction
against velocity, Erickson's Hopf point by simulation, starts from a frame of another run."""
import math

import h5py
import numpy as np
import pytest

from calls import check, data, run

BLOCK = "-model_form chain -grid_n 1 -bc_left free"


def test_ten_decades():
    # A light block pulled by a soft spring, far below the critical stiffness: it creeps at 1e-13 and slips at 1e-2.
    for law in ("ageing", "slip"):
        scene = (BLOCK + f" -friction_law rate-and-state -state_law {law} -friction_a 0.01 -friction_b 0.015"
                 " -friction_D 1e-3 -friction_psi0 1e-3 -model_m 1e-4 -model_k0 0.1 -model_v 1e-6 -ts_max_time 1e6"
                 " -init_psi steady -init_eta steady -init_noise 1e-8 -out_frames 2000")
        s, _ = run(scene + " -out_file decades.h5")
        check(s["implicit"] in ("friction", "both"), f"{law}: the default takes {s['implicit']} implicitly")
        check(s["rhs_evaluations"] < 40000, f"{law}: {s['rhs_evaluations']} evaluations, about 10000 expected")
        with h5py.File("decades.h5") as f:
            slow, fast = np.abs(f["series/psi_min"][:]).min(), f["series/psi_max"][:].max()
            check(fast / max(slow, 1e-300) > 1e10, f"{law}: velocities from {slow} to {fast} only")
            check(np.isfinite(f["psi"][:]).all() and np.isfinite(f["eta"][:]).all(), f"{law}: not finite")
            check((f["theta"][:] > 0).all(), f"{law}: theta is not positive")
            force = f["eta"][-1, 0]
        # the run with a hundredth of the tolerance ends with the same force
        fine, _ = run(scene.replace(" -out_frames 2000", "") + " -ts_rtol 1e-8 -ts_atol 1e-8")
        check(abs(fine["eta_mean"] - force) < 1e-3, f"{law}: eta {force} and, finer, {fine['eta_mean']}")


def test_orders():
    # Smooth scenes; the error of psi at fixed steps h, h/2, h/4 against a converged run falls like h^p.
    state = {"contact-age": "-friction_law cubic -state_law contact-age -model_v 0.5",
             "healing": "-friction_law carlson-langer -friction_stick regularised -friction_eps 0.5 -state_law healing",
             "ageing": "-friction_law rate-and-state -state_law ageing -friction_a 0.3 -friction_b 0.5 -friction_D 1",
             "slip": "-friction_law rate-and-state -state_law slip -friction_a 0.3 -friction_b 0.5 -friction_D 1"}
    methods = [("-ts_type rk -ts_rk_type 5dp", 5, 0.1), ("-ts_type arkimex -ts_arkimex_type 3 -imex_implicit friction", 3, 0.05),
               ("-ts_type arkimex -ts_arkimex_type 4 -imex_implicit both", 4, 0.1)]
    for law, options in state.items():
        scene = BLOCK + " -model_k0 1 -init_psi 0.6 -ts_max_time 2 " + options
        exact = run(scene + " -ts_type rk -ts_rk_type 5dp -ts_rtol 1e-13 -ts_atol 1e-13")[0]["psi_max"]
        for method, p, h in methods:
            errors = [abs(run(f"{scene} {method} -ts_adapt_type none -ts_dt {h / 2 ** i} -snes_atol 1e-15 -snes_rtol 1e-13")[0]["psi_max"]
                          - exact) for i in range(3)]
            # the finest two, unless round-off is near
            rate = math.log2(errors[1] / errors[2]) if errors[2] > 1e-13 else math.log2(errors[0] / errors[1])
            check(p - 0.35 < rate < p + 1.5, f"{law}, {method}: order {rate:.2f}, errors {errors}")


def test_steady_friction():
    # A stiff spring makes the block slide at the plate's velocity; what it then pulls with is the steady friction.
    for v in (1e-4, 1e-2, 1.0):
        a, b, psi0 = 0.02, 0.03, 0.1
        for law in ("ageing", "slip"):
            # ten slip distances' worth of time, from a state ten times too young
            s, _ = run(BLOCK + f" -friction_law rate-and-state -state_law {law} -friction_a {a} -friction_b {b}"
                       f" -friction_psi0 {psi0} -friction_D 0.1 -model_k0 2 -model_m 1e-3 -model_v {v} -init_psi steady"
                       f" -init_eta steady -init_state {0.01 / v} -ts_max_time {4 / v}")
            exact = 0.6 + (a - b) * math.log(v / psi0)
            check(abs(s["eta_mean"] - exact) < 1e-5, f"{law}, v {v}: friction {s['eta_mean']}, steady {exact}")
        s, _ = run(BLOCK + f" -friction_law coulomb -friction_stick regularised -friction_eps {1e-3 * v} -friction_slip_velocity {1e-3 * v}"
                   f" -state_law healing -state_D 0.1 -state_t_h 2 -state_tau_inf 1.5 -model_k0 50 -model_m 0.05 -model_zeta {1 / v}"
                   f" -model_v {v} -init_psi steady -init_eta steady -init_state 1.1 -ts_max_time {5 / v}")
        tau = (1.5 / 2 + v / 0.1) / (1 / 2 + v / 0.1)
        check(abs(s["eta_mean"] - 1 - 0.5 * tau) < 1e-5, f"healing, v {v}: friction {s['eta_mean'] - 1}, steady {0.5 * tau}")


def test_hopf_by_simulation():
    # Erickson's epsilon either side of 0.280702: the small oscillation grows or dies at the eigenvalue's rate.
    g2, xi, a = 0.64, 0.5, 0.01
    for epsilon in (0.23, 0.33):
        scene = (BLOCK + f" -friction_law rate-and-state -state_law slip -friction_a {a} -friction_b {a * (1 + epsilon)}"
                 f" -friction_D 1 -model_v 1 -model_k0 {xi * a} -model_m {xi * a / g2}")
        modes, _ = run(scene, command="spectrum")
        check(modes["stable"] == (epsilon < 0.280702), f"epsilon {epsilon}: stable {modes['stable']}")
        rate = modes["growth_rate"]
        run(scene + " -init_psi 1.001 -init_eta steady -init_state 1 -ts_max_time 100 -out_frames 4001 -out_file hopf.h5"
            " -ts_rtol 1e-9 -ts_atol 1e-11")
        with h5py.File("hopf.h5") as f:
            t, w = f["t"][:], f["psi"][:, 0] - 1
        peaks = [i for i in range(1, len(w) - 1) if w[i] > w[i - 1] and w[i] >= w[i + 1] and t[i] > 10]
        measured = np.polyfit(t[peaks], np.log(w[peaks]), 1)[0]
        # amplitudes of a few thousandths move the rate by their square, 1e-5; peaks are read to (dt omega)^2/8 = 2e-5
        check(abs(measured - rate) < 5e-3 * abs(rate) + 1e-4, f"epsilon {epsilon}: growth {measured}, eigenvalue {rate}")
        check((measured > 0) == (epsilon > 0.280702), f"epsilon {epsilon}: growth {measured}")


def test_start_from_a_file():
    for scene in ("-grid_n 33 -init_type sine -friction_law rate-and-state",
                  "-model_form chain -grid_n 7 -init_noise 0.3 -friction_law carlson-langer -friction_stick regularised"
                  " -friction_eps 0.1 -state_law healing"):
        whole, _ = run(scene + " -ts_max_time 2 -ts_rtol 1e-9 -ts_atol 1e-9 -out_probes 1.5")
        run(scene + " -ts_max_time 1 -ts_rtol 1e-9 -ts_atol 1e-9 -out_frames 3 -out_file half.h5")
        rest = scene.replace(" -init_type sine", "").replace(" -init_noise 0.3", "") + " -init_type file -init_file half.h5"
        second, _ = run(rest + " -ts_max_time 1 -ts_rtol 1e-9 -ts_atol 1e-9 -out_probes 1.5")
        for name in ("psi", "eta"):
            difference = abs(second["probes"][0][name] - whole["probes"][0][name])
            check(difference < 1e-6, f"{name} differs by {difference} when run in two halves: {scene}")
        at_once, _ = run(rest + " -ts_max_time 0 -init_frame 1 -out_probes 0")
        with h5py.File("half.h5") as f:
            check(at_once["probes"][0]["psi"] == f["psi"][1, 0], "init_frame 1 is not frame 1")
    chain = "-model_form chain -grid_n 7 -friction_law carlson-langer -friction_stick regularised"
    for scene, word in ((chain.replace("-grid_n 7", "-grid_n 8"), "7 points"),
                        (chain + " -bc_left free -state_law contact-age", "theta"),
                        ("-grid_n 7 -grid_length 7", "chain"), (chain + " -init_frame 9", "3 frames")):
        _, error = run(scene + " -init_type file -init_file half.h5", code=2)
        check(error.startswith("stickslip: error: ") and error.count("\n") == 1 and word in error, f"{scene}: {error}")
    _, error = run("-init_type file", code=2)
    check("init_file" in error, error)


@pytest.mark.parametrize("method", ("", "-imex_implicit both", "-ts_type rosw", "-ts_type arkimex -ts_arkimex_type 5"))
def test_frames_of_light_blocks(method):
    """psi of frames lies where psi of steps does; by a cubic through slopes, which are f0/m = 1000 times what eta is off, it was
    2000 times as large."""
    s, _ = run("-model_form chain -grid_n 2 -bc_left free -friction_law rate-and-state -friction_a .01 -friction_b .015 -friction_D 1e-5 "
               "-friction_psi0 1e-6 -model_m 10 -model_k0 5.5e6 -model_k1 2e7 -model_f0 1e4 -model_v 1e-6 -init_psi .8e-6 "
               f"-init_eta steady -init_noise 3e-7 -ts_max_time 400 -out_frames 81 -out_file light.h5 {method}")
    file = data("light.h5")
    psi, seen = file["psi"], file["series/psi_max"].max()
    check(psi.min() > 0 and psi.max() <= seen * 1.01, f"{s['method']}: {psi.min()} {psi.max()}, steps up to {seen}")


@pytest.mark.parametrize("method", ("", "-imex_implicit both", "-ts_type rosw"))
def test_slips_of_light_blocks(method):
    """What the spring gives in a slip is what the plate and the block have moved it: f0 drop = k0 (slip - v time). By a cubic through
    slopes, f0/m = 1e14 times what eta is off, slips were 80 m and 200 m long and no work a number. Simpson's rule over steps that
    grow tenfold at most errs by less than 1e-3."""
    run("-model_form chain -grid_n 1 -bc_left free -model_m 1e-7 -model_k0 9.999e8 -model_f0 1e7 -model_zeta 5e6 -model_v 1e-6 "
        "-friction_law dieterich -friction_a 0.005 -friction_b 0.01 -friction_D 2e-5 -friction_mu0 0.6 -friction_psi0 1e-6 "
        "-init_psi 1.01e-6 -init_eta steady -init_state 20 -ts_max_time 2000 -out_events -out_events_velocity 1e-5 "
        f"-out_file slips.h5 -out_frames 2 {method}")
    events = {name: data("slips.h5")[f"events/{name}"][-1] for name in ("begin", "t", "slip", "stress_drop", "friction_work", "radiated")}
    by_spring = 1e7 * events["stress_drop"] / 9.999e8 + 1e-6 * (events["t"] - events["begin"])
    check(abs(events["slip"] / by_spring - 1) < 1e-3, f"{events} {by_spring}")
    check(0 < events["radiated"] < events["friction_work"] < 0.7 * events["slip"], f"{events}")
