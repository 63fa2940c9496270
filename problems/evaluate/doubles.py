"""Functions evaluated in doubles, without any text that is compiled or executed."""

from collections.abc import Callable

import numpy as np

from problems.evaluate.evaluator import Array, Numbers
from problems.graph.arithmetic import ARITHMETIC
from problems.graph.functions import CALLED


def _guarded(function: Callable[..., float]) -> Callable[..., Array]:
    """Return a function on arrays; nan where it has no value."""

    def guarded(*args: float) -> float:
        try:
            return function(*args)
        except (ValueError, OverflowError):
            return np.nan

    return np.vectorize(guarded, otypes=[float])


DOUBLES = Numbers(
    of=np.float64,
    operations={name: _guarded(f.value) for name, f in CALLED.items()}
    | {name: record.value for name, record in ARITHMETIC.items()}
    | {"pow": np.power},
    rows=lambda values, n, columns: np.broadcast_to(values, (n, columns)),
    total=lambda terms: np.cumsum(terms, axis=0)[-1],
    stacked=np.stack,
)
"""Doubles, summed in the order of the terms."""
