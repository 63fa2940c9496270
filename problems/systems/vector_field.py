"""First-order systems, defined by a Python function that returns the right-hand side."""

from collections.abc import Callable
from typing import Annotated, Any

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.errors import InputError
from problems.graph import arguments
from problems.graph.each import length
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
        self._written["field"] = self._listed(value, f, "f").named("field")
        self._trace_declared(invariants, guards)

    def __repr__(self) -> str:
        return f"VectorField({self.name}, dim={self.dim})"
