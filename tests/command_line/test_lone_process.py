"""The start as a single process, without mpirun: no daemon, no search of the network, unless the user asks."""
import os
import re
import shutil
import subprocess

import pytest

PROGRAM = os.environ["STICKSLIP"]


def version(**more):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OMPI_MCA_")}
    return subprocess.run([PROGRAM, "--version"], env={**environment, **more}, capture_output=True, text=True, check=False)


def test_no_daemon_is_started():
    done = version(OPAL_BINDIR="/nonexistent")  # where Open MPI's daemon would be
    assert done.returncode == 0 and done.stdout.startswith("stickslip "), done.stderr


def test_a_daemon_is_started_where_the_user_asks():
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
