"""Unequal blocks and layered media (model_m_profile, model_c_profile, ...) in every command: against dense matrices and motions
of numpy and scipy on random scenes, and exact relations."""
import os

import numpy as np
import pytest
from scipy.optimize import brentq

from calls import check, data, refused, run
from reference import Stick, System, options, read, words

STRICT = "-ts_rtol 1e-10 -ts_atol 1e-11"
RATE = {"friction_law": "rate-and-state", "friction_a": 0.2, "friction_b": 0.3, "friction_D": 0.6}
LAWS = ({}, RATE, {"friction_law": "carlson-langer", "friction_stick": "regularised", "friction_eps": 0.3})


def links(p, n):
    return n if p["bc_left"] == "periodic" else n - 1


def unequal(seed, n, **more):
    """A chain of n blocks that differ in everything."""
    rng = np.random.default_rng([31, seed, n])
    p = {"model_form": "chain", "grid_n": n, "bc_left": ["free", "periodic", "velocity"][seed % 3] if n > 2 else "free",
         "model_v": float(rng.uniform(0.3, 0.9)), "model_f0": float(rng.uniform(0.7, 1.5))}
    if p["bc_left"] == "velocity":
        p["bc_right"] = "free"
        p["bc_left_value"] = p["model_v"] + 0.2
    drawn = {"model_m": rng.uniform(0.4, 2, n), "model_k0": rng.uniform(0.1, 1, n), "model_k1": rng.uniform(0.1, 1.5, links(p, n)),
             "model_zeta": rng.uniform(0, 0.3, n)}
    for k, (name, values) in enumerate(drawn.items()):  # all of them, or one alone
        if seed % 5 == 0 or seed % 5 == k + 1:
            p[name] = values
    return p | more


def layered(seed, n=24, **more):
    """A continuum of which c, delta or both differ."""
    rng = np.random.default_rng([32, seed])
    ring = seed % 2 == 0
    p = {"grid_n": n, "grid_length": 6., "grid_order": 2, "bc_left": "periodic" if ring else "free", "model_gamma": 2.,
         "model_v": float(rng.uniform(0.3, 0.9)), "model_delta_sign": "derived" if seed % 4 < 2 else "printed"}
    if seed % 3 != 1:
        p["model_c"] = rng.uniform(0.5, 2, links(p, n))
    if seed % 3 != 2:
        p["model_delta"] = rng.uniform(0.1, 0.5, n)
    return p | more


def words_of(p):
    """The command line of a scene: of a layered one profiles with the values at nodes and half-way between them."""
    if p.get("model_form") == "chain":
        return words(p)
    h, text = p["grid_length"] / links(p, p["grid_n"]), {}
    for name, value in p.items():
        if isinstance(value, np.ndarray):
            x = h * (np.arange(len(value)) + (0.5 if name == "model_c" else 0))
            text[name + "_profile"] = ",".join(f"{float(a)!r}:{float(b)!r}" for a, b in zip(x, value))
        else:
            text[name] = value
    return words(text)


