"""The massless chain (model_m 0) from the command line: against scipy, which advances psi where the program advances eta;
against numpy's eigenvalues; against ever smaller masses; what is refused, and what is told when psi would jump."""
import glob

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from calls import check, data, refused, run, scene_file
from reference import System, options, words

CHAIN = "-model_form chain -model_m 0 "
TIGHT = "-ts_rtol 1e-10 -ts_atol 1e-12 "


def by_scipy(scene, psi):
    """psi, eta at the end, from psi_t = (eta_t - F_s g)/(B + F_psi)."""
    system = System(scene)
    n, law = system.n, system.law

    def rates(t, y):
        p, s = y[:n], y[n:] if len(y) > n else np.zeros(n)
        by_psi, by_state, _, _ = law.slopes(p, s)
        eta_t = system.K0 * (system.v(t) - p) + system.K1 * system.second(p)
        g = law.rate(p, s) if len(y) > n else s
        return np.concatenate([(eta_t - by_state * g) / (system.B + by_psi), g])[:len(y)]

    y = np.concatenate([psi, law.steady(psi)]) if system.kinds == 3 else psi
    for begin, end in system.plate.pieces(0, system.p["ts_max_time"]):
        system.v = system.plate.after(begin)
        y = solve_ivp(rates, (begin, end), y, method="LSODA", rtol=1e-11, atol=1e-13).y[:, -1]
    return y[:n], system.B * y[:n] + law.force(y[:n], y[n:] if len(y) > n else 0.)


def drawn(seed):
    """A scene's options, with scipy's answer; the law, the ends, profiles and the load drawn at random."""
    random = np.random.default_rng(seed)
    name = ("cubic", "ageing", "slip")[seed % 3]
    n, ring = 5, bool(random.integers(2))
    k0, k1, psi0, more = random.uniform(0.3, 0.8), random.uniform(0.1, 0.6), random.uniform(0.1, 0.3), random.uniform(0.2, 0.6)
    B = random.uniform(1.3, 2) if name == "cubic" else random.uniform(0.1, 0.4)
    p = options(CHAIN + TIGHT) | {
        "grid_n": n, "model_k0": k0, "model_k1": k1, "model_zeta": B, "init_psi": psi0, "init_type": "sine", "init_amplitude": 0.05,
        "ts_max_time": 6, "load_v": f"0:0.2,3:0.2,3:{more!r}", "out_probes": ",".join(map(str, range(n))), "scene_reduce": "off",
        "bc_left": "periodic" if ring else "free", "friction_amplitude": random.uniform(0.8, 1.2, n)}
    a = random.uniform(0.04, 0.08, n)
    if name != "cubic":
        p |= {"friction_law": "rate-and-state", "state_law": name} | ({} if ring else {"friction_a": a})
    return words(p), by_scipy(p, psi0 + 0.05 * np.sin(2 * np.pi * np.arange(n) / (n if ring else n - 1)))


@pytest.mark.parametrize("seed, method", [(0, ""), (1, ""), (2, ""), (4, "-ts_type arkimex"), (9, "-ts_type arkimex -ts_arkimex_type 3"),
                                          (5, "-ts_type arkimex -imex_implicit none")])
def test_run_agrees_with_scipy(seed, method):
    text, (psi, eta) = drawn(seed)
    s, _ = run(text + method.split())
    blocks = len(psi)
    check(s["unknowns"] == blocks * (1 if seed % 3 == 0 else 2), f"{s['unknowns']} unknowns")
    # steps of 1e-10 each, a few hundred of them
    worst = max(np.max(np.abs([p["psi"] for p in s["probes"]] - psi)), np.max(np.abs([p["eta"] for p in s["probes"]] - eta)))
    check(worst < 1e-7, f"seed {seed}: psi and eta differ by {worst}")


