"""What `stickslip run` costs beside its bare steps: processor time of the whole command over that of the steps alone
(bench_steps), without output, with 50 frames, probes, events and checkpoints. Run by
hand, on several ranks after `. scripts/prepare.sh`:

    ninja -C build stickslip bench_steps
    python3 tests/bench/command.py [--nodes 1000,10000,100000,1000000] [--ranks 1,2] [--rounds 3] [--seconds 1]
                                  [--output none,frames,probes,events,checkpoints] [--build build]

A ring at order 4 with the cubic law and rk:5dp, 20 nodes a unit of length; the end is such that the steps take about
--seconds. Command and bare steps take turns; the ratio is that of the medians. On several ranks both are sums over the
ranks, the command's with mpirun itself. `start` is the processor time of a command that takes no step, which every
command pays once; the ratios without it say what measuring and output add to a long run.
"""
import argparse
import os
import resource
import statistics
import subprocess
import tempfile

BUILD = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "build")
KINDS = {"none": "", "frames": "-out_file o.h5 -out_frames 50", "probes": "-out_file o.h5 -out_frames 2 -out_probes 1,10,20",
         "events": "-out_file o.h5 -out_frames 2 -out_events true",
         "checkpoints": "-out_file o.h5 -out_frames 2 -out_checkpoint_every {tenth}"}


def launcher(ranks):
    return ["mpirun", "-n", str(ranks)] if ranks > 1 else []


def spent(words, ranks):
    """Processor time of a command and its ranks, and what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(launcher(ranks) + words, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def scene(n, end):
    return ["-grid_n", str(n), "-grid_length", str(n / 20), "-init_type", "sine", "-init_mode", "3", "-scene_reduce",
            "off", "-ts_max_time", repr(end)]


def bare(n, end, ranks):
    _, said = spent([os.path.join(BUILD, "tests", "bench_steps"), *scene(n, end)], ranks)
    steps, cpu, _ = said.split()
    return int(steps), ranks * float(cpu)


def end_for(n, seconds):
    """The end of a run whose steps take about so long."""
    end = 1.
    while True:
        took = bare(n, end, 1)[1]
        if took > 0.2 * seconds:
            return end * seconds / took
        end *= min(10, 0.5 * seconds / max(took, 1e-3))


def rows(n, ranks, rounds, seconds, kinds):
    end = end_for(n, seconds)
    steps, _ = bare(n, end, ranks)
    for kind in kinds:
        options = KINDS[kind].format(tenth=max(1, steps // 10)).split()
        program = [os.path.join(BUILD, "stickslip"), "run", "-progress", "off"]
        base, whole, start = [], [], []
        for _ in range(rounds):
            base.append(bare(n, end, ranks)[1])
            whole.append(spent([*program, *scene(n, end), *options], ranks)[0])
            start.append(spent([*program, *scene(n, end), "-ts_max_steps", "0"], ranks)[0])
        base, whole, start = (statistics.median(times) for times in (base, whole, start))
        print(f"| {n:.0e} | {ranks} | {steps} | {kind} | {base:.2f} | {whole:.2f} | {start:.2f} | {whole / base:.2f} | "
              f"{(whole - start) / base:.2f} |", flush=True)


def main():
    global BUILD
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", default=BUILD, help="the folder of the programs")
    parser.add_argument("--nodes", default="1000,10000,100000,1000000")
    parser.add_argument("--ranks", default="1,2")
    parser.add_argument("--output", default=",".join(KINDS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=1)
    asked = parser.parse_args()
    BUILD = os.path.abspath(asked.build)
    print("| n | ranks | steps | output | bare steps, s | command, s | start, s | command/steps | less the start |")
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for n in asked.nodes.split(","):
            for ranks in asked.ranks.split(","):
                rows(int(n), int(ranks), asked.rounds, asked.seconds, asked.output.split(","))


if __name__ == "__main__":
    main()
