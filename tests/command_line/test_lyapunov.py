"""Lyapunov exponents beside a run (lyapunov_count): known values, independent integrations, ranks, restart, refusals."""
import math
import os

import h5py
import numpy as np
import pytest

import calls
from calls import SOURCE, check, data, refused, scene_file
from reference import Stick, System, read


def run(*arguments, **more):
    return calls.run(*arguments, **more)[0]


def exponents(summary):
    """Values (-inf where a direction is lost) and errors."""
    value = np.array([-math.inf if e["value"] is None else e["value"] for e in summary["lyapunov"]])
    return value, np.array([math.nan if e["error"] is None else e["error"] for e in summary["lyapunov"]])


def two_blocks(spread, more=""):
    """Options of runs/two-blocks.yaml and its equations; its comment names the draws of its seed."""
    draws = np.array([-0.9315399682553215, 0.9315583105115364])
    own = "-model_form chain -grid_n 2 -bc_left free -model_k0 1 -model_k1 1 -model_v 0.1 -friction_law carlson-langer "
    own += more if "alpha" in more else f"-friction_alpha 2 {more}"
    return f"{scene_file('two-blocks')} -friction_spread {spread} {more}", System(own, 1 + draws * spread)


def round_a_cycle(system, u, period):
    """How far a turn misses itself, and the magnitudes of the multipliers, largest first."""
    turn = Stick(system, u, Y=np.eye(4), rtol=1e-9, atol=1e-11)
    return np.abs(turn.advance(period) - u).max(), np.sort(np.abs(np.linalg.eigvals(turn.Y)))[::-1]


def own_scene():
    """runs/two-blocks.yaml without its alpha."""
    with open(os.path.join(SOURCE, "runs", "two-blocks.yaml"), encoding="utf-8") as file, open("own.yaml", "w", encoding="utf-8") as own:
        own.writelines(line for line in file if "alpha:" not in line)
    return "own.yaml"


def moments_of(path, after):
    with h5py.File(path) as file:
        return file["events/moment"][:][file["events/begin"][:] > after]


def test_at_steady_sliding_they_are_the_growth_rates():
    random = np.random.default_rng(1)
    scenes = ["-grid_n 5 -grid_length 4 -model_v 1.2", "-grid_n 4 -grid_length 4 -grid_order 2 -bc_left velocity -bc_right free -model_v 1.3",
              "-model_form chain -grid_n 3 -bc_left free -model_zeta 0.4 -model_v 1.1 -friction_law carlson-langer",
              "-model_form chain -grid_n 2 -bc_left free -model_k0 1 -model_v 1 -friction_law carlson-langer -state_law healing "
              "-model_zeta 0.9",
              "-model_form chain -grid_n 2 -bc_left free -model_k0 1 -model_v 1 -friction_law rate-and-state",
              "-grid_n 4 -grid_length 4 -grid_order 2 -bc_left free -model_v 0.99 -model_nu 0.2"]
    for scene in scenes:
        scene += f" -model_k1 {random.uniform(0.1, 1):.3f}" if "chain" in scene else f" -model_gamma {random.uniform(2, 4):.3f}"
        modes = run(scene + " -spectrum_count 30 -spectrum_refine off", command="spectrum")["eigenvalues"]
        rates, fastest = [e["re"] for e in modes], max(abs(complex(e["re"], e["im"])) for e in modes)
        s = run(f"{scene} -init_psi steady -init_eta steady -init_noise 1e-6 -ts_max_time 400 -lyapunov_count {len(rates)} "
                "-ts_rtol 1e-9 -ts_atol 1e-9")
        value, error = exponents(s)
        check(np.all(np.abs(np.sort(value)[::-1] - rates) <= 4 * error + 1e-4 * np.abs(rates)), f"{scene}: {value} {rates}")
        # over a part 0.3/fastest a mode of that rate errs by 0.3^5/3600 of it (tangents.cpp)
        check(abs(value.sum() - sum(rates)) < 1.2 * 0.3**5 / 3600 * fastest * len(rates), f"sum {value.sum()} {sum(rates)}")
        if max(rates) < 0:
            check(s["lyapunov_dimension"] == 0 and s["lyapunov_dimension_error"] == 0 and not s["warnings"], f"a point: {s['lyapunov_dimension']}")


