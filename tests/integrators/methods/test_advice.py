"""What is advised does what was promised."""

import numpy as np
import pytest

import integrators
import problems
from integrators import Gauss, advise, integrate
from problems.errors import InputError


def _position_error(problem: problems.Problem, method: integrators.MethodBase) -> float:
    """Of the end, against the exact solution: after whole revolutions Kepler's problem is where it began."""
    y = integrate(problem, method, [problem.t_end]).y[-1]
    return float(np.abs(y[:2] - problem.y0[:2]).max() / (1.0 + problem.arguments["e"]))


def _orbits(e: float, revolutions: int) -> problems.Problem:
    return problems.load("kepler", e=e, t_end=2.0 * np.pi * revolutions)


@pytest.mark.parametrize("accuracy", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("e", [0.1, 0.9])
def test_expected_accuracy_is_met(e: float, accuracy: float) -> None:
    problem = _orbits(e, 200)
    advice = advise(problem, accuracy)
    assert advice.reached
    # measured: 7e-5 (1e-7 at e = 0.9) to 0.13 (1e-10 at e = 0.9) of what was asked for
    assert _position_error(problem, advice.method) <= accuracy


def test_steps_of_one_length_where_they_serve() -> None:
    advice = advise(_orbits(0.1, 200), 1e-8)
    fixed = [one for one in advice.proposals if one.method.options().get("h") is not None]
    assert len(fixed) == 6  # every method that was tried; which is fastest depends on the machine
    assert all(one.position <= 1e-8 for one in advice.proposals)
    assert [one.seconds for one in advice.proposals] == sorted(one.seconds for one in advice.proposals)


def test_own_steps_through_encounters() -> None:
    advice = advise(_orbits(0.97, 20), 1e-8)
    assert [type(one.method).__name__ for one in advice.proposals] == ["HBVM"]
    assert "Own steps vary" in advice.why


def test_chaos_is_told() -> None:
    advice = advise(problems.load("henon_heiles"), 1e-8)
    assert "part exponentially" in advice.why
    assert advice.piece < problems.load("henon_heiles").t_end


def test_out_of_reach_is_told() -> None:
    advice = advise(_orbits(0.5, 200), 1e-15)
    assert not advice.reached
    assert len(advice.proposals) == 1
    assert "out of reach" in advice.why


def test_first_order_systems_have_no_energy() -> None:
    forced = problems.VectorField(lambda t, y, m: [y[1], -y[0] + m.sin(2.0 * t)], dim=2)
    advice = advise(problems.Problem(forced, y0=[1.0, 0.0], t_end=50.0), 1e-9)
    assert advice.reached
    assert advice.proposals[0].energy is None
    assert all(isinstance(one.method, (Gauss, integrators.HBVM)) for one in advice.proposals)


@pytest.mark.parametrize("accuracy", [0.0, 1.0, -1e-8, float("nan"), "small"])
def test_accuracies_that_are_none(accuracy: float) -> None:
    with pytest.raises(InputError, match="relative error between 0 and 1"):
        advise(problems.load("kepler"), accuracy)


def test_how_far_it_looked_is_told() -> None:
    problem = problems.load("pythagorean")  # regular at first; its last encounters part all neighbours
    advice = advise(problem, 1e-6)
    assert advice.until == problem.t0 + advice.piece < problem.t_end
    assert f"up to t={advice.until:g}" in advice.why
    assert f"at t={advice.until:g}" in advice.why or "what comes later is extrapolated" in advice.why


def test_nothing_is_extrapolated_where_everything_was_tried() -> None:
    problem = _orbits(0.1, 1)
    advice = advise(problem, 1e-8)
    assert advice.until == pytest.approx(problem.t_end)
    assert "extrapolated" not in advice.why
