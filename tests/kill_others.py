"""Kills of commands that write one file at their end or a table as they go, and disks that fail: cases of kills.py."""
import glob
import json
import os
import shutil
import signal
import subprocess
import time

import h5py

from calls import call, check, data, errors, line, run, same
from kill_tools import begun, calls_of, ended_inside_a_write, kill, reference

SWEEP = ("-sweep_parameter1 model_v -sweep_from1 0.3 -sweep_to1 1.5 -sweep_points1 24 -grid_n 16 -init_type sine "
         "-ts_max_time 20 -sweep_group_ranks 1")
RESULTS = {
    "boundary": "-grid_n 32 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5 -boundary_of sliding",
    "chart": "-grid_n 16 -ts_max_time 5 -init_type sine -chart_methods rk:3bs,rk:5dp -chart_tolerances 1e-2,1e-3 "
             "-chart_repeats 1 -chart_row_seconds 5 -chart_reference_seconds 20",
    "spectrum": "-grid_n 64", "wave": "-wave_length 100", "cycle": "-grid_n 16", "laws": "",
    "fit": "-grid_n 16 -ts_max_time 5 -fit_data 1:0.1,2:0.2,3:0.1,4:0.2 -fit_parameters model_v,model_gamma -fit_starts 2",
}
CLOCK = ("wall_s", "seconds", "warnings")  # what differs from one time to the next


def lasting(values):
    return {name: value for name, value in values.items() if not any(word in name for word in CLOCK)}


