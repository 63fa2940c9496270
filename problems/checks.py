"""Values checked by their annotations: a problem's arguments and a method's options alike.

What must hold of a value stands where its type does::

    def kepler(*, e: Annotated[float, Must("an eccentricity, 0 <= e < 1", lambda e: 0 <= e < 1)] = 0.6): ...

    class Leapfrog(MethodBase):
        h: Positive
        order: Literal[2, 4, 6, 8] = 2
"""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import numpy as np

from problems.errors import InputError, shown, unknown

T = TypeVar("T")


@dataclass(frozen=True)
class Must:
    """What a value must be: as a message says it, and as it is tested."""

    be: str
    holds: Callable[[Any], bool] = lambda value: True

    def __repr__(self) -> str:
        return self.be


Positive = Annotated[float, Must("a positive number", lambda x: x > 0)]
"""A finite number above 0."""


Named = Annotated[
    Mapping[str, T],
    Must(
        "a dictionary by name, as in {'name': ...}",
        lambda given: isinstance(given, Mapping) and all(isinstance(key, str) and key for key in given),
    ),
]
"""A dictionary whose keys are names: ``Named[float]``."""

NOTHING: Mapping[str, Any] = MappingProxyType({})
"""The empty one, as a default."""


def at_least(least: int) -> Must:
    """Require a whole number that is not smaller: ``Annotated[int, at_least(2)]``."""
    return Must(f"a whole number of at least {least}", lambda n: n >= least)


def checked(owner: str, name: str, value: Any, annotation: Any) -> Any:
    """Return a value in the form in which it is used, or refuse it.

    Parameters
    ----------
    owner, name : str
        Whose argument it is, and its name: ``"kepler"``, ``"e"``.
    value : any
        What was given.
    annotation : any
        What it must be. ``float`` is a finite number, ``int`` a whole one, one of NumPy's
        too; ``bool``, ``str``, ``Sequence[float]`` or ``Sequence[str]`` (a list, returned as
        a tuple), ``Literal[...]`` one of some words or numbers; each may be ``| None``, and
        ``Annotated`` with `Must`, or with an object whose method ``checked(owner, name,
        value)`` takes the place of the type. Any other annotation allows everything.

    Raises
    ------
    problems.errors.InputError
        One sentence: the value, and what it must be.
    """
    if get_origin(annotation) in (Union, UnionType):
        options = get_args(annotation)
        if value is None and NoneType in options:
            return None
        kinds = [option for option in options if option is not NoneType]
        return checked(owner, name, value, kinds[0]) if len(kinds) == 1 else value
    if get_origin(annotation) is Literal:
        return _one_of(owner, name, value, get_args(annotation))
    kind, *conditions = get_args(annotation) if get_origin(annotation) is Annotated else (annotation,)
    for condition in conditions:
        if hasattr(condition, "checked"):
            return condition.checked(owner, name, value)
    conditions = [condition for condition in conditions if isinstance(condition, Must)]
    words, read = _KINDS.get(kind, ("", lambda value: value))
    found = read(value)
    if (words and found is None) or not all(must.holds(found) for must in conditions):
        # The narrowest condition is the one that is told.
        raise refusal(owner, name, value, conditions[0].be if conditions else words)
    return found


def refusal(owner: str, name: str, value: Any, words: str) -> InputError:
    """Return the error for a value that is not what ``words`` say."""
    return InputError(f"{name}={shown(value)} of {owner} must be {words}.")


def number(value: Any) -> float | None:
    """Return a finite number as a float, one of NumPy's too; ``None`` for anything else."""
    try:
        wrong = isinstance(value, bool | np.bool_ | str | bytes) or np.ndim(value)
        found = math.nan if wrong else float(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return found if math.isfinite(found) else None


def numbers(value: Any) -> tuple[float, ...] | None:
    """Return a list, an array or a series of finite numbers as a tuple; ``None`` for anything else."""
    listed = value.tolist() if hasattr(value, "tolist") else value
    found = [number(each) for each in listed] if isinstance(listed, list | tuple | range) else [None]
    return None if None in found else tuple(found)  # type: ignore[return-value]


def path(owner: str, name: str, value: Any) -> Path:
    """Return a path from text or something path-like, or refuse it.

    Raises
    ------
    problems.errors.InputError
        For anything else, and for text that no file can be called.
    """
    try:
        found = Path(value)
    except TypeError:
        found = None
    if found is None or "\0" in str(found):
        raise refusal(owner, name, value, "a path of a file, such as 'pendulum.npz'")
    return found


def whole(value: Any) -> int | None:
    """Return a whole number as an int, one of NumPy's too; ``None`` for anything else."""
    try:
        return None if isinstance(value, bool | np.bool_) or np.ndim(value) else operator.index(value)
    except (TypeError, ValueError):
        return None


def _flag(value: Any) -> bool | None:
    return bool(value) if isinstance(value, bool | np.bool_) or whole(value) in (0, 1) else None


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None


def _texts(value: Any) -> tuple[str, ...] | None:
    listed = isinstance(value, list | tuple) and all(isinstance(each, str) for each in value)
    return tuple(value) if listed else None


_KINDS: dict[Any, tuple[str, Callable[[Any], Any]]] = {
    float: ("a finite number", number),
    int: ("a whole number", whole),
    bool: ("True or False", _flag),
    str: ("text", _text),
    Sequence[float]: ("a list of finite numbers", numbers),
    Sequence[str]: ("a list of texts", _texts),
}


def _one_of(owner: str, name: str, value: Any, known: tuple[Any, ...]) -> Any:
    if all(isinstance(word, str) for word in known):
        if not isinstance(value, str) or value not in known:
            raise unknown(f"{name} of {owner}", value, known)
        return value
    if (found := whole(value)) not in known:
        raise refusal(owner, name, value, f"one of {', '.join(map(str, known))}")
    return found
