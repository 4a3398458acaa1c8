"""Long runs in short, and counters where 32 bits end."""
import os
import shutil
import subprocess

import h5py
import numpy as np
import pytest

import long_runs
from calls import SANITIZED, check, checkpoint_block, data, line, run, same

wrap = 2**31
CHAIN = ("-model_form chain -grid_n 12 -friction_law carlson-langer -model_k1 0.02 -model_v 0.02 -friction_spread 0.3 "
         "-ts_max_time 1500 -out_events -out_frames 20 -out_probes 3")


def test_parts_are_alike():
    assert long_runs.main(["--block-steps", "2e4", "--chain-steps", "5e3", "--seed", "7"]) == 0


def test_what_creeps_in_is_seen():
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(long_runs.parts, long_runs.blocks_of_part))
    long_runs.flat(rows, 0, "noise")
    with pytest.raises(AssertionError, match="not flat"):
        long_runs.flat(rows + 0.15 * np.arange(long_runs.parts)[:, None], 0, "drift")
    t = np.linspace(0, 10, 200)  # psi = 1 + cos(t)/4 under a constant force, and with energy lost
    balance = lambda psi, eta: np.abs(long_runs.balance_of_block(t, psi, eta, "coulomb", 1, 0, 1, 1)[0]).max()
    assert balance(1 + np.cos(t) / 4, 0.5 - np.sin(t) / 4) < 1e-8
    decay = np.exp(-0.01 * t) / 4
    assert balance(1 + decay * np.cos(t), 0.5 - decay * np.sin(t)) > 1e-6


@pytest.mark.skipif(SANITIZED, reason="the sanitizers keep what is freed")
def test_memory_does_not_grow_with_steps():
    peaks = []
    for steps in (10_000, 80_000):
        scene = long_runs.block("carlson-langer", long_runs.random.Random(3))
        process = subprocess.Popen(line(f"{scene} -out_maxima 0 -out_probes 0 -ts_max_time 1e12 -ts_max_steps {steps}"))
        _, status, usage = os.wait4(process.pid, 0)
        check(status == 0, f"status {status}")
        peaks.append(usage.ru_maxrss)
    check(peaks[1] - peaks[0] <= 1024, f"{peaks} KB")  # the seventy thousand steps more have 15 bytes each


@pytest.mark.skipif(SANITIZED, reason="the sanitizers keep what is freed")
def test_rows_do_not_wait_for_frames():
    peaks = []
    for steps in (40_000, 120_000):
        scene = long_runs.block("carlson-langer", long_runs.random.Random(3))
        process = subprocess.Popen(line(f"{scene} -out_file a.h5 -out_frames 2 -out_displacement -out_probes 0 "
                                        f"-ts_max_time 1e12 -ts_max_steps {steps}"))
        _, status, usage = os.wait4(process.pid, 0)
        check(status == 0, f"status {status}")
        peaks.append(usage.ru_maxrss)
    check(peaks[1] - peaks[0] <= 4096, f"{peaks} KB")  # the eighty thousand rows more take 10 MB


def renumbered(path, to, steps, ids):
    """A checkpoint `steps` steps later, and with slip events numbered so much higher."""
    shutil.copy(path, to)
    with h5py.File(to, "r+") as file:
        step = int(file.attrs["step"]) + steps
        file.attrs.modify("step", np.int64(step))
        file["arrays/events.last"][1] += ids
        live = file["arrays/events.live"]
        if live.shape[0]:
            values = live[...]
            values[::7] += ids
            live[...] = values
    with open(to, "rb") as file:
        content = file.read()[512:]
    with open(to, "wb") as file:
        file.write(checkpoint_block(content) + content)
    return step


def test_steps_and_events_beyond_32_bits():
    run(f"{CHAIN} -out_file a.h5 -out_checkpoint_every 100 -out_checkpoint_keep 99")
    first = "a.chk-000200.h5"
    plain, _ = run(f"-restart {first} -out_file b.h5")
    begin = renumbered(first, "far.chk-1.h5", wrap - 250, 2**30 - 30)
    far, _ = run("-restart far.chk-1.h5 -out_file c.h5 -out_checkpoint_every 1000")
    b, c = data("b.h5"), data("c.h5")
    more = far["steps"] - begin
    check(begin < wrap < far["steps"] and more == plain["steps"] - 200 > 100, f"{begin} to {far['steps']} steps")
    # the numbers of events pass 2^30, from where on they begin anew
    check(far["events"] == plain["events"] and np.count_nonzero(c["events/begin"] > c["t"][0]) > 40, f"{far['events']} events")
    check(np.array_equal(c["series/step"], np.arange(begin + 1, far["steps"] + 1)), "series/step")
    b.pop("series/step"), c.pop("series/step")
    same(b, c, "steps numbered beyond 2^31")
    check(os.path.exists(f"c.chk-{far['steps']}.h5"), "the number in the name of the checkpoint")
    begin = renumbered(first, "far.chk-1.h5", wrap - 220, 0)
    last = begin + 50
    s, _ = run(f"-restart far.chk-1.h5 -out_file d.h5 -out_checkpoint_every 1000 -ts_max_steps {last}")
    check(last > wrap and s["steps"] == last and s["stopped_at"] == f"ts_max_steps {last}", f"{s['steps']}, {s['stopped_at']}")
    s, _ = run(f"-restart d.chk-{last}.h5 -ts_max_steps 9e15")
    check(s["status"] == "done" and s["steps"] == begin + more, f"goes on to {s['steps']}")


def test_rejections_are_counted_once():
    """Under a load with corners, and where steps of a chain that sticks are taken back; after a restart, too."""
    load = "-load_v 0:0.05,20:0.5,21:0.1,60:0.9 -model_form chain -grid_n 8 -friction_law carlson-langer -friction_spread 0.3"
    whole, _ = run(f"{load} -ts_max_time 100 -out_file a.h5 -out_checkpoint_every 150 -out_checkpoint_keep 99")
    series = data("a.h5")["series/rejections"]
    check(series[-1] == whole["rejections"] > 3 and np.all(np.diff(series) >= 0), f"{series[-1]}, {whole['rejections']}")
    rest, _ = run("-restart a.chk-000150.h5 -out_file b.h5")
    check(rest["rejections"] == whole["rejections"], f"{rest['rejections']} after a restart, {whole['rejections']}")
