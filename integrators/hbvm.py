"""Hamiltonian Boundary Value Methods, HBVM(k, s), with a fixed step."""

import math
import operator
from dataclasses import dataclass
from typing import Any

from integrators.protocol import MethodBase, Program
from problems.errors import InputError, unknown
from problems.problem import Problem, System

CITATION = """\
@book{BrugnanoIavernaro2016,
  author = {Brugnano, Luigi and Iavernaro, Felice},
  title = {Line Integral Methods for Conservative Problems},
  publisher = {Chapman and Hall/CRC},
  year = {2016}
}
"""

SOLVERS = ("auto", "fixed_point", "newton", "blended")


@dataclass(frozen=True, kw_only=True, repr=False)
class HBVM(MethodBase):
    r"""HBVM(k, s): the polynomial of degree s whose line integral of grad H vanishes.

    With the orthonormal shifted Legendre polynomials ``P_j`` and the k-point
    Gauss rule ``(c_l, b_l)`` on [0, 1], one step of length h from ``y_0`` is

        gamma_j = sum_l b_l P_j(c_l) f(t_0 + c_l h, Y_l),             j = 0 .. s-1,
        Y_l     = y_0 + h sum_j gamma_j int_0^{c_l} P_j,              l = 1 .. k,
        y_1     = y_0 + h gamma_0.

    As a Runge-Kutta method: ``A = I P' Omega`` (rank s), weights b, nodes c.

    Properties, each asserted in ``tests/integrators``:

    * order 2s for every k >= s (`test_order`);
    * symmetric and perfectly A-stable: |R(iy)| = 1 (`test_tableau`, `test_hbvm`);
    * k = s is the Gauss-Legendre method, which is symplectic and keeps quadratic
      invariants; with k > s it is neither (`test_energy`);
    * a polynomial Hamiltonian of degree nu is conserved to round-off if and only
      if k >= nu s / 2 (`test_energy`); any other smooth one in practice, once k is
      large enough that the quadrature error is below round-off (`test_sitnikov`).

    Limits: energy is not accuracy. At a step too large for the trajectory the
    energy is still conserved and the trajectory is wrong; other invariants, such
    as the angular momentum, are kept only as far as the order does (`LineIntegral`
    keeps several).

    These equations do not keep the energy of a Poisson system y' = B(y) grad H(y)
    whose structure B varies. There, with ``G_i = sum_l b_l P_i(c_l) grad H(Y_l)``,

        gamma_j = sum_l b_l P_j(c_l) B(Y_l) sum_i P_i(c_l) G_i

    takes the place of the first: the same for constant B and for k = s, of the same
    order, and the energy is kept because B is skew-symmetric; the Casimirs of B are
    not (``tests/integrators/line/test_poisson``).

    Parameters
    ----------
    k : int
        Nodes of the quadrature, k >= s.
    s : int
        Degree of the polynomial, s >= 1; the order is 2s.
    h : float
        Length of a step, > 0; integration backwards takes steps of -h.

    solver : {"auto", "fixed_point", "newton", "blended"}
        How the stage equations are solved. The fixed-point iteration contracts while h
        times the largest frequency is below about s. ``"newton"``: simplified Newton
        with the stage system block-diagonalized, one complex matrix of the size of the
        system (of half its size for q'' = a(q)) per pair of stages, sparse where the
        system is large. ``"blended"``: blended iteration, one real matrix. ``"auto"``:
        fixed point, and Newton from where that fails or takes a hundred iterations a
        step until it would contract well again. The Jacobian is traced; its factors are
        kept while they serve. ``stats`` tells which solver did how much.

    Raises
    ------
    problems.errors.InputError
        For values outside these ranges.

    References
    ----------
    L. Brugnano, F. Iavernaro, D. Trigiante, *Hamiltonian Boundary Value Methods
    (energy preserving discrete line integral methods)*, JNAIAM 5 (2010) 17-37.

    P. Amodio, L. Brugnano, F. Iavernaro, *Arbitrarily high-order energy-conserving
    methods for Poisson problems*, Numer. Algorithms (2022), doi:10.1007/s11075-022-01285-z.
    """

    k: int
    s: int
    h: float
    solver: str = "auto"

    library = "hbvm-bench"
    citation = CITATION
    family = "hbvm"

    def __post_init__(self) -> None:
        for name in ("s", "k"):
            object.__setattr__(self, name, _whole(type(self).__name__, name, getattr(self, name)))
        object.__setattr__(self, "h", _length(type(self).__name__, self.h))
        if self.k < self.s:
            raise InputError(f"HBVM needs k >= s; k={self.k} is less than s={self.s}: raise k or lower s.")
        if self.solver not in SOLVERS:
            raise unknown("solver", str(self.solver), SOLVERS)

    @property
    def order(self) -> int:
        """Order of convergence, 2s."""
        return 2 * self.s

    def accepts(self, problem: Problem) -> str | None:
        """Accept every system; Poisson systems with fixed-point iteration only."""
        return self._refusal(problem.system)

    def _refusal(self, system: System) -> str | None:
        if system.kind != "poisson" or self.solver in ("auto", "fixed_point"):
            return None
        return (
            "the equations that keep a Poisson system's energy are solved by fixed-point iteration only; "
            f"leave out solver={self.solver!r}, or use Gauss."
        )

    def compile(self, system: System) -> Program:
        """Compile the vector field of ``system``, and the kernel if this machine has not yet."""
        if (refusal := self._refusal(system)) is not None:
            raise InputError(refusal)
        if system.kind == "poisson":
            from integrators.kernel.line.program import LineProgram

            return LineProgram(system, k=self.k, s=self.s, h=self.h)
        from integrators.kernel.program import HBVMProgram  # numba is for those who integrate

        return HBVMProgram(system, k=self.k, s=self.s, h=self.h, solver=self.solver)


def _whole(method: str, name: str, value: Any) -> int:
    """Return an option as an int >= 1, or refuse it."""
    try:
        number = 0 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = 0
    if number < 1:
        raise InputError(f"{method} needs a whole number {name} >= 1, not {name}={value!r}.")
    return number


def _length(method: str, h: Any) -> float:
    """Return the step as a float > 0, or refuse it."""
    try:
        length = math.nan if isinstance(h, (bool, str)) else float(h)
    except (TypeError, ValueError):
        length = math.nan
    if not (length > 0.0 and math.isfinite(length)):
        raise InputError(
            f"{method} needs a finite step h > 0, not h={h!r}; the sign of time is that of the times."
        )
    return length
