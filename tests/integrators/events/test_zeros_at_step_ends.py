"""A zero at the end of a step happens once, on whichever side of it rounding puts the sign."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrators import HBVM, Event, Gauss, integrate
from problems import Hamiltonian, Problem, VectorField

FALL = VectorField(lambda y: [-1.0 + 0.0 * y[0]], dim=1)
SWING = Hamiltonian(lambda q, p: (p[0] ** 2 + q[0] ** 2) / 2.0, dof=1)


def times(problem, method, function, direction):
    solution = integrate(problem, method, [problem.t_end], events=[Event(function, direction=direction)])
    assert solution.status.name == "FINISHED", solution.reason
    (found,) = solution.events.values()
    return found.t if hasattr(found, "t") else found


@pytest.mark.parametrize("method", [HBVM(k=8, s=4, h=0.1), Gauss(s=2, h=0.05), Gauss(s=4, h=0.1), HBVM()])
@pytest.mark.parametrize("direction", [0, -1])
def test_a_crossing_at_the_end_of_a_step_happens_once(method, direction):
    for level in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
        found = times(Problem(FALL, y0=[1.0], t_end=1.0), method, lambda y, a=level: y[0] - a, direction)
        assert found.size == 1
        assert abs(found[0] - (1.0 - level)) < 1e-14  # measured: 2e-16


@pytest.mark.parametrize("method", [HBVM(k=8, s=4, h=0.1), Gauss(s=4, h=0.1)])
def test_a_touch_at_the_end_of_a_step_happens_once(method):
    for level in (0.2, 0.3, 0.6, 0.7):
        touch = lambda y, a=level: (y[0] - a) ** 2  # noqa: E731
        found = times(Problem(FALL, y0=[1.0], t_end=1.0), method, touch, 0)
        assert found.size == 1
        assert abs(found[0] - (1.0 - level)) < 1e-6


@settings(max_examples=40, deadline=None)
@given(parts=st.integers(8, 60), s=st.integers(2, 6), extra=st.integers(0, 3), turns=st.integers(1, 6))
def test_each_passage_of_an_oscillator_whose_steps_end_there_happens_once(parts, s, extra, turns):
    h = np.pi / parts
    problem = Problem(SWING, y0=[0.0, 1.0], t_end=(2 * turns + 0.5) * np.pi)
    found = times(problem, HBVM(k=s + extra, s=s, h=h), lambda q: q[0], 0)
    assert found.size == 2 * turns
    up = times(problem, HBVM(k=s + extra, s=s, h=h), lambda q: q[0], 1)
    assert up.size == turns
