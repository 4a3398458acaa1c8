"""The same scene in other units is the same problem: every result is the same number times its unit.

Units are changed by powers of two up to 2^40 (tests/units.py), so that no number loses a digit: what steps find is equal to the
last bit, but for friction that takes a logarithm of a time. What is solved for is as near as it is solved: eigenvalues and
boundaries to round-off, cycles and trains ten times the 1e-10 to which meshes are refined.
"""
import pytest

import units
from units import explore


@pytest.mark.parametrize("draw, command, salt, short, tolerance", [
    pytest.param(units.draw_spectrum, "spectrum", 902, 6, units.ROUND_OFF, id="spectrum"),
    pytest.param(units.draw_boundary, "boundary", 903, 3, units.ROUND_OFF, id="boundary"),
    pytest.param(units.draw_cycle, "cycle", 904, 3, 1e-9, id="cycle"),
    pytest.param(units.draw_wave, "wave", 905, 3, 1e-9, id="wave"),
    pytest.param(units.draw_run, "run", 901, 6, None, id="run"),
    pytest.param(units.draw_events, "run", 906, 3, None, id="events"),
    pytest.param(units.draw_sweep, "sweep", 908, 2, None, id="sweep"),
    pytest.param(units.draw_fit, "fit", 910, 2, None, id="fit"),
    pytest.param(units.draw_accuracy, "run", 907, 2, None, id="accuracy"),
    pytest.param(units.draw_chart, "chart", 909, 5, None, id="chart"),
])
def test_same_in_any_units(scenes, draw, command, salt, short, tolerance):
    explore(scenes, draw, command, salt, short, tolerance)
