"""boundary_of: where stick-slip ends, against an integration of its own, runs, closed forms, and what may go wrong."""
import os

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from calls import call, check, run, scene_file, tool
from reference import System

BLOCK = "-model_form chain -model_k0 0.2 -model_k1 0.2 -model_zeta paper -friction_law carlson-langer -grid_n 16 "
SMOOTHED = BLOCK + "-friction_stick regularised -friction_eps 0.05 "
IN_V = "-boundary_parameter model_v -boundary_from 0.1 -boundary_to 5 "


def least_velocity(v, zeta="paper"):
    """The least psi of the slip that begins at psi = 0, eta = 1, where it turns for the first time."""
    block = System(BLOCK + f"-grid_n 1 -model_v {v} -model_zeta {zeta}")
    block.going = np.ones(1)

    def turn(t, y):
        return block.rates(t, y)[0]
    turn.direction, turn.terminal = 1, True
    found = solve_ivp(block.rates, (0, 60), [1e-12, 1.], events=turn, method="DOP853", rtol=1e-12, atol=1e-13)
    return found.y_events[0][0][0]


def test_the_block_of_carlson_and_langer():
    found, _ = run(BLOCK + IN_V, command="boundary")
    alone, _ = run(BLOCK + IN_V + "-boundary_of sliding", command="boundary")
    check(found["points"][:1] == alone["points"], "the points of sliding come first, unchanged")
    sliding, end = found["points"]
    check((sliding["of"], sliding["kind"], end["of"], end["kind"]) == ("sliding", "hopf", "stick-slip", "graze"), found["points"])
    check(abs(sliding["value"] - (0.02 ** -0.25 - 1)) < 1e-12, "the closed form")
    check(abs(end["value"] - brentq(least_velocity, 2.39, 3, xtol=1e-12)) < 1e-9, f"{end['value']}: where a slip only grazes rest")
    only, _ = run(BLOCK + IN_V + "-boundary_of stick-slip", command="boundary")
    check(only["points"] == [{**end, "piece": 0}], "asked for alone")


def test_runs_on_both_sides_of_both_lines():
    found, _ = run(BLOCK + IN_V + "-boundary_verify 1", command="boundary")
    said = [(v["of"], v["regime"]) for v in found["verified"]]
    check(said == [("sliding", "stick-slip"), ("sliding", "bistable"), ("stick-slip", "bistable"), ("stick-slip", "sliding")],
          found["verified"])
    check(found["warnings"] == [], found["warnings"])


def test_friction_that_does_not_weaken():
    # Coulomb's block with viscosity slides stably at every velocity, and yet sticks and slips below this one
    words = BLOCK.replace("carlson-langer", "coulomb") + IN_V
    found, _ = run(words, command="boundary")
    point, = found["points"]
    k0, zeta, D = 0.2, np.sqrt(0.02), 0.5
    a, w = zeta / 2, np.sqrt(k0 - zeta ** 2 / 4)

    def least(v):  # of the closed form
        times = np.linspace(np.pi / w, 2 * np.pi / w, 200001)
        psi = v - np.exp(-a * times) * (v * np.cos(w * times) + (a * v - D) / w * np.sin(w * times))
        return psi.min()
    check(abs(point["value"] - brentq(least, 0.2, 2, xtol=1e-13)) < 1e-8, f"{point['value']}")
    _, error = run(words + "-boundary_of sliding", code=1, command="boundary")
    check("sliding is stable throughout" in error or "no boundary" in error or "does not enter" in error, error)


def test_a_state_ends_it_by_a_fold():
    # healing: the cycle meets an unstable one before its slip grazes rest; other ranges, another way there
    words = BLOCK + "-state_law healing -boundary_of stick-slip -boundary_parameter model_v "
    values = []
    for low, high in ((0.1, 8), (3, 4.4)):
        found, _ = run(words + f"-boundary_from {low} -boundary_to {high}", command="boundary")
        point, = found["points"]
        check(point["kind"] == "fold", point)
        values.append(point["value"])
    check(abs(values[1] - values[0]) < 5e-8, f"the same place to 1e-8 of the longer range: {values}")
    # the branch of the cycle goes round the same fold, and on to where the slip of the cycle that repels grazes rest
    branch = run(BLOCK + "-state_law healing -model_v 3 -cycle_continue model_v -cycle_to 4.4", command="cycle")[0]
    fold, graze = branch["special"]
    check((fold["kind"], graze["kind"]) == ("fold", "graze") and graze["value"] < fold["value"], branch["special"])
    check(abs(fold["value"] - values[1]) < 3e-8, f"fold of the branch at {fold['value']}, not {values[1]}")
    one = BLOCK + "-grid_n 1 -bc_left free -state_law healing -init_psi 0 -init_eta 0 -ts_max_time 800 "
    for v, regime in ((values[0] - 0.02, "stick-slip"), (values[0] + 0.05, "sliding")):
        check(run(one + f"-model_v {v}")[0]["regime"] == regime, f"a run beside it: {v}")


