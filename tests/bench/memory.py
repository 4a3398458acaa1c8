"""The largest memory of a command beside what it is stated to take at most (include/stickslip/study/size.hpp). The program states it
itself: a run with -check, other commands when they are refused, for which each is started with a limit of addresses.

    STICKSLIP=build/stickslip /usr/bin/python3 tests/bench/memory.py [--only bdf,spectrum] [--size 1] [--random 20]

Prints the table of docs/developers/performance.md; --size 10 has ten times as many nodes, --random draws runs instead. The exit code is
1 where a peak is above what is stated, or less than a 1.3th of it. Two minutes and 1 GB of memory.
"""
import argparse
import os
import random
import re
import shlex
import subprocess
import sys
import tempfile

PROGRAM = os.path.abspath(os.environ.get("STICKSLIP", "build/stickslip"))
RANK = 55e6  # bytes from the start
ADDRESSES = 500_000_000  # with which the program starts, and a scene is made
RUN = "run -init_type sine -scene_reduce off -ts_max_time 1"
ENDS, STATE, FILE = "-bc_left free -bc_right free", "-friction_law rate-and-state", "-out_file m.h5"
BRIEF = "-ts_max_steps 4"  # where steps are dear
SPECTRUM = "spectrum -spectrum_count 4"
BOUNDARY = "boundary -boundary_of sliding -boundary_parameter model_v -boundary_from 0.8 -boundary_to 1.2"
ROWS = [  # what, nodes, ranks, options
    ("`run`", 1000000, 1, RUN), ("`run`, rk:5dp", 1000000, 1, f"{RUN} -ts_type rk -ts_rk_type 5dp"),
    ("`run`, rk:5dp", 10000000, 1, f"{RUN} -ts_type rk -ts_rk_type 5dp"),
    ("`run`, rk:5dp, four ranks", 10000000, 4, f"{RUN} -ts_type rk -ts_rk_type 5dp"),
    ("fixed steps", 1000000, 1, f"{RUN} -ts_type rk -ts_rk_type 5dp -ts_adapt_type none -ts_dt 0.1"),
    ("a state", 1000000, 1, f"{RUN} -ts_type rk -ts_rk_type 5dp -ts_max_time 0.002 {STATE}"),
    ("spread of friction", 1000000, 1, f"{RUN} -friction_spread 0.1"),
    ("frames", 1000000, 1, f"{RUN} {FILE} -out_frames 10"),
    ("frames, rk:5dp", 1000000, 1, f"{RUN} {FILE} -out_frames 10 -ts_type rk -ts_rk_type 5dp"),
    ("frames, checkpoints", 1000000, 1, f"{RUN} {FILE} -out_frames 10 -out_checkpoint_every 1"),
    ("frames, `out_displacement`", 600000, 1, f"{RUN} {FILE} -out_frames 10 -out_displacement true"),
    ("frames, `out_displacement`, ends", 600000, 1, f"{RUN} {FILE} -out_frames 10 -out_displacement true {ENDS}"),
    ("`out_events`", 1000000, 1, f"{RUN} -out_events true"),
    ("`out_events`, `out_rupture`", 1000000, 1, f"{RUN} -out_events true -out_rupture true"),
    ("one exponent", 600000, 1, f"{RUN} -lyapunov_count 1"), ("three", 600000, 1, f"{RUN} -lyapunov_count 3"),
    ("exact stick", 600000, 1, f"{RUN} {BRIEF} -friction_law coulomb"),
    ("exact stick, `arkimex`, friction", 600000, 1,
     f"{RUN} {BRIEF} -friction_law coulomb -ts_type arkimex -imex_implicit friction"),
    ("`leapfrog`", 1000000, 1, f"{RUN} -ts_type leapfrog -ts_dt 0.1"),
    ("`arkimex`, friction", 1000000, 1, f"{RUN} -ts_type arkimex -imex_implicit friction"),
    ("`arkimex`, wave", 1000000, 1, f"{RUN} -ts_type arkimex -imex_implicit wave"),
    ("`arkimex`, wave, a state", 600000, 1,
     f"{RUN} {BRIEF} -ts_type arkimex -ts_arkimex_type 4 -imex_implicit wave {STATE}"),
    ("`arkimex`, both", 1000000, 1, f"{RUN} -ts_type arkimex -imex_implicit both"),
    ("`arkimex`, both, PETSc's solvers", 300000, 1,
     f"{RUN} {BRIEF} -ts_type arkimex -imex_implicit both -snes_type newtonls"),
    ("rk:5dp, PETSc's step", 600000, 1, f"{RUN} -ts_type rk -ts_rk_type 5dp -rk_fused false"),
    ("euler", 600000, 1, f"{RUN} -ts_type euler -ts_dt 0.1"), ("ssp", 600000, 1, f"{RUN} -ts_type ssp -ts_dt 0.1"),
    ("`rosw`", 300000, 1, f"{RUN} {BRIEF} -ts_type rosw"),
    ("`bdf`", 300000, 1, f"{RUN} {BRIEF} -ts_type bdf"),
    ("`bdf`, ends, order 8", 300000, 1, f"{RUN} {BRIEF} -ts_type bdf -grid_order 8 {ENDS}"),
    ("`bdf`, a state", 100000, 1, f"{RUN} {BRIEF} -ts_type bdf {STATE}"),
    ("`cn`", 300000, 1, f"{RUN} {BRIEF} -ts_type cn -ts_dt 0.001"),
    ("`theta`", 300000, 1, f"{RUN} {BRIEF} -ts_type theta -ts_dt 0.001"),
    ("`beuler`", 300000, 1, f"{RUN} {BRIEF} -ts_type beuler -ts_dt 0.001"),
    ("`alpha`", 300000, 1, f"{RUN} {BRIEF} -ts_type alpha -ts_dt 0.001"),
    ("one node for all", 3000000, 1, "run -init_type uniform -ts_max_time 1"),
    ("`spectrum`", 20000, 1, SPECTRUM), ("`spectrum`", 300000, 1, SPECTRUM),
    ("`spectrum`, order 8", 100000, 1, f"{SPECTRUM} -grid_order 8"),
    ("`spectrum`, 12 eigenvalues", 100000, 1, "spectrum -spectrum_count 12"),
    ("`spectrum`, a state", 100000, 1, f"{SPECTRUM} {STATE}"),
    ("`spectrum`, free ends", 100000, 1, f"{SPECTRUM} {ENDS}"),
    ("`spectrum`, held and free ends", 60000, 1, f"{SPECTRUM} -bc_left velocity -bc_right free"),
    ("`boundary`", 300000, 1, BOUNDARY), ("`boundary`, order 8", 300000, 1, f"{BOUNDARY} -grid_order 8"),
    ("`boundary`, held and free ends", 300000, 1, f"{BOUNDARY} -bc_left velocity -bc_right free"),
    ("`chart`", 100000, 1, "chart -init_type sine -ts_max_time 1 -chart_methods rk:5dp,rk:3bs "
                           "-chart_tolerances 1e-3,1e-4 -chart_repeats 1"),
]