def test_the_sum_is_the_divergence():
    random = np.random.default_rng(2)
    for _ in range(3):
        n = int(random.integers(3, 7))
        scene = random.choice([f"-grid_n {n} -grid_order 2 -grid_length {n}", f"-grid_n {n} -grid_order 2 -grid_length {n} -bc_left free",
                               f"-model_form chain -grid_n {n} -bc_left velocity -bc_left_value 0.4"])
        held = 2 if "velocity" in scene else 0
        scene += f" -model_nu {random.choice([0, 0.05])}"
        s = run(f"{scene} -model_v {random.uniform(0, 0.8):.3f} -init_noise 0.7 -ts_max_time 40 -lyapunov_count {2 * n - held}")
        value, _ = exponents(s)
        check(abs(value.sum() - s["lyapunov_divergence"]) < 1e-5 * np.abs(value).sum(), f"{scene}: {value.sum()} {s['lyapunov_divergence']}")


def test_one_exponent_of_an_oscillation_is_zero():
    """One node: 0, and with a rest nothing else; without, the other is the divergence. The zero errs by (period/time)^2."""
    for scene, rests in (("-model_form chain -grid_n 1", False), ("-model_form chain -grid_n 1 -friction_law coulomb -model_k0 1 -model_v 0.1", True),
                         ("-model_form chain -grid_n 1 -friction_law carlson-langer -model_zeta paper", True)):
        s = run(f"{scene} -init_psi 0 -ts_max_time 800 -lyapunov_count 2 -ts_rtol 1e-7 -ts_atol 1e-7")
        value, _ = exponents(s)
        check(abs(value[0]) < 3e-3, f"{scene}: zero is {value[0]}")
        check(s["lyapunov_dimension"] == 1, f"a closed line: {s['lyapunov_dimension']}")
        check((value[1] == -math.inf and s["lyapunov_divergence"] is None) if rests else
              abs(value[0] + value[1] - s["lyapunov_divergence"]) < 1e-5, f"{scene}: {value}")


def test_on_a_cycle_they_are_those_of_the_multipliers():
    scene, model = two_blocks(0.08)
    s = run(scene + " -ts_max_time 3000 -ts_rtol 1e-9 -ts_atol 1e-9 -out_file c.h5 -out_frames 2")
    value, error = exponents(s)
    begin = data("c.h5")["events/begin"]
    period = (begin[-1] - begin[-11]) / 5  # two events a turn
    missed, multipliers = round_a_cycle(model, read(data("c.h5"), -1), period)
    check(missed < 1e-5, f"the cycle closes: {missed}")
    check(abs(multipliers[0] - 1) < 1e-5, f"one multiplier is 1: {multipliers}")
    expected = np.log(multipliers[:2]) / period
    check(np.all(np.abs(value[:2] - expected) < 2e-4), f"{value[:2]}, by scipy {expected}")
    check(np.all(value[2:] == -math.inf) and multipliers[2] < 1e-6, f"two directions end: {value} {multipliers}")


@pytest.mark.parametrize("nu, alpha", [(0.05, (2, 2)), (0, (2, 1.9)), (0.03, (2, 1.9))])
def test_a_cycle_with_rests_viscosity_and_a_profile(nu, alpha):
    # run, cycle and scipy pass each start and stop in code of their own
    more = f" -friction_alpha_profile 0:{alpha[0]},1:{alpha[1]}" if alpha[0] != alpha[1] else ""
    scene, model = two_blocks(0.08, f"-model_nu {nu}{more}")
    # the scene's own value stands in its file
    scene = scene if alpha[0] == alpha[1] else scene.replace(scene_file("two-blocks"), own_scene())
    found = run(f"{scene} -cycle_cell 0 -out_events false -lyapunov_count 0 -out_file v.h5", command="cycle")
    missed, multipliers = round_a_cycle(model, read(data("v.h5"), 0), found["period"])
    check(missed < 1e-7, f"the cycle closes: {missed}")
    known = np.sort([abs(complex(m["re"], m["im"])) for m in found["multipliers"]])[::-1]
    check(np.all(np.abs(known - multipliers) < 1e-6), f"multipliers {known}, by scipy {multipliers}")
    if alpha[0] != alpha[1]:
        return
    s = run(scene + " -ts_max_time 3000 -ts_rtol 1e-9 -ts_atol 1e-9")
    value, _ = exponents(s)
    expected = np.log(multipliers[:2]) / found["period"]
    check(np.all(np.abs(value[:2] - expected) < 2e-4), f"{value[:2]}, by scipy {expected}")


