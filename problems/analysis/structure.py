"""Structure of a traced system: degree, time, coordinates that do not occur."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from problems.errors import InputError
from problems.graph.fold import Fold
from problems.graph.functions import CALLED
from problems.graph.nodes import STATE, Node, T, reachable
from problems.systems.base import System

WITHOUT_END = ("round", "floor")
"""Functions that jump again and again, at places that no list can hold."""


def degree(system: System, par: ArrayLike | None = None) -> int | None:
    """Return the degree of the energy as a polynomial in the state.

    The degree is that of the expression as it is written: terms that cancel are
    not noticed.

    Parameters
    ----------
    system : System
        A `Hamiltonian` or a `Poisson` system.
    par : array_like, shape (n_par,), optional
        Values of the parameters; a product with a parameter that is 0 then drops out.

    Returns
    -------
    int or None
        ``None`` if the energy is not a polynomial.

    Raises
    ------
    problems.errors.InputError
        If the system has no energy.
    """
    return degree_of([_energy(system)], par)


def degree_of(nodes: Iterable[Node], par: ArrayLike | None = None) -> int | None:
    """Return the largest degree of nodes as polynomials in the state, as `degree` that of the energy."""
    values = None if par is None else np.asarray(par, dtype=np.float64).tolist()
    fold = _Degree(values)
    degrees = [fold.of(node) for node in nodes]
    known = [d for d in degrees if d is not None]
    return int(max(0, *known)) if known and len(known) == len(degrees) else None


_ZERO = float("-inf")  # the degree of the polynomial 0


class _Degree(Fold[float | None]):
    """The degree of nodes as polynomials in the state."""

    def __init__(self, par: list[float] | None):
        super().__init__()
        self._par = par

    def visit_const(self, node: Node) -> float:
        return _ZERO if node.data == 0.0 else 0

    def visit_symbol(self, node: Node) -> float:
        space, place = node.data
        if space == "y":
            return 1
        absent = space == "par" and self._par is not None and isinstance(place, int) and not self._par[place]
        return _ZERO if absent else 0

    def visit_element(self, node: Node, *degrees: float | None) -> float | None:
        return None if None in degrees else max(d for d in degrees if d is not None)

    def visit_add(self, node: Node, a: float | None, b: float | None) -> float | None:
        return None if a is None or b is None else max(a, b)

    visit_sub = visit_add

    def visit_mul(self, node: Node, a: float | None, b: float | None) -> float | None:
        if _ZERO in (a, b):
            return _ZERO
        return None if a is None or b is None else a + b

    def visit_div(self, node: Node, a: float | None, b: float | None) -> float | None:
        return a if b is not None and not node.args[1].flags & STATE else None

    def visit_neg(self, node: Node, a: float | None) -> float | None:
        return a

    visit_sum = visit_neg

    def visit_pow(self, node: Node, a: float | None) -> float | None:
        return None if a is None else a * node.data

    def visit_operation(self, node: Node, *degrees: float | None) -> float | None:
        return 0 if None not in degrees and not node.flags & STATE else None


def depends_on_time(system: System) -> bool:
    """Whether the energy, or the vector field where there is none, contains the time itself."""
    function = system.energy or system.function("field")
    return any(node.flags & T for node in function.roots)


def has_kinks(system: System) -> bool:
    """Whether the vector field has an absolute value, its derivative or a choice, of the state or of time."""
    nodes = reachable(system.function("field").roots)
    return any(has_kink(node) and node.flags & (STATE | T) for node in nodes)


def switches_in_time(system: System) -> bool:
    """Whether there is such an absolute value or choice of time alone."""
    nodes = reachable(system.function("field").roots)
    return any(has_kink(node) and node.args[0].flags & (STATE | T) == T for node in nodes)


def has_kink(node: Node) -> bool:
    """Whether a node chooses, or is a function of which a derivative jumps."""
    return node.op in CALLED and not CALLED[node.op].smooth


def cyclic(system: System) -> list[int]:
    """Return the indices of the positions that do not occur in H, in order: their momenta are constant.

    Raises
    ------
    problems.errors.InputError
        If the system is not a `Hamiltonian`.
    """
    if system.dof is None:
        raise InputError(
            f"{system.name} has no positions and momenta; cyclic coordinates need a Hamiltonian."
        )
    seen: set[int] = set()
    for node in reachable([_energy(system)]):
        if node.op == "symbol" and node.data[0] == "y":
            place = node.data[1]
            seen.update([place] if isinstance(place, int) else place.values(node.loop).tolist())
    return [place for place in range(system.dof) if place not in seen]


def _energy(system: System) -> Node:
    if system.energy is None:
        raise InputError(f"{system.name} has no energy; give it as a Hamiltonian or a Poisson system.")
    return system.energy.roots[0]
