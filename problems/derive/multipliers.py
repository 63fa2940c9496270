"""Multipliers of constraints g(q) = 0 as formulas.

With the velocities u(q, p), the push f = -dH/dq + further forces, G = dg/dq and the rates of the constraints
w = G u, the motion ``q' = u, p' = f - G' lambda`` keeps w where

    (dw/dp G') lambda = dw/dq u + dw/dp f,

whose right side is the derivative of w along the motion without lambda. For masses, u_i = c_i p_i, the matrix
is G C G'. Its entries, and those of G, are arrays that loops fill, whether constraints are written one by one
or in loops: the generated code grows with the number of different formulas, not with that of constraints.
"""

from typing import Any

import numpy as np

from problems.derive.elimination import Elimination, independent_levels, with_loops
from problems.derive.forward import Slopes
from problems.derive.function import Function, array
from problems.derive.jacobian import Jacobian, jacobian, meeting
from problems.errors import InputError
from problems.graph.each import Constants, Each
from problems.graph.fold import Copy, shifted
from problems.graph.loops import Affine
from problems.graph.nodes import STATE, Node, P
from problems.graph.sums import Index


class Motion:
    """A motion without constraints.

    Parameters
    ----------
    velocity, push : Function
        u and f, as many outputs as coordinates.
    scale : Function or None
        c with u_i = c_i p_i, where the velocities have this form.
    """

    def __init__(self, velocity: Function, push: Function, scale: Function | None):
        self.graph, self.dof = velocity.graph, len(velocity.outputs)
        self.velocity, self.push = velocity, push
        self._scale = None if scale is None else _Outputs(scale)
        self._speed, self._push = _Outputs(velocity), _Outputs(push)
        self._heavy = None if scale is None else sorted(places_of(scale))

    def along(self, function: Function) -> Function:
        """Return the derivatives of a function along the motion."""
        return _Along(self).along(function)

    def speed(self, i: Any) -> Node | None:
        """Return the velocity of coordinate i; ``None`` where it is 0."""
        if self._scale is None:
            return self._speed[i]
        scale = self._scale[i]
        place, loop = (i.affine, i.loop) if isinstance(i, Index) else (i, None)
        momentum = self.graph.symbol("y", shifted(place, self.dof), flags=P, loop=loop)
        return None if scale is None else scale * momentum

    def pushed(self, i: Any) -> Node | None:
        """Return f_i."""
        return self._push[i]

    def multipliers(self, constraints: Function, rates: Function) -> tuple[Each, Each]:
        """Return the multipliers, and p' with them.

        Raises
        ------
        problems.derive.elimination.ZeroPivotError
            Where one of the constraints moves nothing, or follows from the others.
        """
        filled, dof, n = with_loops(self.graph), self.dof, len(constraints.outputs)
        G = entries(constraints, 2 * dof)
        W = G if self._scale is not None else entries(rates, 2 * dof)
        slopes, turns = array(G.function), array(W.function)
        of_momenta = np.flatnonzero(W.columns >= (dof if self._scale is None else 0))
        first, second = meeting(W.columns[of_momenta] % dof, G.columns)
        first = of_momenta[first]
        a, b, i = W.rows[first], G.rows[second], G.columns[second]
        use = (b <= a) & (True if self._heavy is None else np.isin(i, self._heavy))
        pairs, place = np.unique(np.stack([a, b], axis=1)[use], axis=0, return_inverse=True)
        rows = np.stack([place.ravel(), first[use], second[use], i[use]], axis=1)
        scale = self._scale
        matrix = filled(
            len(pairs),
            [(lambda to, e, f, i: {to: _times(turns[e] * slopes[f], scale, i)}, rows)],
        )
        places = {(int(a), int(b)): number for number, (a, b) in enumerate(pairs)}
        neighbours: list[set[int]] = [set() for _ in range(n)]
        for k, j in places:
            neighbours[k].add(j)
            neighbours[j].add(k)
        levels = independent_levels(neighbours)
        found = Elimination(places, matrix, array(self.along(rates)), levels, filled).solve()
        push = array(self.push)
        reaction = np.stack([G.columns, np.arange(len(G.rows)), G.rows], axis=1)
        momenta = filled(
            dof,
            [
                (lambda i: {i: push[i]}, np.arange(dof if push.loops else 0)[:, np.newaxis]),
                (lambda i, e, row: {i: -(slopes[e] * found[row])}, reaction),
            ],
        )
        return found, Each(self.graph, dof, momenta.loops, () if push.loops else push.terms)


def entries(function: Function, columns: int) -> Jacobian:
    """Return the derivatives of constraints or rates, entry by entry."""
    found = jacobian(function, function.name.replace("invariant:", "gradient:"), columns)
    if found is None:
        raise InputError("the constraints have too many pairs of terms; write them without sums.")
    return found


class _Outputs:
    """Outputs of a function: by integers their formulas where they have single ones, else of an array."""

    def __init__(self, function: Function):
        self._single: list[Node | None] | None = None
        if not function.loops:
            chains = [[term.node for term in terms] for terms in function.outputs]
            self._single = [sum(chain[1:], chain[0]) if chain else None for chain in chains]
        numbers = [node.data for node in self._single or () if node is not None and node.op == "const"]
        whole = bool(numbers) and len(numbers) == len(function.outputs)
        self._array = Constants(function.graph, np.array(numbers)) if whole else array(function)

    def __getitem__(self, i: Any) -> Node | None:
        return self._array[i] if self._single is None or isinstance(i, Index) else self._single[i]


class _Along(Slopes):
    def __init__(self, motion: Motion):
        super().__init__(Copy(motion.graph), STATE)
        self._motion = motion

    def visit_symbol(self, node: Node) -> Node | None:
        (_, place), loop, dof = node.data, node.loop, self._motion.dof
        of_momenta = (place if loop is None else int(place.values(loop)[0])) >= dof
        i = shifted(place, -dof if of_momenta else 0)
        i = Index(self.graph, loop, i) if loop is not None and isinstance(i, Affine) else i
        return self._motion.pushed(i) if of_momenta else self._motion.speed(i)


def _times(value: Node, scale: _Outputs | None, i: Any) -> Node:
    factor = None if scale is None else scale[i]
    return value if factor is None else value * factor


def places_of(function: Function) -> set[int]:
    """Return the outputs that have summands."""
    inside = (int(i) for loop, part in function.loops for entry in part for i in entry.index.values(loop))
    return {*inside, *(i for i, terms in enumerate(function.outputs) if terms)}
