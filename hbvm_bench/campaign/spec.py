"""A problem or a method as a user types it: one call with literal keyword arguments.

``kepler(e=0.6)``, ``HBVM(k=16, s=8, h=0.25)`` and a bare ``IAS15`` are
specifications. They are parsed with `ast` against a whitelist of nodes and
never evaluated, so that a campaign file or a command line cannot run code. In
``mine.py:swing(g=1.1)`` the name is that of a function in a Python file, which
`hbvm_bench.campaign.own` reads where that was asked for; in ``peers.alone:Taylor()`` it is that of a method
in a module of `hbvm_bench.studies`.
"""

import ast
import re
import sys
import warnings
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from problems.errors import InputError

LONGEST = 4000  # characters; a specification is one line of text
DEEPEST = 8  # nesting of lists in an argument
_FILE = re.compile(r"\s*(?P<file>[^\s()'\"][^()'\"]*\.py(@\w+)?):")
_STUDY = re.compile(r"\s*(?P<file>[a-z_]+(\.[a-z_]+)*):")


@dataclass(frozen=True)
class Spec:
    """A name and its keyword arguments.

    Attributes
    ----------
    name : str
        Name of a problem or a method in its registry, ``"mine.py:swing"``, or ``"peers.alone:Taylor"``.
    arguments : dict
        Values by argument name: numbers, strings, booleans, ``None`` and
        tuples of these.
    """

    name: str
    arguments: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        inside = ", ".join(f"{name}={value!r}" for name, value in self.arguments.items())
        return f"{self.name}({inside})"


@lru_cache(maxsize=100_000)  # a large campaign asks for each of its texts a dozen times
def parse_spec(text: str) -> Spec:
    """Read one specification.

    Parameters
    ----------
    text : str
        ``"HBVM(k=16, s=8, h=0.25)"``, ``"IAS15()"``, ``"IAS15"`` or ``"mine.py:swing(g=1.1)"``.

    Returns
    -------
    Spec
        ``str(spec)`` is its canonical text, and parses back to an equal one.

    Raises
    ------
    problems.errors.InputError
        If the text is anything else; the message names the column.
    """
    if len(text) > LONGEST:
        raise InputError(f"a specification of {len(text)} characters is too long; at most {LONGEST}.")
    if (match := _FILE.match(text) or _STUDY.match(text)) is not None:
        call = parse_spec(text[match.end() :])
        return Spec(f"{match['file']}:{call.name}", call.arguments)
    line = "".join(" " if character.isspace() else character for character in text)  # columns stay
    if not line.strip():
        raise InputError('an empty specification; write a name or a call such as "HBVM(k=4, s=2, h=0.1)".')
    margin = len(line) - len(line.lstrip())
    try:
        with warnings.catch_warnings(action="ignore", category=SyntaxWarning):
            tree = ast.parse(line.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        column = margin + (getattr(error, "offset", None) or 1)
        raise _refused(line, column, "this is not one call with keyword arguments") from None
    if isinstance(tree, ast.Name):
        return Spec(tree.id)
    if not isinstance(tree, ast.Call):
        raise _at(line, tree, "expected a name or one call")
    if not isinstance(tree.func, ast.Name):
        raise _at(line, tree.func, "the name must be one word")
    if tree.args:
        raise _at(line, tree.args[0], "arguments are given by name, as in h=0.1")
    arguments: dict[str, Any] = {}
    for keyword in tree.keywords:
        if keyword.arg is None:
            raise _at(line, keyword.value, "** is not allowed")
        if keyword.arg in arguments:  # ast.parse leaves repeated keywords to the compiler
            raise _at(line, keyword, f"{keyword.arg!r} is given twice")
        arguments[keyword.arg] = _literal(line, keyword.value, DEEPEST)
    return Spec(tree.func.id, arguments)


def file_of(text: str) -> str:
    """Return the Python file that a specification names, ``""`` where it names none."""
    match = _FILE.match(text)
    return "" if match is None else match["file"]


def _literal(line: str, node: ast.expr, depth: int) -> Any:
    match node:
        case ast.Constant(value=bool() | str() | None as value):
            return value
        case ast.Constant(value=int() | float() as number):
            return _finite(line, node, number)
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as number)):
            return -_finite(line, node, number)
        case ast.UnaryOp(op=ast.UAdd(), operand=ast.Constant(value=int() | float() as number)):
            return _finite(line, node, number)
        case ast.List(elts=elements) | ast.Tuple(elts=elements):
            if depth == 0:
                raise _at(line, node, "lists are nested too deep")
            return tuple(_literal(line, element, depth - 1) for element in elements)
    raise _at(line, node, "a value is a number, a string, True, False, None or a list of these")


def _finite(line: str, node: ast.expr, number: float) -> float:
    if isinstance(number, bool):
        raise _at(line, node, "a sign needs a number")
    if not abs(number) <= sys.float_info.max:  # also where an integer has no double
        raise _at(line, node, "the number is too large for a double")
    return number


def _at(line: str, node: ast.expr | ast.keyword, reason: str) -> InputError:
    # ast counts columns in UTF-8 bytes of the stripped text; a user counts characters of the whole
    margin = len(line) - len(line.lstrip())
    before = line.strip().encode()[: node.col_offset].decode(errors="ignore")
    return _refused(line, margin + len(before) + 1, reason)


def _refused(line: str, column: int, reason: str) -> InputError:
    shown = " ".join(line.split())
    shown = shown if len(shown) <= 120 else shown[:117] + "..."
    return InputError(f"cannot read {shown!r}: {reason} (column {column}).")