def test_under_an_oscillating_load():
    # one block of the cubic about stable sliding, v(t) = 1.2 + 0.3 sin: the monodromy matrix over a period of the load by scipy
    period = 9.0

    scene = "-model_form chain -grid_n 1 -model_v 1.2 -load_sine_amplitude 0.3 -load_sine_period 9 "
    system = System(scene)
    z = system.follow(np.array([1.2, -0.6]), 0, 10 * period)
    end, matrix = system.carried(z, period)
    check(np.abs(end - z).max() < 1e-5, "the motion is locked to the load")
    expected = np.sort(np.log(np.abs(np.linalg.eigvals(matrix))))[::-1] / period
    s = run(f"{scene} -init_psi 1.2 -lyapunov_count 2 -lyapunov_from 90 -ts_max_time 540 -ts_rtol 1e-8 -ts_atol 1e-8")
    value, error = exponents(s)
    check(np.all(np.abs(value - expected) < 4 * error + 1e-4), f"{value} +- {error}, by scipy {expected}")


def test_with_rests_under_a_load():
    # a block that sticks and slips under an oscillating plate: what becomes of a small change of its start, by two runs, from a
    # slip near 25 to the end is what the vector grows by; a step's growth is shared out evenly over its time, which errs by
    # some 1e-3 at the first of these
    text = ("-model_form chain -grid_n 1 -model_k0 1 -model_zeta 0.1 -model_v 0.1 -friction_law carlson-langer -friction_alpha 1 "
            "-init_psi 0 -load_sine_amplitude 0.08 -load_sine_period 7 -ts_rtol 1e-11 -ts_atol 1e-12 -ts_max_time 61 ")
    run(text + "-init_eta 0.3 -lyapunov_count 1 -lyapunov_from 0 -out_file l.h5")
    with h5py.File("l.h5") as file:
        t, rate = file["lyapunov/t"][:], file["lyapunov/rate_1"][:]
    first, ends = int(np.searchsorted(t, 25)), []
    for eta in (0.3 - 1e-6, 0.3 + 1e-6):
        run(text + f"-init_eta {eta!r} -out_file e.h5 -out_times {float(t[first])!r},61")
        with h5py.File("e.h5") as file:
            ends.append(np.stack([file["psi"][:, 0], file["eta"][:, 0]]))
    check(ends[0][0, 0] > 0.1 and ends[0][0, 1] == 0, "from a slip to a rest")
    apart = np.log(np.linalg.norm(ends[1] - ends[0], axis=0))
    grown = np.sum((rate * np.diff(np.r_[0, t]))[first + 1:])
    check(abs(grown - apart[1] + apart[0]) < 1e-2, f"the vector grows by {grown}, runs part by {apart[1] - apart[0]}")


