"""Systems from SymPy's expressions: a Hamiltonian, or the equations of `sympy.physics.mechanics`."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from problems.checks import checked_arguments
from problems.errors import InputError, MissingLibraryError, shown
from problems.graph.nodes import Node
from problems.systems.base import System
from problems.systems.hamiltonian import Hamiltonian
from problems.systems.vector_field import VectorField

FUNCTIONS = {
    "sin": "sin", "cos": "cos", "tan": "tan", "exp": "exp", "log": "log", "Abs": "abs", "sinh": "sinh",
    "cosh": "cosh", "tanh": "tanh", "asin": "asin", "acos": "acos", "atan": "atan", "atan2": "atan2",
    "asinh": "asinh", "acosh": "acosh", "atanh": "atanh", "erf": "erf", "erfc": "erfc", "floor": "floor",
    "sign": "sign", "Min": "min", "Max": "max",
}  # fmt: skip
"""SymPy's names of functions, and what a formula calls them."""


@checked_arguments
def from_sympy(
    expression: Any,
    q: Any = (),
    p: Any = (),
    *,
    parameters: Mapping[Any, Any] | None = None,
    t: Any = None,
    name: str = "from_sympy",
) -> System:
    """Return a system from expressions of SymPy.

    Parameters
    ----------
    expression : sympy.Expr, or a LagrangesMethod or KanesMethod
        A Hamiltonian in the symbols ``q`` and ``p``; or a system of `sympy.physics.mechanics` whose equations
        have been formed. The system with their ``mass_matrix_full`` and ``forcing_full``
        is solved by elimination, once, in formulas.
    q, p : sympy.Symbol, or sequence of them
        Positions and momenta, for a Hamiltonian.
    parameters : mapping of Symbol to float, optional
        All other symbols, with their default values; their names are those of the system's parameters.
    t : sympy.Symbol, optional
        The time; by default the symbol ``t``, as in `sympy.physics.mechanics`.
    name : str
        Name of the system.

    Returns
    -------
    Hamiltonian or VectorField
        A `VectorField` of q and their velocities (the generalised speeds) for the second kind.

    Raises
    ------
    problems.errors.InputError
        For symbols that are nothing of these, and functions that no formula may call.
    problems.errors.MissingLibraryError
        If SymPy is not installed.

    Examples
    --------
    >>> import sympy
    >>> from problems import Problem, from_sympy
    >>> q, p, g = sympy.symbols("q p g")
    >>> pendulum = from_sympy(p**2 / 2 - g * sympy.cos(q), [q], [p], parameters={g: 9.81})
    >>> Problem(pendulum, q0=[0.0], p0=[1.9], t_end=10.0).par.tolist()
    [9.81]
    """
    try:
        sympy = import_module("sympy")
    except ImportError:
        raise MissingLibraryError("sympy is not installed; install it with: pip install sympy.") from None
    q, p = ([given] if isinstance(given, sympy.Expr) else list(given) for given in (q, p))
    values = dict(parameters or {})
    names = {symbol: str(symbol) for symbol in values}
    for text in names.values():
        if not text.isidentifier():
            raise InputError(f"the parameter {text!r} must be named as a variable is; rename the symbol.")
    times = {sympy.Symbol("t") if t is None else t}
    defaults = {text: float(values[symbol]) for symbol, text in names.items()}
    if hasattr(type(expression), "mass_matrix_full") and hasattr(expression, "u"):  # it may raise
        state = [*expression.q, *expression.u]
        try:
            matrix, forcing = expression.mass_matrix_full, expression.forcing_full
        except ValueError as error:
            formed = (
                "form_lagranges_equations()"
                if "Lagrange" in type(expression).__name__
                else "kanes_equations()"
            )
            raise InputError(
                f"the equations of this {type(expression).__name__} are not formed; call its {formed} first."
            ) from error
        if matrix.rows > len(state):
            raise InputError(
                f"the equations of this {type(expression).__name__} have {matrix.rows} unknowns for "
                f"{len(state)} coordinates and velocities; those behind them are Lagrange multipliers of its "
                "constraints. Make a problems.Constrained of the coordinates, or choose "
                "coordinates that are independent."
            )
        places: dict[Any, Callable[..., Any]] = {x: _component("y", i) for i, x in enumerate(state)}
        rows = [
            [_Formula(sympy, sympy.sympify(e), places, names, times) for e in [*matrix.row(i), forcing[i]]]
            for i in range(matrix.rows)
        ]

        def field(t, y, par, m):
            given = {"t": t, "y": y, "par": par, "m": m}
            return solution([[entry(given) for entry in row] for row in rows])[: len(state)]

        return VectorField(field, dim=len(state), parameters=defaults, name=name)
    if not isinstance(expression, sympy.Expr) or not q or len(q) != len(p):
        raise InputError(
            f"{shown(expression)} needs as many q as p, and must be an expression of SymPy; or give a "
            "LagrangesMethod or KanesMethod whose equations have been formed."
        )
    places = {x: _component(which, i) for which, listed in (("q", q), ("p", p)) for i, x in enumerate(listed)}
    energy = _Formula(sympy, expression, places, names, times)

    def H(t, q, p, par, m):
        return energy({"t": t, "q": q, "p": p, "par": par, "m": m})

    def at_rest(q, p, par, m):
        return energy({"q": q, "p": p, "par": par, "m": m})

    timeless = not any(time in expression.free_symbols for time in times)
    return Hamiltonian(at_rest if timeless else H, dof=len(q), parameters=defaults, name=name)


