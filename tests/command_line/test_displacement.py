"""The displacement of a chain on weak springs to the plate or without any, counted from the start, also under a harmonic force, and that of
a cycle."""
import glob

import h5py
import numpy as np
from scipy.integrate import solve_ivp

from calls import check, data, refused, run, same
from cluster_scenes import ON, start_file
from reference import Stick, System

FREE = "-model_form chain -model_k0 0 -model_f0 1 -out_displacement"
TIGHT = " -ts_rtol 1e-11 -ts_atol 1e-12 -out_series false"


def frames(path, *names):
    with h5py.File(path) as file:
        return [file[name][:] for name in ("t", *names)]


def test_blocks_are_those_of_scipy():
    """chi is the integral of psi from the start on."""
    rng = np.random.default_rng(3)
    for more in ("-model_m 0.7 -model_k1 2 -model_zeta 0.2 -bc_left periodic", "-model_m 2 -model_k1 0.4 -model_zeta 0.5 -bc_left free",
                 "-model_m 1 -model_k1 1.5 -model_zeta 0.3 -bc_left free -friction_law stribeck -friction_stick regularised -friction_eps 0.3"):
        eta = rng.uniform(-1, 1.5, 6)
        scene = FREE.replace("-model_f0 1", "-model_f0 1.4") + " -grid_n 6 " + more
        run(scene + start_file(eta) + TIGHT + " -ts_max_time 12 -out_frames 9 -out_file r.h5")
        t, chi, psi = frames("r.h5", "chi", "psi")
        system = System(scene)
        v, _, x = solve_ivp(lambda t, y, system=system: np.r_[system.rates(t, y[:12]), y[:6]], (0, 12), np.r_[0 * eta, eta, 0 * eta],
                            method="DOP853", t_eval=t, rtol=1e-12, atol=1e-12).y.T.reshape(len(t), 3, 6).swapaxes(0, 1)
        check(np.abs(psi - v).max() < 1e-8 and np.abs(chi - x).max() < 1e-8, f"{more}: {np.abs(chi - x).max():.1e}, {np.abs(psi - v).max():.1e}")
        check(np.ptp(x) > 1, "they go somewhere")


PULLED = (FREE + " -grid_n 30 -model_m 1 -model_k1 3 -model_zeta 0.2 -bc_left free -friction_law coulomb -friction_fd 0.4 -init_psi 0.5"
          " -init_noise 0.3 -init_eta 0.9")


def test_momentum():
    # all slide forward: m (sum of psi) grows by n (eta(0) - fd) t - zeta (sum of chi)
    run(PULLED + TIGHT + " -ts_max_time 20 -out_frames 11 -out_file m.h5")
    t, chi, psi = frames("m.h5", "chi", "psi")
    check(psi.min() > 0, "nothing rests")
    by_momentum = ((0.9 - 0.4) * t - psi.mean(axis=1) + psi[0].mean()) / 0.2
    check(np.abs(chi.mean(axis=1) - by_momentum).max() < 1e-8, f"{np.abs(chi.mean(axis=1) - by_momentum).max():.1e}")


FRONT = (FREE + " -grid_n 40 -model_m 1 -model_k1 1 -bc_left free -friction_law coulomb -friction_fd 0.5 -friction_back_slip false"
         " -init_type text -init_file front.txt -out_events -ts_rtol 1e-9 -ts_atol 1e-9 -ts_max_time 400")


def front_file(left, right):
    eta = np.where(np.arange(40) < 15, left, right)
    eta[0] = 1.0 + 1e-9
    np.savetxt("front.txt", np.c_[np.arange(40), 0 * eta, eta], fmt="%.17g")


def test_slips_of_events_add_up():
    front_file(0.9, 0.1)
    s, _ = run(FRONT + " -out_frames 3 -out_series false -out_file f.h5")
    chi = frames("f.h5", "chi")[1]
    with h5py.File("f.h5") as file:
        moment = file["events/moment"][:].sum()
    check(s["events"] > 0 and abs(chi[-1].sum() - moment) < 1e-6 * moment and chi[-1].max() > 0.1, f"{chi[-1].sum()}, {moment}")
    check((chi[0] == 0).all(), "counted from the start")


