"""Runs a few commands, on 1 and 2 ranks, under valgrind; what is not in valgrind.supp is a failure.

    STICKSLIP=build/stickslip STICKSLIP_SOURCE=. python3 tests/valgrind.py      (or ./check valgrind)

Memory that is read before it is written, used after it is freed, or lost. About three minutes on one core.
"""
import os
import shutil
import subprocess
import sys
import tempfile

from calls import PROGRAM, SOURCE

COMMANDS = [
    (1, "run -grid_n 24 -grid_length 12 -ts_max_time 1 -init_type sine -out_file a.h5 -out_checkpoint_every 4"
        " -out_probes 3 -out_displacement -summary a.json"),
    (1, "run -restart a.chk-000004.h5 -out_file a.h5 -summary a.json"),
    (1, "run -grid_n 24 -grid_length 12 -ts_max_time 0.5 -init_type sine -ts_type arkimex -imex_implicit both"),
    (1, "run -grid_n 24 -grid_length 12 -ts_max_time 0.5 -init_type sine -ts_type arkimex -imex_implicit friction"
        " -friction_law carlson-langer -friction_stick regularised -friction_eps 0.1 -state_law healing"),
    (1, "run -grid_n 24 -grid_length 12 -ts_max_time 0.5 -init_type sine -ts_type rosw -imex_implicit friction -bc_left velocity"
        " -friction_spread 0.3 -friction_law coulomb -state_law healing -state_D 0.3 -state_t_h 2 -state_tau_inf 1.5"),
    (1, "run -model_form chain -grid_n 9 -bc_left free -friction_law rate-and-state -ts_max_time 0.2 -init_noise 0.01"),
    (1, "run -grid_n 24 -grid_length 12 -ts_type bdf -ts_max_time 0.1 -bc_left velocity -init_type layer"),
    (1, "run -grid_n 24 -ts_rtol 0 -ts_dt 0.9 -ts_type rk -ts_rk_type 4 -init_type sine"),  # explodes: exit code 1
    (1, "run -grid_n -4"),
    (1, "spectrum -grid_n 24 -bc_left velocity -out_file s.h5 -summary s.json"),
    (1, "boundary -grid_n 16 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5 -summary b.json"),
    (1, "wave -wave_pulses 2 -wave_length 60 -out_file w.h5"),
    (1, "laws -out_file l.h5 -laws_points 11"),
    (1, "run -grid_length 12 -init_type sine -ts_max_time 0.3 -accuracy 1e-2"),
    (2, "run -model_form chain -grid_n 9 -bc_left free -friction_law carlson-langer -init_psi 0 -init_noise 0.3"
        " -ts_max_time 3 -out_events -out_file e.h5"),
    (2, "run -grid_n 24 -grid_length 12 -ts_max_time 1 -init_type sine -out_file c.h5 -out_checkpoint_every 4"
        " -out_probes 3"),
    (2, "run -grid_n 24 -grid_length 12 -ts_max_time 0.3 -init_type sine -ts_type arkimex -imex_implicit wave"),
    (2, "spectrum -grid_n 24"),
]


def main():
    if not shutil.which("valgrind"):
        sys.exit("valgrind is not installed")
    valgrind = ["valgrind", "-q", "--leak-check=full", "--show-leak-kinds=definite,possible", "--num-callers=25",
                "--errors-for-leak-kinds=definite,possible", "--error-exitcode=99", "--gen-suppressions=all",
                f"--suppressions={os.path.join(SOURCE, 'tests', 'valgrind.supp')}"]
    failures = 0
    with tempfile.TemporaryDirectory(prefix="stickslip-") as folder:
        os.chdir(folder)
        for ranks, arguments in COMMANDS:
            words = (["mpirun", "-n", str(ranks)] if ranks > 1 else []) + valgrind + [PROGRAM, *arguments.split()]
            if not arguments.startswith("laws"):
                words += ["-progress", "off"]
            done = subprocess.run(words, capture_output=True, text=True, timeout=600)
            found = [line for line in done.stderr.splitlines() if line.startswith("==")]
            if done.returncode not in (0, 1, 2) or found:
                failures += 1
                print(f"FAILED {ranks} ranks: {arguments}: exit {done.returncode}\n" + done.stderr[-6000:])
            print(f"{'clean' if not found else 'FOUND'}, {ranks} ranks: {arguments}", flush=True)
        os.chdir("/")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
