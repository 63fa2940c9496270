"""Gauss-Legendre collocation, which is HBVM(s, s)."""

import re
from dataclasses import dataclass
from typing import Literal

from integrators.caveats import undetected, undetected_in_time, unknown_discontinuities, why_undetected
from integrators.kernel.plan import Plan
from integrators.methods.hbvm import HBVM, Solver
from integrators.options import Absolute, Breakpoints, Count, Stages, Step, Tolerance
from integrators.protocol import MethodBase, Program, cite
from problems.analysis.structure import depends_on_time
from problems.errors import InputError
from problems.problem import Problem, System

Steps = Literal["reversible"]
Precision = Literal["double", "double-double"]


@dataclass(frozen=True, kw_only=True, repr=False)
class Gauss(MethodBase):
    r"""Gauss(s): the collocation method of order 2s at the s Gauss nodes.

    Bitwise identical to ``HBVM(k=s, s=s, h)``: with k = s the polynomial's derivative equals f at the nodes
    (equations: see `HBVM`). On Poisson systems, for which HBVM has separate code, identical up to rounding.

    Properties, each asserted in ``tests/integrators``: order 2s (`test_order`);
    symmetric and perfectly A-stable (`test_tableau`, `test_hbvm`); conserves every quadratic invariant to
    round-off (`test_energy`). Symplectic, as is every Runge-Kutta method that conserves all quadratic
    invariants.

    Limits: a Hamiltonian of degree 3 or more is conserved only up to O(h^{2s}),
    and at large steps, or with an adaptive step size, not at all. With a tolerance, a feature that is shorter
    than a step may be missed; see `HBVM`, whose error estimate uses the additional nodes.

    Parameters
    ----------
    s : int
        Number of stages, s >= 1; the order is 2s. s = 1 is the implicit midpoint rule.
    h : float, optional
        Step size, > 0; backward integration uses -h. With ``tol``, the initial step size.
    tol : float, optional
        Local error per step, as for `HBVM`; s > 1. With the adaptive steps that follow, Gauss does not
        conserve the energy over long times (`test_adaptive`), unless the steps are reversible.
    solver : {"auto", "fixed_point", "newton", "blended"}
        How the stage equations are solved; see `HBVM`.
    max_step, breakpoints, max_steps, atol
        With ``tol``; see `HBVM`.
    steps : {"reversible"}, optional
        With ``tol`` and ``s`` only: adaptive steps that preserve the long-time behaviour, because the
        reversed integration takes the same steps. Their density rho follows a rate w of the field,

        .. math::

            w^4 &= \| (f_y^2)_{qq} \|^2 + w_0^4, \\
            \log \rho_{n+1/2} &= \log \rho_{n-1/2}
                + \frac{2 \epsilon}{\rho_{n-1/2} + \rho_{n+1/2}} \frac{w'}{w}(y_n), \\
            h_{n+1/2} &= \epsilon / \rho_{n+1/2}, \\
            \log \rho_{1/2} &= \log w(y_0) + \frac{\epsilon}{2} \frac{w'}{w^2}(y_0)

        (E. Hairer, G. Söderlind, SIAM J. Sci. Comput. 26 (2005) 1838-1851). With the Jacobian f_y of the
        field, (f_y^2)_qq is the derivative of the accelerations; w_0^2 is its median norm over the time of
        256 ordinary adaptive steps, and epsilon the median of h w over these, at most 0.2. So ``tol`` is the
        local error of a typical step, and no step is rejected. In reversible systems the energy does not
        drift and the time-reversal error is at round-off (`test_reversible`), as long as the motion is
        regular: chaos amplifies rounding errors, and ``tol`` does not control a close encounter whose time
        scale differs from that of the first steps. For systems of positions and momenta given by a formula
        without the time; its sums are unrolled, so for a few bodies. Fixed-point iteration.
    precision : {"double", "double-double"}
        ``"double-double"``: every number of a step is an unevaluated sum of two doubles, with 32 digits; only
        with ``s`` and ``h``. About a hundred times slower, and 3 to 7 times slower than heyoka's
        ``real128``. ``h``, the times and the parameters are the doubles given; ``integrate(..., start=)``
        takes an initial state with more digits, `Solution.pairs` and `Solution.to_mpmath` return the states
        with all digits.
        One trajectory, without events and variations, of a formula with ``sqrt``, ``sin``, ``cos``, ``tan``,
        ``exp``, ``log``, ``abs`` and arithmetic. Fixed-point iteration.

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
    breakpoints: Breakpoints = ()
    max_steps: Count | None = None
    atol: Absolute | None = None
    steps: Steps | None = None
    precision: Precision = "double"

    built = "compiled on this machine by numba"
    computes_with = ("numpy", "numba", "llvmlite")
    citation = cite("HairerLubichWanner2006")
    family = "gauss"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.h is None and self.tol is None:
            raise InputError("Gauss needs a step h, or a tolerance tol for an adaptive step size.")
        if self.precision != "double":
            allowed = {"s", "h", "precision"} | ({"solver"} if self.solver == "fixed_point" else set())
            if others := [name for name in self.options() if name not in allowed]:
                words = f"with s and h alone; leave out {', '.join(others)}."
                raise InputError(f"Gauss takes precision={self.precision!r} {words}")
        if self.steps is not None:
            given = [name for name in self.options() if name not in ("s", "tol", "steps")]
            if self.tol is None or given or self.s == 1:
                others = f"without {', '.join(given)}" if given else "with tol and s > 1"
                raise InputError(f"Gauss takes steps={self.steps!r} {others}: all steps follow from tol.")
        try:
            self._hbvm()
        except InputError as error:
            raise InputError(re.sub(r"\bHBVM\b", "Gauss", str(error))) from None

    @property
    def order(self) -> int:
        """Order of convergence, 2s."""
        return 2 * self.s

    def as_hbvm(self) -> HBVM:
        """Return the HBVM(s, s) that this method is identical to.

        Raises
        ------
        problems.errors.InputError
            With ``steps`` or ``precision``, which HBVM does not have.
        """
        for name in ("steps", "precision"):
            if name in self.options():
                value = self.options()[name]
                raise InputError(f"{self!r} is no HBVM, which has no {name}={value!r}; leave {name}= out.")
        return self._hbvm()

    def _hbvm(self) -> HBVM:
        return HBVM(
            k=self.s, s=self.s, h=self.h, tol=self.tol, solver=self.solver,
            max_step=self.max_step, breakpoints=self.breakpoints, max_steps=self.max_steps,
            atol=self.atol,
        )  # fmt: skip

    def refuses(self, system: System) -> str | None:
        """Refuse none; with reversible steps or in double-double those without certain formulas."""
        if self.precision != "double":
            return self._lacking(system)
        if self.steps is None:
            return None
        if not system.traced:
            return "reversible steps need a formula, and its field is code; leave out steps='reversible'."
        if system.dof is None:
            return "reversible steps need positions and momenta; leave out steps='reversible'."
        if depends_on_time(system):
            return "reversible steps need a field without the time; leave out steps='reversible'."
        return None

    def _lacking(self, system: System) -> str | None:
        if not system.traced:
            return "double-double needs a formula, and its field is code; leave out precision=."
        from integrators.extended.program import lacking  # numba is for those who integrate

        if (name := lacking(system)) is not None:
            return f"its formula has {name}, which is not available in double-double; leave out precision=."
        return None

    def caveat(self, problem: Problem) -> str | None:
        """Return a warning for a field with discontinuities that these options do not detect; see `HBVM`."""
        why = why_undetected(self.s, self.tol, self.solver)
        discontinuities = undetected(problem, why) if self.tol is None else undetected_in_time(problem, why)
        return discontinuities or unknown_discontinuities(problem, self.s, self.tol, self.breakpoints)

    def compile(self, system: System) -> Program:
        """Compile as `HBVM.compile` does, Poisson systems like any other."""
        if self.precision != "double" and self.h is not None:
            from integrators.extended.program import DoubleDoubleProgram

            program = DoubleDoubleProgram(system, self, s=self.s, h=self.h)
            program.method = self
            return program
        from integrators.kernel.program import compiled  # numba is for those who integrate

        return compiled(self, system)

    def plan(self, system: System) -> Plan:
        """Return s and all else that the steps follow from."""
        if self.tol is not None and self.steps is not None:
            return Plan(k=self.s, s=self.s, tol=self.tol, solver="fixed_point", reversible=True)
        return Plan(k=self.s, s=self.s, h=self.h, tol=self.tol, solver=self.solver, **self._hbvm().control())