def test_energy_of_what_pulls_at_the_start():
    # without friction in motion the sum of the energies stays 0
    front_file(0.6, 0.6)
    run(FRONT.replace("friction_fd 0.5", "friction_fd 0") + " -ts_max_time 30 -out_frames 2 -out_file e.h5")
    with h5py.File("e.h5") as file:
        kinetic, elastic, given = (file["series"][name][:] for name in ("energy_kinetic", "energy_elastic", "power_input"))
    check(kinetic.max() > 3 and np.abs(kinetic + elastic).max() < 1e-6 * kinetic.max() and not given.any(), f"{np.abs(kinetic + elastic).max()}")


def test_restarts_and_ranks():
    given = PULLED + " -ts_max_time 8 -out_frames 9 -out_checkpoint_every 9 -out_checkpoint_keep 99"
    run(given + " -out_file whole.h5")
    truth, kept = data("whole.h5"), sorted(glob.glob("whole.chk-*.h5"))
    check(len(kept) > 3, f"{len(kept)} checkpoints")
    for checkpoint in kept[::2]:
        run(f"-restart {checkpoint} -out_file whole.h5")
        same(data("whole.h5"), truth, checkpoint)
    run(given + " -out_file three.h5", ranks=3)
    three = data("three.h5")
    check(np.array_equal(three["psi"], truth["psi"]) and np.allclose(three["chi"], truth["chi"], rtol=1e-12, atol=1e-12), "three ranks")
    run(given + " -out_displacement false -out_file none.h5")
    refused(f"-restart {sorted(glob.glob('none.chk-*.h5'))[0]} -out_displacement true -out_file n.h5", 2, "restart", "since the start")


def drawn_weak(rng):
    """A chain whose springs to the plate are weak or none, so that a force is what moves it, with exact stick or smooth friction."""
    n, sign, k0 = int(rng.integers(1, 4)), rng.choice([-1, 1]), rng.choice([0, 10**rng.uniform(-10, -4)])
    law = rng.choice(["coulomb -friction_fd 0.6", "stribeck -friction_fc 0.5 -friction_vs 0.4", "tanh -friction_vs 0.2", "cubic"])
    return (f"-model_form chain -grid_n {n} -bc_left free -friction_law {law} -model_m {rng.uniform(0.5, 2)!r} -model_k0 {k0!r} "
            f"-model_k1 {rng.choice([0, rng.uniform(0.1, 2)])!r} -model_zeta {rng.uniform(0.1, 0.4)!r} "
            f"-model_v {rng.uniform(0.1, 0.5) * sign!r} -load_force_sine_amplitude {rng.uniform(1.1, 2)!r} "
            f"-load_force_sine_period {rng.uniform(3, 9)!r} ")


def weak_against_scipy(scene, eta, end=25):
    """The largest error of chi since the start over the way that is gone, of default tolerances and of strict ones."""
    system = System(scene)
    if "coulomb" in scene or "stribeck" in scene:
        motion = Stick(system, np.r_[0 * eta, eta])
        motion.advance(end)
        way = motion.slip
    else:
        system.begin_piece(0)
        n = system.n
        way = solve_ivp(lambda t, y: np.r_[system.rates(t, y[:2 * n]), y[:n]], (0, end), np.r_[0 * eta, eta, 0 * eta], method="DOP853",
                        rtol=1e-12, atol=1e-13).y[2 * n:, -1]
    errors, gone = [], None
    for tolerance in ("", TIGHT):
        run(scene + start_file(eta) + tolerance + f" -ts_max_time {end} -out_frames 101 -out_displacement -out_file w.h5")
        chi, psi = frames("w.h5", "chi", "psi")[1:]
        gone = end * np.abs(psi).mean()
        errors.append(np.abs(chi[-1] - chi[0] - way).max() / gone)
    return errors


def test_weak_springs_and_none(scenes):
    """An error of the force over k0 would be millions of times the way; what is left is that of the motion itself."""
    for index, (scene, eta) in scenes(lambda rng: (drawn_weak(rng), rng.uniform(-0.3, 0.3, 3)), 63, short=3):
        loose, strict = weak_against_scipy(scene, eta[:System(scene).n])
        check(loose < 1e-2 and strict < 1e-7, f"{index}: {scene}: {loose:.1e} {strict:.1e}")


