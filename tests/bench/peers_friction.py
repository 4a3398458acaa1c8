#!/usr/bin/env python3
"""Time to accuracy where friction is what people have: exact stick, catalogues, rate-and-state sliders and a fit, as a table each.

    ninja -C build stickslip bench_peers_friction && python3 tests/bench/peers_friction.py build [--only stick,catalogue,state,fit]

Beside this program stand CVODE and ARKODE with roots, a compiled loop of one's own (bench_peers_friction.cpp), SciPy's solve_ivp with
events, smoothed friction, and for rate-and-state friction LSODA, Radau, BDF and explicit pairs in log velocity. Each goes down in
tolerance by factors of sqrt(10) until the largest error at the end is below the one asked for (of psi and eta; of ln psi where that is
the unknown), and that run counts: the median of five. This program's time is `wall_s` of its summary with all that a run measures and writes, less that
of the same run of a single step (`set-up`); the processor time of the whole process stands beside it. The others' is that of the
integration alone.
The exact solution is the loop's at a tolerance of 1e-13; how far this program's strictest run is from it is printed.
"""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

TARGETS = (1e-4, 1e-6, 1e-9)
LONGEST = 5  # seconds of one run, after which a method goes no further
REPEATS = 5
SCATTER = 1e-3  # seconds, of the set-up
TOLERANCES = 10 ** -np.arange(3, 14, 0.5)


class Scene:
    """A chain of one kind of friction: what bench_peers_friction reads, and the program's options."""

    def __init__(self, name, n, t_end, *, sticks=True, one_way=False, slip_law=False, m=1., k0=0.5, k1=1., f0=1., zeta=0.1, v=0.1,
                 alpha=0.5, law=None, spread=0.2, seed=7):
        random = np.random.default_rng([seed, n])
        self.name, self.n, self.t_end, self.sticks, self.one_way, self.slip_law = name, n, t_end, sticks, one_way, slip_law
        self.m, self.k0, self.k1, self.f0, self.zeta, self.v, self.alpha = m, k0, k1, f0, zeta, v, alpha
        self.law = law or {}
        self.kinds = 2 if sticks or m == 0 else 3
        if sticks:
            self.strength = 1 + spread * random.uniform(-1, 1, n)
            self.start = np.stack([np.zeros(n), self.strength * random.uniform(0, 0.9, n)], axis=1)
        else:
            self.strength = np.ones(n)
            y, s = np.log(v * random.uniform(1.1, 1.3, n)), np.full(n, np.log(self.law["D"] / v))
            force = self.friction(y, s) + zeta / f0 * np.exp(y)
            self.start = np.stack([y, s, force][:self.kinds], axis=1)

    def friction(self, y, s):
        p = self.law
        return p["mu0"] + p["a"] * (y - np.log(p["psi0"])) + p["b"] * (s + np.log(p["psi0"] / p["D"]))

    def write(self, path):
        p = self.law
        head = [self.sticks, self.one_way, self.slip_law, self.n, self.kinds, self.t_end, self.m, self.k0, self.k1, self.f0, self.zeta,
                self.v, self.alpha, *(p.get(name, 1) for name in ("a", "b", "D", "mu0", "psi0"))]
        np.concatenate([np.array(head, float), self.strength, self.start.ravel()]).tofile(path)

    def options(self, folder):
        o = {"model_form": "chain", "grid_n": self.n, "bc_left": "free", "scene_reduce": "off", "out_series": "false", "out_frames": 2,
             "init_type": "text", "init_file": os.path.join(folder, "start.txt"), "ts_max_time": self.t_end}
        o |= {"model_" + name: getattr(self, name) for name in ("m", "k0", "k1", "f0", "zeta", "v")}
        x = np.arange(self.n)
        if self.sticks:
            o |= {"friction_law": "carlson-langer", "friction_sigma": 0., "friction_alpha": self.alpha,
                  "friction_back_slip": str(not self.one_way).lower()}
            o["friction_amplitude_profile"] = ",".join(f"{i}:{float(value)!r}" for i, value in enumerate(self.strength))
            columns = [x, *self.start.T]
        else:
            o |= {"friction_law": "dieterich", "state_law": "slip" if self.slip_law else "ageing"}
            o |= {"friction_" + name: value for name, value in self.law.items()}
            y, s = self.start[:, 0], self.start[:, 1]
            columns = [x, np.exp(y), self.friction(y, s) + self.zeta / self.f0 * np.exp(y), np.exp(s)]
        np.savetxt(os.path.join(folder, "start.txt"), np.stack(columns, axis=1), fmt="%.17g")
        return [word for name, value in o.items() for word in ("-" + name, str(value))]

    def judged(self, u):
        """What an error is taken of."""
        return u if self.sticks else u[:, :1]


