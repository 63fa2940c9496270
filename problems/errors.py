"""Exceptions for errors in the input: one sentence that names the value and the fix."""

import math
import re
import reprlib
from collections.abc import Iterable
from difflib import get_close_matches

# They command a terminal, or turn the direction in which a line is read.
_COMMANDS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")


class InputError(ValueError):
    """Invalid input; the command line exits with code 2.

    Examples
    --------
    >>> import problems
    >>> try:
    ...     problems.load("kepler", e=1.5)
    ... except problems.InputError as error:
    ...     print(error)
    e=1.5 of kepler must be an eccentricity, 0 <= e < 1.
    """


class UnknownNameError(InputError):
    """A name (problem, method, option, parameter, metric) that does not exist.

    Examples
    --------
    >>> import problems
    >>> try:
    ...     problems.load("keplr")
    ... except problems.UnknownNameError as error:
    ...     print(error)
    unknown problem 'keplr'; did you mean 'kepler'?
    """


class MissingLibraryError(InputError, ImportError):
    """A library that a method needs is not installed.

    Examples
    --------
    >>> import problems
    >>> issubclass(problems.MissingLibraryError, problems.InputError)
    True
    """


def printable(text: str) -> str:
    """Return text without the characters that command a terminal; line ends and tabs stay."""
    return _COMMANDS.sub("", text)


def shown(value: object, longest: int = 80) -> str:
    """Return a value as a message shows it: on one line, and not longer than ``longest`` characters."""
    if isinstance(value, int) and abs(value) >= 10**20:
        return f"{'-' if value < 0 else ''}{large(abs(value))}"
    try:
        text = re.sub(r" at 0x[0-9a-fA-F]+", "", " ".join(_brief(longest).repr(value).split()))
    except Exception:  # a value's own repr may fail
        text = f"something of type {type(value).__name__}"
    return text if len(text) <= longest else text[: longest - 3] + "..."


def _brief(longest: int) -> reprlib.Repr:
    """Return what makes a text that begins as ``repr`` does and is not much longer than ``longest``."""
    printer = reprlib.Repr()
    printer.maxlist = printer.maxtuple = printer.maxdict = printer.maxset = printer.maxfrozenset = longest
    printer.maxdeque = printer.maxarray = longest
    printer.maxstring = printer.maxlong = printer.maxother = 10 * longest
    return printer


def large(number: int) -> str:
    """Return the size of a number that no double may hold."""
    return f"about 1e{math.log10(number):.0f}"


def unknown(kind: str, name: object, known: Iterable[str]) -> UnknownNameError:
    """Build the error for an unknown name, with the nearest known names.

    Parameters
    ----------
    kind : str
        What the name should have named: ``"problem"``, ``"method"``, ...
    name : object
        The name that was given; anything, where that is no text.
    known : iterable of str
        The names that exist.

    Returns
    -------
    UnknownNameError
        To be raised by the caller.
    """
    names = sorted(known)
    folded = {candidate.casefold(): candidate for candidate in names}
    given = "" if name is None else (name if isinstance(name, str) else shown(name)).casefold()[:80]
    near = [folded[match] for match in get_close_matches(given, folded, n=3, cutoff=0.5)]
    if near:
        hint = "did you mean " + " or ".join(repr(candidate) for candidate in near) + "?"
    elif names:
        hint = "known: " + ", ".join(names) + "."
    else:
        hint = "there are none."
    return UnknownNameError(f"unknown {kind} {shown(name)}; {hint}")