def test_rest_is_the_closed_form():
    # one Carlson-Langer block pulled from 0: eta = k0 v t up to 1, then psi solves zeta psi + 1/(1 + psi) = eta
    k0, v, zeta = 0.5, 0.2, 1.5
    run(CHAIN + TIGHT + f"-grid_n 1 -model_k0 {k0} -model_v {v} -model_zeta {zeta} -friction_law carlson-langer -init_psi 0 "
             "-ts_max_time 14 -out_file rest.h5 -out_times 0,5,9.9,10.5,14")

    def psi_of(eta):
        return max(0, ((eta - zeta) + np.sqrt((eta - zeta) ** 2 + 4 * zeta * (eta - 1))) / (2 * zeta)) if eta > 1 else 0

    eta = solve_ivp(lambda t, y: [k0 * (v - psi_of(y[0]))], (10, 14), [1.0], rtol=1e-11, atol=1e-13, t_eval=[10.5, 14]).y[0]
    file = data("rest.h5")
    found, force = file["psi"], file["eta"]
    check(np.all(found[:3] == 0) and np.max(np.abs(force[:3, 0] - [0, 0.5, 0.99])) < 1e-12, f"at rest {found[:3]} {force[:3]}")
    for k in range(2):
        # between steps values are of order 4 in steps of some hundredths
        check(abs(force[3 + k, 0] - eta[k]) < 1e-6 and abs(found[3 + k, 0] - psi_of(eta[k])) < 1e-6, f"sliding, {k}")


def test_order_of_fixed_steps():
    text = (CHAIN + "-grid_n 4 -model_zeta 0.2 -friction_law rate-and-state -init_psi 0.1 -init_type sine -init_amplitude 0.05 "
            "-scene_reduce off -ts_max_time 2 -ts_adapt_type none -out_probes 1 ")
    for method, order in (("-ts_type rk -ts_rk_type 3bs ", 3), ("-ts_type arkimex -ts_arkimex_type 3 ", 3)):
        at = [run(text + method + f"-ts_dt {dt}")[0]["probes"][0]["psi"] for dt in (0.04, 0.02, 0.01)]
        ratio = abs(at[0] - at[1]) / abs(at[1] - at[2])
        check(0.75 < np.log2(ratio) / order < 1.35, f"{method}: differences fall by {ratio}, order {order}")


def test_small_mass_tends_to_none():
    text = "-model_form chain -grid_n 4 -model_zeta 0.3 -friction_law rate-and-state -model_k0 0.2 -friction_spread 0.3 "
    growth = [run(text + f"-model_m {m}", command="spectrum")[0]["growth_rate"] for m in (0, 1e-4, 2e-4)]
    part = (growth[2] - growth[0]) / (growth[1] - growth[0])
    check(abs(part - 2) < 0.01, f"growth rate: twice the mass moves it {part} times as far")
    text += TIGHT + "-init_type sine -init_amplitude 0.05 -ts_max_time 3 -out_probes 1 -ts_type arkimex -init_eta steady "
    psi = [run(text + f"-model_m {m}")[0]["probes"][0]["psi"] for m in (0, 1e-3, 2e-3)]
    part = (psi[2] - psi[0]) / (psi[1] - psi[0])
    check(abs(part - 2) < 0.05, f"psi: twice the mass moves it {part} times as far")


def matrix(system):
    """J of eta and s, the two beside each other, of uniform sliding."""
    n, free, v = system.n, system.free, np.full(system.n, system.p["model_v"])
    by_psi, by_state, g_psi, g_s = (np.diag(x) for x in system.law.slopes(v, system.law.steady(v) if system.kinds == 3 else 0 * v))
    K, mobility = system.K0 * np.eye(n) - system.K1 * system.D, np.linalg.inv(system.B * np.eye(n) + by_psi)
    J = np.block([[-K @ mobility, K @ mobility @ by_state], [g_psi @ mobility, g_s - g_psi @ mobility @ by_state]])
    at = np.concatenate([free, free + n][:system.kinds - 1])
    return J[np.ix_(at, at)]


@pytest.mark.parametrize("seed", range(4))
def test_spectrum_is_the_dense_matrix(seed):
    random = np.random.default_rng(100 + seed)
    n, held, v, k0, k1 = 8, seed % 2, random.uniform(0.2, 0.8), random.uniform(0.05, 0.5), random.uniform(0.1, 0.8)
    amplitude = random.uniform(0.6, 1.4, n + held)
    name, B = ("ageing", random.uniform(0.1, 0.5)) if seed < 3 else ("cubic", random.uniform(1.6, 2))
    p = options(CHAIN) | {"grid_n": n + held, "model_k0": k0, "model_k1": k1, "model_zeta": B, "model_v": v, "spectrum_count": 99,
                          "bc_left": "velocity" if held else "free", "friction_amplitude": amplitude}
    if name == "ageing":
        p |= {"friction_law": "rate-and-state", "friction_a": 0.3, "friction_b": 0.7, "friction_D": 0.4}
    exact = sorted(np.linalg.eigvals(matrix(System(p))), key=lambda z: (-z.real, z.imag))
    for method in ("dense", "krylov"):
        s, _ = run(words(p | {"spectrum_method": method}), command="spectrum")
        found = [complex(e["re"], e["im"]) for e in s["eigenvalues"]]
        check(method == "krylov" or len(found) == len(exact), f"{len(found)} eigenvalues of {len(exact)}")
        worst = max(min(abs(z - e) for e in exact) for z in found)
        check(worst < 1e-9 and abs(found[0].real - exact[0].real) < 1e-9 and s["complete"], f"{method}: {worst}, {found[0]}")


