"""Every scene in runs/ begins with a comment that says what it shows, and starts: a few steps of it are taken."""
import glob
import os
import re
import subprocess

scenes = sorted(glob.glob(os.path.join(os.environ["STICKSLIP_SOURCE"], "runs", "*.yaml")))
assert len(scenes) >= 11, scenes
# A scene with options of another command than run is for that one; a little of it is enough here.
few = {"run": ["-ts_max_steps", "5"], "boundary": ["-boundary_points", "2"], "spectrum": ["-spectrum_count", "2"],
       "chart": "-chart_methods rk:3bs -chart_tolerances 1e-2 -chart_repeats 1 -ts_max_time 0.1".split()}
for scene in scenes:
    with open(scene, encoding="utf-8") as file:
        text = file.read()
    comment = re.match(r"(#.*\n)*", text).group(0)
    assert len(comment) > 40, f"{scene} does not say what it shows"
    command = (re.findall(r"^(boundary|chart|laws|spectrum|wave)[:_]", text, re.MULTILINE) or ["run"])[0]
    done = subprocess.run([os.environ["STICKSLIP"], command, scene, *few.get(command, [])], capture_output=True, text=True)
    assert done.returncode == 0 and "error" not in done.stderr, f"{scene}: {done.stderr}"
    fits = "pacemaker-jump" not in scene
    assert ("does not fit" in done.stderr) == (not fits), f"{scene}: {done.stderr}"
