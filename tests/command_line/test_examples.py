"""The examples of docs/developers/adding.md, compiled from tests/examples: the page shows the files, every command takes the laws,
the tableau has its order, and the quantity stands in the summary.

Expected values are worked out here from the formulas on the page.
"""
import json
import os
import re
import subprocess
import textwrap

import numpy as np
import pytest

from calls import PROGRAM, SOURCE

EXAMPLES = os.environ.get("STICKSLIP_EXAMPLES",
                          os.path.join(os.path.dirname(PROGRAM), "tests", "stickslip_examples"))
BLOCK = "-model_form chain -grid_n 1 -bc_left free -model_k0 0.5 -model_zeta 0.05"


def summary(command, arguments, code=0):
    done = subprocess.run([EXAMPLES, command, "-progress", "off", *arguments.split(), "-summary", "-"],
                          capture_output=True, text=True, timeout=600)
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(autouse=True, scope="module")
def built():
    if not os.path.exists(EXAMPLES):
        pytest.skip("stickslip_examples is not built")


@pytest.mark.parametrize("name", ["hump.hpp", "lorentz.hpp", "bonding.hpp", "added_tableaus.cpp", "fastest.hpp"])
def test_the_page_shows_the_file(name):
    with open(os.path.join(SOURCE, "docs", "developers", "adding.md"), encoding="utf-8") as page:
        text = page.read()
    with open(os.path.join(SOURCE, "tests", "examples", name), encoding="utf-8") as file:
        assert f"```cpp\n{file.read()}```\n" in text


def test_the_page_shows_the_lines_of_the_source():
    """Those of the drag, of the special point and of methods are the source's own, but for how far they stand to the right."""
    with open(os.path.join(SOURCE, "docs", "developers", "adding.md"), encoding="utf-8") as page:
        text = page.read()
    for name, begin, end in (("include/stickslip/model/node_terms.hpp", "struct NodeTerms {", "\n};"),
                             ("src/options/option_table.cpp", 't.not_negative("model_drag"', ";"),
                             ("tests/examples/own/program.cpp", "  stickslip::register_method(", "TSCreate_Heun);"),
                             ("tests/examples/own/program.cpp", "  stickslip::register_tableau(", "});"),
                             ("tests/test_cycle.cpp", "  const CycleWatch watch = [](double,", '"amplitude-2");')):
        with open(os.path.join(SOURCE, name), encoding="utf-8") as file:
            source = file.read()
        lines = source[source.index(begin):]
        lines = lines[:lines.index(end) + len(end)]
        assert name in text and textwrap.dedent(lines) in text, name


def test_where_a_term_stands():
    """Files and names of the page's table exist."""
    with open(os.path.join(SOURCE, "docs", "developers", "adding.md"), encoding="utf-8") as page:
        rows = re.findall(r"^\| [^|`]+ \| (`.*`.*) \|$", page.read(), re.MULTILINE)
    assert len(rows) >= 6
    for row in rows:
        names = re.findall(r"`([^`]+)`", row)
        files = [name for name in names if "/" in name]
        texts = []
        for name in files:
            with open(os.path.join(SOURCE, "" if name.startswith("src") else "include", name), encoding="utf-8") as file:
                texts.append(file.read())
        for name in set(names) - set(files):
            assert any(re.search(rf"\b{name}\b", text) for text in texts), f"{name} is not in {files}"


def test_the_options_are_declared():
    said = subprocess.run([EXAMPLES, "laws", "-help"], capture_output=True, text=True).stdout
    assert "friction_top" in said and "hump: velocity of largest friction" in said and "lorentz" in said
    assert "bonding: time in which bonds form" in said
    for words, part in (("-friction_top -1", "friction_top"), ("-friction_law lorentz -friction_top 2", "another law"),
                        ("-state_law bonding -friction_law hump -state_b 2 -friction_eps .1", "no threshold")):
        done = subprocess.run([EXAMPLES, "laws", *words.split()], capture_output=True, text=True)
        assert done.returncode == 2 and part in done.stderr, done.stderr


def test_laws():
    s = summary("laws", "-laws_from -2 -laws_to 2 -laws_points 9 -friction_top 0.7")
    psi = np.array(s["psi"])
    np.testing.assert_allclose(s["hump"], 2 * (psi / 0.7) / (1 + (psi / 0.7)**2), rtol=1e-14)
    np.testing.assert_allclose(s["lorentz"], np.sign(psi) / (1 + psi**2), rtol=1e-14)
    assert s["stick"] == {"lorentz": [-1, 1]}
    s = summary("laws", "-laws_points 9 -friction_law lorentz -state_law bonding -state_b 0.4 -state_t_h 3 "
                        "-state_D 0.5")
    psi = np.array(s["psi"])
    bonds = 1 / (1 + 3 * np.abs(psi) / 0.5)
    np.testing.assert_allclose(s["lorentz"], (1 + 0.4 * bonds) * np.sign(psi) / (1 + psi**2), rtol=1e-13)
    np.testing.assert_allclose(s["stick"]["lorentz"], [-1.4, 1.4], rtol=1e-14)


