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
    Literal,
    ParamSpec,
    Self,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
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

File = str | os.PathLike[str]
"""A path of a file, from text or something path-like; returned as a `pathlib.Path`."""

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
        too; ``bool``, ``str``, `File`, ``Sequence[float]`` or ``Sequence[str]`` (a list, returned as
        a tuple), ``Literal[...]`` one of some words or numbers; each may be ``| None``, and
        ``Annotated`` with `Must`, or with an object whose method ``checked(owner, name,
        value)`` takes the place of the type. Any other annotation allows everything.

    Raises
    ------
    problems.errors.InputError
        One sentence: the value, and what it must be.
    """
    kind = _without_none(annotation)
    if value is None and kind != annotation:
        return None
    conditions: list[Any] = []
    if get_origin(kind) is Annotated:
        kind, *conditions = get_args(kind)
    for condition in conditions:
        if hasattr(condition, "checked"):
            return condition.checked(owner, name, value)
    if get_origin(kind) is Literal:
        return _one_of(owner, name, value, get_args(kind))
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
    kind = _without_none(annotation)
    return get_origin(kind) not in (Annotated, Literal) and kind not in _KINDS


def _without_none(annotation: Any) -> Any:
    if get_origin(annotation) not in (Union, UnionType):
        return annotation
    return Union[tuple(kind for kind in get_args(annotation) if kind is not NoneType)]  # noqa: UP007


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


def _path(value: Any) -> Path | None:
    return Path(value) if isinstance(value, str | os.PathLike) and "\0" not in str(value) else None


_KINDS: dict[Any, tuple[str, Callable[[Any], Any]]] = {
    float: ("a finite number", number),
    int: ("a whole number", whole),
    bool: ("True or False", _flag),
    str: ("text", _text),
    File: ("a path of a file, such as 'pendulum.npz'", _path),
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
        What it takes; `checked` says which annotations it knows. Defaults are taken as they are.
    kind : str
        What messages call its arguments: ``"option"``.
    """

    def __init__(self, name: str, signature: inspect.Signature, kind: str = "argument") -> None:
        self.name, self.kind = name, kind
        self.parameters = signature.parameters
        self._defaults = {key: parameter.default for key, parameter in self.parameters.items()}
        self._by_place = [key for key, each in self.parameters.items() if each.kind is not each.KEYWORD_ONLY]
        self._needed = {key for key, default in self._defaults.items() if default is EMPTY}
        self._free = {key for key, each in self.parameters.items() if _allows_everything(each.annotation)}

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
        for option in options:
            if option not in self.parameters:
                raise unknown(f"{self.kind} of {name}", option, self.parameters)
        if len(values) > len(by_place):
            free = [key for key in self.parameters if key not in by_place and key not in options]
            taken = f"only {', '.join(by_place)} by place and the rest" if by_place else f"its {self.kind}s"
            raise InputError(
                f"{name} takes {taken} by name, not {shown(values[len(by_place)])}; "
                f"write it as in {name}({(*free, '')[0]}=...)."
            )
        given = {*options, *by_place[: len(values)]}
        if len(given) < len(values) + len(options):
            twice = next(key for key in by_place if key in options)
            raise InputError(f"{name} gets {twice} twice, by place and by name; give it once.")
        if not self._needed <= given:
            missing = [key for key in self.parameters if key in self._needed - given]
            raise InputError(
                f"{name} needs {', '.join(missing)}; give a value as in {name}({missing[0]}=...)."
            )

    def value(self, key: str, value: Any) -> Any:
        """Return the value of one argument in the form in which it is used, or refuse it; see `checked`."""
        if value is self._defaults[key]:
            return value
        return checked(self.name, key, value, self.parameters[key].annotation)

    def bind(self, values: Sequence[Any], options: Mapping[str, Any]) -> dict[str, Any]:
        """Return all arguments of a call by name, defaults included, checked.

        Raises
        ------
        problems.errors.InputError
            For a name that is not taken or is missing (`check_names`), or a value that is not allowed.
        """
        self.check_names(values, options)
        call = self._defaults.copy()
        for key, value in (*zip(self._by_place, values, strict=False), *options.items()):
            result = value if key in self._free else self.value(key, value)
            call[key] = value if type(value) in (int, float) else result  # it prints as it was made: e=0
        return call

    def printed(self, values: Mapping[str, Any], first: Iterable[str] = ()) -> dict[str, Any]:
        """Return what a call is printed with: ``first``, then what differs from its default."""
        changed = (
            key for key, default in self._defaults.items() if default is EMPTY or values[key] != default
        )
        return {key: values[key] for key in (*first, *changed)}


def checked_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function, or a written ``__init__``, check its arguments by its signature.

    An ``__init__`` is called by the name of its class.
    """
    signature = inspect.signature(function)
    names = list(signature.parameters)
    bound = int(names[:1] == ["self"])  # a method's own object is no argument of a call
    own = signature.replace(parameters=list(signature.parameters.values())[bound:])
    *_, name = function.__qualname__.removesuffix(".__init__").split(".")
    taken = Arguments(name, own)

    @functools.wraps(function)
    def wrapper(*values: P.args, **options: P.kwargs) -> R:
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
            annotation=_named(parameter.annotation),
            default={} if parameter.default is NOTHING else parameter.default,
        )
        for parameter in signature.parameters.values()
    ]
    return signature.replace(parameters=parameters, return_annotation=_named(signature.return_annotation))


class _Name(str):
    """A type as ``help`` writes it, without quotes."""

    __slots__ = ()
    __repr__ = str.__str__


_ARRAY_LIKE = frozenset(get_args(ArrayLike))


def _named(annotation: Any) -> Any:
    """Return the name of a type: ``float | None``, ``Sequence[float]``, ``ArrayLike``."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation is EMPTY:
        return EMPTY
    if isinstance(annotation, list):  # the arguments of a Callable
        return _Name(f"[{', '.join(map(_named, annotation))}]")
    if origin is Annotated:
        return _named(parts[0])
    if origin in (Union, UnionType):
        like = _ARRAY_LIKE.issubset(parts)
        others = (_named(part) for part in parts if not like or part not in _ARRAY_LIKE)
        return _Name(" | ".join([*["ArrayLike"] * like, *others]))
    if origin is Literal:
        return _Name(str(annotation).removeprefix("typing."))
    if origin is None or origin is np.ndarray:
        kind = origin or annotation
        return _Name("None" if kind in (None, NoneType) else getattr(kind, "__name__", kind))
    inner = ", ".join("..." if part is ... else _named(part) for part in parts)
    return _Name(f"{origin.__name__}[{inner}]")


class _OfFields:
    """The signature of a class of options: its fields, with their types and defaults."""

    def __get__(self, instance: object, cls: type) -> inspect.Signature:
        return _shown(_signature(cls))


class CheckedOptions:
    """Base of frozen dataclasses whose options are checked by the annotations of their fields.

    Names are checked before ``__init__`` sees them, values after.
    """

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
    taken = [each.replace(annotation=known[each.name]) for each in signature.parameters.values()]
    return Arguments(cls.__name__, signature.replace(parameters=taken), "option")