def scene(seed):
    p = layered(seed) if seed % 2 else unequal(seed // 2, [2, 3, 7, 12, 40][seed // 2 % 5])
    return p | LAWS[seed % 3]


def distances(found, exact):
    """How far each eigenvalue found lies from the nearest of the exact ones that are left."""
    left = list(exact)
    return [abs(z - left.pop(int(np.argmin(np.abs(np.array(left) - z))))) for z in found]


def apart(found, exact):
    return max(distances(found, exact))


def values_of(summary, name="eigenvalues"):
    return [complex(e["re"], e["im"]) for e in summary[name]]


# ---- sliding ----

@pytest.mark.parametrize("seed", range(10))
def test_spectrum_is_the_dense_matrix(seed):
    p = scene(seed)
    system = System(p)
    exact = system.eigenvalues()
    s, _ = run([*words_of(p), "-spectrum_count", len(exact), "-spectrum_method", "dense", "-spectrum_refine", "off"], command="spectrum")
    found = values_of(s)
    check(len(found) == len(exact), f"{len(found)} eigenvalues of {len(exact)}")
    worst = apart(found, exact)
    check(worst < 1e-9 * np.abs(exact).max(), f"eigenvalues differ by {worst}: {p}")
    check(abs(s["growth_rate"] - exact[0].real) < 1e-9, "growth rate")
    # by Krylov's method, whose count says that none is missing
    s, _ = run([*words_of(p), "-spectrum_count", 4, "-spectrum_method", "krylov", "-spectrum_refine", "off"], command="spectrum")
    check(abs(s["growth_rate"] - exact[0].real) < 1e-8 and s["complete"], f"krylov: {s['growth_rate']} for {exact[0]}")


def test_two_unequal_masses():
    # m_i x'' = -k0 x_i - b m..., friction of slope s: (m1 z^2 + s z + k)(m2 z^2 + s z + k) = k1^2, k = k0 + k1
    m, k0, k1 = (0.5, 1.7), 0.3, 0.8
    for v in (1, 0.6):  # at v = 1 friction does nothing to first order: the frequencies of the undamped pair
        slope = v * v - 1
        s, _ = run(f"-model_form chain -bc_left free -grid_n 2 -model_k0 {k0} -model_k1 {k1} -model_v {v} "
                   f"-model_m_profile 0:{m[0]},1:{m[1]} -spectrum_count 4", command="spectrum")
        found = values_of(s)
        if v == 1:
            k = k0 + k1
            total, product = k * (m[0] + m[1]) / (2 * m[0] * m[1]), (k * k - k1 * k1) / (m[0] * m[1])
            w2 = [total + way * np.sqrt(total * total - product) for way in (1, -1)]
            exact = [sign * 1j * np.sqrt(w) for w in w2 for sign in (1, -1)]
        else:
            one, two = ([mass, slope, k0 + k1] for mass in m)
            exact = np.roots(np.polyadd(np.polymul(one, two), [-k1 * k1]))
        check(apart(found, exact) < 1e-12, f"v = {v}: {found}, {exact}")


@pytest.mark.parametrize("seed, parameter, low, high", [(0, "model_v", 0.5, 1.2), (6, "model_zeta_factor", 0.2, 6), (10, "model_v", 0.5, 1.2)])
def test_boundary(seed, parameter, low, high):
    """Where the largest growth rate of the dense matrix passes zero, and what grows out of it."""
    p = unequal(seed // 2, 6) | {"bc_left": "free", "model_k1": 0.5, "model_zeta": 0.05 + np.arange(6) / 20, "model_f0": 1}
    p.pop("bc_right", None), p.pop("bc_left_value", None)

    def at(x):
        return p | ({parameter: x} if parameter == "model_v" else {"model_zeta": x * p["model_zeta"]})
    exact = brentq(lambda x: System(at(x)).eigenvalues()[0].real, low, high, xtol=1e-12)
    s, _ = run([*words_of(p), "-boundary_parameter", parameter, "-boundary_from", low, "-boundary_to", high, "-boundary_of", "sliding"],
               command="boundary")
    check(len(s["points"]) == 1 and abs(s["points"][0]["value"] - exact) < 1e-8, f"{s['points']}, by numpy {exact}")
    check(s["points"][0]["criticality"] == "supercritical", "of the cubic every Hopf point is")


# ---- motions ----

@pytest.mark.parametrize("seed", range(6))
def test_runs(seed):
    p = scene(seed + 3)
    text = " ".join(words_of(p)) + f" -init_psi 0.4 -init_eta 0.3 -init_noise 0.5 -ts_max_time 4 -out_frames 2 -out_file run.h5 {STRICT}"
    run(text)
    fields = data("run.h5")
    end = System(p).follow(read(fields, 0), 0, 4, rtol=1e-11, atol=1e-12)
    error = np.abs(end - read(fields, 1)).max()
    check(error < 1e-6, f"{p}: {error}")
    for name in ("model_m", "model_k0", "model_zeta", "model_delta"):
        check(name not in p or np.ndim(p[name]) == 0 or np.allclose(fields[name], p[name], rtol=1e-14), f"{name} is not in the file")


METHODS = [
    "rk", "rk -rk_fused false", "arkimex -imex_implicit friction", "arkimex -imex_implicit wave", "arkimex -imex_implicit both",
    "arkimex -imex_implicit friction -rk_fused false", "rosw", "bdf", "theta -ts_theta_theta 0.5",
    "leapfrog"]


@pytest.mark.parametrize("method", METHODS)
def test_every_method(method, request):
    """On a chain or on layers in turn; with --scenes on both."""
    both = ("chain", "continuum")
    for form in both if request.config.getoption("--scenes") else [both[METHODS.index(method) % 2]]:
        every_method(method, form)


def every_method(method, form):
    p = unequal(5, 20) if form == "chain" else layered(3) | {"grid_length": 12.}
    tolerance = 1e-9 if method == "bdf" else 1e-8
    tight = "-ts_adapt_type none -ts_dt 1e-3" if method[:5] in ("leapf", "theta") else f"-ts_rtol {tolerance} -ts_atol {tolerance}"
    run(f"{' '.join(words_of(p))} -init_psi 0.1 -init_noise 0.4 -ts_max_time 1 -ts_type {method} {tight} -out_frames 2 -out_file run.h5")
    fields = data("run.h5")
    end = System(p).follow(read(fields, 0), 0, 1, rtol=1e-10, atol=1e-11)
    # methods of order 2 at steps of 1e-3: the start is rough, and third derivatives, the cube of the fastest frequency, 5 to 8,
    # are some hundred, times 1e-6/12 each unit of time; else some hundred steps of 1e-8 each, of bdf some thousand of 1e-9
    check(np.abs(end - read(fields, 1)).max() < 1e-4, f"{method}: {np.abs(end - read(fields, 1)).max()}")


@pytest.mark.parametrize("law, kind", [("carlson-langer", "free"), ("coulomb", "periodic"), ("coulomb", "velocity"), ("coulomb", "layers"),
                                       ("carlson-langer -state_law healing -state_t_h 3 -state_tau_inf 1.3", "free")])
def test_exact_stick(law, kind):
    """Slips and rests of unequal blocks, node by node with SciPy; in clusters too."""
    law = options("-friction_law " + law)
    if kind == "layers":
        p = layered(3, 9) | {"model_v": 0.3}
    else:
        p = unequal(0, 5, model_v=0.3)
        p.pop("bc_right", None), p.pop("bc_left_value", None)
        p["bc_left"] = kind
        p["model_k1"] = np.resize(p["model_k1"], links(p, 5))
        if kind == "velocity":
            p |= {"bc_left_value": 0.3, "bc_right": "free"}
    p |= {name: value for name, value in law.items() if name.startswith(("friction", "state"))}
    end_time = 40 if "state_law" in law else 12  # thresholds that grow at rest let go later
    text = " ".join(words_of(p)) + f" -init_psi 0 -init_eta 0 -ts_max_time {end_time} -out_frames 2 {STRICT}"
    for clusters in ("off", "on"):
        run(f"{text} -stick_clusters {clusters} -out_file run.h5")
        fields = data("run.h5")
        if clusters == "off":
            motion = Stick(System(p), read(fields, 0), rtol=1e-11, atol=1e-12)
            end = motion.advance(end_time)
            check(motion.changes >= 4, "nothing slips")
        check(np.abs(end - read(fields, 1)).max() < 1e-6, f"clusters {clusters}: {np.abs(end - read(fields, 1)).max()}")


def series_of(fields):
    return {name.split("/")[-1]: values for name, values in fields.items() if name.startswith("series/")}


@pytest.mark.parametrize("form", ["chain", "continuum"])
def test_energy(form):
    """Energies and powers are sums of the definition at every step; of fixed steps, the energy changes by the work, and what the
    trapezium rule misses of that falls like the square of the step."""
    if form == "chain":
        p = unequal(0, 8) | {"bc_left": "free"}
        p["model_k1"] = p["model_k1"][:7]
    else:
        p = layered(3)
    p.pop("bc_right", None), p.pop("bc_left_value", None)
    system, misses = System(p), []
    weight = np.full(system.n, system.h)
    if form == "continuum":
        weight[[0, -1]] /= 2
    for dt in (0.01, 0.005):
        run(f"{' '.join(words_of(p))} -init_psi 0.3 -init_noise 0.2 -init_seed 4 -ts_max_time 2 -ts_adapt_type none -ts_dt {dt} "
            "-ts_type rk -out_displacement -out_frames 2 -out_file run.h5")
        fields = data("run.h5")
        s = series_of(fields)
        energy = s["energy_kinetic"] + s["energy_elastic"]
        power = s["power_input"] - s["power_friction"] - s["power_viscous"]
        misses.append(abs(energy[-1] - energy[0] - np.sum((power[1:] + power[:-1]) / 2) * dt))
        psi, eta = fields["psi"][-1], fields["eta"][-1]
        damping = np.broadcast_to(system.sd / system.A, system.n)
        z = eta + damping * psi
        w = np.linalg.solve(np.eye(system.n) * system.K0 - system.K1 * system.D, -z)
        for name, exact in (("energy_kinetic", psi**2 / (2 * system.A)), ("energy_elastic", -w * z / 2), ("power_input", p["model_v"] * z),
                            ("power_friction", psi * (psi**3 / 3 - psi)), ("power_viscous", (system.B + damping) * psi**2)):
            want = np.sum(weight * exact)
            check(abs(s[name][-1] - want) < 1e-9 * (1 + abs(want)), f"{name}: {s[name][-1]} for {want}")
    check(misses[0] < 1e-3 and 1.9 < np.log2(misses[0] / misses[1]) < 2.1, f"the balance misses {misses}")


def test_displacement_and_events():
    """The springs carry the displacement; events of clusters are those of whole steps."""
    p = unequal(0, 8) | {"bc_left": "free", "model_v": 0.03}
    p["model_k1"] = p["model_k1"][:7]
    p.pop("bc_right", None), p.pop("bc_left_value", None)
    text = (" ".join(words_of(p)) + " -friction_law carlson-langer -friction_sigma 0.05 -init_psi 0 -init_eta 0.1 -init_noise 0.05 "
            f"-ts_max_time 150 -out_frames 4 -out_displacement {STRICT} -out_events")
    run(text + " -out_file run.h5 -stick_clusters off")
    found, system = data("run.h5"), System(p)
    stiffness = np.diag(np.broadcast_to(system.K0, system.n)) - system.K1 * system.D
    for k, t in enumerate(found["t"]):
        chi = np.linalg.solve(stiffness, system.K0 * p["model_v"] * t - found["eta"][k])
        check(np.allclose(found["chi"][k], chi, rtol=1e-9, atol=1e-9), f"displacement at t = {t}")
    run(text + " -out_file clusters.h5 -stick_clusters on")
    other = data("clusters.h5")
    for name in ("moment", "friction_work", "radiated", "stress_drop"):
        one, two = found[f"events/{name}"], other[f"events/{name}"]
        check(len(one) == len(two) > 3 and np.allclose(one, two, rtol=1e-4, atol=1e-6), f"events/{name}: {one} and {two}")


def test_exponents():
    """About sliding that is stable they are the real parts of the eigenvalues."""
    p = unequal(0, 3) | {"bc_left": "free", "model_v": 1.4, "model_k1": np.array([0.4, 0.9])}
    exact = np.sort(System(p).eigenvalues().real)[::-1]
    s, _ = run(" ".join(words_of(p)) + f" -init_psi 1.4 -init_eta steady -ts_max_time 400 -lyapunov_count 6 {STRICT}")
    found = np.array([one["value"] for one in s["lyapunov"]])
    check(abs(found.sum() - exact.sum()) < 1e-5 * abs(exact.sum()) + 1e-6, f"{found} for {exact}")
    check(np.abs(found - exact).max() < 0.02, f"{found} for {exact}")  # like 1/time


@pytest.mark.parametrize("law", ["cubic", "carlson-langer"])
def test_a_cycle_of_the_whole_scene(law):
    p = {"model_form": "chain", "grid_n": 3, "bc_left": "free", "model_v": 0.5 if law == "cubic" else 0.3, "friction_law": law,
         "model_m": np.array([1.2, 0.8, 1.]), "model_k0": np.array([1., 1.2, 0.9]), "model_k1": np.array([0.6, 0.9]),
         "model_zeta": np.array([0.02, 0.1, 0.05])}
    s, _ = run([*words_of(p), *"-cycle_cell 0 -init_psi 0.2 -init_eta 0.5 -init_noise 0.1 -out_file cycle.h5".split()], command="cycle")
    system, fields = System(p), data("cycle.h5")
    start = read(fields, 0)
    if law == "cubic":
        end, matrix = system.carried(start, s["period"], rtol=1e-10, atol=1e-11)
        check(np.abs(end - start).max() < 1e-6, f"the cycle misses itself by {np.abs(end - start).max()}")
        check(apart(values_of(s, "multipliers"), np.linalg.eigvals(matrix)) < 1e-5, "multipliers")
    else:
        motion = Stick(system, start, Y=np.eye(len(start)))
        end = motion.advance(s["period"])
        check(np.abs(end - start).max() < 1e-7, f"the cycle misses itself by {np.abs(end - start).max()}")


# ---- waves that meet a step ----

def field_of(text, n):
    run(f"{text} -grid_n {n} -out_frames 2 -out_file run.h5 -ts_rtol 1e-9 -ts_atol 1e-10")
    fields = data("run.h5")
    return fields["x"], fields["psi"][-1] - 1


LINEAR = "-model_delta 0 -model_v 1 -bc_left free -grid_length 40 -friction_amplitude_profile 0:1e-9,40:1e-9 -ts_max_time 9 "


def pulse(n):
    x = np.linspace(0, 40, n)
    np.savetxt("pulse.txt", np.c_[x, 1 + np.exp(-((x - 12) / 1.5)**2), 0 * x])
    return "-init_type text -init_file pulse.txt "


@pytest.mark.parametrize("place", (20., 20.037))
def test_reflection_at_a_step_of_c(place):
    """A wave is reflected with (c1 - c2)/(c1 + c2) and goes on with twice c1/(c1 + c2), whatever its frequency: what the plate
    takes is the same on both sides. The misses fall like h^2, wherever between two nodes the step lies."""
    c1, c2 = 1., 2.5
    R, misses = (c1 - c2) / (c1 + c2), []
    for n in (401, 801):
        start = pulse(n)
        x, alone = field_of(LINEAR + start + f"-model_c {c1} -grid_order 2", n)
        _, met = field_of(LINEAR + start + f"-model_c_profile 0:{c1},{place}:{c2} -profile_kind step", n)
        want = np.where(x < place, alone + R * np.interp(2 * place - x, x, alone),
                        (1 + R) * np.interp(place + (x - place) * c1 / c2, x, alone))
        inside = (x > 6) & (x < 34)  # what the ends give back has not come there
        misses.append(np.abs(met - want)[inside].max())
    check(abs(R) > 0.4 and misses[1] < 2e-3 and np.log2(misses[0] / misses[1]) > 1.7, f"misses {misses}")


def test_a_matched_layer_reflects_nothing():
    """Blocks of a layer twice as heavy, on springs to the plate twice and to neighbours half as stiff: long waves run through
    with the same impedance sqrt(m k1) and half the speed, and nothing comes back; what does, of the chain, falls like the
    square of a wavelength."""
    def back(width):
        n, m, k0, k1, first = 40 * width, 1., 1 / (400 * width**2), 1., 20 * width
        x = np.arange(n)
        np.savetxt("pulse.txt", np.c_[x, 1 + np.exp(-((x - 10 * width) / (1.5 * width))**2), 0 * x])
        text = (f"-model_form chain -bc_left free -grid_n {n} -model_v 1 -init_type text -init_file pulse.txt -ts_max_time {15 * width} "
                f"-friction_amplitude_profile 0:1e-9,{n - 1}:1e-9 -out_frames 2 -out_file run.h5 -ts_rtol 1e-9 -ts_atol 1e-10 -model_f0 1 ")
        def side(name, here, there):  # the block at the border belongs to both sides by half
            return f"-{name}_profile 0:{here},{first}:{(here + there) / 2},{first + 1}:{there} "
        springs = f"-model_k1_profile 0:{k1},{first}:{k1 / 2} -profile_kind step "
        ends = []
        for blocks in (f"-model_m {m} -model_k0 {k0} -model_k1 {k1}",
                       springs + side("model_m", m, 2 * m) + side("model_k0", k0, 2 * k0),
                       springs + f"-model_m {m} " + side("model_k0", k0, 2 * k0)):
            run(text + blocks)
            ends.append(data("run.h5")["psi"][-1][:first - 3 * width])
        return [np.abs(end - ends[0]).max() for end in ends[1:]]
    (short, unmatched), (long, _) = back(4), back(8)
    check(unmatched > 0.05, f"a layer that does not match gives {unmatched} back")
    check(long < 2e-3 and np.log2(short / long) > 1.6, f"comes back: {short}, {long}")


def test_layers_of_any_order():
    """A profile of delta at order 4; a smooth c at order 2: errors at probes fall like h^2 or faster."""
    errors = []
    for n in (41, 81, 161, 641):
        s, _ = run(f"-bc_left free -grid_length 10 -grid_n {n} -init_type sine -init_mode 2 -init_psi 0.3 -ts_max_time 2 -ts_rtol 1e-9 -ts_atol 1e-10 "
                   "-model_c_profile 0:1,10:2 -profile_kind smooth -model_delta_profile 0:0.1,10:0.4 -out_probes 1.25,5,8.75")
        errors.append(np.array([probe["psi"] for probe in s["probes"]]))
    errors = [np.abs(e - errors[-1]).max() for e in errors[:-1]]
    check(np.log2(errors[1] / errors[2]) > 1.8 and errors[2] < 1e-3, f"errors {errors}")


def test_accuracy():
    text = ("-bc_left free -grid_length 10 -init_psi 0.3 -init_eta steady -ts_max_time 1 -out_probes 2.1,5.03,8 "
            "-model_c_profile 0:1,5:1,5:1.6,10:1.6 -model_delta_profile 0:0.1,10:0.3 -friction_amplitude_profile 0:0.9,10:1.1 ")
    s, _ = run(text + "-accuracy 1e-4")
    exact, _ = run(text + "-grid_n 1601 -ts_rtol 1e-9 -ts_atol 1e-10")
    worst = max(abs(p[name] - q[name]) for p, q in zip(s["probes"], exact["probes"]) for name in ("psi", "eta"))
    check(worst < s["error_estimate"] <= 1e-4, f"errs by {worst}, estimate {s['error_estimate']}")


# ---- the rest ----

def test_equal_blocks_are_no_profile():
    for scene_text, profile in (("-model_form chain -grid_n 30", "-model_m_profile 0:1 -model_k1_profile 0:0.2 -model_zeta_profile 0:0"),
                                ("-grid_n 40 -grid_order 2", "-model_c_profile 0:1 -model_delta_profile 0:0.2")):
        text = f"{scene_text} -init_noise 0.3 -ts_max_time 3 -out_frames 3 {STRICT} "
        run(text + "-out_file none.h5")
        run(text + f"{profile} -out_file same.h5")
        one, other = data("none.h5"), data("same.h5")
        check(np.allclose(one["psi"], other["psi"], rtol=0, atol=1e-8), "a constant profile is not the value")


def test_sweep_of_a_factor():
    run("-model_form chain -bc_left free -grid_n 2 -model_m_profile 0:1,1:2 -sweep_command spectrum -sweep_parameter1 model_m_factor "
        "-sweep_values1 1,2 -out_file sweep.h5", command="sweep")
    found = data("sweep.h5")["growth_rate"]
    for factor, growth in zip((1, 2), found):
        p = {"model_form": "chain", "bc_left": "free", "grid_n": 2, "model_m": factor * np.array([1., 2.])}
        check(abs(System(p).eigenvalues()[0].real - growth) < 1e-10, f"factor {factor}")


SLOPING = ("-model_form chain -bc_left free -grid_n {n} -model_m_profile 0:1,{last}:2 -model_k0_profile 0:0.3,{half}:0.1,{last}:0.3 "
           "-model_k1_profile 0.5:0.3,{half}:0.6 -model_zeta_profile 0:0,{last}:0.2 -init_noise 0.4 ")


@pytest.mark.ranks
@pytest.mark.parametrize("more", ["-stick_clusters off -friction_law coulomb", "-ts_type arkimex -imex_implicit friction"])
def test_ranks(more):
    text = SLOPING.format(n=600, last=599, half=300) + f"-ts_max_time 3 {more} -out_frames 3 "
    run(text + "-out_file one.h5")
    run(text + "-out_file three.h5", ranks=3)
    one, three = data("one.h5"), data("three.h5")
    check(np.allclose(one["psi"], three["psi"], rtol=1e-9, atol=1e-9), "ranks differ")


@pytest.mark.parametrize("text", [
    SLOPING.format(n=40, last=39, half=20) + "-stick_clusters off -friction_law coulomb -init_psi 0 -ts_max_time 6",
    SLOPING.format(n=40, last=39, half=20) + "-stick_clusters on -friction_law coulomb -init_psi 0 -ts_max_time 6 -load_v 0:0.2,2:0.2,2:0.5",
    SLOPING.format(n=40, last=39, half=20) + "-ts_type arkimex -imex_implicit both -ts_rtol 1e-9 -ts_atol 1e-9 -ts_max_time 2",
    "-bc_left free -grid_n 60 -grid_length 20 -model_c_profile 0:1,9:1,9:2 -model_delta_profile 0:0.1,20:0.3 -init_noise 0.2 -ts_max_time 3"])
def test_restart(text):
    run(text + " -out_checkpoint_every 3 -out_checkpoint_keep 1000 -out_frames 9 -out_file whole.h5")
    whole = data("whole.h5")
    points = sorted(one for one in os.listdir() if one.startswith("whole.chk"))
    check(len(points) > 4, f"only {points}")
    for checkpoint in points[1:-1:max(1, len(points) // 2)]:
        run(f"-restart {checkpoint} -out_file again.h5")
        again = data("again.h5")
        kept = len(again["t"])
        check(kept > 1 and all(np.array_equal(again[name], whole[name][-kept:]) for name in ("psi", "eta")), f"other bits from {checkpoint}")


CHAIN = "-model_form chain -bc_left free -grid_n 4 "
REFUSED = [("run", CHAIN + "-model_m 1 -model_m_profile 0:1", ("model_m", "not both")),
           ("run", CHAIN + "-model_m_profile 0:1,3:0", ("model_m_profile", "> 0")),
           ("run", CHAIN + "-model_c_profile 0:1", ("model_c_profile", "continuum")),
           ("run", "-model_k1_profile 0:1", ("model_k1_profile", "chain")),
           ("run", "-model_c_profile 0:1,9:2 -grid_order 4", ("model_c_profile", "order 2", "grid_order is 4")),
           ("run", CHAIN + "-model_k0_profile 0:1 -model_nu 0.1", ("model_k0_profile", "model_nu")),
           ("run", CHAIN + "-model_k0_profile 0:1 -model_m 0", ("model_k0_profile", "model_m > 0")),
           ("run", CHAIN + "-model_m_profile 0:1,2:3 -model_zeta paper", ("model_m_profile", "model_zeta")),
           ("run", CHAIN + "-model_m_factor 2", ("model_m_factor", "model_m_profile")),
           ("run", "-model_c_profile 0:1,9:2 -init_type pulses", ("model_c_profile", "train")),
           ("wave", "-model_c_profile 0:1,9:2 -wave_length 60", ("model_c_profile", "train")),
           ("cycle", CHAIN + "-model_m_profile 0:1,3:2", ("cycle_cell 1", "no cell repeats")),
           ("chart", "-model_c_profile 0:1,9:2 -chart_kind limits", ("model_c_profile", "limits"))]


@pytest.mark.parametrize("command, options, parts", REFUSED)
def test_refused(command, options, parts):
    refused(options, 2, *parts, command=command)
