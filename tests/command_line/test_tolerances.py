"""What a step may err by: relative to the scene's own scales, and judged in the force where friction goes by ln psi."""
import math

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from calls import check, refused, run

BLOCK = "-model_form chain -grid_n 1 -bc_left free"
RISE = (BLOCK + " -model_m 1 -model_k0 0.3 -model_v 1e-4 -friction_b 0.002 -friction_D 1e-3 -friction_psi0 1e-4 -state_law slip"
        " -init_psi 1e-4 -ts_max_time 6e4 -out_frames 2 -out_file r.h5")


@pytest.mark.parametrize("law", ("rate-and-state -friction_a 0.001", "rate-and-state -friction_a 0.0015",
                                 "dieterich -friction_a 0.001", "rate-and-state -friction_a 0.001 -ts_type bdf",
                                 "rate-and-state -friction_a 0.001 -imex_implicit both"))
def test_the_force_is_what_friction_holds(law):
    # From eta = 0.1, where friction holds psi at 1e-222: steps as long as nothing happens, and then it has to slip.
    run(f"{RISE} -friction_law {law}")
    with h5py.File("r.h5") as f:
        t, eta = f["series/t"][:], f["series/eta_mean"][:]
    # friction at psi0 is 0.6 plus what the state, that of psi = 1e-4, adds: nothing; direct and inertial effects 10 a
    check(0.595 < eta.max() < 0.612, f"{law}: the force climbs to {eta.max()}")
    check(eta[-1] < 0.612, f"{law}: the force ends at {eta[-1]}")


@pytest.mark.parametrize("method", ("", "-imex_implicit both", "-ts_type rosw"))
def test_psi_that_falls_by_decades_at_once(method):
    """The force begins 600 a below friction: psi comes to rest in 1e-6 of the time, and is 1e-266 at once. From there it follows the
    force, which the plate raises, and the state, theta = theta_0 + t: psi = psi0 exp((eta - mu0 - b ln(psi0 theta/(2 D)))/a)."""
    a, b, D, psi0, v, k0, psi, eta0, end = 7.344e-4, 1.684e-3, 0.0641, 0.255, 0.03246, 3.962e-3, 3.246e-3, 0.15934, 3000
    run(f"{BLOCK} -friction_law dieterich -state_law prz -friction_a {a} -friction_b {b} -friction_D {D} -friction_mu0 0.6"
        f" -friction_psi0 {psi0} -model_v {v} -model_k0 {k0} -model_m 1.414e-4 -init_psi {psi} -init_eta {eta0} -ts_max_time {end}"
        f" {method} -out_file f.h5 -out_frames 2")
    with h5py.File("f.h5") as f:
        t, found, eta = (f["series/" + name][:] for name in ("t", "psi_mean", "eta_mean"))
    t, found, eta = t[t > 1e-5], found[t > 1e-5], eta[t > 1e-5]
    check(abs(eta - eta0 - k0 * v * t).max() < 1e-8, f"eta is off by {abs(eta - eta0 - k0 * v * t).max()}")
    friction = 0.6 + a * np.log(found / psi0) + b * np.log(psi0 * (2 * D / psi + t) / (2 * D))
    # a step may be off by 1e-6 (mu0 + eta), or one of three unknowns by sqrt(3) times that, and the next one leads back
    check(abs(friction - eta).max() < 2.1e-6, f"{method}: friction is off by {abs(friction - eta).max()}")


def test_what_bdf_cannot_is_told():
    refused(f"{BLOCK} -friction_law dieterich -state_law prz -friction_a 7.344e-4 -friction_b 1.684e-3 -friction_D 0.0641 -friction_mu0 0.6"
            " -friction_psi0 0.255 -model_v 0.03246 -model_k0 3.962e-3 -model_m 1.414e-4 -init_psi 3.246e-3 -init_eta 0.15934"
            " -ts_max_time 3000 -ts_type bdf", 1, "take ts_type arkimex or rosw")


