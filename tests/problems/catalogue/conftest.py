from collections.abc import Callable

import numpy as np
import pytest

import problems
from problems import Problem, registry
from problems.graph.nodes import reachable


@pytest.fixture(params=registry.built_in())
def small(request: pytest.FixtureRequest) -> Problem:
    """Every problem, the large families small enough to be compiled by every engine."""
    return problems.load(request.param, **registry.entry(request.param).expected.small)


@pytest.fixture
def states() -> Callable[..., np.ndarray]:
    """Random states around a problem's start, shape (dim, n), within its domain."""

    def draw(problem: Problem, n: int, seed: int = 0) -> np.ndarray:
        random = np.random.default_rng(seed)
        y0 = problem.y0[:, np.newaxis]
        half = problem.system.dof or problem.system.dim
        size = np.repeat([np.abs(y0[:half]).max(), np.abs(y0[half:]).max(initial=0.0)], half)[: len(y0)]
        size = np.where(size == 0.0, 1.0, size)[:, np.newaxis]
        return y0 + 0.1 * size * random.uniform(-1.0, 1.0, (len(y0), n))

    return draw


@pytest.fixture
def magnitudes() -> Callable[..., np.ndarray]:
    """Size of what is added up in each output of a system's field, shape (dim, n).

    Rounding errors are relative to this: absolute values are added where terms
    are added or subtracted, and carried through products, quotients and
    functions by their derivatives.
    """

    def measure(problem: Problem, y: np.ndarray) -> np.ndarray:
        function = problem.system.function("field")
        inputs = {"y": y, "par": np.broadcast_to(problem.par[:, np.newaxis], (len(problem.par), y.shape[1]))}
        known: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        out = np.zeros((len(function.outputs), y.shape[1]))

        def visit(roots: list, loop: object) -> None:
            for node in reachable(roots):
                if node.id in known or (node.loop is not None and node.loop is not loop):
                    continue
                known[node.id] = _size(node, known, inputs, visit)

        for i, terms in enumerate(function.outputs):
            visit([term.node for term in terms], None)
            out[i] += sum((known[term.node.id][1] for term in terms), np.zeros(y.shape[1]))
        for loop, entries in function.loops:
            visit([entry.node for entry in entries], loop)
            for entry in entries:
                size = np.broadcast_to(known[entry.node.id][1], (len(loop), y.shape[1]))
                np.add.at(out, entry.index.values(loop), size)
        return out

    return measure


def _size(node, known, inputs, visit) -> tuple[np.ndarray, np.ndarray]:
    """Return value and magnitude of a node."""
    if node.op == "const":
        value = np.float64(node.data)
        return value, np.abs(value)
    if node.op == "symbol":
        space, place = node.data
        value = inputs[space][place if isinstance(place, int) else place.values(node.loop)]
        return value, np.abs(value)
    if node.op == "sum":
        visit([node.args[0]], node.data)
        value, size = (
            np.broadcast_to(x, (len(node.data), inputs["y"].shape[1])) for x in known[node.args[0].id]
        )
        return value.sum(axis=0), size.sum(axis=0)
    (a, sa), (b, sb) = (known[arg.id] for arg in (node.args * 2)[:2])
    match node.op:
        case "add":
            return a + b, sa + sb
        case "sub":
            return a - b, sa + sb
        case "mul":
            return a * b, sa * sb
        case "div":
            return a / b, sa * sb / (b * b)
        case "neg":
            return -a, sa
        case "pow":
            return a**node.data, sa**node.data
        case "sqrt":
            return np.sqrt(a), sa / np.sqrt(a)
        case "sin" | "cos":
            return getattr(np, node.op)(a), 1.0 + sa
        case "exp":
            return np.exp(a), np.exp(a) * (1.0 + sa)
        case "log":
            return np.log(a), np.abs(np.log(a)) + sa / a
    raise NotImplementedError(node.op)