def test_boundary_is_the_quasi_static_one():
    # K = -r b = (v/D)((b - a)/v - zeta), at frequency sqrt(K r/(zeta + a T/v)), T = 1 - O(1e-12)
    a, b, D, v, zeta = 0.05, 0.1, 0.1, 0.2, 0.1
    s, _ = run(CHAIN + f"-grid_n 10 -model_v {v} -model_zeta {zeta} -friction_law rate-and-state -friction_a {a} -friction_b {b} "
               f"-friction_D {D} -boundary_parameter model_k0 -boundary_from 0.01 -boundary_to 1", command="boundary")
    (point,) = s["points"]
    K = v / D * ((b - a) / v - zeta)
    check(abs(point["value"] - K) < 1e-9 and point["kind"] == "hopf", f"{point}")
    check(abs(point["frequency"] - np.sqrt(K * v / D / (zeta + a / v))) < 1e-8, f"frequency {point['frequency']}")


def test_accuracy_holds():
    text = CHAIN + ("-grid_n 6 -model_zeta 0.3 -friction_law rate-and-state -init_type sine -init_amplitude 0.05 -ts_max_time 3 "
                    "-out_probes 2 ")
    s, _ = run(text + "-accuracy 1e-6")
    exact = run(text + TIGHT)[0]["probes"][0]["psi"]
    check(abs(s["probes"][0]["psi"] - exact) < s["error_estimate"] + 1e-9 < 1e-6, f"{s['error_estimate']}")


def test_steps_between_earthquakes_are_long():
    # a block that creeps between 1e-14 and 1e-9 and slips at 1, five times: at the frequency that a mass of 1 would give it, 0.3,
    # explicit steps would be some 1e6
    s, _ = run(CHAIN + "-grid_n 1 -model_k0 0.1 -model_zeta 0.1 -model_v 1e-6 -friction_law rate-and-state -friction_a 0.01 "
               "-friction_b 0.02 -friction_D 1e-3 -friction_psi0 1e-6 -init_psi 1e-9 -ts_max_time 1.2e7 -ts_rtol 1e-8 -ts_atol 1e-10")
    check(s["steps"] < 20000, f"{s['steps']} steps")
    check(s["regime"] == "stick-slip" and s["amplitude"] > 0.1, f"{s['regime']} {s['amplitude']}")


def test_a_hold_takes_few_steps():
    """At rest deviations die away in thousands of units of time, and nothing limits the steps as it does at psi = 1."""
    block = ("-model_form chain -grid_n 1 -bc_left free -model_m 0 -model_k0 1 -model_f0 1 -model_v 1 -friction_law rate-and-state -friction_a 0.01"
             " -friction_b 0.006 -friction_D 1 -init_psi 1 -init_eta steady -load_v 0:1,10:1,10:0 -ts_max_time 1010")
    s, _ = run(block)
    exact, _ = run(block + " -ts_rtol 1e-11 -ts_atol 1e-12")
    assert s["steps"] < 1000 and abs(s["eta_mean"] - exact["eta_mean"]) < 1e-5, f"{s['steps']} {s['eta_mean']} {exact['eta_mean']}"


def creeping_chain(length=1, time=1, force=1, blocks=20):
    """Rate-and-state blocks of laboratory scales, beside each other, whose slips go by decades; in units of these sizes."""
    a, b, f0, zeta, v = 0.008, 0.012, 5e6 / force, 5e6 / force / time * length, 1e-6 / length * time
    D = 1e-5 / length
    k0 = 0.075 * f0 * (b - a) / D
    return (f"-model_form chain -model_m 0 -grid_n {blocks} -bc_left free -model_k0 {k0!r} -model_k1 {5 * k0!r} -model_f0 {f0!r} "
            f"-model_zeta {zeta!r} -model_v {v!r} -friction_law rate-and-state -state_law slip -friction_a {a} -friction_b {b} "
            f"-friction_D {D!r} -friction_psi0 {v!r} -init_type sine -init_psi {v!r} -init_amplitude {0.2 * v!r} -scene_reduce off "
            f"-ts_max_time {100 * D / v!r} -out_probes 0,{blocks - 1} ")


