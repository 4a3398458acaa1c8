"""docs/published.md: published results against SciPy and closed forms."""
import functools
import json
import math
import os
import sys

import h5py
import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import iv

from calls import PROGRAM, SOURCE, ran, run, scene_file

sys.path.insert(0, os.path.join(SOURCE, "tests", "bench"))
import catalogues  # noqa: E402
import fronts  # noqa: E402
from reference import Stick, System  # noqa: E402


def stickslip(command, scene, *words):
    """The exit code and, where it is 0, the summary."""
    path = os.path.join(SOURCE, "runs", "published", scene + ".yaml")
    call = [PROGRAM, command, path, *map(str, words), "-summary", "s.json"]
    done = ran(call)
    if done.returncode:
        return done.returncode, done.stderr
    with open("s.json", encoding="utf-8") as file:
        return 0, json.load(file)


def runs_away(push, ageing, a=0.01, b=0.015, k=0.006):
    """The block without mass, by SciPy over its slip s: x = ln psi, q = ln theta, D = v = 1. Slip takes the
    place of time since the rates over s stay bounded. Whoever reaches x = 80 has run away: from x = 40 to 80
    the limit of pushes moves by 1e-7."""
    def rates(_, y):
        x, q = y
        state = math.exp(-x - q) - 1 if ageing else -(x + q)
        return [(k * math.expm1(-x) - b * state) / a, state]

    away, back = lambda _, y: y[0] - 80, lambda _, y: y[0]
    away.terminal = back.terminal = True
    back.direction = -1
    motion = solve_ivp(rates, (0, 1000), [math.log(push), 0], method="DOP853", rtol=1e-12, atol=1e-12,
                       events=(away, back))
    assert motion.status == 1
    return len(motion.t_events[0]) > 0


def test_large_pushes_of_a_block_above_its_critical_stiffness():
    """Slip law: a finite push runs away. The limit is SciPy's to 1e-5: a run ends where psi is
    about 1e15 (x = 35), and SciPy's own limit moves by 7e-6 from x = 30 to 40."""
    low, high = 1.5, 3
    while high / low > 1 + 1e-9:
        middle = math.sqrt(low * high)
        away = runs_away(middle, ageing=False)
        low, high = (low, middle) if away else (middle, high)
    tight = ["-ts_rtol", 1e-10, "-ts_atol", 1e-10]
    assert stickslip("run", "rice-ruina", "-init_psi", high * (1 - 1e-5), *tight)[1]["regime"] == "sliding"
    code, words = stickslip("run", "rice-ruina", "-init_psi", high * (1 + 1e-5), *tight)
    assert code == 1 and "runs away" in words
    for push in (3, 10):
        assert not runs_away(push, ageing=True)
        _, back = stickslip("run", "rice-ruina", "-state_law", "ageing", "-init_psi", push)
        assert back["regime"] == "sliding"


def ends(f0):
    code, found = stickslip("boundary", "belt", "-model_f0", f0, "-model_zeta", 0.1 * f0)
    assert code == 0
    return {(p["of"], p["kind"]): p["value"] for p in found["points"]}


def test_a_brake_of_weak_friction_obeys_its_average():
    """Sliding: exact. Stick-slip: the average is of second order, so that the next term is f0^2 = 0.04 of the
    distance or less."""
    average = brentq(lambda v: iv(1, v) * math.exp(-v) / v - 0.1, 0.1, 10, xtol=1e-14)
    distance = []
    for f0 in (0.2, 0.1, 0.05):
        found = ends(f0)
        assert abs(found["sliding", "hopf"] - math.log(5)) < 1e-9
        distance.append(average - found["stick-slip", "graze"])
    assert distance[0] > 0
    np.testing.assert_allclose(np.divide(distance[:-1], distance[1:]), 4, rtol=0.04)


