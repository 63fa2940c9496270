"""Arguments checked by the signature that takes them: of a function, a problem or a method alike.

What must hold of a value stands where its type does::

    def kepler(*, e: Annotated[float, Must("an eccentricity, 0 <= e < 1", lambda e: 0 <= e < 1)] = 0.6): ...

    class Leapfrog(MethodBase):
        h: Positive
        order: Literal[2, 4, 6, 8] = 2

`Arguments` reads that from a signature: which names there are, what their values must be, and which
of them a call is printed with. `checked_arguments` puts it before a function or an ``__init__``,
`CheckedOptions` before a frozen dataclass and all that inherit from it.
"""

import functools
import inspect
import math
import operator
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    ParamSpec,
    Self,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    overload,
)

import numpy as np
from numpy.typing import ArrayLike

from problems.errors import InputError, shown, unknown
from problems.quantities import refuse_more_than_numbers

T = TypeVar("T")
P = ParamSpec("P")
R = TypeVar("R")
Described = TypeVar("Described", bound=Callable[..., Any])
EMPTY = inspect.Parameter.empty


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


@dataclass(frozen=True)
class Word:
    """A name that is looked up later: what is no text is refused as an unknown one of its kind."""

    kind: str
    known: Sequence[str]

    def checked(self, owner: str, name: str, value: Any) -> str | None:
        if not isinstance(value, str | None):
            raise unknown(self.kind, value, self.known)
        return value


class _File:
    def __repr__(self) -> str:
        return "a path of a file"

    def checked(self, owner: str, name: str, value: Any) -> Path:
        try:
            path = Path(value)
        except TypeError:
            path = None
        if path is None or "\0" in str(path):
            raise refusal(owner, name, value, "a path of a file, such as 'pendulum.npz'")
        return path


File = Annotated[str | os.PathLike[str], _File()]
"""A path of a file, from text or something path-like; returned as a `pathlib.Path`."""


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
    if kind in (float, int, Sequence[float]) and not isinstance(value, bool):
        refuse_more_than_numbers(f"{name}={shown(value)} of {owner}", value)
    result = read(value)
    if (words and result is None) or not all(must.holds(result) for must in conditions):
        # The narrowest condition is the one that is told.
        raise refusal(owner, name, value, conditions[0].be if conditions else words)
    return result


def _allows_everything(annotation: Any) -> bool:
    """Whether `checked` returns any value as it is."""
    if get_origin(annotation) in (Union, UnionType):
        kinds = [option for option in get_args(annotation) if option is not NoneType]
        return len(kinds) > 1 or _allows_everything(kinds[0])
    return get_origin(annotation) not in (Annotated, Literal) and annotation not in _KINDS


def refusal(owner: str, name: str, value: Any, words: str) -> InputError:
    """Return the error for a value that is not what ``words`` say."""
    return InputError(f"{name}={shown(value)} of {owner} must be {words}.")