def best_of(run, exact, scene, targets=TARGETS, tolerances=TOLERANCES):
    """For each target the (seconds, process seconds, what) of the loosest tolerance that reaches it; `run` gives end and costs."""
    found = {}
    for tolerance in tolerances:
        end, seconds, *more = run(tolerance)
        if end is None:
            break
        error = np.abs(scene.judged(end) - exact).max()
        reached = [target for target in targets if target not in found and error <= target]
        if reached:
            costs = [(seconds, *more)] + [run(tolerance)[1:] for _ in range(REPEATS - 1) if seconds < 2]
            for target in reached:
                found[target] = tuple(statistics.median(cost[k] for cost in costs) for k in range(len(costs[0])))
        if len(found) == len(targets) or seconds > LONGEST:
            break
    return found


def second_difference(psi):
    """Of a chain with free ends."""
    return np.diff(np.pad(psi, 1, "edge"), 2)


def timed(words, folder):
    """The completed process of the program, `wall_s` of its summary (None where it failed), and the processor time of it all."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    summary = os.path.join(folder, "o.json")
    done = subprocess.run([*words, "-out_file", os.path.join(folder, "o.h5"), "-summary", summary], capture_output=True, text=True,
                          timeout=2 * LONGEST, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        return done, None, None
    with open(summary, encoding="utf-8") as file:
        return done, json.load(file)["wall_s"], after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ours(program, scene, folder, *more):
    words = [program, "run", *scene.options(folder), *more]

    def run(tolerance, *more):
        tolerances = ["-ts_rtol", str(tolerance), "-ts_atol", str(tolerance * (1 if scene.sticks else scene.v))]
        try:
            done, wall, process = timed([*words, *more, *tolerances], folder)
        except subprocess.TimeoutExpired:
            return None, None
        if done.returncode:
            print("#", done.stderr.strip()[-200:])
            return None, None
        with h5py.File(os.path.join(folder, "o.h5")) as file:
            psi, eta = file["psi"][-1], file["eta"][-1]
        return np.stack([psi if scene.sticks else np.log(psi), eta], axis=1), wall - set_up, process
    set_up = 0.
    set_up = statistics.median(run(1e-6, "-ts_max_time", str(1e-9 * scene.t_end))[1] for _ in range(REPEATS))
    return run


def compiled(bench, scene, folder, method, eps=0.):
    """Of eps < 0: smoothed over what the tolerance allows, -eps of it."""
    path, end = os.path.join(folder, "scene"), os.path.join(folder, "end")
    scene.write(path)

    def run(tolerance):
        try:
            done = subprocess.run([bench, path, method, repr(tolerance), repr(eps if eps >= 0 else -eps * tolerance), end],
                                  capture_output=True, text=True, timeout=3 * LONGEST, check=False)
        except subprocess.TimeoutExpired:
            return None, None
        if done.returncode:
            return None, None
        return np.fromfile(end).reshape(scene.n, scene.kinds), float(done.stdout.split()[0])
    return run


def scipy_stick(scene):
    """solve_ivp with one event, the least of all blocks' distances to their next change, and a new start after each."""
    def run(tolerance):
        begin, n = time.process_time(), scene.n
        u, t, going = scene.start.T.ravel(), 0., np.zeros(n)
        going[np.abs(u[n:]) > scene.strength] = 1

        def rates(_, u):
            psi, eta = u[:n], u[n:]
            slide = (scene.f0 * (eta - scene.strength * going / (1 + 2 * scene.alpha * np.abs(psi))) - scene.zeta * psi) / scene.m
            return np.concatenate([np.where(going != 0, slide, 0), (scene.k0 * (scene.v - psi) + scene.k1 * second_difference(psi)) / scene.f0])

        def gaps(_, u):
            return np.where(going != 0, u[:n] * going, scene.strength - np.abs(u[n:]))

        def event(t, u):
            return gaps(t, u).min()
        event.terminal, event.direction = True, -1
        while t < scene.t_end:
            if time.process_time() - begin > LONGEST:
                return None, None
            part = solve_ivp(rates, (t, scene.t_end), u, method="DOP853", rtol=max(tolerance, 1e-13), atol=tolerance, events=event)
            t, u = part.t[-1], part.y[:, -1].copy()
            if part.status == 1:
                i = int(np.argmin(gaps(t, u)))
                holds = abs(u[n + i]) < scene.strength[i]
                u[i] = 0 if going[i] else u[i]
                going[i] = 0 if going[i] and holds else np.sign(u[n + i])
        return u.reshape(2, n).T, time.process_time() - begin
    return run