def rests(v, f0, slips=8):
    """Whether the mass on the belt comes to rest within some slips, either way, from the threshold on."""
    y, side = [0, 1], 1
    for _ in range(slips):
        def rates(_, y, side=side):
            friction = 0.5 + 0.5 * math.exp(-abs(y[0]))
            return [f0 * (y[1] - 0.1 * y[0] - side * friction), (v - y[0]) / f0]

        stop = lambda _, y: y[0]
        stop.terminal, stop.direction = True, -side
        slip = solve_ivp(rates, (0, 100), [side * 1e-14, y[1]], method="DOP853", rtol=1e-11, atol=1e-12,
                         events=stop)
        y = slip.y[:, -1]
        if abs(y[1]) <= 1:
            return True
        side = math.copysign(1, y[1])
    return False


def test_a_brake_of_very_weak_friction_overtakes_the_belt():
    """1e-3 beyond the place eight slips pass without rest, 1e-3 before it one rests."""
    place = ends(0.0125)["stick-slip", "pass"]
    assert rests(place + 1e-3, 0.0125) and not rests(place - 1e-3, 0.0125)


def test_trains_of_the_figures_fit_the_rings_of_a_van_der_pol_oscillator():
    """psi = f(t - x/V): (1 - c²/V²) f'' + [gamma (f² - 1) + delta] f' + f - v = 0, L = n |V| T."""
    for figure, pulses, speed in ((3, 2, 4.88), (4, 4, 2.48), (5, 11, 1.08)):
        r = 1 - 1 / speed**2

        def rates(_, y, r=r):
            return [y[1], -((3 * (y[0]**2 - 1) + 0.2) * y[1] + y[0] - 0.2) / r]

        def up(_, y):
            return y[0]
        up.direction = 1
        course = solve_ivp(rates, (0, 45), [0, 1], method="DOP853", rtol=1e-10, atol=1e-11, events=up)
        period = course.t_events[0][-1] - course.t_events[0][-2]
        _, found = stickslip("wave", f"../figure{figure}", "-out_file", "train.h5")
        assert abs(found["length"] / (pulses * speed * period) - 1) < 1e-7


LAB = {"a": 0.01, "b": 0.015}


def recorded(k0, law, *words):
    """Time, force and slip of a run of the laboratory's block."""
    code, _ = stickslip("run", "laboratory", "-model_k0", k0, "-state_law", law, "-out_file", "lab.h5", "-out_frames",
                        2, *words)
    assert code == 0
    with h5py.File("lab.h5") as file:
        return file["series/t"][:], file["series/eta_mean"][:]


def test_half_of_a_velocity_steps_evolution_takes_the_slip_of_a_rigid_machine():
    """Halving the compliance halves what is left of it; the way to the half is interpolated to 1e-4 or so."""
    half = math.sqrt(10)
    rigid = {"ageing": (math.log(9 / (half - 1)), -math.log((1 - 1 / half) / 0.9)), "slip": (math.log(2),) * 2}
    for law, expected in rigid.items():
        off = []
        for k0 in (5, 10):
            t, force = recorded(k0, law)
            way = np.interp(t, [0, 1, 2, 12], [0, 1, 11, 21]) - force / k0
            for begin, end, sign, steady in ((1, 2, 1, 0.6 - 0.005 * math.log(10)), (2, 12, -1, 0.6)):
                part = (t >= begin) & (t <= end)
                above, slip = sign * (force[part] - steady), way[part]
                peak = above.argmax()
                off.append(np.interp(-LAB["b"] * math.log(10) / 2, -above[peak:], slip[peak:]) - slip[0])
        off = np.array(off).reshape(2, 2) - expected
        assert np.all(np.abs(off[1]) < 2.5e-3), (law, off)
        np.testing.assert_allclose(off[1], off[0] / 2, atol=3e-4)