def in_logarithms(summary):
    return np.log([probe["psi"] for probe in summary["probes"]])


def test_explicit_steps_go_by_logarithms():
    """Explicit steps move friction's own force in place of eta, from which psi follows by a formula: errors are of ln psi and have
    no unit. (ts_rtol 1e-4 with ts_atol 1e-10 once ended with velocities that no force had.)"""
    exact, _ = run(creeping_chain() + "-ts_rtol 1e-11")
    for rtol, allowed in ((1e-4, 1e-3), (1e-6, 1e-5)):  # ten of what one step may err by
        s, told = run(creeping_chain() + f"-ts_rtol {rtol} -ts_atol 1e-10")
        off = np.max(np.abs(in_logarithms(s) - in_logarithms(exact)))
        check(off < allowed, f"{rtol}: ln psi is off by {off}")
        check("ts_atol has no effect" in told, told)
        # in other units the same steps, but for round-off
        other, _ = run(creeping_chain(length=1e-6, time=3600, force=1e6) + f"-ts_rtol {rtol}")
        check(abs(other["steps"] - s["steps"]) <= 0.02 * s["steps"], f"{rtol}: {s['steps']} steps, in other units {other['steps']}")


@pytest.mark.parametrize("method", ("", "-ts_type rk -ts_rk_type 7vr ", "-ts_type rk -ts_rk_type 3bs "))
def test_frames_within_explicit_steps(method):
    times = ",".join(repr(10 * part) for part in (0.1234, 3.2, 9.71, 30.3, 55.5, 97.01))
    values = []
    for more in ("-ts_rtol 1e-11 ", method + "-ts_rtol 1e-6 "):
        run(creeping_chain(blocks=5) + more + "-out_file f.h5 -out_times " + times)
        values.append((np.log(data("f.h5")["psi"]), data("f.h5")["eta"]))
    (psi, eta), (near, force) = values
    check(np.max(np.abs(psi - near)) < 1e-4 and np.max(np.abs(eta - force)) < 1e-6, f"{np.max(np.abs(psi - near))}")


@pytest.mark.ranks
def test_tiles_of_explicit_steps_on_ranks():
    """More nodes than one tile holds, with amplitudes of their own, a held end and a plate that goes faster."""
    text = (creeping_chain(blocks=1100) + "-bc_left velocity -bc_left_value 1e-6 -friction_amplitude_profile 0:1,500:1.1,1099:0.9 "
            "-load_v 0:1e-6,20:2e-6 -ts_max_time 30 -init_amplitude 1e-7 -out_frames 3 -out_file ")
    run(text + "one.h5")
    run(text + "two.h5", 2)
    check(all(np.array_equal(a, b) for a, b in zip(fields("one.h5"), fields("two.h5"))), "the ranks' bits differ")
    run(text + "library.h5 -rk_fused false -ts_rtol 1e-9")
    psi, exact = np.log(fields("one.h5")[0]), np.log(fields("library.h5")[0])
    check(np.max(np.abs(psi - exact)) < 1e-4, f"ln psi differs from Newton's by {np.max(np.abs(psi - exact))}")


def test_what_is_refused():
    for arguments, command, parts in (
            ("-friction_law carlson-langer -model_zeta 0.9", "run", ["falls with velocity", "model_m > 0"]),
            ("-friction_law coulomb -model_zeta 2", "run", ["falls from its threshold to 0.5"]),
            ("-friction_law coulomb -friction_fd 1", "run", ["zeta/f0 = 0"]),
            ("-model_zeta 2 -model_nu 0.1", "run", ["-model_nu 0.1"]),
            ("-model_zeta 2 -imex_implicit friction", "run", ["imex_implicit friction"]),
            ("-model_zeta 2 -ts_type bdf", "run", ["ts_type bdf"]),
            ("-model_zeta 2 -ts_type leapfrog", "run", ["ts_type leapfrog"]),
            ("-model_zeta 2 -init_eta 0.3 -init_psi 0.2", "run", ["one follows from the other"]),
            ("-model_zeta 0.5", "run", ["would jump"]),
            ("-model_zeta 2 -lyapunov_count 1", "run", ["lyapunov_count"]),
            ("-model_zeta 2", "cycle", ["-model_m 0"]),
            ("-model_zeta 2 -chart_kind limits", "chart", ["limits"])):
        refused(CHAIN + "-grid_n 4 " + arguments, 2, *parts, command=command)
    _, told = run(CHAIN + "-grid_n 4 -model_zeta 0.5", command="spectrum", code=1)
    check("zeta/f0 + F_psi = -0.46" in told, told)


