"""Drag (model_drag c3: c3 psi |psi| beside friction) in every command: against SciPy on random scenes, and exact relations."""
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from calls import check, data, refused, run
from reference import Stick, System, amplitudes, options, read, words

STRICT = "-ts_rtol 1e-10 -ts_atol 1e-11"
BLOCK = "-model_form chain -grid_n 1 -bc_left free"


def drawn(seed):
    """A scene of either form without exact stick, its friction of unequal amplitudes or a profile in two of three."""
    rng = np.random.default_rng([19, seed])
    p = {"model_drag": rng.uniform(0.05, 1), "model_v": rng.uniform(0.3, 1.2) * rng.choice([-1, 1])}
    if seed % 2:
        p |= {"grid_n": 8, "grid_length": rng.uniform(3, 8), "grid_order": 2, "model_gamma": rng.uniform(1, 4),
              "model_delta": rng.uniform(0, 0.5)}
    else:
        p |= {"model_form": "chain", "grid_n": 5, "bc_left": "free", "model_m": rng.uniform(0.5, 2), "model_zeta": rng.uniform(0, 0.4),
              "model_k1": rng.uniform(0.2, 1)}
        if seed % 4:
            p["friction_amplitude"] = rng.uniform(0.5, 1.5, 5)
    return p | [{}, {"friction_law": "rate-and-state", "friction_a": 0.1, "friction_b": 0.15, "friction_D": 0.6},
                {"friction_law": "carlson-langer", "friction_stick": "regularised", "friction_eps": 0.3}][seed % 3]


@pytest.mark.parametrize("seed", range(6))
def test_eigenvalues_and_runs_agree_with_scipy(seed):
    p = drawn(seed)
    system, text = System(p), " ".join(words(p))
    got, want = run(text + " -spectrum_count 24", command="spectrum")[0]["eigenvalues"], system.eigenvalues()
    for value in got:
        assert np.abs(want - complex(value["re"], value["im"])).min() < 1e-9 * np.abs(want).max(), p
    run(f"{text} -init_psi -0.4 -init_eta steady -init_noise 0.8 -ts_max_time 4 -out_frames 2 -out_file run.h5 {STRICT}")
    fields = data("run.h5")
    end = system.follow(read(fields, 0), 0, 4, rtol=1e-11, atol=1e-12)
    # a few hundred steps of 1e-10 each, beside growth by less than a hundred
    assert np.abs(end - read(fields, 1)).max() < 1e-6, p


@pytest.mark.parametrize("method", [
    "rk", "rk -ts_rk_type 7vr", "arkimex -imex_implicit friction", "arkimex -imex_implicit wave", "arkimex -imex_implicit both",
    "rosw", "bdf", "theta -ts_theta_theta 0.5", "leapfrog"])
def test_every_method(method):
    """To one end from one start, with friction and drag in the part of the equations that a method takes them in."""
    tolerance = 1e-9 if method == "bdf" else 1e-8
    tight = "-ts_adapt_type none -ts_dt 1e-3" if method[:5] in ("leapf", "theta") else f"-ts_rtol {tolerance} -ts_atol {tolerance}"
    scene = "-grid_n 24 -grid_length 8 -grid_order 4 -model_drag 0.6 -init_type sine -init_psi 0.1 -scene_reduce off -ts_max_time 2"
    run(f"{scene} -ts_type {method} {tight} -out_frames 2 -out_file run.h5")
    fields = data("run.h5")
    end = System(options(scene)).follow(read(fields, 0), 0, 2, rtol=1e-10, atol=1e-11)
    # methods of order 2 at steps of 1e-3: third derivatives, of 30 or so, times 1e-6/12 each unit of time; else a few
    # hundred steps of 1e-8 each, of bdf some thousand of 1e-9
    assert np.abs(end - read(fields, 1)).max() < 2e-5, method


@pytest.mark.parametrize("law", ["carlson-langer", "coulomb"])
def test_exact_stick(law):
    """Slips and rests of a chain with unequal friction, node by node with SciPy."""
    text = (f"-model_form chain -grid_n 4 -bc_left free -friction_law {law} -model_v 0.3 -model_k0 0.6 -model_k1 0.4 -model_drag 0.7 "
            "-friction_amplitude_profile 0:1,1:1.3,2:0.8,3:1.1")
    s, _ = run(f"{text} -init_psi 0 -init_eta 0 -ts_max_time 9 -out_frames 2 -out_file run.h5 {STRICT}")
    fields = data("run.h5")
    motion = Stick(System(text), read(fields, 0), rtol=1e-11, atol=1e-12)
    end = motion.advance(9)
    assert motion.changes >= 4 and np.abs(end - read(fields, 1)).max() < 1e-6, (motion.changes, s["regime"])
    run(f"{text} -init_psi 0 -init_eta 0 -ts_max_time 9 -stick_clusters on -out_frames 2 -out_file clusters.h5 {STRICT}")
    assert np.abs(end - read(data("clusters.h5"), 1)).max() < 1e-6