def peak(k0, ageing, hold):
    """The peak above steady friction after a hold, by SciPy, without mass: x = ln psi, q = ln theta, D = v = 1."""
    a, b = LAB["a"], LAB["b"]

    def motion(v, y, end, events=None):
        def rates(_, y):
            x, q = y
            p = math.exp(x)
            ages = math.exp(-q) - p if ageing else -p * (x + q)
            return [(k0 * (v - p) - b * ages) / a, ages]
        return solve_ivp(rates, (0, end), y, method="Radau", rtol=1e-9, atol=1e-10, events=events)

    def turns(_, y):
        return -y[0]
    turns.terminal, turns.direction = True, -1
    x, q = motion(1, motion(0, [0, 0], hold).y[:, -1], 2, turns).y[:, -1]
    return a * x + b * q


def test_peaks_after_holds():
    """SciPy's in both laws; ageing near b ln(1 + v t/D), slip near a b/(2 k0 D) ln²(1 + k0 v t/a)."""
    for hold in (10, 1000):
        rigid = {"ageing": LAB["b"] * math.log1p(hold),
                 "slip": LAB["a"] * LAB["b"] / 20 * math.log1p(10 * hold / LAB["a"])**2}
        for law, limit in rigid.items():
            load = f"0:1,1:1,1:0,{1 + hold}:0,{1 + hold}:1"
            _, force = recorded(10, law, "-load_v", load, "-ts_max_time", hold + 3)
            assert abs(force.max() - 0.6 - peak(10, law == "ageing", hold)) < 3e-6
            assert abs((force.max() - 0.6) / limit - 1) < 0.025


def test_multipliers_of_a_block_with_the_plain_logarithm():
    """x = ln psi, u, the state: deviations carried round SciPy's cycle, which by then repeats to round-off."""
    stiffness, xi, epsilon = 0.64, 0.5, 1

    def rates(_, y):
        x, u, state = y[:3]
        p = math.exp(x)
        pull, ages = -stiffness * (u + (state + x) / xi) / p, -p * (state + (1 + epsilon) * x)
        J = np.array([[-stiffness / xi / p - pull, -stiffness / p, -stiffness / xi / p], [p, 0, 0],
                      [ages - p * (1 + epsilon), 0, -p]])
        return np.concatenate([[pull, p - 1, ages], (J @ y[3:].reshape(3, -1)).ravel()])

    def passes(_, y):
        return y[0]
    passes.terminal, passes.direction = True, 1
    y = np.array([math.log(1.05), 0, 0])
    for turn in range(7):
        start = np.concatenate([y, np.eye(3).ravel()]) if turn == 6 else y
        course = solve_ivp(rates, (0, 100), start, method="Radau", rtol=1e-9, atol=1e-11, events=passes)
        y = np.array([1e-15, *course.y[1:3, -1]])
    multipliers = sorted(abs(np.linalg.eigvals(course.y[3:, -1].reshape(3, 3))))
    _, found = stickslip("cycle", "erickson-block")
    assert abs(found["period"] / course.t[-1] - 1) < 1e-6
    assert abs(found["multipliers"][1]["re"] / multipliers[1] - 1) < 1e-3


