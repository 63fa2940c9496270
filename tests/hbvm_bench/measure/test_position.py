"""The position error: one definition for campaigns, race and automatic."""

import numpy as np
import pytest

import problems
from hbvm_bench.measure import measured
from hbvm_bench.measure.measured import POSITION, position_error
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.report import words


def off(problem, away):
    """Return a reference at two times, and states of which the second is off in its first number."""
    true = np.stack([problem.y0, 2.0 * problem.y0])
    reference = Reference(np.array([0.0, 1.0]), true, np.zeros_like(true), {})
    y = true.copy()
    y[1, 0] += away
    return reference, y


@pytest.mark.parametrize("key", ["outer_solar_system", "henon_heiles", "kepler"])
def test_the_error_is_relative_to_the_largest_distance(key):
    problem = problems.load(key)
    reference, y = off(problem, 1e-5)
    t = reference.t
    _, error, _ = measured._position_error(problem, t, y, reference)
    size = measured.largest_distance(problem, measured.positions(problem, reference.high)).max()
    assert error[0] == pytest.approx(1e-5 / size, rel=1e-9)  # 4e-7 of 24 AU, 1e-5 of 0.7 and of 0.8


def test_the_error_does_not_depend_on_where_the_trajectory_is_when_it_is_looked_at():
    """Relative to the position of that moment an oscillator's error would be endless at its centre."""
    problem = problems.load("kepler")
    true = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    assert position_error(problem, np.full((1, 4), 1e-9), true)[0] == pytest.approx(np.sqrt(2.0) * 1e-9)


def test_the_unit_of_length_does_not_matter():
    problem = problems.load("outer_solar_system")
    reference, y = off(problem, 1e-5)
    near = position_error(problem, y - reference.high, reference.high)
    far = position_error(problem, 1e6 * (y - reference.high), 1e6 * reference.high)
    assert near[1] == pytest.approx(far[1], rel=1e-12)


def test_every_page_says_what_it_is_relative_to():
    assert POSITION in METRICS["position_end"].description
    assert METRICS["position_end"].unit == METRICS["position_max"].unit == "relative"
    assert sum(POSITION in rule for rule in words.RULES) == 1
