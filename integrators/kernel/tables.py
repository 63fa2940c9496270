"""The tables of HBVM(k, s) as the kernel wants them: padded to lanes, in columns of eight stages.

A product of the kernel takes each row of ``h A`` as doubles. What rounding does
to a row acts like a wrong node or a wrong weight in every single step, and over
a million steps even a relative 1e-17 of it shows as a linear drift of the
energy (measured on the outer Solar System: up to 8e-19 per year for some h,
against 1e-19 or less with the rule that follows). So rows are rounded such that
they keep their first moments: what they make of a field that is constant,
linear or quadratic over the step is accurate to 1e-19 or so. This costs nothing
when the rows are used.
"""

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.native import binary, store
from integrators.kernel.native.memory import aligned
from integrators.kernel.routes import PER_OCTAVE, THROUGH, WIDE
from integrators.kernel.tolerance import degree_of_error
from problems.double_double import DD

Array = NDArray[np.float64]

# Coefficients that are extrapolated. P_j(2) grows like 5.8^j: with more, that amplifies rounding more than
# it helps. Adaptive steps are long, and what they leave out is larger than that.
MODES, MODES_VARYING = 13, 16
MOMENTS = 3
_UP = 1.0 + np.arange(PER_OCTAVE + 1) / PER_OCTAVE
RATIOS = np.append(0.5 * _UP[:-1], _UP)
"""Adaptive steps are so many times as long as the step before, with up to 16 stages, where nothing
else asks for more or less: there are tables for these ratios. Lanes do not use them."""

FARTHEST = 4.0  # units in the last place of its largest entry by which an entry of a row may move

