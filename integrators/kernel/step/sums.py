"""Sums of two doubles in a step, for one trajectory and for lanes: times, and what stages share."""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.operations import fma, two_sum


@compiled
def time_of_step(t0, time_low, n, h):
    """Return the time after n steps of length h, t0 + time_low + n h, and what it lacks."""
    elapsed = n * h
    t, low = two_sum(t0, elapsed)
    return t, low + fma(n, h, -elapsed) + time_low


@compiled
def time_after(t0, time_low, h):
    """Return the time after a step of length h, t0 + time_low + h, and what it lacks."""
    t, low = two_sum(t0, h)
    return two_sum(t, low + time_low)


@compiled
def multiplied(factor, x, low):
    """Return a factor times x + low, as a number and its low part.

    With the factor kh and a momentum: the drift, by which a position moves in a step without a force.
    """
    product = factor * x
    return product, fma(factor, low, fma(factor, x, -product))


@compiled
def part_of_drift(c, c_low, moved, moved_low, error):
    """Return what the stage at the node c + c_low has of a drift, and of what the state lacks."""
    return fma(c, moved, fma(c, moved_low, fma(c_low, moved, error)))
