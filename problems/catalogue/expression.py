"""A Hamiltonian given as text, and the problem made of it.

The text is an expression of Python, with ``^`` for ``**`` too. It is read by Python's `ast`, checked against
the operations below and calculated with the symbols of a trace; Python never runs it. Names are the
coordinates ``q`` and ``p`` (one degree of freedom) or ``q1, p1, q2, ...``, the time ``t``, ``pi``, the
elementary functions, and parameters.
"""

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, NoReturn

from problems.checks import Must
from problems.entry import Expected, entry
from problems.errors import InputError, shown, unknown
from problems.graph.functions import FUNCTIONS
from problems.picture import Phase
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

MOST_FREEDOM = 100  # degrees of freedom; larger systems have sums, which text has not
LONGEST = 4000  # characters
COORDINATE = re.compile(r"([qp])([1-9][0-9]*)?")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}


class Formula:
    """An expression of Python that is calculated without running it.

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
        If the text is not an expression, or has anything but numbers, names, operators and calls of
        functions; the message shows that part of it.
    """

    def __init__(self, text: str) -> None:
        if len(text) > LONGEST:
            raise InputError(f"a formula of {len(text)} characters is too long; at most {LONGEST}.")
        if not text.strip():
            raise InputError('an empty formula; write one such as "p^2/2 - cos(q)".')
        self.text = text
        try:
            with warnings.catch_warnings(action="ignore", category=SyntaxWarning):
                tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            self._refuse("it is not an expression; write products with *")
        nodes = [node for node in ast.walk(tree) if isinstance(node, ast.expr)]
        called = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
        self._parts = [node for node in reversed(nodes) if id(node) not in called]  # arguments come first
        for part in reversed(self._parts):  # the outermost wrong one is told
            self._check(part)
        words = [node for node in self._parts if isinstance(node, ast.Name)]
        words.sort(key=lambda node: (node.lineno, node.col_offset))
        self.names = tuple(dict.fromkeys(node.id for node in words if node.id != "pi"))

    def _refuse(self, reason: str, part: ast.expr | None = None) -> NoReturn:
        where = "" if part is None else f"`{shown(_Text(part))}` "
        raise InputError(f"cannot read the formula {shown(self.text, 120)}: {where}{reason}.")

    def _check(self, part: ast.expr) -> None:
        """Refuse a part whose kind is none of those that a formula has."""
        match part:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                pass
            case ast.Name(id=name):
                if not NAME.fullmatch(name):
                    self._refuse("is not a name of letters and digits", part)
                if name in FUNCTIONS:
                    self._refuse(f"needs an argument, as in {name}(q)", part)
            case ast.UnaryOp(op=op) | ast.BinOp(op=op) if type(op) in _OPERATORS:
                pass
            case ast.Call(func=ast.Name(id=name)) if name not in FUNCTIONS:
                self._refuse(f"calls an {unknown('function', name, FUNCTIONS)}".rstrip("."), part)
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                if (arity := FUNCTIONS[name].arity) != len(args):
                    self._refuse(f"is wrong: {name} takes {arity} argument{'s' if arity > 1 else ''}", part)
            case _:
                self._refuse(
                    "is not allowed; a formula has numbers, names, + - * / // % ^ and functions", part
                )

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
            For a part that is not a real number; the message shows it.
        """
        known: dict[ast.expr, Any] = {}
        symbols = {name: named(name) for name in self.names} | {"pi": math.pi}

        def calculated(part: ast.expr) -> Any:
            match part:
                case ast.Constant(value=int() | float() as number):
                    return float(number)
                case ast.Name(id=name):
                    return symbols[name]
                case ast.UnaryOp(op=op, operand=operand):
                    return _OPERATORS[type(op)](known[operand])
                case ast.BinOp(left=left, op=op, right=right):
                    return _OPERATORS[type(op)](known[left], known[right])
                case ast.Call(func=ast.Name(id=name), args=args):
                    values = [known[arg] for arg in args]
                    plain = all(isinstance(value, float) for value in values)
                    return (FUNCTIONS[name].value if plain else getattr(functions, name))(*values)
            raise AssertionError(part)

        for part in self._parts:
            try:
                result = calculated(part)
            except InputError as error:  # of symbols; it names a line of this file, which is no help
                self._refuse("is wrong: " + (str(error).partition("`: ")[2] or str(error)).rstrip("."), part)
            except ZeroDivisionError:
                self._refuse("divides by 0", part)
            except (ValueError, OverflowError):  # of numbers: outside of a domain, or too large
                result = math.nan
            if isinstance(result, complex) or (isinstance(result, float) and not math.isfinite(result)):
                self._refuse("is not a number that a double can hold", part)
            known[part] = result
        return known[self._parts[-1]]


class _Text:
    """A part of a formula, as a message shows it."""

    def __init__(self, part: ast.expr) -> None:
        self.part = part

    def __repr__(self) -> str:
        return ast.unparse(self.part).replace("**", "^")


def hamiltonian(
    text: str,
    *,
    parameters: Mapping[str, float] | None = None,
    invariants: Mapping[str, str] | None = None,
    name: str = "expression",
) -> Hamiltonian:
    """Return the system of a Hamiltonian given as text.

    Parameters
    ----------
    text : str
        The energy in ``q, p`` or ``q1, p1, .. qn, pn``; the highest number is the
        number of degrees of freedom.
    parameters : mapping of str to float
        Names and default values of all other names in it.
    invariants : mapping of str to str
        Further conserved quantities, as text.
    name : str
        The system's name.

    Raises
    ------
    problems.errors.InputError
        For text that is not a formula, names without a value, or values of names
        that do not occur.
    """
    values = dict(parameters or {})
    energy = Formula(text)
    others = {key: Formula(formula) for key, formula in (invariants or {}).items()}
    dof = _freedom(energy)
    system = Hamiltonian(
        _traceable(energy, values, dof),
        dof=dof,
        parameters=values,
        invariants={key: _traceable(formula, values, dof) for key, formula in others.items()},
        name=name,
    )
    try:
        system.function("field")
    except (InputError, OverflowError):  # the derivatives' constants may overflow where H does not
        raise InputError(f"the formula {text!r} leads to numbers that a double cannot hold.") from None
    if not energy.coordinates:
        raise InputError(f"the formula {text!r} contains no coordinate; use q and p, or q1, p1, q2, ...")
    for key in values:
        if not any(key in formula.names for formula in (energy, *others.values())):
            raise unknown("parameter, not in the formula,", key, energy.names)
    return system


@entry(
    title=None,
    references=("given by the user",),
    notes="A formula of your own.",
    shows=("H", "q0", "p0"),
    picture=Phase(
        span=12.0,
        points=600,
        arguments={"H": "p^2/2 + k*q^4/4", "q0": [1.0], "p0": [0.0], "parameters": "k=2"},
    ),
    expected=Expected(h=0.2, energy=2e-15, default=2e-15),
)
def expression(
    *,
    H: Annotated[str, Must('text, such as "p^2/2 - cos(q)"')] = "p^2/2 - cos(q)",
    q0: Sequence[float] = (0.0,),
    p0: Sequence[float] = (1.9,),
    parameters: Annotated[str, Must('text, such as "k=2, m=0.5"')] = "",
    t_end: float = 100.0,
) -> Problem:
    """Return a problem whose Hamiltonian is given as text.

    Tests a Hamiltonian of your own, such as
    ``expression(H="(p1^2 + p2^2)/2 + q1^2*q2^2", q0=[0.5, 1.0], p0=[0.0, 0.3])``.

    Parameters
    ----------
    H : str
        The energy, in ``q`` and ``p`` or ``q1, p1, q2, ...``, the time ``t``, ``pi`` and parameters;
        with + - * /, powers ``^`` and the elementary functions of one argument.
    q0, p0 : sequence of float
        The initial state, as many numbers as there are degrees of freedom.
    parameters : str
        Values of the other names in ``H``: ``"k=2, m=0.5"``.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q1 .. qn, p1 .. pn]``; parameters as named in ``H``; invariant:
        energy, if ``H`` does not contain ``t``.

    Raises
    ------
    problems.errors.InputError
        For anything that cannot be read.
    """
    values = assignments(parameters)
    system = hamiltonian(H, parameters=values)
    for key, start in {"q0": q0, "p0": p0}.items():
        if len(start) != system.dof:
            raise InputError(
                f"{key}={shown(list(start))} of expression must be a list of {system.dof} finite numbers."
            )
    return Problem(system, q0=q0, p0=p0, t_end=t_end, title=H)


def assignments(text: str) -> dict[str, float]:
    """Return the values in a text such as ``"k=2, m=0.5"``.

    Raises
    ------
    problems.errors.InputError
        For anything else.
    """
    values: dict[str, float] = {}
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        name, sign, number = (piece.strip() for piece in part.partition("="))
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not sign or not NAME.fullmatch(name) or not math.isfinite(value):
            raise InputError(f'cannot read {part!r}; write parameters as "k=2, m=0.5".')
        if name in values:
            raise InputError(f"the parameter {name!r} is given twice.")
        if name in ("t", "pi", *FUNCTIONS) or COORDINATE.fullmatch(name):
            raise InputError(f"{name!r} has a meaning of its own and cannot be a parameter.")
        values[name] = value
    return values


def _freedom(energy: Formula) -> int:
    plain = [name for name in energy.coordinates if name in ("q", "p")]
    numbered = [name for name in energy.coordinates if name not in ("q", "p")]
    if plain and numbered:
        raise InputError(
            f"the formula {energy.text!r} mixes {plain[0]!r} with {numbered[0]!r}; number all coordinates."
        )
    dof = max((int(name[1:]) for name in numbered), default=1)
    if dof > MOST_FREEDOM:
        raise InputError(
            f"the formula {energy.text!r} has more than {MOST_FREEDOM} degrees of freedom; "
            "write it in Python with m.sum."
        )
    return dof


def _traceable(formula: Formula, values: Mapping[str, float], dof: int) -> Callable[..., Any]:
    """Return the function to be traced: the formula, calculated with symbols."""

    def H(t, q, p, par, m):
        def named(word: str) -> Any:
            if word == "t":
                return t
            coordinate = COORDINATE.fullmatch(word)
            if coordinate is None:
                if word not in values:
                    raise _undeclared(formula, word, values)
                return getattr(par, word)
            letter, number = coordinate.groups()
            if number is None and dof != 1:
                raise InputError(f"{word!r} in {formula.text!r} needs a number, such as {word}1.")
            if number is not None and int(number) > dof:
                raise InputError(
                    f"{word!r} in {formula.text!r} does not exist: H has {dof} degrees of freedom."
                )
            return (q if letter == "q" else p)[int(number or 1) - 1]

        return formula.value(named, m)

    return H


def _undeclared(formula: Formula, name: str, values: Mapping[str, float]) -> InputError:
    near = str(unknown("name", name, [*values, "q", "p", "t", "pi", *FUNCTIONS]))
    hint = near.partition("; ")[2] if "did you mean" in near else f'give it a value, as in "{name}=1".'
    return InputError(f"the formula {formula.text!r} contains {name!r}, which has no value; {hint}")