def test_a_diagram_of_two_options():
    words = scene_file("figure6-carlson-langer") + " -boundary_points 16 -out_file d.h5"
    found, _ = run(words, command="boundary")
    ends = [p for p in found["points"] if p["of"] == "stick-slip"]
    check(14 <= len(ends) <= 18 and all(p["kind"] == "graze" for p in ends), f"{len(ends)} points")
    check(len({p["piece"] for p in ends} & {p["piece"] for p in found["points"] if p["of"] == "sliding"}) == 0, "pieces")
    for p in ends[1:-1:5]:
        least = least_velocity(p["value2"], zeta=np.sqrt(0.1 * p["value"]))
        check(abs(least) < 1e-8 * (1 + p["value2"]), f"at k1 {p['value']}: {least}")
    with h5py.File("d.h5") as file:
        check([text.decode() for text in file["of"][...]] == [p["of"] for p in found["points"]], "whose end, in the file")
        lives = file["stick_slip_distance"][...] < 0
        v, k1 = np.meshgrid(file["stick_slip_sample2"][...], file["stick_slip_sample"][...], indexing="ij")
        check(np.all(lives[v < ((0.1 * k1) ** -0.25 - 1)]), "wherever sliding is unstable")
    check(tool("plot.py", "d.h5").returncode == 0 and os.path.getsize("d.png") > 20000, "drawn")


@pytest.mark.parametrize("words, said", [
    (BLOCK + "-friction_spread 0.1", "friction_spread"),
    (BLOCK + "-bc_left velocity", "held end"),
    (BLOCK + "-model_k0 0", "nothing loads")])
def test_refused(words, said):
    done = call(words + " " + IN_V + "-boundary_of stick-slip", command="boundary")
    check(done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1, done.stderr)


def test_no_end_in_the_range():
    _, error = run(BLOCK + "-boundary_of stick-slip -boundary_parameter model_v -boundary_from 0.1 -boundary_to 1", code=1,
                   command="boundary")
    check("can stick and slip at every model_v from 0.1 to 1: stick-slip does not end in this range" in error, error)
    _, error = run(BLOCK + "-friction_spread 0.1 -grid_n 3 -boundary_parameter model_v -boundary_from 0.1 -boundary_to 0.2", code=1,
                   command="boundary")
    check("stick-slip is left out, as friction_spread" in error and "-cycle_cell" in error, error)
    _, error = run(IN_V + "-boundary_of stick-slip", code=1, command="boundary")  # the cubic's ends at its Hopf point
    check("does not end" in error and "Hopf" in error, error)


@pytest.mark.ranks
def test_any_number_of_ranks():
    words = BLOCK + IN_V + "-boundary_of stick-slip -boundary_verify 1"
    one, _ = run(words, command="boundary")
    two, _ = run(words, ranks=2, command="boundary")
    check(one["points"] == two["points"] and one["verified"] == two["verified"], "the same on two ranks")


class Smoothed:
    """The block of Carlson and Langer smoothed over 0.05, with the divergence along its motion."""

    def __init__(self, zeta):
        self.block = System(SMOOTHED + f"-grid_n 1 -model_zeta {zeta}")

    def go(self, time, y, v, **more):
        self.block.v = lambda t: v
        return solve_ivp(lambda t, y: [*self.block.rates(t, y[:2]), -self.block.B - self.block.law.slopes(y[0], 0.)[0]],
                         (0, time), y, method="DOP853", rtol=1e-12, atol=1e-13, **more)

    def fold(self, v):
        """The cycle whose second multiplier is 1: its divergence has the mean 0. From the cycle that attracts a bit below v."""
        def up(_, y):
            return y[0] - v + 0.01
        up.direction = 1
        settled = self.go(100, [v, 3., 0], v - 0.01, events=up)

        def miss(u):
            y = self.go(u[2], [u[0], u[1], 0], u[0]).y[:, -1]
            return [y[0] - u[0], y[1] - u[1], y[2]]
        found = root(miss, [v, settled.y_events[0][-1][1], np.diff(settled.t_events[0])[-1]], tol=1e-13, options={"eps": 1e-7})
        assert np.abs(found.fun).max() < 1e-11
        return found.x[0]


