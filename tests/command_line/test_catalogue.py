"""Statistics of catalogues (postprocess/catalogue.py): on catalogues drawn from known laws, and as a user calls it."""
import json
import os
import sys

import numpy as np
import pytest
from scipy.integrate import trapezoid

from calls import SOURCE, call, check, scene_file, tool, words

sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
import catalogue as c  # noqa: E402


def drawn(random, b, number, width=3.0):
    """Magnitudes of a density exp(-b m) on [0, width]."""
    return -np.log1p(random.random(number) * np.expm1(-b * width)) / b


def run(magnitude, begin=None, end=100.0, n=10, **options):
    begin = np.sort(np.asarray(begin)) if begin is not None else np.linspace(0, end, len(magnitude), endpoint=False)
    return {"events": {"magnitude": np.asarray(magnitude), "begin": begin, "moment": np.exp(magnitude),
                       "direction": np.ones(len(magnitude)), "extent": np.ones(len(magnitude))},
            "x": np.arange(n), "t": np.array([0, end]), "begin": 0.0, "end": end, "way": 0.01 * end, "shift": 0.01 * end, "path": "drawn",
            "options": {"init_seed": "1", "grid_n": str(n), **options}}


def test_b_is_that_of_the_law():
    for b in (0.3, 1.0, 2.5):
        m = drawn(np.random.default_rng(1), b, 20000)
        found, error, number = c.fit(m, 0, 3)
        check(number == 20000 and abs(found - b) < 4 * error, f"b {b}: {found} +- {error}")
        # the curvature of the likelihood: the variance of the truncated exponential, by quadrature
        x = np.linspace(0, 3, 20001)
        w = np.exp(-b * x)
        mean = trapezoid(x * w, x) / trapezoid(w, x)
        variance = trapezoid((x - mean)**2 * w, x) / trapezoid(w, x)
        check(abs(error * np.sqrt(20000 * variance) - 1) < 0.02, f"its error: {error}")
    check(abs(c.mean_of(1e-9, 3) - 1.5) < 1e-8 and abs(c.mean_of(-0.7, 3) + c.mean_of(0.7, 3) - 3) < 1e-12, "symmetric about b = 0")
    check(np.isnan(c.fit(np.zeros(3), 0, 3)[0]), "too few for a fit")
    for freedom, factor in ((1, 12.7062), (2, 4.30265), (3, 3.18245), (4, 2.77645), (7, 2.36462), (30, 2.04227)):
        check(abs(c.student(freedom) / factor - 1) < 0.01, f"Student's factor of {freedom}: {c.student(freedom)}")


def test_intervals_cover_what_they_should():
    """95 % of the intervals hold the true b, of many runs and of few, of long ones and of short. spread: of b from
    run to run, so that events of a run are not independent draws; uneven: runs of unequal length."""
    random = np.random.default_rng(2)
    cases = ((8, 100, 1, 0, 0), (8, 100, 1, 0.3, 0), (2, 12, 0.4, 0, 0), (2, 60, 2.5, 0, 0), (3, 10, 1, 0, 0),
             (3, 60, -0.5, 0.3, 0), (5, 40, 1, 0, 0.5))
    for number, each, b, spread, uneven in cases:
        held = naive = made = 0
        while made < 300:
            counts = random.poisson(each * np.exp(uneven * random.normal(size=number)))
            runs = [run(drawn(random, b + spread * random.normal(), count)) for count in counts]
            found, error, count = c.fit(np.concatenate([c.magnitudes(r) for r in runs]), 0, 3)
            if count < c.FEWEST:
                continue
            low, high = c.interval(runs, 0, 3)
            check(low <= found <= high, f"b {found} outside [{low}, {high}]")
            made += 1
            held += low <= b <= high
            naive += abs(found - b) <= 1.96 * error
        case = f"{number} runs of {each}, b {b}, spread {spread}, uneven {uneven}"
        check(0.91 < held / made < 0.99, f"{case}: {held / made}")
        if each >= 60:
            check((naive / made > 0.9) == (spread == 0), f"{case}: errors of independent events: {naive / made}")
    low, high = c.interval([run(drawn(random, 1, 800))], 0, 3)
    b, error, _ = c.fit(drawn(random, 1, 800), 0, 3)
    check(abs((low + high) / 2 - 1) < 4 * error and 2 < (high - low) / error < 6,
          f"one run, by stretches of its time: {low} {high}, error {error}")


