"""Friction that falls with slip and begins anew at stops (slip-weakening with the state laws slip-since-stop and
slip-healed-at-rest), by a formula or a table of strength against slip: motions, recurrence, multipliers and exponents against
SciPy with its own search for starts and stops."""
import glob
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import reference
from calls import data, refused, run
from reference import Stick, System, options, read

STATES = ("slip-since-stop", "slip-healed-at-rest")
STRICT = "-ts_rtol 1e-11 -ts_atol 1e-12"


def weakening(kind, rng):
    if kind == "table":
        slips = np.concatenate([[0.], np.cumsum(rng.uniform(0.1, 0.6, 2))])
        points = zip(slips, [rng.uniform(0.9, 1.2), rng.uniform(0.6, 0.8), rng.uniform(0.3, 0.5)])
        return "-friction_weakening table -friction_strength " + ",".join(f"{s:.3f}:{f:.3f}" for s, f in points)
    return (f"-friction_weakening {kind} -friction_fs {rng.uniform(0.9, 1.2):.3f} -friction_fd {rng.uniform(0.3, 0.6):.3f} "
            f"-friction_Dc {rng.uniform(0.2, 0.8):.3f}")


def random_scene(rng, kind, state, n):
    heals = f"-state_t_h {rng.uniform(1, 10):.3f}" if state == "slip-healed-at-rest" else ""
    places = ",".join(f"{i}:{a:.3f}" for i, a in enumerate(rng.uniform(0.8, 1.2, n)))
    amplitude = f"-friction_amplitude_profile {places}" if n > 1 else ""
    return (f"-model_form chain -grid_n {n} -bc_left free -model_k0 {rng.uniform(0.3, 1):.3f} -model_k1 {rng.uniform(0.3, 1):.3f} "
            f"-model_zeta {rng.uniform(0, 0.1):.3f} -model_v {rng.uniform(0.05, 0.2):.3f} -friction_law slip-weakening "
            f"-state_law {state} {heals} {amplitude} {weakening(kind, rng)}")


def drawn(rng):
    return random_scene(rng, str(rng.choice(["exponential", "linear", "table"])), str(rng.choice(STATES)), 4)


def test_motions_agree_with_scipy(scenes):
    """Of chains of four blocks that start in motion, by steps of the whole and of what moves alone, through starts and stops."""
    changes = 0
    for index, scene in scenes(drawn, 71, short=6):
        stick = Stick(System(options(scene)), np.r_[np.full(4, 0.1), np.zeros(8)])
        end = stick.advance(40.)
        changes += stick.changes
        for clusters in ("off", "on"):
            run(f"{scene} -init_psi 0.1 -init_eta 0 -ts_max_time 40 -out_file run.h5 -out_frames 2 -stick_clusters {clusters} {STRICT}")
            # a kink in strength is met within a step: its error is that of the step's tolerance, times what changes make of it
            off = np.abs(read(data("run.h5"), -1) - end).max()
            assert off < 1e-6, (index, scene, clusters, off)
    assert changes > 30


def cycle_of_block(scene):
    """Period and slip of one block that is renewed at stops, from SciPy: the slip from the threshold on, and the rest."""
    p, system = options(scene), System(options(scene))
    system.going = np.array([1.])
    slip = solve_ivp(system.rates, (0, 1e3), [0, float(system.law.threshold(0.)), 0.], method="DOP853", rtol=1e-12, atol=1e-13,
                     events=stops, max_step=0.01)
    eta, time = slip.y_events[0][0][1], slip.t_events[0][0]
    return time + (float(system.law.threshold(0.)) - eta) / (p["model_k0"] * p["model_v"])


def stops(t, u):
    return u[0] if t > 1e-3 else 1.


stops.terminal, stops.direction = True, -1


@pytest.mark.parametrize("kind", ["exponential", "linear", "table"])
def test_recurrence_of_a_block(kind):
    """Of a plate a thousand times slower than the slip, as of faults; and Coulomb's closed form where slip weakens at once."""
    rng = np.random.default_rng([72, len(kind)])
    scene = (f"-model_form chain -grid_n 1 -bc_left free -model_k0 0.4 -model_v 1e-4 -friction_law slip-weakening "
             f"-state_law slip-since-stop {weakening(kind, rng)}")
    want = cycle_of_block(scene)
    cycle, _ = run(scene, command="cycle")
    assert abs(cycle["period"] / want - 1) < 1e-6
    found, _ = run(f"{scene} -ts_max_time {12 * want} -ts_rtol 1e-9 -ts_atol 1e-10")
    assert abs(found["period"] / want - 1) < 1e-6


