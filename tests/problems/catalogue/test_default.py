"""HBVM that chooses everything itself keeps the energy of every problem to rounding."""

import numpy as np
import pytest

import integrators
import problems
from problems import registry


@pytest.mark.parametrize("name", registry.built_in())
def test_the_default_keeps_the_energy_at_rounding(name):
    expected = registry.entry(name).expected
    problem = problems.load(name, **({} if expected.until is None else {"t_end": expected.until}))
    found = integrators.integrate(problem, times=np.linspace(problem.t0, problem.t_end, 201))
    assert isinstance(found.method, integrators.HBVM)
    assert found.method == integrators.HBVM()
    assert not found.status.failed, found.reason
    assert found.errors()["energy"].max() <= 4 * expected.default