def number(value: Any) -> float | None:
    """Return a finite number as a float, one of NumPy's too; ``None`` for anything else."""
    try:
        wrong = isinstance(value, bool | np.bool_ | str | bytes) or np.ndim(value)
        result = math.nan if wrong else float(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return result if math.isfinite(result) else None


def numbers(value: Any) -> tuple[float, ...] | None:
    """Return a list, an array or a series of finite numbers as a tuple; ``None`` for anything else."""
    listed = value.tolist() if hasattr(value, "tolist") else value
    results = [number(each) for each in listed] if isinstance(listed, list | tuple | range) else [None]
    return None if None in results else tuple(results)  # type: ignore[return-value]


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
    if (choice := whole(value)) not in known:
        raise refusal(owner, name, value, f"one of {', '.join(map(str, known))}")
    return choice


class Arguments:
    """What a call may give to a function or a class, by the signature of that.

    Parameters
    ----------
    name : str
        What is called.
    signature : inspect.Signature
        What it takes; `checked` says which annotations it knows.
    kind : str
        What messages call its arguments: ``"option"``.
    owner : str, optional
        What a message calls the owner of a wrong value; ``name`` by default.
    """

    def __init__(
        self, name: str, signature: inspect.Signature, kind: str = "argument", owner: str | None = None
    ) -> None:
        self.name, self.kind, self.owner = name, kind, owner or name
        self.signature = signature
        self.parameters = signature.parameters
        self._defaults: dict[str, Any] = {}
        self._by_place = [
            key for key, parameter in self.parameters.items() if parameter.kind is not parameter.KEYWORD_ONLY
        ]
        self._needed = [key for key, parameter in self.parameters.items() if parameter.default is EMPTY]
        # Values by place, and none by name, that are a call.
        self._enough = max((1 + [*self.parameters].index(key) for key in self._needed), default=0)
        self._free = {
            key for key, parameter in self.parameters.items() if _allows_everything(parameter.annotation)
        }

    def check_names(self, values: Sequence[Any], options: Mapping[str, Any]) -> None:
        """Refuse what the signature does not take.

        Parameters
        ----------
        values, options
            What is given by place and by name.

        Raises
        ------
        problems.errors.UnknownNameError
            For an unknown name, with the nearest ones.
        problems.errors.InputError
            For values by place that have to be named, one given twice, or one missing.
        """
        name, by_place = self.name, self._by_place
        if not options and self._enough <= len(values) <= len(by_place):
            return
        for option in options:
            if option not in self.parameters:
                raise unknown(f"{self.kind} of {name}", option, self.parameters)
        if len(values) > len(by_place):
            example = next(
                key for key in (*self.parameters, "") if key not in by_place and key not in options
            )
            raise InputError(
                f"{name} takes {self._places()} by name, not {shown(values[len(by_place)])}; "
                f"write it as in {name}({example}=...)."
            )
        placed = by_place[: len(values)]
        for key in placed:
            if key in options:
                raise InputError(f"{name} gets {key} twice, by place and by name; give it once.")
        missing = [key for key in self._needed if key not in placed and key not in options]
        if missing:
            raise InputError(
                f"{name} needs {', '.join(missing)}; give a value as in {name}({missing[0]}=...)."
            )

    def _places(self) -> str:
        return (
            f"only {', '.join(self._by_place)} by place and the rest"
            if self._by_place
            else f"its {self.kind}s"
        )

    def value(self, key: str, value: Any) -> Any:
        """Return the value of one argument in the form in which it is used, or refuse it; see `checked`."""
        parameter = self.parameters[key]
        if value is not parameter.default:
            return checked(self.owner, key, value, parameter.annotation)
        if key not in self._defaults:  # a default is checked once, not in every call
            self._defaults[key] = checked(self.owner, key, value, parameter.annotation)
        return self._defaults[key]

    @functools.cached_property
    def _unchecked(self) -> dict[str, Any]:
        """The arguments in their order, with the defaults as a call gets them."""
        return {
            key: EMPTY if parameter.default is EMPTY else self._used(key, parameter.default)
            for key, parameter in self.parameters.items()
        }

    def _used(self, key: str, value: Any) -> Any:
        if key in self._free:
            return value
        result = self.value(key, value)
        # A call prints as it was made: e=0, not e=0.0.
        return value if type(value) in (int, float) else result

    def bind(self, values: Sequence[Any], options: Mapping[str, Any]) -> dict[str, Any]:
        """Return all arguments of a call by name, defaults included, checked.

        Raises
        ------
        problems.errors.InputError
            For a name that is not taken or is missing (`check_names`), or a value that is not allowed.
        """
        self.check_names(values, options)
        call = self._unchecked.copy()
        for key, value in (*zip(self._by_place, values, strict=False), *options.items()):
            call[key] = value if key in self._free else self._used(key, value)
        return call

    def printed(self, values: Mapping[str, Any], first: Iterable[str] = ()) -> dict[str, Any]:
        """Return what a call is printed with: ``first``, then what differs from its default."""
        changed = (
            key
            for key, parameter in self.parameters.items()
            if parameter.default is EMPTY or values[key] != parameter.default
        )
        return {key: values[key] for key in (*first, *changed)}


@overload
def checked_arguments(function: Callable[P, R], /) -> Callable[P, R]: ...
@overload
def checked_arguments(*, owner: str) -> Callable[[Callable[P, R]], Callable[P, R]]: ...
def checked_arguments(function: Any = None, /, *, owner: str | None = None) -> Any:
    """Make a function, or a written ``__init__``, check its arguments by its signature.

    Parameters
    ----------
    function : callable
        An ``__init__`` is called by the name of its class.
    owner : str, optional
        What messages call the owner of a wrong value; the function's name by default.
    """
    if function is None:
        return functools.partial(_checking, owner=owner)
    return _checking(function, None)


def _checking(function: Callable[P, R], owner: str | None) -> Callable[P, R]:
    signature = inspect.signature(function)
    names = list(signature.parameters)
    bound = int(names[:1] == ["self"])  # a method's own object is no argument of a call
    own = signature.replace(parameters=list(signature.parameters.values())[bound:])
    makes = function.__name__ == "__init__"

    @functools.cache
    def arguments(name: str) -> Arguments:
        return Arguments(name, own, owner=owner)

    @functools.wraps(function)
    def wrapper(*values: P.args, **options: P.kwargs) -> R:
        taken = arguments(type(values[0]).__name__ if makes else function.__name__)
        return function(*values[:bound], **taken.bind(values[bound:], options))  # type: ignore[call-arg]

    return readable(wrapper)


def readable(described: Described) -> Described:
    """Let ``help`` show the types of a function or class by their names."""
    described.__signature__ = _shown(inspect.signature(described))
    return described


def _shown(signature: inspect.Signature) -> inspect.Signature:
    """Return a signature with the names of types, and without what must hold of the values."""
    parameters = [
        parameter.replace(
            annotation=EMPTY if parameter.annotation is EMPTY else _Name(parameter.annotation),
            default={} if parameter.default is NOTHING else parameter.default,
        )
        for parameter in signature.parameters.values()
    ]
    returned = signature.return_annotation
    return signature.replace(
        parameters=parameters, return_annotation=EMPTY if returned is EMPTY else _Name(returned)
    )


class _Name:
    """A type as ``help`` writes it: ``float | None``, ``Sequence[float]``, ``ArrayLike``."""

    def __init__(self, annotation: Any) -> None:
        self._text = _named(annotation)

    def __repr__(self) -> str:
        return self._text


_ARRAY_LIKE = frozenset(get_args(ArrayLike))


def _named(annotation: Any) -> str:
    if isinstance(annotation, list):  # the arguments of a Callable
        return f"[{', '.join(map(_named, annotation))}]"
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation is None or annotation is NoneType:
        return "None"
    if origin is Annotated:
        return _named(parts[0])
    if origin in (Union, UnionType):
        like = _ARRAY_LIKE.issubset(parts)
        rest = [part for part in parts if not like or part not in _ARRAY_LIKE]
        return " | ".join(["ArrayLike"] * like + [_named(part) for part in rest])
    if origin is Literal:
        return f"Literal[{', '.join(map(repr, parts))}]"
    if origin is np.ndarray:
        return "ndarray"
    if origin is not None:
        inner = ", ".join("..." if part is ... else _named(part) for part in parts)
        return f"{origin.__name__}[{inner}]"
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", repr(annotation))


class _OfFields:
    """The signature of a class of options: its fields, with their types and defaults."""

    def __get__(self, instance: object, cls: type) -> inspect.Signature:
        return _shown(_signature(cls))


class CheckedOptions:
    """Base of frozen dataclasses whose options are checked by the annotations of their fields.

    Names are checked before ``__init__`` sees them, values after. ``_owner`` is what messages call
    the owner of a wrong value; the name of the class by default.
    """

    _owner: ClassVar[str | None] = None
    __signature__ = _OfFields()

    def __new__(cls, *values: Any, **options: Any) -> Self:
        _of_fields(cls).check_names(values, options)
        return super().__new__(cls)

    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]:
        # copies and pickles are made by __new__ too
        return (), self._values()

    def _values(self) -> dict[str, Any]:
        return {key: getattr(self, key) for key in _of_fields(type(self)).parameters}

    def _printed(self) -> dict[str, Any]:
        return _of_fields(type(self)).printed(self._values())

    def __post_init__(self) -> None:
        arguments = _of_fields(type(self))
        for key, value in self._values().items():
            object.__setattr__(self, key, arguments.value(key, value))


def _signature(cls: type) -> inspect.Signature:
    whole = inspect.signature(cls.__init__)
    return inspect.Signature(list(whole.parameters.values())[1:])


@functools.cache
def _of_fields(cls: type[CheckedOptions]) -> Arguments:
    """Return what a dataclass takes; annotations that are text are read where they were written."""
    signature, known = _signature(cls), get_type_hints(cls, include_extras=True)
    taken = [
        parameter.replace(annotation=known[parameter.name]) for parameter in signature.parameters.values()
    ]
    return Arguments(cls.__name__, signature.replace(parameters=taken), "option", cls._owner)
