"""A few scenes in other units (tests/audit/test_units.py has many): the same problem, the same numbers times their units."""
import json

import pytest

import units
from calls import call
from units import explore


@pytest.mark.parametrize("command, draw, salt, count, tolerance", [
    ("spectrum", units.draw_spectrum, 922, 6, 1e-9), ("boundary", units.draw_boundary, 923, 3, 1e-9),
    ("cycle", units.draw_cycle, 926, 2, 1e-6), ("wave", units.draw_wave, 925, 3, 1e-7)])
def test_other_units(scenes, command, draw, salt, count, tolerance):
    explore(scenes, draw, command, salt, count, tolerance)


def test_a_fault_in_units_of_megametres():
    """A published slider whose velocities are 1e-13 of its unit: the matrix needs balancing, and no rate is near 1."""
    done = call("-model_form chain -grid_n 5 -bc_left free -friction_law rate-and-state -friction_a .05 -friction_b .06 "
                "-friction_D 1e-4 -friction_psi0 1e-12 -model_m 1e21 -model_k0 500 -model_k1 1000 -model_v 1e-13 "
                "-friction_spread .2 -summary s.json", command="spectrum")
    assert done.returncode == 0
    with open("s.json", encoding="utf-8") as file:
        summary = json.load(file)
    assert summary["growth_rate"] == pytest.approx(-1.97787e-11, rel=1e-5) and summary["stable"]
