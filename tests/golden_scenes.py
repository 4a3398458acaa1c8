"""The scenes of golden.py: of every feature of every command one that would notice its loss.

A scene is a name and its steps, each a command line as a user types it, carried out in one folder in this order.
`@N` at its end: on N ranks. `^C`: with SIGINT once its file is there. NEWEST: the newest checkpoint of the folder.
RUNS/: the scenes shipped. Runs end before chaos parts two programs that differ by round-off.
"""

FILE = "-out_file a.h5"
SHORT = "-ts_max_time 4 -out_frames 5 -out_file a.h5"
STEPS = "-ts_adapt_type none -ts_dt 0.01 -ts_max_time 0.5 -out_frames 3 -out_file a.h5"
RING = "-grid_n 64 -grid_length 20 -init_type sine"
CHAIN = "-model_form chain -grid_n 9 -bc_left free"
STICKS = (f"{CHAIN} -friction_law carlson-langer -friction_sigma 0.05 -friction_alpha 2.5 "
          "-friction_spread 0.3 -init_psi 0 -init_eta 0.5 -init_noise 0.3 -model_v 0.1 -model_k0 1 -model_k1 3")
REST = "-model_form chain -grid_n 1 -bc_left free -model_k0 1"
AGES = "-friction_law rate-and-state -friction_a 0.05 -friction_b 0.1 -friction_D 0.5"

METHODS = {
    "rk-3bs": "-ts_type rk -ts_rk_type 3bs", "rk-5dp": "-ts_type rk -ts_rk_type 5dp",
    "rk-7vr": "-ts_type rk -ts_rk_type 7vr", "rk-8vr": "-ts_type rk -ts_rk_type 8vr",
    "petsc-rk-5dp": "-ts_type rk -ts_rk_type 5dp -rk_fused false",
    "imex-friction": "-ts_type arkimex -ts_arkimex_type 4 -imex_implicit friction",
    "imex-wave": "-ts_type arkimex -ts_arkimex_type 4 -imex_implicit wave",
    "imex-both": "-ts_type arkimex -ts_arkimex_type 3 -imex_implicit both",
    "imex-petsc": "-ts_type arkimex -ts_arkimex_type 3 -imex_implicit both -rk_fused false",
    "rosw-both": "-ts_type rosw -ts_rosw_type 4l", "ssp": "-ts_type ssp -ts_ssp_type rks3",
    "bdf": "-ts_type bdf -ts_bdf_order 2", "theta": "-ts_type cn", "alpha": "-ts_type alpha", "leapfrog": "-ts_type leapfrog",
}
LAWS = {
    "cubic": "", "regularised": "-friction_law carlson-langer -friction_stick regularised -friction_eps 0.05",
    "coulomb": "-friction_law coulomb -friction_stick regularised -friction_eps 0.05 -friction_slip_velocity 0.2",
    "healing": "-friction_law coulomb -friction_stick regularised -friction_eps 0.1 -friction_slip_velocity 0.5 "
               "-state_law healing",
    "contact-age": "-state_law contact-age", "ageing": AGES, "slip": f"{AGES} -state_law slip",
    "n-shaped": "-friction_law n-shaped",
}


