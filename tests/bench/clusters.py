"""What a catalogue costs when only what slides is advanced: runs/catalogue.yaml for several lengths of the chain: processor time of
the whole command, of an event, of a step of a node, and the most memory.

usage: tests/bench/clusters.py [build/stickslip]
"""
import json
import os
import resource
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def cost(program, n, until):
    with tempfile.TemporaryDirectory() as folder:
        out, summary = (os.path.join(folder, name) for name in ("c.h5", "c.json"))
        begin = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([program, "run", os.path.join(ROOT, "runs", "catalogue.yaml"), "-grid_n", str(n), "-ts_max_time", str(until),
                        "-out_frames", "2", "-out_file", out, "-summary", summary, "-progress", "off"], check=True)
        end = resource.getrusage(resource.RUSAGE_CHILDREN)
        with open(summary, encoding="utf-8") as file:
            said = json.load(file)
    seconds = end.ru_utime + end.ru_stime - begin.ru_utime - begin.ru_stime
    return (f"{n:8d} blocks to t = {until}: {said['events']} events, {seconds:.2f} s, {1e3 * seconds / said['events']:.3f} ms an "
            f"event, {1e9 * seconds / said['node_steps']:.0f} ns a step of a node, {said['clusters']} clusters at most, "
            f"{end.ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    given = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "build", "stickslip")
    for blocks, end_time in ((1000, 2000), (10000, 1500), (100000, 1500)):
        print(cost(os.path.abspath(given), blocks, end_time), flush=True)
