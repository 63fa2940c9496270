"""Poisson systems: what they are made of, and what is refused."""

import numpy as np
import pytest

import integrators
import problems
from problems import Poisson, Problem, targets
from problems.errors import InputError


def energy(y):
    return y[0] ** 2 / 2 + y[1] ** 2 / 4 + y[2] ** 4


def cross(y):
    return [[0, -y[2], y[1]], [y[2], 0, -y[0]], [-y[1], y[0], 0]]


def test_the_field_is_the_structure_times_the_gradient():
    system = Poisson(energy, cross, dim=3)
    y = np.array([0.3, -1.2, 0.7])
    slope = targets.numpy(system, system.slope)(0.0, y, system.pack())
    matrix = targets.numpy(system, system.structure)(0.0, y, system.pack()).reshape(3, 3)
    assert slope == pytest.approx([y[0], y[1] / 2, 4 * y[2] ** 3], rel=1e-15)
    assert (matrix == -matrix.T).all()
    field = targets.numpy(system, "field")(0.0, y, system.pack())
    assert field == pytest.approx(matrix @ slope, rel=1e-14)
    assert (system.kind, system.dof, system.separable) == ("poisson", None, False)
    assert tuple(system.invariants) == ("energy",)
    assert repr(system) == "Poisson(energy, dim=3)"


def test_a_canonical_system_is_a_poisson_system():
    def swing(y, m):
        return y[1] ** 2 / 2 - m.cos(y[0])

    system = Poisson(swing, lambda: [[0, 1], [-1, 0]], dim=2)
    problem = Problem(system, y0=[0.0, 1.9], t_end=10.0)
    found = integrators.integrate(problem, integrators.HBVM(k=16, s=8, h=0.2))
    other = integrators.integrate(problems.load("pendulum", t_end=10.0), integrators.HBVM(k=16, s=8, h=0.2))
    # The one in second-order form, the other not: measured 2e-14.
    assert np.abs(found.y - other.y).max() <= 2e-13


def test_an_energy_with_time_is_no_invariant():
    system = Poisson(lambda t, y: y[0] ** 2 + t * y[1] + y[2], cross, dim=3)
    assert not system.invariants


@pytest.mark.parametrize(
    ("H", "B", "message"),
    [
        (energy, lambda y: [[0, y[0], 0], [y[0], 0, 0], [0, 0, 0]], "not skew-symmetric as it is written"),
        (energy, lambda y: [[y[0], 0, 0], [0, 0, 0], [0, 0, 0]], r"\[0\]\[0\] is not minus \[0\]\[0\]"),
        (energy, lambda y: [[0, 0], [0, 0]], "B must return 3 lists of 3 entries"),
        (energy, lambda y: y[0], "B must return 3 lists of 3 entries"),
        (lambda y, m: m.sum(lambda i: y[i] ** 2, range(3)), cross, "write the sum in Python"),
        (lambda y: [y[0], y[1]], cross, "not one number"),
    ],
)
def test_what_is_not_a_poisson_system_is_refused_with_its_line(H, B, message):
    with pytest.raises(InputError, match=message) as caught:
        Poisson(H, B, dim=3)
    assert "test_poisson.py:" in str(caught.value)


def test_the_energy_is_not_given_twice():
    with pytest.raises(InputError, match="'energy' is H itself"):
        Poisson(energy, cross, dim=3, invariants={"energy": energy})