def runs():
    for name, method in METHODS.items():
        quiet = "-model_delta 0 -friction_law cubic" if name == "leapfrog" else ""
        yield f"method-{name}", [f"run {RING} {method} {quiet} {SHORT}"]
        yield f"fixed-{name}", [f"run {RING} {method} {quiet} {STEPS}"]
    for name, law in LAWS.items():
        yield f"law-{name}", [f"run {RING} -init_psi 0.6 -init_amplitude 0.1 {law} {SHORT}"]
    for order in (2, 6, 8):
        yield f"order-{order}", [f"run {RING} -grid_order {order} {SHORT}"]
    yield "ends-held-free", [f"run -grid_n 64 -grid_length 20 -bc_left velocity -bc_left_value -1.5 -bc_right free "
                             f"-init_type layer {SHORT} -out_probes 0,3.7,20 -out_displacement"]
    yield "ends-held-both", [f"run {CHAIN} -bc_left velocity -bc_right velocity -bc_right_value 0.5 {SHORT} -out_displacement"]
    yield "viscosity", [f"run {RING} -model_nu 0.3 {SHORT}", f"run {RING} -model_nu 30 -ts_type arkimex {SHORT}"]
    yield "printed-sign", [f"run {RING} -model_delta_sign printed {SHORT}"]
    yield "spread", [f"run {RING} -friction_spread 0.3 {SHORT}",
                     f"run {CHAIN} -friction_spread 0.3 -friction_spread_kind lognormal -friction_seed 7 {SHORT}"]
    yield "profiles", [f"run {RING} -friction_amplitude_profile 0:1,10:2,20:1 -profile_kind smooth {SHORT}",
                       f"run {RING} -friction_law rate-and-state -init_psi 0.6 -init_amplitude 0.1 "
                       f"-friction_a_profile 0:0.05,10:0.2,20:0.05 {SHORT}"]
    yield "load", [f"run {RING} -load_v 0:0.2,1:0.8,1:0.1,3:0.5 -load_sine_amplitude 0.1 -load_sine_period 3 {SHORT} -out_displacement"]
    yield "load-sticks", [f"run {STICKS} -load_v 0:0.1,3:-0.2,8:0.3 -ts_max_time 20 -out_events -out_frames 9 {FILE}"]
    yield "massless", [f"run {CHAIN} -model_m 0 -model_zeta 3 {SHORT}", f"run RUNS/massless.yaml -ts_max_time 3 {FILE}"]
    yield "reduced", [f"run -grid_n 32 {SHORT}", f"run -grid_n 32 -scene_reduce off {SHORT}"]
    yield "sticks", [f"run {STICKS} -ts_max_time 30 -out_frames 9 -out_events {FILE}"]
    yield "sticks-one-way", [f"run {STICKS} -friction_back_slip false -ts_max_time 20 -out_events {FILE}"]
    yield "sticks-continuum", [f"run -grid_n 40 -grid_length 10 -friction_law coulomb -friction_spread 0.4 "
                               f"-model_v 1 -init_psi 0 -init_eta 0.5 -init_noise 0.4 -ts_max_time 12 -out_events {FILE}"]
    yield "sticks-states", [f"run {CHAIN} -friction_law coulomb -state_law healing -friction_spread 0.4 -model_v 0.5 -init_psi 0 -init_eta 0.9 -init_noise 0.2 "
                            f"-ts_max_time 40 -out_events {FILE}",
                            f"run {CHAIN} -friction_law coulomb -friction_fd 0.6 -state_law contact-age -init_psi 0.2 "
                            f"-friction_spread 0.4 -model_v 0.4 -init_noise 0.1 -ts_max_time 30 -model_nu 0.1 -out_events {FILE}"]
    yield "sticks-fixed", [f"run {STICKS} -ts_adapt_type none -ts_dt 0.02 -ts_max_time 4 {FILE}"]
    yield "catalogue", [f"run -model_form chain -model_m 1 -model_k0 1 -model_k1 9 -model_f0 1 -model_v 1e-3 -friction_law carlson-langer "
                        f"-friction_sigma 0.01 -friction_alpha 3 -friction_back_slip false -init_psi 0 -init_eta 0.5 -init_noise 0.5 "
                        f"-grid_n 40 -bc_left free -ts_max_time 300 -out_series false -out_frames 2 -out_events {FILE}"]
    yield "events-smooth", [f"run {RING} -out_events -out_events_velocity 0.5 -ts_max_time 12 -out_frames 3 {FILE}"]
    yield "starts", [f"run -grid_n 64 -grid_length 40 -init_type pulses -init_pulses 2 {SHORT}",
                     f"run -grid_n 400 -grid_length 40 -model_delta 0 -init_type wave -init_pulses 1 -init_direction left {SHORT}",
                     f"run {RING} -init_noise 0.1 -init_seed 3 {SHORT}",
                     f"run {RING} -init_psi steady -init_eta steady -model_v 1.1 {SHORT}",
                     f"run -grid_n 32 -grid_length 20 -init_type file -init_file a.h5 -init_frame 2 -ts_max_time 1 -out_file b.h5"]
    yield "frames", [f"run {RING} -ts_max_time 3 -out_times 0,0.5,2.25 {FILE}", f"run {RING} -ts_max_time 3 -out_every 0.7 {FILE}",
                     f"run {RING} -ts_max_time 30 -out_maxima 3 -out_series false -out_probes 3 -out_frames 2 {FILE}"]
    yield "checkpoints", [f"run {RING} -ts_type rk -ts_rk_type {kind} {SHORT} -out_checkpoint_every 20 -ts_max_steps 50"
                          for kind in ("3bs",)] + ["run -restart NEWEST -ts_max_steps 100000"]
    yield "checkpoints-sticks", [f"run {STICKS} -ts_max_time 15 -out_events {FILE} -out_checkpoint_every 100 -ts_max_steps 250",
                                 "run -restart NEWEST -ts_max_steps 100000 -ts_max_time 18 @2"]
    yield "checkpoints-imex", [f"run {RING} {METHODS['imex-friction']} {SHORT} -out_checkpoint_every 20 -ts_max_steps 25 @2",
                               "run -restart NEWEST -ts_max_steps 100000 @4"]
    yield "signal", [f"run {RING} -ts_type rk -ts_rk_type 3bs -grid_n 600 -ts_max_time 12 -out_frames 101 {FILE} ^C",
                     "run -restart NEWEST"]
    for ranks in (2, 4):
        yield f"ranks-{ranks}", [f"run {RING} {SHORT} -out_probes 1,19 -out_events -out_displacement @{ranks}",
                                 f"run {STICKS} -ts_max_time 15 -out_events {FILE} @{ranks}",
                                 f"run {RING} {METHODS['imex-wave']} {STEPS} @{ranks}",
                                 f"run {RING} {METHODS['imex-both']} {SHORT} @{ranks}"]
    yield "exponents", ["run RUNS/two-blocks.yaml -lyapunov_count 2 -ts_max_time 60 -out_frames 2 -out_file a.h5",
                        f"run {RING} -lyapunov_count 1 -ts_max_time 10"]
    yield "accuracy", [f"run {RING} -grid_n auto -ts_max_time 3 -accuracy 1e-5 {FILE}",
                       f"run {REST} -accuracy 1e-7 -ts_max_time 10", f"run {RING} -check"]


