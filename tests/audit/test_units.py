"""The same scene in other units is the same problem: every result is the same number times its unit.

Units are changed by powers of two up to 2^40 (tests/units.py), so that no number loses a digit and what does the same
operations does them with the same bits. What takes logarithms or roots of numbers that have a unit differs by round-off.
"""
import pytest

import units
from units import explore


@pytest.mark.parametrize("draw, command, salt, short, tolerance", [
    pytest.param(units.draw_spectrum, "spectrum", 902, 6, 1e-9, id="spectrum"),
    pytest.param(units.draw_boundary, "boundary", 903, 3, 1e-9, id="boundary"),
    pytest.param(units.draw_cycle, "cycle", 904, 3, 1e-6, id="cycle"),
    pytest.param(units.draw_wave, "wave", 905, 3, 1e-7, id="wave"),
    pytest.param(units.draw_run, "run", 901, 6, 1e-6, id="run"),
    pytest.param(units.draw_events, "run", 906, 3, 1e-6, id="events"),
    pytest.param(units.draw_sweep, "sweep", 908, 2, 1e-6, id="sweep"),
    pytest.param(units.draw_fit, "fit", 910, 2, 1e-5, id="fit"),
    pytest.param(units.draw_accuracy, "run", 907, 2, 1e-6, id="accuracy"),
    pytest.param(units.draw_chart, "chart", 909, 5, 1e-6, id="chart"),
])
def test_same_in_any_units(scenes, draw, command, salt, short, tolerance):
    explore(scenes, draw, command, salt, short, tolerance)