def scipy_state(scene, method):
    """In ln psi and ln theta, as the field's scripts do."""
    p = scene.law

    def run(tolerance):
        begin, n, kinds = time.process_time(), scene.n, scene.kinds

        def rates(_, u):
            u = u.reshape(n, kinds)
            y, s = u[:, 0], u[:, 1]
            psi = np.exp(y)
            pull = scene.k0 * (scene.v - psi) + scene.k1 * second_difference(psi)
            s_t = -psi / p["D"] * (np.log(psi / p["D"]) + s) if scene.slip_law else np.exp(-s) - psi / p["D"]
            if kinds == 2:
                y_t = (pull - scene.f0 * p["b"] * s_t) / (scene.f0 * p["a"] + scene.zeta * psi)
                return np.stack([y_t, s_t], axis=1).ravel()
            y_t = (scene.f0 * (u[:, 2] - scene.friction(y, s)) - scene.zeta * psi) / (scene.m * psi)
            return np.stack([y_t, s_t, pull / scene.f0], axis=1).ravel()
        width = 2 * kinds - 1
        more = {"lband": width, "uband": width} if method == "LSODA" and n > 1 else {}
        if method == "Radau" and n > 1:
            i = np.arange(kinds * n)
            more = {"jac_sparsity": np.abs(i[:, None] - i) <= width}
        with np.errstate(all="ignore"):
            done = solve_ivp(rates, (0, scene.t_end), scene.start.ravel(), method=method, rtol=max(tolerance, 3e-14), atol=tolerance,
                             t_eval=[scene.t_end], **more)
        if not done.success:
            return None, None
        return done.y[:, -1].reshape(n, kinds), time.process_time() - begin
    return run


def show(scene, exact, methods):
    """One line for each accuracy: the best of this program and of each of the others."""
    rows = {name: best_of(run, exact, scene) for name, run in methods}
    own = {name: row for name, row in rows.items() if name.startswith("stickslip")}
    others = [name for name in NAMES if not name.startswith("stickslip")]
    for target in TARGETS:
        reached = [(row[target], name) for name, row in own.items() if target in row]
        (mine, process), by = min(reached) if reached else ((np.nan, np.nan), "-")
        least = max(mine, SCATTER)
        cells = [f"{1e3 * rows[name][target][0]:.3g} ({rows[name][target][0] / least:.2g})" if target in rows.get(name, {}) else "-"
                 for name in others]
        print(f"| {scene.name} | {target:.0e} | {'below ' * (mine < SCATTER)}{1e3 * least:.3g} ({by.removeprefix('stickslip ')}) | {1e3 * process:.3g} | "
              + " | ".join(cells) + " |", flush=True)


NAMES = []


def heading(methods):
    NAMES[:] = [name for name, _ in methods]
    others = [name for name, _ in methods if not name.startswith("stickslip")]
    print("\n| scene | error | this program, ms | its process, ms | " + " | ".join(f"{name}, ms (ratio)" for name in others) + " |")
    print("|" + "---|" * (4 + len(others)))


