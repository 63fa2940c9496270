"""Calls that a function does not take, and values that an annotation does not allow, told in one sentence."""

import dataclasses
import functools
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, ParamSpec, Self, TypeVar, Union, get_args, get_origin

from problems.errors import InputError, shown, unknown

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Must:
    """What a value must be: as a message says it, and as it is tested.

    It belongs to an annotation: ``Annotated[float, Must("a positive number", lambda x: x > 0)]``.
    """

    be: str
    holds: Callable[[Any], bool] = lambda value: True


Positive = Annotated[float, Must("a positive number", lambda x: x > 0)]
"""A finite number above 0."""


def at_least(least: int) -> Must:
    """Require a whole number that is not smaller: ``Annotated[int, at_least(2)]``."""
    return Must(f"a whole number of at least {least}", lambda n: n >= least)


def check(
    name: str, signature: inspect.Signature, values: Sequence[Any], options: Mapping[str, Any], kind: str
) -> None:
    """Refuse arguments that a signature does not take.

    Parameters
    ----------
    name : str
        What is called.
    signature : inspect.Signature
        What it takes.
    values, options
        What it is given by place and by name.
    kind : str
        What to call its arguments: ``"option"``.

    Raises
    ------
    problems.errors.UnknownNameError
        For an unknown name, with the nearest ones.
    problems.errors.InputError
        For values by place that have to be named, one given twice, or one missing.
    """
    taken = signature.parameters
    by_place = [key for key, p in taken.items() if p.kind is not p.KEYWORD_ONLY]
    for option in options:
        if option not in taken:
            raise unknown(f"{kind} of {name}", option, taken)
    if len(values) > len(by_place):
        example = next(key for key in (*taken, "") if key not in by_place and key not in options)
        raise InputError(
            f"{name} takes {f'only {by_place[0]} by place and the rest' if by_place else f'its {kind}s'} "
            f"by name, not {shown(values[len(by_place)])}; write it as in {name}({example or 'name'}=...)."
        )
    given = {*by_place[: len(values)], *options}
    for key in by_place[: len(values)]:
        if key in options:
            raise InputError(f"{name} gets {key} twice, by place and by name; give it once.")
    missing = [key for key, p in taken.items() if p.default is p.empty and key not in given]
    if missing:
        raise InputError(f"{name} needs {', '.join(missing)}; give a value as in {name}({missing[0]}=...).")


def checked(init: Callable[P, R]) -> Callable[P, R]:
    """Make a written ``__init__`` refuse arguments that it does not take by `check`."""
    signature = inspect.signature(init)
    parameters = list(signature.parameters.values())
    own = signature.replace(parameters=parameters[1:])

    @functools.wraps(init)
    def wrapper(*values: P.args, **options: P.kwargs) -> R:
        check(type(values[0]).__name__, own, values[1:], options, "argument")
        return init(*values, **options)

    return wrapper


class Called:
    """Base of frozen dataclasses whose options are checked by `check` before ``__init__`` sees them."""

    def __new__(cls, *values: Any, **options: Any) -> Self:
        check(cls.__name__, _signature(cls), values, options, "option")
        return super().__new__(cls)

    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]:
        # copies and pickles are made by __new__ too
        fields = dataclasses.fields(self)  # type: ignore[arg-type]
        return (), {field.name: getattr(self, field.name) for field in fields if field.init}


@functools.cache
def _signature(cls: type) -> inspect.Signature:
    return inspect.signature(cls)


def bound(
    name: str, signature: inspect.Signature, values: Sequence[Any], options: Mapping[str, Any]
) -> inspect.BoundArguments:
    """Return all arguments of a call, defaults included, checked by their annotations.

    Parameters
    ----------
    name : str
        What is called.
    signature : inspect.Signature
        What it takes. ``float`` is a finite number, ``int`` a whole one, ``str`` a text,
        ``Sequence[float]`` a list of finite numbers (returned as a tuple of floats),
        ``Literal[...]`` one of some words or numbers; each may be ``| None``, and
        ``Annotated`` with `Must`. Other annotations allow everything.
    values, options
        What it is given by place and by name.

    Raises
    ------
    problems.errors.InputError
        For a name that is not taken or is missing (`check`), or a value that is not allowed.
    """
    check(name, signature, values, options, "argument")
    call = signature.bind(*values, **options)
    call.apply_defaults()
    for key, value in call.arguments.items():
        call.arguments[key] = _allowed(name, key, value, signature.parameters[key].annotation)
    return call


def _is_number(value: Any) -> bool:
    """Whether a value is a finite number that a double can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no double holds
        return False


_KINDS = {
    float: Must("a finite number", _is_number),
    int: Must("a whole number", lambda value: isinstance(value, int) and not isinstance(value, bool)),
    str: Must("text", lambda value: isinstance(value, str)),
    Sequence[float]: Must(
        "a list of finite numbers",
        lambda value: isinstance(value, list | tuple) and all(map(_is_number, value)),
    ),
}


def _allowed(name: str, key: str, value: Any, annotation: Any) -> Any:
    """Return an argument as the function gets it, or refuse it."""
    if get_origin(annotation) in (Union, UnionType) and NoneType in get_args(annotation):
        if value is None:
            return None
        others = [option for option in get_args(annotation) if option is not NoneType]
        annotation = others[0] if len(others) == 1 else Any
    if get_origin(annotation) is Literal:
        return _one_of(name, key, value, get_args(annotation))
    kind, *conditions = get_args(annotation) if get_origin(annotation) is Annotated else (annotation,)
    conditions = [must for must in conditions if isinstance(must, Must)]
    if kind in _KINDS:
        conditions.append(_KINDS[kind])
    # The kind is tested first, and the narrowest condition is the one that is told.
    if not all(must.holds(value) for must in reversed(conditions)):
        raise InputError(f"{key}={shown(value)} of {name} must be {conditions[0].be}.")
    return tuple(map(float, value)) if kind == Sequence[float] else value


def _one_of(name: str, key: str, value: Any, known: tuple[Any, ...]) -> Any:
    if any(type(value) is type(word) and value == word for word in known):
        return value
    if all(isinstance(word, str) for word in known):
        raise unknown(f"{key} of {name}", value, known)
    raise InputError(f"{key}={shown(value)} of {name} must be one of {', '.join(map(str, known))}.")
