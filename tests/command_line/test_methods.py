"""Methods from the command line: refusals, warnings and failures with their exit codes; displacement and energy."""
import json
import re

import h5py
import numpy as np
import pytest

from calls import call, check


def run(arguments):
    return call(arguments)


SMALL = " -grid_n 64 -grid_length 6 -init_type sine -ts_max_time 1"


@pytest.mark.parametrize("arguments, code, text", [
    ("-ts_type eimex", 2, "error: -ts_type eimex"),
    ("-ts_type glee", 2, "error: -ts_type glee: it ignores the implicit part"),
    ("-ts_type arkimex -ts_arkimex_type bpr3", 2, "its order falls to 1"),
    ("-ts_type rk -ts_rk_type 4 -ts_adapt_type basic", 2, "rk:4 has no error estimate"),
    ("-ts_type rk -ts_rk_type 4 -ts_dt 0.01 -ts_rtol 1e-9", 0, "warning: ts_rtol has no effect"),
    ("-ts_type ssp", 0, "chosen for stability and not for accuracy"),
    ("-ts_type leapfrog -ts_dt 0.05", 0, ""),
    ("-ts_type leapfrog", 0, "leapfrog has no error estimate and a fixed step"),
    ("-ts_type leapfrog -ts_dt 0.01 -ts_adapt_type basic", 2, "leapfrog has no error estimate"),
    ("-ts_type leapfrog -ts_dt 0.01 -imex_implicit wave", 2, "ts_type leapfrog takes friction implicitly"),
    ("-ts_type leapfrog -ts_dt 0.01 -model_nu 0.1", 2, "viscosity between neighbours (model_nu 0.1)"),
    ("-ts_type leapfrog -ts_dt 1", 0, "is beyond the stability limit of leapfrog, which is about"),
    ("-ts_type leapfrog -ts_dt 1", 0, "have several solutions"),
    ("-ts_type rosw -imex_implicit friction", 2, "ts_type rosw does not split; use ts_type arkimex"),
    ("-ts_type rosw -load_v 0:0.2,1:0.4", 2, "ts_type rosw: it does not follow a load that varies"),
    ("-ts_dt 1e6", 0, ""),
    ("-ts_type rk -ts_rk_type 4 -ts_dt 1", 1, "is beyond the stability limit of rk:4"),
    ("-ts_type rk -ts_rk_type 4 -ts_dt 1", 1, "error: the solution is not finite after step")])
def test_refusals_and_warnings(arguments, code, text):
    done = run(arguments + SMALL + (" -ts_max_time 40" if arguments.endswith("-ts_dt 1") else ""))
    assert done.returncode == code and text in done.stderr, done.stderr


# psi and eta at the end, largest error over three places, against rk at a tolerance of 1e-10
def errors(scene, method, steps):
    def probes(method):
        done = run(f"{scene} {method} -out_probes 1,4,8 -summary -")
        check(done.returncode == 0, done.stderr)
        summary = json.loads(done.stdout[done.stdout.index("{"):])
        return np.array([[p["psi"], p["eta"]] for p in summary["probes"]])
    exact = probes("-ts_type rk -ts_rtol 1e-10 -ts_atol 1e-10")
    return [np.abs(probes(f"{method} -ts_adapt_type none -ts_dt {dt}") - exact).max() for dt in steps]


@pytest.mark.parametrize("scene", [
    # blocks that stick and slip, with contacts that strengthen at rest
    "-model_form chain -friction_law carlson-langer -state_law healing -state_t_h 2 -state_tau_inf 1.5 -state_D 0.3 "
    "-grid_n 12 -model_k1 3 -model_v 0.3 -model_zeta 0.3 -friction_spread 0.1 -init_psi 0 -init_eta 0.8 -init_state 1 "
    "-bc_left free -ts_max_time 16",
    # a held end, a load with a step in it, friction that varies along x
    "-grid_n 61 -grid_length 20 -grid_order 6 -bc_left velocity -bc_left_value -1.5 -bc_right free -init_type layer "
    "-friction_spread 0.3 -ts_max_time 2.5 -load_v 0:0.2,1:0.2,1:0.4,9:0"])
