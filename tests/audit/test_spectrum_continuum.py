"""growth_continuum and wavenumber_continuum against the dispersion relation of single waves: the companion matrices of
numpy over many thousand wavenumbers that fit, far beyond every grid's, and the limit of ever shorter waves."""
import json

import numpy as np

import reference
from calls import call, run

from . import sliding


def check(index, p):
    words = reference.words(p)
    done = call(["-summary", "s.json", *words], command="spectrum")
    if done.returncode == 1 and "no steady sliding" in done.stderr:
        return None
    assert done.returncode == 0, f"scene {index}: {words}: {done.stderr}"
    with open("s.json", encoding="utf-8") as file:
        summary = json.load(file)
    text = f"scene {index}: {' '.join(words)}"
    ends = [p.get("bc_" + end, "periodic") for end in ("left", "right")]
    L, held = p["grid_length"], ends.count("velocity")
    unit = 2 * np.pi / L if ends[0] == "periodic" else np.pi / L
    first = {0: 0, 1: 0.5, 2: 1}[held]
    j = first + np.unique(np.concatenate([np.arange(2000), np.geomspace(2000, 1e7, 2000).astype(int)]))
    growth = np.linalg.eigvals(reference.waves(p, (unit * j)**2)).real.max(axis=1)
    found = summary["growth_continuum"]
    assert found >= growth.max() - 1e-9 * (1 + abs(found)), f"{text}: {growth.max()} at k = {unit * j[growth.argmax()]}"
    if summary["wavenumber_continuum"] is None:
        assert abs(growth[-1] - found) < 1e-4 * (1 + abs(found)), f"{text}: ever shorter waves come to {growth[-1]}"
        assert growth.max() < found + 1e-9, text
    else:
        assert abs(summary["wavenumber_continuum"] - unit * first) < 1e-12, text
        assert abs(growth[0] - found) < 1e-9 * (1 + abs(found)), text
    if abs(found) > 1e-9:
        assert summary["stable"] is (found < 0 and summary["growth_rate"] < -summary["growth_rate_error"]), text
    return True


def test_supremum_over_all_waves(scenes):
    done = [check(index, p) for index, p in
            scenes(lambda random: sliding.scene(random, uniform=True, form="continuum"), 32)]
    assert done.count(True) > 0.6 * len(done)


def test_short_waves_that_the_grid_does_not_carry():
    summary, said = run("-grid_n 64 -friction_law cubic -state_law contact-age -state_b .9 -state_D 2 -state_theta0 2.4 "
                        "-model_delta 0 -model_gamma .4 -model_v .995", command="spectrum")
    assert summary["growth_rate"] < 0 < summary["growth_continuum"] and summary["stable"] is False
    assert summary["wavenumber_continuum"] is None and "warning" in said


def test_the_longest_wave_leads_a_degenerate_line():
    for n in (64, 100, 130, 600):
        summary, _ = run(f"-grid_n {n} -model_v 0.9", command="spectrum")
        assert summary["degenerate"] is True
        C = 3 * (0.9**2 - 1) + 0.2  # k = 0: lambda^2 + C lambda + 1
        assert abs(summary["frequency"] - np.sqrt(1 - C**2 / 4)) < 1e-9, f"n = {n}: {summary['frequency']}"