def test_spectrum():
    # one block, m = 1: lambda^2 + (zeta + phi') lambda + k0 = 0
    v, zeta, k0 = 1.6, 0.05, 0.5
    for law, slope in (("hump", 2 * (1 - v * v) / (1 + v * v)**2), ("lorentz", -2 * v / (1 + v * v)**2)):
        s = summary("spectrum", f"{BLOCK} -friction_law {law} -model_v {v}")
        roots = np.roots([1, zeta + slope, k0])
        assert s["growth_rate"] == pytest.approx(max(roots.real), rel=1e-9)
        assert s["frequency"] == pytest.approx(max(abs(roots.imag)), rel=1e-9)
    # with bonds: psi, eta, s as a matrix
    s = summary("spectrum", f"{BLOCK} -friction_law lorentz -state_law bonding -model_v {v}")
    b, phi, dphi, bonds = 0.5, 1 / (1 + v * v), -2 * v / (1 + v * v)**2, 1 / (1 + v)
    matrix = [[-zeta - (1 + b * bonds) * dphi, 1, -b * phi], [-k0, 0, 0], [-bonds, 0, -1 - v]]
    assert s["growth_rate"] == pytest.approx(max(np.linalg.eigvals(matrix).real), rel=1e-9)


def test_boundary():
    # 2 v/(1 + v^2)^2 = zeta beyond the steepest fall
    s = summary("boundary", f"{BLOCK} -friction_law lorentz -boundary_parameter model_v -boundary_from 1 "
                            "-boundary_to 8")
    v = s["points"][0]["value"]
    assert 2 * v / (1 + v * v)**2 == pytest.approx(0.05, rel=1e-7)


def test_run():
    # exact stick, and the same smoothed: the amplitude of stick-slip agrees to the width of the smoothing
    scene = f"{BLOCK} -friction_law lorentz -model_v 0.1 -init_psi 0 -init_eta 0 -ts_max_time 60"
    exact = summary("run", scene)
    smooth = summary("run", scene + " -friction_stick regularised -friction_eps 1e-4")
    assert exact["psi_max"] == pytest.approx(smooth["psi_max"], rel=1e-2, abs=1e-2)
    # bonds that form at rest hold longer: loaded at the rate k0 v, the first slip comes at the force 1 + b s(t)
    times = np.arange(0, 40, 0.001)
    for words, threshold in (("", 0 * times + 1), ("-state_law bonding -init_state 0", 1.5 - 0.5 * np.exp(-times))):
        start = times[np.argmax(0.5 * 0.1 * times >= threshold)]
        before, after = (summary("run", f"{BLOCK} -friction_law lorentz {words} -model_v 0.1 -init_psi 0 -init_eta 0 "
                                        f"-ts_max_time {start + d}")["psi_max"] for d in (-0.01, 0.5))
        assert before == 0 and after > 0
    # at rest in the middle of the rising branch nothing moves but the approach to sliding
    hump = summary("run", f"{BLOCK} -friction_law hump -model_v 0.3 -init_psi 0.2 -ts_max_time 400")
    assert hump["psi_mean"] == pytest.approx(0.3, rel=1e-4)


def test_wave_and_chart():
    line = "-friction_law hump -model_v 1.7 -model_gamma 3 -model_delta 0.05"
    wave = summary("wave", line + " -wave_speed 2")
    assert wave["residual"] < 1e-6 and wave["psi_max"] > 1.7 > wave["psi_min"]
    chart = summary("chart", line + " -grid_n 32 -ts_max_time 1 -chart_methods rk:5dp -chart_tolerances 1e-4,1e-6 "
                                    "-chart_orders 4 -chart_grids 32")
    assert all(row["failed"] is None for row in chart["rows"])


def test_tableau():
    scene = "-grid_n 32 -grid_length 20 -init_type sine -ts_max_time 1 -out_probes 3.75 -ts_type rk -ts_rk_type zonneveld"
    exact = summary("run", scene.replace("zonneveld", "8vr") + " -ts_rtol 1e-12 -ts_atol 1e-12")["probes"][0]["psi"]
    errors = []
    for steps in (20, 40):
        made = summary("run", f"{scene} -ts_adapt_type none -ts_dt {1 / steps}")
        assert made["method"] == "rk:zonneveld" and made["steps"] == steps
        errors.append(abs(made["probes"][0]["psi"] - exact))
    assert 3.6 < np.log2(errors[0] / errors[1]) < 4.6, errors
    adaptive = summary("run", scene + " -ts_rtol 1e-7 -ts_atol 1e-7")
    assert abs(adaptive["probes"][0]["psi"] - exact) < 1e-5 and adaptive["steps"] > 5
    assert summary("run", scene + " -accuracy 1e-4 -grid_n auto")["method"] == "rk:zonneveld"
    chart = summary("chart", "-grid_n 32 -ts_max_time 0.2 -chart_methods rk:zonneveld -chart_tolerances 1e-4 "
                             "-chart_orders 4 -chart_grids 32 -chart_repeats 1 -chart_reference_seconds 2")
    assert chart["rows"][0]["method"] == "rk:zonneveld"


def test_quantity(tmp_path):
    scene = (f"-model_form chain -grid_n 6 -init_noise 0.3 -ts_max_time 20 -out_file {tmp_path}/a.h5 "
             "-out_checkpoint_every 40 -out_checkpoint_keep 9")
    whole = summary("run", scene)
    fastest = whole["fastest"]
    assert fastest["psi"] >= max(abs(whole["psi_max"]), abs(whole["psi_min"])) and 0 <= fastest["t"] <= 20
    first = sorted(tmp_path.glob("a.chk-*.h5"))[0]
    assert summary("run", f"-restart {first} -out_file {tmp_path}/b.h5")["fastest"] == fastest
    two = subprocess.run(["mpirun", "-n", "2", EXAMPLES, "run", *scene.split(), "-progress", "off", "-summary", "-"],
                         capture_output=True, text=True, check=True, timeout=600)
    assert json.loads(two.stdout)["fastest"]["psi"] == pytest.approx(fastest["psi"], rel=1e-12)
