"""How a run ends when it does not reach its end time: limits of steps and wall clock, floors, failures of Newton's
method, disks that fill and folders that vanish, a rank that dies. The exit code and the summary say which; what was
computed until then is kept."""
import glob
import os
import resource
import shutil
import subprocess
import time

import numpy as np
import pytest

from calls import PROGRAM, SANITIZED, call, check, data, errors, gone, refused, run, same, started

SINE = "-init_type sine -grid_n 64"


def kept(path, summary, text):
    """The file holds finite frames up to the time reached."""
    now = data(path)
    check(len(now["t"]) > 0 and np.isfinite(now["psi"]).all() and now["t"][-1] <= summary["t_end"],
          f"{text}: {len(now['t'])} frames up to {now['t'][-1]}, t_end {summary['t_end']}")
    check(abs(now["series/t"][-1] - summary["t_end"]) < 1e-12, f"{text}: series up to {now['series/t'][-1]}")


@pytest.mark.ranks
def test_limits_of_steps_and_wall_clock():
    scene = f"{SINE} -ts_rk_type 3bs -ts_max_time 20 -out_every 0.5"
    run(f"{scene} -out_file plain.h5")
    # steps: exit code 0, the reason, and a checkpoint where they are wanted
    s, _ = run(f"{scene} -out_file steps.h5 -ts_max_steps 50 -out_checkpoint_every 1000")
    check(s["status"] == "stopped" and s["reason"] == "ts_max_steps 50; checkpoint steps.chk-000050.h5", s["reason"])
    check(s["stopped_at"] == "ts_max_steps 50" and s["steps"] == 50, f"stopped_at {s['stopped_at']}")
    kept("steps.h5", s, "ts_max_steps")
    run("-restart steps.chk-000050.h5 -ts_max_steps 100000")
    same(data("plain.h5"), data("steps.h5"), "a run that ts_max_steps had stopped, completed")
    # the wall clock: always with a checkpoint
    for ranks in (1, 2):
        s, _ = run(f"{scene} -out_file wall.h5 -ts_max_time 1e5 -out_every 50 -ts_max_wall 0.5s", ranks)
        check(s["status"] == "stopped" and s["reason"].startswith("ts_max_wall 0.5s; checkpoint wall.chk-"), s["reason"])
        check(0.4 < s["wall_s"] < 20 and s["t_end"] < 1e5 and s["stopped_at"] == "ts_max_wall 0.5s", f"{s['wall_s']} s")
        kept("wall.h5", s, "ts_max_wall")
    checkpoint = s["reason"].split()[-1]
    again, _ = run(f"-restart {checkpoint} -ts_max_time {s['t_end'] + 10} -ts_max_wall 10m")
    check(again["stopped_at"] is None and again["t_end"] == s["t_end"] + 10, "going on after ts_max_wall")
    refused("-ts_max_wall 30", 2, "-ts_max_wall 30", "30s, 10m, 2h")
    refused("-ts_max_wall -1s", 2, "-ts_max_wall")


IMPLICIT = "-ts_type arkimex -imex_implicit both"


@pytest.mark.parametrize("arguments, parts", [
    ("-ts_adapt_dt_min 0.5", ["ts_adapt_dt_min 0.5", "above the tolerance"]),
    ("-ts_type bdf -ts_adapt_dt_min 0.05", ["ts_adapt_dt_min 0.05"]),
    ("-ts_type beuler -ts_dt 5 -snes_max_it 1", ["Newton's method failed"]),
    (f"{IMPLICIT} -snes_max_it 1 -snes_rtol 1e-30 -snes_atol 1e-30 -snes_stol 0",
     ["rejected more than 60 times", "Newton's method fails"]),
    (f"{IMPLICIT} -ts_adapt_type none -ts_dt 3 -snes_max_it 2", ["Newton's method failed"]),
    ("-ts_max_reject 0 -ts_dt 5", ["ts_max_reject", "more than 0 times"]),
    ("-ts_type rk -ts_rk_type 4 -ts_dt 0.9", ["not finite", "ts_dt"])])
def test_failures(arguments, parts):
    s, said = run(f"{SINE} {arguments} -out_file f.h5", code=1)
    said = errors(said)
    check(len(said) == 1 and all(part in said[0] for part in parts), f"{arguments}: {said}")
    check(s["status"] == "failed" and said[0].endswith(s["reason"]) and s["t_end"] < 60, f"{arguments}: summary")
    kept("f.h5", s, arguments)
    refused(f"{SINE} {arguments}", 1, *parts, ranks=2)


def test_a_floor_that_is_met_does_no_harm():
    run(f"{SINE} -ts_adapt_dt_min 1e-3 -ts_max_time 5")


