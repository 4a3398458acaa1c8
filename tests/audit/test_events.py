"""Catalogues of slip events against motion computed another way: chains of Coulomb blocks, whose motion between two
changes is a sum of exponentials; the continuum with wide stencils, several events at once; and for the other laws the
frames at the beginnings and ends of the events."""
import h5py
import numpy as np
from scipy.optimize import brentq

import calls
from reference import Stick, System, words

from .test_stick import amplitudes


def catalogue(path):
    with h5py.File(path) as file:
        return {name: data[:] for name, data in file["events"].items()}


class Block_chain:
    """psi' = A (eta - B psi - fd dir), eta' = K0 v - K psi of the blocks that move; the others rest at |eta| <= fs."""

    def __init__(self, n, k0, k1, zeta, v, fs, fd, ring, back):
        self.n, self.k0, self.B, self.v, self.fs, self.fd, self.ring, self.back = n, k0, zeta, v, fs, fd, ring, back
        pairs = [(i, (i + 1) % n) for i in range(n if ring else n - 1)]
        self.K = k0 * np.eye(n)
        for i, j in pairs:
            self.K[i, i] += k1
            self.K[j, j] += k1
            self.K[i, j] -= k1
            self.K[j, i] -= k1
        self.beside = [{j for p in pairs if i in p for j in p} - {i} for i in range(n)]
        self.t, self.psi, self.eta, self.dir = 0., np.zeros(n), np.zeros(n), np.zeros(n, int)

    def motion(self):
        """q(t), psi(t) of the blocks that move, t an array counted from now."""
        M = np.flatnonzero(self.dir)
        kappa, Q = np.linalg.eigh(self.K[np.ix_(M, M)])
        g = Q.T @ (self.eta[M] - self.fd[M] * self.dir[M])
        beta = Q.T @ np.full(len(M), self.k0 * self.v) / kappa
        alpha = (g - self.B * beta) / kappa
        root = np.sqrt(self.B**2 / 4 - kappa + 0j)
        r1, r2 = -self.B / 2 + root, -self.B / 2 - root
        c1 = (Q.T @ self.psi[M] - beta + alpha * r2) / (r1 - r2)
        c2 = -alpha - c1

        def at(t):
            t = np.atleast_1d(t)[:, None]
            e1, e2 = c1 * np.exp(r1 * t), c2 * np.exp(r2 * t)
            return (alpha + beta * t + (e1 + e2).real) @ Q.T, (beta + (r1 * e1 + r2 * e2).real) @ Q.T
        return M, at, 2 * np.pi / np.sqrt(kappa.max())

    def gaps(self, M, at, t):
        """What is positive until something changes: velocities of blocks that move, distances to thresholds."""
        q, psi = at(t)
        eta = self.eta + self.k0 * self.v * np.atleast_1d(t)[:, None] - q @ self.K[:, M].T
        rest = np.flatnonzero(self.dir == 0)
        below = self.fs[rest] + eta[:, rest] if self.back else np.full((len(eta), len(rest)), 1.)
        return np.hstack([psi * self.dir[M], self.fs[rest] - eta[:, rest], below])

    def segment(self, t_end):
        """Goes on to the next change; returns (blocks that moved, dt, their q(t) and psi(t)), nothing for rest."""
        if not self.dir.any():
            wait = (self.fs - self.eta) / (self.k0 * self.v)
            first = int(np.argmin(wait))
            self.t += wait[first]
            self.eta += self.k0 * self.v * wait[first]
            self.eta[first] = self.fs[first]
            self.dir[first] = 1
            return None
        M, at, period = self.motion()
        rest = np.flatnonzero(self.dir == 0)
        step, begin = period / 150, 0.
        while True:
            t = begin + step * np.arange(1, 101)
            gone = self.gaps(M, at, t) < 0
            if gone.any():
                break
            begin = t[-1]
            if self.t + begin > t_end:  # it slides on
                self.t = t_end
                return M, begin, at
        k = int(np.argmax(gone.any(axis=1)))
        low = begin if k == 0 else t[k - 1]
        changes = []
        for j in np.flatnonzero(gone[k]):
            def gap(s, j=j):
                return self.gaps(M, at, s)[0, j]
            # a block that has just been let go has psi = 0 at the beginning of the segment
            start = low if gap(low) > 0 else low + 1e-6 * step
            assert gap(start) > 0
            changes.append((brentq(gap, start, t[k], xtol=1e-15, rtol=1e-15), j))
        dt, j = min(changes)
        q, psi = at(dt)
        self.t += dt
        self.eta = self.eta + self.k0 * self.v * dt - self.K[:, M] @ q[0]
        self.psi[M] = psi[0]
        if j < len(M):
            i = M[j]
            self.psi[i] = 0
            outside = self.eta[i] > self.fs[i] or (self.back and self.eta[i] < -self.fs[i])
            self.dir[i] = np.sign(self.eta[i]) if outside else 0
        else:
            i = rest[(j - len(M)) % len(rest)]
            self.dir[i] = 1 if j < len(M) + len(rest) else -1
        return M, dt, at

    def catalogue(self, t_end, most):
        """Events by the definition of docs/events.md: dictionaries, in order of their ends."""
        live, ended = [], []
        nodes, weights = np.polynomial.legendre.leggauss(12)
        began = {}  # eta of all blocks when events began
        while self.t < t_end and len(ended) < most:
            begin, before = self.t, self.eta.copy()
            done = self.segment(t_end)
            moved = set() if done is None else set(done[0])
            for event in [e for e in live if not e["nodes"] & moved]:
                live.remove(event)
                ended.append(self.closed(event, begin, before, began))
            if done is None:
                continue
            M, dt, at = done
            for i in M:
                if any(i in e["nodes"] for e in live):
                    continue
                near = [e for e in live if e["nodes"] & self.beside[i]]
                if not near:
                    began[begin] = before
                    near = [{"nodes": set(), "begin": begin, "d": np.zeros(self.n), "friction": 0., "radiated": 0.,
                             "merged": False, "first": i}]
                    live.append(near[0])
                near.sort(key=lambda e: e["begin"])
                for other in near[1:]:
                    near[0]["nodes"] |= other["nodes"]
                    near[0]["merged"] = True
                    for key in ("d", "friction", "radiated"):
                        near[0][key] = near[0][key] + other[key]
                    live.remove(other)
                near[0]["nodes"].add(i)
            panels = max(1, int(np.ceil(dt * np.sqrt(np.abs(self.K).sum(axis=1).max()))))
            s = (np.arange(panels)[:, None] + (nodes + 1) / 2).ravel() * dt / panels
            square = (np.tile(weights / 2, panels) * dt / panels) @ at(s)[1]**2
            q = at(dt)[0][0]
            for k, i in enumerate(M):
                event = next(e for e in live if i in e["nodes"])
                event["d"][i] += q[k]
                event["friction"] += self.fd[i] * abs(q[k])
                event["radiated"] += self.B * square[k]
        return ended

    def closed(self, event, end, eta, began):
        region = sorted(event["nodes"])
        duration = end - event["begin"]
        # before: what eta would be without this slip, and without what the plate has done
        before = eta + self.K @ event["d"] - self.k0 * self.v * duration
        d = event["d"][region]
        literal = np.abs(before - began[event["begin"]])[region].max() < 1e-9
        return {"begin": event["begin"], "t": end, "extent": len(region), "slip": d.max(), "moment": d.sum(),
                "stress_drop": (before - eta)[region].mean(),
                "strain_energy": (d * (before + eta)[region]).sum() / 2, "friction_work": event["friction"],
                "radiated": event["radiated"], "first": event["first"],
                "bound": self.k0 * self.v * duration * np.abs(d).sum() / 2, "merged": event["merged"],
                "literal": literal}


