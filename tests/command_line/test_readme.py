"""Every command of the README's tour does what a reader expects of it, run as it stands there."""
import json
import os
import re
import subprocess

from calls import PROGRAM, SOURCE


def tour():
    with open(os.path.join(SOURCE, "README.md"), encoding="utf-8") as page:
        text = re.search(r"```sh\n(.*?)```", page.read(), re.DOTALL).group(1)
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def test_tour():
    commands = tour()
    assert len(commands) >= 8, commands
    os.makedirs("build")
    os.makedirs("results")
    os.symlink(PROGRAM, os.path.join("build", "stickslip"))
    for name in ("runs", "postprocess"):
        os.symlink(os.path.join(SOURCE, name), name)
    said = {}
    for command in commands:
        done = subprocess.run(command, shell=True, capture_output=True, text=True)
        assert done.returncode == 0 and "stickslip: error: " not in done.stderr, f"{command}\n{done.stderr}"
        said[command] = done.stdout

    def summary(start):
        """What the first command that begins so wrote as its summary."""
        command = next(c for c in commands if c.startswith(start))
        name = re.search(r"-summary (\S+)", command).group(1)
        if name == "-":
            return json.loads(said[command])
        with open(name, encoding="utf-8") as file:
            return json.load(file)

    run = summary("build/stickslip run runs/pacemaker.yaml")
    assert run["regime"] == "stick-slip" and run["warnings"] == [], run["warnings"]
    assert summary("build/stickslip run runs/chain-damped.yaml -out_file")["regime"] == "stick-slip"
    assert summary("build/stickslip run runs/chain-damped.yaml -model_v")["regime"] == "sliding"
    # growth rate -C/2, C = gamma (v^2 - 1) + delta
    spectrum = summary("build/stickslip spectrum")
    assert abs(spectrum["growth_rate"] + (3 * (0.95**2 - 1) + 0.2) / 2) < 1e-9 and spectrum["stable"] is False
    # C = 0 at v = sqrt(1 - delta/gamma)
    points = summary("build/stickslip boundary")["points"]
    assert len(points) == 1 and abs(points[0]["value"] - (1 - 0.2 / 3)**0.5) < 1e-9, points
    assert abs(summary("build/stickslip wave")["speed"] - 2.68955) < 1e-5
    for picture in ("pacemaker.png", "pacemaker-phase.png", "laws.png"):
        assert os.path.getsize(os.path.join("results", picture)) > 5000, picture
