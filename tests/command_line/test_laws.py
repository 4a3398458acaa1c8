"""The command laws: tables against the formulas written out here, the file against the summary, wrong use refused."""
import os

import numpy as np
import pytest
import xarray

from calls import refused, run, tool


def summary(words=""):
    return run(words, command="laws")[0]


def close(actual, expected):
    np.testing.assert_allclose(np.array(actual, dtype=float), expected, rtol=1e-13, atol=1e-15)


def test_every_law():
    """Every law by default, each with its own parameters."""
    s = summary("-friction_fs 1.5 -friction_fd 0.7 -friction_mu0 0.4 -friction_a 0.01 -friction_b 0.015")
    psi = np.array(s["psi"])
    assert len(psi) == 601 and psi[0] == -3 and psi[-1] == 3 and psi[300] == 0
    close(psi, np.linspace(-3, 3, 601))
    close(s["cubic"], psi**3 / 3 - psi)
    close(s["carlson-langer"], np.sign(psi) / (1 + np.abs(psi)))
    close(s["coulomb"], 0.7 * np.sign(psi))
    a, b, mu0 = 0.01, 0.015, 0.4  # steady: theta = D/|psi|, with psi0 = 1 by default
    v = np.abs(np.delete(psi, 300))
    steady = np.sign(np.delete(psi, 300)) * a * np.arcsinh(v / 2 * np.exp((mu0 - b * np.log(v)) / a))
    close(np.delete(s["rate-and-state"], 300), steady)
    assert s["stick"] == {"carlson-langer": [-1, 1], "coulomb": [-1.5, 1.5], "stribeck": [-1.5, 1.5], "slip-weakening": [-1.5, 1.5]}
    assert s["table"] is None  # nobody gave a curve


def test_one_law_regularised():
    """One law, regularised; a range without 0."""
    s = summary("-friction_law coulomb -friction_stick regularised -friction_eps 0.1 -friction_fs 2 -friction_slip_velocity 0.3 "
                "-laws_from 0.1 -laws_to 1.3 -laws_points 7")
    psi = np.array(s["psi"])
    close(psi, 0.1 + 0.2 * np.arange(7))
    smooth = np.tanh(psi / 0.1)
    close(s["coulomb"], (0.5 + 1.5 * np.exp(-psi * smooth / 0.3)) * smooth)
    assert s["cubic"] is None and s["stick"] == {}


def test_a_state_law():
    """A state law: the contact as strong as it settles to at each velocity."""
    s = summary("-friction_law carlson-langer -state_law healing -state_t_h 0.5 -state_tau_inf 3 -state_D 2 "
                "-friction_back_slip false -laws_points 11")
    psi = np.array(s["psi"])
    tau = (3 / 0.5 + np.abs(psi) / 2) / (1 / 0.5 + np.abs(psi) / 2)
    close(s["carlson-langer"], tau * np.sign(psi) / (1 + np.abs(psi)))
    assert s["stick"] == {"carlson-langer": [None, 3]}  # no force drives it backwards: from -infinity


def test_the_file():
    """The file holds the same."""
    path = "laws.h5"
    s = summary(f"-out_file {path} -laws_points 5")
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        close(data["psi"], s["psi"])
        for law in ("cubic", "carlson-langer", "coulomb", "rate-and-state"):
            assert data[law].dims == ("psi",)
            close(data[law], s[law])
        assert data.attrs["kind"] == "laws"
    with xarray.open_dataset(path, engine="h5netcdf", group="stick") as data:
        names = [str(n) for n in data["name"].values]
        for k, name in enumerate(names):
            np.testing.assert_equal([float(data["low"][k]), float(data["high"][k])],
                                    s["stick"].get(name, [np.nan, np.nan]))

    # drawn, also where a stick range has no lower end
    summary(f"-out_file {path} -friction_law coulomb -friction_back_slip false")
    drawn = tool("plot.py", path, "-o", path + ".png")
    assert drawn.returncode == 0 and not drawn.stderr and os.path.getsize(path + ".png") > 5000, drawn


@pytest.mark.parametrize("words, part", [
    ("-laws_from 4", "laws_from 4"), ("-laws_points 1", "laws_points 1"), ("-friction_law cubic -friction_fs 2", "friction_fs"),
    ("-laws_pionts 5", "-laws_points?"), ("-out_file /", "out_file")])
def test_wrong_use(words, part):
    refused(words, 2, part, command="laws")