def test_goodness_of_fit():
    random = np.random.default_rng(3)
    p = np.array([c.goodness(drawn(random, 0.8, 150), 0, 3, draws=99, seed=k) for k in range(100)])
    check(abs(np.mean(p <= 0.05) - 0.05) < 0.07 and abs(p.mean() - 0.5) < 0.1, f"of true lines: {np.mean(p <= 0.05)} {p.mean()}")
    bump = np.r_[drawn(random, 1, 300), 2.2 + 0.1 * random.normal(size=60)]
    check(c.goodness(bump, 0, 3) < 0.01, "a bump is seen")
    check(c.goodness(np.full(30, 0.5), 0, 3) < 0.01, "equal magnitudes are no line")
    check(np.isnan(c.goodness(np.zeros(3), 0, 3)), "too few")


def test_stationarity():
    random = np.random.default_rng(4)

    def times(early, late):
        return np.r_[50 * random.random(random.poisson(early)), 50 + 50 * random.random(random.poisson(late))]

    held = 0
    for _ in range(100):
        runs = []
        for _ in range(8):
            t = times(60, 60)
            runs.append(run(drawn(random, 1, len(t)), t))
        found = c.halves(runs)["events"]
        held += found["low"] <= 1 <= found["high"]
    check(abs(held / 100 - 0.95) < 0.07, f"stationary: {held / 100}")
    runs = []
    for _ in range(8):
        t = times(60, 120)
        runs.append(run(drawn(random, 1, len(t)), t))
    found = c.halves(runs)["events"]
    check(1 < found["low"] < 2 < found["high"], f"twice as many later: {found}")


def test_ensembles_and_size():
    random = np.random.default_rng(5)
    runs = [run(np.log(n**1.5 * (1 + random.random(100))), n=n, grid_n=str(n), init_seed=str(k)) for n in (10, 20, 40)
            for k in range(3)]
    groups = c.ensembles(runs, "grid_n")
    check([value for value, _ in groups] == ["10", "20", "40"] and all(len(members) == 3 for _, members in groups), "by size")
    table = {value: c.statistics(members, (0, 9)) for value, members in groups}
    check(abs(c.size_exponent(table) - 1.5) < 0.05, f"exponent {c.size_exponent(table)}")
    with pytest.raises(c.Unusable, match="grid_n"):
        c.ensembles(runs)


class Clock:
    """A plate that goes as time does."""
    @staticmethod
    def way(t):
        return t


def places_of(left, extent, n, ring):
    nodes = range(int(left) - 1, int(left + extent) + 1)  # with those beside
    return {i % n for i in nodes} if ring else set(nodes)


