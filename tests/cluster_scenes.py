"""Random scenes of exact stick of which only what slides can be advanced (stick_clusters), and their events both ways."""
import h5py
import numpy as np

from calls import check, run

ON = " -stick_clusters on"


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
    n, v, ring = int(rng.integers(8, most)), float(rng.choice([1e-2, 3e-2, -1e-2])) / slow, rng.integers(2)
    given = f"-grid_n {n} -model_v {v} -bc_left {'periodic' if ring else 'free'} -ts_rtol 1e-10 -ts_atol 1e-10"
    given += f" -ts_max_time {0.8 / abs(v)} -out_events -out_rupture -out_series false -out_frames 2"
    given += f" -friction_back_slip {'true' if v < 0 or rng.integers(2) else 'false'}"
    given += [" -friction_law coulomb", f" -friction_law carlson-langer -friction_alpha {rng.uniform(0.5, 3)}"
              f" -friction_sigma {rng.uniform(0.05, 0.3)}"][rng.integers(2)]
    if rng.integers(2):
        given += f" -friction_spread {rng.uniform(0.05, 0.3)} -friction_seed {rng.integers(1000)}"
    if rng.integers(2):
        given += f" -model_form chain -model_m 1 -model_k0 1 -model_k1 {rng.uniform(0.2, 5)} -model_f0 1"
        given += f" -model_zeta {rng.uniform(0, 0.5) * rng.integers(2)}"
        h = 1.0
    else:
        given += f" -model_form continuum -grid_order 2 -grid_length {0.5 * n} -model_gamma 1"
        given += f" -model_c {rng.uniform(0.2, 1.5)} -model_delta {0.1 * rng.integers(2)}"
        h = 0.5 if ring else 0.5 * n / (n - 1)
    return given + start_file(np.sign(v) * rng.uniform(0, 0.7, n), h), abs(v)


def events_alike(given, loading):
    """How many events of whole steps and of clusters follow each other that agree: in place and extent, to 1e-7 in sizes and
    energies, and in times, at which eta comes to a threshold (of each node's first slip, too), to that over the rate of
    loading. And how many there are. What the two err by, some 1e-10 a step, grows from event to event, as the motion is chaotic,
    but by no jumps: the first event that does not agree so far does to ten thousand times as much."""
    run(given + " -out_file whole.h5")
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