def reference(bench, scene, folder, program, method="loop"):
    end = compiled(bench, scene, folder, method)(1e-13)[0]
    exact = scene.judged(end)
    strict = "arkimex:5" if scene.kinds == 3 else "rk:8vr"
    own = ours(program, scene, folder, "-ts_type", strict)(1e-12)[0]
    away = "too slow" if own is None else f"{np.abs(scene.judged(own) - exact).max():.2g} from the reference"
    print(f"# {scene.name}: this program with {strict} is {away}", file=sys.stderr)
    return exact


def stick(program, bench, folder):
    for k, (n, t_end) in enumerate(((1, 200.), (10, 30.), (100, 25.), (1000, 20.))):
        scene = Scene(f"{n} block{'s' * (n > 1)}", n, t_end)
        exact = reference(bench, scene, folder, program)
        methods = [("stickslip default", ours(program, scene, folder)), ("stickslip rk:7vr", ours(program, scene, folder, "-ts_type", "rk:7vr")),
                   ("stickslip rk:8vr", ours(program, scene, folder, "-ts_type", "rk:8vr")),
                   ("own loop", compiled(bench, scene, folder, "loop")), ("ARKODE, roots", compiled(bench, scene, folder, "erk")),
                   ("CVODE Adams, roots", compiled(bench, scene, folder, "adams")),
                   ("CVODE BDF, smoothed", compiled(bench, scene, folder, "bdf", -1.)),
                   ("own loop, smoothed", compiled(bench, scene, folder, "loop", -1.)), ("SciPy, events", scipy_stick(scene))]
        if k == 0:
            heading(methods)
        if n >= 1000:  # minutes a run
            methods = [method for method in methods if "smoothed" not in method[0] and "SciPy" not in method[0]]
        show(scene, exact, methods)


def catalogue(program, bench, folder):
    """As long as events agree nothing is to be said of accuracy: counts and seconds."""
    print("\n| blocks | time | events of the program, starts in the loop | program, s (process) | own loop, s | ratio |\n|---|---|---|---|---|---|")
    for n, t_end in ((100, 1000.), (1000, 100.)):
        scene = Scene(f"{n} blocks", n, t_end, one_way=True, k0=1., k1=9., zeta=0., v=1e-3, spread=0.1)
        words = [program, "run", *scene.options(folder), "-out_events", "true", "-ts_rtol", "1e-5", "-ts_atol", "1e-5"]
        done, wall, process = timed(words, folder)
        assert done.returncode == 0, done.stderr
        with h5py.File(os.path.join(folder, "o.h5")) as file:
            begins = len(file["events/begin"])
        path = os.path.join(folder, "scene")
        scene.write(path)
        done = subprocess.run([bench, path, "loop", "1e-5", "0", os.path.join(folder, "end")], capture_output=True, text=True, check=True)
        seconds, _, events = done.stdout.split()
        print(f"| {n} | {t_end:g} | {begins}, {events} | {wall:.3g} ({process:.3g}) | {float(seconds):.3g} | {float(seconds) / wall:.3g} |",
              flush=True)


def state(program, bench, folder):
    law = {"a": 0.008, "b": 0.012, "D": 1e-5, "mu0": 0.6, "psi0": 1e-6}
    first = True
    for n in (1, 100):
        for mass in (0., 1e-3):
            f0, v, zeta = 5e6, 1e-6, 5e6
            k0 = (0.5 if n == 1 else 0.075) * f0 * (law["b"] - law["a"]) / law["D"]
            m = mass * zeta ** 2 / (4 * k0)
            scene = Scene(f"{n} block{'s' * (n > 1)}, {'massless' if not mass else 'light'}", n, 100 * law["D"] / v, sticks=False,
                          slip_law=True, m=m, k0=k0, k1=5 * k0, f0=f0, zeta=zeta, v=v, law=law)
            exact = reference(bench, scene, folder, program, "loop" if not mass else "bdf")
            methods = [("stickslip default", ours(program, scene, folder)),
                       ("stickslip rk:7vr", ours(program, scene, folder, "-ts_type", "rk:7vr")),
                       ("stickslip arkimex:4", ours(program, scene, folder, "-ts_type", "arkimex:4")),
                       ("own loop", compiled(bench, scene, folder, "loop")), ("CVODE BDF", compiled(bench, scene, folder, "bdf")),
                       ("LSODA", scipy_state(scene, "LSODA")), ("Radau", scipy_state(scene, "Radau")),
                       ("DOP853", scipy_state(scene, "DOP853"))]
            if first:
                heading(methods)
            first = False
            show(scene, exact, methods)


