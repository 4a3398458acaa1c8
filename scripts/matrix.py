#!/usr/bin/python3
"""Writes the tables of docs/matrix.md, between their markers: every property of a scene against every command and what can be
asked of it, each cell from a run of the program.

usage: scripts/matrix.py build/stickslip [--check N [--seed S]]      --check: only N cells, drawn; says which are stale
"""
import argparse
import concurrent.futures
import os
import random
import re
import subprocess
import sys
import tempfile

PAGE = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "docs", "matrix.md")
CHAIN = "-model_form chain -grid_n 2 -bc_left free -model_k1 1 -model_v 0.3 -init_noise 0.05 -friction_law carlson-langer "
SMOOTH = CHAIN + "-friction_stick regularised -friction_eps 0.1 "
MEDIUM = "-grid_n 8 -grid_length 6 -grid_order 2 -init_noise 0.05 "
RATE = "-friction_law rate-and-state -state_law ageing "
# Rows: a property of a scene and the scene that has it.
SCENES = {
    "continuum, ring": MEDIUM,
    "continuum, free ends": MEDIUM + "-bc_left free",
    "continuum, a held end": MEDIUM + "-bc_left velocity -bc_left_value 0.3 -init_type layer",
    "chain, smooth friction": SMOOTH,
    "one block": SMOOTH + "-grid_n 1",
    "exact stick": CHAIN,
    "exact stick in a continuum": MEDIUM + "-friction_law carlson-langer",
    "rate-and-state": CHAIN.replace("-friction_law carlson-langer ", RATE),
    "strength by slip": CHAIN.replace("carlson-langer", "slip-weakening -friction_Dc 0.1 -state_law slip-since-stop"),
    "contact age": CHAIN + "-state_law contact-age -state_b 0.2",
    "a table of friction": SMOOTH.replace("carlson-langer", "table -friction_table 0:1,0.5:0.7,1:0.6,2:0.65"),
    "a plate of varying velocity": SMOOTH + "-load_v 0:0.3,2:0.4",
    "a sine of the plate": SMOOTH + "-load_sine_amplitude 0.1 -load_sine_period 5",
    "a sine of force": SMOOTH + "-load_force_sine_amplitude 0.1 -load_force_sine_period 5",
    "a varying normal load": SMOOTH + "-load_normal 0:1,2:1.2",
    "a sine of normal load": SMOOTH + "-load_normal_sine_amplitude 0.1 -load_normal_sine_period 5",
    "a plate that halts": CHAIN + "-friction_sigma 0.05 -load_halt",
    "unequal blocks": SMOOTH + "-model_m_profile 0:1,1:1.4",
    "amplitude along x": SMOOTH + "-friction_amplitude_profile 0:1,1:1.2",
    "speed of sound along x": MEDIUM + "-bc_left free -model_c_profile 0:1,6:1.3",
    "random friction": SMOOTH + "-friction_spread 0.1",
    "viscosity between neighbours": SMOOTH + "-model_nu 0.1",
    "drag": SMOOTH + "-model_drag 0.1",
    "no mass": CHAIN.replace("-friction_law carlson-langer ", RATE) + "-model_m 0 -friction_a 0.02 -friction_b 0.01 -init_psi steady "
               "-init_eta steady -init_noise 0",
}
RUN = "run -ts_max_time 3 -out_file a.h5 "
OVER = "-{0}_parameter{1} model_v -{0}_from{1} 0.2 -{0}_to{1} 0.4 "
# Columns: what is asked, in two tables.
TABLES = {
    "run": {
        "run": RUN,
        "two ranks": RUN,
        "`-accuracy`": RUN + "-accuracy 1e-3",
        "events": RUN + "-out_events",
        "displacement": RUN + "-out_displacement",
        "exponents": RUN + "-lyapunov_count 2",
        "clusters": RUN + "-stick_clusters on -grid_n 6",
        "restart": RUN + "-out_checkpoint_every 1",
        "`-ts_type arkimex`": RUN + "-ts_type arkimex",
    },
    "other commands": {
        "`spectrum`": "spectrum",
        "`boundary`": "boundary " + OVER.format("boundary", "") + "-boundary_of sliding",
        "end of stick-slip": "boundary " + OVER.format("boundary", "") + "-boundary_of stick-slip",
        "`cycle`": "cycle -cycle_cell 0",
        "its branch": "cycle -cycle_cell 0 -cycle_continue model_v -cycle_to 0.32",
        "`wave`": "wave -wave_pulses 1 -wave_length 10",
        "`sweep`": "sweep -ts_max_time 3 -out_file a.h5 " + OVER.format("sweep", 1) + "-sweep_points1 2",
        "`fit`": "fit -ts_max_time 3 -fit_data d.txt -fit_parameters model_v -fit_starts 1",
        "`chart`": "chart -ts_max_time 1 -chart_methods rk:5dp -chart_tolerances 1e-3 -chart_repeats 1 -out_file a.h5",
    },
}
SECONDS = 200
MPI = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
       "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}


