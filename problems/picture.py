"""How a problem is drawn: what the gallery shows of it, said in the problem's own file."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Picture:
    """What all pictures say.

    Attributes
    ----------
    span : float, optional
        How much of the problem's span is shown; all of it by default.
    points : int
        Samples.
    arguments : mapping
        Of the problem, where its default ones are not to be drawn.
    """

    span: float | None = None
    points: int = 1500
    arguments: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Orbits(Picture):
    """The orbits of bodies, in their first two coordinates.

    Attributes
    ----------
    dimension : int
        Coordinates of a body.
    first, last : int
        Which bodies, as in a slice.
    limits : tuple of float, optional
        Left, right, bottom and top of what is shown; ``None`` leaves one to the drawing.
    inset : tuple of (int, int, float, str), optional
        First and last body, the span, and the title of a smaller picture beside the orbits.
    """

    dimension: int = 2
    first: int = 0
    last: int | None = None
    limits: tuple[float | None, float | None, float | None, float | None] | None = None
    inset: tuple[int, int, float, str] | None = None


@dataclass(frozen=True, kw_only=True)
class Plane(Picture):
    """One component of the state against another.

    Attributes
    ----------
    places : tuple of int
        The two components.
    labels : tuple of str
        Their names.
    outline : array_like, shape (n, 2), optional
        A line behind the orbit.
    width : float
        Of the orbit's line, in points.
    """

    places: tuple[int, int] = (0, 1)
    labels: tuple[str, str] = ("q₁", "q₂")
    outline: ArrayLike | None = None
    width: float = 0.7


@dataclass(frozen=True, kw_only=True)
class Curves(Picture):
    """Components of the state against time.

    Attributes
    ----------
    curves : sequence of (int or callable, str)
        A place in the state, or a function of the states (n, dim) that returns (n,), and a label.
    """

    curves: Sequence[tuple[int | Callable[[Array], Array], str]]


@dataclass(frozen=True, kw_only=True)
class Lattice(Picture):
    """All positions of a chain as colours over time; ``moving``: less their mean."""

    moving: bool = False


@dataclass(frozen=True, kw_only=True)
class Phase(Picture):
    """An orbit in one degree of freedom among the level curves of its energy."""