def draw_blocks(random):
    n = int(random.integers(3, 13))
    ring = bool(random.random() < 0.3)
    return dict(n=n, ring=ring, k0=random.uniform(0.1, 1), k1=random.uniform(0.3, 3),
                zeta=0. if random.random() < 0.5 else random.uniform(0.05, 0.5), v=10**random.uniform(-3, -1.3),
                fd=random.uniform(0.4, 0.9), spread=random.uniform(0.1, 0.5), seed=int(random.integers(1, 1000)),
                back=bool(random.random() < 0.7))


def options_of(s):
    return (f"-model_form chain -grid_n {s['n']} -model_k0 {s['k0']} -model_k1 {s['k1']} -model_zeta {s['zeta']}"
            f" -model_v {s['v']} -friction_law coulomb -friction_fd {s['fd']} -friction_spread {s['spread']}"
            f" -friction_seed {s['seed']} -friction_back_slip {str(s['back']).lower()}"
            f" -bc_left {'periodic' if s['ring'] else 'free'} -init_psi 0 -init_eta 0 -out_frames 2 -scene_reduce off")


def test_coulomb_chains(scenes):
    compared = {"events": 0, "blocks": 0, "merged": 0, "touched": 0}
    for index, s in scenes(draw_blocks, salt=606, short=5):
        # sliding friction in steady motion shows the factors of the thresholds
        calls.run(options_of(s) + " -init_psi 1 -init_eta steady -ts_max_time 0 -out_file a.h5")
        with h5py.File("a.h5") as file:
            factor = (file["eta"][0] - s["zeta"]) / s["fd"]
        t_end = 2.5 / (s["k0"] * s["v"])

        def by_hand(a):
            return Block_chain(s["n"], s["k0"], s["k1"], s["zeta"], s["v"], a, a * s["fd"], s["ring"], s["back"]
                               ).catalogue(t_end, 15)
        expected = by_hand(factor)
        # slips amplify round-off from event to event: what thresholds that differ by 1e-12 do says by how much
        shaken = by_hand(factor * (1 + 1e-12 * np.arange(s["n"])))
        if expected:  # else it slides on until the end
            t_end = min(t_end, expected[-1]["t"] + 1e-6)
        calls.run(options_of(s) + f" -ts_max_time {t_end!r} -ts_rtol 1e-12 -ts_atol 1e-14 -out_events -out_series false"
                  " -out_file e.h5")
        found = catalogue("e.h5")
        assert len(found["t"]) >= len(expected) - 1, f"scene {index}: {len(found['t'])} of {len(expected)} events"
        for k, (e, other) in enumerate(zip(expected[:len(found["t"])], shaken)):
            scale = {"strain_energy": e["friction_work"], "radiated": e["friction_work"]}
            for name in ("begin", "t", "first", "extent", "slip", "moment", "stress_drop", "strain_energy",
                         "friction_work", "radiated"):
                error = abs(found[name][k] - e[name])
                bound = 1e-7 * max(abs(e[name]), scale.get(name, 1e-3)) + 30 * abs(other[name] - e[name])
                assert error < bound, \
                    f"scene {index} {s}, event {k}: {name} {found[name][k]!r}, not {e[name]!r}"
            # what the springs give away is taken by friction and damping, but for the plate
            assert abs(found["strain_energy"][k] - found["friction_work"][k] - found["radiated"][k]) \
                <= e["bound"] + 1e-6 * e["friction_work"], f"scene {index}, event {k}: energies"
            compared["events"] += 1
            compared["blocks"] += e["extent"] > 2
            compared["merged"] += e["merged"]
            compared["touched"] += not e["literal"]
    print(compared)
    assert compared["blocks"] > 20


