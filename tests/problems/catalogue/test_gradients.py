"""The emitted derivatives against SymPy's, on every problem."""

import mpmath
import numpy as np
import sympy

from problems import targets
from problems.graph.nodes import reachable

STATES = 3


def _as_sympy(system, what):
    """Write a traced scalar with SymPy; constants become exact rationals."""
    y = sympy.symbols(f"y0:{system.dim}")
    par = sympy.symbols(f"c0:{max(system.n_par, 1)}")
    inputs = {"y": y, "par": par}
    root = system.function(what).outputs[0][0].node
    known: dict[int, sympy.Expr] = {}

    def place(node, row):
        space, at = node.data
        return inputs[space][at if isinstance(at, int) else int(at.values(node.loop)[row])]

    def written(node, here, row):
        if node.op == "const":
            return sympy.Rational(*float(node.data).as_integer_ratio())
        if node.op == "symbol":
            return place(node, row)
        if node.op == "sum":
            body = [n for n in reachable([node.args[0]]) if n.loop is node.data]
            total = sympy.Integer(0)
            for i in range(len(node.data)):
                inner: dict[int, sympy.Expr] = {}
                for n in body:
                    inner[n.id] = written(n, inner, i)
                total += inner[node.args[0].id]
            return total
        a, *rest = (here[arg.id] if arg.id in here else known[arg.id] for arg in node.args)
        match node.op:
            case "add":
                return a + rest[0]
            case "sub":
                return a - rest[0]
            case "mul":
                return a * rest[0]
            case "div":
                return a / rest[0]
            case "neg":
                return -a
            case "pow":
                return a**node.data
        return getattr(sympy, {"abs": "Abs"}.get(node.op, node.op))(a)

    for node in reachable([root]):
        if node.loop is None:
            known[node.id] = written(node, known, 0)
    return known[root.id], y, par


def test_gradients_agree_with_sympys(small, states, magnitudes):
    system = small.system
    energy, symbols, parameters = _as_sympy(system, "hamiltonian")
    slope = [sympy.diff(energy, symbol) for symbol in symbols]
    exact = sympy.lambdify([symbols, parameters], slope, "mpmath", cse=True)
    y = states(small, STATES, seed=11)
    field = targets.numpy(system, system.slope if system.kind == "poisson" else system.field)(
        0.0, y, small.par
    )
    if system.kind == "hamiltonian":
        dof = system.dof
        field = np.concatenate([-field[dof:], field[:dof]])  # dH/dq, dH/dp
    with mpmath.workdps(40):
        par = [mpmath.mpf(x) for x in small.par.tolist()] or [mpmath.mpf(0)]
        for column, values in enumerate(y.T.tolist()):
            found = exact([mpmath.mpf(x) for x in values], par)
            gap = [
                abs(float(mpmath.mpf(a) - b)) for a, b in zip(field[:, column].tolist(), found, strict=True)
            ]
            size = max(abs(float(x)) for x in found)
            # Rounding in what is added up: measured at most 6 ulp of the terms' size.
            if system.kind == "hamiltonian":
                terms = magnitudes(small, y)[:, column]
                terms = np.concatenate([terms[dof:], terms[:dof]])
            else:
                terms = np.full(len(gap), 10 * size)
            assert (np.array(gap) <= 16 * np.spacing(terms)).all()
