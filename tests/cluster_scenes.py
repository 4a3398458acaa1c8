"""Random scenes of exact stick of which only what slides can be advanced (stick_clusters), and their events both ways."""
import h5py
import numpy as np
from scipy.integrate import solve_ivp

from calls import check, run
from reference import System

ON, OFF = " -stick_clusters on", " -stick_clusters off"


def catalogue(path):
    with h5py.File(path) as file:
        found = {name: data[:] for name, data in file["events"].items() if name != "rupture"}
        found.update({f"rupture/{name}": data[:] for name, data in file["events"].get("rupture", {}).items()})
    return found


def start_file(eta, h=1.0):
    np.savetxt("start.txt", np.c_[h * np.arange(len(eta)), 0 * eta, eta], fmt="%.17g")
    return " -init_type text -init_file start.txt"


def drawn_scene(rng, most=100, slow=1):
    """The words of a random scene of up to so many nodes, its start, and K0 |v|, smaller the slower."""
    n, v, ring = int(rng.integers(16, most)), float(rng.choice([1e-2, 3e-2, -1e-2])) / slow, rng.integers(2)
    end = 0.8 / abs(v)
    given = f"-grid_n {n} -model_v {v} -ts_rtol 1e-10 -ts_atol 1e-10"
    given += " -out_events -out_rupture -out_series false -out_frames 2"
    given += f" -friction_back_slip {'true' if v < 0 or rng.integers(2) else 'false'}"
    given += [" -friction_law coulomb", f" -friction_law carlson-langer -friction_alpha {rng.uniform(0.5, 3)}"
              f" -friction_sigma {rng.uniform(0.05, 0.3)}"][rng.integers(2)]
    chain = rng.integers(2)
    h = 1.0 if chain else 0.5 if ring else 0.5 * n / (n - 1)
    if rng.integers(2):
        given += f" -friction_spread {rng.uniform(0.05, 0.3)} -friction_seed {rng.integers(1000)}"
    if rng.integers(4) == 0:
        length = h * (n if ring else n - 1)
        given += f" -friction_amplitude_profile 0:1,{0.3 * length}:{rng.uniform(1, 1.3)},{0.7 * length}:{rng.uniform(0.8, 1)}"
    order = 2
    if chain:
        given += f" -model_form chain -model_m 1 -model_k0 1 -model_k1 {rng.uniform(0.2, 5)} -model_f0 1"
        given += f" -model_zeta {rng.uniform(0, 0.5) * rng.integers(2)}"
    else:
        order = int(rng.choice([2, 4, 6, 8]))
        given += f" -model_form continuum -grid_order {order} -grid_length {0.5 * n} -model_gamma 1"
        given += f" -model_c {rng.uniform(0.2, 1.5)} -model_delta {0.1 * rng.integers(2)}"
    # what slips is reached by an end that moves, but stays where it is wherever order 8 has none
    ends = "periodic" if ring else "velocity" if order < 8 and rng.integers(3) == 0 else "free"
    given += f" -bc_left {ends}"
    if ends == "velocity":
        given += f" -bc_left_value {v if rng.integers(2) else 0} -bc_right free"
    if rng.integers(4) == 0:
        given += f" -model_nu {rng.uniform(0.02, 0.3)}"
    kind = rng.integers(6)
    if kind == 0:
        given += f" -load_sine_amplitude {rng.uniform(0.5, 4) * abs(v)} -load_sine_period {rng.uniform(0.05, 0.5) * end}"
    elif kind == 1:
        given += f" -load_v 0:{v},{0.4 * end}:{2 * v},{0.4 * end}:{-0.5 * v},{0.6 * end}:{-0.5 * v},{0.7 * end}:{1.5 * v}"
    elif kind == 2 and "carlson" in given:
        given += f" -state_law healing -state_t_h {rng.uniform(5, 50)} -state_tau_inf {rng.uniform(1.1, 1.5)} -state_D {rng.uniform(0.2, 1)} -init_state 1.05"
    elif kind == 3:
        given += f" -state_law contact-age -state_b {rng.uniform(0.01, 0.05)} -state_theta0 {rng.uniform(0.5, 2)} -state_D {rng.uniform(0.2, 1)} -init_state 3"
    return given + f" -ts_max_time {end}" + start_file(np.sign(v) * rng.uniform(0, 0.7, n), h), abs(v)


def events_alike(given, loading):
    """How many events of whole steps and of clusters follow each other that agree: in place and extent, to 1e-7 in sizes and
    energies, and in times, at which eta comes to a threshold (of each node's first slip, too), to that over the rate of
    loading. And how many there are. What the two err by, some 1e-10 a step, grows from event to event, as the motion is chaotic,
    but by no jumps: the first event that does not agree so far does to ten thousand times as much."""
    run(given + OFF + " -out_file whole.h5")
    summary, _ = run(given + ON + " -out_file own.h5")
    whole, own = catalogue("whole.h5"), catalogue("own.h5")
    check(summary["events"] == len(own["t"]), f"events {summary['events']}: {given}")
    count = min(len(whole["t"]), len(own["t"]))

    def alike(bound):
        apart = np.zeros(count, bool)
        for name in ("left", "extent", "direction", "first"):
            apart |= whole[name][:count] != own[name][:count]
        for name in ("slip", "moment", "stress_drop", "strain_energy", "friction_work", "radiated"):
            apart |= ~np.isclose(whole[name][:count], own[name][:count], rtol=bound, atol=bound)
        for name in ("begin", "t"):
            apart |= np.abs(whole[name][:count] - own[name][:count]) > bound / loading
        return int(np.argmax(apart)) if apart.any() else count

    found = alike(1e-7)
    rows = int(np.append(own["rupture_offset"], len(own["rupture/x"]))[found])  # of the nodes of those events
    check(np.array_equal(whole["rupture/x"][:rows], own["rupture/x"][:rows]), f"other nodes: {given}")
    apart = np.abs(whole["rupture/time"][:rows] - own["rupture/time"][:rows])
    check((apart <= 1e-7 / loading).all(), f"other times of first slips, by {apart.max(initial=0)}: {given}")
    check(found == count or alike(1e-3) > found, f"a jump at event {found} of {count}: {given}")
    return found, max(len(whole["t"]), len(own["t"]))


def lone_slip(p, v=0.):
    """Of a block from its threshold on between blocks at rest (options by name, k0 v the plate's pull): (duration, eta at the
    end, slip, work of friction)."""
    stiff = p["model_k0"] + 2 * p["model_k1"]
    one = System(p | {"grid_n": 1, "model_k0": stiff, "model_v": p["model_k0"] * v / stiff})

    def rates(t, y):
        return [*one.rates(t, y[:2]), y[0], y[0] * one.law.force(y[0], 0., 1.)]

    def stops(t, y):
        return y[0] if t > 0 else 1.
    one.going, stops.terminal, stops.direction = np.ones(1), True, -1
    done = solve_ivp(rates, (0, 1000), [0, 1, 0, 0], method="DOP853", rtol=1e-13, atol=1e-16, events=stops)
    return done.t[-1], *done.y[1:, -1]
