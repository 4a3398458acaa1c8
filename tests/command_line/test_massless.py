"""The massless chain (model_m 0) from the command line: against scipy, which advances psi where the program advances eta;
against numpy's eigenvalues; against ever smaller masses; what is refused, and what is told when psi would jump."""
import glob

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from calls import check, data, refused, run

CHAIN = "-model_form chain -model_m 0 "
TIGHT = "-ts_rtol 1e-10 -ts_atol 1e-12 "


def d2(psi, ring):
    """Of the blocks along the first axis, between free ends or round a ring."""
    right, left = np.roll(psi, -1, 0), np.roll(psi, 1, 0)
    if not ring:
        right[-1], left[0] = psi[-1], psi[0]
    return right + left - 2 * psi


class Law:
    """Rate-and-state friction of every block, or the cubic: F, its slopes, and the rate g of s = ln theta."""

    def __init__(self, name, a=0.05, b=0.1, D=0.1, amplitude=1.0):
        self.name, self.a, self.b, self.D, self.amplitude = name, a, b, D, amplitude
        self.has_state = name != "cubic"

    def force(self, psi, s):
        """F, F_psi, F_s."""
        if not self.has_state:
            return self.amplitude * (psi**3 / 3 - psi), self.amplitude * (psi**2 - 1), 0 * psi
        e = np.exp((0.6 + self.b * (s - np.log(self.D))) / self.a) / 2
        root = np.sqrt(1 + (psi * e) ** 2)
        return (self.amplitude * self.a * np.arcsinh(psi * e), self.amplitude * self.a * e / root,
                self.amplitude * self.b * psi * e / root)

    def rate(self, psi, s):
        x = psi * np.exp(s) / self.D
        return -x * np.log(x) * np.exp(-s) if self.name == "slip" else np.exp(-s) - psi / self.D


def reference(law, B, k0, k1, v, ring, psi, t_end):
    """psi, eta at the end, from psi_t = (eta_t - F_s g)/(B + F_psi)."""
    n = len(psi)

    def rates(t, y):
        p, s = y[:n], y[n:]
        _, by_psi, by_state = law.force(p, s)
        eta_t = k0 * (v(t) - p) + k1 * d2(p, ring)
        g = law.rate(p, s) if law.has_state else s
        return np.concatenate([(eta_t - by_state * g if law.has_state else eta_t) / (B + by_psi), g])

    start = np.concatenate([psi, np.log(law.D / psi)]) if law.has_state else psi
    end = solve_ivp(rates, (0, t_end), start, method="LSODA", rtol=1e-11, atol=1e-13).y[:, -1]
    psi, s = end[:n], end[n:]
    return psi, B * psi + law.force(psi, s)[0]


def drawn(seed):
    """A scene's options, with scipy's answer; the law, the ends, profiles and the load drawn at random."""
    random = np.random.default_rng(seed)
    name = ("cubic", "ageing", "slip")[seed % 3]
    n, ring, t_end = 5, bool(random.integers(2)), 6.0
    k0, k1, psi0, more = random.uniform(0.3, 0.8), random.uniform(0.1, 0.6), random.uniform(0.1, 0.3), random.uniform(0.2, 0.6)
    B = random.uniform(1.3, 2) if name == "cubic" else random.uniform(0.1, 0.4)
    amplitude = random.uniform(0.8, 1.2, n)
    a = random.uniform(0.04, 0.08, n) if not ring else np.full(n, 0.05)
    law = Law(name, a=a, amplitude=amplitude)
    psi = psi0 + 0.05 * np.sin(2 * np.pi * np.arange(n) / (n if ring else n - 1))
    text = CHAIN + TIGHT + (f"-grid_n {n} -model_k0 {k0!r} -model_k1 {k1!r} -model_zeta {B!r} -init_psi {psi0!r} -init_type sine "
                            f"-init_amplitude 0.05 -ts_max_time {t_end} -load_v 0:0.2,3:0.2,3:{more!r} "
                            f"-out_probes {','.join(map(str, range(n)))} -scene_reduce off ")
    text += "" if ring else "-bc_left free "
    # the last pair of a ring's profile is its first
    text += "-friction_amplitude_profile " + ",".join(f"{i}:{x!r}" for i, x in enumerate(map(float, amplitude))) + " "
    if name != "cubic":
        text += f"-friction_law rate-and-state -state_law {name} "
        if not ring:
            text += "-friction_a_profile " + ",".join(f"{i}:{x!r}" for i, x in enumerate(map(float, a))) + " "
    return text, reference(law, B, k0, k1, lambda t: 0.2 if t < 3 else more, ring, psi, t_end)


@pytest.mark.parametrize("seed, method", [(0, ""), (1, ""), (2, ""), (4, "-ts_type arkimex"), (9, "-ts_type rosw"),
                                          (5, "-ts_type arkimex -imex_implicit none")])
def test_run_agrees_with_scipy(seed, method):
    text, (psi, eta) = drawn(seed)
    s, _ = run(text + method)
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


def matrix(n, law, B, k0, k1, v, held, ring=False):
    """J of eta and s: the two beside each other, blocks between free ends, or the first held at v."""
    coupling = d2(np.eye(n + held), ring)[held:, held:]
    s = np.log(law.D / v) if law.has_state else 0.0
    _, by_psi, by_state = law.force(np.full(n, v), np.full(n, s))
    K, slope = k0 * np.eye(n) - k1 * coupling, B + by_psi
    if not law.has_state:
        return -K / slope
    x = v / law.D  # ageing: g = exp(-s) - psi/D
    return np.block([[-K / slope, K * (by_state / slope)], [np.diag(-1 / law.D / slope), np.diag(by_state / law.D / slope - x)]])


@pytest.mark.parametrize("seed", range(4))
def test_spectrum_is_the_dense_matrix(seed):
    random = np.random.default_rng(100 + seed)
    n, held, v, k0, k1 = 8, seed % 2, random.uniform(0.2, 0.8), random.uniform(0.05, 0.5), random.uniform(0.1, 0.8)
    amplitude = random.uniform(0.6, 1.4, n + held)
    name, B = ("ageing", random.uniform(0.1, 0.5)) if seed < 3 else ("cubic", random.uniform(1.6, 2))
    law = Law(name, a=0.3, b=0.7, D=0.4, amplitude=amplitude[held:])
    text = CHAIN + (f"-grid_n {n + held} -model_k0 {k0!r} -model_k1 {k1!r} -model_zeta {B!r} -model_v {v!r} -bc_left "
                    f"{'velocity' if held else 'free'} -friction_amplitude_profile "
                    + ",".join(f"{i}:{x!r}" for i, x in enumerate(map(float, amplitude))) + " -spectrum_count 99 ")
    if name == "ageing":
        text += "-friction_law rate-and-state -friction_a 0.3 -friction_b 0.7 -friction_D 0.4 "
    exact = sorted(np.linalg.eigvals(matrix(n, law, B, k0, k1, v, held)), key=lambda z: (-z.real, z.imag))
    for method in ("dense", "krylov"):
        s, _ = run(text + f"-spectrum_method {method}", command="spectrum")
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


def test_what_is_refused():
    for arguments, command, words in (
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
        refused(CHAIN + "-grid_n 4 " + arguments, 2, *words, command=command)
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
