"""Arguments that a function does not take, or not with these values, told in one sentence."""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ParamSpec, Self, TypeVar

from problems import checks
from problems.errors import InputError, shown, unknown

P = ParamSpec("P")
R = TypeVar("R")
Described = TypeVar("Described", bound=Callable[..., Any])


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


def checked_arguments(init: Callable[P, R]) -> Callable[P, R]:
    """Make a written ``__init__`` check its arguments by its signature; see `bound`."""
    signature = inspect.signature(init)
    parameters = list(signature.parameters.values())
    own = signature.replace(parameters=parameters[1:])

    @functools.wraps(init)
    def wrapper(*values: P.args, **options: P.kwargs) -> R:
        call = bound(type(values[0]).__name__, own, values[1:], options)
        return init(values[0], *call.args, **call.kwargs)  # type: ignore[call-arg]

    return readable(wrapper)


def readable(described: Described) -> Described:
    """Let ``help`` show the names and defaults of a function or class; its docstring has the types."""
    signature, empty = inspect.signature(described), inspect.Signature.empty
    plain = [
        p.replace(annotation=empty, default={} if p.default is checks.NOTHING else p.default)
        for p in signature.parameters.values()
    ]
    described.__signature__ = signature.replace(parameters=plain, return_annotation=empty)
    return described


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
        What it takes; `problems.checks.checked` says what annotations it knows.
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
        found = checks.checked(name, key, value, signature.parameters[key].annotation)
        # A call prints as it was made: e=0, not e=0.0.
        call.arguments[key] = value if type(value) in (int, float) else found
    return call