@pytest.mark.parametrize("more", ("-model_v 0.2", "-model_v -1", "-model_v 0.2 -ts_adapt_type none -ts_dt 0.01"))
def test_a_jump_is_told(more):
    # zeta = 1/2: on the outer branch |psi| > 1/sqrt(2), which the motion leaves
    s, told = run(CHAIN + f"-grid_n 4 -model_zeta 0.5 -init_psi 1 {more}", code=1)
    check(s["status"] != "done" and "does not say what psi is" in told and "model_m > 0" in told, told)


def fields(path):
    file = data(path)
    return file["psi"], file["eta"]


@pytest.mark.ranks
def test_ranks_and_restart_agree():
    text = (CHAIN + "-grid_n 9 -bc_left velocity -bc_left_value 0.3 -model_zeta 0.2 -friction_law rate-and-state -friction_spread 0.2 "
            "-init_type sine -init_amplitude 0.05 -init_psi 0.2 -ts_rtol 1e-9 ")
    ends = []
    for ranks, method in ((1, ""), (2, ""), (1, "-ts_type arkimex -ts_rtol 1e-4 "), (2, "-ts_type arkimex -ts_rtol 1e-4 ")):
        run(text + method + "-ts_max_time 2 -out_file whole.h5 -out_frames 2 -out_checkpoint_every 1", ranks)
        ends.append(fields("whole.h5"))
    check(all(np.array_equal(a, b) for a, b in zip(ends[0], ends[1])), "explicit steps on 2 ranks")
    # Newton's method stops at 1e-9 of the first residual
    check(all(np.max(np.abs(a - b)) < 1e-7 for a, b in zip(ends[2], ends[3])), "implicit steps on 2 ranks")
    run(text + "-ts_max_time 1 -out_file part.h5 -out_times 0,1 -out_checkpoint_every 1 -out_checkpoint_keep 99")
    chosen = sorted(glob.glob("part.chk-*.h5"))[0]
    run(f"-restart {chosen} -ts_max_time 2 -out_file on.h5 -out_times 2")
    check(all(np.array_equal(a[-1], b[-1]) for a, b in zip(ends[0], fields("on.h5"))), "restart")


def test_a_runaway_is_called_one():
    # below the critical stiffness (b - a)/D = 2 a block without mass is ever faster, and comes to no end within a finite time
    scene = "-model_form chain -model_m 0 -grid_n 1 -bc_left free -friction_law rate-and-state -friction_a 0.01 -friction_b 0.03 " \
            "-friction_D 0.01 -model_k0 0.5 -model_v 0.01 -ts_max_time 100 "
    refused(scene + "-init_psi 0.011 -init_eta steady -init_state steady", 1, "a block runs away", "model_m > 0")
    # at once: steps beyond all numbers are taken again and shorter, until they are too short
    refused(f"{scene_file('published/rice-ruina')} -init_psi 10", 1, "a block runs away", "model_zeta > 0, or model_m > 0")
    # the same from sliding with another state; SciPy's Radau in ln psi comes to 1e12 at t = 18.1604
    _, told = run(scene + "-init_psi steady -init_eta steady -init_state 0.5", code=1)
    check("at t = 18.160" in told and "a block runs away" in told, told)


def test_laboratory_sliders_run_to_their_end():
    """Beside mu0 = 0.6 the direct effect a is small: psi goes by the exponential of eta/a, and the first step of a slip that is too
    long leads beyond all numbers, or below them. Periods: SciPy's Radau in ln psi and ln theta."""
    slider = ("-model_form chain -grid_n 1 -bc_left free -model_m 0 -model_k0 9.999e8 -model_f0 1e7 -model_zeta 5e6 -model_v 1e-6 "
              "-friction_law dieterich -friction_a 0.005 -friction_b 0.01 -friction_D 2e-5 -friction_mu0 0.6 -friction_psi0 1e-6 "
              "-init_psi 1.01e-6 -init_state 20 -ts_max_time 6000 ")
    for more, period in (("", 773.97466), ("-friction_law rate-and-state", 773.97466), ("-state_law slip", 677.34727),
                         ("-ts_type rosw", 773.97466), ("-ts_type arkimex", 773.97466), ("-accuracy 1e-6", 773.97466)):
        s, _ = run(slider + more)
        part = 1e-4 if "accuracy" in more else 0.01  # an error of eta of 1e-6 is 0.01 s of the plate's pull
        check(s["status"] == "done" and s["period_error"] < part * period, f"{more}: {s['status']}, {s['period_error']}")
        off = abs(s["period"] - period)
        check(off < 1e-5 * period and off < s["period_error"], f"{more}: {s['period']}")
    # beside a viscous bed, where a slip is slow and B psi outweighs the direct effect early
    s, _ = run("-model_form chain -grid_n 1 -bc_left free -model_m 0 -model_k0 1e6 -model_f0 5e7 -model_zeta 2.5e14 -model_v 1e-9 "
               "-friction_law rate-and-state -friction_a 0.01 -friction_b 0.02 -friction_D 1e-2 -friction_psi0 1e-9 -init_psi 1.1e-9 "
               "-ts_max_time 4e11")
    check(s["status"] == "done", f"{s['status']}")


