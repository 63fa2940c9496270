"""Formulas as text, such as ``"p^2/2 - cos(q)"``: parsed by a whitelist, never evaluated.

The text is read with Python's `ast` module. Numbers, names, ``+ - * /``, powers
(``^`` or ``**``) with a number as exponent, parentheses and the functions sqrt, sin,
cos, tan, exp, log and abs of one argument are all there is; everything else is
refused with the column where it stands.
"""

import ast
import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from problems.errors import InputError, unknown

LONGEST = 4000  # characters
DEEPEST = 60  # nesting of parentheses, functions and signs
LARGEST_POWER = 100
FUNCTIONS = ("sqrt", "sin", "cos", "tan", "exp", "log", "abs")
COORDINATE = re.compile(r"([qp])([1-9][0-9]*)?")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Number:
    """A number, all arithmetic with plain numbers carried out."""

    value: float


@dataclass(frozen=True)
class Name:
    """A coordinate, the time, or a parameter."""

    word: str


@dataclass(frozen=True)
class Negative:
    """Minus a formula."""

    inner: "Formula"


@dataclass(frozen=True)
class Chain:
    """A first operand, then operators with theirs, from left to right."""

    first: "Formula"
    steps: tuple[tuple[str, "Formula"], ...]


@dataclass(frozen=True)
class Power:
    """A formula to an integer or half-integer power."""

    base: "Formula"
    exponent: float


@dataclass(frozen=True)
class Call:
    """One of `FUNCTIONS` of a formula."""

    function: str
    argument: "Formula"


Formula = Number | Name | Negative | Chain | Power | Call


@dataclass(frozen=True)
class Expression:
    """A parsed formula.

    Attributes
    ----------
    text : str
        As it was given.
    names : tuple of str
        The coordinates and other names in it, in the order in which they appear.
    formula : Number, Name, Negative, Chain, Power or Call
        What the text says.
    """

    text: str
    names: tuple[str, ...]
    formula: Formula

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names that are positions or momenta."""
        return tuple(name for name in self.names if COORDINATE.fullmatch(name))

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names that must be parameters."""
        return tuple(name for name in self.names if name != "t" and not COORDINATE.fullmatch(name))


def parse(text: str) -> Expression:
    """Read one formula.

    Parameters
    ----------
    text : str
        Such as ``"(p1^2 + p2^2)/2 + k*(q1^2 + q2^2)/2"``.

    Raises
    ------
    problems.errors.InputError
        If the text is anything else than a formula; the message names the column.
    """
    return _Reader(text).expression()