def drawn(count, seed):
    """Runs of any law, ends, order, method and output that go together."""
    draw = random.Random(seed)
    for _ in range(count):
        parts = [draw.choice(["", STATE, "-friction_law carlson-langer -friction_stick regularised", "-friction_spread 0.2"]),
                 draw.choice(["", ENDS, "-bc_left velocity -bc_right free"]), f"-grid_order {draw.choice([2, 4, 6])}",
                 draw.choice(["-ts_type rk -ts_rk_type " + draw.choice(["3bs", "5f", "5dp", "8vr"]),
                              "-ts_type rk -ts_rk_type 5bs -rk_fused false",
                              "-ts_type bdf", "-ts_type rosw", "-ts_type beuler -ts_dt 0.001",
                              f"-ts_type arkimex -ts_arkimex_type {draw.choice([3, 4, 5])} -imex_implicit "
                              + draw.choice(["friction", "wave", "both"])]),
                 draw.choice(["", "", f"{FILE} -out_times 1e-7", f"{FILE} -out_times 1e-7 -out_displacement true",
                              "-out_events true", "-lyapunov_count 2"])]
        options = " ".join(part for part in parts if part)
        yield options, 200000, 1, f"{RUN} {BRIEF} {options}"


def words_of(nodes, options):
    return [PROGRAM, *shlex.split(options), "-grid_n", str(nodes), "-grid_length", str(nodes)]


def stated(nodes, options):
    """Bytes of a node, as the program says them: of a run before its steps, else with a limit that is too low."""
    limit = []
    words = [*words_of(nodes, options), "-check", "true"]
    if "-scene_reduce off" not in options:
        limit, words = ["prlimit", f"--as={ADDRESSES}"], words_of(10000000, options)
    done = subprocess.run([*limit, *words], capture_output=True, text=True, check=False, timeout=60)
    found = re.search(r"([0-9.e+]+) bytes a node", done.stderr)
    if not found:
        raise SystemExit(f"{shlex.join(words)}: says nothing of bytes a node: {done.stderr}")
    return float(found[1])


def peak(nodes, ranks, options):
    """Bytes at most: of a command, and of the largest of several ranks; 0 where it fails."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    words = [*launcher, "timeout", "100", *words_of(nodes, options), "-progress", "off"]
    nowhere = [(os.POSIX_SPAWN_OPEN, k, "/dev/null", os.O_WRONLY, 0) for k in (1, 2)]
    _, status, used = os.wait4(os.posix_spawnp(words[0], words, os.environ, file_actions=nowhere), 0)
    return used.ru_maxrss * 1024 if status == 0 else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="rows whose name has one of these words")
    parser.add_argument("--size", type=float, default=1, help="so many times the nodes")
    parser.add_argument("--random", type=int, default=0, help="so many drawn runs")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rows = drawn(asked.random, asked.seed) if asked.random else ROWS
    print("| | nodes | bytes a node, stated | peak of a rank, stated, MB | measured | ratio |\n|---|---|---|---|---|---|")
    off = 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for what, nodes, ranks, options in rows:
            if not any(word in what for word in asked.only.split(",")):
                continue
            nodes = int(nodes * asked.size)
            node = stated(nodes, options)
            expected, seen = RANK + nodes / ranks * node, peak(nodes, ranks, options)
            if seen == 0 and asked.random:  # a scene that the method cannot solve
                print(f"| {what} | failed | | | | |", flush=True)
                continue
            off += not 1 / 1.3 < seen / expected <= 1
            print(f"| {what} | {nodes} | {node:.0f} | {expected / 1e6:.0f} | {seen / 1e6:.0f} | {seen / expected:.2f} |",
                  flush=True)
        os.chdir("/")
    return 1 if off else 0


if __name__ == "__main__":
    sys.exit(main())
