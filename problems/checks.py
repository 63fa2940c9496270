"""Values checked by their annotations: a problem's arguments and a method's options alike.

A number is annotated with what must hold of it::

    def kepler(*, e: Annotated[float, Between(0.0, 1.0, words="an eccentricity, 0 <= e < 1")] = 0.6): ...

    class Leapfrog(MethodBase):
        h: Positive
        order: Literal[2, 4, 6, 8] = 2

`checked` knows ``float`` (finite), ``int``, ``bool``, ``str``, ``Literal[...]`` and
``Annotated[..., condition]``, each also ``| None``; anything else it lets pass. A condition is
an object with a method ``checked(owner, name, value)``, such as the classes here.
"""

import math
import operator
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from problems.errors import InputError, shown, unknown


def checked(owner: str, name: str, value: Any, annotation: Any) -> Any:
    """Return a value in the form in which it is compared and printed, or refuse it.

    Parameters
    ----------
    owner, name : str
        Whose argument it is, and its name: ``"kepler"``, ``"e"``.
    value : any
        What was given.
    annotation : any
        What it must be; see the module.

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
    if get_origin(annotation) is Annotated:
        for condition in annotation.__metadata__:
            if hasattr(condition, "checked"):
                value = condition.checked(owner, name, value)
        return value
    if get_origin(annotation) is Literal:
        return _choice(owner, name, value, get_args(annotation))
    condition = _PLAIN.get(annotation) if isinstance(annotation, type) else None
    return value if condition is None else condition.checked(owner, name, value)


def refusal(owner: str, name: str, value: Any, words: str) -> InputError:
    """Return the error for a value that is not what ``words`` say."""
    return InputError(f"{name}={shown(value)} of {owner} must be {words}.")


@dataclass(frozen=True)
class Between:
    """A finite number ``low <= x < high``, or above ``low`` where it is ``open``.

    Attributes
    ----------
    words : str
        What such a number is called, for the message; by default the bounds.
    """

    low: float = -math.inf
    high: float = math.inf
    open: bool = False
    words: str = ""

    def checked(self, owner: str, name: str, value: Any) -> float:
        """Return the number as a float, or refuse it."""
        x = number(value)
        if not math.isfinite(x):
            named = f"a finite number, {self.words}" if self.words else self._bounds(name)
            raise refusal(owner, name, value, named)
        if not self.low <= x < self.high or (self.open and x == self.low):
            raise refusal(owner, name, value, self.words or self._bounds(name))
        return x

    def _bounds(self, name: str) -> str:
        low = f"{self.low:g} {'<' if self.open else '<='} " if self.low > -math.inf else ""
        high = f" < {self.high:g}" if self.high < math.inf else ""
        return f"a finite number, {low}{name}{high}" if low or high else "a finite number"


Positive = Annotated[float, Between(0.0, open=True, words="positive")]
"""A finite number above 0."""


@dataclass(frozen=True)
class AtLeast:
    """A whole number of at least ``least``."""

    least: int

    def checked(self, owner: str, name: str, value: Any) -> int:
        """Return the number as an int, or refuse it."""
        given = whole(value)
        if given is None or given < self.least:
            raise refusal(owner, name, value, f"a whole number of at least {self.least}")
        return given


@dataclass(frozen=True)
class Length:
    """A list of so many finite numbers."""

    size: int

    def checked(self, owner: str, name: str, value: Any) -> tuple[float, ...]:
        """Return the numbers as a tuple, or refuse them."""
        found = tuple(map(number, value)) if isinstance(value, list | tuple) else ()
        if len(found) != self.size or not all(map(math.isfinite, found)):
            raise refusal(owner, name, value, f"a list of {self.size} finite numbers")
        return found


class _Whole:
    def checked(self, owner: str, name: str, value: Any) -> int:
        if (given := whole(value)) is None:
            raise refusal(owner, name, value, "a whole number")
        return given


class _Flag:
    def checked(self, owner: str, name: str, value: Any) -> bool:
        if isinstance(value, bool | np.bool_) or whole(value) in (0, 1):
            return bool(value)
        raise refusal(owner, name, value, "True or False")


class _Text:
    def checked(self, owner: str, name: str, value: Any) -> str:
        if not isinstance(value, str):
            raise refusal(owner, name, value, "a text")
        return value


_PLAIN: dict[type, Any] = {float: Between(), int: _Whole(), bool: _Flag(), str: _Text()}


def _choice(owner: str, name: str, value: Any, known: tuple[Any, ...]) -> Any:
    if isinstance(known[0], str):
        if not isinstance(value, str) or value not in known:
            raise unknown(f"{name} of {owner}", value, known)
        return value
    if (given := whole(value)) not in known:
        raise refusal(owner, name, value, f"one of {', '.join(map(str, known))}")
    return given


def number(value: Any) -> float:
    """Return a number as a float, one of NumPy's too; NaN for what is none, or none that a double holds."""
    try:
        wrong = isinstance(value, bool | np.bool_ | str | bytes) or np.ndim(value)
        return math.nan if wrong else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def whole(value: Any) -> int | None:
    """Return a whole number as an int, one of NumPy's too; ``None`` for anything else."""
    try:
        return None if isinstance(value, bool | np.bool_) or np.ndim(value) else operator.index(value)
    except (TypeError, ValueError):
        return None
