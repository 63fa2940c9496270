"""Fields whose values have noise: the run ends and says how much, or does what the tolerance allows."""

import numpy as np
import pytest

from integrators import HBVM, integrate
from integrators.protocol import Status
from problems import Opaque, Problem
from tests.faults.noisy import METHODS, cases, smooth_problem, wrong


def decay(noise):
    """Return y' = -y with noise, from 1 to t = 5."""
    random = np.random.default_rng(0)
    field = Opaque(lambda t, y: [-y[0] + noise * random.normal()], dim=1)
    return Problem(field, y0=[1.0], t_end=5.0)


def single(t, y):
    """Return a pendulum's field in single precision."""
    return np.array([y[1], -np.sin(y[0])], np.float32)


def test_noise_ends_adaptive_steps_with_its_size():
    # Before: no end.
    made = integrate(decay(0.1), HBVM(tol=1e-6, max_steps=2000), [5.0])
    assert made.status == Status.NONLINEAR_DIVERGENCE
    assert "have noise" in made.reason
    assert (made.stats.evaluations or 0) < 20_000


def test_noise_ends_fixed_steps_with_what_helps():
    # Before: "take a smaller h".
    made = integrate(decay(1e-12), HBVM(k=4, s=2, h=0.1), [5.0])
    assert made.status == Status.NONLINEAR_DIVERGENCE
    assert "have noise" in made.reason


def test_single_precision_is_enough_for_a_loose_tolerance():
    made = integrate(
        Problem(Opaque(single, dim=2), y0=[1.0, 0.0], t_end=5.0), HBVM(tol=1e-5, max_steps=300), [5.0]
    )
    assert made.status == Status.FINISHED, made.reason
    # DOP853 at 1e-13: (-0.0239512, 0.9585519)
    assert made.y[-1] == pytest.approx([-0.0239512, 0.9585519], abs=1e-5)


@pytest.mark.parametrize("method", [HBVM(), HBVM(solver="newton")], ids=repr)
def test_single_precision_ends_a_tight_tolerance_with_the_one_that_can_be_had(method):
    # Before: 531,344 steps with HBVM().
    made = integrate(Problem(Opaque(single, dim=2), y0=[1.0, 0.0], t_end=5.0), method, [5.0])
    assert made.status == Status.NONLINEAR_DIVERGENCE, made.reason
    assert "have noise" in made.reason
    assert "or tol=1e-0" in made.reason
    assert (made.stats.evaluations or 0) < 5_000  # measured 578 and 840


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.1, 1e-4, 1e-6, 1e-8, 1e-10])
def test_noise_ends_fixed_steps_by_newton_with_its_size(noise):
    # Before: "take a smaller h".
    made = integrate(decay(noise), HBVM(k=4, s=2, h=0.1, solver="newton"), [5.0])
    assert made.status == Status.NONLINEAR_DIVERGENCE
    assert "have noise" in made.reason


@pytest.mark.slow
def test_a_step_that_is_too_long_for_a_smooth_field_is_not_called_noisy():
    def steep(t, y):
        return -1e6 * (y - np.cos(t))

    made = integrate(
        Problem(Opaque(steep, dim=1), y0=[0.0], t_end=1.0), HBVM(k=4, s=2, h=0.1, solver="fixed_point"), [1.0]
    )
    assert made.status == Status.NONLINEAR_DIVERGENCE
    assert "noise" not in made.reason


def told(first, count):
    """Return what smooth fields and those with jumps are told of noise, by adaptive steps."""
    methods = [method for method in METHODS if method().options().get("h") is None]
    reasons = []
    for seed in range(first, first + count):
        problem = smooth_problem(seed)
        made = integrate(problem, methods[seed % len(methods)](max_steps=1000), [problem.t_end])
        reasons += [(seed, made.reason)] if "noise" in made.reason else []
    return reasons


def search(first, count):
    """Return what is wrong of so many random cases."""
    return [what for what in map(wrong, cases(first, count)) if what is not None]


def test_runs_with_noise_finish_in_few_steps_or_end_with_its_size():
    # Before: 5 of these 20.
    assert search(0, 20) == []


def test_fields_without_noise_are_not_told_of_any():
    assert told(0, 13) == []


@pytest.mark.slow
def test_many_runs_with_noise_finish_in_few_steps_or_end_with_its_size():
    # Before: 28 of the first 200.
    assert search(1000, 500) == []


@pytest.mark.slow
def test_many_fields_without_noise_are_not_told_of_any():
    assert told(1000, 300) == []
