"""Formulas as text, such as ``"p^2/2 - cos(q)"``: read by a whitelist, never run by Python.

The text is read with Python's `ast` module. Numbers, names, ``+ - * /``, powers (``^`` or
``**``) with a number as exponent, parentheses and the elementary functions of one argument are
all there is; everything else is refused with the column where it stands. What is left is
calculated by the operators of whatever the names stand for: on symbols it is traced, as a formula
written in Python is.
"""

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable
from typing import Any, NoReturn

from problems.errors import InputError, unknown
from problems.graph.functions import FUNCTIONS, OF_ONE_ARGUMENT

LONGEST = 4000  # characters
DEEPEST = 60  # nesting of parentheses, functions and signs
LARGEST_POWER = 100
COORDINATE = re.compile(r"([qp])([1-9][0-9]*)?")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

_OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


class Formula:
    """A formula whose text Python can read; what it may contain is checked by `value`.

    Parameters
    ----------
    text : str
        Such as ``"(p1^2 + p2^2)/2 + k*(q1^2 + q2^2)/2"``.

    Attributes
    ----------
    text : str
        As it was given.
    names : tuple of str
        The coordinates and other names in it, in the order in which they appear.

    Raises
    ------
    problems.errors.InputError
        If the text is not an expression; the message names the column.
    """

    def __init__(self, text: str) -> None:
        if not isinstance(text, str):
            raise InputError(f'a formula is text, such as "p^2/2 - cos(q)", not {text!r}.')
        if len(text) > LONGEST:
            raise InputError(f"a formula of {len(text)} characters is too long; at most {LONGEST}.")
        if not text.strip():
            raise InputError('an empty formula; write one such as "p^2/2 - cos(q)".')
        self.text = text
        self._columns: list[int] = []  # of each character of the Python text in the given one
        python = ""
        for column, character in enumerate(text, start=1):
            readable = character.isascii() and (character.isprintable() or character in "\t\n\r")
            if not readable or character in "#\\;=@":
                self._refuse(column, f"{character!r} has no meaning in a formula")
            if not python and character.isspace():
                continue
            piece = "**" if character == "^" else " " if character.isspace() else character
            python += piece
            self._columns += [column] * len(piece)
        self._tree = self._read(python.rstrip())
        called = {id(node.func) for node in ast.walk(self._tree) if isinstance(node, ast.Call)}
        words = [node for node in ast.walk(self._tree) if isinstance(node, ast.Name)]
        words.sort(key=lambda node: node.col_offset)
        self.names = tuple(
            dict.fromkeys(node.id for node in words if node.id != "pi" and id(node) not in called)
        )

    def _read(self, python: str) -> ast.expr:
        try:
            with warnings.catch_warnings(action="ignore", category=SyntaxWarning):
                return ast.parse(python, mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            # Python counts from 1, and says 0 where the text ends too soon.
            offset = (getattr(error, "offset", None) or len(python)) - 1
            column = self._columns[min(offset, len(self._columns) - 1)]
        return self._refuse(column, "this is not a formula; write products with *")

    def _refuse(self, where: int | ast.expr, reason: str) -> NoReturn:
        """Raise an error that names the column, given or that of a node."""
        if isinstance(where, ast.expr):
            where = self._columns[min(where.col_offset, len(self._columns) - 1)]
        shown = " ".join(self.text.split())
        shown = shown if len(shown) <= 120 else shown[:117] + "..."
        raise InputError(f"cannot read the formula {shown!r}: {reason} (column {where}).")

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names that are positions or momenta."""
        return tuple(name for name in self.names if COORDINATE.fullmatch(name))

    def value(self, named: Callable[[str], Any], functions: Any) -> Any:
        """Calculate the formula, its plain numbers as doubles.

        Parameters
        ----------
        named : callable
            Returns what a name stands for.
        functions : Any
            Has the elementary functions as attributes, of what names stand for.

        Raises
        ------
        problems.errors.InputError
            If the text is anything else than a formula; the message names the column.
        """
        return self._value(self._tree, 0, named, functions)

    def _value(self, node: ast.expr, depth: int, named: Callable[[str], Any], functions: Any) -> Any:
        if depth > DEEPEST:
            self._refuse(node, f"the formula is nested deeper than {DEEPEST}")

        def inner(part: ast.expr) -> Any:
            return self._value(part, depth + 1, named, functions)

        spine: list[ast.BinOp] = []  # a long sum leans to the left: walked, not descended
        while isinstance(node, ast.BinOp) and not isinstance(node.op, ast.Pow):
            if type(node.op) not in _OPERATORS:
                self._refuse(node, "only + - * / and powers are allowed")
            spine.append(node)
            node = node.left
        match node:
            case ast.Constant(value=bool()):
                self._refuse(node, "True and False are not numbers")
            case ast.Constant(value=int() | float() as number):
                total = self._calculated(node, float, number)
            case ast.Name(id="pi"):
                total = math.pi
            case ast.Name(id=name):
                if not NAME.fullmatch(name):
                    self._refuse(node, f"{name!r} is not a name of letters and digits")
                if name in OF_ONE_ARGUMENT:
                    self._refuse(node, f"{name} needs an argument, as in {name}(q)")
                total = named(name)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                total = inner(operand)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                total = -inner(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                base, exponent = inner(left), self._exponent(right, inner(right))
                power = math.pow if isinstance(base, float) else operator.pow
                total = self._calculated(node, power, base, exponent)
            case ast.Call(func=ast.Name(id=name), args=[only], keywords=[]) if name in OF_ONE_ARGUMENT:
                argument = inner(only)
                known = FUNCTIONS[name].value if isinstance(argument, float) else getattr(functions, name)
                total = self._calculated(node, known, argument)
            case _:
                self._refuse(node, _why_not(node))
        for parent in reversed(spine):
            right = inner(parent.right)
            if isinstance(parent.op, ast.Div) and isinstance(right, float) and right == 0.0:
                self._refuse(parent.right, "this divides by 0")
            total = self._calculated(parent, _OPERATORS[type(parent.op)], total, right)
        return total

    def _calculated(self, node: ast.expr, operation: Callable[..., Any], *values: Any) -> Any:
        try:
            result = operation(*values)
        except InputError as error:  # of symbols; it names a line of this file, which is no help
            reason = str(error).partition("`: ")[2] or str(error)
            self._refuse(node, reason.rstrip("."))
        except (ValueError, OverflowError):  # of numbers: outside the function's domain, or too large
            result = math.nan
        if isinstance(result, float) and not math.isfinite(result):
            self._refuse(node, "this is not a number that a double can hold")
        return result

    def _exponent(self, node: ast.expr, exponent: Any) -> float:
        if not isinstance(exponent, float):
            self._refuse(
                node, "an exponent must be a number such as 2, -1, 0.5 or (3/2); write x^a as exp(a*log(x))"
            )
        if abs(exponent) > LARGEST_POWER:
            self._refuse(node, f"the power is larger than {LARGEST_POWER}")
        if not (2 * exponent).is_integer():
            self._refuse(node, "an exponent must be an integer or half an integer")
        return exponent


def _why_not(node: ast.expr) -> str:
    match node:
        case ast.Call(func=ast.Name(id=name)) if name in OF_ONE_ARGUMENT:
            return f"{name} takes one argument"
        case ast.Call(func=ast.Name(id=name)):
            return str(unknown("function", name, OF_ONE_ARGUMENT)).rstrip(".")
        case ast.Call():
            return "only functions by name can be called"
        case ast.Attribute():
            return "a dot after a name is not allowed"
    return f"{_kind(node)} is not allowed in a formula"


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