def test_friction_that_a_slip_loses():
    """15 of its e-folds take friction all, (b - a) 17 > mu0, and under the slip law it comes back only as the block creeps over D at v,
    with psi held by zeta alone: deviations die away at k0/zeta = 2000 a second meanwhile, for 1500 s. Explicit steps of three such
    times would be a million; the ageing law heals at once. The period: SciPy's Radau in ln psi and ln theta."""
    slider = ("-model_form chain -grid_n 1 -bc_left free -model_m 0 -model_k0 1e10 -model_f0 4e7 -model_zeta 5e6 -model_v 6e-8 "
              "-friction_law rate-and-state -friction_a 0.013 -friction_b 0.07 -friction_D 9e-5 -friction_mu0 0.6 -friction_psi0 6e-8 "
              "-init_psi 6.1e-8 -init_state 1500 -init_eta steady -ts_max_time 4e5 ")
    for more, method in (("-state_law slip", "arkimex:4"), ("-state_law slip -model_v -6e-8 -init_psi -6.1e-8", "arkimex:4"),
                         ("-state_law ageing", "rk:5dp")):
        s, _ = run(slider + more)
        check(s["status"] == "done" and s["method"] == method and s["steps"] < 1e4, f"{more}: {s['method']}, {s['steps']}")
        check("ageing" in more or abs(s["period"] / 48209.3056 - 1) < 1e-5, f"{more}: {s['period']}")
    # named all the same: half a million steps for each slip (measured: 0.4), and that is said
    for more, said in (("-state_law slip", True), ("-state_law ageing", False)):
        _, told = run(f"{slider} {more} -ts_type rk -ts_max_steps 3")
        check(("5e+05 steps for each slip; take ts_type arkimex" in told) == said, f"{more}: {told}")
    # with mass what is explicit beside friction, a neighbour's pull, is as fast
    for more, implicit in (("-state_law slip", "both"), ("-state_law ageing", "friction")):
        s, _ = run(f"{slider} -model_m 250 -grid_n 2 -model_k1 5e10 -scene_reduce off {more}")
        check(s["status"] == "done" and s["implicit"] == implicit and s["steps"] < 2e4, f"{more}: {s['implicit']}, {s['steps']}")


def drawn_oscillation(rng):
    """A chain of one or two blocks on springs below the critical stiffness, K = (v/D) [(b - a)/v - zeta/f0], both state laws, both signs."""
    n, a, sign, law = int(rng.integers(1, 3)), 10**rng.uniform(-3, -1), rng.choice([-1, 1]), rng.choice(["ageing", "slip"])
    b, D, v = a * rng.uniform(1.3, 2), 10**rng.uniform(-5, 0), 10**rng.uniform(-6, 0)
    zeta = 10**rng.uniform(-3, -0.5) * (b - a) / v
    k0 = ((b - a) - zeta * v) / D * (rng.uniform(0.8, 0.95) if law == "slip" else rng.uniform(0.5, 0.9))
    k1 = k0 * rng.uniform(0.2, 1) if n > 1 else 0
    return {"model_form": "chain", "model_m": 0, "grid_n": n, "bc_left": "free", "model_k0": k0, "model_k1": k1, "model_zeta": zeta,
            "model_v": v * sign, "friction_law": "rate-and-state", "state_law": law, "friction_a": a, "friction_b": b, "friction_D": D,
            "friction_mu0": 0.6, "friction_psi0": v, "init_psi": 1.1 * v * sign, "cycle_cell": 0}


