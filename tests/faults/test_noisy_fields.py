"""Fields whose values have noise: the run ends and says how much, or does what the tolerance allows."""

import numpy as np
import pytest

from integrators import HBVM, integrate
from integrators.protocol import Status
from problems import Opaque, Problem


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
