"""Criticality of the boundary from outside: against the amplitudes of runs on either side, keys, files, pictures."""
import os

import h5py
import numpy as np
import pytest

from calls import check, data, run, scene_file, tool
from files_page import FilesPage, disagreements

BLOCK = "-model_form chain -grid_n 1 -bc_left free "


def last_amplitude(words, t, period):
    """Half of the range of psi over the last two periods of a run to the time t."""
    run(f"{words} -ts_max_time {t} -ts_rtol 1e-8 -ts_atol 1e-10 -out_file a.h5 -out_every {period / 60}")
    found = data("a.h5")
    psi = found["psi"][found["t"] > t - 2.1 * period]
    return np.ptp(psi, axis=0).max() / 2  # of the block that moves most


RATE = "-friction_law rate-and-state -state_law ageing -friction_a 0.05 -model_v 0.1 "
GROWING = {"block": BLOCK + RATE + "-friction_D 0.1 ",
           "profiles": "-model_form chain -grid_n 3 -bc_left free -model_k1 0.3 " + RATE +
                       "-friction_D_profile 0:0.08,1:0.1,2:0.14 -friction_b_profile 0:0.13,1:0.07,2:0.11 "
                       "-friction_amplitude_profile 0:1.2,2:0.8 "}


@pytest.mark.parametrize("which", GROWING)
def test_the_amplitude_that_grows_out_of_sliding(which):
    # ageing law, a fast plate: beside the boundary the motion settles at sqrt(-growth/l), with an error of order a^2
    words = GROWING[which]
    found, _ = run(words + "-boundary_parameter model_k0 -boundary_from 0.1 -boundary_to 20 -boundary_log -boundary_of sliding",
                   command="boundary")
    point = found["points"][0]
    check(point["criticality"] == "supercritical" and point["lyapunov_of"] == ("uniform" if which == "block" else "mode"), point)
    off = []
    for share in (0.94, 0.98):
        here = words + f"-model_k0 {share * point['value']!r} "
        growth = run(here, command="spectrum")[0]["growth_rate"]
        a = np.sqrt(-growth / point["lyapunov_coefficient"])
        reached = last_amplitude(here + f"-init_psi {0.1 + 0.9 * a} -init_eta steady", 4.5 / growth, 2 * np.pi / point["frequency"])
        off.append(reached / a - 1)
    # three times nearer, a third of the error; exp(-2 * 4.5) of the first deviation is left, a tenth of a: below 1e-4
    check(abs(off[0]) < 0.05 and abs(off[1]) < abs(off[0]) / 2.5, f"amplitudes beside the point: {off}")


def test_the_amplitude_beyond_which_sliding_is_lost():
    # Carlson and Langer's law beside the boundary, where sliding is stable: a start within the amplitude
    # sqrt(-growth/l) comes back, one beyond it leaves
    words = BLOCK + "-friction_law carlson-langer -model_zeta 0.2 "
    found, _ = run(words + "-boundary_parameter model_v -boundary_from 0.5 -boundary_to 3", command="boundary")
    point = found["points"][0]
    check(point["criticality"] == "subcritical", point)
    v = 1.01 * point["value"]
    growth = run(words + f"-model_v {v!r}", command="spectrum")[0]["growth_rate"]
    a = np.sqrt(-growth / point["lyapunov_coefficient"])
    period = 2 * np.pi / point["frequency"]
    for share in (0.9, 1.1):
        reached = last_amplitude(words + f"-model_v {v!r} -init_psi {v + share * a!r} -init_eta {0.2 * v + 1 / (1 + v)!r}",
                                 0.5 / -growth, period)
        check((reached > share * a) == (share > 1), f"from {share} of the amplitude to {reached / a} of it")


@pytest.mark.parametrize("law", ("cubic -boundary_parameter model_v", "carlson-langer -model_zeta 0.3 -model_v 0.42 -friction_sigma 0.17 "
                                 "-boundary_parameter friction_alpha", "stribeck -model_v 0.8 -boundary_parameter model_zeta"))
def test_a_block_with_a_profile_of_one_value_is_the_block(law):
    # its matrix at the eigenvalue is zero, and not only singular, wherever the round-off has it
    for k0 in (0.31, 0.65, 1.1, 1.7):
        scene = f"{BLOCK}-friction_law {law} -model_k0 {k0} -boundary_from 0.02 -boundary_to 3 -boundary_of sliding "
        alone, profile = (run(scene + more, command="boundary")[0]["points"] for more in ("", "-friction_amplitude_profile 0:1"))
        assert alone and [p["criticality"] for p in alone] == [p["criticality"] for p in profile], profile
        np.testing.assert_allclose([p["lyapunov_coefficient"] for p in profile], [p["lyapunov_coefficient"] for p in alone], rtol=1e-10)


def test_a_curve_with_a_bautin_point():
    found, _ = run(scene_file("bautin") + " -boundary_points 12 -boundary_of sliding", command="boundary")
    check([p["kind"] for p in found["special"]] == ["bautin"], found["special"])
    v = found["special"][0]["value"]
    check(abs(0.05 * 0.1 / v**2 - 3 - 2 * np.sqrt(5)) < 1e-8, "r = 3 + 2 sqrt(4 + (b - a)/a) there")
    for p in found["points"]:
        check((p["criticality"] == "subcritical") == (p["value"] < v) == (p["lyapunov_coefficient"] > 0), p)
        check(p["lyapunov_of"] == "uniform" and p["criticality_unknown"] is None, p)
    check(not disagreements("bautin.h5", FilesPage()), "docs/files.md, of special/")
    with h5py.File("bautin.h5") as file:
        check(file["special/value"][0] == v and len(file["criticality"]) == len(found["points"]), "the file has the same")
        check(np.all(file["lyapunov_coefficient"][...] == [p["lyapunov_coefficient"] for p in found["points"]]), "and those")
    done = tool("plot.py", "bautin.h5")
    check(done.returncode == 0 and os.path.getsize("bautin.png") > 5000, done.stderr)


def test_short_waves_have_no_criticality():
    found, _ = run("-grid_n 64 -state_law contact-age -state_b .9 -state_D 2 -state_theta0 2.4 -model_delta 0 -model_gamma .4 "
                   "-boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5", command="boundary")
    point = found["points"][0]
    check(point["criticality"] is None and point["lyapunov_coefficient"] is None and
          "short waves" in point["criticality_unknown"], point)