def limited(size):
    """For a process to come: no file beyond this size, as a full disk would have it."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def test_disks():
    refused(f"{SINE} -out_file none/a.h5", 2, "out_file 'none/a.h5'", "does not exist", ranks=2)
    if os.path.ismount("/proc"):  # which is read-only, for root too
        refused(f"{SINE} -out_file /proc/a.h5", 2, "out_file '/proc/a.h5'", "cannot be written")
        refused(f"{SINE} -summary /proc/a.json", 2, "summary '/proc/a.json'")
    refused(f"{SINE} -ts_max_time 0.1 -summary /dev/full", 1, "/dev/full", "No space left")
    # no room at the start: nothing is begun
    done = call(f"{SINE} -out_file small.h5", preexec_fn=limited(20000))
    check(done.returncode == 2 and len(errors(done.stderr)) == 1 and "small.h5" in done.stderr, done.stderr)
    check(not glob.glob("*small*") and not glob.glob(".small*"), f"nothing is left: {os.listdir()}")


@pytest.mark.ranks
@pytest.mark.parametrize("ranks", [1, 2])
def test_no_room_in_mid_run(ranks):
    """The series outgrow their first room: what was there stays, and so does the checkpoint."""
    scene = f"{SINE} -ts_max_time 1e6 -out_times 1,2,3 -ts_rk_type 3bs -ts_max_steps 1000000"
    process, pids = started(f"{scene} -out_file full.h5 -out_checkpoint_every 300 -summary full.json", ranks,
                            "full.h5", stderr=subprocess.PIPE)
    for pid in pids:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (700000, 700000))
    _, stderr = process.communicate(timeout=120)
    said = errors(stderr)
    check(process.returncode == 1 and len(said) == 1 and "full.h5" in said[0] and "too large" in said[0],
          f"a file that cannot grow, {ranks} ranks: exit {process.returncode}, {stderr[-500:]}")
    now = data("full.h5")
    check(len(now["t"]) == 3 and len(now["series/t"]) > 1000 and np.isfinite(now["psi"]).all(),
          "what was there stays")
    with open("full.json", encoding="utf-8") as file:
        check('"status": "failed"' in file.read(), "the summary of a full disk")
    check(not glob.glob(".full*"), f"no temporary file is left: {os.listdir()}")
    last = sorted(glob.glob("full.chk-*.h5"))[-1]
    s, _ = run(f"-restart {last} -ts_max_steps {int(last[9:15]) + 100}", ranks)
    check(s["steps"] == int(last[9:15]) + 100, "the last checkpoint is whole")


@pytest.mark.ranks
@pytest.mark.parametrize("ranks", [1, 2])
def test_the_folder_vanishes(ranks):
    os.makedirs("gone")
    process, _ = started(f"{SINE} -ts_max_time 1e6 -out_every 10 -out_file gone/a.h5 -out_checkpoint_every 100",
                         ranks, "gone/a.h5", stderr=subprocess.PIPE)
    os.rename("gone", "moved")
    _, stderr = process.communicate(timeout=60)
    said = errors(stderr)
    check(process.returncode == 1 and len(said) == 1 and "gone/a" in said[0],
          f"the folder vanishes, {ranks} ranks: {process.returncode} {stderr[-500:]}")
    check(len(data("moved/a.h5")["t"]) > 0, "what was in it is whole")
    shutil.rmtree("moved")


@pytest.mark.ranks
def test_dead_ranks():
    """One rank fails or dies: all end within seconds, and the program speaks once."""
    scene = f"{SINE} -ts_max_time 1e7 -out_every 1000"
    # killed
    process, children = started(f"{scene} -out_file dead.h5", 3, "dead.h5", stderr=subprocess.DEVNULL)
    os.kill(children[1], 9)
    begin = time.monotonic()
    check(process.wait(timeout=60) != 0 and time.monotonic() - begin < 15, "a rank is killed: all end")
    until = time.monotonic() + 10
    while not all(gone(pid) for pid in children) and time.monotonic() < until:
        time.sleep(0.1)
    check(all(gone(pid) for pid in children), "no rank is left")
    check(len(data("dead.h5")["t"]) > 0, "its file opens")
    if SANITIZED:
        print("out of memory on one rank: not under the address sanitizer, which brings its own malloc")
        return
    # out of memory on one rank of three: allocations of more than 16 MB fail there
    with open("memory.c", "w", encoding="ascii") as file:
        file.write("""#include <errno.h>
#include <stddef.h>
extern void* __libc_malloc(size_t);
extern void* __libc_memalign(size_t, size_t);
void* malloc(size_t size) { return size > 16000000 ? (errno = ENOMEM, (void*)0) : __libc_malloc(size); }
int posix_memalign(void** p, size_t to, size_t size) {
  return size > 16000000 || !(*p = __libc_memalign(to, size)) ? ENOMEM : 0;
}
""")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", "memory.so", "memory.c"], check=True)
    # by a script, since the launcher of Open MPI 5.0.7 dies of several programs in one command
    poor = f'[ "$OMPI_COMM_WORLD_RANK" != 1 ] || export LD_PRELOAD={os.path.abspath("memory.so")}; exec "$@"'
    begin = time.monotonic()
    done = subprocess.run(["mpirun", "-n", "3", "sh", "-c", poor, "sh", PROGRAM, "run", "-progress", "off",
                           *f"{SINE} -grid_n 4000000 -ts_max_steps 3".split()], capture_output=True, text=True, timeout=120)
    check(done.returncode == 1 and time.monotonic() - begin < 30, f"no memory on one rank: {done.returncode}")
    check(errors(done.stderr) == ["stickslip: error: out of memory"], f"no memory on one rank: {done.stderr[-1000:]}")