def slips_of_a_chain(eta, v, k1, sigma, alpha, until):
    """The catalogue of a chain of Carlson and Langer between free ends (m = k0 = f0 = 1, no back slip), by SciPy:
    begin, end, first block, left block, blocks and moment of each time of motion. Each start and each stop ends an
    integration."""
    n, t, found = len(eta), 0.0, []
    springs = np.eye(n, k=1) + np.eye(n, k=-1)
    springs -= np.diag(springs.sum(axis=1))
    while True:
        wait = (1 - eta.max()) / v  # at rest eta grows as the plate goes
        if t + wait > until:
            return found
        t, eta, slip = t + wait, eta + v * wait, np.zeros(n)
        begin, first = t, int(np.argmax(eta))
        slides = np.arange(n) == first
        psi = np.zeros(n)
        while slides.any():
            def rates(_, y, slides=slides):
                psi = np.where(slides, y[:n], 0)
                friction = (1 - sigma) / (1 + 2 * alpha * psi / (1 - sigma))
                return np.r_[np.where(slides, y[n:2 * n] - friction, 0), v - psi + k1 * springs @ psi, psi]

            changes = [functools.partial(lambda _, y, place, at: y[place] - at, place=i if slides[i] else n + i,
                                         at=0 if slides[i] else 1) for i in range(n)]
            for i, change in enumerate(changes):
                change.terminal, change.direction = True, -1 if slides[i] else 1
            part = solve_ivp(rates, (t, t + 1e3), np.r_[psi, eta, slip], method="DOP853", rtol=1e-11,
                             atol=1e-13, events=changes)
            which = next(i for i in range(n) if len(part.t_events[i]))
            t, (psi, eta, slip) = part.t[-1], part.y[:, -1].reshape(3, n)
            slides = slides ^ (np.arange(n) == which)
            psi = np.where(slides, psi, 0)
        region = np.flatnonzero(slip)
        assert len(region) == np.ptp(region) + 1, "two events at once"
        found.append((begin, t, first, region[0], len(region), slip.sum()))


def test_a_catalogue_is_that_of_scipy_until_chaos_parts_the_two():
    """Eleven events of eight blocks, four of them of several. Either errs by less than 1e-8 in the sizes of an
    event, and passes on what it errs by in eta, which here grows to 4e-8 in all: loads as long as that part the
    times."""
    v, k1, sigma, alpha = 1e-3, 4.0, 0.05, 2.5
    eta = np.random.default_rng(4).uniform(0, 0.9, 8)
    np.savetxt("start.txt", np.c_[np.arange(8), 0 * eta, eta], fmt="%.17g")
    truth = np.array(slips_of_a_chain(eta, v, k1, sigma, alpha, 1500))
    run("-model_form chain -model_m 1 -model_k0 1 -model_f0 1 -friction_law carlson-langer -friction_back_slip false"
        f" -grid_n 8 -bc_left free -model_k1 {k1} -model_v {v} -friction_sigma {sigma} -friction_alpha {alpha}"
        " -ts_rtol 1e-11 -ts_atol 1e-12 -init_type text -init_file start.txt -ts_max_time 1500 -stick_clusters on"
        " -out_events -out_frames 2 -out_file c.h5")
    with h5py.File("c.h5") as file:
        columns = [file["events"][name][:] for name in ("begin", "t", "first", "left", "extent", "moment")]
    here = np.transpose(columns)
    assert here.shape == truth.shape and len(here) == 11
    np.testing.assert_array_equal(here[:, 2:5], truth[:, 2:5])
    np.testing.assert_allclose(here[:, 5], truth[:, 5], rtol=1e-6)
    np.testing.assert_allclose(here[:, :2], truth[:, :2], rtol=0, atol=1e-6 / v)


def test_small_and_large_events_of_carlson_and_langer():
    """The smallest slip is that of a block between blocks at rest, but for the plate's way meanwhile (v times some 0.2 =
    2e-5 of 0.01, by which the force drops). What is large has nearly all of the moment, which makes up for the
    plate's way but for what is stored: less than two thresholds, of five units."""
    code, found = stickslip("run", "carlson-langer", "-ts_max_time", 110000, "-grid_n", 300, "-out_file", "c.h5")
    assert code == 0 and found["clusters"] > 1
    with h5py.File("c.h5") as file:
        moment, begin = file["events/moment"][:], file["events/begin"][:]
        lone = catalogues.slip_of_a_lone_block(catalogues.read("c.h5", 6)["options"])
    assert abs(moment.min() / lone - 1) < 0.01
    late = moment[begin >= 60000]
    assert late[np.log(late) > 1.6].sum() > 0.99 * late.sum()
    assert abs(late.sum() / 300 - 5) < 2


def front(more, scene="front"):
    run(f"{scene_file('published/' + scene)} {more} -out_file front.h5")


