"""What follows an action has the parameters it has made: reductions, guards, files, earlier checkpoints."""

from typing import Any

import numpy as np
import pytest

import integrators
from integrators import HBVM, Event
from integrators.reduce import Maximum, Mean
from problems import Hamiltonian, Problem

integrate: Any = integrators.integrate
integrate_many: Any = integrators.integrate_many
SPRING = Hamiltonian(
    lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 2 / 2,
    dof=1, parameters={"k": 1.0}, guards={"stiffness": lambda par: par.k - 1.0}, name="spring",
)  # fmt: skip
GRID = np.linspace(0.0, 9.0, 31)


def spring() -> Problem:
    return Problem(SPRING, y0=[1.0, 0.0], t_end=9.0)


def doubled(name: str = "passing") -> Event:
    return Event(lambda q: q[0], then=lambda q, p, par: ([q[0], p[0]], {"k": 2.0 * par.k}), name=name)


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_reductions_have_the_parameters_of_each_time(own: bool, sign: float) -> None:
    stiffness, times = [1.0, 1.5, 2.0], sign * GRID[1:]
    if own:
        times = np.stack([times, 0.9 * times, np.where(np.arange(30) < 20, times, np.nan)])
    given = {"parameters": {"k": stiffness}, "times": times, "events": doubled(), "threads": 2}
    plain = integrate_many(spring(), HBVM(), **given)
    most = Maximum(lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 2 / 2, over="times")
    mean = Mean(lambda par: par.k, over="times")
    found = integrate_many(spring(), HBVM(), reduce={"most": most, "mean": mean}, **given)
    for i, k in enumerate(stiffness):
        alone = plain[i]
        passed = (sign * alone.events["passing"].t < sign * alone.t[:, np.newaxis]).sum(axis=1)
        assert passed[-1] > 2
        assert found.reduced["mean"][i] == pytest.approx(np.mean(k * 2.0**passed), rel=1e-14)  # measured 0
        energy = alone.invariants()["energy"].max()
        assert found.reduced["most"][i] == pytest.approx(energy, rel=1e-14)  # measured 2e-16


def test_guards_have_the_parameters_of_each_time() -> None:
    found = integrate(spring(), HBVM(), GRID, events=doubled())
    passed = (found.events["passing"].t < found.t[:, np.newaxis]).sum(axis=1)
    assert np.array_equal(found.guards()["stiffness"], 2.0**passed - 1.0)
    assert passed[-1] > 2
