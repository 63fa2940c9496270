"""The errors a user can cause: one sentence that names the value and the fix."""

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """Something the user gave cannot be used; the command line exits with code 2."""


class UnknownNameError(InputError):
    """A name (problem, method, option, parameter, metric) that does not exist."""


class MissingLibraryError(InputError, ImportError):
    """A library that a method needs is not installed."""


def unknown(kind: str, name: str, known: Iterable[str]) -> UnknownNameError:
    """Build the error for an unknown name, with the nearest known names.

    Parameters
    ----------
    kind : str
        What the name should have named: ``"problem"``, ``"method"``, ...
    name : str
        The name that was given.
    known : iterable of str
        The names that exist.

    Returns
    -------
    UnknownNameError
        To be raised by the caller.
    """
    names = sorted(known)
    folded = {candidate.casefold(): candidate for candidate in names}
    near = [folded[match] for match in get_close_matches(name.casefold(), folded, n=3, cutoff=0.5)]
    if near:
        hint = "did you mean " + " or ".join(repr(candidate) for candidate in near) + "?"
    elif names:
        hint = "known: " + ", ".join(names) + "."
    else:
        hint = "there are none."
    return UnknownNameError(f"unknown {kind} {name!r}; {hint}")
