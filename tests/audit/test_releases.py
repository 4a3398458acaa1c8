"""Blocks that rest and are shaken, by a force, by the plate, by the normal load, with strengths near that which just moves them: how
often and when each slips, against a count of its own, in which a rest is a formula looked at closely, and a slip an integration."""
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import calls
from reference import System, words

NEAR = 200  # places looked at in the shortest period


class Block:
    """One block of a scene. Forces are those of spring and load together, to one side."""

    def __init__(self, p):
        self.p, self.system = p, System(p)
        self.system.begin_piece(0)
        self.law, self.state = self.system.law, self.system.law.state != "none"
        periods = [p[f"{name}_period"] for name in ("load_sine", "load_force_sine", "load_normal_sine") if f"{name}_period" in p]
        self.points = np.array(self.system.plate.points).T
        normal = np.array(self.system.loads.normal.points).T
        for times in (self.points[0], normal[0]):
            periods += list(2 * np.diff(np.unique(times)))
        self.step = min(periods) / NEAR
        self.normal = self.system.normal
        if "load_normal" in p:  # through its corners
            self.normal = self.system.normal = lambda t: np.interp(t, *normal)
        if "load_v" in p:
            self.system.v = lambda t: np.interp(t, *self.points)

    def way(self, t):
        turn, (times, v) = 2 * np.pi / self.p.get("load_sine_period", 1), self.points
        begins = np.r_[0, np.cumsum(np.diff(times) * (v[1:] + v[:-1]) / 2)]
        piece = np.maximum(np.searchsorted(times, t, "right") - 1, 0)
        straight = begins[piece] + (t - times[piece]) * (v[piece] + np.interp(t, times, v)) / 2
        return straight + self.p.get("load_sine_amplitude", 0) * (1 - np.cos(turn * t)) / turn

    def resting(self, since, eta, s):
        """The excess over the threshold on either side, as a function of time and side."""
        K0, one_way = float(np.mean(self.system.K0)), self.law.one_way

        def state(t):
            if self.law.state == "healing":
                return self.law.g.tau_inf + (s - self.law.g.tau_inf) * np.exp(-(t - since) / self.law.g.t_h)
            return s * np.exp(-(t - since) / self.law.g.t_h) if self.state else 0.

        def excess(t, side):
            force = eta + K0 * (self.way(t) - self.way(since)) + self.system.push(t)
            return -1. if side < 0 and one_way else side * force - self.normal(t) * self.law.threshold(state(t))
        return excess, state, lambda t: eta + K0 * (self.way(t) - self.way(since))

    def release(self, excess, since, end):
        """(time, side) of the first from `since` on, where it is not beyond; None."""
        for begin in np.arange(since, end, 100 * self.step):
            t = begin + self.step * np.arange(102)
            found = []
            for side in (1, -1):
                g = np.array([excess(x, side) for x in t]) if self.state else excess(t, side) * np.ones(len(t))
                for k in range(101):
                    high = t[k + 1] if g[k + 1] > 0 else None
                    if high is None and 0 < k and g[k] > max(g[k - 1], g[k + 1]) - 1e-9:  # between
                        best = minimize_scalar(lambda x: -excess(x, side), bounds=(t[k - 1], t[k + 1]), method="bounded",
                                               options={"xatol": 1e-9 * self.step})
                        high = best.x if best.fun < 0 else None
                    if high is None:
                        continue
                    low = t[max(k - 1, 0)]
                    if excess(low, side) >= -1e-14:  # it is at the threshold, which the force leaves behind first
                        low = next((x for x in np.linspace(low, high, 2000) if excess(x, side) < -1e-14), high)
                    if low < high:
                        found.append((brentq(lambda x: excess(x, side), low, high, xtol=1e-14), side))
                        break
                    found.append((low, side))
                    break
            if found:
                first = min(found)
                return first if first[0] < end else None
        return None

    def slips(self, eta, s, end):
        """(begin, end, side) of each slip; s: the state, if there is one."""
        t, found, eta, self.rests = 0., [], float(eta), []
        while t < end:
            excess, state, elastic = self.resting(t, eta, s)
            released = self.release(excess, t, end)
            self.rests.append((t, released[0] if released else end, elastic))
            if not released:
                break
            t0, side = released
            u = np.array([0., elastic(t0)] + ([state(t0)] if self.state else []))
            self.system.going = np.array([float(side)])

            def stops(t, u):
                return u[0] * side if t > t0 + 1e-9 * self.step else 1.
            stops.terminal, stops.direction = True, -1
            slip = solve_ivp(self.system.rates, (t0, end), u, method="DOP853", rtol=1e-11, atol=1e-14, events=stops,
                             max_step=2 * self.step)
            t, u = slip.t[-1], slip.y[:, -1]
            found.append((t0, t, side))
            eta, s = float(u[1]), float(u[2]) if self.state else 0.
            excess = self.resting(t, eta, s)[0]
            assert max(excess(t, 1), excess(t, -1)) < 0, "it turns without a rest: not drawn here"
        return found


