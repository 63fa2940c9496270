"""Gauss collocation in double-double arithmetic: a second opinion on reference solutions.

Nothing is shared with the Taylor method that makes the references but the traced
vector field: other method, other arithmetic, other code. The step follows the
Legendre coefficients of the field: the last of s is of the size h^{s-1}, the
error of the step about its square.
"""

import ast
import hashlib
from collections.abc import Callable
from functools import cache
from typing import Any

import mpmath
import numpy as np
from numba import njit
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from hbvm_bench.reference import extended
from hbvm_bench.reference.extended import number, plus, row, times
from problems import emit
from problems.errors import InputError
from problems.problem import Problem
from problems.systems.base import System

Array = NDArray[np.float64]

STAGES = 16
DECAY = 1e-17  # of the last Legendre coefficient; its square is the size of the error
MOST_ITERATIONS = 200


def integrate(problem: Problem, at: Array, *, decay: float = DECAY) -> Array:
    """Return the solution at given times as double-double numbers.

    Parameters
    ----------
    problem : Problem
        What to integrate; every number enters as the exact double.
    at : ndarray, shape (n,)
        Increasing (or, backwards, decreasing) times, from ``t0`` on.
    decay : float
        Wanted size of the last Legendre coefficient relative to the first.

    Returns
    -------
    ndarray, shape (n, dim, 2)
        The states are ``[..., 0] + [..., 1]``.

    Raises
    ------
    problems.errors.InputError
        If the iteration does not converge, or the step shrinks to nothing; for functions that
        double-double arithmetic does not have.
    """
    advance = _program(problem.system)
    nodes, weights, matrix, legendre = _tables(STAGES)
    y, par = (np.stack([x, np.zeros_like(x)], axis=1) for x in (problem.y0, problem.par))
    out = np.empty((len(at), *y.shape))
    t, h = float(problem.t0), 0.0
    for i, end in enumerate(np.asarray(at, dtype=np.float64).tolist()):
        try:
            code, h = advance(t, end, h, y, par, nodes, weights, matrix, legendre, decay)
        except NumbaError:
            raise InputError(
                f"the field of {problem!r} has a function or a table that is not to be had in double-double."
            ) from None
        if code:
            raise InputError(f"{problem!r} could not be integrated beyond t = {t!r} in double-double.")
        t = end
        out[i] = y
    return out


def decimals(states: Array) -> list[list[Any]]:
    """Return states as mpmath numbers."""
    with mpmath.workdps(50):
        return [[mpmath.mpf(hi) + mpmath.mpf(lo) for hi, lo in state] for state in states.tolist()]


@cache
def _tables(s: int) -> tuple[Array, Array, Array, Array]:
    """Return nodes and weights (s, 2), coefficients (s, s, 2), and some b_l P_j(c_l)."""
    with mpmath.workdps(60):
        roots = [_root(s, x) for x in np.polynomial.legendre.leggauss(s)[0].tolist()]
        slopes = [_slope(s, x) for x in roots]
        b = [1 / ((1 - x * x) * d * d) for x, d in zip(roots, slopes, strict=True)]
        c = [(1 + x) / 2 for x in roots]
        value = [[mpmath.sqrt(2 * j + 1) * mpmath.legendre(j, x) for j in range(s)] for x in roots]
        integral = [[_integral(j, x) for j in range(s)] for x in roots]
        a = [
            [b[m] * mpmath.fsum(i * v for i, v in zip(integral[l], value[m], strict=True)) for m in range(s)]
            for l in range(s)
        ]
        # Of the first Legendre coefficient and the last two.
        projection = np.array([[_pair(b[l] * value[l][j]) for l in range(s)] for j in (0, s - 2, s - 1)])
        nodes = np.array([_pair(x) for x in c])
        matrix = np.array([[_pair(x) for x in line] for line in a])
        return nodes, np.array([_pair(x) for x in b]), matrix, projection


def _slope(s: int, x: Any) -> Any:
    return s * (x * mpmath.legendre(s, x) - mpmath.legendre(s - 1, x)) / (x * x - 1)


def _root(s: int, guess: float) -> Any:
    x = mpmath.mpf(guess)
    for _ in range(4):  # Newton's: 16, 32, 64 digits
        x -= mpmath.legendre(s, x) / _slope(s, x)
    return x


def _integral(j: int, x: Any) -> Any:
    """Return the integral of P_j from 0 to c = (1 + x)/2."""
    if j == 0:
        return (1 + x) / 2
    root = mpmath.sqrt(2 * j + 1)
    return (mpmath.legendre(j + 1, x) - mpmath.legendre(j - 1, x)) / (2 * root)


def _pair(value: Any) -> tuple[float, float]:
    high = float(value)
    return high, float(value - mpmath.mpf(high))


