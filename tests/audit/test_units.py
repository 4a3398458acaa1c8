"""The same scene in other units is the same problem: every result is the same number times its unit.

Units are changed by powers of two up to 2^40 (tests/units.py), so that no number loses a digit and what does the same
operations does them with the same bits. What takes logarithms or roots of numbers that have a unit differs by round-off.
"""
import units
from units import explore


def test_spectrum(scenes):
    explore(scenes, units.draw_spectrum, "spectrum", 902, 6, 1e-9)


def test_boundary(scenes):
    explore(scenes, units.draw_boundary, "boundary", 903, 3, 1e-9)


def test_cycle(scenes):
    explore(scenes, units.draw_cycle, "cycle", 904, 3, 1e-6)


def test_wave(scenes):
    explore(scenes, units.draw_wave, "wave", 905, 3, 1e-7)


def test_run(scenes):
    explore(scenes, units.draw_run, "run", 901, 6, 1e-6)


def test_events(scenes):
    explore(scenes, units.draw_events, "run", 906, 3, 1e-6)


def test_sweep(scenes):
    explore(scenes, units.draw_sweep, "sweep", 908, 2, 1e-6)


def test_fit(scenes):
    explore(scenes, units.draw_fit, "fit", 910, 2, 1e-5)


def test_accuracy(scenes):
    explore(scenes, units.draw_accuracy, "run", 907, 2, 1e-6)


def test_chart(scenes):
    explore(scenes, units.draw_chart, "chart", 909, 5, 1e-6)
