"""Every scene in runs/ begins with a comment that says what it shows, and starts: a few steps of it are taken."""
import glob
import os
import re
import subprocess

scenes = sorted(glob.glob(os.path.join(os.environ["STICKSLIP_SOURCE"], "runs", "*.yaml")))
assert len(scenes) >= 11, scenes
for scene in scenes:
    with open(scene, encoding="utf-8") as file:
        comment = re.match(r"(#.*\n)*", file.read()).group(0)
    assert len(comment) > 40, f"{scene} does not say what it shows"
    # a scene for another command names it: for `stickslip laws`
    command = (re.findall(r"for `stickslip (\w+)`", comment) or ["run"])[0]
    few = ["-ts_max_steps", "5"] if command == "run" else []
    done = subprocess.run([os.environ["STICKSLIP"], command, scene, *few], capture_output=True, text=True)
    assert done.returncode == 0 and "error" not in done.stderr, f"{scene}: {done.stderr}"
    fits = "pacemaker-jump" not in scene
    assert ("does not fit" in done.stderr) == (not fits), f"{scene}: {done.stderr}"
