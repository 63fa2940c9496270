"""What a problem declares to be looked at: the curves of its picture, by their labels."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

import problems
from problems import registry
from problems.picture import Curves
from problems.problem import Problem

Array = NDArray[np.float64]
Observable = Callable[[Array], Array]


def observables(problem: Problem) -> dict[str, Observable]:
    """Return functions of states, shape (n, dim), that return (n,), by label; none where none is declared."""
    entry = registry.entry(problem.name) if problem.name in problems.names() else None
    if entry is None or not isinstance(entry.picture, Curves):
        return {}
    return {
        label: partial(_component, curve) if isinstance(curve, int) else curve
        for curve, label in entry.picture.curves
    }


def _component(place: int, y: Array) -> Array:
    return y[:, place]
