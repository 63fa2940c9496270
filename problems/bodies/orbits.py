"""Orbital elements: states of two bodies from them, and they from states.

With mu = G (m_1 + m_2), the semi-latus rectum p = a (1 - e^2) and the true anomaly f, in the plane of the
orbit and from the pericentre

    r = p / (1 + e cos f),   x = r (cos f, sin f),   v = sqrt(mu/p) (-sin f, e + cos f),

turned by omega, inc and Omega about the third, first and third axis. Kepler's equation is M = E - e sin E, or
M = e sinh H - H for e > 1. (C. D. Murray, S. F. Dermott, Solar System Dynamics, 1999, chapter 2.)
"""

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.checks import CheckedOptions
from problems.errors import InputError, shown, unknown
from problems.quantities import refuse_more_than_numbers

Array = NDArray[np.float64]
ROUNDING = 1e-14  # what rounding leaves of an e or a sine of inc that is 0: measured 2e-15
JACOBI, BARYCENTRIC = "jacobi", "barycentric"  # what an orbit may be about, besides a body
ANOMALIES = ("f", "M", "T")


@dataclass(frozen=True, kw_only=True, eq=False)
class Orbit(CheckedOptions):
    """Orbital elements of a body; numbers, or arrays of shapes that fit together for many orbits.

    Parameters
    ----------
    a : array_like
        Semi-major axis; negative for hyperbolas.
    e : array_like
        Eccentricity, >= 0 and not 1.
    inc, Omega, omega : array_like
        Inclination, longitude of the ascending node and argument of the pericentre, in radians, with respect
        to the plane of the first two axes and the first axis.
    f, M, T : array_like, optional
        Where the body is: the true anomaly, the mean anomaly or the time of a pericentre. One of them; by
        default it is at the pericentre.
    primary : int or str
        What the orbit is about: a body by its index or name, ``"jacobi"`` for the centre of mass of all
        bodies before it, or ``"barycentric"`` for that of all. Its mass counts in mu, beside that of the
        body; for ``"barycentric"`` mu is that of all.

    Raises
    ------
    problems.errors.InputError
        For elements that are no orbit.

    Examples
    --------
    >>> from problems.bodies import Orbit
    >>> Orbit(a=1.524, e=0.0934, M=0.3).e
    0.0934
    """

    a: ArrayLike
    e: ArrayLike = 0.0
    inc: ArrayLike = 0.0
    Omega: ArrayLike = 0.0
    omega: ArrayLike = 0.0
    f: ArrayLike | None = None
    M: ArrayLike | None = None
    T: ArrayLike | None = None
    primary: int | str = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        given = {
            field.name: value
            for field in fields(self)
            if field.name != "primary" and (value := getattr(self, field.name)) is not None
        }
        anomalies = [name for name in ANOMALIES if name in given]
        if len(anomalies) > 1:
            raise InputError(f"an Orbit takes one of f, M and T; got {' and '.join(anomalies)}.")
        for name, value in given.items():
            refuse_more_than_numbers(f"{name} of Orbit", value)
            try:
                array = np.array(value, dtype=np.float64)
            except (TypeError, ValueError):
                array = np.array(np.nan)
            if not np.isfinite(array).all():
                raise InputError(f"{name}={shown(value)} of Orbit must be finite numbers.")
            object.__setattr__(self, name, array if array.ndim else float(array))
        try:
            np.broadcast_shapes(*(np.shape(getattr(self, name)) for name in given))
        except ValueError:
            raise InputError("the elements of an Orbit must be arrays of shapes that fit together.") from None
        a, e = np.broadcast_arrays(np.array(self.a), np.array(self.e))
        if (wrong := (e < 0.0) | (e == 1.0)).any():
            raise InputError(f"e={e[wrong].flat[0]!s} of Orbit must be >= 0 and not 1; parabolas have no a.")
        if (wrong := (a == 0.0) | ((a > 0.0) != (e < 1.0))).any():
            raise InputError(
                f"a={a[wrong].flat[0]!s} and e={e[wrong].flat[0]!s} of Orbit do not go together: a is "
                "positive for e < 1 and negative for e > 1."
            )
        if self.f is not None and (np.array(e) * np.cos(self.f) <= -1.0).any():
            raise InputError(
                f"f={shown(self.f)} of Orbit is beyond the asymptotes, where 1 + e cos(f) = 0; give a "
                "smaller one."
            )

    def state(self, mu: ArrayLike, t: float = 0.0) -> tuple[Array, Array]:
        """Return positions and velocities with respect to the primary, shape (..., 3).

        Parameters
        ----------
        mu : array_like
            G times both masses.
        t : float
            The time, which ``T`` is related to.
        """
        a, e, mu = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in (self.a, self.e, mu)))
        parameter = a * (1.0 - e) * (1.0 + e)
        if self.M is None and self.T is None:
            f = np.asarray(0.0 if self.f is None else self.f)
            r = parameter / (1.0 + e * np.cos(f))
            along, across = r * np.cos(f), r * np.sin(f)
        else:
            M = self.M if self.T is None else np.sqrt(mu / np.abs(a) ** 3) * (t - np.asarray(self.T))
            along, across, r = _from_anomaly(*np.broadcast_arrays(a, e, np.asarray(M, dtype=np.float64)))
        speed = np.sqrt(mu / parameter)
        x = self._turned(along, across)
        v = self._turned(-speed * across / r, speed * (e + along / r))
        return x, v

    def _turned(self, along: Array, across: Array) -> Array:
        """Return vectors in space, from their components along the pericentre and across."""
        (cO, sO), (co, so), (ci, si) = (
            (np.cos(angle), np.sin(angle)) for angle in (self.Omega, self.omega, self.inc)
        )
        u, w = along * co - across * so, along * so + across * co
        return np.stack(np.broadcast_arrays(u * cO - w * sO * ci, u * sO + w * cO * ci, w * si), axis=-1)