_programs: dict[str, Callable[..., Any]] = {}


def _program(system: System) -> Callable[..., Any]:
    """Return the compiled integrator of a system."""
    made = emit.source(system, "field", "numba", limit=0)
    key = hashlib.sha256(made.text.encode()).hexdigest()
    if key not in _programs:
        namespace: dict[str, Any] = {"np": np, "number": number, **extended.FUNCTIONS}
        tree = ast.fix_missing_locations(_Numerators().visit(ast.parse(made.text)))
        exec(compile(tree, "<field>", "exec"), namespace)  # noqa: S102 -- emitted from a graph
        _programs[key] = _compiled(njit(namespace[made.name]))
    return _programs[key]


class _Numerators(ast.NodeTransformer):
    """Turns literals that are divided into double-double numbers: 1.0/30.0 is no double."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if isinstance(node.op, ast.Div) and isinstance(node.left, ast.Constant):
            zero = ast.Constant(0.0)
            node.left = ast.Call(ast.Name("number", ast.Load()), [node.left, zero], [])
        return node


def _compiled(field: Any) -> Any:
    @njit
    def evaluate(t, y, par, out):
        field(t, row(y), row(par), row(out))

    @njit
    def advance(t, end, h, y, par, nodes, weights, matrix, legendre, decay):
        s, dim = len(nodes), len(y)
        slope = np.zeros((s, dim, 2))
        new = np.zeros((s, dim, 2))
        stage = np.zeros((dim, 2))
        direction = 1.0 if end > t else -1.0
        if h == 0.0:
            h = direction * 1e-3 * abs(end - t)
        while (end - t) * direction > 0.0:
            last = abs(h) >= abs(end - t)
            step = end - t if last else h
            if t + step == t:
                return 2, h
            after = end if last else t + step
            step = after - t
            exact = plus(number(after, 0.0), number(-t, 0.0))  # from one double to the next
            evaluate(number(t, 0.0), y, par, new[0])
            for i in range(s):
                slope[i] = new[0]
            before, change = np.inf, np.inf
            for _ in range(MOST_ITERATIONS):
                for i in range(s):
                    for d in range(dim):
                        total = number(0.0, 0.0)
                        for j in range(s):
                            a = number(matrix[i, j, 0], matrix[i, j, 1])
                            total = plus(total, times(a, number(slope[j, d, 0], slope[j, d, 1])))
                        total = times(total, exact)
                        total = plus(number(y[d, 0], y[d, 1]), total)
                        stage[d, 0] = total.hi
                        stage[d, 1] = total.lo
                    moment = times(exact, number(nodes[i, 0], nodes[i, 1]))
                    evaluate(plus(number(t, 0.0), moment), stage, par, new[i])
                change, size = 0.0, 1e-300
                for d in range(dim):
                    for i in range(s):
                        gap = (new[i, d, 0] - slope[i, d, 0]) + (new[i, d, 1] - slope[i, d, 1])
                        change = max(change, abs(gap))
                        size = max(size, abs(new[i, d, 0]))
                slope[:] = new
                change /= size
                if not change < np.inf:
                    break
                if change < 1e-33 or (change < 1e-27 and change >= 0.5 * before):
                    break
                before = change
            if not change < 1e-27:
                if abs(step) < 1e-12 * abs(end):
                    return 1, h
                h = 0.25 * step
                continue
            ratio = _decay(slope, legendre)
            factor = 0.9 * (decay / max(ratio, 1e-300)) ** (1.0 / (s - 1))
            factor = min(2.0, max(0.1, factor))
            if ratio > 30.0 * decay:
                h = step * factor
                continue
            for d in range(dim):
                total = number(0.0, 0.0)
                for j in range(s):
                    b = number(weights[j, 0], weights[j, 1])
                    total = plus(total, times(b, number(slope[j, d, 0], slope[j, d, 1])))
                total = plus(number(y[d, 0], y[d, 1]), times(total, exact))
                y[d, 0] = total.hi
                y[d, 1] = total.lo
            t = after
            if not last:
                h = step * factor
        return 0, h

    return advance


@njit
def _decay(slope, legendre):
    """Return the largest of the last two Legendre coefficients relative to the largest of the first."""
    s, dim, _ = slope.shape
    top, tail = 1e-300, 0.0
    for j in range(3):
        for d in range(dim):
            total = number(0.0, 0.0)
            for i in range(s):
                weight = number(legendre[j, i, 0], legendre[j, i, 1])
                total = plus(total, times(weight, number(slope[i, d, 0], slope[i, d, 1])))
            if j == 0:
                top = max(top, abs(total.hi))
            else:
                tail = max(tail, abs(total.hi))
    return tail / top
