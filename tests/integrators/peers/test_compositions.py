"""pyhamsys' compositions: orders, the order of drift and kick, and their library alone."""

from typing import get_args

import numpy as np
import pytest

import problems
from integrators import HBVM, Composition, integrate
from integrators.peers.pyhamsys import Type

PROBLEM = problems.load("henon_heiles", energy=0.125, q2=0.1, t_end=8.0)


def driven(q, p, t, m):
    return p[0] ** 2 / 2 - m.cos(q[0]) - 0.3 * q[0] * m.sin(2 * t)


DRIVEN = problems.Problem(problems.Hamiltonian(driven, dof=1), q0=[0.2], p0=[1.0], t_end=8.0)


OFTEN = {"Verlet", "Yo4", "BM4", "ABA864", "RKN6a"}  # each kind compiles for 2 s; all of them are slow tests


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[] if kind in OFTEN else pytest.mark.slow) for kind in get_args(Type)],
)
def test_errors_fall_with_the_order_of_the_type(kind):
    # Measured 1.97 to 2.12, 3.97 to 4.07, 5.94 to 6.27, Yo8 8.8. RKN6a has order 4 if it begins with a kick.
    truth = integrate(PROBLEM, HBVM(), [8.0]).y[-1]
    long, short = (np.abs(integrate(PROBLEM, Composition(h=h, type=kind), [8.0]).y[-1] - truth).max()
                   for h in (0.4, 0.2))  # fmt: skip
    order = Composition(h=0.1, type=kind).order
    assert np.log2(long / short) == pytest.approx(order, abs=0.9 if kind == "Yo8" else 0.35)


@pytest.mark.parametrize(("kind", "order"), [("BM6", 6), ("RKN6a", 6), ("RKN6b", 6), ("ABA864", 4)])
def test_kicks_are_at_the_times_of_the_drifts(kind, order):
    truth = integrate(DRIVEN, HBVM(), [8.0]).y[-1]
    errors = [
        np.abs(integrate(DRIVEN, Composition(h=h, type=kind), [8.0]).y[-1] - truth).max() for h in (0.4, 0.2)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.5)


def test_a_hamiltonian_that_is_not_separable_is_refused():
    assert "separable" in Composition(h=0.1).accepts(problems.load("double_pendulum"))