def spectra():
    for name, law in LAWS.items():
        yield f"spectrum-{name}", [f"spectrum -grid_n 24 -grid_length 6 -model_v 0.8 {law} {FILE}"]
    yield "spectrum-order", ["spectrum -grid_n 30 -grid_order 8 -grid_length 9 -model_v 0.9 -spectrum_refine off"]
    yield "spectrum-held", [f"spectrum -grid_n 40 -grid_length 9 -bc_left velocity -bc_left_value 0.4 -model_v 0.9 {FILE}"]
    yield "spectrum-krylov", [f"spectrum -grid_n 3000 -grid_length 60 -bc_left velocity -bc_left_value 0.8 -model_v 1 "
                              f"-spectrum_method krylov -spectrum_count 4 {FILE}"]
    yield "spectrum-profile", [f"spectrum -grid_n 40 -grid_length 9 -friction_amplitude_profile 0:1,4:1.5,9:1 -model_v 0.9 {FILE}"]
    yield "spectrum-massless", [f"spectrum {CHAIN} -model_m 0 -model_zeta 0.5 -model_v 0.9 {FILE}"]
    yield "spectrum-then-run", [f"spectrum {RING} -model_v 0.9 {FILE}",
                                f"run {RING} -model_v 0.9 -init_type file -init_file a.h5 -init_amplitude 0.01 -ts_max_time 2"]
    yield "spectrum-ranks", ["spectrum -grid_n 24 -grid_length 6 -model_v 0.8 -bc_left free @2"]