LAWS = ("-friction_law coulomb -friction_fd 0.6", "-friction_law carlson-langer -friction_sigma 0.05 -friction_alpha 1",
        "-friction_law coulomb -friction_fd 0.7 -state_law healing -state_t_h 20 -state_D 0.3",
        "-friction_law carlson-langer -friction_stick regularised -friction_eps 0.003",
        "-friction_law rate-and-state -state_law ageing -friction_a 0.02 -friction_b 0.06 -friction_D 0.05"
        " -friction_psi0 0.01 -out_events_velocity 0.05")


def draw_any(random):
    law = int(random.integers(len(LAWS)))
    medium = "-model_form chain -model_k0 {:.3f} -model_k1 {:.3f} -model_zeta {:.3f} -grid_n {}".format(
        random.uniform(0.2, 1), random.uniform(0.2, 2), random.choice([0, 0.2]), random.integers(4, 20))
    if law < 2 and random.random() < 0.4:
        medium = "-model_gamma {:.3f} -model_delta {} -grid_length 8 -grid_n {} -grid_order {}".format(
            random.uniform(1, 4), random.choice([0, 0.2]), random.integers(17, 40), random.choice([2, 4, 6]))
    ends = random.choice(["-bc_left free", "-bc_left periodic -bc_right periodic"])
    return f"{medium} {ends} -model_v {10**random.uniform(-2, -1.2):.5f} {LAWS[law]} -friction_spread 0.2" \
           f" -friction_seed {random.integers(1, 1000)} -scene_reduce off", law < 3


