"""Units and labels: what closing lines, files, pictures and summaries call things by; no number depends on them. The scenes
that are there to be replaced by one's own, and how their data were made."""
import json
import os
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

from calls import PROGRAM, SOURCE, check, ran, refused, run, scene_file, tool

sys.path.insert(0, os.path.join(SOURCE, "scripts"))
import synthetic  # noqa: E402

BRAKE = os.path.join(SOURCE, "runs", "brake.yaml")


def said(*words, code=0):
    done = ran([PROGRAM, *words])
    check(done.returncode == code, f"{words}: {done.returncode} {done.stderr}")
    return done.stderr


def number(pattern, text):
    found = re.search(pattern, text)
    check(found is not None, f"{pattern} in {text}")
    return float(found[1])


def test_closing_lines_carry_units():
    text = said("run", BRAKE, "-summary", "s.json", "-out_file", "r.h5", "-out_frames", "3")
    with open("s.json", encoding="utf-8") as file:
        summary = json.load(file)
    check(summary["units"] == {"length": "m", "time": "s", "force": "N"}, summary["units"])
    check(summary["labels"] == {"model_v": "disc speed", "model_zeta": "damping"}, summary["labels"])
    check(abs(number(r"period [\d.e-]+ s \(([\d.]+) Hz\)", text) * summary["period"] - 1) < 1e-3, text)
    check(number(r"psi from [\d.e-]+ to ([\d.]+) m/s over", text) > 0.4 and "t = 0.2 s in" in text, text)
    with h5py.File("r.h5") as file:
        units = {name: file[name].attrs["units"] for name in ("t", "psi", "series/dt")}
        check(units == {"t": "s", "psi": "m/s", "series/dt": "s"}, units)
        check("units" not in file["x"].attrs or file["x"].attrs["units"] != "m", "blocks are counted, not measured")
        options = json.loads(file.attrs["option_units"])
    check(options["model_k0"] == "N/m" and options["model_m"] == "kg" and options["model_zeta"] == "N s/m", options)


def test_no_number_depends_on_them():
    scene = "-model_form chain -grid_n 1 -bc_left free -model_v 0.3 -ts_max_time 40 "
    plain, named = run(scene)[0], run(scene + "-units_length furlong -units_time fortnight -units_force lbf "
                                      "-labels_model_v plate")[0]
    differ = [key for key in plain if plain[key] != named[key] and key not in ("options", "units", "labels", "wall_s")]
    check(not differ and plain["units"] is None and plain["labels"] is None, f"{differ} {plain['units']}")


def test_the_map_is_in_hertz_and_metres_a_second():
    axes = [word for name, low, high, number in (("model_v", 0.05, 3, ""), ("model_zeta", 1, 200, "2"))
            for word in (f"-boundary_parameter{number}", name, f"-boundary_from{number}", str(low), f"-boundary_to{number}", str(high))]
    done = ran([PROGRAM, "boundary", BRAKE, *axes[:6], "-boundary_of", "sliding"])
    check(re.search(r"disc speed [\d.]+ m/s  hopf, .*frequency 1[34]\d\d\S* 1/s \(22\d\S* Hz\)", done.stdout), done.stdout)
    check(re.search(r"along disc speed sliding is unstable from 0.05 to [\d.]+ m/s, stable from [\d.]+ to 3 m/s", done.stderr), done.stderr)
    text = said("boundary", BRAKE, *axes, "-boundary_points", "9", "-boundary_of", "sliding", "-out_file", "b.h5")
    check(re.search(r"disc speed [\d.]+ to [\d.]+ m/s, damping [\d.]+ to [\d.]+ N s/m", text), text)
    text = said("spectrum", BRAKE)
    check(abs(number(r"frequency [\d.]+ 1/s \(([\d.]+) Hz\)", text) - np.sqrt(1e6 / 0.5) / (2 * np.pi)) < 1, text)
    text = said("cycle", BRAKE)
    # of one block on its spring: k0 z = f0 eta, and Newton's law along the orbit
    summary, _ = run(BRAKE + " -out_file c.h5", command="cycle")
    with h5py.File("c.h5") as file:
        psi, eta = file["psi"][:, 0], file["eta"][:, 0]
        friction = np.interp(psi, file["friction/psi"][...], file["friction/F"][...])
    moves = psi > 0
    push = np.abs(400 * (eta - friction) - 10 * psi)[moves].max() / 0.5
    check(abs(summary["displacement"] / (400 * np.ptp(eta) / 2 / 1e6) - 1) < 1e-3, f"{summary['displacement']} {np.ptp(eta)}")
    check(abs(summary["acceleration"] / push - 1) < 1e-2, f"{summary['acceleration']} {push}")
    for key, pattern in (("amplitude", r"amplitude ([\d.e-]+) m/s,"), ("displacement", r"displacement ([\d.e-]+) m to either side"),
                         ("acceleration", r"acceleration up to ([\d.e+-]+) m/s\^2")):
        check(abs(number(pattern, text) / summary[key] - 1) < 1e-3, f"{key}: {text}")
    check(abs(number(r"force drop [\d.e-]+ \(([\d.e+-]+) N\)", text) / (400 * summary["force_drop"]) - 1) < 1e-3, text)
    done = tool("plot.py", "b.h5", "-o", "b.svg")
    check(done.returncode == 0, done.stderr)
    with open("b.svg", encoding="utf-8") as file:
        drawn = file.read()
    check("disc speed (m/s)" in drawn and "damping (N s/m)" in drawn, re.findall(r"<!-- (.*?) -->", drawn))


