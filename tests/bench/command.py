"""What `stickslip run` costs beside its bare steps: processor time of the whole command over that of the steps alone
(bench_steps), without output, with 50 frames, probes, events and checkpoints; on two ranks also what wall time gains from
the second. Run by hand, after `. scripts/prepare.sh`, on a machine that does nothing else:

    ninja -C build stickslip bench_steps
    python3 tests/bench/command.py                        # docs/performance.md's table, 1e3 to 1e7 nodes: ten minutes
    python3 tests/bench/command.py --frames 200           # 200 frames at 1e6 nodes on 1, 2 and 4 ranks: two minutes
    python3 tests/bench/command.py --steps 1,5,20         # runs of few steps: what measuring costs there
    python3 tests/bench/command.py --machine              # what two programs that know nothing of each other gain
                                  [--nodes 1e3,1e4,...] [--ranks 1,2] [--rounds 3] [--seconds 1.5]
                                  [--output none,frames,probes,events,checkpoints] [--build build]

A ring at order 4 with the cubic law and rk:5dp, 20 nodes a unit of length; the end is such that the steps take about
--seconds, or are so many (--steps). `frames` has at least 1000 steps up to 1e5 nodes, whatever they take, and 300 at 1e6.
Command and bare steps take turns; the ratio is that of the medians, in brackets without the start, which is
the processor time of a command that takes no step. On several ranks times are sums over the ranks, the command's with
mpirun itself. Gain: wall time of one rank over that of two, of the bare steps and of the command less its start.
"""
import argparse
import os
import resource
import statistics
import subprocess
import tempfile
import time

BUILD = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "build")
KINDS = {"none": "", "frames": "-out_file o.h5 -out_frames {frames}",
         "probes": "-out_file o.h5 -out_frames 2 -out_probes 1,10,20",
         "events": "-out_file o.h5 -out_frames 2 -out_events true",
         "checkpoints": "-out_file o.h5 -out_frames 2 -out_checkpoint_every {tenth}"}
LEAST_STEPS = {1e6: 300}  # of `frames`; 1000 at fewer nodes, and 1e7 nodes have none: 50 of them are 8 GB


def launcher(ranks):
    return ["mpirun", "-n", str(ranks)] if ranks > 1 else []