def test_frames_at_beginnings_and_ends(scenes):
    """stress_drop of any law, and the numbers of motion that begins and ends at rest, from psi, eta and chi of frames."""
    compared = 0
    for index, (scene, sticks) in scenes(draw_any, salt=607, short=10):
        start = " -init_psi 0 -init_eta 0.5" if sticks else " -init_psi 0.01 -init_eta steady"
        base = scene + start + " -ts_max_time 60 -ts_rtol 1e-8 -ts_atol 1e-10 -out_events -out_series false"
        calls.run(base + " -out_file first.h5 -out_frames 2")
        found = catalogue("first.h5")
        # events during which no other one was under way: no other slip comes into their numbers
        alone = [k for k in range(len(found["t"]))
                 if all(found["t"][j] <= found["begin"][k] or found["begin"][j] >= found["t"][k]
                        for j in range(len(found["t"])) if j != k)][:25]
        if not alone:
            continue
        times = sorted({float(t) for k in alone for t in (found["begin"][k], found["t"][k])})
        calls.run(base + " -out_file second.h5 -out_displacement -out_times " + ",".join(map(repr, times)))
        with h5py.File("second.h5") as file:
            x, t, psi, eta, chi = (file[name][:] for name in ("x", "t", "psi", "eta", "chi"))
        h = x[1] - x[0]
        weight = h if "-model_gamma" in scene else 1
        weights = np.full(len(x), weight)
        if "-model_gamma" in scene and "periodic" not in scene:
            weights[[0, -1]] = h / 2  # the trapezoidal rule
        for k in alone:
            a, b = np.searchsorted(t, [found["begin"][k] - 1e-12, found["t"][k] - 1e-12])
            assert abs(t[a] - found["begin"][k]) < 1e-9 and abs(t[b] - found["t"][k]) < 1e-9, f"scene {index}"
            if sticks and (psi[a].any() or psi[b].any()):
                continue  # another event is under way, which the run did not see end
            region = (round(found["left"][k] / h) + np.arange(round(found["extent"][k] / weight))) % len(x)
            drop = (eta[a] - eta[b])[region].mean()
            what = f"scene {index} {scene}, event {k} of {len(region)} nodes at {found['begin'][k]}"
            assert abs(found["stress_drop"][k] - drop) < 1e-6, f"{what}: {found['stress_drop'][k]!r}, frames {drop!r}"
            compared += len(region) > 1
            if not sticks:
                continue
            d = (chi[b] - chi[a])[region]
            assert np.abs(found["moment"][k] - (weights[region] * d).sum()) < 1e-5, what
            strain = (weights[region] * d * (eta[a] + eta[b])[region]).sum() / 2
            assert abs(found["strain_energy"][k] - strain) < 1e-5 * max(1, abs(strain)), f"{what}: strain"
    assert compared > 10


