"""Viscosity between neighbours (model_nu) from the command line: what it is for, closed forms, other methods and scipy."""
import math

import h5py
import numpy as np

from calls import check, data, refused, run, scene_file
from reference import System, read, waves

NU = 0.05


def growth(k2, C, nu, A, K0, K1):
    """Largest real part of lambda^2 + (C + nu k^2) lambda + A (K0 + K1 k^2) = 0 (A N = nu in the continuum)."""
    return max(np.roots([1, C + nu * k2, A * (K0 + K1 * k2)]).real)


def test_cut_off_and_one_leading_mode():
    # every eigenvalue of a ring on its dispersion relation, which has a cut-off; one mode leads instead of all
    gamma, delta, v, n, length = 3, 0.2, 0.9, 40, 20
    scene = f"-model_gamma {gamma} -model_delta {delta} -model_v {v} -grid_n {n} -grid_length {length} -grid_order 2"
    C = gamma * (v * v - 1) + delta
    plain, _ = run(scene, command="spectrum")
    check(plain["degenerate"] and abs(plain["growth_rate"] + C / 2) < 1e-9, "without viscosity all waves grow alike")
    s, _ = run(scene + f" -model_nu {NU} -spectrum_refine off -spectrum_count {2 * n}", command="spectrum")
    h = length / n
    values = []
    for j in range(n):
        kappa2 = 4 / h**2 * math.sin(math.pi * j / n) ** 2
        values += list(np.roots([1, C + NU * kappa2, 1 + kappa2]))
    found = [complex(e["re"], e["im"]) for e in s["eigenvalues"]]
    found += [z.conjugate() for z in found if z.imag > 0 and len(found) < 2 * n]
    for z in values:
        check(min(abs(z - w) for w in found) < 1e-8, f"eigenvalue {z} is missing")
    s, _ = run(scene + f" -model_nu {NU}", command="spectrum")
    check(not s["degenerate"] and s["wavenumber_continuum"] == 0, "the longest wave leads, alone")
    check(abs(s["growth_continuum"] - growth(0, C, NU, gamma, 1 / gamma, 1 / gamma)) < 1e-9, "and at the rate -C/2")
    check(s["dispersion_error"] < 1e-9 and s["complete"], "all modes lie on the relation")
    grows = [e["wavenumber"] for e in s["eigenvalues"] if e["re"] > 0]
    check(max(grows) < math.sqrt(-C / NU), "nothing grows beyond the cut-off")


def test_boundary_between_held_ends():
    # of standing waves k = pi/L is the longest: C + nu k^2 = 0
    gamma, delta, length, nu = 3, 0.2, 4, 0.3
    k2 = (math.pi / length) ** 2
    ends = f"-model_delta {delta} -grid_n 64 -grid_length {length} -bc_left velocity -bc_right velocity"
    s, _ = run(ends + f" -model_nu {nu} -boundary_parameter model_v -boundary_from 0.1 -boundary_to 1.5", command="boundary")
    (p,) = s["points"]
    check(abs(p["value"] - math.sqrt(1 - (delta + nu * k2) / gamma)) < 1e-6, f"threshold in v: {p}")
    check(p["kind"] == "hopf" and not p["degenerate"] and abs(p["wavenumber"] ** 2 - k2) < 1e-9, f"which mode: {p}")
    check(abs(p["frequency"] - math.sqrt(1 + k2)) < 1e-6, "its frequency")
    s, _ = run(ends + " -model_v 0.9 -boundary_parameter model_nu -boundary_from 0.01 -boundary_to 2", command="boundary")
    (p,) = s["points"]
    check(abs(p["value"] - (gamma * (1 - 0.81) - delta) / k2) < 1e-6, f"threshold in nu: {p}")


def test_a_wave_of_finite_length_leads():
    # runs/viscous-wavelength.yaml: fast motion falls with velocity, slow motion does not
    s, _ = run(scene_file("viscous-wavelength"), command="spectrum")
    v = 0.85
    p = {"model_gamma": 4, "model_delta": 0.3, "model_v": v, "model_nu": 0.02, "state_law": "contact-age", "state_b": 2,
         "state_theta0": 0.2, "state_D": 0.2}

    def rate(k):
        return np.linalg.eigvals(waves(p, [k * k]))[0].real.max()

    best = max([2 * math.pi * j / 20 for j in range(60)], key=rate)
    check(rate(0) < 0 < rate(best) and 0 < best, "the scene is one where a finite wavelength grows alone")
    check(abs(s["wavenumber_continuum"] - best) < 1e-9 and abs(s["growth_continuum"] - rate(best)) < 1e-8, f"{s}")
    check(not s["stable"] and abs(s["growth_rate"] - rate(best)) < 0.02 * rate(best), "and on the grid")
    # a run from noise shows it: the wave that has grown most
    _, _ = run(scene_file("viscous-wavelength") + " -ts_max_time 12 -out_frames 2 -out_file noise.h5")
    power = np.abs(np.fft.rfft(data("noise.h5")["psi"][-1] - v))
    j = int(np.argmax(power))
    check(abs(2 * math.pi * j / 20 - best) <= 3 * 2 * math.pi / 20, f"wave {j} of the run, {best * 20 / 2 / math.pi} expected")


