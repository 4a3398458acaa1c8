"""One page about a scene: its numbers are those of the commands that they come from, and what does not apply is named."""
import json
import os
import sys

from calls import SOURCE, run, scene_file, tool


def report(scene, *more):
    done = tool("report.py", scene, "-o", "r.png", *more)
    assert done.returncode == 0, done.stderr
    assert os.path.getsize("r.png") > 20000
    with open("r.json", encoding="utf-8") as file:
        return json.load(file), done.stdout


def test_numbers_are_those_of_the_commands():
    scene = scene_file("measured-curve")
    found, said = report(scene)
    spectrum, _ = run(scene, command="spectrum")
    cycle, _ = run(scene, command="cycle")
    ends, _ = run(scene + " -boundary_parameter model_v -boundary_from 0.02 -boundary_to 0.5 -boundary_of both", command="boundary")
    assert found["sliding"]["growth_rate"] == spectrum["growth_rate"] and found["sliding"]["stable"] is False
    assert found["oscillation"]["period"] == cycle["period"]
    assert [point["value"] for point in found["ends"]["points"]] == [point["value"] for point in ends["points"]]
    assert found["motion"]["regime"] == "stick-slip"
    # the branch starts at the scene's cycle and reaches both ends of the range
    values = [point["value"] for point in found["amplitude"]]
    assert values == sorted(values) and abs(values[0] - 0.02) < 1e-9 and abs(values[-1] - 0.5) < 1e-9
    assert found["map"]["at"] == [0.1, 0.5] and found["refused"] == {}, found["refused"]
    assert f"period {cycle['period']:.6g}" in said


def test_a_catalogue_and_what_does_not_apply():
    found, said = report(scene_file("catalogue"), "--", "-grid_n", "20", "-ts_max_time", "3000")
    assert found["catalogue"]["events"] > 20 and "events" in said
    assert "map" in found["refused"] and "\nMap: no boundary in the box" in said


def test_what_does_not_matter_and_one_reason_is_said_once():
    """The stiffness of a spring under one block with cubic friction; a load that most commands do not take; panels fill the page."""
    found, said = report(scene_file("chain-plain"), "--", "-grid_n", "1", "-bc_left", "free", "-model_v", "0.5", "-ts_max_time", "20")
    assert "Stiffness to the plate k₀ does not matter for where sliding changes its stability." in said, said
    assert len({point["value2"] for point in found["map"]["points"]}) > 2
    found, said = report(scene_file("lab-steps"), "--", "-ts_max_time", "16")
    assert len(found["refused"]) == 5 and said.count("-load_v") == 2 and "No sliding and friction: " in said, said
    sys.path.insert(0, os.path.join(SOURCE, "postprocess"))
    import stickslip
    run(scene_file("brake") + " -ts_max_time 1e-3 -out_file b.h5")
    with stickslip.reading("b.h5") as file:
        title = stickslip.scene_title(file).replace("\u00a0", " ")
    assert "k₀ = 1e6 N/m" in title and "disc speed v = 0.5 m/s" in title and "damping ζ = 10 N s/m" in title, title


def test_a_scene_that_asks_for_a_map_has_ends_along_one_option():
    """`none` takes the second option of a scene's boundary away."""
    summary, _ = run(scene_file("motions") + " -boundary_of sliding -boundary_from 0.5 -boundary_parameter2 none -boundary_from2 none "
                     "-boundary_to2 none", command="boundary")
    assert [round(point["value"], 6) for point in summary["points"]] == [0.966092] and summary["points"][0].get("value2") is None, summary["points"]


def test_a_scene_of_which_nothing_is_known_in_time_has_a_page():
    """A catalogue under a plate that halts, which no command but run takes, and run takes longer."""
    done = tool("report.py", scene_file("published/mori-kawamura-halted"), "-o", "r.png", "--seconds", "1")
    assert done.returncode == 0, done.stderr
    assert "No motion: took longer than 1 s." in done.stdout and "No sliding" in done.stdout, done.stdout


def test_a_wrong_scene_is_one_line():
    done = tool("report.py", "nowhere.yaml")
    assert done.returncode == 1 and done.stderr.splitlines()[-1].startswith("report.py: error: "), done.stderr
    assert not os.path.exists("report.pdf")