def oscillation(p):
    """Period and range of psi of what its motion settles on, of the unknowns ln |psi| and ln theta, all blocks moving alike."""
    system = System(p | {"grid_n": 1})
    side, law, v, K0, B = np.sign(p["model_v"]), system.law, p["model_v"], system.K0, system.B

    def rates(t, y):
        psi = side * np.exp(y[:1])
        by_psi, by_state, _, _ = law.slopes(psi, y[1:])
        g = law.rate(psi, y[1:])
        return np.concatenate([(K0 * (v - psi) - by_state * g) / (B + by_psi) / psi, g])

    def section(t, y):
        return y[0] - np.log(abs(v))
    section.direction, section.terminal = 1, True

    def turns(t, y):
        return rates(t, y)[0]
    turn = 2 * np.pi * p["friction_D"] / abs(v)
    y, periods = np.r_[np.log(1.1 * abs(v)), law.steady(np.array([1.1 * v]))], [np.inf]
    for _ in range(60):
        y = y + 1e-9 * turn * rates(0, y)  # off the section
        flow = solve_ivp(rates, (0, 1000 * turn), y, method="LSODA", rtol=1e-11, atol=1e-12, events=(section, turns))
        y, extremes = flow.y_events[0][0], flow.y_events[1][:, 0]
        periods.append(flow.t[-1] + 1e-9 * turn)
        settled = abs(periods[-1] / periods[-2] - 1)
        if settled < 1e-10:
            break
    return periods[-1], settled, np.exp(extremes.max()), np.exp(extremes.min())


def test_cycles_against_scipy(scenes):
    """Period and range; and one multiplier of a block is 1, another smaller."""
    for index, p in scenes(drawn_oscillation, 66, short=2):
        period, settled, fastest, slowest = oscillation(p)
        text = words(p)
        found, said = run(text, command="cycle")
        check(abs(found["period"] / period - 1) < 1e-8 + 10 * settled, f"{index}: {text}: {found['period']}, {period} ({settled:.0e})")
        high, low = (found["psi_max"], found["psi_min"]) if p["model_v"] > 0 else (-found["psi_min"], -found["psi_max"])
        check(abs(high / fastest - 1) < 1e-5 + settled and abs(low / slowest - 1) < 1e-5 + settled,
              f"{index}: {high, fastest}, {low, slowest}")
        check(found["unknowns"] == 2 * p["grid_n"] == len(found["multipliers"]) and found["multiplier_error"] < 1e-7,
              f"{index}: {found['multipliers']}")


def of_wave(p, y, period, kappa2):
    """Multipliers of a wave on the uniform motion that begins at (psi, stored state) y: its deviation of (eta, state) carried along."""
    system = System(p | {"grid_n": 1, "bc_left": "free", "cycle_cell": 0})
    law, K0, B = system.law, system.K0, system.B
    K = K0 + p["model_k1"] / p.get("model_f0", 1) * kappa2

    def rates(t, y):
        side = np.sign(p["model_v"])
        psi, s, Y = side * np.exp(y[:1]), y[1:2], y[2:].reshape(2, 2)
        by_psi, by_state, g_psi, g_s = (float(x[0]) for x in law.slopes(psi, s))
        g, mobility = float(law.rate(psi, s)[0]), 1 / (B + by_psi)
        J = np.array([[-K * mobility, K * mobility * by_state], [g_psi * mobility, g_s - g_psi * mobility * by_state]])
        return np.concatenate([[(K0 * (p["model_v"] - psi[0]) - by_state * g) * mobility / psi[0], g], (J @ Y).ravel()])
    start = np.concatenate([[np.log(abs(y[0])), y[1]], np.eye(2).ravel()])
    end = solve_ivp(rates, (0, period), start, method="LSODA", rtol=1e-11, atol=1e-13).y[:, -1]
    check(np.abs(end[:2] - start[:2]).max() < 1e-5, f"the motion misses itself by {end[:2] - start[:2]}")
    return np.linalg.eigvals(end[2:].reshape(2, 2))


def waves_of(p):
    found, _ = run(words(p | {"cycle_spectrum": "true", "cycle_wavenumbers": 8}) + ["-out_file", "w.h5"], command="cycle")
    file = data("w.h5")
    return found, file, file["spectrum/wavenumber"], file["spectrum/multiplier_re"] + 1j * file["spectrum/multiplier_im"]


