"""Poincaré sections are a solution made of passages."""

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Gauss, LineIntegral, section
from integrators.protocol import Status
from problems import InputError


@pytest.fixture(scope="module")
def problem():
    return problems.load("henon_heiles", t_end=1e5)


METHODS = [HBVM(k=6, s=4, h=0.5), LineIntegral(k=8, s=4, tol=1e-9, invariants=["energy"])]


@pytest.mark.parametrize("method", METHODS)
def test_a_section_is_one_line_and_lies_on_the_surface_and_the_energy(problem, method):
    passages = section(problem, method, lambda q: q[0], count=60)
    assert passages.y.shape == (60, 4)
    assert passages.status is Status.EVENT
    assert np.abs(passages.y[:, 0]).max() < 1e-13  # measured 1.4e-14: rounding of times up to 470
    assert (passages.y[:, 2] > 0).all()
    assert passages.errors()["energy"].max() < 1e-14  # measured 7.5e-16
    assert (np.diff(passages.t) > 1.0).all()


def test_a_section_without_a_count_goes_to_the_end(problem):
    up, down, both = (
        section(problem, METHODS[0], lambda q: q[0], direction=d, t_end=100.0) for d in (1, -1, 0)
    )
    assert up.status is Status.FINISHED
    assert up.t_stop == 100.0
    assert np.array_equal(np.sort(np.concatenate([up.t, down.t])), both.t)
    assert up.stats.steps > 100


def test_a_section_at_a_period_of_time_is_a_stroboscope():
    driven = problems.Problem(
        problems.Hamiltonian(lambda q, p, t, m: p[0] ** 2 / 2 - m.cos(q[0]) - q[0] * m.cos(t) / 5, dof=1),
        q0=[0.1],
        p0=[0.0],
        t_end=60.0,
    )
    strobe = section(driven, Gauss(s=6, h=0.25), lambda t, m: m.sin(t / 2), direction=0)
    assert np.allclose(strobe.t, 2 * np.pi * np.arange(1, 10), rtol=0, atol=1e-13)  # measured 0
    sampled = integrators.integrate(driven, Gauss(s=6, h=0.25), strobe.t)
    assert np.abs(sampled.y - strobe.y).max() < 1e-13  # measured 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"count": 0}, "count=0 of section must be a whole number of at least 1"),
        ({"count": 2.5}, "count=2.5 of section must be a whole number of at least 1"),
        ({"t_end": 0.0}, "another time than t0=0.0"),
        ({"direction": 5}, "direction=5"),
    ],
)
def test_bad_options_are_refused(problem, options, message):
    with pytest.raises(InputError, match=message):
        section(problem, METHODS[0], lambda q: q[0], **options)


def test_other_methods_refuse(problem):
    with pytest.raises(InputError, match="cannot find events"):
        section(problem, integrators.Radau(rtol=1e-6, atol=1e-6), lambda q: q[0])