def boundaries():
    over_v = "-boundary_parameter model_v -boundary_from 0.3 -boundary_to 1.5"
    yield "boundary-point", [f"boundary -grid_n 32 {over_v} {FILE}", f"boundary -grid_n 32 {over_v} -boundary_verify 1"]
    yield "boundary-held", [f"boundary -grid_n 24 -grid_length 8 -bc_left velocity {over_v}"]
    yield "boundary-profile", [f"boundary {CHAIN} -friction_amplitude_profile 0:1,8:1.4 {over_v}"]
    yield "boundary-state", [f"boundary {REST} {AGES} -boundary_parameter model_k0 -boundary_from 0.01 -boundary_to 1 "
                             f"-boundary_log {FILE}"]
    yield "boundary-curve", [f"boundary RUNS/figure6-cubic.yaml -boundary_points 9 {FILE}",
                             f"boundary RUNS/figure6-carlson-langer.yaml -boundary_points 9 -boundary_of sliding {FILE}"]
    yield "boundary-stick-slip", [f"boundary {REST} -model_k0 0.2 -model_zeta 0.1414213562 -friction_law carlson-langer "
                                  f"-boundary_parameter model_v -boundary_from 0.5 -boundary_to 4 {FILE}"]
    yield "boundary-bautin", [f"boundary RUNS/bautin.yaml -boundary_points 7 -boundary_of sliding {FILE}"]
    yield "boundary-viscous", [f"boundary -grid_n 64 -grid_length 20 -model_nu 0.2 -state_law contact-age -state_b 0.4 {over_v} -boundary_of sliding"]


def orbits():
    pair = f"cycle {CHAIN} -grid_n 2 -model_v 0.3 -cycle_cell 0 {FILE}"
    yield "cycle", [f"cycle {FILE}", "cycle -model_gamma 40", "cycle -model_v -0.9 -cycle_spectrum -cycle_wavenumbers 20"]
    yield "cycle-state", [f"cycle {REST} {AGES} -model_k0 0.03 {FILE}"]
    yield "cycle-sticks", [f"cycle {REST} -friction_law carlson-langer -model_zeta 0.1 -cycle_spectrum {FILE}",
                           f"cycle {REST} -friction_law coulomb -state_law healing -model_zeta 0.2"]
    yield "cycle-branch", [f"cycle RUNS/cycle-canard.yaml -cycle_steps 12 {FILE}",
                           f"cycle {REST} -friction_law carlson-langer -model_zeta 0.3 -cycle_continue model_v -cycle_to 2 "
                           f"-cycle_steps 12 {FILE}"]
    yield "cycle-pair", [pair, f"cycle RUNS/cycle-stick-pair.yaml {FILE}"]
    yield "cycle-massless", [f"cycle {REST} -model_m 0 -model_zeta 0.2 {FILE}"]
    yield "wave-length", [f"wave -model_delta 0 -model_v 0.5 -wave_pulses 4 -wave_length 100 {FILE}"]
    yield "wave-speed", [f"wave -wave_speed -1.7 {FILE}", "wave -wave_speed 1.05 -wave_pulses 2"]
    yield "wave-spectrum", [f"wave -wave_speed 2 -wave_spectrum -spectrum_count 6 {FILE}"]
    yield "wave-laws", [f"wave -wave_speed 3 -friction_law rate-and-state -friction_a 0.15 -friction_b 0.25 -friction_D 0.6 -model_v 0.8 -model_gamma 7.5 "
                        f"-model_delta 0 {FILE}", "wave -wave_speed 2 -friction_law coulomb -friction_stick regularised "
                        "-friction_eps 0.49 -friction_slip_velocity 1.28 -friction_fd 0.41 -friction_fs 1.26 -model_gamma 1.23 -model_v 0.82"]
    yield "wave-branch", [f"wave RUNS/train-branch.yaml -wave_steps 8 {FILE}"]
    yield "wave-limits", [f"wave RUNS/train-limits.yaml -wave_steps 3 {FILE}"]