def spent(words, ranks):
    """Processor time of a command and its ranks, wall time, and what it printed."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(launcher(ranks) + words, capture_output=True, text=True)
    after, end = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    if done.returncode != 0:
        raise SystemExit(" ".join(words) + "\n" + done.stderr)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, end - begin, done.stdout


def scene(n, end):
    return ["-grid_n", str(n), "-grid_length", str(n / 20), "-init_type", "sine", "-init_mode", "3", "-scene_reduce",
            "off", "-ts_type", "rk", "-ts_rk_type", "5dp", "-ts_max_time", repr(end)]


def bare(n, end, ranks, more=()):
    """Steps, and their processor and wall time."""
    steps, cpu, wall = spent([os.path.join(BUILD, "tests", "bench_steps"), *scene(n, end), *more], ranks)[2].split()
    return int(steps), ranks * float(cpu), float(wall)


def end_for(n, seconds, least_steps=0):
    """The end of a run whose steps take about so long, or are so many."""
    end = 1e-2
    while True:
        steps, took, _ = bare(n, end, 1)
        if took > 0.2 * seconds and steps >= 0.05 * least_steps:
            return end * max(seconds / took, 1.05 * least_steps / steps)
        end *= min(10., max(0.5 * seconds / max(took, 1e-3), 0.2 * least_steps / max(1, steps), 1.5))


def medians(n, end, ranks, options, rounds):
    """Processor and wall times: bare steps, command, start."""
    program = [os.path.join(BUILD, "stickslip"), "run", "-progress", "off"]
    times = [[], [], []]
    for _ in range(rounds):
        times[0].append(bare(n, end, ranks)[1:])
        times[1].append(spent([*program, *scene(n, end), *options], ranks)[:2])
        times[2].append(spent([*program, *scene(n, end), "-ts_max_steps", "0"], ranks)[:2])
    return [[statistics.median(one[k] for one in part) for k in (0, 1)] for part in times]


def table(asked):
    print("| n | output | steps | ranks | bare steps, s | command, s | start, s | command/steps (less the start) | "
          "gain of steps | gain of command |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for n in asked.nodes:
        for kind in asked.output:
            if kind == "frames" and n > 1e6:
                continue
            seconds = min(asked.seconds, 1.) if n < 1e6 else asked.seconds if n < 1e7 else 5 * asked.seconds
            least = LEAST_STEPS.get(n, 1000) if kind == "frames" else 0
            end = end_for(n, seconds, least)
            steps = bare(n, end, 1)[0]
            rounds = asked.rounds if n < 1e6 else 1
            options = KINDS[kind].format(tenth=max(1, steps // 10), frames=50).split()
            alone = None
            for ranks in asked.ranks if n >= 1e5 else asked.ranks[:1]:
                base, whole, start = medians(n, end, ranks, options, rounds)
                walls = base[1], whole[1] - start[1]
                gains = ["", ""] if alone is None else [f"{a / b:.2f}" for a, b in zip(alone, walls)]
                alone = alone or walls
                print(f"| {n:.0e} | {kind} | {steps} | {ranks} | {base[0]:.2f} | {whole[0]:.2f} | {start[0]:.2f} | "
                      f"{whole[0] / base[0]:.2f} ({(whole[0] - start[0]) / base[0]:.2f}) | {gains[0]} | {gains[1]} |",
                      flush=True)


def frames_of_a_million(count, rounds):
    """Wall and processor time of a run with so many frames beside the same run with two."""
    n, program = 1000000, [os.path.join(BUILD, "stickslip"), "run", "-progress", "off"]
    end = end_for(n, 1, 200)
    steps = bare(n, end, 1)[0]
    print(f"| ranks | {steps} steps, 2 frames: wall, processor, s | {count} frames | a frame: wall, processor, ms | MB/s |")
    print("|---|---|---|---|---|")
    for ranks in (1, 2, 4):
        times = []
        for many in (2, count):
            words = [*program, *scene(n, end), "-out_file", "o.h5", "-out_frames", str(many), "-out_limit", "1000"]
            taken = [spent(words, ranks)[:2] for _ in range(rounds)]
            times.append([statistics.median(one[k] for one in taken) for k in (1, 0)])
            os.remove("o.h5")
        each = [(b - a) / (count - 2) for a, b in zip(*times)]
        print(f"| {ranks} | {times[0][0]:.2f}, {times[0][1]:.2f} | {times[1][0]:.2f}, {times[1][1]:.2f} | "
              f"{1e3 * each[0]:.1f}, {1e3 * each[1]:.1f} | {16e-6 * n / each[0]:.0f} |", flush=True)


def two_at_once(nodes, rounds):
    """Bare steps of half the nodes, one program alone and two side by side: what the machine gives a second rank when
    nothing is sent and nobody waits; beside it two ranks with all the nodes."""
    print("| n | half of it alone, s | two halves side by side, s | two ranks, s | gain side by side | gain of two ranks |")
    print("|---|---|---|---|---|---|")
    for n in nodes:
        end = end_for(n, 2)
        words = [os.path.join(BUILD, "tests", "bench_steps"), *scene(n // 2, end)]
        alone, beside, ranks, whole = [], [], [], []
        for _ in range(rounds):
            whole.append(bare(n, end, 1)[2])
            alone.append(bare(n // 2, end, 1)[2])
            both = [subprocess.Popen(words, stdout=subprocess.PIPE, text=True) for _ in range(2)]
            beside.append(max(float(one.communicate()[0].split()[2]) for one in both))
            ranks.append(bare(n, end, 2)[2])
        whole, alone, beside, ranks = (statistics.median(times) for times in (whole, alone, beside, ranks))
        print(f"| {n:.0e} | {alone:.3f} | {beside:.3f} | {ranks:.3f} | {2 * alone / beside:.2f} | {whole / ranks:.2f} |",
              flush=True)


def few_steps(counts, nodes, rounds):
    """Of runs of so many steps: the command less its start, over the bare steps and their set-up."""
    print("| n | steps | bare steps and their set-up, s | command less its start over them |")
    print("|---|---|---|---|")
    for n in nodes:
        for count in counts:
            end = 0.1 * count  # steps of about 0.1
            base, whole, start = medians(n, end, 1, [], rounds)
            set_up = statistics.median(bare(n, end, 1, ["-ts_max_steps", "0"])[1] for _ in range(rounds))
            print(f"| {n:.0e} | {bare(n, end, 1)[0]} | {base[0]:.3f} | {(whole[0] - start[0] + set_up) / base[0]:.2f} |",
                  flush=True)


def main():
    global BUILD
    parser = argparse.ArgumentParser()
    numbers = lambda kind: lambda text: [kind(float(part)) for part in text.split(",")]
    parser.add_argument("--build", default=BUILD, help="the folder of the programs")
    parser.add_argument("--nodes", type=numbers(int), default=[10**k for k in range(3, 8)])
    parser.add_argument("--ranks", type=numbers(int), default=[1, 2])
    parser.add_argument("--output", type=lambda text: text.split(","), default=list(KINDS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=1.5)
    parser.add_argument("--frames", type=int, help="so many at 1e6 nodes on 1, 2 and 4 ranks, and nothing else")
    parser.add_argument("--steps", type=numbers(int), help="runs of so many steps, and nothing else")
    parser.add_argument("--machine", action="store_true", help="two programs side by side, and nothing else")
    asked = parser.parse_args()
    BUILD = os.path.abspath(asked.build)
    with tempfile.TemporaryDirectory(dir=os.getcwd()) as folder:
        os.chdir(folder)
        if asked.frames:
            frames_of_a_million(asked.frames, asked.rounds)
        elif asked.machine:
            two_at_once([n for n in asked.nodes if n >= 1e4], asked.rounds)
        elif asked.steps:
            few_steps(asked.steps, asked.nodes, asked.rounds)
        else:
            table(asked)


if __name__ == "__main__":
    main()