def test_smooth_friction_ends_by_a_fold():
    found, _ = run(SMOOTHED + IN_V + "-boundary_verify 1", command="boundary")
    kinds = [(p["of"], p["kind"]) for p in found["points"]]
    check(kinds == [("sliding", "hopf"), ("sliding", "hopf"), ("stick-slip", "fold")], kinds)
    # below the first Hopf point, which is supercritical, sliding attracts and nothing else does: no second point there
    check(found["points"][0]["criticality"] == "supercritical", found["points"][0])
    end = found["points"][2]["value"]
    known = Smoothed("paper").fold(end)
    check(abs(end - known) < 1e-8, f"{end}, by shooting {known}")
    branch = run(SMOOTHED + "-model_v 2 -cycle_continue model_v -cycle_to 3", command="cycle")[0]["special"][0]
    check(branch["kind"] == "fold" and abs(branch["value"] - known) < 1e-8, branch)
    beside, _ = run(SMOOTHED + f"-model_v {end * 0.9999}", command="cycle")
    check(beside["stable_alike"] and beside["amplitude"] > 2, "just before the fold the cycle that attracts is given")
    said = [(v["of"], v["regime"]) for v in found["verified"]]
    check(said[-2:] == [("stick-slip", "bistable"), ("stick-slip", "sliding")], found["verified"])


def test_a_curve_of_folds():
    words = SMOOTHED + IN_V + "-boundary_of stick-slip -boundary_parameter2 model_zeta -boundary_from2 0.1 -boundary_to2 0.3"
    found, _ = run(words + " -boundary_points 5", command="boundary")
    points = found["points"]
    check(len(points) == 5 and all(p["kind"] == "fold" and p["piece"] == 0 for p in points), points)
    check({points[0]["value2"], points[-1]["value2"]} == {0.1, 0.3}, "from border to border")
    p = points[2]
    known = Smoothed(p["value2"]).fold(p["value"])
    check(abs(p["value"] - known) < 1e-7, f"{p['value']} at zeta {p['value2']}, by shooting {known}")


def test_a_state_without_rest():
    # rate-and-state, a block: subcritical at small k0, where the fold lies a little on the stable side of the Hopf point, and
    # supercritical at large k0, where there is none
    words = ("-model_form chain -friction_law rate-and-state -friction_a 0.05 -friction_b 0.1 -friction_D 0.1 -state_law ageing "
             "-bc_left free -grid_n 1 -boundary_parameter model_v -boundary_from 0.003 -boundary_to 1 -boundary_log ")
    hopf, fold = run(words + "-model_k0 0.52", command="boundary")[0]["points"]
    check((hopf["criticality"], fold["kind"], fold["of"]) == ("subcritical", "fold", "stick-slip"), (hopf, fold))
    check(0.85 * hopf["value"] < fold["value"] < hopf["value"], (hopf["value"], fold["value"]))
    # the branch of the cycle that attracts on the unstable side turns round there
    cycle = words.split("-boundary")[0] + "-model_k0 0.52 "
    branch = run(cycle + f"-model_v {hopf['value'] * 1.01} -cycle_continue model_v -cycle_to {fold['value'] * 0.98}",
                 command="cycle")[0]["special"]
    check(branch[0]["kind"] == "fold" and abs(branch[0]["value"] - fold["value"]) < 1e-8, branch)
    point, = run(words + "-model_k0 1", command="boundary")[0]["points"]
    check(point["criticality"] == "supercritical" and point["of"] == "sliding", point)