def test_fronts_run_at_the_speed_of_their_prestress():
    """The second half of 200 blocks: the way to the speed of long chains falls off faster the larger q is."""
    for q, bound in ((0.3, 1e-3), (0.5, 1e-6), (0.8, 1e-6)):
        front(f"-init_eta {0.5 + 0.5 * q}")
        found_q, speed, error = fronts.speed("front.h5")
        assert abs(found_q - q) < 1e-12 and error < bound
        assert abs(speed * math.sqrt(1 - q * q) - 1) < bound


def test_fronts_stop_where_the_closed_form_says():
    """With inertia: 2 s1/s2 = 2 times as far as the surplus reaches. The last block's threshold keeps the front from
    the last (fs - eta)/s2 = 1.5 blocks, twice (there, and by what is sent back), and half a block is lost by the
    grid at either end; waves of the grid that nu takes away cost some blocks more, fewer than in proportion to the
    length."""
    for x0 in (50, 100):
        front(f"-grid_n {3 * x0 + 20} -friction_fd_profile 0:0.5,{x0 - 0.5}:0.9 -ts_max_time {10 * x0}", "arrest")
        with h5py.File("front.h5") as file:
            short = 3 * x0 - file["events/extent"][0]
        assert 2 <= short <= 5, f"{x0}: {short}"
    # a prestress that falls evenly: surplus x - x^2/(2 x0), which is -x0/2 at x0 (1 + sqrt 2)
    x0 = 100
    eta = 0.5 + 0.3 * (1 - np.arange(270) / x0)
    eta[0] = 1 + 1e-9
    np.savetxt("start.txt", np.c_[np.arange(270), 0 * eta, eta], fmt="%.17g")
    with open(os.path.join(SOURCE, "runs", "published", "arrest.yaml"), encoding="utf-8") as file:
        scene = file.read()
    start = scene[scene.index("init:"):scene.index("grid:")]
    profiles = [line for line in scene.splitlines() if "_profile:" in line]
    for old, now in ((start, "init: {type: text, file: start.txt}\n"), (profiles[0], "  fs: 1"),
                     (profiles[1], "  fd: 0.5"), ("profile_kind: step\n", "")):
        assert old in scene
        scene = scene.replace(old, now)
    with open("falling.yaml", "w", encoding="utf-8") as file:
        file.write(scene)
    run("falling.yaml -grid_n 270 -ts_max_time 1000 -out_file front.h5")
    with h5py.File("front.h5") as file:
        assert abs(file["events/extent"][0] - x0 * (1 + math.sqrt(2))) < 4


def test_strong_viscosity_stops_fronts_where_forces_balance():
    """Exactly: the first block whose threshold holds what all before it have too much. The last node whose force has
    changed is beside the last that has slipped."""
    x0, n = 25, 60
    front(f"-grid_n {n} -friction_fd_profile 0:0,0.5:0.5,{x0 - 0.5}:0.9 -model_nu 0 -model_zeta 1 -ts_max_time 20000",
          "arrest")
    surplus = np.cumsum(np.r_[0.7, np.full(x0 - 1, 0.2), np.full(n - x0, -0.2)])
    with h5py.File("front.h5") as file:
        changed = np.flatnonzero(file["eta"][-1] != file["eta"][0])
    assert changed[-1] == 1 + np.flatnonzero(surplus <= 0.3)[0]


def two_blocks(k1):
    return System(f"-model_form chain -grid_n 2 -bc_left free -model_k0 1 -model_k1 {k1} -model_v 0.1 "
                  "-friction_law carlson-langer -friction_alpha 1", np.ones(2))


