"""First-order systems, defined by a Python function that returns the right-hand side."""

from collections.abc import Callable
from typing import Annotated, Any

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.derive.function import Function, Loops, LoopTerm, Term, joined
from problems.errors import InputError
from problems.graph import arguments
from problems.graph.each import Each, components, length
from problems.graph.source_line import line_of_function
from problems.systems.base import System, Value


class VectorField(System):
    """Any first-order system y' = f(t, y).

    Parameters
    ----------
    f : callable
        The right-hand side; returns the list of derivatives, in which ``m.each``, ``m.scatter`` and ``m.dot``
        are as many components as they have. Its arguments are among ``t, y, par, m``.
    dim : int
        Length of the state.
    parameters, invariants, guards, name
        As for `Hamiltonian`; there is no energy unless it is given as an invariant.

    Examples
    --------
    >>> from problems import Problem, VectorField
    >>> def f(t, y, par, m):
    ...     return [y[1], par.a * m.cos(t) - m.sin(y[0])]
    >>> forced = VectorField(f, dim=2, parameters={"a": 0.3})
    >>> Problem(forced, y0=[0.0, 1.0], t_end=10.0).system.dim
    2
    """

    kind = "vector_field"

    @checked_arguments
    def __init__(
        self,
        f: Callable[..., Any],
        *,
        dim: Annotated[int, at_least(1)],
        parameters: Named[Value] = NOTHING,
        invariants: Named[Callable[..., Any]] = NOTHING,
        guards: Named[Callable[..., Any]] = NOTHING,
        name: str | None = None,
    ) -> None:
        super().__init__(f, dim, None, parameters, invariants, guards, name)
        value = self._call(f, "f")
        size = length(value) if arguments.is_list(value) else None
        if size != dim:
            got = "one value" if size is None else f"{size} values"
            raise InputError(
                f"{line_of_function(f)}: f returns {got}, not a list of dim={dim}; "
                "return one derivative for each component of y."
            )
        self._written["field"] = self._joined(f, value)
        self._trace_declared(invariants, guards)

    def _joined(self, f: Callable[..., Any], value: Any) -> Function:
        """Return the function of a list of numbers, and of arrays that loops fill."""
        outputs: list[tuple[Term, ...]] = [()] * self.dim
        loops: list[tuple[int, Loops]] = []
        for at, part in components(value):
            if not isinstance(part, Each):
                node = self._node(part, f, f"f's component {at}")
                outputs[at] = (Term(node, node.id),)
                continue
            for place, node in part.terms:
                outputs[at + place] = (*outputs[at + place], Term(node, node.id))
            terms = (tuple(LoopTerm(place, node) for place, node in entries) for _, entries in part.loops)
            loops.append((at, tuple(zip((loop for loop, _ in part.loops), terms, strict=True))))
        return Function(self._graph, tuple(outputs), joined(loops), "field")

    def __repr__(self) -> str:
        return f"VectorField({self.name}, dim={self.dim})"