def test_what_a_scene_s_files_do_not_hold_is_told():
    """A motion that leaves the table of its friction, and a header in units that are not the scene's."""
    with open("kmh.csv", "w", encoding="latin-1") as file:
        file.write("Gleitgeschwindigkeit \u00fcber Grund (km/h);Reibung\n0;0.5\n0.6;0.45\n1;0.4\n")
    text = said("run", BRAKE, "-ts_max_time", "0.05", "-friction_table",
                'kmh.csv:"Gleitgeschwindigkeit \u00fcber Grund (km/h)",Reibung')
    check("km/h of the header is no unit of the scene (m, s, m/s)" in text and "columns 'Gleitgeschwindigkeit \u00fcber Grund" in text, text)
    check(re.search(r"psi comes to 1\.\d+ m/s, beyond the end of friction_table at 1 m/s: there friction is taken as constant", text), text)
    text = said("cycle", BRAKE)
    check("beyond the end" not in text and "no unit of the scene" not in text, text)


def test_units_of_a_train():
    text = said("wave", *"-wave_pulses 1 -wave_length 25 -units_length m -units_time s -units_force N".split())
    for pattern in (r"speed V = [\d.]+ m/s, length L = 25 m, period T = [\d.]+ s \([\d.]+ Hz\)", r"psi from [-\d.]+ to [\d.]+ m/s"):
        check(re.search(pattern, text), text)


def test_what_is_implicit_and_what_smoothing_costs():
    block = "run -grid_n 1 -bc_left free -model_form chain -ts_max_time 5 -accuracy 1e-3".split()
    text = said(*block, *"-friction_law coulomb -friction_stick regularised -friction_eps 0.05 -ts_type arkimex".split())
    check(" steps of arkimex:" in text and " with friction implicit (" in text, text)
    check("without what smoothing over friction_eps changes" in text, text)
    check("smoothing" not in said(*block), "smooth friction")


@pytest.mark.parametrize("words, says", [
    ("-labels_model_w plate", "model_w"), ("-labels 'model_v'", "no words"), ("-labels_model_v 'a, b'", "comma")])
def test_labels_refused(words, says):
    refused("-grid_n 8 " + words, 2, says)


def test_data_of_the_scenes():
    """The file is the one that the script makes."""
    os.mkdir("made")
    subprocess.run(["/usr/bin/python3", "-B", os.path.join(SOURCE, "scripts", "synthetic.py"), PROGRAM, "made"], check=True)
    for name in ("lab-steps.csv",):
        with open(os.path.join(SOURCE, "runs", name), encoding="utf-8") as file:
            shipped = file.read().splitlines()
        with open(os.path.join("made", name), encoding="utf-8") as file:
            made = file.read().splitlines()
        check(made[0] == shipped[0] and len(made) == len(shipped), name)
        # a digit that is rounded may fall to either side
        a, b = (np.array([line.split(",") for line in lines[1:]], float) for lines in (made, shipped))
        check(np.allclose(a, b, rtol=0, atol=1.1e-4), f"{name}: {np.abs(a - b).max()}")


def test_the_laboratory_file():
    s, _ = run(scene_file("lab-steps"), command="fit")
    true = {"friction_a": synthetic.BLOCK["friction_a"], "friction_b": synthetic.BLOCK["friction_b"],
            "friction_D": synthetic.BLOCK["friction_D"], "friction_mu0": synthetic.BLOCK["friction_mu0"]}
    far = {p["name"]: (p["value"] - true[p["name"]]) / p["error"] for p in s["parameters"]}
    check(max(abs(x) for x in far.values()) < 3.5, f"{far}")
    check(abs(s["trend"]["value"] - synthetic.DRIFT) < 3.5 * s["trend"]["error"], s["trend"])
    check(not s["warnings"] and s["independent_rows"] > 200, f"{s['warnings']} {s['independent_rows']}")
    without, _ = run(scene_file("lab-steps") + " -fit_trend none", command="fit")
    told = [w for w in without["warnings"] if "errors are too small" in w]
    check(len(told) == 1 and without["independent_rows"] < s["independent_rows"], f"{without['warnings']} {without['parameters']}")