def draw(random):
    """A block that a load just moves, by `margin` of its threshold, or just not."""
    margin = float(random.choice([-1, 1], p=[0.2, 0.8])) * 10**random.uniform(-3.5, -1)
    law = str(random.choice(["coulomb", "stribeck", "carlson-langer", "slip-weakening", "healing"]))
    fs = round(random.uniform(0.5, 1.5), 2)
    p = {"model_form": "chain", "grid_n": 1, "bc_left": "free", "model_v": 0., "model_m": random.uniform(0.5, 2),
         "model_k0": 10**random.uniform(-3, -1), "model_zeta": float(random.choice([0, 0.1])),
         "friction_law": "coulomb" if law == "healing" else law}
    if law in ("coulomb", "healing", "slip-weakening"):
        p |= {"friction_fs": fs, "friction_fd": round(fs * float(random.choice([1, 0.98])), 3)}
    if law == "slip-weakening":
        p |= {"state_t_h": random.uniform(0.05, 0.3), "friction_Dc": random.uniform(0.5, 2)}
    if law == "stribeck":
        p |= {"friction_fs": fs, "friction_fc": round(fs - 0.02, 2), "friction_vs": 1.}
    if law == "carlson-langer":
        fs = 1
    if law == "healing":
        p |= {"state_law": "healing", "state_t_h": random.uniform(0.05, 0.2), "state_tau_inf": random.uniform(1.02, 1.1)}
    limit, period = fs * p.get("state_tau_inf", 1), random.uniform(0.5, 2)
    kind = int(random.integers(6))
    start = {"init_psi": 0., "init_eta": 0., "ts_max_time": period * 5}
    if kind == 0:  # a force
        p |= {"load_force_sine_amplitude": limit * (1 + margin), "load_force_sine_period": period}
    elif kind == 1:  # the plate, there and back
        turn = 2 * np.pi / period
        start["init_eta"] = random.uniform(-0.5, 0.5) * limit
        p |= {"load_sine_amplitude": (limit * (1 + margin) - start["init_eta"]) * turn / (2 * p["model_k0"]), "load_sine_period": period}
    elif kind == 2:  # the normal load
        depth = random.uniform(0.05, 0.5)
        p |= {"load_normal_sine_amplitude": depth, "load_normal_sine_period": period}
        start["init_eta"] = limit * (1 - depth) * (1 + margin)
    elif kind == 3:  # a force and the normal load
        p |= {"load_force_sine_amplitude": 0.9 * limit, "load_force_sine_period": period, "load_normal_sine_amplitude": 0.1 + abs(margin),
              "load_normal_sine_period": period * float(random.choice([0.5, 1, 1.5]))}
    else:  # a file, of the plate there and back, with corners or at once, or of the normal load
        ends = np.r_[0, np.cumsum(period * random.uniform(0.6, 1.4, 4))]
        depth, jumps = random.uniform(0.05, 0.5), random.random() < 0.5
        start["init_eta"] = limit * (random.uniform(-0.5, 0.5) if kind == 4 else (1 - depth) * (1 + margin))
        points = [] if kind == 4 and jumps else [(0., 0. if kind == 4 else 1.)]
        for begin, end in zip(ends, ends[1:]):
            whole = end - begin
            v = (limit * (1 + margin) - start["init_eta"]) / p["model_k0"] / whole * (2 if jumps else 4)
            there_and_back = ([(0, v), (0.5, v), (0.5, -v), (1, -v)] if jumps else [(0.25, v), (0.75, -v), (1, 0)])
            points += [(begin + part * whole, value) for part, value in (there_and_back if kind == 4 else [(0.5, 1 - depth), (1, 1.)])]
        p["load_v" if kind == 4 else "load_normal"] = ",".join(f"{t!r}:{value!r}" for t, value in points)
    if law == "slip-weakening":
        start["init_state"] = 0.
    if law == "healing":
        start["init_state"] = p["state_tau_inf"]
    p["friction_back_slip"] = str(random.choice(["true", "true", "false"]))
    return p, start, 10**random.uniform(-9, -5)


def in_files(p):
    """The options, with loads that go by points in files."""
    files = {name: f"{name}.txt" for name in ("load_v", "load_normal") if name in p}
    for name, path in files.items():
        with open(path, "w", encoding="ascii") as file:
            file.write(p[name].replace(":", " ").replace(",", "\n"))
    return words(p | files)


def test_shaken_blocks(scenes):
    total = 0
    for index, (p, start, tolerance) in scenes(draw, salt=91, short=4):
        calls.run(in_files(p | start) + ["-ts_rtol", tolerance, "-ts_atol", tolerance, "-out_events", "-out_file", "b.h5"])
        found = calls.data("b.h5")
        try:
            exact = Block(p).slips(start["init_eta"], start.get("init_state", 0.), start["ts_max_time"])
        except AssertionError as skipped:
            print(index, skipped)
            continue
        ended = [(begin, end) for begin, end, _ in exact if end < start["ts_max_time"]]
        text = f"scene {index} {words(p | start)} at {tolerance}"
        assert len(found["events/begin"]) == len(ended), f"{text}: {len(found['events/begin'])} events of {len(ended)}"
        if ended:
            off = np.abs(found["events/begin"] - np.array(ended)[:, 0]).max()
            assert off < 30 * np.sqrt(tolerance), f"{text}: an event begins {off} beside its time"
        total += len(ended)
    print(total, "slips")
    assert total > 10