def test_fronts_that_a_grid_resolves():
    # runs/viscous-front.yaml: order 4 once h is well below the thickness sqrt(nu/gamma); without viscosity none
    def profile(n, extra=""):
        run(scene_file("viscous-front") + f" -grid_n {n} -out_file f.h5 -ts_max_time 6 -out_frames 2 -ts_rtol 1e-8 -ts_atol 1e-8 {extra}")
        return data("f.h5")["psi"][-1]

    def orders(extra):
        grids = [profile(n, extra) for n in (128, 256, 512)]
        change = [np.abs(grids[k] - grids[k + 1][::2]).max() for k in range(2)]
        return math.log2(change[0] / change[1]), change[1]

    order, change = orders("")
    check(order > 3.5 and change < 1e-3, f"with viscosity: order {order}, change {change}")
    order, change = orders("-model_nu 0")
    check(order < 1 and change > 0.05, f"without: order {order}, change {change}")


def test_every_method_and_split():
    # a chain with a state, free and held ends, spread: scipy, explicit, each split of arkimex, all implicit
    scene = ("-model_form chain -grid_n 12 -model_nu 0.3 -model_k0 0.4 -model_k1 1.1 -model_zeta 0.2 -model_v 0.6"
             " -bc_left velocity -bc_left_value 0.9 -bc_right free -state_law contact-age"
             " -state_b 0.5 -state_theta0 0.8 -state_D 0.7")
    for method, bound in (("", 1e-6), *((f"-ts_type arkimex -ts_arkimex_type 4 -imex_implicit {split}", 3e-6)
                                        for split in ("friction", "wave", "both"))):
        run(f"{scene} -init_type sine -ts_max_time 6 -ts_rtol 1e-9 -ts_atol 1e-10 -out_frames 2 -out_file m.h5 "
            f"-scene_reduce off {method}")
        found = data("m.h5")
        off = np.abs(read(found, -1) - System(scene).follow(read(found, 0), 0, 6, rtol=1e-10, atol=1e-11)).max()
        check(off < bound, f"{method}: {off}")


def test_damping_scales_out():
    # cubic: (gamma, delta, v) is (gamma a^2, 0, v/a), a^2 = 1 - delta/gamma, nu unchanged; exact at fixed steps
    gamma, delta, v = 3, 0.3, 0.4
    a = math.sqrt(1 - delta / gamma)
    common = f"-model_nu {NU} -grid_n 64 -grid_length 15 -ts_max_time 4 -ts_type rk -ts_rk_type 4 -ts_dt 0.01 -out_frames 2"

    def end(scene):
        run(f"{common} -init_type sine -out_file d.h5 {scene}")
        return [data("d.h5")[name][-1] for name in ("psi", "eta")]

    psi, eta = end(f"-model_gamma {gamma} -model_delta {delta} -model_v {v} -init_psi 0.2 -init_amplitude 0.5 -init_eta 0")
    # eta' = [eta + (1 - a^2) psi]/a^3 of the start is no constant: it is taken from a file
    run(f"{common} -init_type sine -model_gamma {gamma * a * a!r} -model_delta 0 -model_v {v / a!r} -init_psi {0.2 / a!r}"
        f" -init_amplitude {0.5 / a!r} -init_eta 0 -out_file e.h5 -ts_max_time 0.01")
    with h5py.File("e.h5", "r+") as f:
        f["eta"][-1] = (1 - a * a) * f["psi"][0] * a / a**3
        f["psi"][-1] = f["psi"][0]
    run(f"{common} -model_gamma {gamma * a * a!r} -model_delta 0 -model_v {v / a!r} -init_type file -init_file e.h5 -out_file g.h5")
    f = data("g.h5")
    check(np.abs(f["psi"][-1] * a - psi).max() < 1e-11, "psi' = psi/a")
    check(np.abs(f["eta"][-1] * a**3 - (eta + (1 - a * a) * psi)).max() < 1e-11, "eta'")


