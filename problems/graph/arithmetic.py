"""The operators of a formula: all that is known of each, in one record, as of a function in `functions`."""

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

SUM, PRODUCT, LEAF = 1, 2, 3
"""How tightly a printed operation binds."""


@dataclass(frozen=True)
class Arithmetic:
    """An operator.

    Attributes
    ----------
    name : str
        That of its method in `problems.graph.nodes.Graph`.
    arity : int
        Number of arguments.
    value : callable
        The value at numbers of any kind that have operators.
    text : str
        What is printed between two arguments, or before one.
    level : int
        How tightly it binds: `SUM` or `PRODUCT`.
    """

    name: str
    arity: int
    value: Callable[..., Any]
    text: str
    level: int


ARITHMETIC = {
    record.name: record
    for record in (
        Arithmetic("add", 2, operator.add, " + ", SUM),
        Arithmetic("sub", 2, operator.sub, " - ", SUM),
        Arithmetic("mul", 2, operator.mul, "*", PRODUCT),
        Arithmetic("div", 2, operator.truediv, "/", PRODUCT),
        Arithmetic("neg", 1, operator.neg, "-", SUM),
    )
}
"""All of them, by name."""