def test_foreshocks_and_aftershocks_are_those_of_the_rule():
    # one event after the other, by sets of nodes; and in the reverse of time the two change places
    random = np.random.default_rng(6)
    for ring in (True, False):
        n, number = 30, 400
        r = run(drawn(random, 0.5, number), random.uniform(0, 100, number), n=n, bc_left="periodic" if ring else "free")
        e, r["plate"] = r["events"], Clock
        e["extent"] = random.integers(1, 9, number).astype(float)
        e["left"] = np.floor(random.random(number) * (n if ring else n + 1 - e["extent"]))
        own = [set(i % n for i in range(int(a), int(a + k))) for a, k in zip(e["left"], e["extent"])]
        beside = [places_of(a, k, n, ring) for a, k in zip(e["left"], e["extent"])]
        mains = fore = after = expected = 0
        for k in range(number):
            t, m = e["begin"][k], e["magnitude"][k]
            near = [j for j in range(number) if j != k and own[j] & beside[k]]
            close = [j for j in near if abs(e["begin"][j] - t) <= 2.5]
            if m < 2 or t < 2.5 or t > 97.5 or any(e["magnitude"][j] > m for j in close):
                continue
            mains += 1
            fore += sum(e["begin"][j] < t for j in close)
            after += sum(e["begin"][j] > t for j in close)
            expected += sum(e["magnitude"][j] < m for j in near) * 2.5 / 100
        found = c.sequences([r], 2, 2.5)
        check(found["main_shocks"] == mains > 10 and abs(found["by_mean_rate"] * mains / expected - 1) < 1e-12, f"main shocks {found}")
        check(abs(found["foreshocks"] * mains - fore) < 1e-9 and abs(found["aftershocks"] * mains - after) < 1e-9, f"{fore}, {after}: {found}")
        e["begin"] = 100 - e["begin"]
        turned = c.sequences([r], 2, 2.5)
        check(turned["foreshocks"] == found["aftershocks"] and turned["aftershocks"] == found["foreshocks"], "backwards")
    check(c.sequences([r], 4, 2.5) is None, "no main shock")
    # events that know nothing of each other come at the mean rate, as nothing exceeds a main shock of the largest magnitude;
    # and ten planted behind each of thirty are found
    magnitude, begin = np.zeros(20000), np.sort(random.uniform(0, 100, 20000))
    magnitude[::600] = 3
    r = run(magnitude, begin, n=1, bc_left="free")
    r["plate"], r["events"]["left"] = Clock, np.zeros(20000)
    found = c.sequences([r], 3, 1)
    for name in ("foreshocks", "aftershocks"):
        check(abs(found[name] - found["by_mean_rate"]) < 4 * found[name + "_error"], f"at random: {found}")
    main = begin[::600]
    more = np.concatenate([t + random.uniform(0, 1, 10) for t in main])
    order = np.argsort(np.r_[begin, more])
    planted = run(np.r_[magnitude, np.zeros(len(more))][order], np.r_[begin, more], n=1, bc_left="free")
    planted["plate"], planted["events"]["left"] = Clock, np.zeros(len(order))
    grown = c.sequences([planted], 3, 1)
    others = len(more) * 1 / 100  # of other main shocks, wherever they are
    check(10 <= grown["aftershocks"] - found["aftershocks"] < 10 + 3 * others, f"planted: {grown}, {found}")


def test_as_a_user_calls_it():
    for seed in (1, 2, 3):
        call(scene_file("catalogue") + f" -grid_n 40 -ts_max_time 6000 -out_frames 2 -out_file c-{seed:06d}.h5 -init_seed {seed}").check_returncode()
    files = [f"c-{seed:06d}.h5" for seed in (1, 2, 3)]
    done = tool("catalogue.py", *files, "--from", 1, "--fit", -3.5, -0.5, "-o", "c.png", "--json", "c.json", "--by", "grid_n")
    check(done.returncode == 0, done.stderr)
    row = json.load(open("c.json"))["grid_n 40"]
    check(row["runs"] == 3 and row["nodes"] == 40 and row["events"] > 50, f"table: {row}")
    check(0.8 < row["moment_per_node_and_way"] < 1.2, f"slip makes up for the plate: {row['moment_per_node_and_way']}")
    check("3 runs of 40 nodes" in done.stdout and os.path.getsize("c.png") > 10000, done.stdout)
    check("sequences" not in row and "main shock" not in done.stdout, "unasked for")
    done = tool("catalogue.py", *files, "--main", 1, "--window", 0.2, "--json", "c.json")
    check(done.returncode == 0, done.stderr)
    row = json.load(open("c.json"))["all"]["sequences"]
    check(row["main_shocks"] > 5 and f"  {row['main_shocks']} main shocks, each with" in done.stdout, f"{row}: {done.stdout}")
    for wrong, said in ((files + ["--by", "nothing"], "no option nothing"), (["none.h5"], "does not exist"),
                        (files + ["--from", "90"], "ends before")):
        refused = tool("catalogue.py", *wrong)
        check(refused.returncode == 1 and said in refused.stderr and refused.stderr.count("\n") == 1, refused.stderr)