def test_massless():
    """B psi + F + c3 psi |psi| = eta: SciPy advances psi where the program advances eta."""
    text = ("-model_form chain -model_m 0 -grid_n 4 -bc_left free -model_zeta 1.2 -model_k0 0.5 -model_k1 0.4 -model_drag 0.8 "
            "-friction_amplitude_profile 0:0.7,1:1.1,2:0.9,3:1.15")
    s, _ = run(f"{text} -init_psi 0.1 -init_noise 0.2 -ts_max_time 5 -out_frames 2 -out_file run.h5 {STRICT}")
    fields, system = data("run.h5"), System(text)

    def rates(t, psi):
        eta_t = system.K0 * (system.v(t) - psi) + system.K1 * system.second(psi)
        return eta_t / (system.B + system.law.slopes(psi, 0 * psi)[0])
    psi = solve_ivp(rates, (0, 5), fields["psi"][0], method="LSODA", rtol=1e-11, atol=1e-13).y[:, -1]
    check(s["unknowns"] == 4, "psi is no unknown")
    assert np.abs(psi - fields["psi"][1]).max() < 1e-7
    assert np.abs(system.B * psi + system.law.force(psi) - fields["eta"][1]).max() < 1e-7


def test_damping_of_sliding_is_twice_the_drag_times_the_velocity():
    """Growth -[A (B + F' + 2 c3 |v|) + s delta]/2 of every oscillating mode, and the boundary in closed form: with the cubic
    v = -c3 + sqrt(c3^2 + 1 - s delta/gamma)."""
    gamma, delta, c3, v = 2.5, 0.3, 0.4, 0.6
    scene = f"-model_gamma {gamma} -model_delta {delta} -model_drag {c3} -grid_n 16 -grid_length 6"
    for velocity in (v, -v):
        s, _ = run(f"{scene} -model_v {velocity}", command="spectrum")
        assert abs(s["growth_rate"] + (gamma * (v * v - 1 + 2 * c3 * v) + delta) / 2) < 1e-9
    s, _ = run(f"{scene} -boundary_parameter model_v -boundary_from 0.2 -boundary_to 2 -boundary_of sliding", command="boundary")
    assert abs(s["points"][0]["value"] - (-c3 + np.sqrt(c3 * c3 + 1 - delta / gamma))) < 1e-9
    s, _ = run(f"{scene} -model_v {v} -boundary_parameter model_drag -boundary_from 0.01 -boundary_to 2 -boundary_of sliding", command="boundary")
    assert abs(s["points"][0]["value"] - (1 - delta / gamma - v * v) / (2 * v)) < 1e-9


def test_boundary_and_its_kind_agree_with_scipy():
    """Of a chain with unequal friction where the rightmost eigenvalue crosses; of one block, whether the cycle that is born
    there grows: l has the sign of -(F''' + its part of F''), which the drag enters by F'' = 2 c3 alone."""
    scene = {"model_form": "chain", "grid_n": 4, "bc_left": "free", "model_zeta": 0.1, "model_drag": 0.2,
             "friction_amplitude": np.array([0.8, 1.2, 1.1, 0.9])}
    got, _ = run(" ".join(words(scene)) + " -boundary_parameter model_v -boundary_from 0.3 -boundary_to 1.5 -boundary_of sliding", command="boundary")
    want = brentq(lambda v: System(scene | {"model_v": v}).eigenvalues()[0].real, 0.3, 1.5, xtol=1e-13)
    assert abs(got["points"][0]["value"] - want) < 1e-8
    # psi_t = A (e - phi(psi)), e_t = -K0 psi: at the Hopf point l = -A F'''/16 for any F''
    plain, dragged = (run(f"{BLOCK} -model_drag {c3} -boundary_parameter model_v -boundary_from 0.2 -boundary_to 1.5 -boundary_of sliding",
                          command="boundary")[0]["points"][0] for c3 in (0, 0.3))
    assert dragged["criticality"] == plain["criticality"] == "supercritical"
    assert dragged["lyapunov_coefficient"] == pytest.approx(plain["lyapunov_coefficient"], rel=1e-6)


@pytest.mark.parametrize("law, k1", [("cubic", ""), ("carlson-langer", "")])
def test_cycles_agree_with_scipy(law, k1):
    """Of one block, smooth and with rests: SciPy comes back after the period, and carries deviations as the multipliers say."""
    text = f"{BLOCK} -model_k0 0.5 -model_v 0.3 -model_drag 0.25 -friction_law {law}{k1}"
    found, _ = run(text + " -out_file c.h5", command="cycle")
    start, system = read(data("c.h5"), 0), System(text)
    if law == "cubic":
        end, matrix = system.carried(start, found["period"])
        known = np.linalg.eigvals(matrix)
        assert np.abs(end - start).max() < 1e-6
        for one in found["multipliers"]:
            assert np.abs(known - complex(one["re"], one["im"])).min() < 1e-5
    else:
        motion = Stick(system, start, rtol=1e-11, atol=1e-12)
        assert np.abs(motion.advance(found["period"]) - start).max() < 1e-6 and motion.changes == 2