def test_chaos_of_two_blocks():
    scene, model = two_blocks(0.3)
    s = run(scene + " -out_file c.h5 -out_frames 2")
    value, error = exponents(s)
    check(value[0] > 5 * error[0] > 0 and abs(value[1]) < 5e-3, f"chaos and a zero: {value} {error}")
    check(abs(s["lyapunov_dimension"] - 2) < 0.1 and s["lyapunov_largest"] == value[0], f"dimension: {s['lyapunov_dimension']}")
    file = data("c.h5")
    check(len(file["lyapunov/rate_1"]) == 256 and abs(file["lyapunov/t"][-1] - 4000) < 1e-6, "rows of the file")
    time, logs = 300.0, []

    def shorten(motion):
        logs.append(np.log(np.linalg.norm(motion.Y)))
        motion.Y /= np.linalg.norm(motion.Y)
    motion = Stick(model, read(file, -1), Y=[[0.3], [0.1], [0.8], [-0.5]], rtol=1e-9, atol=1e-11)
    motion.advance(time, shorten)
    shorten(motion)
    # over so short a time the exponent scatters by error sqrt(3000/300)
    apart = abs(sum(logs) / time - value[0])
    check(apart < 4 * error[0] * math.sqrt(3000 / time), f"by scipy: {apart} off {value[0]}")


def test_periods_double_and_laminar_phases_break():
    for spread, slips, period in ((0.09, 1, 17.480), (0.07, 2, 34.709), (0.056, 4, 69.184), (0.053, 8, 138.169)):
        s = run(two_blocks(spread)[0] + " -ts_max_time 6000 -ts_rtol 1e-8 -ts_atol 1e-8 -out_file d.h5 -out_frames 2 -lyapunov_count 2")
        value, _ = exponents(s)
        check(abs(value[0]) < 1e-3 and value[1] < -3e-3, f"a stable cycle at {spread}: {value}")
        m = moments_of("d.h5", 5000)
        repeats = [k for k in range(1, 17) if np.all(np.abs(m[k:] - m[:-k]) < 1e-4 * m.max())]
        with h5py.File("d.h5") as file:
            begin = file["events/begin"][:]
        check(repeats[0] == slips and abs(begin[-1] - begin[-1 - slips] - period) < 2e-3, f"{repeats} {begin[-1] - begin[-1 - slips]}")
    flip = exponents(run(two_blocks(0.0583)[0] + " -ts_max_time 6000 -ts_rtol 1e-8 -ts_atol 1e-8 -lyapunov_count 2"))[0]
    check(abs(flip[1]) < 1e-3, f"at the doubling the second exponent passes 0 too: {flip}")

    longest = []
    for spread in (0.2105, 0.2116, 0.214):
        run(two_blocks(spread)[0] + " -ts_max_time 8000 -out_file i.h5 -out_frames 2 -lyapunov_count 0")
        m = moments_of("i.h5", 2000)
        ends = np.flatnonzero(np.r_[True, np.abs(np.diff(m)) > 0.02 * m.max(), True])
        longest.append(np.diff(ends).max() - 1)
    check(longest[0] > 200 and 300 > longest[1] > 1.2 * longest[2] > 6, f"laminar phases of the slips: {longest}")


def test_a_run_is_not_changed_by_it():
    scene = "-model_form chain -grid_n 6 -bc_left free -friction_law coulomb -friction_spread 0.3 -init_psi 0 -ts_max_time 63 " \
            "-scene_reduce off"
    without, beside = run(scene), run(scene + " -lyapunov_count 3")
    keys = ("steps", "rejections", "t_end", "psi_min", "psi_max", "psi_mean", "eta_mean")
    check(all(without[k] == beside[k] for k in keys), f"the same run: {[(without[k], beside[k]) for k in keys]}")
    check(without["lyapunov"] is None and without["lyapunov_dimension"] is None, "nothing measured")


STIFF = "-model_form chain -bc_left free -friction_law rate-and-state -friction_a 0.02 -friction_b 0.03 -friction_D 0.01 -model_k0 0.5 " \
        "-model_m 1e-2 -model_v 0.01 -friction_psi0 1e-2 -init_psi 0.012 -init_eta steady -init_state steady "


def test_stiff_friction():
    # one block: a zero and a negative one; the third direction is damped at once, at rates of 1e5 and more
    s = run(f"{STIFF} -grid_n 1 -ts_max_time 500 -ts_rtol 1e-8 -ts_atol 1e-10 -lyapunov_count 2")
    value, error = exponents(s)
    check(s["regime"] == "stick-slip" and abs(value[0]) < error[0] and value[1] < -error[1] and s["lyapunov_dimension"] == 1,
          f"a stable oscillation: {value} {error}")
    refused(f"{STIFF} -grid_n 1 -init_psi 0.1 -init_eta 0.1 -ts_max_time 10 -lyapunov_count 3", 1, "lyapunov_count 3", "ask for fewer exponents")