def test_a_cell_whose_period_doubles():
    # two unequal blocks (runs/two-blocks.yaml): the flip, where a multiplier of the whole scene's cycle is -1
    scene = scene_file("two-blocks") + " -cycle_cell 0 "
    found, _ = run(scene + "-boundary_of stick-slip -boundary_parameter friction_spread -boundary_from 0.084 -boundary_to 0.088",
                   command="boundary")
    flip = [p["value"] for p in found["points"] if p["kind"] == "flip"]
    branch = run(scene + "-friction_spread 0.12 -cycle_continue friction_spread -cycle_to 0.084", command="cycle")[0]["special"]
    check([p["kind"] for p in branch] == ["flip"] and len(flip) == 1 and abs(flip[0] - branch[0]["value"]) < 1e-7, (flip, branch))


def test_a_line_of_ends_of_a_cell():
    # one block as a whole scene goes the way of cells: its own motion is followed to a cycle at places of five lines. Its end is
    # that of uniform motion, which is found another way.
    words = SMOOTHED.replace("-grid_n 16", "-grid_n 1 -bc_left free -init_psi 0 -init_eta 3") + "-boundary_of stick-slip "
    box = "-boundary_parameter model_v -boundary_from 2.1 -boundary_to 2.4 -boundary_points 3 "
    found, _ = run(words + box + "-cycle_cell 0 -boundary_parameter2 model_zeta -boundary_from2 0.14 -boundary_to2 0.145",
                   command="boundary")
    points = found["points"]
    check(len(points) == 3 and all(p["kind"] == "fold" and p["piece"] == 0 for p in points), points)
    check({points[0]["value2"], points[-1]["value2"]} == {0.14, 0.145}, "from border to border")
    known, = run(words + box + f"-model_zeta {points[1]['value2']}", command="boundary")[0]["points"]
    check(abs(points[1]["value"] - known["value"]) < 1e-8, (points[1], known))


def test_a_stiff_slip_is_refused_in_time():
    # rate-and-state with little slip: an explicit search for a cycle beside sliding would take 1e8 steps a turn
    words = ("-model_form chain -friction_law rate-and-state -friction_a 0.05705 -friction_b 0.08283 -friction_D 0.03182 "
             "-state_law ageing -model_k0 0.8394 ")
    done = call(words + "-model_v 0.006", command="cycle")
    check(done.returncode == 1 and "nothing oscillates" in done.stderr and done.stderr.count("\n") == 1, done.stderr)
    found, _ = run(words + "-model_v 0.0074", command="cycle")
    check(found["stable_alike"], "0.04 % beside its fold, at 0.0073968, the cycle that attracts")


@pytest.mark.parametrize("words, said", [
    (BLOCK, "continuum"), ("-grid_n 16 ", "boundary_parameter2"), ("-grid_n 16 -bc_left free ", "ring"),
    ("-grid_n 16 -friction_law coulomb ", "regularised"), ("-grid_n 16 -friction_spread 0.1 ", "spread"),
    ("-grid_n 16 -cycle_cell 2 ", "cycle_cell")])
def test_the_diagram_of_all_motions_is_refused(words, said):
    second = "" if said == "boundary_parameter2" else "-boundary_parameter2 model_c -boundary_from2 1 -boundary_to2 2 "
    done = call(words + IN_V + second + "-boundary_of all", command="boundary")
    check(done.returncode == 2 and "boundary_of all" in done.stderr and said in done.stderr and
          done.stderr.count("\n") == 1, done.stderr)


def test_a_graze_that_is_no_end_is_no_point():
    """Coulomb's law without dynamic friction: at zeta 0.0704 one shape of slip gives way to another, and the block sticks and
    slips on either side."""
    scene = "-model_form chain -grid_n 1 -friction_law coulomb -friction_fd 0 -state_law contact-age -boundary_of stick-slip"
    axis = "-boundary_parameter model_zeta -boundary_from 0.03 -boundary_to 3"
    summary, said = run(f"{scene} {axis}", command="boundary")
    assert [round(p["value"], 6) for p in summary["points"]] == [0.482798], summary["points"]
    assert any("0.0704" in w and "does not end there" in w for w in summary["warnings"])
    for zeta, alive in ((0.05, True), (0.09, True), (0.6, False)):  # as the cycles say
        words = f"-model_form chain -grid_n 1 -friction_law coulomb -friction_fd 0 -state_law contact-age -model_zeta {zeta}"
        found, _ = run(words, command="cycle", code=None)
        assert (found["status"] == "done" and found["rest_fraction"] > 0) == alive, (zeta, found["reason"])