def test_order_of_leapfrog_through_starts_and_stops(scene):
    coarse, fine = errors(scene, "-ts_type leapfrog", (0.04, 0.02))
    check(0.9 * 4 < coarse / fine < 1.13 * 4 and fine < 6e-3, f"{coarse:.2e}, {fine:.2e}")


def test_displacement_and_energy():
    path, summary = "a.h5", "a.json"
    done = run(f"-init_type sine -grid_n 64 -grid_length 12 -ts_max_time 2 -ts_rtol 1e-8 -out_file {path} -summary {summary} "
               "-out_displacement -out_frames 201")
    check(done.returncode == 0, done.stderr)
    with open(summary, encoding="utf-8") as file:
        check(json.load(file)["method"] == "rk:7vr", "the default method")
    with h5py.File(path) as file:
        t, psi, chi, series = file["t"][:], file["psi"][:], file["chi"][:], file["series"]
        # chi_t = psi: central differences of the frames, error dt^2 |psi_tt|/6
        rate = (chi[2:] - chi[:-2]) / (t[2:] - t[:-2])[:, None]
        bend = np.abs(psi[2:] - 2 * psi[1:-1] + psi[:-2]).max()
        check(np.abs(rate - psi[1:-1]).max() < bend, "chi moves with psi")
        energy = series["energy_kinetic"][:] + series["energy_elastic"][:]
        power = series["power_input"][:] - series["power_friction"][:] - series["power_viscous"][:]
        gained = np.sum(0.5 * (power[1:] + power[:-1]) * series["dt"][1:])
        check(abs(energy[-1] - energy[0] - gained) < 1e-2 * abs(gained), "the energy balance")


def test_log_view_names_what_is_done():
    for command, more, stages in (("run", "-grid_n 16 -ts_max_time 1", ["time stepping"]),
                                  ("spectrum", "-grid_n 200 -spectrum_method krylov -bc_left velocity -bc_left_value 0.5 -model_v 1.2",
                                   ["spectrum", "eigenvalues"])):
        said = call(f"{more} -log_view", command=command).stdout
        for stage in stages:
            check(re.search(rf"^ *\d+: +{stage}: ", said, re.MULTILINE), f"{command}: {stage} in {said[:3000]}")
        check(not re.search(r"Stage \d+: Unknown", said), f"{command}: a stage without a name in {said[:3000]}")


def test_log_view_counts_the_operations_of_steps():
    """Of a step as many on every grid, times its nodes."""
    of_step = {}
    for n in (64, 128):
        said = call(f"-grid_n {n} -init_type sine -ts_max_time 1 -ts_type rk:5dp -log_view", command="run").stdout
        stage = said[said.index("Stage 2: time stepping"):] if "Stage 2: time stepping" in said else said
        count, flops = re.search(r"^TSStep +(\d+) [\d.]+ \S+ [\d.]+ (\S+)", stage, re.MULTILINE).groups()
        of_step[n] = float(flops) / int(count) / n
    check(of_step[64] > 100 and abs(of_step[128] / of_step[64] - 1) < 0.05, f"{of_step}")


def test_a_monitor_says_of_which_solver_it_speaks():
    said = call("-grid_n 200 -spectrum_method krylov -bc_left velocity -bc_left_value 0.5 -model_v 1.2 -eps_monitor",
                command="spectrum").stdout
    check(re.match(r"EPS of the eigenvalues nearest to \S+ of 398 unknowns\n +1 EPS nconv=", said), said[:300])


def test_why_a_solver_without_a_matrix_fails_is_told():
    done = call("-grid_n 128 -model_c 30 -model_gamma 300 -init_type sine -ts_max_time 3 -ts_type rosw -snes_mf", command="run")
    check(done.returncode == 1 and "without a matrix there is no preconditioner" in done.stderr and "-snes_fd" in done.stderr, done.stderr)