def test_two_equal_blocks_move_as_one_or_are_chaotic():
    """At k1 = 1 SciPy's multipliers round the cycle; wave pi of a chain with k1 = 1/2 is the two against each other. At
    3.31 SciPy's exponent over 150 units, which scatters by the error of the run times sqrt(3000/150)."""
    together = Stick(two_blocks(1), [0, 0, 0.3, 0.25], rtol=1e-9, atol=1e-11).advance(100)
    turn = Stick(two_blocks(1), together, Y=np.eye(4), rtol=1e-9, atol=1e-11)
    code, found = stickslip("cycle", "equal-blocks", "-model_k1", 0.5, "-lyapunov_count", 0, "-cycle_spectrum", "-out_file",
                            "waves.h5")
    assert code == 0 and np.abs(turn.advance(found["period"]) - together).max() < 1e-6
    exponents = np.log(np.sort(np.abs(np.linalg.eigvals(turn.Y)))[::-1][:2]) / found["period"]
    with h5py.File("waves.h5") as file:
        assert abs(file["spectrum/wavenumber"][-1] - math.pi) < 1e-12
        apart = file["spectrum/growth_rate"][-1]
    assert np.all(np.abs(exponents - [0, apart]) < 1e-5)

    _, chaos = stickslip("run", "equal-blocks")
    logs = []

    def shorten(motion):
        logs.append(math.log(np.linalg.norm(motion.Y)))
        motion.Y /= np.linalg.norm(motion.Y)
    begin = Stick(two_blocks(3.31), [0, 0, 0.3, 0.25], rtol=1e-8, atol=1e-10).advance(40)
    motion = Stick(two_blocks(3.31), begin, Y=[[0.3], [0.1], [0.8], [-0.5]], rtol=1e-8, atol=1e-10)
    motion.advance(150, shorten)
    shorten(motion)
    scatter = chaos["lyapunov_largest_error"] * math.sqrt(3000 / 150)
    assert abs(sum(logs) / 150 - chaos["lyapunov_largest"]) < 4 * scatter


def test_waves_on_the_oscillation_of_the_cubic_change_sign_from_turn_to_turn():
    """psi' = gamma (eta - phi), eta' = (v - psi)/gamma, and of a wave eta' = -(1 + c²k²) psi/gamma; nu = 0."""
    code, found = stickslip("cycle", "pacemakers", "-model_nu", 0, "-cycle_spectrum", "-out_file", "waves.h5")
    assert code == 0
    with h5py.File("waves.h5") as file:
        waves, multiplier = file["spectrum/wavenumber"][:], file["spectrum/multiplier_re"][:].min(axis=1)
    lead = multiplier.argmin()
    k = waves[lead]

    def rates(_, y, k=k):
        psi, eta = y[:2]
        grown = np.array([[3 - 3 * psi**2, 3], [-(1 + k * k) / 3, 0]]) @ y[2:].reshape(2, 2)
        return [3 * (eta - psi**3 / 3 + psi), (0.98 - psi) / 3, *grown.ravel()]

    def up(_, y):
        return y[0]
    up.terminal, up.direction = True, 1
    y = np.array([1e-9, 0, 1, 0, 0, 1])
    for _ in range(4):
        turn = solve_ivp(rates, (0, 60), [1e-9, y[1], 1, 0, 0, 1], method="DOP853", rtol=1e-11, atol=1e-12, events=up)
        y = turn.y[:, -1]
    assert abs(found["period"] / turn.t[-1] - 1) < 1e-7
    expected = np.linalg.eigvals(y[2:].reshape(2, 2)).real.min()
    assert expected < -2.5 and abs(multiplier[lead] / expected - 1) < 1e-5