def test_weakening_at_once_is_coulombs():
    """Without a length to weaken over a block slips for half a period of its spring, by twice the drop less what the plate does."""
    k, v, drop, length = 0.4, 0.01, 0.5, 1e-9
    scene = (f"-model_form chain -grid_n 1 -bc_left free -model_k0 {k} -model_v {v} -friction_law slip-weakening -friction_Dc {length} "
             "-state_law slip-since-stop")
    # psi = v (1 - cos wt) + (drop/w) sin wt, w^2 = k: back at 0 when tan(wt/2) = -drop/(v w)
    w = math.sqrt(k)
    slips = 2 / w * (math.pi - math.atan(drop / (v * w)))
    moved = v * (slips - math.sin(w * slips) / w) + drop / k * (1 - math.cos(w * slips))
    cycle, _ = run(scene, command="cycle")
    # over that length slip grows like exp(t sqrt(drop/length)): fewer than 36 (ln 1e16) times of that from round-off on
    assert 0 < cycle["period"] - moved / v < 36 * math.sqrt(length / drop)


def test_multipliers_and_exponents():
    """A state that rest heals by the time it lasts carries a deviation into the next slip; one that is renewed does not."""
    rng = np.random.default_rng(73)
    for state in STATES:
        scene = random_scene(rng, "exponential", state, 1) + " -model_v 0.03"
        cycle, _ = run(f"{scene} -out_file c.h5", command="cycle")
        system = System(options(scene))
        start = read(data("c.h5"), 0)
        stick = Stick(system, start, 0., np.eye(3))
        # from the release on: one slip and one rest
        end = stick.advance(cycle["period"] * (1 - 1e-9))
        assert np.abs(end - start).max() < 1e-5
        others = sorted((abs(complex(m["re"], m["im"])) for m in cycle["multipliers"]), key=lambda m: abs(m - 1))[1:]
        largest = max(others)  # but for that of the phase
        if state == "slip-since-stop":
            assert largest < 1e-12
            continue
        # the deviation of the slip memory at the release, eta being at the threshold that goes with it
        step = 1e-5

        def returned(s):
            threshold = float(system.law.threshold(s))
            system.going = np.array([1.])
            slip = solve_ivp(system.rates, (0, 1e3), [0, threshold, s], method="DOP853", rtol=1e-12, atol=1e-13, events=stops, max_step=0.05)
            _, eta, left = slip.y_events[0][0]
            p = options(scene)

            def at(t):
                return left * math.exp(-t / p["state_t_h"])
            t = brentq(lambda t: eta + p["model_k0"] * p["model_v"] * t - float(system.law.threshold(at(t))), 0, 1e4, xtol=1e-13)
            return at(t)
        s = start[2]
        slope = (returned(s + step) - returned(max(s - step, 0))) / (s + step - max(s - step, 0))
        assert abs(largest - abs(slope)) < 1e-3 * abs(slope) + 1e-9


def test_a_stop_in_a_checkpoint():
    """A run that goes on from a checkpoint has the same bits: the state is renewed before anybody is told of the stop."""
    rng = np.random.default_rng(74)
    scene = random_scene(rng, "exponential", "slip-since-stop", 3)
    run(f"{scene} -ts_max_time 60 -out_file whole.h5 -out_frames 2 -stick_clusters off")
    run(f"{scene} -ts_max_time 60 -out_file part.h5 -out_frames 2 -stick_clusters off -out_checkpoint_every 1 -out_checkpoint_keep 60 -ts_max_steps 45")
    whole = read(data("whole.h5"), -1)
    for name in sorted(glob.glob("part.chk-*.h5"))[::6]:
        run(f"-restart {name} -out_file part.h5 -ts_max_steps unlimited")
        assert np.array_equal(whole, read(data("part.h5"), -1)), name


def test_what_has_no_meaning_is_refused():
    block = "-model_form chain -grid_n 1 -bc_left free -friction_law slip-weakening"
    refused(f"{block} -state_law slip-since-stop -friction_stick regularised", 2, "-friction_stick exact")
    refused(f"{block} -state_law slip-since-stop -state_t_h 3", 2, "state_t_h")
    refused(f"{block} -friction_weakening table", 2, "-friction_strength is missing")
    refused(f"{block} -friction_weakening table -friction_strength 0:1,1:0.5 -friction_fs 2", 2, "friction_fs")
    refused(f"{block} -friction_strength 0:1,1:0.5", 2, "friction_strength")
    refused(f"{block} -friction_weakening table -friction_strength 1:1,0:0.5", 2, "ascend")
    refused(f"{block} -friction_weakening table -friction_strength 0:0,1:0.5", 2, "above 0 at first")
    refused(f"{block} -state_law slip-since-stop -model_v 0.1", 1, "without end in motion", command="spectrum")