class Elements(NamedTuple):
    """Orbital elements, arrays of one shape.

    Attributes
    ----------
    a, e, inc, Omega, omega : ndarray
        As in `Orbit`. Omega and omega are between 0 and 2 pi. For inc = 0 or pi the node is on the first
        axis, and for e = 0 the pericentre at the node.
    f, M : ndarray
        True and mean anomaly, between -pi and pi; M of hyperbolas is any number.
    T : ndarray
        Time of the nearest pericentre.
    """

    a: Array
    e: Array
    inc: Array
    Omega: Array
    omega: Array
    f: Array
    M: Array
    T: Array


def elements_of(x: Array, v: Array, mu: ArrayLike, t: ArrayLike = 0.0) -> Elements:
    """Return the elements of positions and velocities with respect to a primary, shape (..., 3)."""
    mu = np.asarray(mu, dtype=np.float64)
    r, radial = np.linalg.norm(x, axis=-1), np.sum(x * v, axis=-1)
    spin = np.cross(x, v)
    h, level = np.linalg.norm(spin, axis=-1), np.hypot(spin[..., 0], spin[..., 1])
    with np.errstate(divide="ignore", invalid="ignore"):  # straight lines and parabolas have NaN
        a = 1.0 / (2.0 / r - np.sum(v * v, axis=-1) / mu)
        cosine, sine = h * h / (mu * r) - 1.0, h * radial / (mu * r)
        e, f = np.hypot(cosine, sine), np.arctan2(sine, cosine)
        planar = level <= ROUNDING * h
        node = np.where(planar, 0.0, np.arctan2(spin[..., 0], -spin[..., 1]))
        first = np.stack([np.cos(node), np.sin(node), np.zeros_like(node)], axis=-1)
        second = np.cross(spin / h[..., np.newaxis], first)
        latitude = np.arctan2(np.sum(second * x, axis=-1), np.sum(first * x, axis=-1))
        f = np.where(e <= ROUNDING, latitude, f)
        bound = e < 1.0
        E = 2.0 * np.arctan2(
            np.sqrt(np.maximum(1.0 - e, 0.0)) * np.sin(f / 2.0), np.sqrt(1.0 + e) * np.cos(f / 2.0)
        )
        size = radial / np.sqrt(mu * np.abs(a))  # e sinh H
        M = np.where(bound, E - e * np.sin(E), size - np.arcsinh(size / e))
        T = t - M / np.sqrt(mu / np.abs(a) ** 3)
    turn = 2.0 * np.pi
    return Elements(
        a, e, np.arctan2(level, spin[..., 2]), np.mod(node, turn), np.mod(latitude - f, turn), f, M, T
    )


def _from_anomaly(a: Array, e: Array, M: Array) -> tuple[Array, Array, Array]:
    """Return the position in the plane, along the pericentre and across, and the distance.

    Newton's iteration for Kepler's equation begins beyond the solution, on the side where the function is
    convex, so that it comes down to it from every start.
    """
    bound = e < 1.0
    M = np.where(bound, np.remainder(M + np.pi, 2.0 * np.pi) - np.pi, M)
    side, m = np.where(M < 0.0, -1.0, 1.0), np.abs(M)
    open_ = np.where(bound, 2.0, e)  # where it is not used, a value that does no harm
    closed = np.where(bound, e, 0.0)
    E = np.minimum(m + closed, np.pi)
    H = np.minimum(np.arcsinh(m / (open_ - 1.0)), np.cbrt(6.0 * m / open_))
    while True:
        lower = E - (E - closed * np.sin(E) - m) / (1.0 - closed * np.cos(E))
        lower_h = H - (open_ * np.sinh(H) - H - m) / (open_ * np.cosh(H) - 1.0)
        if not ((bound & (lower < E)) | (~bound & (lower_h < H))).any():
            break
        E, H = np.minimum(E, lower), np.minimum(H, lower_h)
    across = np.sqrt(np.abs((1.0 - e) * (1.0 + e)))
    x = a * np.where(bound, np.cos(E) - e, np.cosh(H) - e)
    y = np.abs(a) * across * side * np.where(bound, np.sin(E), np.sinh(H))
    return x, y, a * np.where(bound, 1.0 - e * np.cos(E), 1.0 - e * np.cosh(H))


def primary_index(primary: Any, names: tuple[str, ...], n: int) -> int | str:
    """Return the index of a body by its index or name, or one of the words for centres of mass.

    Raises
    ------
    problems.errors.InputError
        If there is no such body.
    """
    if primary in (JACOBI, BARYCENTRIC):
        return primary
    if names and isinstance(primary, str) and primary not in names:
        raise unknown("primary", primary, (*names, JACOBI, BARYCENTRIC))
    return body_index(primary, names, n)


def body_index(body: Any, names: tuple[str, ...], n: int) -> int:
    """Return the index of a body by its index, negative ones from the end, or its name; raises as above."""
    if isinstance(body, str):
        if body in names:
            return names.index(body)
        listed = ", ".join(names) if names else f"not named; give an index below {n}, or names= to nbody"
        raise InputError(f"there is no body {body!r}; the bodies are {listed}.")
    if not -n <= body < n:
        raise InputError(f"there is no body {body!r}; the bodies are 0 to {n - 1}.")
    return body % n