def test_fronts_of_an_excitable_chain():
    """By SciPy; when a block first stops is interpolated between steps. With weak springs no pulse leaves the end."""
    n, v, gamma = 100, 1.2, 3
    x = np.arange(n)
    psi = v + (-2 - v) * np.exp(-(x / 2.0)**2)

    def rates(_, y):
        u, eta = y[:n], y[n:]
        pull = np.r_[0, np.diff(u, 2), u[-2] - u[-1]]
        grown = np.array([gamma * (eta - u**3 / 3 + u), (v - u + pull) / gamma])
        grown[:, 0] = 0  # held
        return grown.ravel()

    stops = [lambda _, y, i=i: y[i] for i in (50, 90)]
    exact = solve_ivp(rates, (0, 100), np.r_[psi, psi**3 / 3 - psi], method="DOP853", rtol=1e-8, atol=1e-9, events=stops)
    expected = 40 / (exact.t_events[1][0] - exact.t_events[0][0])
    scene = ["-grid_n", n, "-out_probes", "50,90", "-out_file", "front.h5"]
    for k1, end in ((1, 100), (0.1, 200)):
        assert stickslip("run", "excitable", "-model_k1", k1, "-ts_max_time", end, *scene)[0] == 0
        with h5py.File("front.h5") as file:
            t, psi = file["probes/t"][:], file["probes/psi"][:]
        if k1 == 0.1:
            assert psi.min() > 1
            continue
        first = [np.interp(0, -psi[:i + 1, j], t[:i + 1]) for j in (0, 1) for i in [np.argmax(psi[:, j] < 0)]]
        np.testing.assert_allclose(first, [found[0] for found in exact.t_events], rtol=0, atol=2e-3)
        assert abs(40 / (first[1] - first[0]) / expected - 1) < 2e-4


def test_a_block_with_n_shaped_friction_between_regular_and_relaxation_oscillations():
    """The curve of Hopf points, K = -r b (1 + r/(A a)) with a = F_psi, b = dF_ss/dv, r = -g_theta (docs/theory.md). For
    small k0 the block follows steady friction but for jumps at its extremes: T k0 tends to an integral over the two
    branches, as k0^(2/3) (the way round a fold), and the velocities to those at which the jumps end."""
    a, b, h = 0.05, 0.1, 0.005

    def friction(psi, theta):
        return a * np.arcsinh(psi / 0.2 * np.exp((0.6 + b * np.log(0.1 * theta + 1)) / a))

    def steady(v):
        return friction(v, 1 / np.sqrt(v**2 + h**2))

    def slope(f, v):
        return np.imag(f(v * (1 + 1e-30j))) / (v * 1e-30)

    code, found = stickslip("boundary", "n-block", "-boundary_of", "sliding", "-boundary_parameter", "model_v", "-boundary_from",
                            1e-3, "-boundary_to", 1, "-boundary_log", "-boundary_parameter2", "model_k0", "-boundary_from2", 1e-4,
                            "-boundary_to2", 0.1, "-boundary_log2", "-boundary_points", 15)
    assert code == 0 and len(found["points"]) > 10
    for point in found["points"]:
        v = point["value"]
        r = math.hypot(v, h)
        direct = slope(lambda w, r=r: friction(w, 1 / r), v)
        assert abs(point["value2"] / (-r * slope(steady, v) * (1 + r / direct)) - 1) < 1e-6

    top, bottom = brentq(lambda v: slope(steady, v), 0.003, 0.01), brentq(lambda v: slope(steady, v), 0.03, 0.3)
    slow = brentq(lambda v: steady(v) - steady(bottom), 1e-6, top)
    fast = brentq(lambda v: steady(v) - steady(top), bottom, 10)
    limit = sum(quad(lambda x: slope(steady, math.exp(x)) * math.exp(x) / (0.02 - math.exp(x)), math.log(begin), math.log(end))[0]
                for begin, end in ((slow, top), (fast, bottom)))
    off = []
    for k0 in (1e-4, 1e-5):
        _, cycle = stickslip("cycle", "n-block", "-model_k0", k0)
        off.append([cycle["period"] * k0 / limit - 1, cycle["psi_min"] / slow - 1, 1 - cycle["psi_max"] / fast])
    assert np.all(np.abs(off[1]) < [0.03, 0.006, 0.006]) and np.all(np.array(off) * [1, -1, 1] * [1, 0, 1] >= 0)
    np.testing.assert_allclose(off[0][0] / off[1][0], 10**(2 / 3), rtol=0.1)