def others():
    over_v = "-sweep_parameter1 model_v -sweep_from1 0.2 -sweep_to1 1.2 -sweep_points1 4"
    yield "sweep-grid", [f"sweep {REST} -ts_max_time 30 {over_v} -sweep_parameter2 model_k0 -sweep_values2 0.5,1 {FILE}"]
    yield "sweep-sobol", [f"sweep {REST} -ts_max_time 5 {over_v} -sweep_sample sobol -sweep_count 9 {FILE}",
                          f"sweep {REST} -ts_max_time 5 {over_v} -sweep_sample random -sweep_count 5 -sweep_seed 4 {FILE}"]
    yield "sweep-follow", [f"sweep {REST} -ts_max_time 30 {over_v} -sweep_follow {FILE}"]
    yield "sweep-refine", [f"sweep {REST} -ts_max_time 60 {over_v} -sweep_refine 0.05 {FILE}"]
    yield "sweep-spectrum", [f"sweep -sweep_command spectrum -grid_n 16 {over_v} -sweep_files {FILE} @2"]
    yield "sweep-boundary", [f"sweep -sweep_command boundary -boundary_parameter model_v -boundary_from 0.3 -boundary_to 2 "
                             f"-sweep_parameter1 model_gamma -sweep_values1 2,3,5 {FILE}"]
    yield "sweep-again", [f"sweep {REST} -ts_max_time 5 {over_v} {FILE}", "sweep -restart a.h5"]
    yield "chart", ["chart -grid_n 32 -ts_max_time 2 -chart_methods rk:5dp,arkimex:4:friction -chart_tolerances 1e-4,1e-6 "
                    "-chart_orders 4 -chart_repeats 1 -out_file a.h5"]
    yield "limits", ["chart RUNS/limits-gamma.yaml -chart_kind limits -chart_methods rk:3bs -chart_values 3,10 -out_file a.h5"]
    yield "laws", ["laws -laws_points 31 -out_file a.h5", "laws RUNS/laws.yaml -out_file b.h5"]
    yield "help", ["--help", "--version", "run -help", "boundary -help", "sweep -help"]
    yield "refusals", [
        "", "runs", "run -model_gama 3", "run -model_gamma x", "run -model_gamma -1", "run -grid_n 10000000000",
        "run -friction_law cubik", "run -bc_left periodic -bc_right free", "run nothing.yaml", "run -out_file /nowhere/a.h5",
        "run -ts_type eimex", "run -friction_law coulomb -ts_type bdf", "run -grid_n 3 @4", "run -init_file nothing.h5 -init_type file",
        "run -ts_max_time soon", "run -restart nothing", "run -state_law ageing", "spectrum -load_v 0:1,1:2",
        "spectrum -friction_law rate-and-state -model_v 0", "boundary", "boundary -boundary_parameter grid_n -boundary_from 1 -boundary_to 9",
        "wave", "wave -wave_speed 0.5", "wave -wave_length 10 -wave_speed 2", "cycle -model_v 3", "sweep", "laws -laws_points 1",
        "chart -chart_methods rk:9", "run -snes_typ newtonls", "run -out_limit 1e-9 -out_file a.h5", "run -model_m 0 -model_form chain",
    ]


def scenes():
    """(name, steps) of every scene, by name."""
    found = [scene for kind in (runs, spectra, boundaries, orbits, others) for scene in kind()]
    names = [name for name, _ in found]
    assert len(set(names)) == len(names)
    return found
