"""Times that steps end at: what a step costs does not depend on how many there are."""

import time

import numpy as np
import pytest

import problems
from integrators import HBVM

OSCILLATOR = problems.Problem(problems.VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[1.0, 0.0], t_end=1e9)
STEPS = 100


def seconds(points, sample):
    """Return the CPU time of some pieces between breakpoints, with others ahead; the lesser of two."""
    program = HBVM(tol=1e-6, breakpoints=np.arange(1.0, 1.0 + points).tolist()).compile(OSCILLATOR.system)
    times = []
    for _ in range(2):
        stepper = program.start(OSCILLATOR.y0)
        stepper.advance(np.array([1.5]), sample=sample)
        began = time.process_time()
        stepper.advance(np.arange(2.0, STEPS + 0.5, 0.5), sample=sample)
        times.append(time.process_time() - began)
    return min(times)


@pytest.mark.parametrize("sample", ["partial", "stop", "dense", "steps"])
def test_a_step_takes_no_longer_with_many_breakpoints_ahead(sample):
    few, many = seconds(STEPS + 10, sample), seconds(40_000, sample)
    # Measured: 0.9 to 1.6 times as long; 6 to 9 with half as many points where all are looked through
    assert many < 4.0 * few


@pytest.mark.parametrize(("t0", "t_end"), [(-2.0, 2.0), (2.0, -2.0), (-2.0625, 1.9375), (1.9375, -2.0625)])
def test_steps_end_at_each_breakpoint_both_ways(t0, t_end):
    points = np.arange(-3.0, 3.5, 0.125).tolist()
    stepper = HBVM(tol=1e-3, breakpoints=points).compile(OSCILLATOR.system).start(OSCILLATOR.y0, t0=t0)
    samples = stepper.advance(np.array([t0, t_end]), sample="steps")
    passed = {point for point in points if min(t0, t_end) < point < max(t0, t_end)}
    assert passed <= set(samples.t.tolist())