def way_in_small_steps(points, amplitude, period, v, end):
    """How far the plate has come and gone: sums over a million pieces of time."""
    t = (np.arange(10**6) + 0.5) * end / 10**6
    w = np.full_like(t, v)
    if points:
        behind = [k for k in range(len(points)) if k + 1 == len(points) or points[k + 1][0] > points[k][0]]
        w = np.full_like(t, points[0][1])
        for k in behind:
            a, u = points[k]
            b, to = points[k + 1] if k + 1 < len(points) else (a + 1, u)
            w = np.where(t >= a, u + (to - u) * (t - a) / (b - a), w)
    w += amplitude * np.sin(2 * np.pi * t / period)
    return t, np.cumsum(w) * end / 10**6, np.cumsum(np.abs(w)) * end / 10**6


def test_the_way_of_the_plate_under_a_load():
    """Of loads drawn at random, of either direction, with corners, steps and sines; --from counts on it."""
    random = np.random.default_rng(7)
    for scene in range(6):
        end, v = random.uniform(2, 9), random.uniform(-1, 1)
        times = np.repeat(np.sort(random.uniform(0, 1.2 * end, 3)), random.integers(1, 3, 3)) if scene % 3 else []
        points = [(float(t), float(u)) for t, u in zip(times, random.uniform(-1, 1, len(times)))]
        amplitude, period = (random.uniform(0.1, 1), random.uniform(0.3, 6)) if scene % 2 == 0 else (0, 1)
        table = ",".join(f"{t!r}:{u!r}" for t, u in points)
        options = (f"-load_v {table} " if points else "") + \
            (f"-load_sine_amplitude {amplitude} -load_sine_period {period}" if amplitude else "")
        ran("-model_form", "chain", "-grid_n", "1", "-model_v", v, *words(options), "-ts_max_time", end, "-out_frames", "2",
            "-out_file", "way.h5")
        with c.reading("way.h5") as file:
            plate = c.Plate(file, end)
        t, shift, way = way_in_small_steps(points, amplitude, period, v, end)
        some = slice(1000, None, 9999)
        off = max(abs(plate.shift(t) - shift)[some].max(), abs(plate.way(t) - way)[some].max())
        check(off < 2e-5, f"{options}: off by {off}")
        check(abs(plate.time_of(way[-1] / 2) - t[np.searchsorted(way, way[-1] / 2)]) < 1e-2, f"{options}: half of the way")


def test_a_load_that_is_a_constant_velocity():
    """The plate goes as at model_v, and so do the events and the table."""
    def table(seeds, end, way):
        tables = []
        for how in ("-model_v 2e-3", "-load_v 0:2e-3,3000:2e-3"):
            runs = []
            for seed in seeds:
                ran(*words(scene_file("catalogue")), "-grid_n", 300, "-init_noise_of", "psi", "-init_seed", seed,
                    "-friction_alpha", 2, "-ts_max_time", end, "-out_frames", 2, *words(how), "-out_file", "a.h5")
                runs.append(c.read("a.h5", way))
            tables.append((runs, c.statistics(runs, (-5, -0.5))))
        return tables

    # at first the motion is the same but for round-off, which ten chains of 30 blocks enlarged to 4e-8 at most by t = 200
    (one, first), (other, second) = table([1], 200, 0)
    one, other = one[0]["events"], other[0]["events"]
    check(len(one["t"]) == len(other["t"]) > 100, f"{len(one['t'])} events at a constant velocity, {len(other['t'])} under a load")
    for key in ("begin", "t", "moment", "extent", "left"):
        check(np.allclose(other[key], one[key], rtol=1e-6, atol=1e-6), f"{key}: {one[key]} {other[key]}")
    for key in ("events", "per_node_and_way", "moment_per_node_and_way", "in_fit", "b"):
        check(abs(first[key] / second[key] - 1) < 1e-6, f"{key}: {first} at a constant velocity, {second} under a load")
    # later the two are different motions of one kind: numbers and moments of runs scatter by 9 %, so that the means of
    # 6 differ by 5.2 %
    (_, first), (_, second) = table(range(1, 7), 1500, 1)
    for key in ("events", "per_node_and_way", "moment_per_node_and_way"):
        check(abs(first[key] / second[key] - 1) < 0.1, f"{key}: {first} at a constant velocity, {second} under a load")


def ran(*arguments):
    done = call(arguments)
    check(done.returncode == 0, done.stderr)
