"""Files, summaries and pictures as a user meets them: what xarray sees, kill -9, full disks, files of others."""
import contextlib
import glob
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import xarray

import calls
from calls import PROGRAM, SOURCE, check, ran, started

sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
import plot as PLOT  # noqa: E402


def command(*options, ranks=1):
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return launcher + [PROGRAM, "run", "-progress", "off", *[str(option) for option in options]]


def run(*options, ranks=1, **settings):
    return ran(command(*options, ranks=ranks), **settings)


def refused(result, code, *words):
    """The run ended with this code and one line of error that holds the words."""
    lines = [line for line in result.stderr.splitlines() if line.startswith("stickslip: error: ")]
    return result.returncode == code and len(lines) == 1 and all(word in lines[0] for word in words)


def contents(path):
    """All datasets. The times are opened and read first: whatever they count is complete in the others, also while the
    file is being written."""
    with h5py.File(path, "r") as file:
        found = {name: file[name][...] for name in ("t", "probes/t", "series/t") if name in file}

        def visit(name, item):
            if isinstance(item, h5py.Dataset):
                found.setdefault(name, item[...])

        file.visititems(visit)
        return found


SINE = ["-init_type", "sine", "-out_probes", "0,10.3125,45"]


def test_what_is_in_a_file():
    out = run(*SINE, "-grid_n", 64, "-ts_max_time", 5, "-out_frames", 11, "-out_file", "a.h5", "-summary", "a.json")
    check(out.returncode == 0, "run: " + out.stderr)
    with open("a.json", encoding="utf-8") as file:
        summary = json.load(file)
    common = "command status reason warnings version git model_form delta_sign units labels ranks wall_s".split()
    check(list(summary)[:len(common)] == common and list(summary)[-1] == "options", "common keys first, options last")
    check(summary["status"] == "done" and summary["reason"] is None and summary["command"] == "run", "status done")
    check(summary["delta_sign"] == "derived" and summary["model_form"] == "continuum" and summary["ranks"] == 1, "form")
    check(summary["options"]["grid_n"] == "64" and summary["options"]["model_gamma"] == "3", "options with defaults")
    check(summary["t_end"] == 5.0, "t_end")

    with xarray.open_dataset("a.h5", engine="h5netcdf") as data:
        check(data.psi.dims == ("t", "x") and data.eta.dims == ("t", "x"), "dimensions of psi and eta")
        check(np.array_equal(data.t, np.linspace(0, 5, 11)), "t is a coordinate")
        check(np.allclose(data.x, np.arange(64) * 60 / 64, rtol=0, atol=1e-13), "x is a coordinate")
        for name in ("t", "x", "psi", "eta"):
            check(data[name].attrs.get("units") and data[name].attrs.get("long_name"), f"units of {name}")
        for name in ("version", "git", "command_line", "options", "date", "kind"):
            check(name in data.attrs, f"attribute {name}")
        check(data.attrs["kind"] == "run" and "-grid_n 64" in data.attrs["command_line"], "kind, command line")
        check(json.loads(data.attrs["options"]) == summary["options"], "options in file and summary")
        last = data.psi.sel(t=5).values
        check(abs(last.mean() - summary["psi_mean"]) < 1e-12 and last.max() == summary["psi_max"], "last frame")
    with xarray.open_dataset("a.h5", engine="h5netcdf", group="probes") as data:
        check(data.psi.dims == ("t", "x") and list(data.x.values) == [0, 10.3125, 45], "probes")
        for k, probe in enumerate(summary["probes"]):
            check(data.psi.values[-1, k] == probe["psi"] and data.eta.values[-1, k] == probe["eta"], "probes, summary")
        check(data.t.values[0] == 0 and data.t.values[-1] == 5, "probes from start to end")
    with xarray.open_dataset("a.h5", engine="h5netcdf", group="series") as data:
        check(data.psi_mean.dims == ("t",) and len(data.t) == summary["steps"] + 1, "a row of series for each step")

    out = run("-grid_n", 16, "-ts_max_time", 1, "-summary", "-", ranks=2)
    check(out.returncode == 0 and json.loads(out.stdout)["ranks"] == 2, "summary on standard output, once")


def foreign_files():
    with open("notes.txt", "w", encoding="utf-8") as file:
        file.write("keep me")
    with h5py.File("foreign.h5", "w") as file:
        file["t"] = [1.0]
    os.makedirs("folder", exist_ok=True)