def test_long_steps_of_a_stiff_block():
    """psi is in balance with the force 1e9 times faster than the state changes: its row, off its balance by a part of 1e-9 where Newton's
    method is nearly there, is no reason to shorten a step of that. (It took 13000 steps and 22000 rejections for a twentieth.)"""
    s, _ = run(f"{BLOCK} -friction_law rate-and-state -state_law ageing -friction_a .0078 -friction_b .0373 -friction_D 3e-4"
               " -friction_mu0 .3876 -friction_psi0 3.675e-9 -model_m 6142556 -model_k0 8.377e8 -model_f0 7.1237e6 -model_zeta 4.7e10"
               " -model_v 3.675e-9 -init_psi 2.828e-9 -init_state 81812 -init_eta steady -ts_max_time 3.27e6"
               " -ts_type arkimex -snes_max_it 60")
    check(s["steps"] < 300 and s["rejections"] < 30, f"{s['steps']} steps, {s['rejections']} rejected")


def test_strict_steps_of_stiff_chains():
    # psi is a slave of the force, 1e16 times faster than a step: what it is off by at the start of a step is no error of it.
    scene = ("-model_form chain -bc_left free -grid_n 20 -friction_law rate-and-state -friction_a .01 -friction_b .015"
             " -friction_D .01 -friction_psi0 1e-6 -model_m 1e10 -model_f0 1e13 -model_k0 4.5e12 -model_k1 2e13 -model_v 1e-9"
             " -init_psi 8e-10 -init_eta steady -init_noise 3e-10 -init_seed 3 -ts_max_time 3e9")
    ends = [run(f"{scene} {strict}")[0] for strict in ("-ts_atol 1e-15", "-ts_atol auto:1e-7 -ts_rtol 1e-7",
                                                       "-ts_atol 1e-15 -imex_implicit both")]
    for s in ends[1:]:
        check(abs(s["psi_max"] / ends[0]["psi_max"] - 1) < 1e-2 and abs(s["eta_mean"] - ends[0]["eta_mean"]) < 1e-4,
              f"{[(e['psi_max'], e['eta_mean']) for e in ends]}")


def test_bristles_that_are_stiff():
    # sigma0 1e5: bristles of 1e-5 under a plate of 1e-2, against scipy
    sigma0, k0, v, amplitude = 1e5, 2.0, 1e-4, 0.01
    run(BLOCK + f" -friction_law dahl -friction_fc 1 -friction_sigma0 {sigma0} -model_k0 {k0} -model_v {v} -init_psi 0 -init_eta 0"
        f" -load_sine_amplitude {amplitude} -load_sine_period 10 -ts_max_time 30 -out_frames 301 -out_file d.h5")

    def rates(t, y):
        psi, eta, z = y
        return [eta - sigma0 * z, k0 * (v + amplitude * math.sin(2 * math.pi * t / 10) - psi), psi * (1 - np.sign(psi) * sigma0 * z)]
    with h5py.File("d.h5") as f:
        t, psi, eta = f["t"][:], f["psi"][:, 0], f["eta"][:, 0]
    exact = solve_ivp(rates, (0, 30), [0, 0, 0], method="LSODA", rtol=1e-10, atol=[1e-15, 1e-12, 1e-17], t_eval=t).y
    off = abs(psi - exact[0]).max() / abs(exact[0]).max(), abs(eta - exact[1]).max() / abs(exact[1]).max()
    # what steps err by adds up over the 1500 turns of the block on its bristles: 3e-5 of a turn each
    check(off[0] < 5e-2 and off[1] < 1e-5, f"psi and eta are off by {off} of their size")


def fields(options, n=1):
    run(options + " -out_frames 5 -out_file u.h5")
    with h5py.File("u.h5") as f:
        return f["t"][:], f["psi"][:], f["eta"][:]


@pytest.mark.parametrize("law", ("carlson-langer -friction_alpha {v} -friction_stick regularised -friction_eps {e}",
                                 "stribeck -friction_vs {v}", "tanh -friction_vs {v} -friction_fc 0.3"))