def solution(rows: list[list[Any]]) -> list[Any]:
    """Return the solution of a linear system of formulas; the last column is the right-hand side.

    Rows are exchanged only where a pivot is 0 whatever the state is: a mass matrix needs no exchange.

    Raises
    ------
    problems.errors.InputError
        If the matrix is singular as it is written.
    """
    n, rows = len(rows), [list(row) for row in rows]
    for k in range(n):
        pivot = next((i for i in range(k, n) if not _is_zero(rows[i][k])), None)
        if pivot is None:
            raise InputError("the mass matrix is singular as it is written; each speed needs a mass.")
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for row in rows[k + 1 :]:
            if _is_zero(row[k]):
                continue
            factor = row[k] / rows[k][k]
            for j in range(k + 1, n + 1):
                if not _is_zero(rows[k][j]):
                    row[j] = row[j] - factor * rows[k][j]
    values: list[Any] = [0.0] * n
    for k in reversed(range(n)):
        total = rows[k][n]
        for j in range(k + 1, n):
            if not _is_zero(rows[k][j]) and not _is_zero(values[j]):
                total = total - rows[k][j] * values[j]
        values[k] = total / rows[k][k]
    return values


def _is_zero(value: Any) -> bool:
    number = value.data if isinstance(value, Node) and value.op == "const" else value
    return isinstance(number, int | float) and number == 0


def _component(vector: str, i: int) -> Callable[..., Any]:
    return lambda given: given[vector][i]


class _Formula:
    """An expression, evaluated with whatever numbers or symbols it is given; common parts once."""

    def __init__(self, sympy: Any, expression: Any, places: Any, names: Any, times: Any):
        self._sympy, self._places, self._names, self._times = sympy, places, names, times
        self._expression = expression
        known = {*places, *names, *times}
        bound = expression.subs({x: sympy.Dummy() for x in places})
        unknown = sorted(str(x) for x in bound.free_symbols - known if not isinstance(x, sympy.Dummy))
        if unknown:
            raise InputError(
                f"the symbol {unknown[0]!r} has no value; give parameters={{{unknown[0]}: ...}}."
            )

    def __call__(self, given: Mapping[str, Any]) -> Any:
        """Return its value."""
        values: dict[Any, Any] = {}

        def value(e: Any) -> Any:
            if e not in values:
                values[e] = self._evaluated(e, value, given)
            return values[e]

        return value(self._expression)

    def _evaluated(self, e: Any, value: Callable[[Any], Any], given: Mapping[str, Any]) -> Any:
        sympy, m = self._sympy, given["m"]
        if e in self._places:
            return self._places[e](given)
        if e in self._names:
            return getattr(given["par"], self._names[e])
        if e in self._times:
            return given["t"]
        if e.is_Integer:
            return int(e)
        if e.is_Rational:
            return int(e.p) / int(e.q)
        if e.is_number:
            return float(e)
        if e.is_Add:
            total = value(e.args[0])
            for term in e.args[1:]:
                total = total + value(term)
            return total
        if e.is_Mul:
            above, below = e.as_numer_denom()
            if below != 1:
                return value(above) / value(below)
            product = value(e.args[0])
            for factor in e.args[1:]:
                product = product * value(factor)
            return product
        if e.is_Pow:
            return self._power(e, value, m)
        if e.func == sympy.exp:
            return m.exp(value(e.args[0]))
        called = FUNCTIONS.get(type(e).__name__)
        if called is None:
            raise InputError(f"no formula may call {shown(e)}: known are {', '.join(FUNCTIONS)}.")
        return getattr(m, called)(*map(value, e.args))

    def _power(self, e: Any, value: Callable[[Any], Any], m: Any) -> Any:
        base, exponent = e.args
        if exponent.is_number and not exponent.is_positive:
            return 1.0 / value(base ** (-exponent))
        if exponent.is_Integer:
            return value(base) ** int(exponent)
        if exponent.is_Rational and exponent.q == 2:
            root = m.sqrt(value(base))
            whole = int(exponent - self._sympy.Rational(1, 2))
            return root if whole == 0 else value(base) ** whole * root
        return m.exp(value(exponent) * m.log(value(base)))
