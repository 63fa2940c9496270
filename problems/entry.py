"""The decorator that makes a function a problem of the catalogue.

The function's own signature gives the problem's name, its defaults, the checks of
its arguments and the call that it prints as; the decorator adds what people read
and what the tests expect. Nothing else has to know of the problem.
"""

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ParamSpec

from problems.checks import Arguments, checked
from problems.errors import InputError, shown, unknown
from problems.picture import Picture
from problems.problem import Problem

P = ParamSpec("P")


@dataclass(frozen=True, kw_only=True)
class Expected:
    """What was measured of a problem at its default arguments; tests allow 4 times as much.

    Attributes
    ----------
    h : float
        A step at which HBVM(16, 8) resolves it.
    energy : float
        The largest relative energy error in 400 such steps.
    default : float
        The largest relative energy error over the whole integration interval with HBVM().
    until : float, optional
        Where that run ends instead, if doubles cannot hold the whole integration interval.
    small : mapping
        Arguments with which every engine compiles it in a second.
    """

    h: float
    energy: float
    default: float
    until: float | None = None
    small: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What is known of a problem besides its function; see `entry`."""

    title: str | None
    references: Sequence[str]
    notes: str
    shows: Sequence[str]
    picture: Picture | None
    expected: Expected | None


def entry(
    *,
    title: str | None,
    references: Sequence[str],
    notes: str,
    shows: Sequence[str] = (),
    picture: Picture | None = None,
    expected: Expected | None = None,
) -> Callable[[Callable[P, Problem]], Callable[P, Problem]]:
    """Describe a function that takes keyword arguments and returns a `Problem`.

    What the function returns gets its name, prints as the call that made it, and
    says the rest. Its arguments are checked by their annotations before it runs
    (`problems.checks.Arguments`), and refused with an `InputError`; what else must hold, it
    checks itself.

    Parameters
    ----------
    title : str or None
        One line for reports; ``None``: the one that the function gives its `Problem`.
    references : sequence of str
        Where the problem comes from.
    notes : str
        What to know about it, in a sentence.
    shows : sequence of str
        Arguments that are printed, and first, even at their defaults.
    picture : Picture, optional
        How the gallery draws it.
    expected : Expected, optional
        What tests expect; every built-in problem has it.

    Examples
    --------
    >>> from problems import Hamiltonian, Problem
    >>> from problems.checks import Positive
    >>> @entry(title="a rotor", references=(), notes="Turns.")
    ... def rotor(*, p: Positive = 1.0, t_end: float = 10.0) -> Problem:
    ...     return Problem(Hamiltonian(lambda p: p[0] ** 2 / 2, dof=1), q0=[0.0], p0=[p], t_end=t_end)
    >>> rotor(p=2.0)
    rotor(p=2.0)
    >>> rotor(p=-1.0)
    Traceback (most recent call last):
    problems.errors.InputError: p=-1.0 of rotor must be a positive number.
    """
    words = Entry(
        title=checked("entry", "title", title, str | None),
        references=checked("entry", "references", references, Sequence[str]),
        notes=checked("entry", "notes", notes, str),
        shows=checked("entry", "shows", shows, Sequence[str]),
        picture=picture,
        expected=expected,
    )

    def decorate(make: Callable[P, Problem]) -> Callable[P, Problem]:
        name = make.__name__
        taken = Arguments(name, inspect.signature(make, eval_str=True))
        for key, parameter in taken.parameters.items():
            if parameter.kind is not parameter.KEYWORD_ONLY:
                raise InputError(f"{key} of {name} must be taken by name; write def {name}(*, ...).")
        for key in words.shows:
            if key not in taken.parameters:
                raise unknown(f"argument of {name} in shows", key, taken.parameters)

        @functools.wraps(make)
        def factory(*values: P.args, **options: P.kwargs) -> Problem:
            call = taken.bind(values, options)
            problem = make(**call)  # type: ignore[call-arg]
            if not isinstance(problem, Problem):
                raise InputError(f"{name} must return a problems.Problem, not {shown(problem)}.")
            return problem.with_metadata(
                name=name,
                title=words.title or problem.title,
                arguments=taken.printed(call, words.shows),
                references=words.references,
                notes=words.notes,
            )

        vars(factory)["entry"] = words
        return factory

    return decorate
