"""Periodic forcing: cycles under sines of the plate's velocity, of a force and of the normal load against SciPy's monodromy matrices, closed forms of
the linear response, `run` from period to period; where sliding under it loses stability; what is refused."""
import numpy as np
import pytest

from calls import check, data, refused, run
from reference import Stick, System, multipliers, near, options, read, words

CHAIN = "-model_form chain "
TIGHT = "-ts_rtol 1e-11 -ts_atol 1e-12 "


def cycle(scene):
    """The summary of a cycle and its state at phase 0."""
    found, _ = run(scene + " -out_file c.h5", command="cycle")
    return found, read(data("c.h5"), 0)


def random_blocks(number):
    """A short chain of unequal friction under a load, that slides or oscillates."""
    r = np.random.default_rng(number)
    n, period = int(r.integers(1, 5)), r.uniform(2, 9)
    amplitudes = ",".join(f"{i}:{r.uniform(0.8, 1.2):.4f}" for i in range(n))
    scene = (f"{CHAIN}-cycle_cell 0 -grid_n {n} -bc_left free -model_k0 {r.uniform(0.2, 0.8):.4f} -model_k1 {r.uniform(0.1, 0.6):.4f} "
             f"-model_zeta {r.uniform(0.02, 0.2):.4f} -friction_amplitude_profile {amplitudes} ")
    scene += [f"-model_v {r.uniform(1.2, 1.6):.4f} -init_psi 1.3 -init_eta 0 ",
              f"-model_v {r.uniform(0.4, 0.8):.4f} -friction_law rate-and-state -friction_a 0.3 -friction_b 0.2 -friction_D 0.5 -init_psi 0.5 "
              "-init_eta 0.5 ",
              f"-model_v {r.uniform(1.2, 1.6):.4f} -friction_law stribeck -friction_stick regularised -friction_eps 0.2 -friction_viscous 0.6 "
              "-init_psi 1.3 -init_eta 1 "][number % 3]
    plate = f"-load_sine_amplitude {r.uniform(0.1, 0.4):.4f} -load_sine_period {period:.6f} "
    force = f"-load_force_sine_amplitude {r.uniform(0.05, 0.2):.4f} -load_force_sine_period "
    normal = f"-load_normal_sine_amplitude {r.uniform(0.05, 0.2):.4f} -load_normal_sine_period "
    if number % 3 == 1 and number > 3:
        normal = f"-state_law {('ageing', 'slip')[number % 2]} -state_linker_dieterich {r.uniform(0.05, 0.2):.4f} " + normal
    one = f"{period:.6f}"
    return scene + [plate, force + one, normal + one, plate + normal + repr(1.5 * float(one)),
                    plate + normal + repr(0.5 * float(one)) + " " + force + one][number // 3]


@pytest.mark.parametrize("number", range(15))
def test_multipliers_of_random_blocks(tmp_path, monkeypatch, number):
    monkeypatch.chdir(tmp_path)
    scene = random_blocks(number)
    found, start = cycle(scene)
    system = System(scene)
    end, matrix = system.carried(start, found["period"], rtol=1e-12, atol=1e-13)
    assert np.abs(end - start).max() < 1e-8
    near(multipliers(found), np.linalg.eigvals(matrix), 1e-6)
    assert found["multiplier_error"] is None
    periods = [value for name, value in options(scene).items() if name.endswith("sine_period")]
    both = 3 * periods[0] if number // 3 == 3 else max(periods)
    assert abs(found["period"] - found["forcing_periods"] * both) < 1e-9
    assert found["stable"] == (np.abs(np.linalg.eigvals(matrix)).max() < 1)


@pytest.mark.parametrize("number", range(3))
def test_multipliers_of_unequal_blocks(tmp_path, monkeypatch, number):
    """Masses, springs and dampers that differ, under sines of the plate and of the normal load."""
    monkeypatch.chdir(tmp_path)
    r = np.random.default_rng([41, number])
    n, period = number + 2, r.uniform(3, 6)
    drawn = {"model_m": r.uniform(0.5, 2, n), "model_k0": r.uniform(0.2, 0.8, n), "model_k1": r.uniform(0.1, 0.8, n - 1),
             "model_zeta": r.uniform(0.02, 0.2, n)}
    scene = f"{CHAIN}-cycle_cell 0 -grid_n {n} -bc_left free " + " ".join(words(drawn)) + " "
    scene += [f"-model_v 1.4 -init_psi 1.4 -init_eta 0 -load_sine_amplitude 0.3 -load_sine_period {period!r} ",
              f"-model_v 0.6 -friction_law rate-and-state -friction_a 0.3 -friction_b 0.2 -friction_D 0.5 -init_psi 0.5 -init_eta 0.5 "
              f"-load_sine_amplitude 0.2 -load_sine_period {period!r} ",
              f"-model_v 1.3 -init_psi 1.3 -init_eta 0 -load_normal_sine_amplitude 0.2 -load_normal_sine_period {period!r} "][number]
    found, start = cycle(scene)
    end, matrix = System(scene).carried(start, found["period"], rtol=1e-12, atol=1e-13)
    assert np.abs(end - start).max() < 1e-8
    near(multipliers(found), np.linalg.eigvals(matrix), 1e-6)


@pytest.mark.parametrize("of", ("load_sine", "load_force_sine", "load_normal_sine"))
def test_the_linear_response(tmp_path, monkeypatch, of):
    """Of a small sine: (A K0 - w^2 + i w A (B + F')) psi = A K0 a, or i w A p, or -i w A F a; what is left is of the second order."""
    monkeypatch.chdir(tmp_path)
    k0, zeta, v, period, small = 0.4, 0.3, 1.3, 5.0, 1e-4
    found, start = cycle(f"{CHAIN}-grid_n 1 -bc_left free -model_k0 {k0} -model_zeta {zeta} -model_v {v} -init_psi 1.3 -init_eta 0 "
                         f"-{of}_amplitude {small} -{of}_period {period}")
    w = 2 * np.pi / period
    drive = {"load_sine": k0, "load_force_sine": 1j * w, "load_normal_sine": -1j * w * (v**3 / 3 - v)}[of]
    answer = drive * small / (k0 - w**2 + 1j * w * (zeta + v**2 - 1))  # of exp(i w t), whose imaginary part is the sine
    assert abs(found["amplitude"] - abs(answer)) < 1e-3 * small
    assert abs(start[0] - v - answer.imag) < 1e-3 * small and found["forcing_periods"] == 1
    # both multipliers, without one that is 1: exp(lambda T) of the linear equation
    roots = np.roots([1, zeta + v**2 - 1, k0])
    near(multipliers(found), np.exp(roots * period), 1e-6)


STICKS = (f"{CHAIN}-cycle_cell 0 -bc_left free -model_k0 1 -model_zeta 0.1 -model_v 0.1 -friction_law carlson-langer -friction_alpha 1 "
          "-init_psi 0 -init_eta 0.3 ")


@pytest.mark.parametrize("more", ("-grid_n 1 -load_sine_amplitude 0.08 -load_sine_period 7",
                                  "-grid_n 1 -load_sine_amplitude 0.08 -load_sine_period 7 -friction_alpha 3",
                                  "-grid_n 2 -load_sine_amplitude 0.1 -load_sine_period 5 -model_k1 0.3 -init_noise 0.1 "
                                  "-friction_amplitude_profile 0:1,1:1.2",
                                  "-grid_n 1 -load_normal_sine_amplitude 0.15 -load_normal_sine_period 7",
                                  "-grid_n 1 -load_force_sine_amplitude 0.1 -load_force_sine_period 7",
                                  "-grid_n 2 -load_normal_sine_amplitude 0.1 -load_normal_sine_period 6 -load_force_sine_amplitude 0.15 "
                                  "-load_force_sine_period 6 -model_k1 0.3 -init_noise 0.1 -friction_amplitude_profile 0:1,1:1.2"))
def test_a_cycle_that_rests(tmp_path, monkeypatch, more):
    """Against SciPy from change to change, with the deviations' jumps, and against the stroboscope of `run`."""
    monkeypatch.chdir(tmp_path)
    scene = STICKS.replace("-friction_alpha 1 " if "alpha" in more else "  ", "") + more
    found, start = cycle(scene)
    assert found["rest_fraction"] > 0.01 and found["residual"] < 1e-9
    system = System(scene)
    n, dof = system.n, 2
    # deviations of a node at rest at phase 0 have no psi
    stick = Stick(system, start, Y=np.eye(dof * n))
    stick.advance(found["period"])
    check(np.abs(stick.u - start).max() < 1e-8, f"SciPy ends {np.abs(stick.u - start).max()} off")
    near(multipliers(found), np.linalg.eigvals(stick.Y), 1e-5)
    np.savetxt("start.txt", np.column_stack([np.arange(n), *np.split(start, 2)]), fmt="%.17g")
    run(f"{scene.replace('-init_psi 0 -init_eta 0.3', '').replace('-init_noise 0.1', '')} {TIGHT} -init_type text -init_file start.txt "
        f"-ts_max_time {5 * found['period']!r} -out_file r.h5 -out_frames 2")
    check(np.abs(read(data("r.h5"), -1) - start).max() < 1e-6, "the stroboscope of `run`, five cycles later")


@pytest.mark.parametrize("k0", (1e-3, 0.03, 1))
def test_a_block_that_a_force_only_just_moves(k0):
    """Friction 1 that does not drop: on a soft spring psi = p [cos(a) - cos(w t)]/w - (t - a/w) from w t = a on, where p sin(a) = 1. What
    deviates hardly comes back on it, its multiplier is 1 but for k0, and Newton's step the larger for that."""
    for margin in (1e-3, 1e-2, 0.1):
        p, w = 1 + margin, 2 * np.pi
        a = np.arcsin(1 / p)
        top = (2 * p * np.cos(a) - (np.pi - 2 * a)) / w
        found, _ = run(f"-model_form chain -grid_n 1 -bc_left free -friction_law coulomb -friction_fd 1 -model_v 0 -model_k0 {k0} -init_psi 0 "
                       f"-init_eta 0 -load_force_sine_amplitude {p!r} -load_force_sine_period 1", command="cycle")
        # the spring's share of the force while it slips, k0/w^2, and how well the start is known, since psi goes like margin^1.5
        allowed = 2 * k0 / w**2 + 5 * found["error_estimate"] / margin
        for side in (found["psi_max"], -found["psi_min"]):
            check(abs(side / top - 1) < allowed, f"{k0} {p}: {side}, {top}")
        check(found["period"] == 1 and found["stable_alike"] and found["multipliers"][0]["re"] < 1, f"{k0} {p}: {found['multipliers']}")


# sliding beside its boundary v = 1, shaken at twice its own frequency: the damping's sine opens a band of parametric resonance
DOUBLING = f"{CHAIN}-model_k0 0.2 -model_v 1.05 -init_psi 1.05 -init_eta -0.66 -load_sine_period 7 "
BOUNDARY = "-boundary_parameter load_sine_amplitude -boundary_from 0 -boundary_to 0.6 "


def slide(system, period):
    """The state at phase 0 and the matrix over a period of the slide under a load, by Newton's method from steady sliding."""
    u, apart = system.steady, 1
    while apart > 1e-11:
        end, matrix = system.carried(u, period)
        u, apart = u + np.linalg.solve(np.eye(len(u)) - matrix, end - u), np.abs(end - u).max()
    return u, matrix


def test_doubling(tmp_path, monkeypatch):
    """Where a multiplier passes -1: by a branch of cycles, by `boundary`, and SciPy's matrix there; two periods beyond."""
    monkeypatch.chdir(tmp_path)
    one = DOUBLING + "-grid_n 1 -bc_left free "
    branch, _ = run(one + "-load_sine_amplitude 0.1 -cycle_continue load_sine_amplitude -cycle_to 0.6", command="cycle")
    flips = [s["value"] for s in branch["special"] if s["kind"] == "flip"]
    bound, _ = run(one + "-load_sine_amplitude 0.1 " + BOUNDARY, command="boundary")
    points = bound["points"]
    assert [p["kind"] for p in points] == ["flip"] and len(flips) == 1 and abs(points[0]["value"] - flips[0]) < 1e-7
    assert abs(points[0]["frequency"] - np.pi / 7) < 1e-6 and points[0]["of"] == "sliding"
    _, matrix = slide(System(one + f"-load_sine_amplitude {flips[0]!r}"), 7)
    assert np.abs(np.linalg.eigvals(matrix) + 1).min() < 1e-6
    beyond, _ = run(one + f"-load_sine_amplitude {1.2 * flips[0]!r}", command="cycle")
    before, _ = run(one + f"-load_sine_amplitude {0.8 * flips[0]!r}", command="cycle")
    assert (before["forcing_periods"], beyond["forcing_periods"]) == (1, 2) and beyond["stable_alike"]


def test_waves_on_the_slide(tmp_path, monkeypatch):
    """On a ring the shortest way to a boundary is a wave of half the load's frequency: the whole ring's matrix has modulus 1 there."""
    monkeypatch.chdir(tmp_path)
    ring = DOUBLING.replace("-load_sine_period 7", "-load_sine_period 3.755") + "-model_k1 0.5 -grid_n 6 -load_sine_amplitude 0.1 "
    found, _ = run(ring + BOUNDARY.replace("0.6", "3"), command="boundary")
    first = found["points"][0]
    assert first["kind"] == "flip" and abs(first["wavenumber"] - np.pi / 3) < 1e-12
    scene = ring + f"-load_sine_amplitude {first['value']!r}"
    _, one = cycle(scene)  # all nodes alike: of one node
    end, matrix = System(scene).carried(np.repeat(one, 6), 3.755)
    moduli = np.abs(np.linalg.eigvals(matrix))
    assert np.abs(end - np.repeat(one, 6)).max() < 1e-8 and abs(moduli.max() - 1) < 1e-7
    # the same ring as nodes that are not known to be alike
    unlike, _ = run(ring + "-friction_amplitude_profile 0:1,1:1 " + BOUNDARY.replace("0.6", "3"), command="boundary")
    assert abs(unlike["points"][0]["value"] - first["value"]) < 1e-7
    # and in two options
    curve, _ = run(ring + BOUNDARY.replace("0.6", "3") + "-boundary_parameter2 model_v -boundary_from2 1.02 -boundary_to2 1.1 "
                   "-boundary_points 5", command="boundary")
    for point in curve["points"]:
        assert abs(modulus(ring, point["value"], point["value2"]) - 1) < 1e-6


def modulus(ring, amplitude, v):
    """The largest modulus of the multipliers of the ring's slide."""
    scene = ring + f"-load_sine_amplitude {amplitude!r} -model_v {v!r}"
    u, _ = slide(System(scene.replace("-grid_n 6", "-grid_n 1 -bc_left free")), 3.755)
    return np.abs(np.linalg.eigvals(System(scene).carried(np.repeat(u, 6), 3.755)[1])).max()


def test_a_slide_that_stops(tmp_path, monkeypatch):
    """Coulomb friction and viscosity: the slide is a sine, and stops where its amplitude is v."""
    monkeypatch.chdir(tmp_path)
    k0, zeta, v, period = 0.5, 0.2, 0.3, 4.0
    w = 2 * np.pi / period
    exact = v * abs(k0 - w**2 + 1j * w * zeta) / k0
    found, _ = run(f"{CHAIN}-grid_n 1 -bc_left free -friction_law coulomb -model_k0 {k0} -model_zeta {zeta} -model_v {v} "
                   f"-load_sine_amplitude 0.1 -load_sine_period {period} -boundary_parameter load_sine_amplitude -boundary_from 0 "
                   "-boundary_to 4", command="boundary")
    assert [p["kind"] for p in found["points"]] == ["stop"] and abs(found["points"][0]["value"] - exact) < 1e-9
    # below it the cycle never rests, and its branch ends there
    branch, _ = run(f"{CHAIN}-grid_n 1 -bc_left free -friction_law coulomb -model_k0 {k0} -model_zeta {zeta} -model_v {v} -init_psi 0.3 "
                    f"-init_eta 0.56 -load_sine_amplitude 0.5 -load_sine_period {period} -cycle_continue load_sine_amplitude -cycle_to 4",
                    command="cycle")
    assert branch["rest_fraction"] == 0 and branch["special"][-1]["kind"] == "graze"
    assert abs(branch["special"][-1]["value"] - exact) < 1e-5


def test_a_slide_that_changes_fast_is_found_all_along():
    """From a load of 1.07 to 1.18 neither a growing load nor the slides beside lead to it: the motion settles on it (`cycle`)."""
    block = ("-model_form chain -grid_n 1 -bc_left free -model_m 0.35 -model_k0 0.9 -model_zeta 0 -friction_law dahl -friction_fc 0.5 "
             "-friction_sigma0 26 -model_v 1.4 -load_force_sine_period 6.7 ")
    found, said = run(block + "-load_force_sine_amplitude 0.25 -boundary_parameter load_force_sine_amplitude -boundary_from 0.9 "
                      "-boundary_to 1.2", command="boundary")
    assert [point["kind"] for point in found["points"]] == ["flip"] and "no slide" not in said
    one, _ = run(block + "-load_force_sine_amplitude 1.12 -cycle_cell 0 -init_psi 1.4", command="cycle")
    assert one["forcing_periods"] == 1 and one["stable"]


def test_the_end_of_a_branch_is_listed(tmp_path, monkeypatch):
    """Where a slip only just comes to rest SciPy's motion rests once in a period of the force on one side, and not on the other; two blocks
    that change places end a branch, too."""
    monkeypatch.chdir(tmp_path)
    one = (f"{CHAIN}-grid_n 1 -bc_left free -friction_law coulomb -friction_fd 0.572 -model_zeta 0.322 -model_k0 0.5 -model_v 0.1981 "
           "-init_psi 0.1981 -init_eta .5 -load_force_sine_period 7.969 -load_force_sine_amplitude ")
    branch, _ = run(one + "0.4192 -cycle_continue load_force_sine_amplitude -cycle_to 0.08384", command="cycle")
    end = branch["special"][-1]
    points = branch["branch"]["points"]
    assert end["kind"] == "graze" and end["value"] == points[-1]["value"] and end["after"] == len(points) - 1
    u, changes = [0.1981, 0.5], []  # down to there, so that no other motion is met
    for amplitude in (0.1285, 0.127, 0.1264, end["value"] * (1 + 1e-4), end["value"] * (1 - 1e-4)):
        motion = Stick(System(one + repr(amplitude)), u)
        motion.advance(6 * 7.969)
        settled = motion.changes
        u = motion.advance(12 * 7.969)
        changes.append(motion.changes - settled)
    assert changes[:4] == 4 * [12] and changes[4] != 12, changes
    two, _ = run(f"{CHAIN}-grid_n 3 -bc_left free -cycle_cell 0 -friction_law coulomb -friction_fd 0.6 -friction_amplitude_profile 0:1,2:1.2 "
                 "-model_zeta 0.2 -model_k0 0.5 -model_k1 0.3 -model_v 0.3 -init_psi 0.3 -init_eta 0.5 -load_sine_amplitude 0.3 "
                 "-load_sine_period 8 -cycle_continue model_k0 -cycle_to 1.5", command="cycle")
    ends = [p for p in two["special"] if p["kind"] in ("graze", "pass", "release", "order")]
    assert ("no cycle" in two["branch"]["end"]) == bool(ends), (two["branch"]["end"], two["special"])
    # starts and stops pass every phase of the load on this branch
    far, _ = run(f"{CHAIN}-grid_n 1 -bc_left free -friction_law stribeck -friction_fc 0.806 -model_zeta 0.237 -model_k0 0.5 -model_v 0.2365 "
                 "-init_psi 0.2365 -init_eta .5 -load_force_sine_amplitude 0.427 -load_force_sine_period 12.18 "
                 "-cycle_continue load_force_sine_period -cycle_to 2.435", command="cycle")
    assert far["special"][-1]["kind"] == "graze" and far["branch"]["points"][-1]["value"] < 3.1, far["branch"]["end"]


def test_where_a_slide_under_a_normal_load_ends(tmp_path, monkeypatch):
    """SciPy's matrix of the slide has a multiplier on the unit circle at the point that `boundary` finds: of a block, and of a ring, where a
    wave of half the load's frequency resonates."""
    monkeypatch.chdir(tmp_path)
    block = f"{CHAIN}-model_k0 0.2 -model_zeta 0.1 -load_normal_sine_period 3.755 -load_normal_sine_amplitude "
    alone = "-grid_n 1 -bc_left free "
    found, _ = run(block + "0.3 " + alone + "-boundary_parameter model_v -boundary_from 0.8 -boundary_to 1.2", command="boundary")
    assert found["points"]
    for point in found["points"]:
        _, matrix = slide(System(block + f"0.3 {alone}-model_v {point['value']!r}"), 3.755)
        assert abs(np.abs(np.linalg.eigvals(matrix)).max() - 1) < 1e-6
    ring = "-grid_n 6 -model_k1 0.5 -model_v 1 "
    found, _ = run(block + "0.1 " + ring + "-boundary_parameter load_normal_sine_amplitude -boundary_from 0 -boundary_to 0.9",
                   command="boundary")
    assert found["points"] and found["points"][0]["wavenumber"] > 0
    value = found["points"][0]["value"]
    u, _ = slide(System(block + f"{value!r} {alone}-model_v 1"), 3.755)
    _, matrix = System(block + f"{value!r} {ring}").carried(np.repeat(u, 6), 3.755)
    assert abs(np.abs(np.linalg.eigvals(matrix)).max() - 1) < 1e-6


def test_a_slide_that_only_its_neighbours_lead_to():
    """Beyond a period of 17.26 the slide is not reached by making the load grow; on the way from shorter periods it is, and there it
    becomes stable, by SciPy's matrix too."""
    blocks = (f"{CHAIN}-grid_n 3 -bc_left free -model_k0 0.177994 -model_f0 0.644167 -model_m_profile 0:2.10215,1:2.30611,2:2.38143 "
              "-model_zeta_profile 0:0.0568,1:0.02956,2:0.02878 -model_k1_profile 0.5:0.09061,1.5:0.13259 -friction_amplitude_profile "
              "0:0.79044,1:1.14372,2:0.91727 -friction_law coulomb -friction_fs 1 -friction_fd 0.65766 -friction_stick regularised "
              "-friction_eps 0.100136 -friction_slip_velocity 0.38232 -model_v 0.592452 -load_force_sine_amplitude 0.24897 ")
    found, _ = run(blocks + "-boundary_parameter load_force_sine_period -boundary_from 16 -boundary_to 18", command="boundary")
    (point,) = found["points"]
    assert point["kind"] == "torus" and abs(point["value"] - 17.2714) < 1e-3 and not found["notes"]
    _, matrix = slide(System(blocks + f"-load_force_sine_period {point['value']!r}"), point["value"])
    assert abs(np.abs(np.linalg.eigvals(matrix)).max() - 1) < 1e-5


def test_a_rate_within_its_error_of_zero_is_no_sign():
    """Dahl's bristles without damping lose nothing on a slide that only pulls them forward: every multiplier has modulus 1, and no place is
    one where that changes."""
    found, _ = run(f"{CHAIN}-grid_n 1 -bc_left free -model_m .35 -model_k0 .9 -model_zeta 0 -friction_law dahl -friction_fc .5 "
                   "-friction_sigma0 26 -model_v 1.4 -load_force_sine_period 6.7 -boundary_parameter load_force_sine_amplitude "
                   "-boundary_from 0.1 -boundary_to 0.6", code=1, command="boundary")
    assert not found["points"] and found["reason"].endswith("its growth rate is 0")
    assert found["notes"][0].startswith("the growth rate is 0 from load_force_sine_amplitude 0.1 to 0.6"), found["notes"]


@pytest.mark.parametrize("of, to", (("load_normal_sine", 0.2), ("load_force_sine", 0.6)))
def test_doubling_under_other_sines(tmp_path, monkeypatch, of, to):
    """A branch of cycles and `boundary` find one doubling."""
    monkeypatch.chdir(tmp_path)
    one = DOUBLING.replace("load_sine", of) + f"-grid_n 1 -bc_left free -{of}_amplitude 0.05 "
    branch, _ = run(f"{one} -cycle_continue {of}_amplitude -cycle_to {to}", command="cycle")
    flips = [s["value"] for s in branch["special"] if s["kind"] == "flip"]
    bound, _ = run(f"{one} -boundary_parameter {of}_amplitude -boundary_from 0 -boundary_to {to}", command="boundary")
    assert [p["kind"] for p in bound["points"]] == ["flip"] and len(flips) == 1
    assert abs(bound["points"][0]["value"] - flips[0]) < 1e-7


@pytest.mark.parametrize("law, load", [
    ("coulomb", "-load_sine_amplitude 0.15 -load_sine_period 7"),
    ("coulomb -state_law healing -state_t_h 3 -state_tau_inf 1.6 -state_D 0.5", "-load_normal_sine_amplitude 0.15 -load_normal_sine_period 7"),
    ("carlson-langer -friction_sigma 0.1", "-load_force_sine_amplitude 0.3 -load_force_sine_period 15 "
                                          "-load_normal_sine_amplitude 0.1 -load_normal_sine_period 15")])
def test_waves_on_a_cycle_with_rests(tmp_path, monkeypatch, law, load):
    """Of blocks that are alike: a deviation of one block, whose neighbours deviate by the phase of a wave, by SciPy round the period."""
    monkeypatch.chdir(tmp_path)
    scene = f"{CHAIN}-grid_n 8 -model_k0 0.5 -model_k1 0.3 -model_zeta 0.05 -model_v 0.2 -friction_law {law} {load} "
    found, start = cycle(scene + "-cycle_spectrum -cycle_wavenumbers 8")
    file = data("c.h5")
    k, mu = file["spectrum/wavenumber"], file["spectrum/multiplier_re"] + 1j * file["spectrum/multiplier_im"]
    for j in (0, 3, 7):
        system = System(options(scene) | {"grid_n": 1, "bc_left": "free"})
        wave, alone = np.array([[2 * np.cos(k[j]) - 2]]), system.jacobian
        system.jacobian = lambda u, D=None, t=0., wave=wave, alone=alone: alone(u, wave, t)
        stick = Stick(system, start, 0., np.eye(len(start)))
        assert np.abs(stick.advance(found["period"]) - start).max() < 1e-6
        known = np.linalg.eigvals(stick.Y)
        near(np.sort_complex(known), mu[j], 1e-5)
        assert abs(np.log(np.abs(known).max()) / found["period"] - file["spectrum/growth_rate"][j]) < 1e-5


def test_exponents_under_a_normal_load(tmp_path, monkeypatch):
    """On a cycle with rests they are the logarithms of the moduli of its multipliers over its period."""
    monkeypatch.chdir(tmp_path)
    scene = STICKS + "-grid_n 1 -load_normal_sine_amplitude 0.15 -load_normal_sine_period 7 "
    found, _ = cycle(scene)
    run_of, _ = run(f"{scene} {TIGHT} -ts_max_time {60 * found['period']!r} -lyapunov_count 1 -lyapunov_from {20 * found['period']!r}")
    exact = np.log(np.abs(multipliers(found)).max()) / found["period"]
    assert abs(run_of["lyapunov"][0]["value"] - exact) < 1e-3 * abs(exact) + 1e-9, (run_of["lyapunov"], exact)


def test_refusals():
    sine = "-load_sine_amplitude 0.1 -load_sine_period 3 "
    axis = "-boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5 "
    for command in ("cycle", "boundary"):
        refused(axis + "-load_v 0:0.1,5:0.2", 2, "load_v", command, command=command)
        refused(axis + "-load_sine_amplitude 0.1", 2, "load_sine_period", command=command)
        refused(axis + sine + "-model_form chain -model_k0 0", 2, "model_k0", command=command)
        refused(axis + "-load_normal 0:1,5:2", 2, "load_normal", command, command=command)
        refused(axis + sine + "-load_normal_sine_amplitude 0.1 -load_normal_sine_period 3.1415926", 2, "load_normal_sine_period",
                "3.1415926", "whole", command=command)
        refused(axis + "-load_normal_sine_amplitude 1 -load_normal_sine_period 3", 2, "load_normal_sine_amplitude", "> 0", command=command)
    for command in ("spectrum", "wave", "chart"):
        refused("-wave_length 60 " + sine, 2, "load_sine_amplitude", command, command=command)
    force = "-load_force_sine_amplitude 0.1 -load_force_sine_period 3 -model_form chain "
    refused(force + "-model_k0 0 -load_v 0:1,2:1", 2, "load_v", "model_k0 0")
    refused(force + "-grid_n 4 -bc_left free -model_k0_profile 0:1,3:2", 2, "load_force_sine_amplitude", "model_k0_profile")
    refused(axis + sine + "-boundary_of stick-slip", 2, "boundary_of", command="boundary")
    refused(axis + sine + "-boundary_verify 1", 2, "boundary_verify", command="boundary")
    refused(axis + sine + "-friction_amplitude_profile 0:1,30:2", 2, "unknowns", command="boundary")