@pytest.mark.parametrize("method", ("", "-ts_type rosw"))
def test_units_of_powers_of_two(law, method):
    """A scene in units of length, time and force that are powers of two of others takes the same steps, bit by bit; to round-off
    where PETSc solves for them, which begins by numbers of its own."""
    def scene(length, time, force):
        velocity = length / time
        scale = {"v": (1 / velocity if "alpha" in law else velocity) * 0.3, "e": 0.02 * velocity}
        return (f"-model_form chain -grid_n 4 -bc_left free -model_m {0.7 * force * time ** 2 / length!r} -model_k0"
                f" {0.4 * force / length!r} -model_k1 {0.9 * force / length!r} -model_f0 {1.3 * force!r} -model_v {0.11 * velocity!r}"
                f" -friction_law {law.format(**scale)} -init_psi {0.05 * velocity!r} -init_eta 0.2 -init_noise {0.02 * velocity!r}"
                f" -ts_max_time {8 * time!r} {method}")
    t, psi, eta = fields(scene(1.0, 1.0, 1.0))
    for length, time, force in ((2.0 ** 30, 2.0 ** -12, 2.0 ** 17), (2.0 ** -25, 2.0 ** 9, 2.0 ** -31)):
        other = fields(scene(length, time, force))
        back = [other[0] / time, other[1] * time / length, other[2]]
        same = [np.array_equal(a, b) if not method else np.allclose(a, b, rtol=1e-9, atol=1e-11)
                for a, b in zip(back, (t, psi, eta))]
        check(all(same), f"{law} {method}, units {length}, {time}, {force}: psi by {abs(other[1] * time / length - psi).max()}")


def test_no_step_is_too_short():
    """The library's floor, 1e-20, is of one unit: here steps are some 1e-22 long."""
    found = []
    for t in (1, 2.0**-70):
        found.append(run(f"{BLOCK} -friction_law stribeck -friction_vs {0.5 / t!r} -friction_stick regularised -friction_eps {0.05 / t!r}"
                         f" -model_m {t * t!r} -model_v {0.3 / t!r} -init_psi {0.1 / t!r} -init_eta 0 -ts_max_time {20 * t!r}")[0])
    one, other = found
    check(one["steps"] == other["steps"] and one["psi_max"] == other["psi_max"] * 2.0**-70, f"{one['steps']}, {other['steps']}")


def test_ts_atol():
    scene = BLOCK + " -model_v 1e-3 -friction_law carlson-langer -init_psi 1e-4 -init_eta 1 -ts_max_time 20"
    counts = [run(f"{scene} {atol}")[0]["rhs_evaluations"] for atol in ("", "-ts_atol auto", "-ts_atol auto:1e-6", "-ts_atol auto:1e-9",
                                                                        "-ts_atol 1e-6")]
    check(counts[0] == counts[1] == counts[2] < counts[3] and counts[4] < counts[0], f"{counts}")
    for wrong in ("auto:0", "auto:-1", "auto:", "soon", "-1", "auto:1e-9:3"):
        refused(f"{scene} -ts_atol {wrong}", 2, "ts_atol", "auto:NUMBER")


def test_holds_are_no_growth_near_sliding():
    # Stick-slip that begins beside sliding and leaves it within a sixteenth of the run, all of which was taken for time near it: the
    # long steps of its holds would let the slow instability of sliding grow fifteen times too fast.
    _, told = run("-model_form chain -grid_n 2 -bc_left free -scene_reduce off -model_m 0.083 -model_k0 1.2266e9 -model_k1 4.322e10"
                  " -model_f0 4.44e7 -model_zeta 4.1e6 -model_v 5.1e-8 -friction_law rate-and-state -state_law ageing -friction_a 0.015"
                  " -friction_b 0.0333 -friction_D 1.46e-4 -friction_mu0 0.392 -friction_psi0 5.1e-8 -init_psi 5.32e-8 -init_noise 5e-9"
                  " -init_state 2865 -init_eta steady -ts_max_time 2.07e6")
    check("near sliding" not in told, told)
