"""Kepler's problem: superintegrable, so that invariants depend on each other."""

import numpy as np
import pytest

import integrators
import problems
from integrators import LineIntegral

H = 2 * np.pi / 40


@pytest.fixture(scope="module")
def kepler():
    return problems.load("kepler", e=0.6)


def run(problem, names, *, k=16, s=4, h=H):
    solution = integrators.integrate(problem, LineIntegral(k=k, s=s, h=h, invariants=names))
    assert solution.status == "finished", solution.reason
    return solution.errors(), solution.stats.extra


def test_energy_angular_momentum_and_a_lenz_component_over_100_revolutions(kepler):
    errors, extra = run(kepler, ["energy", "angular_momentum", "lenz[1]"])
    assert errors["energy"].max() <= 5e-15  # measured 1.1e-15
    assert errors["angular_momentum"].max() <= 1e-15  # measured 1.8e-16
    assert errors["lenz"].max() <= 5e-15  # measured 7.9e-16
    assert extra["left_out"] == []
    # With two of them the orbit turns: 2.97e-5 of the size of the terms.
    assert run(kepler, ["energy", "angular_momentum"])[0]["lenz"].max() == pytest.approx(3.0e-5, rel=0.1)


def test_an_invariant_that_follows_from_others_is_left_out_and_kept_all_the_same(kepler):
    # |lenz|^2 = 1 + 2 H L^2, and lenz = (0.6, 0) here: its first component depends on the others.
    errors, extra = run(kepler, ["energy", "angular_momentum", "lenz"])
    assert extra["left_out"] == ["lenz[0]"]
    assert max(error.max() for error in errors.values()) <= 5e-15  # measured 1.1e-15
    errors, extra = run(kepler, ["lenz", "angular_momentum", "energy"])
    assert extra["left_out"] == ["energy"]
    assert max(error.max() for error in errors.values()) <= 5e-15  # measured 1.1e-15


def test_which_lenz_component_is_left_out_depends_on_the_orbit():
    original = problems.load("kepler", e=0.6)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    turned = problems.Problem(
        original.system, q0=turn @ original.y0[:2], p0=turn @ original.y0[2:], t_end=30.0
    )
    errors, extra = run(turned, ["energy", "angular_momentum", "lenz"])
    assert extra["left_out"] == ["lenz[1]"]
    assert max(error.max() for error in errors.values()) <= 5e-15  # measured 8.9e-16


@pytest.mark.parametrize("e", [1e-2, 1e-4, 1e-6, 1e-8])
def test_nearly_dependent_invariants_do_no_harm_on_nearly_circular_orbits(e):
    problem = problems.load("kepler", e=e, t_end=60.0)
    exact = problems.catalogue.kepler.solution(problem, [60.0])[0]
    times = np.linspace(0.0, 60.0, 61)
    error = {}
    for names in (("energy",), ("energy", "angular_momentum")):
        method = LineIntegral(k=12, s=4, h=0.2, invariants=names)
        solution = integrators.integrate(problem, method, times)
        assert solution.status == "finished", solution.reason
        error[names] = np.abs(solution.y[-1] - exact).max()
        for name in names:
            assert solution.errors()[name].max() <= 3e-15  # measured 4.3e-16
    assert error["energy", "angular_momentum"] <= 2 * error[("energy",)] + 1e-12


def test_a_circular_orbit_needs_one_of_two():
    errors, extra = run(problems.load("kepler", e=0.0, t_end=60.0), ["energy", "angular_momentum"])
    assert extra["left_out"] == ["angular_momentum"]
    assert errors["angular_momentum"].max() <= 1e-14  # measured 3e-16


def test_backwards_and_in_pieces_the_invariants_are_those_of_the_start(kepler):
    method = LineIntegral(k=16, s=4, h=H, invariants=["energy", "angular_momentum"])
    stepper = method.compile(kepler.system).start(kepler.y0, kepler.par)
    states = [stepper.advance([time]).y[-1] for time in (20.0, 3.3, 17.1, -30.0, 0.7)]
    errors = kepler.errors(np.array(states))
    assert errors["energy"].max() <= 5e-15  # measured 4.6e-16
    assert errors["angular_momentum"].max() <= 1e-15  # measured 9.1e-17