def answer(program, scene, asked, table):
    """"" where it works; else why not, as the program says it. What ends as not found was tried: it works."""
    command, *more = TABLES[table][asked].split()
    start = ["mpirun", "-n", "2", program] if asked == "two ranks" else [program]
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "d.txt"), "w", encoding="utf-8") as file:
            file.writelines(f"{0.1 * k:g} {0.02 * k:g}\n" for k in range(1, 25))
        try:
            done = subprocess.run([*start, command, *SCENES[scene].split(), *more], cwd=folder, capture_output=True, text=True,
                                  env=os.environ | MPI, timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired:
            return f"takes longer than {SECONDS} s here"
    if done.returncode != 2:
        if done.returncode not in (0, 1):
            raise RuntimeError(f"exit {done.returncode}: {scene}: {asked}\n{done.stderr}")
        return ""
    said = next(line for line in done.stderr.splitlines() if "error: " in line).split("error: ", 1)[1]
    return re.sub(r"the command \w+", "the command", said.split(": ", 1)[-1])  # without the option, whose row or column it is


def cells(program, chosen):
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        return dict(zip(chosen, pool.map(lambda cell: answer(program, *cell), chosen)))


def every_cell():
    return [(scene, asked, table) for table, columns in TABLES.items() for asked in columns for scene in SCENES]


def written(table, found):
    """The table, with a number in each cell that does not work, and the reasons below."""
    columns, reasons = list(TABLES[table]), []
    text = "| a scene with | " + " | ".join(columns) + " |\n|---|" + "---|" * len(columns) + "\n"
    for scene in SCENES:
        row = []
        for asked in columns:
            why = found[scene, asked, table]
            if why and why not in reasons:
                reasons.append(why)
            row.append(str(reasons.index(why) + 1) if why else "yes")
        text += f"| {scene} | " + " | ".join(row) + " |\n"
    return text + "\n" + "".join(f"{k}. `{why}`\n" for k, why in enumerate(reasons, 1))


def read(page):
    """The cells as they stand on the page."""
    found = {}
    for table, columns in TABLES.items():
        text = re.search(rf"<!-- table: {table} -->\n(.*?)<!-- end of table -->", page, re.DOTALL)[1]
        reasons = re.findall(r"^\d+\. `(.*)`$", text, re.MULTILINE)
        for line in text.splitlines()[2:]:
            if not line.startswith("| "):
                break
            scene, *row = line.strip("| ").split(" | ")
            for asked, cell in zip(columns, row):
                found[scene, asked, table] = "" if cell == "yes" else reasons[int(cell) - 1]
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--check", type=int, metavar="N")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    program = os.path.abspath(given.program)
    with open(PAGE, encoding="utf-8") as file:
        page = file.read()
    if given.check:
        chosen = random.Random(given.seed).sample(every_cell(), given.check)
        stands = read(page)
        stale = [f"{cell}: {now!r}, on the page {stands.get(cell)!r}" for cell, now in cells(program, chosen).items()
                 if now != stands.get(cell)]
        sys.exit("\n".join(stale) or 0)
    found = cells(program, every_cell())
    for table in TABLES:
        page = re.sub(rf"(<!-- table: {table} -->\n).*?(<!-- end of table -->)",
                      lambda mark, table=table: mark[1] + written(table, found) + mark[2], page, flags=re.DOTALL)
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(page)


if __name__ == "__main__":
    main()
