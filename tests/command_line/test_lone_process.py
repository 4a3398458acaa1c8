"""The start as a single process, without mpirun: no daemon, no search of the network, unless the user asks."""
import os
import re
import shutil
import subprocess
import time

import pytest

PROGRAM = os.environ["STICKSLIP"]


def version(**more):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OMPI_MCA_")}
    return subprocess.run([PROGRAM, "--version"], env={**environment, **more}, capture_output=True, text=True, check=False)


def test_no_daemon_is_started():
    done = version(OPAL_BINDIR="/nonexistent")  # where Open MPI's daemon would be
    assert done.returncode == 0 and done.stdout.startswith("stickslip "), done.stderr


def test_its_folder_is_its_own(tmp_path):
    """Open MPI has one folder for all processes of a user, and each that ends removes it: whoever starts at that moment
    dies. Here none can be made at all. Nothing is left by one that is done, refuses, is at work or is killed."""
    shared = tmp_path / f"ompi.{os.uname().nodename}.{os.geteuid()}"
    shared.write_text("")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OMPI_MCA_")}
    environment["TMPDIR"] = str(tmp_path)
    for more in ({}, {"OMPI_MCA_orte_tmpdir_base": str(tmp_path)}, {"OMPI_MCA_orte_create_session_dirs": "1"}):
        done = version(**environment, **more)
        assert done.returncode == 0 and done.stdout.startswith("stickslip "), done.stderr
    assert subprocess.run([PROGRAM, "run", "-grid_n", "0"], env=environment, capture_output=True, check=False).returncode == 2
    shared.unlink()
    before = set(os.listdir(tmp_path))
    with subprocess.Popen([PROGRAM, "run", "-ts_max_time", "1e9", "-out_file", "a.h5", "-out_every", "1e6", "-progress", "off"],
                          env=environment) as process:
        while process.poll() is None and not os.path.exists("a.h5"):
            time.sleep(0.01)
        at_work = set(os.listdir(tmp_path))
        process.kill()
    assert at_work == before == set(os.listdir(tmp_path)), at_work - before


def test_a_daemon_is_started_where_the_user_asks():
    if "Open MPI v4." not in version().stdout:
        return  # later releases start none
    assert version(OPAL_BINDIR="/nonexistent", OMPI_MCA_ess_singleton_isolated="0").returncode != 0


def test_parameters_of_the_user_stay(tmp_path):
    assert version(OMPI_MCA_pml="none_of_this_name").returncode != 0
    folder = tmp_path / ".openmpi"
    folder.mkdir()
    (folder / "mca-params.conf").write_text("# mine\n  pml = none_of_this_name\n", encoding="utf-8")
    assert version(HOME=str(tmp_path)).returncode != 0


@pytest.mark.skipif(not shutil.which("strace"), reason="strace is not installed")
def test_the_start_has_no_sleep():
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OMPI_MCA_")}
    done = subprocess.run(["strace", "-f", "-o", "calls.txt", PROGRAM, "cycle", "-model_form", "chain", "-grid_n", "1", "-bc_left",
                           "free", "-progress", "off"], env=environment, capture_output=True, text=True, check=False)
    with open("calls.txt", encoding="utf-8", errors="replace") as file:
        calls = file.read().splitlines()
    if done.returncode != 0 or not any("execve(" in one for one in calls):
        pytest.skip("strace cannot trace here")
    # the main process neither sleeps nor waits for a time; PMIx's thread waits for what comes, until it is told to end
    main = calls[0].split()[0]
    waits = [one for one in calls if re.search(r"\b(nanosleep|clock_nanosleep|sched_yield|pause)\(", one) or
             (one.split()[0] == main and re.search(r"\b(poll|ppoll|select|pselect6|epoll_wait)\(", one))]
    assert not waits, waits[:5]