def test_slips_lose_energy_between_neighbours():
    # exact stick, no plate: what the springs give is friction's work and what viscosity takes, for every event
    scene = ("-model_form chain -grid_n 30 -bc_left free -model_k0 1 -model_k1 4 -model_v 1e-6 -model_nu 0.4"
             " -friction_law carlson-langer -friction_sigma 0.05 -init_psi 0 -init_eta 0.95 -init_noise 0.2 -init_seed 4"
             " -out_events true -ts_max_time 40 -ts_rtol 1e-8 -ts_atol 1e-9 -out_file s.h5")
    s, _ = run(scene)
    events = {name: data("s.h5")["events/" + name] for name in ("strain_energy", "friction_work", "radiated", "begin")}
    rest = events["begin"] > 0  # those of the start begin with the noise's kinetic energy
    total = events["friction_work"] + events["radiated"]
    check(len(total) > 0 and (events["radiated"] > 0).all(), f"{len(total)} events, viscosity takes {events['radiated']}")
    if rest.any():
        check(np.allclose(events["strain_energy"][rest], total[rest], rtol=1e-4), f"{events}")


def test_catalogues_have_a_limit():
    # runs/viscous-catalogue.yaml: with viscosity the same slips on two grids, none small; without, single nodes on each
    def events(n, nu):
        run(scene_file("viscous-catalogue") + f" -grid_n {n} -model_nu {nu} -out_frames 2 -out_file c.h5")
        file = data("c.h5")
        return [file["events/" + name][np.argsort(file["events/begin"])] for name in ("begin", "extent", "slip")]

    # on 160 nodes fronts are not resolved (the run warns) and the second slip is half as large again, at any tolerance
    (begin, extent, slip), (fine_begin, fine_extent, fine_slip) = events(320, 1), events(640, 1)
    check(min(extent.min(), fine_extent.min()) > 3, f"least extents {extent.min()} and {fine_extent.min()}")
    # 0.5 of time is 0.005 of force, half of what friction drops by at once (sigma); a count of nodes between the same two
    # ends is off by less than one on either grid: in length by less than 1.5 spacings of the coarser one
    for ours, fine, bound in ((begin, fine_begin, 0.5), (extent, fine_extent, 1.5 * 40 / 320),
                              (slip, fine_slip, 0.05 * fine_slip[:5])):
        check((np.abs(ours[:5] - fine[:5]) < bound).all(), f"{ours[:5]} on 320 nodes, {fine[:5]} on 640")
    for n in (160, 320):
        _, single, _ = events(n, 0)
        check(single.min() < 40.001 / n and len(single) > 10 * len(extent), f"without: {len(single)}, least {single.min()}")


def test_what_is_refused():
    alone = ("trains are solved for without viscosity between neighbours", )
    refused("-model_nu 0.1 -wave_length 20", 2, "model_nu 0.1", *alone, command="wave")
    refused("-wave_length 20 -wave_continue model_nu -wave_to 0.4", 2, *alone, command="wave")
    refused("-model_nu 0.1 -init_type wave -init_pulses 1", 2, "model_nu 0.1", *alone)
    refused("-model_nu -0.1", 2, "model_nu")


def test_a_rupture_front_slows_to_that_of_none():
    # A Coulomb chain at uniform stress, no springs to the plate: V = c/sqrt(1 - q^2) (Amundsen et al. 2015), here 2/sqrt(3).
    # With viscosity the front runs faster, in proportion to nu.
    with open("start.txt", "w", encoding="utf-8") as file:
        file.writelines(f"{i} 0 {1.001 if i == 0 else 0.75}\n" for i in range(800))

    def speed(nu):
        run("-model_form chain -grid_n 800 -model_m 1 -model_k0 0 -model_k1 1 -model_zeta 0 -model_v 0 -model_f0 1"
            f" -model_nu {nu} -friction_law coulomb -friction_fs 1 -friction_fd 0.5 -bc_left free -bc_right free"
            " -init_type text -init_file start.txt -ts_max_time 560 -ts_rtol 1e-7 -ts_atol 1e-9 -ts_adapt_dt_max 0.1"
            " -out_file front.h5 -out_frames 2 -out_probes 300,600")
        t, psi = (data("front.h5")["probes/" + name] for name in ("t", "psi"))
        return 300 / abs(np.subtract(*(t[np.argmax(psi[:, k] > 1e-12)] for k in (0, 1))))
    none, half, whole = (speed(nu) for nu in (0, 0.025, 0.05))
    assert abs(none * np.sqrt(3) / 2 - 1) < 3e-3
    assert abs((whole - none) / (half - none) - 2) < 0.05 and 0.03 < whole / none - 1 < 0.04
