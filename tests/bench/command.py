"""What `stickslip run` costs beside its bare steps: processor time of the whole command over that of the steps alone
(bench_steps), without output, with 50 frames, probes, events and checkpoints; on two ranks also what wall time gains from
the second. Run by hand, after `. scripts/prepare.sh`, on a machine that does nothing else:

    ninja -C build stickslip bench_steps
    python3 tests/bench/command.py --all                  # every table below, in Markdown: twelve minutes
    python3 tests/bench/command.py                        # whole command over bare steps, 1e3 to 1e7 nodes: eight
    python3 tests/bench/command.py --shares 2,5,20,100    # measuring in runs of so many steps, as -log_view has it
    python3 tests/bench/command.py --frames 200           # 200 frames at 1e6 nodes on 1, 2 and 4 ranks
    python3 tests/bench/command.py --machine              # what two programs that know nothing of each other gain
    python3 tests/bench/command.py --memory               # a rank's memory: held ends, profiles, spread, displacement
                                  [--nodes 1e3,1e4,...] [--ranks 1,2] [--rounds 3] [--seconds 1]
                                  [--output none,frames,probes,events,checkpoints] [--build build]

A ring at order 4 with the cubic law and rk:5dp, 20 nodes a unit of length; the end is such that the steps take about
--seconds (five times that at 1e7). `frames` has at least 1000 steps up to 1e5 nodes, whatever they take, and 300 at 1e6.
Command and bare steps take turns; the ratio is that of the medians, in brackets without the start, which is
the processor time of a command that takes no step. On several ranks times are sums over the ranks, the command's with
mpirun itself. Gain: wall time of one rank over that of two, of the bare steps and of the command less its start.
"""
import argparse
import os
import re
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
        short = end_for(n, asked.seconds if n < 1e7 else 5 * asked.seconds)
        of_short = bare(n, short, 1)[0]
        for kind in asked.output:
            if kind == "frames" and n > 1e6:
                continue
            least = LEAST_STEPS.get(n, 1000) if kind == "frames" else 0
            end = short * max(1., 1.05 * least / of_short)
            steps = of_short if end == short else bare(n, end, 1)[0]
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


def shares(counts, nodes, rounds):
    """Of runs of about so many steps: the time of measuring beside that of the steps, both by -log_view."""
    print("| n | steps | TSStep, ms | Measuring, ms | Measuring/TSStep |")
    print("|---|---|---|---|---|")
    for n in nodes:
        for count in counts:
            if n * count > 2e8:
                continue
            words = [os.path.join(BUILD, "stickslip"), "run", "-progress", "off", *scene(n, 0.1 * count), "-log_view",
                     ":log"]
            found = []
            for _ in range(rounds if n * count < 2e7 else 1):
                spent(words, 1)
                with open("log") as log:
                    rows = re.findall(r"^(TSStep|Measuring) +([0-9]+) +\S+ +(\S+)", log.read(), re.M)
                steps = max(int(row[1]) for row in rows if row[0] == "TSStep")
                times = {name: 1e3 * float(time) for name, _, time in rows}
                found.append((times["Measuring"] / times["TSStep"], steps, times))
            share, steps, times = sorted(found, key=lambda one: one[0])[len(found) // 2]
            print(f"| {n:.0e} | {steps} | {times['TSStep']:.2f} | {times['Measuring']:.2f} | {share:.3f} |", flush=True)


LONG = {"held ends": "-bc_left velocity -bc_left_value 0.3 -bc_right velocity -init_type layer -init_width 20",
        "profile of friction's amplitude": "-init_type sine -friction_amplitude_profile 0:1,100:1.2,200:1",
        "spread": "-init_type sine -friction_spread 0.1",
        "events": "-init_type sine -out_events true",
        "out_displacement": "-init_type sine -out_displacement true"}


def memory(own):
    """The largest memory of a rank with so many nodes, one alone and each of four with all the others'."""
    print("| scene | 1 rank, MB | each of 4, MB | nodes a rank |")
    print("|---|---|---|---|")
    for name, options in LONG.items():
        peaks = []
        for ranks in (1, 4):
            n = own * ranks
            words = [os.path.join(BUILD, "stickslip"), "run", "-progress", "off", "-grid_n", str(n), "-grid_length",
                     str(n // 20), *options.split(), "-ts_max_time", "0.01", "-ts_dt", "0.005", "-ts_adapt_type", "none",
                     "-out_file", "o.h5", "-out_frames", "2"]
            process = subprocess.Popen(launcher(ranks) + words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            _, status, used = os.wait4(process.pid, 0)
            peaks.append(f"{used.ru_maxrss / 1024:.0f}" if status == 0 else "failed")
        print(f"| {name} | {peaks[0]} | {peaks[1]} | {own} |", flush=True)


def main():
    global BUILD
    parser = argparse.ArgumentParser()
    numbers = lambda kind: lambda text: [kind(float(part)) for part in text.split(",")]
    parser.add_argument("--build", default=BUILD, help="the folder of the programs")
    parser.add_argument("--nodes", type=numbers(int), default=[10**k for k in range(3, 8)])
    parser.add_argument("--ranks", type=numbers(int), default=[1, 2])
    parser.add_argument("--output", type=lambda text: text.split(","), default=list(KINDS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=1)
    parser.add_argument("--frames", type=int, help="so many at 1e6 nodes on 1, 2 and 4 ranks, and nothing else")
    parser.add_argument("--shares", type=numbers(int), help="measuring in runs of so many steps, and nothing else")
    parser.add_argument("--machine", action="store_true", help="two programs side by side, and nothing else")
    parser.add_argument("--memory", action="store_true", help="memory of a rank, and nothing else")
    parser.add_argument("--all", action="store_true", help="all tables, one after the other")
    asked = parser.parse_args()
    BUILD = os.path.abspath(asked.build)
    with tempfile.TemporaryDirectory(dir=os.getcwd()) as folder:
        os.chdir(folder)
        tables = [("frames", lambda: frames_of_a_million(asked.frames or 200, 1)),
                  ("shares", lambda: shares(asked.shares or [2, 5, 20, 100, 1000], asked.nodes, asked.rounds)),
                  ("machine", lambda: two_at_once([n for n in asked.nodes if n >= 1e5], min(asked.rounds, 2))),
                  ("memory", lambda: memory(2_500_000))]
        chosen = [(name, run) for name, run in tables if asked.all or getattr(asked, name)]
        for name, run in [("command over steps", lambda: table(asked)), *chosen] if asked.all or not chosen else chosen:
            begin = time.monotonic()
            run()
            print(f"{name}: {time.monotonic() - begin:.0f} s\n", flush=True)


if __name__ == "__main__":
    main()
