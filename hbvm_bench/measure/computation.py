"""Computations of a study that are no integration of a problem by a method: maps, bisections, sections.

A study names a function that lists them as `Task`; each runs as a case does, in a process of its own
under limits, and is a row of the results. What one returns is stored as MessagePack, in which not-a-number
and every bit of a double survive; the type that its function is annotated with says how it is read again.
"""

import functools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

VALUE = "value"


@dataclass(frozen=True)
class Task:
    """One computation: a function, or a `functools.partial` of one, that says what it returns."""

    key: str  # under which its result is found
    run: Callable[[], Any]
    cost: float = 1.0  # rough seconds, so that the long ones start first
    timed: bool = False  # whether it takes times, so that nothing may run beside it
    limit: float = 3600.0  # seconds after which it is ended


def each(key: str, run: Callable[..., Any], values: Iterable[Any], cost: float) -> list[Task]:
    """Return the tasks, ``key value``, that each call a function with one of the values."""
    return [Task(f"{key} {value}", functools.partial(run, value), cost) for value in values]


def split(key: str, run: Callable[..., Any], values: Sequence[float], parts: int, cost: float) -> list[Task]:
    """Return the tasks, ``key 0`` to ``key parts-1``, that each call a function with a part of the values."""
    pieces = [piece.tolist() for piece in np.array_split(np.asarray(values), parts)]
    return [Task(f"{key} {i}", functools.partial(run, piece), cost) for i, piece in enumerate(pieces)]


def packed(value: Any) -> NDArray[Any]:
    """Return a result as the bytes that are stored as its only array, `VALUE`."""
    return np.frombuffer(msgspec.msgpack.encode(value, enc_hook=_array_out), np.uint8)


def unpacked(data: NDArray[Any], run: Callable[..., Any]) -> Any:
    """Return the result of a computation from its bytes."""
    kind = get_type_hints(function_of(run))["return"]
    return msgspec.msgpack.decode(data.tobytes(), type=kind, dec_hook=_array_in)


def function_of(run: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function that a task calls."""
    return run.func if isinstance(run, functools.partial) else run


def _array_out(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return (value.shape, np.ascontiguousarray(value, dtype="<f8").tobytes())
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError(f"{type(value).__name__} is no result.")


def _array_in(kind: type, value: Any) -> Any:
    shape, data = value
    return np.frombuffer(data, dtype="<f8").reshape(shape).copy()