def test_waves_on_cycles(scenes):
    """Of one node against SciPy; of a cell of two as of one, whose waves it has twice over."""
    for index, drawn in scenes(drawn_oscillation, 67, short=2):
        p = {name: value for name, value in drawn.items() if name != "bc_left"}
        p |= {"grid_n": 8, "cycle_cell": 1, "model_k1": p["model_k0"] * 10**np.random.default_rng(index).uniform(-1, 1.5)}
        found, file, k, waves = waves_of(p)
        state = np.log(file["theta"][0, 0])
        for at in (0, 3, 7):
            exact = of_wave(p, (file["psi"][0, 0], state), found["period"], 4 * np.sin(k[at] / 2)**2)
            for one in exact:
                off = np.abs(waves[at] - one).min()
                check(off < 1e-6 * max(1, abs(one)), f"{index}: {words(p)}: wave {k[at]}: {waves[at]}, SciPy {exact}")
        _, _, k2, pair = waves_of(p | {"cycle_cell": 2})
        for at in (1, 7):
            both = np.concatenate([of_wave(p, (file["psi"][0, 0], state), found["period"], 4 * np.sin(x / 2)**2)
                                   for x in (k2[at], k2[at] - np.pi)])
            for one in both:
                off = np.abs(pair[at] - one).min()
                check(off < 1e-5 * max(1, abs(one)), f"{index}: {words(p)}: in a cell of two {k2[at]}: {pair[at]}, SciPy {both}")


def test_multipliers_by_the_trace():
    """Of one block the product of both multipliers is exp of the integral of the trace; and those of a small mass tend to them."""
    p = {"model_form": "chain", "model_m": 0, "grid_n": 1, "bc_left": "free", "model_k0": 0.3, "model_zeta": 0.05, "model_v": 1, "friction_law":
         "rate-and-state", "friction_a": 0.5, "friction_b": 1.0, "friction_D": 1, "friction_mu0": 5, "friction_psi0": 1, "cycle_cell": 0, "init_psi": 1.2}
    found, _ = run(words(p), command="cycle")
    system, law = System(p), System(p).law

    def rates(t, y):
        psi, s = np.exp(y[:1]), y[1:2]
        by_psi, by_state, g_psi, g_s = law.slopes(psi, s)
        g, resists = law.rate(psi, s), system.B + by_psi
        # d psi_eta = 1/resists, d psi_s = -by_state/resists: the trace of (eta, s)
        trace = -system.K0 / resists + g_s - g_psi * by_state / resists
        return np.concatenate([(system.K0 * (system.v(t) - psi) - by_state * g) / resists / psi, g, trace])

    def section(t, y):
        return y[0]
    section.direction = 1
    flow = solve_ivp(rates, (0, 200), [np.log(1.2), *law.steady(np.array([1.2])), 0], method="LSODA", rtol=1e-11, atol=1e-11, events=section)
    period = np.diff(flow.t_events[0])[-1]
    product = np.exp(np.diff(flow.y_events[0][:, 2])[-1])
    check(abs(found["period"] / period - 1) < 1e-8, f"{found['period']}, {period}")
    mine = np.prod([m["re"] for m in found["multipliers"]])
    check(abs(mine - product) < 1e-6 * abs(product) + 1e-12, f"{mine}, {product}")
    apart = []
    for m in (1e-3, 1e-4):
        heavy, _ = run(words(p | {"model_m": m}), command="cycle")
        apart.append(abs(heavy["period"] / found["period"] - 1))
    check(apart[1] < 0.15 * apart[0] < 1e-2, f"{apart}")


def test_branches_without_mass():
    """In zeta, up to the Hopf point where K = (v/D) [(b - a)/v - zeta/f0]."""
    p = {"model_form": "chain", "model_m": 0, "grid_n": 1, "bc_left": "free", "model_k0": 0.3, "model_zeta": 0.05, "model_v": 1, "friction_law":
         "rate-and-state", "friction_a": 0.5, "friction_b": 1.0, "friction_D": 1, "friction_mu0": 5, "friction_psi0": 1, "init_psi": 1.2}
    found, _ = run(words(p | {"cycle_continue": "model_zeta", "cycle_to": 0.3}), command="cycle")
    hopf = [point["value"] for point in found["special"] if point["kind"] == "hopf"]
    check(len(hopf) == 1 and abs(hopf[0] - 0.2) < 1e-6, f"{found['special']}, {found['branch']['end']}")
    refused("-model_form chain -model_m 0 -model_zeta 2 -friction_law stribeck -friction_stick regularised -friction_eps 1 "
            "-state_law healing", 2, "model_m", "rate-and-state", command="cycle")