def draw_for_exponents(random):
    """The same on stiffer springs, which what it slips tells, without a state; from rest to rest."""
    while True:
        p, start, _ = draw(random)
        if p["friction_law"] == "slip-weakening" or {"state_law", "load_v", "load_normal"} & set(p):
            continue
        p |= {"model_k0": 10**random.uniform(-0.5, 0.7), "friction_back_slip": "true"}
        if "load_sine_period" in p:  # as far as before
            p["load_sine_amplitude"] *= 0.1 / p["model_k0"] * random.uniform(1, 3)
        return p, start


def test_exponents_of_shaken_blocks(scenes):
    """How a deviation of the force shrinks from one rest to a later one, against differences of the motion."""
    compared = slips = 0
    for index, (p, start) in scenes(draw_for_exponents, salt=93, short=3):
        block, end, apart, moved = Block(p), start["ts_max_time"], (-4e-6, -1e-6, 1e-6, 4e-6), []
        try:
            for by in apart:
                count = len(block.slips(start["init_eta"] + by, 0., end))
                moved.append(block.rests)
        except AssertionError:
            print(index, "it turns without a rest")
            continue
        if len({len(rests) for rests in moved}) > 1 or len(moved[0]) < 3 or moved[0][-1][1] < end:
            print(index, "it slips too seldom, does not end at rest, or slips more often beside it")
            continue
        # late in a rest: growth counts evenly over a step, with that of the stop before it
        since, until = max(rests[1][0] for rests in moved), min(rests[1][1] for rests in moved)
        begin = until - 1e-5 * (until - since)
        first, last = ([rests[k][2](t) for rests in moved] for k, t in ((1, begin), (-1, end)))
        wide, narrow = (np.log((last[-k - 1] - last[k]) / (first[-k - 1] - first[k])) for k in (0, 1))
        if not abs(wide - narrow) < 1e-4 * abs(narrow) + 1e-5:
            print(index, "it grazes its threshold")
            continue
        calls.run(words(p | start) + ["-ts_rtol", 1e-9, "-ts_atol", 1e-12, "-lyapunov_count", 1, "-lyapunov_from", repr(begin),
                                      "-out_file", "l.h5"])
        rows = calls.data("l.h5")  # the summary weighs them, the middle of the time most
        found = np.sum(rows["lyapunov/rate_1"] * np.diff(np.concatenate([[begin], rows["lyapunov/t"]])))
        assert abs(found - narrow) < 1e-3 * abs(narrow) + 1e-4, f"scene {index} {words(p | start)}: {found} for {narrow}"
        compared += 1
        slips += count
    print(compared, "exponents of", slips, "slips")
    assert compared > 0


def draw_chain(random):
    """Blocks on springs between them, that a plate which goes there and back just moves."""
    n, period, eta = int(random.integers(6, 40)), random.uniform(0.5, 2), random.uniform(-0.3, 0.3)
    p = {"model_form": "chain", "grid_n": n, "bc_left": "free", "model_m": random.uniform(0.5, 2), "model_k0": 10**random.uniform(-3, 0),
         "model_k1": 10**random.uniform(-2, 0), "model_v": float(random.choice([0, 1e-3, -1e-3])), "scene_reduce": "off",
         "friction_law": str(random.choice(["coulomb", "carlson-langer"])), "friction_spread": float(random.choice([0, 1e-3, 0.05])),
         "friction_seed": int(random.integers(1, 1000)), "load_sine_period": period, "init_psi": 0., "init_eta": eta,
         "ts_max_time": 8 * period}
    if p["friction_law"] == "coulomb":
        p["friction_fd"] = float(random.choice([1, 0.99, 0.9]))
    if random.random() < 0.3:
        p["model_nu"] = random.uniform(0.01, 0.2)
    margin = 10**random.uniform(-3, -1)
    return p | {"load_sine_amplitude": (1 + margin - eta) * np.pi / (period * p["model_k0"])}


def test_shaken_chains_with_clusters_and_without(scenes):
    total = 0
    for index, p in scenes(draw_chain, salt=92, short=2):
        found = []
        for clusters in ("on", "off"):
            calls.run(words(p) + ["-stick_clusters", clusters, "-ts_rtol", 1e-9, "-ts_atol", 1e-11, "-out_events", "-out_frames", 2,
                                  "-out_file", "c.h5"])
            found.append(calls.data("c.h5"))
        one, other = found
        text = f"scene {index} {words(p)}"
        assert len(one["events/begin"]) == len(other["events/begin"]), \
            f"{text}: {len(one['events/begin'])} events in clusters, {len(other['events/begin'])} by steps of the whole"
        off = np.abs(one["eta"][-1] - other["eta"][-1]).max()
        assert off < 1e-5, f"{text}: eta ends {off} beside"
        total += len(one["events/begin"])
    print(total, "events")
    assert total > 20
