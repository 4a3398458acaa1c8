"""Scenes that gave other results in other units (tests/audit/test_units.py draws many): the same problem, the same numbers times
their units."""
import json

import pytest

import units
from calls import call


BLOCK = {"model_form": "chain", "grid_n": 1, "bc_left": "free", "model_m": 1.2, "model_k0": .3, "model_k1": 0., "model_f0": 1.1,
         "model_zeta": .1}
LUGRE = {"friction_law": "lugre", "friction_sigma0": 20., "friction_vs": .25, "friction_sigma1": .13, "friction_sigma2": .1}


@pytest.mark.parametrize("command, options, tolerance", [
    # nothing holds the block, and no time is 1
    ("run", BLOCK | {"model_k0": 0., "model_v": .4, "friction_law": "tanh", "friction_vs": .6, "init_psi": .16, "init_eta": -.3,
                     "ts_max_time": 17.}, 0),
    # the regime of what moves about 0
    ("run", BLOCK | {"model_v": 0., "friction_law": "stribeck", "friction_fc": .4, "friction_fs": 1., "friction_vs": .6,
                     "init_psi": .3, "init_eta": .2, "ts_max_time": 30.}, 0),
    # Newton's steps by PETSc, under a normal load
    ("run", BLOCK | {"model_v": .1, "friction_law": "rate-and-state", "friction_a": .1, "friction_b": .3, "friction_D": .6,
                     "friction_psi0": 1.1, "state_law": "slip", "init_psi": .2, "init_eta": -.3, "ts_max_time": 10.,
                     "load_normal_sine_amplitude": .4, "load_normal_sine_period": 6.}, 1e-6),
    # a state that is a length, in a section of the orbit and which way it runs round
    ("cycle", BLOCK | LUGRE | {"model_v": .35, "model_m": 1.45, "model_k0": .78, "model_f0": .61, "model_zeta": 0.,
                               "cycle_continue": "model_v", "cycle_to": .19, "cycle_steps": 3}, 1e-9)])
def test_scenes_in_large_and_small_units(command, options, tolerance):
    for place, slip, time, force in ((0, 20, 0, 0), (0, -30, 31, 7), (0, 39, -38, -20)):
        rescaling = units.Rescaling(None, options, factors=(place, slip, time, force))
        code, report, *_ = units.compare(command, options, rescaling, tolerance)
        assert code == 0 and not report, report


def test_a_fault_in_units_of_megametres():
    """A published slider whose velocities are 1e-13 of its unit: the matrix needs balancing, and no rate is near 1."""
    done = call("-model_form chain -grid_n 5 -bc_left free -friction_law rate-and-state -friction_a .05 -friction_b .06 "
                "-friction_D 1e-4 -friction_psi0 1e-12 -model_m 1e21 -model_k0 500 -model_k1 1000 -model_v 1e-13 "
                "-friction_spread .2 -summary s.json", command="spectrum")
    assert done.returncode == 0
    with open("s.json", encoding="utf-8") as file:
        summary = json.load(file)
    assert summary["growth_rate"] == pytest.approx(-1.97787e-11, rel=1e-5) and summary["stable"]