def draw_wide(random):
    """The continuum with stencils that reach further than neighbours, so loosely coupled that events stay small."""
    n, left = int(random.integers(20, 41)), bool(random.random() < 0.5)
    p = {"grid_n": n, "grid_order": int(random.choice([4, 6, 8])), "bc_left": "periodic" if random.random() < 0.5 else "free",
         "friction_law": str(random.choice(["coulomb", "carlson-langer"])), "friction_seed": int(random.integers(1, 10**6)),
         "friction_spread": random.uniform(0.3, 0.6), "model_v": random.uniform(0.02, 0.08), "scene_reduce": "off",
         "model_gamma": random.uniform(0.5, 2), "model_c": random.uniform(0.5, 1.5),
         "model_delta": float(random.choice([0, random.uniform(0.05, 0.4)]))}
    if p["friction_law"] == "coulomb":
        p |= {"friction_fs": 1, "friction_fd": random.uniform(0.6, 0.9)}
    else:
        p |= {"friction_sigma": random.uniform(0.05, 0.3), "friction_alpha": random.uniform(0.1, 0.5)}
    p["grid_length"] = n * p["model_c"] * random.uniform(1.5, 3)
    p["friction_spread_length"] = p["grid_length"] / n
    eta, t_end = random.uniform(0.4, 0.7), random.uniform(15, 30)
    return p | ({"model_v": -p["model_v"]} if left else {}), -eta if left else eta, t_end


def by_segments(motion):
    """Events by the definition of docs/events.md. Force before: behind, less what the own slip and the plate did."""
    s, live, ended, last = motion.system, [], [], np.zeros(motion.n)
    h, n, ring = s.h, motion.n, s.ends[0] == "periodic"
    eta, half, v = None, n // 2, s.p["model_v"]
    weights = np.full(n, h)
    if not ring:
        weights[[0, -1]] = h / 2
    for begin, _, direction, q, u in motion.segments:
        moved = set(np.flatnonzero(direction))
        for event in [e for e in live if not e["nodes"] & moved]:
            live.remove(event)
            region, d = sorted(event["nodes"]), event["d"]
            before = eta + s.K0 * d - s.K1 * s.D @ d - s.K0 * v * (begin - event["begin"])
            sign = np.sign(d.sum())
            left = min((i for i in region if (i - 1) % n not in region or not ring), default=-1)
            ended.append({"begin": event["begin"], "t": begin, "direction": sign, "extent": h * len(region),
                          "left": h * left,
                          "slip": (sign * d[region]).max(), "moment": abs((weights * d).sum()),
                          "stress_drop": sign * (before - eta)[region].mean(),
                          "strain_energy": (weights * d * (before + eta)).sum() / 2, "beside": event["beside"]})
        for i in sorted(moved):
            if any(i in e["nodes"] for e in live):
                continue
            sides = {(i - 1) % n, (i + 1) % n} if ring else {i - 1, i + 1}
            near = sorted((e for e in live if e["nodes"] & sides), key=lambda e: e["begin"])
            if not near:
                near = [{"nodes": set(), "begin": begin, "d": np.zeros(n), "beside": False}]
                live.append(near[0])
            near[0]["nodes"].add(i)
            for other in near[1:]:
                near[0]["nodes"] |= other["nodes"]
                near[0]["d"] += other["d"]
                live.remove(other)
        for event in live:
            own = sorted(event["nodes"])
            event["d"][own] += (q - last)[own]
            event["beside"] |= any(np.abs((i - own + half) % n - half).min() <= s.p["grid_order"] // 2
                                   for other in live if other is not event for i in other["nodes"])
        last, eta = q, u[n:]
    return ended


