"""Gauss-Legendre collocation, which is HBVM(s, s)."""

import re
from dataclasses import dataclass
from typing import Any

from integrators.caveats import blind, unknown_kinks, unseen, unseen_in_time
from integrators.methods.hbvm import HBVM, Solver
from integrators.options import Absolute, Count, Landings, Stages, Step, Tolerance
from integrators.protocol import MethodBase, Program
from problems.errors import InputError
from problems.problem import Problem, System

CITATION = """\
@book{HairerLubichWanner2006,
  author = {Hairer, Ernst and Lubich, Christian and Wanner, Gerhard},
  title = {Geometric Numerical Integration},
  edition = {2},
  publisher = {Springer},
  year = {2006}
}
"""


@dataclass(frozen=True, kw_only=True, repr=False)
class Gauss(MethodBase):
    """Gauss(s): the collocation method of order 2s at the s Gauss nodes.

    The very same code as ``HBVM(k=s, s=s, h)``, bit for bit: with k = s the
    polynomial's derivative equals f at the nodes (equations: see `HBVM`). On Poisson
    systems, for which HBVM has code of its own, the same up to rounding.

    Properties, each asserted in ``tests/integrators``: order 2s (`test_order`);
    symmetric and perfectly A-stable (`test_tableau`, `test_hbvm`); keeps every
    quadratic invariant to round-off (`test_energy`). Symplectic, as every method
    that keeps all quadratic invariants is.

    Limits: a Hamiltonian of degree 3 or more is conserved only up to O(h^{2s}),
    and at large steps, or with changing steps, not at all. With a tolerance, what is
    shorter than a step may be stepped over; see `HBVM`, whose estimate sees more, because it
    has nodes to spare.

    Parameters
    ----------
    s : int
        Number of stages, s >= 1; the order is 2s. s = 1 is the implicit midpoint rule.
    h : float, optional
        Length of a step, > 0; integration backwards takes steps of -h. With ``tol``,
        the first step's.
    tol : float, optional
        Local error per step, as for `HBVM`; s > 1. With the steps that then vary, Gauss
        keeps no energy over long times (`test_adaptive`): it is there to be compared with.
    solver : {"auto", "fixed_point", "newton", "blended"}
        How the stage equations are solved; see `HBVM`.
    max_step, breakpoints, max_steps, atol
        With ``tol``; see `HBVM`.

    Raises
    ------
    problems.errors.InputError
        For values outside these ranges.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, integrate
    >>> solution = integrate(problems.load("kepler", e=0.6), Gauss(s=3, h=0.1), [0.0, 500.0])
    >>> bool(solution.errors()["angular_momentum"].max() < 1e-13)  # quadratic
    True
    """

    s: Stages
    h: Step | None = None
    tol: Tolerance | None = None
    solver: Solver = "auto"
    max_step: Step | None = None
    breakpoints: Landings = ()
    max_steps: Count | None = None
    atol: Absolute | None = None

    library = "hbvm-bench"
    citation = CITATION
    family = "gauss"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.h is None and self.tol is None:
            raise InputError("Gauss needs a step h, or a tolerance tol for an adaptive step size.")
        try:
            self.as_hbvm()
        except InputError as error:
            raise InputError(re.sub(r"\bHBVM\b", "Gauss", str(error))) from None

    @property
    def order(self) -> int:
        """Order of convergence, 2s."""
        return 2 * self.s

    def as_hbvm(self) -> HBVM:
        """Return the HBVM that this method is."""
        return HBVM(
            k=self.s, s=self.s, h=self.h, tol=self.tol, solver=self.solver,
            max_step=self.max_step, breakpoints=self.breakpoints, max_steps=self.max_steps,
            atol=self.atol,
        )  # fmt: skip

    def caveat(self, problem: Problem) -> str | None:
        """Name a field with kinks that these options do not look for; see `HBVM`."""
        why = blind(self.s, self.tol, self.solver)
        kinks = unseen(problem, why) if self.tol is None else unseen_in_time(problem, why)
        return kinks or unknown_kinks(problem, self.s, self.tol, self.breakpoints)

    def compile(self, system: System) -> Program:
        """Compile as `HBVM.compile` does, Poisson systems like any other."""
        made = self._compiled(system)
        made.method = self
        return made

    def _compiled(self, system: System) -> Any:
        if self.tol is not None:
            from integrators.kernel.program import AdaptiveProgram

            return AdaptiveProgram(
                system, k=self.s, s=self.s, tol=self.tol, h=self.h, solver=self.solver,
                **self.as_hbvm().control(),
            )  # fmt: skip
        from integrators.kernel.program import HBVMProgram  # numba is for those who integrate

        assert self.h is not None
        return HBVMProgram(system, k=self.s, s=self.s, h=self.h, solver=self.solver)