def test_restarts_on_weak_springs():
    given = ("-model_form chain -grid_n 6 -model_k0 1e-6 -model_k1 0.3 -friction_law coulomb -friction_spread 0.2 -model_zeta 0.2 "
             "-load_force_sine_amplitude 1.3 -load_force_sine_period 4 -out_displacement -ts_max_time 12 -out_frames 13 "
             "-out_checkpoint_every 20 -out_checkpoint_keep 99")
    run(given + " -out_file whole.h5")
    truth, kept = data("whole.h5"), sorted(glob.glob("whole.chk-*.h5"))
    check(len(kept) > 2 and np.ptp(truth["chi"][-1]) > 0.01, f"{len(kept)} checkpoints")
    run(f"-restart {kept[1]} -out_file whole.h5 -ts_max_time 12")
    same(data("whole.h5"), truth, kept[1])
    run(given + " -out_file two.h5", ranks=2)
    check(np.allclose(data("two.h5")["chi"], truth["chi"], rtol=1e-12, atol=1e-11), "two ranks")


def test_where_forces_tell_it():
    """With springs that are not weak chi is what they say, to the last digit."""
    run("-model_form chain -grid_n 5 -model_k0 0.2 -model_v 0.3 -ts_max_time 40 -out_displacement -out_file k.h5")
    t, chi, eta = frames("k.h5", "chi", "eta")
    check(np.abs(0.2 * (0.3 * t[:, None] - chi) - eta).max() < 1e-12, "k0 (v t - chi) = f0 eta of alike blocks")


def test_blocks_that_nothing_ties():
    """Without any spring a block keeps its eta, and psi goes to where it carries it."""
    run("-model_form chain -grid_n 3 -model_k0 0 -model_k1 0 -friction_law tanh -model_zeta 0.5 -init_psi 0 -init_eta 0.9 -ts_max_time 20"
        " -out_displacement -out_frames 3 -out_file n.h5" + TIGHT)
    chi, psi, eta = frames("n.h5", "chi", "psi", "eta")[1:]
    check(np.abs(eta - 0.9).max() < 1e-12 and chi.min() >= 0 and chi[-1].min() > 1, f"{chi}")
    one = System("-model_form chain -grid_n 1 -model_k0 0 -model_k1 0 -friction_law tanh -model_zeta 0.5")
    x = solve_ivp(lambda t, y: np.r_[one.rates(t, y[:2]), y[0]], (0, 20), [0, 0.9, 0], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    check(np.abs(chi[-1] - x[2]).max() < 1e-8 and np.abs(psi[-1] - x[0]).max() < 1e-8, f"{chi[-1]}, {x[2]}")


def test_refused():
    refused(PULLED + ON + " -ts_max_time 1 -out_file n.h5", 2, "out_displacement", "stick_clusters")
    s, _ = run(PULLED + " -grid_n 80 -ts_max_time 1 -out_file n.h5")
    check(s["clusters"] is None and "out_displacement" in s["clusters_reason"], f"whole steps: {s['clusters_reason']}")


def test_cycle():
    """chi goes by psi, and by v T in a period."""
    for given in ("-model_form chain -model_k0 0.5 -model_v 0.3 -model_zeta 0.1", "-model_gamma 2 -model_delta 0 -model_v 0.4",
                  "-model_form chain -model_k0 0.5 -model_v 0.3 -friction_law coulomb -friction_fd 0.5"):
        s, _ = run(given + " -out_file c.h5", command="cycle")
        t, psi, eta, chi = frames("c.h5", "psi", "eta", "chi")
        v = float(given.split("-model_v ")[1].split()[0])
        check(abs(chi[-1, 0] - chi[0, 0] - v * s["period"]) < 1e-8, f"{given}: {chi[-1, 0] - chi[0, 0]}, {v * s['period']}")
        one = System(given + " -grid_n 1 -grid_order 2")
        p, f, dt = psi[:, 0], one.rates(0, np.c_[psi[:, 0], eta[:, 0]])[:, 0], np.diff(t)
        slips = dt * (p[1:] + p[:-1]) / 2 + dt**2 * (f[:-1] - f[1:]) / 12  # of the cubic between two times
        inside = slice(None) if "coulomb" not in given else (p[1:] != 0) & (p[:-1] != 0)
        apart = np.abs(np.diff(chi[:, 0]) - slips)[inside]
        check(apart.max() < 2e-9 * s["amplitude"] and np.median(apart) < 1e-9 and dt.size > 50, f"{given}: {apart.max()} {np.median(apart)}")