def test_outputs_refused():
    foreign_files()
    run(*SINE, "-grid_n", 64, "-ts_max_time", 5, "-out_frames", 11, "-out_file", "a.h5")
    for name, why in (("notes.txt", "HDF5 is written"), ("foreign.h5", "not written by this program")):
        before = open(name, "rb").read()
        check(refused(run("-out_file", name), 2, "out_file", name, why), f"out_file {name}")
        check(open(name, "rb").read() == before, f"{name} is untouched")
    check(refused(run("-out_file", "none/a.h5", ranks=2), 2, "out_file", "none"), "out_file in no folder, two ranks")
    check(refused(run("-out_file", "folder"), 2, "out_file", "folder"), "out_file is a folder")
    check(refused(run("-summary", "folder"), 2, "summary", "folder"), "summary is a folder")
    check(refused(run("-summary", "none/s.json"), 2, "summary", "none"), "summary in no folder")
    check(refused(run("-summary", "notes.txt"), 2, "summary", "notes.txt"), "summary over another file")
    check(refused(run("-out_file", "a", "-summary", "a"), 2, "summary", "out_file"), "both in one")
    check(refused(run("-restart", "notes.txt"), 2, "restart", "notes.txt"), "restart from a text")
    # a file of ours is replaced, and not before the checks are over
    before = contents("a.h5")
    check(run("-out_file", "a.h5", "-grid_n", "-4").returncode == 2, "wrong use")
    check(np.array_equal(contents("a.h5")["psi"], before["psi"]), "wrong use leaves the old file")
    check(run("-out_file", "a.h5", "-grid_n", 16, "-ts_max_time", 1).returncode == 0, "a file of ours is replaced")
    check(contents("a.h5")["psi"].shape == (200, 16), "by the new one")
    check(not glob.glob(".*.tmp") and not glob.glob(".*.new"), "no temporary file is left")


def test_failures_and_stops():
    out = run("-init_type", "sine", "-grid_n", 64, "-ts_type", "rk", "-ts_adapt_type", "none", "-ts_dt", 0.9,
              "-out_file", "f.h5", "-summary", "f.json")
    check(refused(out, 1), "an explicit step too long: " + out.stderr)
    summary = json.load(open("f.json", encoding="utf-8"))
    check(summary["status"] == "failed" and summary["reason"] in out.stderr, "its summary")
    kept = contents("f.h5")
    check(len(kept["t"]) >= 1 and np.isfinite(kept["psi"]).all(), "what was computed until then")

    process, _ = started([*SINE, *LONG, "-out_file", "stop.h5", "-summary", "stop.json"], 1, "stop.h5")
    process.send_signal(signal.SIGTERM)
    check(process.wait(timeout=60) == 143, "exit code 143 after SIGTERM")
    summary = json.load(open("stop.json", encoding="utf-8"))
    check(summary["status"] == "stopped" and "SIGTERM" in summary["reason"], "summary after SIGTERM")
    check(len(glob.glob("stop.chk-*.h5")) >= 1, "checkpoint after SIGTERM")

    os.makedirs("gone", exist_ok=True)
    process, _ = started([*SINE, *LONG, "-out_file", "gone/a.h5"], 1, "gone/a.h5", stderr=subprocess.PIPE)
    shutil.rmtree("gone")
    _, stderr = process.communicate(timeout=60)
    lines = [line for line in stderr.splitlines() if "error" in line]
    check(process.returncode == 1 and len(lines) == 1 and "gone/a.h5" in lines[0], "the folder vanishes: " + stderr)


LONG = ["-grid_n", 300, "-ts_max_time", 600, "-out_frames", 6001, "-out_checkpoint_every", 200]


def test_full_disk():
    """A small disk, where the machine lets us make one (the unit tests have the same with a write that fails)."""
    script = ('mkdir small && mount -t tmpfs -o size=1m tmpfs small && cd small && "$@"; code=$?; '
              'cp *.h5 s.json .. 2>/dev/null; cd ..; exit $code')
    if subprocess.run(["unshare", "-rm", "sh", "-c", script, "sh", "true"], capture_output=True).returncode != 0:
        print("full disk: no mount here, left to test_stops.py, which limits the size of files")
        return
    os.rmdir("small")
    out = subprocess.run(["unshare", "-rm", "sh", "-c", script, "sh", *command(
        *SINE, "-grid_n", 300, "-out_file", "full.h5", "-summary", "s.json", "-out_checkpoint_every", 20)],
        capture_output=True, text=True, timeout=60)
    os.rmdir("small")
    check(refused(out, 1, "full.", "No space left"), "full disk: " + out.stderr)
    kept = contents("full.h5")
    check(len(kept["t"]) > 1 and len(kept["t"]) == len(kept["psi"]) and np.isfinite(kept["psi"]).all(), "frames kept")