NAMES = (
    "nodes", "nodes_low", "weights", "weights_low", "position_weights", "position_weights_low",
    "matrix", "matrix_low", "projection", "to_legendre", "extrapolation_basis", "two_step_extrapolation",
    "basis",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Constants:
    """What the tables are made of; independent of the step.

    Attributes
    ----------
    k, s, lanes : int
        Stages, degree, and stages per call of the field.
    second : bool
        Whether for the second-order form.
    route : int
        How a product is done: a number of columns, `WIDE` or `THROUGH`.
    columns : int
        Of the matrix.
    arrays : dict of str to ndarray
        ``matrix`` + ``matrix_low`` (k, k), or (k, s) on the route THROUGH; ``projection``
        (s, k) and ``to_legendre`` (modes, k) onto coefficients; ``extrapolation_basis`` (k, modes), the
        modes at the nodes of the next step; ``two_step_extrapolation`` (k, 2 k), from two steps' values to
        the nodes of the next one, on the route of eight columns; ``basis`` (k, moments); and vectors (k,).
    """

    k: int
    s: int
    lanes: int
    second: bool
    route: int
    modes: int
    arrays: dict[str, Array]

    @property
    def two_steps(self) -> bool:
        """Whether the first stages of a step come from the values of the two before it."""
        return from_two(self.k, self.s, self.route)

    @property
    def first(self) -> int:
        """Coefficients that come before gamma_0: on the route THROUGH the first ones are there twice."""
        return min(MOMENTS, self.s) if self.route == THROUGH else 0


def lanes_for(k: int) -> int:
    """Return how many stages the field should take at a time."""
    return 16 if 8 < k <= 16 else 8


def route_for(k: int, s: int, lanes: int) -> int:
    """Return the cheapest route of a product."""
    if k <= lanes:
        return lanes
    chunks, modes = _up(k) // 8, _up(s + MOMENTS) // 8
    return THROUGH if 2 * modes < chunks else WIDE


@lru_cache(maxsize=64)
def constants(k: int, s: int, second: bool, lanes: int) -> Constants:
    """Return the constants of HBVM(k, s), from disk if they have been made before.

    Making them takes 50-digit arithmetic, and importing it alone takes longer
    than loading them.
    """
    route = route_for(k, s, lanes)
    shapes = _shapes(k, s, route)
    name = store.key("tables", f"{k} {s} {second} {route}", binary.sources(__name__))
    parts = store.arrays(name, shapes, lambda: [*map(_make(k, s, second, route).__getitem__, NAMES)])
    arrays: dict[str, Array] = dict(zip(NAMES, parts, strict=True))
    return Constants(k, s, lanes, second, route, min(k, MODES_VARYING), arrays)


def from_two(k: int, s: int, route: int) -> bool:
    """Whether first stages come from two steps; with s < k - 1 their polynomials do not join so smoothly."""
    return route == 8 and s >= k - 1


def _shapes(k: int, s: int, route: int) -> list[tuple[int, int]]:
    modes = min(k, MODES_VARYING)
    inner = s if route == THROUGH else k
    extrapolations = [(modes, k), (k, modes), (k, 2 * k if from_two(k, s, route) else 0)]
    return [(k, 1)] * 6 + [(k, inner)] * 2 + [(s, k), *extrapolations, (k, min(MOMENTS, k))]


def _make(k: int, s: int, second: bool, route: int) -> dict[str, Array]:
    from integrators.coefficients import legendre

    t = legendre.tables(k, s)
    modes = min(k, MODES_VARYING)
    integrals = t.double_integrals if second else t.integrals
    matrix = (integrals.hi, integrals.lo)
    if route != THROUGH:
        matrix = _product(matrix, (t.projection.hi, t.projection.lo))
    basis = legendre.legendre(t.nodes.hi, max(modes, MOMENTS))
    return {
        "nodes": t.nodes.hi,
        "nodes_low": t.nodes.lo,
        "weights": t.weights.hi,
        "weights_low": t.weights.lo,
        "position_weights": t.position_weights.hi,
        "position_weights_low": t.position_weights.lo,
        "matrix": matrix[0],
        "matrix_low": matrix[1],
        "projection": keep_moments(t.projection.hi, t.projection.lo, basis[:, : min(MOMENTS, k)]),
        "to_legendre": (basis[:, :modes] * t.weights.hi[:, None]).T,
        "extrapolation_basis": legendre.legendre(1.0 + t.nodes.hi, modes),
        "two_step_extrapolation": legendre.two_step_extrapolation(k, MODES)
        if from_two(k, s, route)
        else np.empty((k, 0)),
        "basis": basis[:, : min(MOMENTS, k)],
    }


def keep_moments(high: Array, low: Array, basis: Array) -> Array:
    """Round the rows of ``high + low`` to doubles that keep their products with ``basis``.

    Parameters
    ----------
    high, low : ndarray, shape (n, k)
        The matrix, as a sum of two doubles.
    basis : ndarray, shape (k, m)
        Columns with which the rounded rows shall have the products that the exact rows
        have, the most important first.

    Returns
    -------
    ndarray, shape (n, k)
        Some entries have moved by a few units of the row's own rounding error.
    """
    rounded = high.copy()
    k, m = basis.shape
    weights = 0.5 ** np.arange(m)
    for row, exact, low_row in zip(rounded, high, low, strict=True):
        far = FARTHEST * np.spacing(np.abs(exact).max())
        # The entries that are rounded most finely, of the whole row and of its parts: of the
        # latter none need move far.
        parts = [np.arange(k), *np.array_split(np.arange(k), m)]
        finest = [part[np.argsort(np.abs(exact[part]))] for part in parts]
        pool = np.unique(np.concatenate([finest[0][:9], *(part[:3] for part in finest[1:])]))
        sets = np.array(list(itertools.combinations(pool, m)))
        inverses = np.linalg.inv(basis[sets].transpose(0, 2, 1))
        for _ in range(3):
            deficit = ((exact - row) + low_row) @ basis  # exact - row is exact: they differ by a few units
            moved = (row[sets] + inverses @ deficit) - row[sets]
            left = deficit - np.einsum("si,sij->sj", moved, basis[sets])
            sizes = np.linalg.norm(left * weights, axis=1)
            sizes[np.abs(moved).max(axis=1) > far] = np.inf
            best = np.argmin(sizes)
            if sizes[best] >= np.linalg.norm(deficit * weights):
                break
            row[sets[best]] += moved[best]
    return rounded


# --- tables for one step length ---------------------------------------------------------------------


def unit(constants: Constants, velocity: Array) -> bool:
    """Whether the rows' factors can be part of the matrix: all velocities 1, or first-order form."""
    return not constants.second or (constants.route > 1 and bool((velocity == 1.0).all()))


@lru_cache(maxsize=32)  # they take milliseconds
def scaled(constants: Constants, h: float, *, squared: bool) -> dict[str, Array]:
    """Return the tables for the step h, as `Context` has them; they are shared, not to be written to.

    Parameters
    ----------
    constants : Constants
        From `constants`.
    h : float
        The step, negative backwards.
    squared : bool
        Whether the matrix takes h twice, as it does in the second-order form
        where no factor follows.
    """
    a = constants.arrays
    high, low = times(a["matrix"], a["matrix_low"], h)
    if squared:
        high, low = times(high, low, h)
    modes = slice(MODES)
    basis = a["extrapolation_basis"][:, modes]
    if constants.route == THROUGH:
        # What rounding takes from the first columns goes into columns of its own, before
        # the others, so that a chain of products holds it before it is rounded.
        first = constants.first
        matrix = np.hstack([low[:, :first], high])
        extrapolation = high @ a["projection"] @ basis
    else:
        matrix = keep_moments(high, low, a["basis"])
        extrapolation = high @ basis @ a["to_legendre"][modes]
    columns = constants.route if constants.route > 1 else None
    more = {}
    if constants.two_steps:
        older, last = np.hsplit(high @ a["two_step_extrapolation"], 2)
        parts = [packed(part, columns=columns, repeat=True) for part in (older, last)]
        more["extrapolation_two"] = joined(parts)
    return {
        "matrix": packed(matrix, columns=columns, repeat=True),
        "extrapolation": packed(extrapolation, columns=columns, repeat=True),
        **more,
    }


@lru_cache(maxsize=32)
def rounded(constants: Constants) -> Array:
    """Return the matrix for a step of 1 with the moments of its rows kept, as `Context` has it.

    What rounding does to a row acts in every step of varying length. Not on the route THROUGH.
    """
    a = constants.arrays
    columns = constants.route if constants.route > 1 else None
    kept = keep_moments(a["matrix"], a["matrix_low"], a["basis"])
    return packed(kept, columns=columns, repeat=True)


@lru_cache(maxsize=32)
def extrapolations(constants: Constants) -> Array:
    """Return the tables for first stages where steps vary: for a step of 1, for all `RATIOS`."""
    from integrators.coefficients import legendre

    a = constants.arrays
    nodes, modes, columns = a["nodes"].reshape(-1), constants.modes, constants.route
    basis = [legendre.legendre(1.0 + ratio * nodes, modes) for ratio in RATIOS]
    matrices = [a["matrix"] @ there @ a["to_legendre"] for there in basis]
    return joined([packed(matrix, columns=columns, repeat=True) for matrix in matrices])


def fixed(constants: Constants) -> dict[str, Array]:
    """Return the tables that do not depend on the step, as `Context` has them."""
    a = constants.arrays
    columns = constants.route if constants.route > 1 else None
    raw, projection = a["matrix"], a["projection"]
    if constants.route == THROUGH:
        raw = np.hstack([np.zeros((constants.k, constants.first)), raw])
        projection = np.vstack([projection[: constants.first], projection])
    return {
        "raw_matrix": packed(raw, columns=columns, repeat=True),
        "projection": packed(projection),
        "mode_projection": packed(a["to_legendre"]),
        "nodes": _vector(a["nodes"], repeat=True),
        "nodes_low": _vector(a["nodes_low"], repeat=True),
        "weights": _vector(a["weights"]),
        "weights_low": _vector(a["weights_low"]),
        "position_weights": _vector(a["position_weights"]),
        "position_weights_low": _vector(a["position_weights_low"]),
        "recurrence": recurrence(constants.modes),
    }


def degrees_judged(k: int, s: int) -> tuple[int, ...]:
    """Return the degrees of the coefficients ``GAMMA_0`` .. ``LAST`` that a step is judged by."""
    m = degree_of_error(k, s)
    return 0, *(min(j, m - 1) for j in (1, 2, 3)), m - 1, m, max(k - 2, 0), k - 1


def recurrence(modes: int) -> Array:
    """Return pairs a, b with P_{j+1} = a x P_j - b P_{j-1}, x = 2 c - 1, for the orthonormal basis."""
    j = np.arange(modes, dtype=np.float64)
    up = np.sqrt(2.0 * j + 3.0)
    return np.stack([np.sqrt(2.0 * j + 1.0) * up, j * up / np.sqrt(np.abs(2.0 * j - 1.0))], axis=1) / (
        j[:, None] + 1.0
    )


def times(high: Array, low: Array, h: float) -> tuple[Array, Array]:
    """Return (high + low) * h as a sum of two doubles."""
    product = DD(high, low) * h
    return product.hi, product.lo


def _product(left: tuple[Array, Array], right: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return left @ right as a sum of two doubles, to about 30 digits."""
    total = DD(np.zeros((left[0].shape[0], right[0].shape[1])))
    for j in range(left[0].shape[1]):
        total = total + DD(left[0][:, j : j + 1], left[1][:, j : j + 1]) * DD(right[0][j], right[1][j])
    return total.hi, total.lo


def _up(n: int) -> int:
    return (n + 7) // 8 * 8


def _vector(values: Array, *, repeat: bool = False) -> Array:
    """Pad to a multiple of eight: with the last value, so that idle stages are like a real one, or 0."""
    values = values.reshape(-1)
    out = aligned(_up(values.size))
    out[: values.size] = values
    if repeat:
        out[values.size :] = values[-1]
    return out


def joined(parts: list[Array]) -> Array:
    """Lay packed matrices out one after another."""
    out = aligned(sum(part.size for part in parts))
    out[:] = np.concatenate(parts)
    return out


def packed(matrix: Array, *, columns: int | None = None, repeat: bool = False) -> Array:
    """Pad to multiples of eight and lay out as groups of eight rows, each column by column."""
    n, m = matrix.shape
    padded = np.zeros((_up(n), _up(m) if columns is None else columns))
    padded[:n, :m] = matrix
    if repeat:
        padded[n:] = padded[n - 1]
    out = aligned(padded.size)
    out[:] = padded.reshape(-1, 8, padded.shape[1]).transpose(0, 2, 1).reshape(-1)
    return out
