"""Limits of trains from outside: keys, file, the diagram over one of sliding, bad input."""
import os

import h5py
import numpy as np

from calls import check, refused, run, tool
from files_page import FilesPage, disagreements

TRAIN = "-model_v 0.853 -wave_pulses 1 -wave_length 25 "


def test_limits_followed_in_a_second_option():
    found, _ = run(TRAIN + "-wave_continue model_v -wave_to 0.8555 -wave_steps 4 -wave_continue2 model_gamma -wave_to2 3.1 "
                   "-out_file t.h5", command="wave")
    check([p["kind"] for p in found["special"]] == ["hopf"] and found["special"][0]["leads"], found["special"])
    check(abs(found["special"][0]["value"] - 0.8541419474) < 1e-9, "the velocity at gamma = 3")
    curve = found["curves"][0]
    check(curve["end"] == "model_v leaves its range" and abs(curve["points"][-1]["value"] - 0.8555) < 1e-9, curve["end"])
    check(np.all(np.diff([p["value2"] for p in curve["points"]]) > 0), curve["points"])
    check(all(p["length"] == 25 and p["frequency"] > 0.4 for p in curve["points"]), curve["points"])
    check(not disagreements("t.h5", FilesPage()), "docs/files.md, of curves/")
    with h5py.File("t.h5") as file:
        check(np.all(file["curves/value"][...] == [p["value"] for p in curve["points"]]), "the file has the same")
    run("-grid_n 16 -boundary_parameter model_gamma -boundary_from 2.9 -boundary_to 3.1 -boundary_parameter2 model_v "
        "-boundary_from2 0.8 -boundary_to2 1 -boundary_points 4 -out_file b.h5", command="boundary")
    for files in (["t.h5"], ["b.h5", "t.h5"]):  # with the axes the other way round, too
        done = tool("plot.py", *files, "-o", "d.png")
        check(done.returncode == 0 and os.path.getsize("d.png") > 5000, done.stderr)


def test_curves_in_the_damping_are_those_of_undamped_trains():
    # damping scales out of the cubic law: (gamma, delta, v) is (gamma a^2, 0, v/a) with a^2 = 1 - delta/gamma
    found, _ = run("-model_delta 0 -model_v 0.893 -wave_pulses 1 -wave_length 25 -wave_continue model_v -wave_to 0.8962 "
                   "-wave_steps 6 -wave_continue2 model_delta -wave_to2 0.1", command="wave")
    (curve,) = found["curves"]
    at = np.array([[(p["value"] - 0.893) / 0.0032, p["value2"] / 0.1] for p in curve["points"]])
    apart = np.hypot(*np.diff(at, axis=0).T)
    # a piece of a curve that turns by less than 0.5 differs from its chord by less than 1/90
    check(len(at) > 3 and apart.max() / apart.min() < 1.03, f"even along the curve: {apart}")
    last = curve["points"][-1]
    a = np.sqrt(1 - last["value2"] / 3)
    check(curve["points"][0]["value2"] == 0 and a < 1, curve)
    train, _ = run(f"-model_delta 0 -model_gamma {3 * a * a} -model_v {last['value'] / a} -wave_pulses 1 -wave_length 25 "
                   "-wave_spectrum -spectrum_count 4", command="wave")
    modes = [z for z in train["eigenvalues"] if not z["translation"] and abs(z["re"]) < 1e-9]
    check(abs(train["speed"] - last["speed"]) < 1e-8 and len(modes) == 2 and
          abs(abs(modes[0]["im"]) - last["frequency"]) < 1e-8, f"{last} against {train['eigenvalues']}")


def test_what_makes_no_sense_is_refused():
    branch = TRAIN + "-wave_continue model_v -wave_to 0.856 "
    refused(TRAIN + "-wave_continue2 model_gamma -wave_to2 3.1", 2, "wave_continue", command="wave")
    refused(branch + "-wave_continue2 model_gamma", 2, "wave_to2", command="wave")
    refused(branch + "-wave_continue2 model_v -wave_to2 0.9", 2, "already", command="wave")
    refused(branch + "-wave_continue2 model_gama -wave_to2 3.1", 2, "model_gamma", command="wave")