def test_trains_agree_with_scipy():
    """Along a train, t - x/V its one variable, eta_t (1 - c^2/V^2) = K0 (v - psi) - s delta (eta - F) - (c^2/V^2) F' psi_t: from
    a point of it SciPy comes back after L/(n V)."""
    scene = "-wave_speed 1.8 -model_gamma 3 -model_delta 0.2 -model_c 1 -model_v 0.2 -model_drag 0.4"
    found, _ = run(scene + " -wave_spectrum -spectrum_count 4 -out_file train.h5", command="wave")
    fields, system = data("train.h5"), System("-model_drag 0.4")
    ratio = (1 / 1.8)**2

    def rates(t, u):
        psi, eta = u[:1], u[1:]
        F, F_psi = system.law.force(psi), system.law.slopes(psi, 0 * psi)[0]
        psi_t = system.A * (eta - F)
        return np.concatenate([psi_t, (system.K0 * (0.2 - psi) - system.sd * (eta - F) - ratio * F_psi * psi_t) / (1 - ratio)])
    start = np.array([fields["psi"][0], fields["eta"][0]])
    end = solve_ivp(rates, (0, found["length"] / 1.8), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    assert np.abs(end - start).max() < 1e-6
    assert found["translation_error"] < 1e-6  # the eigenvalue 0 of translation, about the train with the drag's slope


def test_exponents_of_sliding():
    """Without growth the exponents of steady sliding are the real parts of the eigenvalues, -(B + F' + 2 c3 |v|)/2 each."""
    v, c3 = 0.9, 0.3
    s, _ = run(f"{BLOCK} -model_k0 1 -model_v {v} -model_drag {c3} -init_psi steady -init_eta steady -init_noise 1e-6 -ts_max_time 200 "
               "-lyapunov_count 2 -ts_rtol 1e-9 -ts_atol 1e-9")
    want = -(v * v - 1 + 2 * c3 * v) / 2
    assert all(abs(e["value"] - want) < 4 * e["error"] + 1e-4 * abs(want) for e in s["lyapunov"]), s["lyapunov"]


def test_energy_and_what_friction_amplitudes_multiply():
    """The drag's work stands with that of friction; the spread of friction multiplies F and not the drag."""
    scene = "-grid_n 32 -grid_length 8 -model_drag 0.7 -friction_spread 0.4 -friction_spread_length 0.5"
    run(f"{scene} -init_type sine -ts_max_time 2 -ts_rtol 1e-9 -ts_atol 1e-9 -out_displacement -out_frames 3 -out_file run.h5")
    fields, plain = data("run.h5"), scene.replace("-model_drag 0.7", "")
    run(f"{plain} -init_psi 1.3 -init_eta steady -ts_max_time 1e-3 -out_frames 2 -out_file plain.h5 -scene_reduce off")
    at = data("plain.h5")
    p = options(plain) | {"model_v": 1.3}
    own = amplitudes(p, at["psi"][0], at["eta"][0]) if np.ptp(at["psi"][0]) == 0 else None
    assert own is not None and np.ptp(own) > 0.1
    law = System(options(scene), own).law
    psi = fields["psi"][-1]
    lost = 8 / 32 * np.sum(psi * law.force(psi))
    series = {name.split("/")[-1]: fields[name] for name in fields if name.startswith("series/")}
    assert series["power_friction"][-1] == pytest.approx(lost, rel=1e-10)
    energy = series["energy_kinetic"] + series["energy_elastic"]
    power = series["power_input"] - series["power_friction"] - series["power_viscous"]
    gained = np.sum(0.5 * (power[1:] + power[:-1]) * series["dt"][1:])
    assert abs(energy[-1] - energy[0] - gained) < 1e-2 * np.sum(np.abs(power[1:]) * series["dt"][1:])


def test_accuracy():
    scene = "-grid_length 10 -model_drag 0.5 -init_type sine -ts_max_time 2 -out_probes 3"
    asked, _ = run(f"{scene} -accuracy 1e-3")
    fine, _ = run(f"{scene} -grid_n 256 -grid_order 6 -ts_rtol 1e-9 -ts_atol 1e-9")
    assert abs(asked["probes"][0]["psi"] - fine["probes"][0]["psi"]) < 1e-3


@pytest.mark.parametrize("method", ["rk", "arkimex -imex_implicit both"])
def test_the_same_bits_on_any_ranks(method):
    """With what each node has of its own at the borders between ranks."""
    ends = []
    for ranks in (1, 3):
        run(f"-grid_n 48 -grid_length 8 -model_drag 0.5 -friction_spread 0.3 -init_type sine -ts_type {method} -ts_max_time 0.5 -out_frames 2 "
            "-out_file run.h5", ranks=ranks)
        ends.append(read(data("run.h5"), -1))
    assert np.array_equal(*ends)


def test_laws_tabulates_laws_alone():
    plain, beside = (run(f"-friction_law cubic -laws_points 9 -model_drag {c3}", command="laws")[0]["cubic"] for c3 in (0, 2))
    assert plain == beside


def test_refusals():
    refused("-model_drag -1", 2, "model_drag")
    refused("-model_drag nan", 2, "model_drag")
