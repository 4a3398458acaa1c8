"""Long runs: 10^7 steps of one block and 10^6 of a chain of 100, at whose end nothing has crept in.

    STICKSLIP=build/stickslip python3 tests/long_runs.py     (or ./check long_runs)

Four runs in a folder of their own, which goes; the options that the seed draws stand in what is printed:
  - rests    a block that sticks exactly and slips, adaptive steps, with every kind of row at every step, checkpoints
             and maxima;
  - smooth   a block with the cubic law, adaptive steps, a probe at every step;
  - turns    a block on its spring under a constant force, by leapfrog and by rk 4 in fixed steps: a rotation, which
             after so many steps is known in closed form;
  - chain    100 blocks that stick, with energies, a probe and checkpoints.
Each is cut into ten parts of equal numbers of steps, and what these have in common must be the same in all of them:
  - the balance of energy: what is stored, less what plate and friction have done since, changes by the error of the
    steps and of the quadrature, in every part alike;
  - the mean step and the rejected steps;
  - the period, which is that of the command `cycle`, too;
and over the whole run
  - the memory of the process does not grow once its buffers are there;
  - the file takes 8 bytes a value and at most as much again that is set aside; checkpoints do not grow.
Alike: means of the parts differ by no more than six standard errors, from the scatter of a hundred blocks of each part,
and by what the clock's rounding makes of them. --block-steps and --chain-steps say how many steps, --only which runs.
Prints a line a run, and writes results to --summary.
"""
import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

from calls import check, line
from reference import Law

parts, blocks_of_part = 10, 100
header_bytes = 400_000      # of a file, all that is no row: attributes, the table of friction, HDF5's own
most_growth_kb = 1024       # of memory after the first fifth of the steps
many = 900_000              # steps from which on memory, and the file under way, are looked at: buffers are small then



# ---- running ----------------------------------------------------------------------------------------------------------

def memory_kb(pid):
    """Resident memory of a process now; None where it is gone."""
    try:
        with open(f"/proc/{pid}/status", encoding="ascii") as status:
            return next((int(words.split()[1]) for words in status if words.startswith("VmRSS")), None)
    except OSError:
        return None


