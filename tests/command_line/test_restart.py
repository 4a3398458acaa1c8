"""Checkpoints and restarts, from the command line: every method goes on bitwise alike or says before it starts that it
will not; checkpoints by the clock and by signals; what is refused, and with which words."""
import glob
import os
import re
import shlex
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

from calls import PROGRAM, check, checkpoint_block, data, methods, ran, refused, run, same, started, words

TINY = ("-grid_n 20 -grid_length 12 -init_type sine -ts_max_time 0.9 -out_frames 7 -out_probes 3,7.1 -ts_dt 0.02"
        " -ts_max_steps 40")
WHOLE = " -ts_max_steps 100000"  # to the end time, which does not depend on the rounding of the steps
RESULTS = ("t_end steps rejections rhs_evaluations psi_min psi_max psi_mean eta_mean probes regime amplitude "
           "wave_speed pulses").split()


def clear(stem):
    for name in glob.glob(stem + ".*"):
        os.remove(name)


def goes_on(arguments, name, ranks=2, every=3):
    """A run with checkpoints, and the same from one of them: appended to its file it is the same file. On other ranks
    the answer is the same to 1e-12."""
    clear("whole")
    if ranks > 1:
        arguments += WHOLE
    whole, _ = run(f"{TINY} {arguments} -out_file whole.h5 -out_checkpoint_every {every} -out_checkpoint_keep 1000")
    reference = data("whole.h5")
    checkpoints = sorted(glob.glob("whole.chk-*.h5"))
    check(len(checkpoints) >= 2, f"{name}: {len(checkpoints)} checkpoints")
    middle = checkpoints[(len(checkpoints) - 1) // 2]
    again, _ = run(f"-restart {middle} -out_file whole.h5")
    same(reference, data("whole.h5"), f"{name} after a restart")
    differing = [key for key in RESULTS if whole[key] != again[key]]
    check(not differing, f"{name}: {differing} in the summary after a restart")
    if ranks > 1:
        # the same checkpoints again, since the method restarts there; a file of its own
        other, _ = run(f"-restart {middle} -out_file other.h5", ranks)
        differences = [abs(whole[key] - other[key]) for key in ("t_end", "psi_min", "psi_max", "psi_mean", "eta_mean")]
        for a, b in zip(whole["probes"], other["probes"]):
            differences += [abs(a[key] - b[key]) for key in ("psi", "eta")]
        check(max(differences) < 1e-12, f"{name}: differs by {max(differences)} after a restart on {ranks} ranks")
        clear("other")


SEVERAL_RANKS = {"rk:5dp none", "rk:3bs none", "euler none", "ssp:rks2 none", "arkimex:3 friction", "arkimex:4 wave",
                 "arkimex:4 both", "rosw:ra34pw2 both", "bdf:2 both", "bdf:6 both", "theta both", "cn both", "alpha both"}
METHODS = list(methods())


def test_methods_are_those_of_the_page():
    names = {name for _, name in METHODS}
    assert len(names) >= 75 and SEVERAL_RANKS < names


@pytest.mark.parametrize("arguments, name, ranks", [
    pytest.param(arguments, name, 2, id=name, marks=pytest.mark.ranks) if name in SEVERAL_RANKS else
    pytest.param(arguments, name, 1, id=name) for arguments, name in METHODS])
def test_every_method(arguments, name, ranks):
    goes_on(arguments, name, ranks)


@pytest.mark.parametrize("arguments", [
    "-ts_adapt_type dsp", "-ts_type rk -ts_rk_type 3bs -ts_adapt_type dsp",
    "-ts_type bdf -ts_adapt_type dsp", "-ts_type theta -ts_adapt_type basic",
    "-ts_type alpha -ts_adapt_type basic", "-ts_type bdf -ts_bdf_order 4 -ts_adapt_type none",
    "-ts_adapt_time_step_increase_delay 3",
    "-ts_type arkimex -imex_implicit both -ts_arkimex_initial_guess_extrapolate"])
def test_every_controller(arguments):
    goes_on(arguments, arguments, ranks=1, every=3)


def test_memory_is_told():
    """What PETSc's solvers keep between steps is in no checkpoint: told before the run, where there are checkpoints."""
    for arguments in ("-snes_lag_jacobian -2", "-snes_lag_preconditioner 4 -snes_lag_preconditioner_persists true",
                      "-snes_type qn -snes_max_it 300"):
        scene = f"{TINY} -ts_type arkimex -imex_implicit both {arguments}"
        _, said = run(scene + " -out_file lag.h5 -out_checkpoint_every 4 -ts_max_steps 8")
        check("not to the last bit" in said and arguments.split()[0] in said, f"{arguments}: {said}")
        _, said = run(scene + " -ts_max_steps 8")
        check("not to the last bit" not in said, f"{arguments} without checkpoints: {said}")
    clear("lag")


# rk:3bs goes on bitwise whether or not the uninterrupted run has a checkpoint there. Many nodes and few steps: ranks that
# wait for each other at every step starve on a busy machine.
LONG = ("-grid_n 50000 -grid_length 6000 -init_type sine -ts_max_time 15 -ts_type rk -ts_rk_type 3bs -ts_rtol 1e-6"
        " -ts_atol 1e-6 -out_frames 11 -out_probes 4.2")


def test_by_the_clock():
    begin = time.monotonic()
    run(f"{LONG} -out_file plain.h5")
    every = (time.monotonic() - begin) / 20
    reference = data("plain.h5")
    run(f"{LONG} -out_file clock.h5 -out_checkpoint_every {every:.3f}s -out_checkpoint_keep 1000")
    same(reference, data("clock.h5"), "checkpoints by the clock do not show in the answer")
    checkpoints = sorted(glob.glob("clock.chk-*.h5"))
    check(len(checkpoints) >= 3, f"{len(checkpoints)} checkpoints by the clock")
    run(f"-restart {checkpoints[0]} -out_file clock.h5")
    same(reference, data("clock.h5"), "a restart from a checkpoint by the clock")


@pytest.mark.ranks
@pytest.mark.parametrize("ranks", [1, 2])
def test_by_signal(ranks):
    """SIGUSR1 goes on; SIGTERM and SIGINT stop; a restart completes the same file. The signal goes to one rank, as a
    launcher passes it on to each."""
    run(f"{LONG} -out_file plain.h5", ranks)
    expected = data("plain.h5")
    for number in (signal.SIGUSR1, signal.SIGTERM, signal.SIGINT):
        clear("signal")
        process, pids = started(f"{LONG} -out_file signal.h5 -summary signal.json", ranks, "signal.h5",
                                stderr=subprocess.PIPE)
        os.kill(pids[-1], number)
        _, said = process.communicate(timeout=600)  # under sanitizers it takes minutes
        name = f"{number.name} on {ranks} ranks"
        checkpoints = glob.glob("signal.chk-*.h5")
        check(len(checkpoints) == 1, f"{name}: {len(checkpoints)} checkpoints; {said}")
        with open("signal.json", encoding="utf-8") as file:
            text = file.read()
        if number == signal.SIGUSR1:
            check(process.returncode == 0 and '"status": "done"' in text, f"{name} goes on: {said}")
        else:
            check('"status": "stopped"' in text and f'"{number.name}; checkpoint signal.chk-' in text, text[:500])
            check(process.returncode == (128 + number if ranks == 1 else process.returncode) != 0, f"{name}: code")
        if checkpoints:
            run(f"-restart {checkpoints[0]} -out_file signal.h5", ranks)
        same(expected, data("signal.h5"), name)


def altered(source, path, change):
    """A copy of a checkpoint with something changed in it, and a checksum that fits again."""
    with open(source, "rb") as file, open(path, "wb") as copy:
        copy.write(file.read())
    with h5py.File(path, "r+") as file:
        change(file)
    with open(path, "r+b") as file:
        block = checkpoint_block(file.read()[512:])
        file.seek(0)
        file.write(block)


def test_refusals():
    scene = f"{TINY} -ts_rk_type 3bs"
    run(f"{scene} -out_file r.h5 -out_checkpoint_every 8")
    checkpoint = sorted(glob.glob("r.chk-*.h5"))[0]
    before = data("r.h5")

    # another scene, another step: the difference is named
    refused(f"-restart {checkpoint} -ts_dt 0.3", 2, "-ts_dt 0.3", "0.02", "checkpoint")
    refused(f"-restart {checkpoint} -model_gamma 4", 2, "-model_gamma 4", "checkpoint")
    refused(f"-restart {checkpoint} -ts_rk_type 5dp", 2, "-ts_rk_type 5dp", "3bs")
    refused(f"-restart {checkpoint} -init_type uniform", 2, "-init_type uniform", "sine", ranks=2)
    with open("other.yaml", "w", encoding="utf-8") as file:
        file.write("model: {gamma: 3, c: 2}\n")
    refused(f"other.yaml -restart {checkpoint}", 2, "-model_c 2", "checkpoint")
    refused(f"-restart {checkpoint} -ts_max_time 1e-3", 2, "ts_max_time 1e-3", "before the time")
    run("-grid_n 24 -ts_max_time 1 -out_file grid.h5")
    refused(f"-restart {checkpoint} -out_file grid.h5", 2, "grid.h5", "another grid")

    # another version, or no checkpoint at all
    altered(checkpoint, "old.h5", lambda file: file.attrs.__setitem__("version", "0.0.9"))
    refused("-restart old.h5", 2, "old.h5", "version 0.0.9", "go on with the version that wrote it")
    altered(checkpoint, "git.h5", lambda file: file.attrs.__setitem__("git", "0123abc"))
    _, said = run("-restart git.h5 -out_file git-run.h5")
    check("revision 0123abc" in said, f"another revision is told: {said}")
    refused("-restart r.h5", 2, "r.h5", "is not a checkpoint")
    refused("-restart none.h5", 2, "none.h5", "No such file")
    refused("-restart .", 2, "restart '.'", "not a file")

    # senseless in spite of a checksum that fits
    def attribute(name, value, group="/"):
        return lambda file: file[group].attrs.__setitem__(name, value)
    for change, part in [(attribute("t", float("nan")), "no run can have"), (attribute("dt", -1.), "no run can have"),
                         (attribute("step", -3), "no run can have"), (attribute("kind", "run"), "is no checkpoint"),
                         (attribute("texts", "{"), "bad.h5"), (lambda file: file["fields"].pop("state"), "bad.h5"),
                         (lambda file: file["numbers"].attrs.pop("t_end"), "not a whole checkpoint"),
                         (attribute("nodes", 0., "numbers"), "nodes"),
                         (attribute("nodes", 10., "numbers"), "'state' does not fit")]:
        altered(checkpoint, "bad.h5", change)
        refused("-restart bad.h5", 2, part)

    # damage to single bytes is found by the checksum, a cut too
    with open(checkpoint, "rb") as file:
        content = file.read()
    rng = np.random.default_rng(3)
    for at in [*rng.integers(0, len(content), 12), 511, 512, 513]:
        broken = bytearray(content)
        broken[at] ^= 1 + int(rng.integers(255))
        with open("bad.h5", "wb") as file:
            file.write(broken)
        if at < 512 and not bytes(content[at:at + 1]).strip(b"\0"):
            continue  # beyond the block's text
        refused("-restart bad.h5", 2, "bad.h5")
    for length in (0, 100, 512, len(content) // 2, len(content) - 1):
        with open("bad.h5", "wb") as file:
            file.write(content[:length])
        refused("-restart bad.h5", 2, "bad.h5")
    same(before, data("r.h5"), "refusals leave the results alone")


def test_of_a_run_to_an_accuracy():
    """Its checkpoints are those of any run; what the accuracy was asked of is measured again as out_probes has it."""
    clear("acc")
    whole, _ = run("-grid_n 32 -grid_length 20 -accuracy 1e-4 -accuracy_of period -out_probes 0,7 -ts_max_time 30"
                   " -out_file acc.h5 -out_checkpoint_every 30 -out_checkpoint_keep 100")
    reference, checkpoints = data("acc.h5"), sorted(glob.glob("acc.chk-*.h5"))
    check(len(checkpoints) >= 2, f"{len(checkpoints)} checkpoints")
    again, _ = run(f"-restart {checkpoints[-2]} -out_file acc.h5")
    same(reference, data("acc.h5"), "a restart of a run to an accuracy")
    check(again["steps"] == whole["steps"] and abs(again["period"] / whole["period"] - 1) < 2e-3, f"{again['period']}")


def test_a_finished_run_is_extended():
    """A finished run goes on; frames, probes and series have no row twice and none missing."""
    scene = f"{TINY} {WHOLE} -ts_rk_type 3bs -out_every 0.1".replace("-out_frames 7", "")
    run(f"{scene} -out_file e.h5 -out_checkpoint_every 8")
    last = sorted(glob.glob("e.chk-*.h5"))[-1]
    summary, _ = run(f"-restart {last} -out_file e.h5 -ts_max_time 1.2")
    now = data("e.h5")
    check(np.allclose(now["t"], np.arange(13) * 0.1, atol=1e-12), f"frames: {now['t']}")
    for name in ("probes/t", "series/t"):
        check((np.diff(now[name]) > 0).all() and len(now[name]) == summary["steps"] + 1, f"rows of {name}")
    check(np.array_equal(now["series/step"], np.arange(summary["steps"] + 1)), "every step has its row")


def told(stderr):
    """The command that a stopped run or sweep prints to go on with, as a shell takes it."""
    found = re.search(r"to go on: (stickslip .*)$", stderr, re.MULTILINE)
    check(found, stderr)
    return found.group(1)


def typed(command):
    return subprocess.run(["sh", "-c", command.replace("stickslip", shlex.quote(PROGRAM), 1)], capture_output=True, text=True, timeout=300)


def closing(arguments):
    """What a run says at its end."""
    done = ran([PROGRAM, "run", *words(arguments)])
    check(done.returncode == 0, done.stderr)
    return done.stderr


def drawn_stop(rng):
    """A run with checkpoints, and the limits at which it and those that go on with it stop."""
    scene = rng.choice([
        TINY.replace(" -ts_max_steps 40", ""),
        "-grid_n 6 -model_form chain -friction_law coulomb -friction_fd 0.5 -init_psi 0.4 -init_noise 0.3 -ts_max_time 30 -out_frames 7",
        "-grid_n 80 -model_form chain -friction_law carlson-langer -friction_sigma 0.1 -init_psi 0 -init_noise_of eta -init_noise 0.4 "
        "-ts_max_time 5 -out_frames 7"])
    return scene + " -ts_rk_type 3bs" * int("80" not in scene), int(rng.integers(3, 30)), rng.choice(["a b/it's.h5", "plain.h5"])


def test_every_line_to_go_on_goes_on(scenes):
    """The command is typed as it stands, and again as often as it stops, and ends in the file of a run without limits."""
    for index, (scene, steps, name) in scenes(drawn_stop, 71, short=2):
        os.makedirs("a b", exist_ok=True)
        clear("whole")
        files = ["-out_checkpoint_every", "7", "-out_checkpoint_keep", "1000"]
        run([*scene.split(), "-out_file", "whole.h5", *files])
        said = closing([*scene.split(), "-out_file", name, *files, "-ts_max_steps", steps])
        before = data(name)["series/t"][-1]
        done = typed(told(said))
        check(done.returncode == 0 and data(name)["series/t"][-1] > before and "stopped" not in done.stderr, f"{index}: {told(said)}: {done.stderr}")
        same(data("whole.h5"), data(name), f"{index}: {scene}, stopped after {steps}")
        os.remove(name)


def test_a_limit_that_is_reached_is_told_and_lifted():
    scene = TINY.replace("-ts_max_steps 40", "-ts_rk_type 3bs -out_checkpoint_every 5 -out_file l.h5")
    said = closing(scene + " -ts_max_steps 20")
    before = data("l.h5")
    more = closing("-restart l.chk-000020.h5")
    check("ts_max_steps 20; nothing is left to do" in more, more)
    same(before, data("l.h5"), "nothing was done")
    check(told(more) == told(said) == "stickslip run -restart l.chk-000020.h5 -ts_max_steps unlimited", told(more))
    s, more = run("-restart l.chk-000020.h5 -ts_max_steps unlimited -out_checkpoint_every none -out_times none")
    check(s["status"] == "done" and s["t_end"] == 0.9 and s["files"] == ["l.h5"], f"{s['status']}, {s['files']}")
    s, _ = run("-restart l.chk-000020.h5 -ts_max_steps 25")
    check(s["steps"] == 25 and s["options"]["ts_max_steps"] == "25", "another limit")
    # a word for what the run did not set is none, and for what only the start may set an error
    refused("-restart l.chk-000020.h5 -grid_n auto", 2, "-grid_n", "20")
    run("-restart l.chk-000020.h5 -load_v none -ts_max_steps 21")


def test_the_clock_and_signals():
    """A clock begins anew; what it has stopped goes on, and what a signal stops then."""
    scene = "-grid_n 64 -init_type sine -ts_max_time 1e6 -out_times 1,2 -out_series_every 100 -out_file c.h5 -out_checkpoint_every 1000000"
    said = closing(scene + " -ts_max_wall 1s")
    first, begun = data("c.h5")["series/t"][-1], set(glob.glob("c.chk-*"))
    process = subprocess.Popen(["sh", "-c", "exec " + told(said).replace("stickslip", shlex.quote(PROGRAM), 1) +
                                " -ts_max_wall unlimited -out_checkpoint_every 5000"], stderr=subprocess.PIPE, text=True)
    while not set(glob.glob("c.chk-*.h5")) - begun and process.poll() is None:  # it goes on, however long its start takes
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    second = data("c.h5")["series/t"][-1]
    check(process.returncode == 130 and second > first, said)
    done = typed(told(said) + f" -ts_max_time {second + 40!r} -out_times {second + 40!r}")
    check(done.returncode == 0 and data("c.h5")["t"][-1] > second, f"{told(said)}: {done.stderr}")


def test_a_sweep_goes_on():
    given = ("-sweep_parameter1 model_v -sweep_from1 0.1 -sweep_to1 1.5 -sweep_points1 2000 -model_form chain -grid_n 1 -bc_left free "
             "-ts_max_time 200 -out_file").split() + ["my sweep.h5"]
    process = subprocess.Popen([PROGRAM, "sweep", *given], stderr=subprocess.PIPE, text=True)
    while not os.path.exists("my sweep.h5") and process.poll() is None:
        time.sleep(0.01)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    check(process.returncode == 130, said)
    done = typed(told(said))
    check(done.returncode == 0 and "2000 of 2000 points" in done.stderr, f"{told(said)}: {done.stderr}")
