"""Every command of the tour and of the study does what a reader expects of it, run as it stands there."""
import json
import os
import re
import subprocess

import xarray

from calls import PROGRAM, SOURCE, ran, tool


def walked(page):
    """Runs the commands of the page; gives a function that finds the summary of the first one that begins with some words."""
    with open(os.path.join(SOURCE, page), encoding="utf-8") as file:
        text = re.search(r"```sh\n(.*?)```", file.read(), re.DOTALL).group(1)
    commands = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert len(commands) >= 8, commands
    os.makedirs("build")
    os.makedirs("results")
    os.symlink(PROGRAM, os.path.join("build", "stickslip"))
    for name in ("runs", "postprocess"):
        os.symlink(os.path.join(SOURCE, name), name)
    said = {}
    typed = set()
    for command in commands:
        plain = re.sub(r"\s+#.*", "", command)
        program, *words = plain.split()
        if program not in typed or re.search(r"[^\w\s./=,:+-]", plain):
            done = subprocess.run(command, shell=True, capture_output=True, text=True)
        else:  # of each program once more, for a tenth of the time of a start
            done = ran([PROGRAM, *words]) if program == "build/stickslip" else tool(os.path.basename(program), *words)
        typed.add(program)
        assert done.returncode == 0 and "stickslip: error: " not in done.stderr, f"{command}\n{done.stderr}"
        said[command] = done.stdout

    def summary(start):
        command = next(c for c in commands if c.startswith(start))
        name = re.search(r"-summary (\S+)", command).group(1)
        if name == "-":
            return json.loads(said[command])
        with open(name, encoding="utf-8") as file:
            return json.load(file)

    return summary


def test_tour():
    summary = walked("docs/tour.md")
    run = summary("build/stickslip run runs/pacemaker.yaml")
    assert run["regime"] == "stick-slip" and run["warnings"] == [], run["warnings"]
    assert summary("build/stickslip run runs/chain-damped.yaml -out_file")["regime"] == "stick-slip"
    assert summary("build/stickslip run runs/chain-damped.yaml -model_v")["regime"] == "sliding"
    smooth = summary("build/stickslip run runs/chart-smooth.yaml")
    assert smooth["wave_speed"] is None and smooth["error_estimate"] <= 1e-6  # a sine that steepens where it stands
    # growth rate -C/2, C = gamma (v^2 - 1) + delta
    spectrum = summary("build/stickslip spectrum")
    assert abs(spectrum["growth_rate"] + (3 * (0.95**2 - 1) + 0.2) / 2) < 1e-9 and spectrum["stable"] is False
    # C = 0 at v = sqrt(1 - delta/gamma)
    points = summary("build/stickslip boundary -grid_n")["points"]
    assert len(points) == 1 and abs(points[0]["value"] - (1 - 0.2 / 3)**0.5) < 1e-9, points
    assert abs(summary("build/stickslip wave")["speed"] - 2.68955) < 1e-5
    for picture in ("pacemaker.png", "pacemaker-phase.png", "catalogue.png", "diagram.png", "cycle.png"):
        assert os.path.getsize(os.path.join("results", picture)) > 5000, picture


def test_study():
    summary = walked("docs/study.md")
    run, stricter = (summary("build/stickslip run runs/study.yaml" + more) for more in (" -out_file", " -ts_rtol"))
    assert run["regime"] == stricter["regime"] == "stick-slip"
    assert abs(run["amplitude"] / stricter["amplitude"] - 1) < 1e-4
    sliding, end = summary("build/stickslip boundary")["points"]
    assert sliding["criticality"] == "subcritical" and abs(sliding["value"] - 1.6591479485) < 1e-9
    assert end["kind"] == "graze" and abs(end["value"] - 2.4047128309) < 1e-8
    assert abs(summary("build/stickslip cycle")["rest_fraction"] - 0.3084) < 5e-5
    sweep = xarray.open_dataset("results/sweep.h5", engine="h5netcdf")
    up, down = sweep.regime.values.T
    assert list(up) == ["stick-slip"] * 20 + ["sliding"] * 6
    assert list(down[sweep.model_v > 1.75]) == ["sliding"] * 13
    for picture in ("study", "sweep", "cycle", "diagram", "catalogue"):
        assert os.path.getsize(os.path.join("results", picture + ".png")) > 5000, picture


def test_what_is_missing_is_installed():
    """By a dpkg-query and an apt-get of our own: a package that was removed, or asked for by another one, is `not-installed`."""
    os.mkdir("bin")
    known = {"here": "installed ", "of-two-kinds": "not-installed installed ", "gone": "not-installed ", "left": "config-files ", "new": ""}
    said = "".join(f"{name}) printf '{status}';; " for name, status in known.items())
    for name, does in {"dpkg-query": f'case "${{@: -1}}" in {said}esac', "apt-get": 'echo "$@" >> asked', "id": "echo 0"}.items():
        with open(os.path.join("bin", name), "w", encoding="ascii") as file:
            file.write(f"#!/bin/bash\n{does}\n")
        os.chmod(os.path.join("bin", name), 0o755)
    script = f'. "{SOURCE}/scripts/prepare.sh"; packages=(here gone); install_missing of-two-kinds left new'
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, env=os.environ | {"PATH": "bin:" + os.environ["PATH"]})
    assert done.returncode == 0, done.stderr
    with open("asked", encoding="ascii") as file:
        asked = file.read().splitlines()
    assert asked[-1].split()[-3:] == ["gone", "left", "new"], asked