def plot(*arguments):
    """plot.py in this process, which has matplotlib loaded already: its exit code and what it says on stderr."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = PLOT.main(arguments)
    return code, said.getvalue()


def is_picture(path):
    with open(path, "rb") as file:
        return file.read(8) == b"\x89PNG\r\n\x1a\n" and os.path.getsize(path) > 10000


def test_pictures():
    foreign_files()
    run("-grid_n", 16, "-ts_max_time", 1, "-out_file", "a.h5")
    run(*SINE, "-grid_n", 400, "-ts_max_time", 15, "-out_frames", 2001, "-out_checkpoint_every", 40, "-out_file",
        "reference1.h5")
    out = subprocess.run(["/usr/bin/python3", "-B", PLOT.__file__, "reference1.h5"], capture_output=True, text=True,
                         timeout=120)
    check(out.returncode == 0 and out.stdout == "reference1.png\n" and is_picture("reference1.png"), out.stderr)
    for what in ("profile", "phase", "probes", "series"):
        code, said = plot("reference1.h5", "--what", what, "-o", f"{what}.png")
        check(code == 0 and is_picture(f"{what}.png"), what + said)
    for kind, options in {"spectrum": ["-grid_n", 64, "-bc_left", "velocity"],
                          "wave": ["-wave_pulses", 2, "-wave_length", 60], "laws": []}.items():
        out = ran([PROGRAM, kind, *options, "-out_file", f"{kind}.h5"])
        check(out.returncode == 0, kind + out.stderr)
        with xarray.open_dataset(f"{kind}.h5", engine="h5netcdf") as data:
            check(data.attrs["kind"] == kind and len(data.coords) > 0, f"xarray opens the file of {kind}")
        code, said = plot(f"{kind}.h5")
        check(code == 0 and is_picture(f"{kind}.png"), kind + said)
    with open("cut.h5", "wb") as file:
        file.write(open("reference1.h5", "rb").read(100000))
    for arguments in (["notes.txt"], ["foreign.h5"], ["none.h5"], ["folder"], ["cut.h5"], ["a.h5", "--probes"],
                      ["reference1.h5", "--profile", "--frame", "5000"], ["a.h5", "-o", "none/a.png"],
                      ["a.h5", "--field", "tau"], [sorted(glob.glob("reference1.chk-*.h5"))[-1]], ["laws.h5", "--phase"]):
        code, said = plot(*arguments)
        check(code == 2 and said.count("\n") == 1 and said.startswith("plot.py: error: "), f"{arguments}: {said}")


def test_two_writers():
    """A file that one command writes is refused to a second one; a killed one holds nobody off."""
    scene = "-grid_n 2000 -init_type sine -ts_max_time 1e6 -ts_type rk -ts_rk_type 3bs -out_times 0,1e6"
    first, _ = started(f"{scene} -out_file one.h5", 1, ".one.h5.lock")
    try:
        os.makedirs("sub")
        os.symlink("../one.h5", "sub/link.h5")
        said = f"one.h5': another command writes it now (process {first.pid} on "
        points = "-sweep_parameter1 model_v -sweep_values1 1,2 -grid_n 16"
        calls.refused("-grid_n 16 -ts_max_time 1 -out_file one.h5", 2, "out_file", said)
        calls.refused("-out_file ./one.h5", 2, "out_file", said, command="laws")
        calls.refused(f"{points} -out_file one.h5", 2, "out_file", said, command="sweep")
        while not os.path.exists("one.h5"):
            time.sleep(0.01)
        calls.refused("-grid_n 16 -ts_max_time 1 -out_file sub/link.h5", 2, "another command writes it now")
        calls.run("-grid_n 16 -ts_max_time 1 -out_file two.h5")
    finally:
        first.kill()
        first.wait()
    calls.run("-grid_n 16 -ts_max_time 1 -out_file one.h5")
    check(not [name for name in os.listdir(".") if name.endswith(".lock")], "locks are left")


def test_the_second_writer_leaves_what_the_first_one_writes():
    """Before its first frame a run's file has a hidden name: whether a file can be made there is tried by another."""
    scene = "-grid_n 2000 -init_type sine -ts_max_time 1e6 -ts_type rk -ts_rk_type 3bs -out_times 1e6"
    first, _ = started(f"{scene} -out_file one.h5", 1, ".one.h5.tmp")
    try:
        made = os.stat(".one.h5.tmp").st_ino
        calls.refused("-grid_n 16 -ts_max_time 1 -out_file one.h5", 2, "another command writes it now")
        check(os.stat(".one.h5.tmp").st_ino == made, "the first one's file is gone")
        check(sorted(os.listdir(".")) == [".one.h5.lock", ".one.h5.tmp"], "the trial is left")
    finally:
        first.kill()
        first.wait()