def fit(program, _, folder):
    """Velocity steps of a laboratory, 1000 rows with noise: a, b and D."""
    a, b, D, mu0, k, v0 = 0.011, 0.016, 7., 0.6, 3e-3, 10.
    steps = [(0., 15., 10.), (15., 25., 30.), (25., 40., 10.)]
    t = np.linspace(0, 40, 1000)

    def motion(a, b, D):
        """Massless, in ln psi and ln theta, from steady sliding."""
        u, mu = np.array([np.log(v0), np.log(D / v0)]), np.empty(len(t))
        for begin, end, v in steps:
            def rates(_, u, v=v):
                psi = np.exp(u[0])
                s_t = np.exp(-u[1]) - psi / D
                return [(k * (v - psi) - b * s_t) / a, s_t]
            at = t[(t >= begin) & (t <= end)]
            done = solve_ivp(rates, (begin, end), u, method="LSODA", rtol=1e-7, atol=1e-9, t_eval=np.unique(np.append(at, end)))
            y, s = done.y[:, :len(at)]
            mu[(t >= begin) & (t <= end)] = mu0 + a * (y - np.log(v0)) + b * (s + np.log(v0 / D))
            u = done.y[:, -1]
        return mu
    measured = motion(a, b, D) + np.random.default_rng(7).normal(0, 5e-4, len(t))
    data = os.path.join(folder, "lab.txt")
    np.savetxt(data, np.stack([t, measured], axis=1), fmt="%.9g")
    words = [program, "fit", "-model_form", "chain", "-grid_n", "1", "-bc_left", "free", "-model_m", "0", "-model_k0", str(k), "-model_zeta",
             "0", "-model_v", str(v0), "-load_v", "0:10,15:10,15:30,25:30,25:10,40:10", "-friction_law", "dieterich", "-friction_mu0", str(mu0),
             "-friction_psi0", str(v0), "-friction_a", "0.02", "-friction_b", "0.02", "-friction_D", "20", "-state_law", "ageing",
             "-init", "sliding", "-ts_max_time", "40", "-fit_data", data, "-fit_of", "force", "-fit_parameters", "friction_a,friction_b,friction_D", "-fit_starts", "1",
             "-summary", os.path.join(folder, "f.json")]
    begin = time.perf_counter()
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    mine = time.perf_counter() - begin
    assert done.returncode == 0, done.stderr
    with open(os.path.join(folder, "f.json"), encoding="utf-8") as file:
        summary = json.load(file)
    begin = time.process_time()
    found = least_squares(lambda p: motion(*np.exp(p)) - measured, np.log([0.02, 0.02, 20.]), x_scale="jac")
    theirs = time.process_time() - begin
    print("\n| a, b, D of the program | of SciPy | program, s (as typed) | SciPy, s | ratio |\n|---|---|---|---|---|")
    values = [p["value"] for p in summary["parameters"]] if isinstance(summary.get("parameters"), list) else summary
    print(f"| {values} | {np.exp(found.x)} | {mine:.3g} | {theirs:.3g} | {theirs / mine:.3g} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("--only", default="stick,catalogue,state,fit")
    parser.add_argument("--bench", help="bench_peers_friction; else that of the build")
    given = parser.parse_args()
    parts = {"stick": stick, "catalogue": catalogue, "state": state, "fit": fit}
    for part in given.only.split(","):
        with tempfile.TemporaryDirectory() as place:
            parts[part](os.path.abspath(os.path.join(given.build, "stickslip")),
                        os.path.abspath(given.bench or os.path.join(given.build, "tests", "bench_peers_friction")), place)