def test_psi_without_its_digits_is_told():
    """A block that creeps at 2e-11 between slips: its exponents need psi to a part of itself."""
    block = scene_file("published/erickson-block") + " -friction_b 5 -ts_max_time 300 -lyapunov_count 1 -ts_rtol 1e-7"
    told = [text for text in run(block)["warnings"] if "slope of friction" in text]
    assert len(told) == 1 and "ts_atol" in told[0], told
    s = run(block + " -ts_atol 1e-20")
    assert not any("slope of friction" in text for text in s["warnings"]), s["warnings"]


def test_restart_goes_on_alike_in_stiff_friction():
    whole = run(f"{STIFF} -grid_n 2 -friction_spread 0.1 -ts_max_time 40 -lyapunov_count 3 -out_file w.h5 -out_frames 3 -out_checkpoint_every 300")
    names = sorted(f for f in os.listdir(".") if f.startswith("w.chk"))
    again = run(f"-restart {names[0]} -out_file again.h5")
    check(again["lyapunov"] == whole["lyapunov"], f"{again['lyapunov']} {whole['lyapunov']}")


def test_restart_goes_on_alike():
    scene = "-model_form chain -grid_n 4 -bc_left free -friction_law coulomb -state_law healing -friction_spread 0.3 -init_psi 0 " \
            "-ts_max_time 80 -lyapunov_count 5 -out_frames 3"
    whole = run(scene + " -out_file w.h5 -out_checkpoint_every 9 -out_checkpoint_keep 100")
    names = sorted(f for f in os.listdir(".") if f.startswith("w.chk"))
    check(len(names) > 3, f"checkpoints: {names}")
    for name in names[:: max(1, len(names) // 3)][:3]:
        again = run(f"-restart {name} -out_file again.h5 -out_checkpoint_every 9")
        check(again["lyapunov"] == whole["lyapunov"], f"{name}: {again['lyapunov']} {whole['lyapunov']}")


@pytest.mark.ranks
def test_the_same_on_any_number_of_ranks():
    for scene in ("-grid_n 7 -grid_length 7 -init_noise 0.5 -ts_max_time 2 -ts_dt 0.05",
                  "-model_form chain -grid_n 5 -bc_left free -model_k0 1 -model_v 1 -friction_law coulomb -friction_spread 0.3 "
                  "-init_psi 0 -ts_max_time 8 -ts_dt 0.2"):
        scene += " -ts_type rk -ts_rk_type 4 -lyapunov_count 4"
        one, two = run(scene), run(scene, ranks=2)
        check(np.allclose(exponents(one)[0], exponents(two)[0], rtol=0, atol=1e-9), f"{exponents(one)} {exponents(two)}")
    one, two = (run(f"{STIFF} -grid_n 3 -friction_spread 0.1 -ts_max_time 3 -lyapunov_count 4", ranks=ranks) for ranks in (1, 2))
    check(np.allclose(exponents(one)[0], exponents(two)[0], rtol=1e-6, atol=1e-6), f"{exponents(one)} {exponents(two)}")


def test_what_is_refused():
    for wrong, said in (("-grid_n 5 -grid_length 5 -lyapunov_count 11", "10 unknowns"), ("-grid_n 5 -grid_length 5 -lyapunov_count -1", "lyapunov_count"),
                        ("-grid_n 5 -grid_length 5 -lyapunov_count 2 -lyapunov_from 60", "lyapunov_from 60")):
        refused(wrong, 2, said)
    s = run("-grid_n 5 -grid_length 5 -lyapunov_count 2 -ts_max_steps 5")
    check(s["lyapunov"] is None and "nothing was measured" in s["warnings"][0], f"stopped too soon: {s['warnings']}")