def steps_so_far(path):
    """Rows of a file that is being written, and the bytes that it takes; None before the first frame."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            name = "series/t" if "series" in file else "probes/t"
            return file[name].shape[0], os.stat(path).st_blocks * 512
    except OSError:
        return None


def run_watched(arguments, path=None, every=0.5):
    """The summary of a run, and what was seen of it under way: (steps, KB, bytes of the file)."""
    process = subprocess.Popen([*line(arguments), "-summary", "summary.json"])
    seen = []
    while process.poll() is None:
        kb, rows = memory_kb(process.pid), steps_so_far(path) if path else None
        if kb and rows:
            seen.append((rows[0], kb, rows[1]))
        time.sleep(every)
    check(process.returncode == 0, f"exit {process.returncode}: {arguments}")
    with open("summary.json", encoding="utf-8") as file:
        return json.load(file), seen


def summary_of(command, arguments):
    subprocess.run([*line(arguments, command=command), "-summary", "summary.json"], check=True)
    with open("summary.json", encoding="utf-8") as file:
        return json.load(file)


def time_of(scene, steps):
    """The model time in which so many steps are taken, and some more."""
    few_steps = min(steps // 10, 20_000)
    s = summary_of("run", f"{scene} -out_series false -ts_max_time 1e12 -ts_max_steps {few_steps}")
    return (1.001 if "-grid_n 1 " in scene else 1.1) * s["t_end"] * steps / s["steps"]


# ---- what must be flat ------------------------------------------------------------------------------------------------

def flat(rows, rounding, what):
    """Means of rows of blocks, one row a part, agree with that of the first part; the largest difference over what is
    allowed."""
    means = np.array([row.mean() for row in rows])
    errors = np.array([row.std(ddof=1) / np.sqrt(len(row)) for row in rows])
    allowed = 6 * np.hypot(errors, errors[0]) + rounding + 1e-12 * np.abs(means).max()
    worst = np.abs(means - means[0])[1:] / allowed[1:]
    check(worst.max() <= 1, f"{what}: not flat: {means} +- {errors}, rounding {rounding}")
    return worst.max()


def in_blocks(values):
    """Sums of values of single steps of one part over its blocks."""
    return values[:len(values) // blocks_of_part * blocks_of_part].reshape(blocks_of_part, -1).sum(axis=1)


def parts_of(group, names, begin, steps):
    """Rows of a group from step `begin` on, part by part, each with the last row of the one before."""
    length = (steps - begin) // parts
    for k in range(parts):
        yield {name: np.ravel(group[name][begin + k * length:begin + (k + 1) * length + 1]) for name in names}


def balance_of_block(t, psi, eta, law, A, B, K0, v):
    """Energy stored at the end of each step less that at its beginning and the work done in between, by the rule that is
    exact for cubics: with the work's rate at both ends and its slope. Units of the friction amplitude; per node
        psi_t = A (eta - B psi - F), eta_t = K0 (v - psi);  E = psi^2/(2 A) + eta^2/(2 K0),  E_t = v eta - psi (F + B psi)."""
    def force(psi):
        return law.force(psi, 0., 1.)
    law, moves = Law({"friction_law": law}), psi != 0
    F, dF = np.where(moves, force(psi), 0), np.where(moves, law.slopes(psi, 0., 1.)[0], 0)
    psi_t = np.where(moves, A * (eta - B * psi - F), 0)
    power = v * eta - psi * (F + B * psi)
    change = v * K0 * (v - psi) - psi_t * (F + psi * dF + 2 * B * psi)
    # a step into or out of rest: what moves at one end alone moves at the other, too, up to where it stands
    h = np.diff(t)
    begin_F = force(np.where(moves[:-1] | moves[1:], psi[:-1], np.nan))
    starts = ~moves[:-1] & moves[1:]
    change[:-1][starts] -= (A * (eta[:-1] - begin_F) * begin_F)[starts]
    first = change[:-1]
    last = change[1:].copy()
    stops = moves[:-1] & ~moves[1:]
    end_F = force(psi[1:])
    last[stops] -= (A * (eta[1:] - end_F) * end_F)[stops]
    work = h / 2 * (power[:-1] + power[1:]) + h**2 / 12 * (first - last)
    stored = psi**2 / (2 * A) + eta**2 / (2 * K0)
    return np.diff(stored) - work, h * v * (eta[:-1] + eta[1:]) / 2


def releases(t, psi):
    """When the block begins to slip: where a step at rest, from rest to rest, ends."""
    return t[1:][(psi[:-1] == 0) & (psi[1:] == 0)]


def passages(t, psi, psi_t, level):
    """When psi passes a level upwards, by the cubic of each step."""
    at = np.flatnonzero((psi[:-1] < level) & (psi[1:] >= level))
    h = t[at + 1] - t[at]
    a, b, da, db = psi[at] - level, psi[at + 1] - level, h * psi_t[at], h * psi_t[at + 1]
    low, high = np.zeros(len(at)), np.ones(len(at))
    for _ in range(60):
        s = (low + high) / 2
        value = a * (1 + 2 * s) * (1 - s) ** 2 + da * s * (1 - s) ** 2 + b * s**2 * (3 - 2 * s) - db * s**2 * (1 - s)
        low, high = np.where(value < 0, s, low), np.where(value < 0, high, s)
    return t[at] + h * (low + high) / 2


def period_is_flat(times, cycle, tolerance, t_end, what):
    """Over blocks of whole cycles in each part, but for the first cycles, which the start is part of; returns the period of
    the first and of the last part. A cycle has less than a hundred steps, of which each errs by less than the tolerance;
    where they fall in the cycle, and so their errors, depends on how the clock is rounded."""
    times = times[20:]
    blocks = min(blocks_of_part, (len(times) - 1) // parts)
    each = (len(times) - 1) // (parts * blocks)
    marks = times[:each * parts * blocks + 1:each]
    periods = (np.diff(marks) / each).reshape(parts, blocks)
    flat(periods, tolerance * cycle + 2 * np.spacing(t_end) / each, f"{what}: period")
    first, last = periods[0].mean(), periods[-1].mean()
    for found in (first, last):
        check(abs(found - cycle) <= 100 * tolerance * cycle, f"{what}: period {found}, that of `cycle` {cycle}")
    return first, last


def memory_is_flat(seen, steps, what):
    later = [kb for done, kb, _ in seen if done >= 0.2 * steps]
    if steps < many or len(later) < 5:
        return None
    check(max(later) - later[0] <= most_growth_kb, f"{what}: memory grows from {later[0]} to {max(later)} KB")
    return later[0], max(later)


def file_is_as_foreseen(path, seen, rows, row_bytes, keep, what):
    """8 bytes a value, and room set aside for no more than that again, while it grows and in the end; checkpoints hold
    64 to 128 windows of the record of the motion, and do not grow otherwise."""
    taken = os.stat(path)
    with h5py.File(path) as file:
        of_frames = 8 * sum(file[name].size for name in ("t", "psi", "eta", "chi") if name in file)
    least = row_bytes * rows + of_frames
    for size in (taken.st_size, taken.st_blocks * 512):
        check(least <= size <= 2 * least + header_bytes,
              f"{what}: {size} bytes for {rows} rows of {row_bytes} and {of_frames} of frames")
    for done, _, size in seen:
        if done >= many:  # more rows may have been written since these were counted
            least = row_bytes * done + of_frames * done / rows
            check(least - header_bytes <= size <= 2.1 * least + header_bytes, f"{what}: {size} bytes at {done} rows of {row_bytes}")
    stem = os.path.splitext(path)[0]
    sizes = [os.stat(name).st_size for name in sorted(os.listdir(".")) if name.startswith(stem + ".chk-")]
    check(len(sizes) == keep and max(sizes) <= 2 * min(sizes), f"{what}: checkpoints of {sizes} bytes")
    return taken.st_blocks * 512


# ---- the runs ---------------------------------------------------------------------------------------------------------

def block(law, rng):
    return (f"-model_form chain -grid_n 1 -model_k1 0 -friction_law {law} -model_k0 {rng.uniform(0.1, 0.3):.3f} "
            f"-model_v {rng.uniform(*((0.05, 0.15) if law == 'carlson-langer' else (0.2, 0.4))):.3f}")


def attributes(file):
    return {name: file.attrs[name] for name in ("A", "B", "K0", "v")}


class Balance:
    """What the parts of a run add up to, taken in one after the other."""

    def __init__(self):
        self.dt, self.missing, self.rejected, self.work, self.all_missing, self.marks = [], [], [], 0, 0, []

    def add(self, t, missing, work, rejections=None, marks=()):
        self.dt.append(in_blocks(np.diff(t)))
        self.missing.append(in_blocks(missing))
        if rejections is not None:
            self.rejected.append(in_blocks(np.diff(rejections)))
        self.work += work.sum()
        self.all_missing += missing.sum()
        self.marks.append(marks)
        self.end = t[-1]

    def judged(self, what, s, seen):
        rounding = 2 * np.spacing(self.end)
        power = self.work / self.end
        worst = [flat(self.dt, rounding, f"{what}: mean step"),
                 flat(self.missing, rounding * power, f"{what}: balance of energy")]
        if self.rejected:
            worst.append(flat(self.rejected, 1, f"{what}: rejected steps"))
        return {"steps": s["steps"], "rejections": s["rejections"], "seconds": s["wall_s"], "t_end": s["t_end"],
                "balance": self.all_missing / self.work, "memory": memory_is_flat(seen, s["steps"], what),
                "worst": max(worst)}


def watched(name, scene, steps, outputs, every):
    s, seen = run_watched(f"{scene} -ts_max_time {time_of(scene, steps)!r} -out_file {name}.h5 -out_frames 2001 {outputs} "
                          f"-out_checkpoint_every {steps // (100 if steps >= many else 3)}", name + ".h5", every)
    check(s["status"] == "done", f"{name}: {s['status']}")
    return s, seen


def rests(steps, rng, every):
    scene, tolerance = block("carlson-langer", rng), 1e-7
    s, seen = watched("rests", f"{scene} -ts_rtol {tolerance} -ts_atol {tolerance}", steps,
                      "-out_displacement -out_probes 0 -out_maxima 0", every)
    sums = Balance()
    with h5py.File("rests.h5") as file:
        series, a = file["series"], attributes(file)
        rows = series["t"].shape[0]
        check(rows == s["steps"] + 1 == file["probes/t"].shape[0] and s["steps"] >= steps, f"rests: {rows} rows")
        check(series["step"][-1] == s["steps"], "rests: the number of the last step")
        for of in parts_of(series, ("t", "psi_mean", "eta_mean", "energy_kinetic", "energy_elastic", "rejections"), 0, steps):
            t, psi, eta = of["t"], of["psi_mean"], of["eta_mean"]
            own = psi**2 / (2 * a["A"]) + eta**2 / (2 * a["K0"])
            miss = np.abs(of["energy_kinetic"] + of["energy_elastic"] - own).max()
            check(miss <= 1e-12 + 4 * np.spacing(a["v"] * t[-1]), f"rests: energies of the file are off by {miss}")
            sums.add(t, *balance_of_block(t, psi, eta, "carlson-langer", **a), of["rejections"], releases(t, psi))
    found, cycle = sums.judged("rests", s, seen), summary_of("cycle", scene)
    found["period"] = period_is_flat(np.concatenate(sums.marks), cycle["period"], tolerance, sums.end, "rests")
    found["bytes"] = file_is_as_foreseen("rests.h5", seen, rows, 8 * 16, 2, "rests")
    found["scene"], found["cycle"] = scene, cycle["period"]
    check(0 < len(s["maxima"]) < 10_000 and s["maxima_period"] == 1, f"rests: {len(s['maxima'])} maxima")
    return found


def smooth(steps, rng, every):
    scene, tolerance = block("cubic", rng), 1e-7
    s, seen = watched("smooth", f"{scene} -ts_rtol {tolerance} -ts_atol {tolerance}", steps, "-out_series false -out_probes 0",
                      every)
    sums = Balance()
    with h5py.File("smooth.h5") as file:
        a, rows = attributes(file), file["probes/t"].shape[0]
        for of in parts_of(file["probes"], ("t", "psi", "eta"), 0, steps):
            t, psi, eta = of["t"], of["psi"], of["eta"]
            psi_t = a["A"] * (eta - a["B"] * psi - Law({"friction_law": "cubic"}).force(psi))
            sums.add(t, *balance_of_block(t, psi, eta, "cubic", **a), marks=passages(t, psi, psi_t, a["v"]))
    found, cycle = sums.judged("smooth", s, seen), summary_of("cycle", scene)
    found["period"] = period_is_flat(np.concatenate(sums.marks), cycle["period"], tolerance, sums.end, "smooth")
    found["bytes"] = file_is_as_foreseen("smooth.h5", seen, rows, 8 * 3, 2, "smooth")
    found["scene"], found["cycle"] = scene, cycle["period"]
    return found


def chain(steps, rng, every):
    # of the whole chain: without these outputs, as its steps are counted first, it would be advanced by clusters
    scene = (f"-model_form chain -grid_n 100 -stick_clusters off -friction_law carlson-langer -model_v {rng.uniform(0.05, 0.1):.3f} "
             f"-init_psi 0.05 -init_eta steady -init_noise 0.02 -init_seed {rng.randrange(1, 10**6)}")
    s, seen = watched("chain", scene, steps, "-out_displacement -out_probes 50 -out_maxima 50", every)
    sums = Balance()
    with h5py.File("chain.h5") as file:
        rows = file["series/t"].shape[0]
        check(rows == s["steps"] + 1 and s["steps"] >= steps, f"chain: {rows} rows of {s['steps']} steps")
        for of in parts_of(file["series"], tuple(file["series"]), s["steps"] // 20, s["steps"]):  # after the start
            stored, dt = of["energy_kinetic"] + of["energy_elastic"], np.diff(of["t"])
            power = of["power_input"] - of["power_friction"] - of["power_viscous"]
            missing = np.diff(stored) - dt * (power[1:] + power[:-1]) / 2  # kinks wherever a block starts or stops
            sums.add(of["t"], missing, dt * (of["power_input"][1:] + of["power_input"][:-1]) / 2, of["rejections"])
    found = sums.judged("chain", s, seen)
    found["bytes"] = file_is_as_foreseen("chain.h5", seen, rows, 8 * 16, 2, "chain")
    found["scene"] = scene
    return found


def turns(steps, rng):
    """About sliding at v under friction that does not change psi - v and (eta - F)/sqrt(A K0 m) turn by w h a step. The
    implicit midpoint rule, which leapfrog is for one block, turns by 2 atan(w h/2) and keeps the radius; rk 4 multiplies
    by 1 + z + z^2/2 + z^3/6 + z^4/24, z = i w h. A step has some ten operations, of which each rounds psi or eta by half a
    unit in the last place at most; all in one direction, over all steps, that is the bound. The clock rounds once a step."""
    h, w = rng.uniform(0.05, 0.1), np.sqrt(0.2)
    h = round(h, 4)
    found = {}
    for method, factor in (("leapfrog", np.exp(2j * np.arctan(w * h / 2))),
                           ("rk -ts_rk_type 4", sum((1j * w * h) ** k / np.prod(np.arange(1, k + 1)) for k in range(5)))):
        s = summary_of("run", f"-model_form chain -grid_n 1 -model_k1 0 -model_k0 0.2 -friction_law coulomb -model_v 1 -init_psi 1.25 "
                              f"-init_eta steady -ts_type {method} -ts_dt {h} -ts_max_time 1e12 -ts_max_steps {steps} "
                              "-out_series false -out_probes 0")
        check(s["steps"] == steps, f"turns: {s['steps']} steps")
        end = s["probes"][0]["psi"] - 1
        want = 0.25 * (np.longdouble(abs(factor)) ** steps * np.cos(np.longdouble(steps) * np.longdouble(np.angle(factor))))
        miss = abs(end - float(want))
        clock = abs(s["t_end"] - steps * h)
        check(miss <= 5 * steps * np.spacing(1.25), f"turns: {method}: psi - v = {end}, not {want}")
        check(clock <= steps * np.spacing(s["t_end"]) / 2, f"turns: {method}: the clock is off by {clock}")
        found[method.split()[0]] = {"steps": steps, "seconds": s["wall_s"], "miss": miss, "clock": clock, "h": h}
    return found


def shown(name, found):
    if name == "turns":
        for method, of in found.items():
            print(f"turns by {method}: {of['steps']} steps of {of['h']}, off by {of['miss']:.1e}, clock by {of['clock']:.1e}, "
                  f"{of['seconds']:.0f} s", flush=True)
        return
    print(f"{name}: {found['steps']} steps ({found['rejections']} rejected) to t = {found['t_end']:.4g}; energy closes to "
          f"{abs(found['balance']):.1e} of the work"
          + (f"; period {found['period'][0]:.10g} and {found['period'][1]:.10g}, `cycle` {found['cycle']:.10g}" if "period" in found else "")
          + (f"; memory {found['memory'][0]} to {found['memory'][1]} KB" if found["memory"] else "")
          + f"; {found['bytes']} bytes; parts differ by {found['worst']:.2f} of what is allowed; "
          f"{found['seconds']:.0f} s: {found['scene']}", flush=True)


def main(arguments):
    parser = argparse.ArgumentParser(description="long runs at whose end nothing has crept in")
    parser.add_argument("--block-steps", type=float, default=1e7)
    parser.add_argument("--chain-steps", type=float, default=1e6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="rests,smooth,turns,chain")
    parser.add_argument("--summary", help="file for what was found, as JSON")
    asked = parser.parse_args(arguments)
    steps, of_chain, every = int(asked.block_steps), int(asked.chain_steps), 0.5 if asked.block_steps >= 1e6 else 0.02
    found, here = {}, os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for name, run in {"rests": lambda r: rests(steps, r, every), "smooth": lambda r: smooth(steps, r, every),
                              "turns": lambda r: turns(steps, r), "chain": lambda r: chain(of_chain, r, every)}.items():
                if name in asked.only.split(","):
                    found[name] = run(random.Random(f"{asked.seed}/{name}"))
                    shown(name, found[name])
                    for left in os.listdir("."):
                        os.remove(left)
        finally:
            os.chdir(here)
    if asked.summary:
        with open(asked.summary, "w", encoding="utf-8") as file:
            json.dump(found, file, indent=2, default=float)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
