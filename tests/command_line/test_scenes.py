"""Every scene in runs/ begins with a comment that says what it shows, and starts: a few steps of it are taken."""
import glob
import os
import re

import pytest

from calls import PROGRAM, SOURCE, ran

SCENES = sorted(glob.glob(os.path.join(SOURCE, "runs", "**", "*.yaml"), recursive=True))
# A scene with options of another command than run is for that one; a little of it is enough here.
FEW = {"run": ["-ts_max_steps", "5"], "boundary": "-boundary_points 2 -boundary_of sliding".split(), "spectrum": ["-spectrum_count", "2"],
       "cycle": ["-cycle_steps", "2", "-cycle_wavenumbers", "10"],
       "sweep": "-ts_max_time 5 -sweep_points1 2 -out_file few.h5".split(),
       "wave": ["-wave_steps", "2"],
       "chart": "-chart_methods rk:3bs -chart_tolerances 1e-2 -chart_repeats 1 -ts_max_time 0.1".split()}


def test_there_are_scenes():
    assert len(SCENES) >= 11


@pytest.mark.parametrize("scene", SCENES, ids=[os.path.basename(scene)[:-5] for scene in SCENES])
def test_scene_says_what_it_shows_and_starts(scene):
    with open(scene, encoding="utf-8") as file:
        text = file.read()
    assert len(re.match(r"(#.*\n)*", text).group(0)) > 40, f"{scene} does not say what it shows"
    command = (re.findall(r"^(sweep|boundary|chart|cycle|laws|spectrum|wave|fit)[:_]", text, re.MULTILINE) or ["run"])
    command = next((c for c in ("sweep", "boundary") if c in command), command[0])
    done = ran([PROGRAM, command, scene, *FEW.get(command, [])])
    assert done.returncode == 0 and "stickslip: error: " not in done.stderr, done.stderr
    assert ("does not fit" in done.stderr) == ("pacemaker-jump" in scene), done.stderr
