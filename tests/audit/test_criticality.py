"""Criticality of Hopf points in random scenes, against oscillations of small amplitudes solved for by harmonic balance
(periodic.py): growth rate of sliding = -l a^2 there."""
import numpy as np
import pytest

import reference
from calls import call, check, data, run

from . import periodic, sliding


def scene(random):
    """Few nodes, since the balance is dense; of a medium that differs, so that one mode crosses at a time, or alike."""
    p = sliding.scene(random, uniform=random.random() < 0.3, least=3, most=7)
    if p["model_form"] == "continuum":
        p |= {"grid_order": 2, "grid_length": random.uniform(2, 10)}
    p.pop("model_v")
    if "friction_spread" not in p and random.random() < 0.3:
        p["model_nu"] = random.uniform(0.01, 0.2)
    return p


def scene_with_profiles(random):
    p = sliding.scene(random, uniform=True, form="chain", least=3, most=6)
    p = {name: value for name, value in p.items() if name != "model_v" and not name.startswith("bc_")}
    return sliding.with_profiles(random, p | ({"bc_left": "free", "bc_right": "free"} if random.random() < 0.7 else {}))


def amplitudes(p, value):
    if "friction_amplitude" in p:
        return p["friction_amplitude"]
    if "friction_spread" not in p:
        return None
    done = call(reference.words(p | {"model_v": value}) + ["-spectrum_refine", "off", "-out_file", "s.h5"], command="spectrum")
    check(done.returncode == 0, done.stderr)
    file = data("s.h5")
    return reference.amplitudes(p | {"model_v": value}, file["steady_psi"], file["steady_eta"])


def coefficients(point, n):
    """Those of a point, each with the shape of its oscillation where it is one of several."""
    l, wave, crest = (point["lyapunov_" + name] for name in ("coefficient", "travelling", "standing"))
    check(point["criticality"] == ("subcritical" if l > 0 else "supercritical"), "the word that goes with the sign")
    if wave is None:
        return [(l, None)]
    check(l == (crest if 2 * crest > wave else wave), "that of the wave whose sum of squares grows most")
    phase = 2 * np.pi * np.round(point["wavenumber"] * n / (2 * np.pi)) / n * np.arange(n)  # a chain
    return [(wave, np.exp(1j * phase)), (crest, np.cos(phase) + 0j)]


def compare(p, point, what):
    """The coefficients of a point against oscillations; what the comparison allows, relative."""
    compared = []
    for l, shape in coefficients(point, p["grid_n"]):
        measured = periodic.Oscillations(p, "model_v", amplitudes(p, point["value"]), shape)
        rate, _ = measured.mode(point["value"])
        check(abs(rate - 1j * point["frequency"]) < 1e-9 * abs(rate), f"{what}: the mode, {rate}")
        by_balance, allowed = measured.lyapunov(point["value"], 0.02 * point["value"])
        check(abs(by_balance - l) <= allowed,
              f"{what}: {point['lyapunov_of']} {l}, by oscillations {by_balance} +- {allowed}: {p}")
        compared.append(allowed / abs(l))
    return compared


@pytest.mark.parametrize("draw", (scene, scene_with_profiles))
def test_coefficients_are_those_of_small_oscillations(scenes, draw):
    compared = []
    for index, p in scenes(draw, 61):
        words = reference.words(p) + ["-spectrum_refine", "off", "-boundary_of", "sliding", "-boundary_parameter", "model_v", "-boundary_from", "0.15",
                                    "-boundary_to", "2"]
        summary, _ = run(words, code=None, command="boundary")
        for point in summary["points"] or []:  # null where no boundary is in that range
            if point["lyapunov_coefficient"] is None or point["degenerate"]:
                continue
            compared += compare(p, point, f"scene {index}")
    check(len(compared) > 4 and np.median(compared) < 1e-5, f"{len(compared)} compared, to {np.median(compared)}")


def test_waves_of_finite_length_that_viscosity_chooses():
    # friction that falls with velocity at once and rises in the long run: neither the longest nor the shortest wave leads
    common = {"grid_n": 7, "friction_law": "cubic", "state_law": "contact-age", "state_b": 2, "state_theta0": 0.2, "state_D": 0.2}
    chain = {"model_form": "chain", "model_m": 0.25, "model_k0": 0.25, "model_k1": 0.8, "model_zeta": 0.025, "model_nu": 0.1}
    medium = {"model_form": "continuum", "model_gamma": 4, "model_c": 1, "model_delta": 0.1, "grid_length": 4, "grid_order": 2,
              "model_nu": 0.1}
    free = {"bc_left": "free", "bc_right": "free"}
    for p in (common | chain, common | medium | free):
        h = p.get("grid_length", 0) / (p["grid_n"] - (p.get("bc_left") == "free")) or 1
        words = reference.words(p) + ["-spectrum_refine", "off", "-boundary_of", "sliding", "-boundary_parameter", "model_v",
                                    "-boundary_from", "0.3", "-boundary_to", "1.5"]
        (point,) = run(words, command="boundary")[0]["points"]
        check(0.1 < point["wavenumber"] * h < 0.8 * np.pi and not point["degenerate"], f"which wave leads: {point}")
        allowed = compare(p, point | {"wavenumber": point["wavenumber"] * h}, f"{p['model_form']}")
        check(max(allowed) < 1e-3, f"the comparison says something: {allowed}")
