"""The noise of a field that is called, and the sentence that ends a run by it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from integrators.kernel.step.rule import FLOOR, SMALLEST
from integrators.protocol import Array, Status
from problems.analysis.roundoff import UNIT

POINTS, FEWEST = 16, 4  # values on a line, and how many of their differences must not be 0
# Of the state's size, the lengths of the lines: on the first there are sixteen thousand doubles, on the last
# a field that is rounded to two digits changes. One with fewer steps than that has discontinuities, which
# adaptive steps end at; where a step has failed, they are its noise.
LENGTHS = (2.0**-38, 2.0**-29, 2.0**-20, 2.0**-11, 2.0**-2)
ALL_LENGTHS = (*LENGTHS, 1.0)
GOLDEN = 0.618  # multiples of it, but for their integers, are in no order
FLAT = 0.1  # coefficients of high degree that are at least this part of the middle ones do not fall off
BEYOND_ROUNDING = 100.0
MARGIN = 30.0  # times what noise adds while the state changes by its size is a tolerance that can be had
MOST = 0.1  # a looser tolerance is no advice

_X = 0.5 - 0.5 * np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)
# Chebyshev coefficients of independent values of deviation 1, all of the same size
_COEFFICIENTS = np.cos(np.pi * np.outer(np.arange(POINTS), np.arange(POINTS) + 0.5) / POINTS) * math.sqrt(
    2.0 / POINTS
)


def field_noise(
    field: Callable[[float, Array], Array], t: float, h: float, y: Array, lengths: Sequence[float]
) -> Array:
    """Return the standard deviation of the noise of a field near a state, for each component.

    By the idea of J. J. More and S. M. Wild, "Estimating computational noise", SIAM J. Sci. Comput. 33 (2011)
    1292-1314: on so short a line a smooth field is a polynomial of low degree, and what is found of high
    degrees is noise, of the same size in all of them. As there, the line is longer where most values
    on it are equal, those of a field that is rounded. Coefficients take the place of differences, since those
    of rounded values at equal distances may vanish. The least is taken of two lines that begin at the
    state in opposite directions, at both ends of the step: a discontinuity is on one of them.

    Parameters
    ----------
    field : callable
        Returns the derivatives at a time and a state.
    t, h : float
        The lines are in the step from t of length h.
    y : array, shape (dim,)
        What stays 0 in that step stays 0: the field may not be defined, or another one, beside it.
    lengths : sequence of float
        Of the lines, relative to the state, ascending; a longer one is taken where a component has fewer than
        `FEWEST` steps on those before.

    Returns
    -------
    array, shape (dim,)
        0 where rounding of the state and of the derivatives explains what is found, or the field is not
        finite.
    """
    order = np.asarray(GOLDEN * np.arange(1, len(y) + 1) % 1.0, dtype=np.float64)
    away: Array = np.where(order * 64.0 % 2.0 < 1.0, 0.5, -0.5) * (1.0 + order)  # so that terms do not cancel
    away *= np.where(y != 0.0, y, h * field(t, y))
    end = float(np.nextafter(t + h, t))  # whose rounding may be beyond the interval
    lines = (t, h, -away), (end, -h, away)
    return np.minimum(*(_on_line(field, start, way, y, beside, lengths) for start, way, beside in lines))


def _on_line(
    field: Callable[[float, Array], Array],
    t: float,
    h: float,
    y: Array,
    away: Array,
    lengths: Sequence[float],
) -> Array:
    """Return the same from lines in one direction."""
    noise = np.full(len(y), np.nan)
    for length in lengths:
        values = np.array([field(t + length * x * h, y + length * x * away) for x in _X])
        steps = np.count_nonzero(np.diff(values, axis=0), axis=0)
        found = np.where(steps >= FEWEST, _on_one_length(values, length), np.nan)
        noise = np.where(np.isnan(noise), found, noise)
        if not np.isnan(noise).any():
            break
    return np.nan_to_num(noise)


def _on_one_length(values: Array, length: float) -> Array:
    """Return the noise of values on a line of a length, 0 where they are smooth or not finite."""
    coefficients = np.abs(_COEFFICIENTS @ values)
    half = POINTS // 2
    middle, high = (
        np.sqrt(np.mean(part**2, axis=0)) for part in (coefficients[half // 2 : half], coefficients[half:])
    )
    rounding = UNIT * np.maximum(np.abs(values).max(axis=0), np.ptp(values, axis=0) / length)
    return np.where((high > BEYOND_ROUNDING * rounding) & (high > FLAT * middle), high, 0.0)


@dataclass(frozen=True)
class Noise:
    """The noise of a field near a state.

    Attributes
    ----------
    values : array, shape (dim,)
        Its standard deviation; see `field_noise`.
    slope, y : array, shape (dim,)
        The field there, and the state.
    """

    values: Array
    slope: Array
    y: Array

    def added(self, h: float) -> float:
        """Return what it adds to a component in a step of length h, relative to its size, at most."""
        size = np.maximum(np.abs(self.y), FLOOR * np.abs(self.y).max()) + abs(h) * np.abs(self.slope)
        return float(np.max(abs(h) * self.values / np.maximum(size, SMALLEST)))

    @property
    def relative(self) -> float:
        """The noise relative to the field: what it adds while the state changes by its size."""
        return float(self.values.max() / max(np.abs(self.slope).max(), self.values.max()))

    def ends(self, t: float, h: float) -> tuple[Status, str]:
        """Return the status of a run that it has ended in a step from t, and the reason as a sentence."""
        tolerance = 10.0 ** math.ceil(math.log10(MARGIN * self.relative))
        advice = "give a field that is smooth to rounding"
        if tolerance <= MOST:
            advice += f", or tol={tolerance:.0e} or more"
        return Status.NONLINEAR_DIVERGENCE, (
            f"the values of the vector field have noise of {self.values.max():.0e}, too much for the step of "
            f"h = {h!r} from t = {t!r}: while the state changes by its size, it adds {self.relative:.0e} "
            f"of that; {advice}."
        )