def test_several_events_at_once_within_a_stencil(scenes):
    """What the slip of others that goes on meanwhile does is no part of an event, at any tolerance."""
    compared = {"events": 0, "beside": 0}
    for index, (s, eta, t_end) in scenes(draw_wide, salt=711, short=3):
        motion = Stick(System(s, amplitudes(s)), np.repeat([0, eta], s["grid_n"]))
        motion.advance(t_end)
        expected = by_segments(motion)
        for tolerance in (1e-6, 1e-9, 1e-12):
            calls.run(words(s) + ["-init_psi", 0, "-init_eta", eta, "-ts_max_time", t_end, "-ts_rtol", tolerance, "-ts_atol",
                                  tolerance, "-out_events", "-out_frames", 2, "-out_file", "w.h5"])
            found = catalogue("w.h5")
            assert len(found["t"]) == len(expected), f"scene {index} {s}: {len(found['t'])} of {len(expected)} events"
            for e in expected:
                k = np.argmin(np.abs(found["begin"] - e["begin"]) + np.abs(found["t"] - e["t"]))  # a whole ring has no left end
                for name in ("direction", "extent", "slip", "moment", "stress_drop", "strain_energy"):
                    size = e["extent"] if name in ("moment", "strain_energy") else 1
                    assert abs(found[name][k] - e[name]) <= (1000 * tolerance + 1e-8) * max(1, size), \
                        f"scene {index} {s} at {tolerance}: {name} {found[name][k]!r}, not {e[name]!r}"
        compared["events"] += len(expected)
        compared["beside"] += sum(e["beside"] for e in expected)
    print(compared)
    assert compared["beside"] > 5


def slip_of_one_block(s):
    """Of a block that begins to slip beside neighbours that rest, all the way until it rests again."""
    k0 = 1 + 2 * s["k1"]
    motion = Stick(System({"model_form": "chain", "grid_n": 1, "model_k0": k0, "model_v": s["v"] / k0,
                           "friction_law": "carlson-langer", "friction_sigma": s["sigma"], "friction_alpha": s["alpha"]}),
                   [0, np.nextafter(1, 2)])
    motion.advance(100, most=1)
    return motion.slip[0]


def test_one_block_errs_alike_in_long_chains_and_short(scenes):
    """At the tolerance of every run: who rests does not make those that move err by more."""
    def draw_chain(random):
        return dict(n=int(random.choice([80, 300, 1500])), k1=random.uniform(3, 12), sigma=random.uniform(0.008, 0.03),
                    alpha=random.uniform(0.5, 3), v=1e-3 * random.choice([1, 0.3]), seed=int(random.integers(1, 10**6)))
    seen = 0
    for index, s in scenes(draw_chain, salt=624, short=4):
        calls.run(["-model_form", "chain", "-grid_n", s["n"], "-bc_left", "free", "-model_m", 1, "-model_k0", 1, "-model_k1",
                   s["k1"], "-model_f0", 1, "-model_zeta", 0, "-model_v", s["v"], "-friction_law", "carlson-langer",
                   "-friction_sigma", s["sigma"], "-friction_alpha", s["alpha"], "-friction_back_slip", "false",
                   "-init_psi", 0, "-init_eta", 0.5, "-init_noise", 0.5, "-init_seed", s["seed"],
                   "-ts_max_time", 20 / s["n"] / s["v"], "-out_events", "-out_file", "one.h5"])
        found = catalogue("one.h5")
        inside = (found["extent"] == 1) & (found["first"] > 0) & (found["first"] < s["n"] - 1)
        exact = slip_of_one_block(s)
        # a block beside one that has just moved may begin to slip above its threshold
        own = found["slip"][inside][np.abs(found["slip"][inside] / exact - 1) < 0.05]
        seen += len(own)
        assert np.abs(own / exact - 1).max(initial=0) < 1e-3, f"scene {index} {s}: {np.abs(own / exact - 1).max():.1e}"
    print(seen, "events of one block")
    assert seen > 20
