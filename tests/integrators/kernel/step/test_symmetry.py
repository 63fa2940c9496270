"""Mirrored bodies stay mirrored to the last bit, by every route through the kernel."""

import numpy as np
import pytest

import problems
from integrators.kernel.plan import Plan
from integrators.kernel.program import HBVMProgram


@pytest.mark.parametrize("form", ["first", "second"])
@pytest.mark.parametrize(("k", "s"), [(2, 2), (8, 5), (12, 8), (16, 16), (18, 2), (24, 20), (40, 6)])
def test_sitnikovs_planetoid_stays_on_its_axis(k, s, form):
    problem = problems.load("sitnikov")
    stepper = HBVMProgram(problem.system, Plan(k=k, s=s, h=0.1, form=form)).start(problem.y0, problem.par)
    samples = stepper.advance(np.linspace(0.0, 60.0, 97))  # partial steps too
    q = samples.y[:, :9].reshape(-1, 3, 3)
    p = samples.y[:, 9:].reshape(-1, 3, 3)
    for x in (q, p):
        assert not x[:, 2, :2].any()  # the planetoid on the axis
        assert np.array_equal(x[:, 0, :2], -x[:, 1, :2])  # the primaries opposite each other
        assert np.array_equal(x[:, 0, 2], x[:, 1, 2])


def test_a_turn_by_a_right_angle_turns_every_state_exactly():
    problem = problems.load("kepler", e=0.7)
    program = HBVMProgram(problem.system, Plan(k=8, s=8, h=0.125))

    def turned(y):
        return np.stack([-y[..., 1], y[..., 0], -y[..., 3], y[..., 2]], axis=-1)

    times = np.arange(0.0, 50.0, 0.4)
    straight = program.start(problem.y0).advance(times).y
    assert np.array_equal(program.start(turned(problem.y0)).advance(times).y, turned(straight))


def test_units_that_are_powers_of_two_change_nothing():
    problem = problems.load("kepler", e=0.5)
    times = np.arange(0.0, 20.0, 0.25)
    straight = HBVMProgram(problem.system, Plan(k=8, s=8, h=0.125)).start(problem.y0).advance(times).y
    # Lengths times 4 and times times 8: velocities times 1/2, and the same force law.
    scale = np.array([4.0, 4.0, 0.5, 0.5])
    scaled = HBVMProgram(problem.system, Plan(k=8, s=8, h=1.0)).start(problem.y0 * scale).advance(8 * times).y
    assert np.array_equal(scaled, straight * scale)
