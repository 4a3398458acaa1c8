"""Nodes without friction (an amplitude of 0 in friction_amplitude_profile): a string that is bowed at one block, and random chains, by exact
stick and smooth, against SciPy; their spectrum against numpy's; cycles, ranks, restarts; what is refused."""
import glob

import numpy as np
from scipy.integrate import solve_ivp

from calls import check, data, refused, run, same
from reference import Stick, System, multipliers

TIGHT = " -ts_rtol 1e-10 -ts_atol 1e-12 "
STRING = ("-model_form chain -grid_n 9 -bc_left velocity -bc_right velocity -bc_left_value 0 -bc_right_value 0 -model_k0 0 -model_k1 4 "
          "-model_zeta 0.05 -friction_amplitude_profile 0:0,1:0,2:1,3:0,8:0 ")


def drawn(rng):
    """A chain in which some blocks have friction, its forces at the start, and how long it is followed."""
    n = int(rng.integers(2, 7))
    amplitude = np.where(rng.random(n) < 0.5, 0, rng.uniform(0.5, 1.5, n))
    amplitude[rng.integers(n)] = 1.
    amplitude[(np.flatnonzero(amplitude)[0] + 1) % n] = 0
    law = rng.choice(["coulomb -friction_fd 0.6", "carlson-langer", "stribeck -friction_fc 0.5 -friction_p 1.5", "cubic",
                      "carlson-langer -state_law healing -friction_stick regularised -friction_eps 0.1",
                      "rate-and-state -friction_psi0 1e-3 -state_law slip", "coulomb -friction_stick regularised -friction_eps 0.05"])
    profile = ",".join(f"{k}:{a!r}" for k, a in enumerate(amplitude.tolist()))
    return (f"-model_form chain -grid_n {n} -bc_left free -friction_law {law} -friction_amplitude_profile {profile} "
            f"-model_k0 {rng.uniform(0.2, 1)!r} -model_k1 {rng.uniform(0.2, 2)!r} -model_zeta {rng.uniform(0.1, 0.4)!r} "
            f"-model_v {rng.uniform(0.2, 0.6) * rng.choice([-1, 1])!r} "), rng.uniform(-0.4, 0.4), 15.


def sticks(scene):
    return any(law in scene for law in ("coulomb", "carlson", "stribeck")) and "regularised" not in scene


def by_scipy(scene, eta, end):
    system = System(scene)
    psi, eta = np.full(system.n, 0.05), np.full(system.n, eta)
    if sticks(scene):
        return Stick(system, np.r_[psi, eta]).advance(end)
    s = [system.law.steady(psi)] if system.kinds == 3 else []
    return solve_ivp(system.rates, (0, end), np.concatenate([psi, eta, *s]), method="LSODA", rtol=1e-11, atol=1e-13).y[:, -1]


def test_runs_against_scipy(scenes):
    for index, (scene, eta, end) in scenes(drawn, 64, short=4):
        run(f"{scene}{TIGHT}-init_psi 0.05 -init_eta {eta!r} -ts_max_time {end} -out_frames 2 -out_file r.h5")
        psi, eta_end = data("r.h5")["psi"][-1], data("r.h5")["eta"][-1]
        truth = by_scipy(scene, eta, end)
        n = len(psi)
        off = max(np.abs(psi - truth[:n]).max(), np.abs(eta_end - truth[n:2 * n]).max())
        check(off < 2e-6, f"{index}: {scene}: {off:.1e}")


def test_spectra_against_numpy(scenes):
    for index, (scene, _, _) in scenes(drawn, 65, short=3):
        found, _ = run(scene + "-spectrum_count 4", command="spectrum")
        exact = System(scene).eigenvalues()
        check(abs(found["growth_rate"] - exact[0].real) < 1e-8, f"{index}: {scene}: {found['growth_rate']}, {exact[0]}")


def test_a_bowed_string():
    """Held ends, no springs to a plate: the string is drawn by the bow alone, which moves at v in the frame of the string."""
    # in the bow's frame the ends go at -v, and friction is that of the block's own velocity there
    scene = STRING.replace("_value 0", "_value -0.3") + "-friction_law carlson-langer -init_psi -0.3 -init_eta 0 "
    s, _ = run(scene + TIGHT + "-ts_max_time 30 -out_frames 301 -out_file b.h5 -out_checkpoint_every 200 -out_checkpoint_keep 99")
    psi = data("b.h5")["psi"]
    bowed = psi[150:, 2]
    check((bowed == 0).mean() > 0.1 and bowed.min() < -0.3, f"the string sticks to the bow: {(bowed == 0).mean()}")
    check(not (psi[:, 5] == 0).any(), "and elsewhere it never rests")
    check(s["clusters_reason"] is None or "nodes" in s["clusters_reason"] or "friction_amplitude" in s["clusters_reason"], s["clusters_reason"])
    truth = data("b.h5")
    kept = sorted(glob.glob("b.chk-*.h5"))
    run(f"-restart {kept[1]} -out_file b.h5")
    same(data("b.h5"), truth, kept[1])
    run(scene + TIGHT + "-ts_max_time 30 -out_frames 301 -out_file two.h5 -out_checkpoint_every 200", ranks=2)
    check(np.abs(data("two.h5")["psi"] - truth["psi"]).max() < 1e-9, "two ranks")


def test_cycles_against_runs():
    """A cycle with rests of a chain in which one block of three has friction, and one with smooth friction."""
    scene = ("-model_form chain -grid_n 3 -bc_left free -model_k0 0.3 -model_k1 0.5 -model_zeta 0.2 -model_v 0.3 -friction_amplitude_profile "
             "0:1,1:0,2:0 -cycle_cell 0 -friction_law carlson-langer -init_psi 0.1 -init_eta 0.2 ")
    for more in ("", "-friction_stick regularised -friction_eps 0.05 "):
        found, _ = run(scene + more, command="cycle")
        s, _ = run(scene.replace("-cycle_cell 0", "") + more + TIGHT + f"-ts_max_time {100 * found['period']!r} -out_probes 0")
        turns = found["period"] / s["period"]  # of the motion in a cycle
        check(abs(turns / round(turns) - 1) < 1e-6, f"{more}: {s['period']}, {found['period']}")
        check(found["stable"] and (found["rest_fraction"] > 0) == (not more or found["rest_fraction"] > 0), found["rest_fraction"])
        check(np.abs(multipliers(found)).max() < 1 + 1e-8, "its multipliers")


def test_refused():
    chain = "-model_form chain -grid_n 4 -bc_left free -ts_max_time 1 "
    refused(chain + "-friction_amplitude_profile 0:0,3:0", 2, "friction_amplitude_profile", "everywhere")
    refused(chain + "-friction_amplitude_profile 0:0,3:1 -model_drag 0.1", 2, "friction_amplitude_profile", "model_drag")
    refused(chain + "-friction_amplitude_profile 0:0,3:1 -model_m 0 -friction_law rate-and-state", 2, "friction_amplitude_profile", "model_zeta")
    refused(chain + "-friction_amplitude_profile 0:0,3:1 -friction_law dieterich", 2, "friction_amplitude_profile", "dieterich")
    refused(chain + "-friction_amplitude_profile 0:0,3:1 -friction_law coulomb -load_halt", 2, "load_halt", "friction_amplitude_profile")
    refused(chain + "-friction_amplitude_profile 0:0,3:1 -friction_law coulomb -stick_clusters on", 2, "stick_clusters", "friction_amplitude_profile")
    refused(chain + "-friction_amplitude_profile 0:-1,3:1", 2, "friction_amplitude_profile", ">= 0")
