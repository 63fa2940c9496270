"""A rule that is written once gives the same bits for one trajectory and in lanes."""

import ctypes

import numpy as np
import pytest

from integrators.kernel.native import binary, stages
from integrators.kernel.native.memory import aligned
from integrators.kernel.simd.operations import opposite, where
from integrators.kernel.step.control import as_errors_allow, as_iterations_allow, bounded, log_of_order
from integrators.kernel.step.estimate import is_gap, judged, local_error, size_in_step
from integrators.kernel.step.finish import added, moved_by
from integrators.kernel.step.rounding import is_visible
from integrators.kernel.step.size import inverse_sizes, speed_of
from integrators.kernel.step.stopping import further, judge, residual_at_end, stagnates, untested
from integrators.kernel.step.sums import multiplied, time_after

LANES, ROWS = 8, 8


def stopping(t, y, par, out):
    best, stalled, rate, converged, rest = judge(y[0], y[1], y[2], y[3], -y[4], y[5], y[6], 0.0)
    over = converged | stagnates(y[7], stalled, 1e-13)
    out[0], out[1], out[2] = best, stalled, rate
    out[3] = where(over, further(residual_at_end(converged, rest, best), rate, -61.0), -1.0)


def sizes(t, y, par, out):
    out[0], out[1] = inverse_sizes(y[0], y[1], 1e-6, y[2], y[3])
    out[2] = size_in_step(y[4], y[5])
    out[3] = where(opposite(is_visible(y[5], y[6], y[7])), local_error(y[5], y[6], y[7], y[4]), 0.0)


def control(t, y, par, out):
    error, quadrature_error = log_of_order(y[0], 0.05), log_of_order(y[1], 0.04)
    factor, in_doubt = as_errors_allow(
        error,
        -y[2],
        -y[3],
        quadrature_error,
        -y[4],
        -y[5],
        y[6] < 1.0,
        y[7] - 1.0,
        y[0] < 1.0,
        y[1] < 1.0,
        0.1,
    )
    out[0] = where(in_doubt, factor, -factor)
    out[1] = bounded(factor, 2.0)
    out[2] = as_iterations_allow(factor, y[2], y[3], y[4], y[5])
    out[3] = error


def ends(t, y, par, out):
    out[0], out[1] = added(y[0], y[1], y[2], y[3], y[4])
    out[2], out[3] = moved_by(y[0], y[1], y[5], y[6], y[2], y[7], y[3], y[4])


def coefficients(t, y, par, out):
    low, high, slope, error, quadrature_error = judged(
        y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], 0.3, 0.1
    )
    out[0], out[1] = low + high, slope
    out[2] = where(is_gap(y[0], y[1], y[2]), error, -1.0)
    out[3] = quadrature_error


def times(t, y, par, out):
    later, lacks = time_after(y[0], y[1], y[2])
    out[0] = later + multiplied(y[4], y[5], y[6])[1]
    out[1] = lacks
    out[2] = untested(y[3], -y[4], -50.0)
    out[3] = speed_of(-y[7])


def results(code, inputs):
    call = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 4)(binary.load(code))
    out = []
    for block in inputs:
        y, found = aligned(ROWS * LANES), aligned(4 * LANES)
        y[:] = block.reshape(-1)
        call(0, y.ctypes.data, 0, found.ctypes.data)
        out.append(found)
    return np.array(out)


@pytest.mark.parametrize("rule", [stopping, sizes, control, ends, coefficients, times])
def test_a_rule_gives_the_same_bits_for_a_number_and_for_a_row(rule):
    random = np.random.default_rng(1)
    inputs = 10.0 ** random.uniform(-20, 2, size=(500, ROWS, LANES))
    chosen = random.uniform(size=inputs.shape)
    inputs[chosen < 0.1] = random.choice([0.0, 1.0, 3.0, np.inf, np.nan], size=(chosen < 0.1).sum())
    alone = results(stages.build_one_by_one(rule, LANES), inputs)
    in_lanes = results(stages.build_on_lanes(rule, LANES), inputs)
    assert np.array_equal(alone, in_lanes, equal_nan=True)
    assert np.isfinite(alone).mean() > 0.5
    assert np.unique(alone).size > 1000