class _Reader:
    """Checks a text; keeps what is needed to name columns of the text as it was given."""

    def __init__(self, text: str) -> None:
        if not isinstance(text, str):
            raise InputError(f'a formula is text, such as "p^2/2 - cos(q)", not {text!r}.')
        if len(text) > LONGEST:
            raise InputError(f"a formula of {len(text)} characters is too long; at most {LONGEST}.")
        self.given = text
        self.columns: list[int] = []  # for each character of the Python text, the column in the given one
        pieces: list[str] = []
        for column, character in enumerate(text, start=1):
            if not character.isascii() or not (character.isprintable() or character in "\t\n\r"):
                raise self.refused(column, f"{character!r} has no meaning in a formula")
            piece = "**" if character == "^" else " " if character.isspace() else character
            pieces.append(piece)
            self.columns += [column] * len(piece)
        self.python = "".join(pieces)
        if not self.python.strip():
            raise InputError('an empty formula; write one such as "p^2/2 - cos(q)".')
        self.names: dict[str, None] = {}

    def refused(self, column: int, what: str) -> InputError:
        shown = " ".join(self.given.split())
        shown = shown if len(shown) <= 120 else shown[:117] + "..."
        return InputError(f"cannot read the formula {shown!r}: {what} (column {column}).")

    def at(self, node: ast.AST, what: str) -> InputError:
        margin = len(self.python) - len(self.python.lstrip())
        offset = margin + int(getattr(node, "col_offset", 0))
        return self.refused(self.columns[min(offset, len(self.columns) - 1)], what)

    def expression(self) -> Expression:
        self._comments()
        try:
            with warnings.catch_warnings(action="ignore", category=SyntaxWarning):
                tree = ast.parse(self.python.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            margin = len(self.python) - len(self.python.lstrip())
            # Python counts from 1, and says 0 where the text ends too soon.
            offset = margin + (getattr(error, "offset", None) or len(self.python.strip())) - 1
            column = self.columns[min(offset, len(self.columns) - 1)]
            raise self.refused(column, "this is not a formula; write products with *") from None
        formula = self._formula(tree, 0)
        return Expression(self.given, tuple(self.names), formula)

    def _comments(self) -> None:
        for character in "#\\;=@":
            if character in self.python:
                column = self.columns[self.python.index(character)]
                raise self.refused(column, f"{character!r} has no meaning in a formula")

    def _formula(self, node: ast.expr, depth: int) -> Formula:
        if depth > DEEPEST:
            raise self.at(node, f"the formula is nested deeper than {DEEPEST}")
        spine: list[ast.BinOp] = []  # a long sum leans to the left: walked, not descended
        while isinstance(node, ast.BinOp) and not isinstance(node.op, ast.Pow):
            if type(node.op) not in _OPERATORS:
                raise self.at(node, "only + - * / and powers are allowed")
            spine.append(node)
            node = node.left
        first = self._operand(node, depth)
        steps: list[tuple[str, Formula]] = []
        for parent in reversed(spine):
            symbol, right = _OPERATORS[type(parent.op)], self._formula(parent.right, depth + 1)
            if right == Number(0.0) and symbol == "/":
                raise self.at(parent.right, "this divides by 0")
            if isinstance(first, Number) and isinstance(right, Number) and not steps:
                first = self._number(parent, applied(symbol, first.value, right.value))
            else:
                steps.append((symbol, right))
        return Chain(first, tuple(steps)) if steps else first

    def _operand(self, node: ast.expr, depth: int) -> Formula:
        match node:
            case ast.Constant(value=bool()):
                raise self.at(node, "True and False are not numbers")
            case ast.Constant(value=int() | float() as value):
                return self._number(node, value)
            case ast.Name(id="pi"):
                return Number(math.pi)
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
                inner = self._formula(operand, depth + 1)
                if isinstance(sign, ast.UAdd):
                    return inner
                return Number(-inner.value) if isinstance(inner, Number) else Negative(inner)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                base, exponent = self._formula(left, depth + 1), self._exponent(right, depth)
                if isinstance(base, Number):
                    return self._number(node, _evaluated(lambda: math.pow(base.value, exponent)))
                return Power(base, exponent)
            case ast.Call(func=ast.Name(id=name), args=[only], keywords=[]) if name in FUNCTIONS:
                argument = self._formula(only, depth + 1)
                if isinstance(argument, Number):
                    function = getattr(math, {"abs": "fabs"}.get(name, name))
                    return self._number(node, _evaluated(lambda: function(argument.value)))
                return Call(name, argument)
        raise self.at(node, _why_not(node))

    def _number(self, node: ast.expr, value: Any) -> Number:
        if not _is_finite(value):
            raise self.at(node, "this is not a number that a double can hold")
        return Number(float(value))

    def _name(self, node: ast.expr, name: str) -> Name:
        if not NAME.fullmatch(name):
            raise self.at(node, f"{name!r} is not a name of letters and digits")
        if name in FUNCTIONS:
            raise self.at(node, f"{name} needs an argument, as in {name}(q)")
        self.names[name] = None
        return Name(name)

    def _exponent(self, node: ast.expr, depth: int) -> float:
        exponent = self._formula(node, depth + 1)
        if not isinstance(exponent, Number):
            raise self.at(
                node, "an exponent must be a number such as 2, -1, 0.5 or (3/2); write x^a as exp(a*log(x))"
            )
        if abs(exponent.value) > LARGEST_POWER:
            raise self.at(node, f"the power is larger than {LARGEST_POWER}")
        if not (2 * exponent.value).is_integer():
            raise self.at(node, "an exponent must be an integer or half an integer")
        return exponent.value


_OPERATORS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


def applied(symbol: str, left: Any, right: Any) -> Any:
    """Return ``left symbol right``."""
    match symbol:
        case "+":
            return left + right
        case "-":
            return left - right
        case "*":
            return left * right
    return left / right


def _evaluated(compute: Callable[[], float]) -> float:
    try:
        return compute()
    except (ValueError, OverflowError):  # outside the function's domain, or too large
        return math.nan


def _why_not(node: ast.expr) -> str:
    match node:
        case ast.Call(func=ast.Name(id=name)) if name in FUNCTIONS:
            return f"{name} takes one argument"
        case ast.Call(func=ast.Name(id=name)):
            return str(unknown("function", name, FUNCTIONS)).rstrip(".")
        case ast.Call():
            return "only functions by name can be called"
        case ast.Attribute():
            return "a dot after a name is not allowed"
    return f"{_kind(node)} is not allowed in a formula"


def _is_finite(value: Any) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no double holds
        return False


def _kind(node: ast.expr) -> str:
    names = {
        ast.Subscript: "an index in brackets",
        ast.Lambda: "a lambda",
        ast.IfExp: "a condition",
        ast.Compare: "a comparison",
        ast.BoolOp: "and/or",
        ast.Constant: "text or a complex number",
        ast.Tuple: "a list",
        ast.List: "a list",
        ast.ListComp: "a comprehension",
        ast.SetComp: "a comprehension",
        ast.DictComp: "a comprehension",
        ast.GeneratorExp: "a comprehension",
    }
    return names.get(type(node), "this")
