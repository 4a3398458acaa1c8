"""The command cycle against SciPy: periods, multipliers, waves, cells, branches; files, refusals."""
import os

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from calls import call, check, data, refused, run, scene_file, tool
from reference import System, bloch, multipliers, near, options, read
from settling import compare
from settling import scene as settling_scene

ROUND = {"rtol": 3e-13, "atol": 1e-13}
TIGHT = ROUND | {"method": "DOP853"}
CHAIN = "-model_form chain -model_m 1 -model_k0 0.2 -model_f0 1 "


CASES = {"cubic": "-model_v 0.3",
         "smoothed": "-friction_law carlson-langer -friction_stick regularised -friction_eps 0.05 -model_zeta paper -model_v 1.2",
         "pair": "-cycle_cell 2 -grid_n 8 -init_noise 0.5 -model_k1 0.02",
         "viscous pair": "-cycle_cell 2 -grid_n 8 -init_noise 0.5 -model_k1 0.02 -model_nu 0.002"}


@pytest.mark.parametrize("case", CASES)
def test_a_cycle_is_what_scipy_integrates(tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    scene = CHAIN + CASES[case]
    found, _ = run(scene + " -cycle_spectrum -out_file c.h5", command="cycle")
    file, period, n = data("c.h5"), found["period"], 2 if "pair" in case else 1
    start, system = read(file, 0), System(options(scene) | {"grid_n": n})
    course = solve_ivp(system.rates, (0, period), start, dense_output=True, **TIGHT)
    # DOP853 errs by some 100 rtol over a period; the profile is known to 1e-9 of its range
    assert np.abs(course.y[:, -1] - start).max() < 1e-8
    t = np.linspace(0, period, 4001)
    psi, eta = np.split(course.sol(t), 2)
    assert abs(psi.max() - found["psi_max"]) < 1e-5 and abs(psi.min() - found["psi_min"]) < 1e-5
    assert abs(np.ptp(eta.mean(axis=0)) - found["force_drop"]) < 1e-5
    assert abs(np.ptp(psi, axis=1).max() / 2 - found["amplitude"]) < 1e-5
    k, mu = file["spectrum/wavenumber"], file["spectrum/multiplier_re"] + 1j * file["spectrum/multiplier_im"]
    small = 0.02
    _, matrices = system.carried(start, period, [bloch(n, n * x) for x in (0, k[20], k[150], small)], **ROUND)
    cell, *waves, slow = np.linalg.eigvals(matrices)
    near(multipliers(found), cell, 1e-6)
    assert found["error_estimate"] < 1e-10 and found["stable_alike"]
    growth = file["spectrum/growth_rate"]
    for j, known in zip((20, 150), waves):
        near(mu[j], known, 1e-6)
        assert abs(np.log(np.abs(known).max()) / period - growth[j]) < 1e-6
    assert found["stable"] == (growth.max() < 0) and found["decided"]
    # the phase diffusion from a long wave
    phase = slow[np.abs(slow - 1).argmin()]
    assert abs(-np.log(abs(phase)) / period / small**2 / found["diffusion"] - 1) < 0.02


def test_with_a_state(tmp_path, monkeypatch):
    """Rate-and-state with ageing, one block: psi stays positive, theta advances as its logarithm."""
    monkeypatch.chdir(tmp_path)
    scene = "-model_form chain -model_k0 0.005 -model_k1 0 -model_v 1 -friction_law rate-and-state -friction_D 1"
    found, _ = run(scene + " -out_file c.h5", command="cycle")
    start = read(data("c.h5"), 0)
    end = System(scene + " -grid_n 1").follow(start, 0, found["period"], method="Radau", rtol=1e-10, atol=1e-12)
    assert np.abs(end - start).max() < 1e-6 * (1 + found["psi_max"])
    assert found["psi_min"] > 0 and found["stable"] and len(found["multipliers"]) == 3


def test_a_branch_round_its_fold(tmp_path, monkeypatch):
    """Beyond the fold the cycle repels; SciPy finds the same one, as a fixed point of its return map on psi = v."""
    monkeypatch.chdir(tmp_path)
    scene = CHAIN + CASES["smoothed"]
    found, _ = run(scene + " -cycle_continue model_v -cycle_to 3 -out_file c.h5", command="cycle")
    kinds = [special["kind"] for special in found["special"]]
    assert kinds == ["fold", "hopf"]
    points = found["branch"]["points"]
    fold = found["special"][0]
    beyond = [p for p in points[fold["after"] + 1:] if p["amplitude"] > 0.5]
    beyond = beyond[len(beyond) // 2]
    assert not beyond["stable"] and all(p["stable"] for p in points[:fold["after"]])
    assert max(p["value"] for p in points) <= fold["value"] + 1e-9
    v = beyond["value"]
    system = System(options(scene) | {"grid_n": 1, "model_v": v})

    def falls(t, y):
        return y[0] - v

    def rises(t, y):
        return y[0] - v
    falls.direction, falls.terminal, rises.direction, rises.terminal = -1, True, 1, True

    def lap(eta):
        t, y = 0, [v, eta]
        for event in (falls, rises):
            course = solve_ivp(system.rates, (t, t + 60), y, events=event, method="DOP853", rtol=1e-11, atol=1e-11)
            t, y = course.t_events[0][0], course.y_events[0][0]
        return t, y[1]
    etas = system.steady[1] + np.linspace(0.1, 1.2, 10)
    gain = [lap(eta)[1] - eta for eta in etas]
    k = next(k for k in range(9) if gain[k] < 0 < gain[k + 1])
    unstable = brentq(lambda eta: lap(eta)[1] - eta, etas[k], etas[k + 1], xtol=1e-9)
    assert abs(lap(unstable)[0] - beyond["period"]) < 1e-6


def test_exact_stick_up_to_grazing():
    found, _ = run(CHAIN + "-friction_law carlson-langer -model_zeta paper -model_v 1 -cycle_continue model_v -cycle_to 3",
                   command="cycle")
    assert [special["kind"] for special in found["special"]] == ["graze"]
    assert abs(found["special"][0]["value"] - 2.4047128309) < 1e-8  # by an independent integration
    rest = [point["rest_fraction"] for point in found["branch"]["points"]]
    assert all(before > after for before, after in zip(rest, rest[1:])) and rest[-1] < 1e-3


def test_exact_stick_from_the_least_value_of_an_option():
    branch, _ = run(scene_file("cycle-stick-pair") + " -cycle_spectrum false -friction_sigma 0 -cycle_continue friction_sigma "
                    "-cycle_to 0.05", command="cycle")
    alone, _ = run(scene_file("cycle-stick-pair") + " -cycle_spectrum false -friction_sigma 0.05", command="cycle")
    first, last = branch["branch"]["points"][0], branch["branch"]["points"][-1]
    assert (first["value"], last["value"]) == (0, 0.05) and abs(last["period"] / alone["period"] - 1) < 1e-9


def test_waves_on_a_cell_that_sticks(tmp_path, monkeypatch):
    """Of two blocks, twisted by 0, a quarter and half a turn: the multipliers of the ring of four such cells."""
    monkeypatch.chdir(tmp_path)
    cell, _ = run(scene_file("cycle-stick-pair") + " -cycle_wavenumbers 2 -out_file c.h5", command="cycle")
    with h5py.File("c.h5") as file:
        psi, eta = np.tile(file["psi"][0], 4), np.tile(file["eta"][0], 4)
        quarter, half = file["spectrum/multiplier_re"][...] + 1j * file["spectrum/multiplier_im"][...]
    np.savetxt("ring.txt", np.column_stack([np.arange(8), psi, eta]), fmt="%.17g")
    ring, _ = run(scene_file("cycle-stick-pair") + " -cycle_cell 0 -cycle_spectrum false -init_type text -init_file ring.txt "
                  "-init_noise 0", command="cycle")
    for name in ("period", "psi_max", "amplitude", "force_drop", "rest_fraction"):  # extrema between and at the ends of steps
        assert abs(ring[name] - cell[name]) < 1e-12 * cell["period"], name
    near(multipliers(ring), np.concatenate([multipliers(cell), quarter, quarter.conj(), half]), 1e-8)
    assert cell["stable"] and np.ptp(psi) > 0.5 and 0 < cell["rest_fraction"] < 1


def test_whole_scene_with_held_end_and_spread():
    found, _ = run("-model_form chain -grid_n 10 -cycle_cell 0 -bc_left velocity -bc_left_value 0.5 -model_k1 1",
                   command="cycle")
    assert found["unknowns"] == 18 and found["stable"] and found["multiplier_error"] < 1e-6
    found, _ = run("-model_form chain -grid_n 6 -cycle_cell 0 -friction_spread 0.3", command="cycle")
    assert found["unknowns"] == 12 and found["error_estimate"] < 1e-10


def test_rests_beside_a_held_end():
    # a run that has settled is the same a period later, at the nodes that are not held; with viscosity between neighbours
    words = ("-model_form chain -grid_n 6 -bc_left velocity -bc_right free -model_nu 0.2 -model_zeta 0.3 -bc_left_value 0 "
             "-friction_law carlson-langer ")
    found, _ = run(words + "-cycle_cell 0 -out_file c.h5", command="cycle")
    T = found["period"]
    assert found["unknowns"] == 10 and found["stable"] and 0.1 < found["rest_fraction"] < 0.9
    cycle = data("c.h5")
    assert cycle["psi"].shape[1] == 5 and set(cycle["rest_x"]) <= set(range(1, 6))
    run(words + f"-ts_max_time {1000 + T} -ts_rtol 1e-9 -ts_atol 1e-10 -out_times 1000,{1000 + T / 3},{1000 + T} -out_file r.h5")
    psi = data("r.h5")["psi"][:, 1:]
    assert np.abs(psi[-1] - psi[0]).max() < 1e-6 < np.abs(psi[1] - psi[0]).max()
    assert psi.max() < found["psi_max"] + 1e-6 and psi.min() > found["psi_min"] - 1e-6


REFUSED = [("-model_v 1.2", 1, "no cycle: nothing oscillates"),
           ("-model_v 1.5 -state_law contact-age", 1, "; a slip that begins 1, 0.1, 0.01, 4 friction forces above it ends so: "),
           ("-model_v 1.5 -state_law contact-age", 1, "no cycle: the motion from the start settles on steady sliding; nothing oscillates"),
           ("-cycle_cell 0", 2, "at most 300 are solved for"),
           ("-cycle_cell 4 -bc_left free", 2, "repeat on a ring only"),
           ("-friction_spread 0.1", 2, "no cell repeats"),
           ("-cycle_continue model_v", 2, "belong together"),
           ("-cycle_continue model_w -cycle_to 1", 2, "no such option; did you mean model_c?"),
           ("-cycle_cell 0 -grid_n 6 -cycle_spectrum", 2, "no neighbours"),
           ("-model_form chain -model_k0 0", 2, "nothing drives a cycle"),
           ("-cycle_cell 3 -model_v 1.2 -init_noise 0.1", 1, "settles on steady sliding"),
           ("-model_form chain -grid_n 4 -cycle_cell 0 -bc_left velocity -bc_left_value -0.01 -bc_right free -friction_law coulomb -model_v -0.01 "
            "-friction_back_slip false -init_psi 0 -init_eta 0", 1, "rests without a slip"),
           ("-model_form chain -grid_n 20 -cycle_cell 0 -friction_spread 0.1", 1, "never repeats")]


@pytest.mark.parametrize("words, code, part", REFUSED, ids=[f"{words} {part[:9]}" for words, _, part in REFUSED])
def test_what_is_no_cycle(tmp_path, monkeypatch, words, code, part):
    monkeypatch.chdir(tmp_path)
    done = call(words + " -out_file c.h5", command="cycle")
    assert done.returncode == code, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and part in done.stderr, done.stderr
    assert not os.path.exists("c.h5")


def test_file_opens_and_is_drawn(tmp_path, monkeypatch):
    xarray = pytest.importorskip("xarray")
    monkeypatch.chdir(tmp_path)
    run("-cycle_spectrum -cycle_wavenumbers 20 -cycle_continue model_v -cycle_to 0.3 -cycle_steps 4 -out_file c.h5",
        command="cycle")
    with xarray.open_dataset("c.h5", engine="h5netcdf") as data:
        assert data.psi.dims == ("t", "x") and float(data.t[-1]) == data.attrs["period"]
        assert (data.psi[0] == data.psi[-1]).all()
    assert tool("plot.py", "c.h5").returncode == 0 and os.path.getsize("c.png") > 10000


@pytest.mark.ranks
def test_same_on_two_ranks(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = "-model_form chain -cycle_cell 2 -init_noise 0.3 -grid_n 8"
    one, _ = run(words, command="cycle")
    two, _ = run(words, command="cycle", ranks=2)
    assert one["period"] == two["period"] and one["multipliers"] == two["multipliers"] and two["ranks"] == 2


def test_a_branch_that_breaks_off_has_not_folded():
    """Where the sequence of starts and stops changes, the last steps turn by what Newton's method leaves; no multiplier
    is near 1 there."""
    found, _ = run("-model_form chain -cycle_cell 0 -grid_n 2 -bc_left free -bc_right free -model_m 0.684374322163822 "
                   "-model_k0 0.2450364012509286 -model_k1 0.19687347909875047 -model_f0 1.1657508011907998 "
                   "-model_zeta 0.020405076295837384 -model_v 0.5624774607597093 -init_noise 0.5 -init_seed 432 "
                   "-init_psi 0.41232758508376877 -friction_law carlson-langer -state_law contact-age "
                   "-friction_sigma 0.26851357135874404 -friction_alpha 1.4408508027410292 "
                   "-state_b 0.07301287653005148 -state_theta0 1.4944385977579073 -state_D 1.7523375798809175 "
                   "-friction_amplitude_profile 0:1.111111137105493,1:0.6221174920690298 "
                   "-cycle_continue state_b -cycle_to 0.10951931479507722 -cycle_steps 30", command="cycle")
    branch = found["branch"]
    ends = [(point["kind"], point["value"]) for point in found["special"]]
    assert ends == [("graze", branch["points"][-1]["value"])] and "the sequence" in str(branch), branch


LUGRE_PAIR = ("-model_form chain -grid_n 2 -model_m 0.954145 -model_f0 1.039132 -model_k1 1.278207 -bc_left free "
              "-model_k0_profile 0.0:0.16315,1.0:0.14504 -model_zeta_profile 0.0:0.05387,1.0:0.08221 -friction_law lugre "
              "-friction_fc 0.78345 -friction_fs 0.97478 -friction_vs 0.0803 -friction_sigma0 12.72595 -friction_sigma1 0.45753 "
              "-model_drag 0.13522 -model_v 0.185447 -cycle_cell 0 -init_psi 0.05563 -init_eta 0.3 -init_noise 0.01854 "
              "-cycle_continue friction_vs ")


def test_turns_of_a_branch_whose_cycles_pass_corners():
    """psi passes 0, where |psi| turns a corner, and the branch turns: to ten digits where it does in steps of other lengths."""
    found, _ = run(LUGRE_PAIR + "-cycle_to 0.0796 -cycle_steps 12", command="cycle")
    [fold] = found["special"]
    assert fold["kind"] == "fold" and abs(fold["value"] - 0.07970905914) < 1e-8 * (0.0803 - 0.0796), fold
    stable = [p["stable"] for p in found["branch"]["points"]]
    assert all(stable[:fold["after"] + 1]) and not any(stable[fold["after"] + 1:])


def test_special_points_where_friction_passes_from_piece_to_piece():
    """Nodes of the mesh stand where psi passes a velocity of a table: without them a flip hung on the lengths of the steps,
    by 1.7e-7 of the range between these two walks."""
    table = "0:0,0.2962:1.0282,0.5471:0.7545,1.0639:0.5602,1.5485:0.6758"
    walks = [run(f"-model_form chain -grid_n 2 -model_m 2 -model_k0 0.3666 -model_f0 0.6083 -model_k1 0.1905 -model_zeta 0.0907 "
                 f"-model_v 0.3433 -bc_left free -friction_law table -friction_table {table} -friction_table_beyond constant "
                 "-load_sine_amplitude 0.0742 -load_sine_period 8.67 -cycle_cell 0 -init_psi 0.5155 -init_noise 0.1 -init_seed 251 "
                 f"-cycle_continue model_k0 -cycle_to 1.407 -cycle_steps {steps}", command="cycle")[0]["special"] for steps in (40, 27)]
    for kind in ("fold", "flip"):
        one, other = ([s["value"] for s in walk if s["kind"] == kind][0] for walk in walks)
        assert abs(one - other) < 1e-8 * (1.407 - 0.3666), (kind, one, other)


def test_a_branch_of_doubled_period_ends_where_it_was_born():
    """At the flip of the cycle of half the period, on whose branch the equations of the doubled one are singular."""
    scene = ("-model_form chain -grid_n 1 -model_v 0.2288 -model_m 1.5754 -model_k0 0.4172 -model_zeta 0.1016 -friction_law lugre "
             "-friction_fc 0.5314 -friction_fs 1.0227 -friction_vs 0.2587 -friction_sigma0 8.2086 -friction_sigma1 0.221 "
             "-cycle_cell 0 -init_psi 0.59 -cycle_continue model_f0 ")
    doubled, _ = run(scene + "-model_f0 0.6447 -cycle_to 0.165 -cycle_steps 40", command="cycle")
    single, _ = run(scene + "-model_f0 0.615 -cycle_to 0.63", command="cycle")
    [halves], [flip] = ([s for s in found["special"] if s["kind"] == kind] for found, kind in ((doubled, "halves"), (single, "flip")))
    assert abs(halves["value"] - flip["value"]) < 1e-8 * 0.48, (halves, flip)
    assert abs(halves["period"] / flip["period"] - 2) < 1e-7
    assert "two halves" in doubled["branch"]["end"], doubled["branch"]["end"]


def test_a_small_forced_motion_is_no_long_branch():
    """Steps are measured in the size of a slip, not in that of the first motion: under a load a hundred times as large."""
    found, _ = run("-model_form chain -grid_n 1 -bc_left free -model_v 1.2 -load_sine_amplitude 1e-3 -load_sine_period 5 "
                   "-cycle_cell 0 -cycle_continue load_sine_amplitude -cycle_to 0.1 -cycle_steps 200", command="cycle")
    assert len(found["branch"]["points"]) < 60 and "reached" in found["branch"]["end"], len(found["branch"]["points"])


def test_cells_of_stiff_friction():
    """Blocks that creep between their slips, which explicit steps could not follow: two that move alike have the period of
    one, whose cycle is found by another method; where explicit steps still can, the same cycle in other steps."""
    scene = ("-model_form chain -model_m 1 -model_f0 1 -model_k0 0.3 -friction_law rate-and-state -friction_a 0.05 -friction_b 0.1 "
             "-friction_D 0.1 ")
    for v in (0.1, 0.05):
        one, _ = run(f"{scene} -model_v {v} -grid_n 1", command="cycle")
        two, _ = run(f"{scene} -model_v {v} -model_k1 0.1 -grid_n 2 -cycle_cell 2", command="cycle")
        for key in ("period", "psi_min", "psi_max", "force_drop"):
            assert abs(two[key] / one[key] - 1) < 1e-9, (v, key, two[key], one[key])
        assert two["stable"] is False  # out of step they part


def test_cycles_of_unlike_blocks(scenes):
    """A few of tests/audit/test_settling.py."""
    assert sum(compare(p, f"scene {index}", multipliers=False) for index, p in scenes(settling_scene, 661, short=3)) > 0


PAIR = "RUNS/two-blocks.yaml -cycle_cell 0 -lyapunov_count 0 -friction_stick regularised -friction_eps 0.01 "


@pytest.mark.parametrize("spread, period, multiplier", [(0.085, 14.19364, -0.9912), (0.095, 53.765, -0.156),
                                                        (0.1, 76.543, -0.173)])
def test_a_cycle_of_many_slips_or_beside_a_doubling(spread, period, multiplier):
    """The period is the shortest and the multiplier of the doubling is negative; where collocation on the first mesh fails
    a finer one is taken, and what repeats is not called chaos. Values by shooting, as many digits as are given."""
    found, _ = run(PAIR.replace("RUNS/two-blocks.yaml", scene_file("two-blocks")) + f"-friction_spread {spread}", command="cycle")
    others = sorted((abs(m["re"] + 1j * m["im"]), m["re"]) for m in found["multipliers"] if abs(m["re"] - 1) > 1e-6)
    assert abs(found["period"] - period) < 1e-3 and abs(others[-1][1] - multiplier) < 1e-3, found


def test_stiff_friction_takes_the_steps_of_a_run():
    """A law that holds for psi > 0 alone, stages of which led beyond in explicit steps; and creep between slips that they took
    minutes for. The periods are those of a long run."""
    block = "-model_form chain -grid_n 1 -model_f0 1.0 -friction_law dieterich -friction_mu0 0.6 -friction_psi0 1 -cycle_cell 0 "
    for words in ("-model_v 0.05 -model_k0 0.05 -friction_a 0.05 -friction_b 0.1 -friction_D 0.5",
                  "-model_v 0.02 -model_k0 0.2 -friction_a 0.04 -friction_b 0.1 -friction_D 0.2"):
        found, _ = run(block + words, command="cycle")
        T = found["period"]
        ran, _ = run(f"{block.replace('-cycle_cell 0 ', '')} {words} -ts_max_time {60 * T} -ts_rtol 1e-8")
        assert abs(ran["period"] / T - 1) < 1e-4 and found["stable"], (words, T, ran["period"])


def test_a_start_on_unstable_sliding_is_pushed_off():
    for words in ("", "-friction_law carlson-langer -friction_alpha 0.5 -friction_sigma 0 -model_zeta 0.05"):
        found, _ = run(f"-model_form chain -grid_n 2 -bc_left free -model_v 0.4 -init_psi 0.4 -init_eta steady -init_noise 0 {words} "
                       "-cycle_cell 0", command="cycle")
        assert found["psi_max"] > 1 and found["psi_min"] < 1e-12 and found["stable"], words


def test_a_cycle_without_linear_deviations_is_answered():
    """Several nodes begin to slip at once, which motions beside it do one by one: a period, and no multipliers."""
    pair = ("-model_form chain -grid_n 2 -bc_left free -model_m 2 -model_k0 1.2 -model_f0 .5 -model_k1 .6 -model_nu .2 -model_zeta 0 "
            "-friction_law carlson-langer -friction_alpha .27 -friction_sigma .2 -model_v .75 -init_psi .7 -init_eta .7 ")
    found, _ = run(pair + "-cycle_cell 0", command="cycle")
    ran, _ = run(pair + "-ts_max_time 300")
    assert abs(found["period"] / ran["period"] - 1) < 1e-6 and found["residual"] < 1e-9
    assert [found[name] for name in ("multipliers", "multiplier_error", "stable", "stable_alike", "growth_rate")] == [None] * 5
    refused(pair + "-cycle_cell 0 -cycle_continue model_v -cycle_to 0.8", 1, "deviations that add up", "several nodes begin to slip at once", command="cycle")


def test_slow_decay_is_no_chaos():
    """Sliding loses a thousandth in a unit of time: it is not reached within the 400 turns."""
    refused("-model_form chain -grid_n 4 -bc_left free -model_k0 0.21717 -model_f0 0.52983 -model_k1 1.04231 "
            "-model_m 1.86825 -model_zeta_profile 0.0:0.03195,1.0:0.0106,2.0:0.08563,3.0:0.06504 -model_v 0.14965 "
            "-friction_law slip-weakening -friction_fs 1 -friction_fd 0.866 -friction_Dc 0.235 -friction_stick "
            "regularised -friction_eps 0.05 -init_psi 0.7457 -init_noise 0.3 -init_seed 416 -cycle_cell 0",
            1, "settles on steady sliding", command="cycle")


def test_a_plate_so_slow_that_a_block_creeps_for_thousands_of_turns():
    """It loads the block all the while, and neither rests nor slides: the period is that of a run (docs/oscillations.md)."""
    found, _ = run("-model_form chain -grid_n 1 -bc_left free -model_m 1 -model_f0 1 -model_k0 0.3 -friction_law rate-and-state -friction_a 0.05 "
                   "-friction_b 0.1 -friction_D 0.1 -state_law ageing -cycle_cell 0 -model_v 1e-5", command="cycle")
    assert abs(found["period"] / 486593 - 1) < 1e-5 and found["stable"]


def test_neighbours_that_feel_each_other_by_viscosity():
    """Phases that part are drawn together in proportion to the viscosity, however weak and however strong: what sliding blocks lose
    of kappa^2 psi to it has the same part along the phase at each. Beside springs too, whose own part is subtracted."""
    def diffusion(k1, nu):
        found, _ = run(f"-model_form chain -grid_n 1 -model_k0 1 -model_v 0.6 -model_k1 {k1} -model_nu {nu} -cycle_spectrum "
                       "-cycle_wavenumbers 8", command="cycle")
        check(found["warnings"] == [], found["warnings"])
        check((found["stable"], found["decided"]) == (nu > 0, True), f"k1 {k1}, nu {nu}: {found['growth_rate']}")
        return found["diffusion"]
    one, springs = diffusion(0, 1e-6), diffusion(0.01, 0)
    for nu in (2e-6, 1e-3, 10):
        check(abs(diffusion(0, nu) / one - nu / 1e-6) < 1e-5 * nu / 1e-6, f"nu {nu}")
    check(abs(diffusion(0.01, 10) - springs - 1e7 * one) < 1e-5 * 1e7 * one, "beside springs")