def sweep_killed(case):
    """Killed at any moment or inside a write, or stopped by SIGTERM; goes on to the table that nobody killed."""
    name, rng, ranks = case.name, case.rng, case.ranks
    wanted, duration = reference(SWEEP, 1, "sweep")
    how = rng.choice(["inside", "kill", "one", "term"])
    if how == "inside":
        words = line(f"{SWEEP} -out_file {name}.h5", ranks, "sweep")
        ended_inside_a_write(words, rng.randint(1, max(1, calls_of(SWEEP, 1, "sweep") // ranks)))
    else:
        process = begun(SWEEP, ranks, name, "sweep", rng.uniform(0, 1.2) * duration)
        number = signal.SIGTERM if how == "term" else signal.SIGKILL
        kill(process, ranks, f"{name}.pids", number, rng.randrange(ranks) if how == "one" else None)
    case.count(f"sweep {how}")
    goes_on = os.path.exists(f"{name}.h5")
    check(goes_on or not glob.glob(f"{name}.h5.points-*"), f"{case}: points without a table")
    if goes_on:
        data(f"{name}.h5")
        case.count("sweep continued")
    done = call(f"-restart {name}.h5" if goes_on else f"{SWEEP} -out_file {name}.h5", rng.choice([1, 2]), "sweep")
    check(done.returncode == 0, f"{case}: exit {done.returncode} of the sweep that goes on: {done.stderr[-500:]}")
    same(lasting(wanted), lasting(data(f"{name}.h5")), str(case))
    check(os.path.exists(f"{name}.csv") and not glob.glob(f"{name}.h5.points-*"), f"{case}: files of the table")


def is_whole(path, command):
    with h5py.File(path) as file:
        check(file.attrs["kind"] == command, f"{path}: kind {file.attrs['kind']}")
    data(path)


def result_killed(case):
    """An earlier file of the name stays or is replaced by a whole one; the next command has no trouble."""
    name, rng, ranks = case.name, case.rng, case.ranks
    command = rng.choice(["boundary", "boundary", "chart", "chart", "spectrum", "wave", "cycle", "laws", "fit"])
    arguments = RESULTS[command]
    wanted, duration = reference(arguments, ranks, command)
    old = rng.random() < 0.5
    if old:
        run(f"-out_file {name}.h5", command="laws")
        before = open(f"{name}.h5", "rb").read()
    how = rng.choice(["inside", "inside", "kill", "one", "term"])
    if how == "inside":
        ended_inside_a_write(line(f"{arguments} -out_file {name}.h5 -summary {name}.json", ranks, command),
                             rng.randint(1, calls_of(arguments, 1, command) + 2))
    else:
        process = begun(f"{arguments} -summary {name}.json", ranks, name, command, rng.uniform(0, 1) * duration)
        number = signal.SIGTERM if how == "term" else signal.SIGKILL
        kill(process, ranks, f"{name}.pids", number, rng.randrange(ranks) if how == "one" else None)
    case.count(f"{command} {how}")
    if os.path.exists(f"{name}.h5"):
        with open(f"{name}.h5", "rb") as file:
            if not old or file.read() != before:
                is_whole(f"{name}.h5", command)
    else:
        check(not old, f"{case}: the earlier file is gone")
    if os.path.exists(f"{name}.json"):
        with open(f"{name}.json", encoding="utf-8") as file:
            check(file.read().rstrip().endswith("}"), f"{case}: a part of a summary")
    run(f"{arguments} -out_file {name}.h5", ranks, command=command)
    if command != "chart":  # whose errors come with seconds
        same(lasting(wanted), lasting(data(f"{name}.h5")), str(case))


def on_a_small_disk(name, size, frozen, words):
    """The program's end with folder `name` on a disk of its own, of `size` kB, perhaps read-only; what it left there is
    copied to NAME-kept, since the disk goes with the process. None where nothing can be mounted."""
    script = (f'mount -t tmpfs -o size={size}k tmpfs {name} && cd {name} && ' +
              ("mount -o remount,ro . && " if frozen else "") +
              f'"$@"; code=$?; cp *.h5 *.json *.csv *.points-* ../{name}-kept 2>/dev/null; exit $code')
    for folder in (name, f"{name}-kept"):
        os.makedirs(folder)
    done = subprocess.run(["unshare", "-rm", "sh", "-c", script, "sh", *words], capture_output=True, text=True,
                          timeout=600, check=False)
    return None if "unshare" in done.stderr or "mount:" in done.stderr else done


def small_disk(case, run_scene):
    """A disk of some kB or hundred kB, or one that may not be written, for the results, the summary or both: one line,
    files that can be read, and a run goes on where there is room."""
    name, rng, ranks = case.name, case.rng, case.ranks
    command = rng.choice(["run", "run", "run", "run", *RESULTS, "sweep", "sweep"])
    arguments = {"run": run_scene, "sweep": f"{SWEEP} -sweep_files {rng.choice(['true', 'false'])}", **RESULTS}[command]
    size, frozen = rng.choice([4, 20, 100, 300, 600, 1000, 1500, 2500, 4000]), rng.random() < 0.2
    what = rng.choice(["both", "both", "results", "summary"])  # which stand on that disk
    results = "a.h5" if what != "summary" else f"../{name}-kept/a.h5"
    summary = "a.json" if what != "results" else f"../{name}-kept/a.json"
    done = on_a_small_disk(name, size, frozen, line(f"{arguments} -out_file {results} -summary {summary}", ranks, command))
    if done is None:
        case.count("no mount here")
        return
    said = errors(done.stderr)
    codes = (2,) if frozen else (0, 1, 2)
    check(done.returncode in codes, f"{case}: exit {done.returncode}, {done.stderr[-500:]}")
    check(len(said) == (done.returncode != 0), f"{case}: {len(said)} errors, exit {done.returncode}: {done.stderr[-800:]}")
    case.count(f"read-only {what}" if frozen else f"disk with {what}, exit {done.returncode}")
    if not frozen:
        case.count(f"disk {command}")
    os.chdir(f"{name}-kept")
    try:
        kept_can_be_used(case, command, done.returncode, None if command != "run" else reference(run_scene, ranks)[0])
    finally:
        os.chdir("..")


def kept_can_be_used(case, command, code, wanted):
    """What a disk kept: whole files; after success all of them; a run goes on to what nobody disturbed (`wanted`)."""
    if os.path.exists("a.json"):
        with open("a.json", encoding="utf-8") as file:
            json.load(file)
    check(code != 0 or (os.path.exists("a.json") and os.path.exists("a.h5")), f"{case}: exit 0 without its files")
    for path in set(glob.glob("a*.h5")) - set(glob.glob("a.chk-*.h5")):
        data(path)
    checkpoints = sorted(glob.glob("a.chk-*.h5"))
    if command == "run" and checkpoints:
        run(f"-restart {checkpoints[-1]} -out_file a.h5", case.ranks)
        same(wanted, data("a.h5"), str(case))
        case.count("continued after a full disk")


def folder_gone(case, run_scene):
    """The folder of the output is removed: one line, an end, no file elsewhere."""
    name, rng, ranks = case.name, case.rng, case.ranks
    command = rng.choice(["run", "run", "sweep", "boundary", "chart"])
    arguments = {"run": run_scene, "sweep": SWEEP, **RESULTS}[command]
    os.makedirs(name)
    process = subprocess.Popen(line(f"{arguments} -out_file {name}/a.h5", ranks, command), stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)
    time.sleep(rng.uniform(0, 1) * reference(arguments, 1, command)[1])
    shutil.rmtree(name, ignore_errors=True)  # as it is, a file may come meanwhile
    _, said = process.communicate(timeout=300)
    check(process.returncode in (0, 1, 2) and len(errors(said)) == (process.returncode != 0),
          f"{case}: {command} ends with {process.returncode}: {said[-500:]}")
    case.count(f"folder gone, exit {process.returncode}")
