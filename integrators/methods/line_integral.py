"""Line integral methods that conserve several invariants."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from integrators.caveats import undetected
from integrators.kernel.plan import Plan
from integrators.options import Absolute, Stages, Step, Tolerance
from integrators.protocol import MethodBase, Program, cite
from problems.checks import refusal
from problems.errors import InputError
from problems.problem import Problem, System


class _Names:
    def checked(self, owner: str, name: str, value: Any) -> tuple[str, ...]:
        listed = tuple(value) if isinstance(value, list | tuple) else ()
        if not listed or not all(isinstance(text, str) for text in listed):
            raise refusal(
                owner, name, value, f'a list of names, such as {name}=["energy", "angular_momentum"]'
            )
        if len(set(listed)) < len(listed):
            raise refusal(owner, name, value, "a list of different names")
        return listed


@dataclass(frozen=True, kw_only=True, repr=False)
class LineIntegral(MethodBase):
    r"""The polynomial of degree s along which the line integrals of several gradients vanish.

    With the basis ``P_j`` and the k-point Gauss rule of `HBVM`, the Legendre
    coefficients ``gamma_j`` of the field f and ``phi_ij`` of the gradients of the
    invariants at the k stages, and a fixed diagonal metric W, one step is

    .. math::

        \sigma' &= \sum_{j=0}^{s-1} P_j \Big( \gamma_j - W \sum_i \phi_{ij} \alpha_i \Big), \\
        y_1 &= \sigma(t_0 + h), \\
        \sum_j \phi_{ij}^T \gamma_j &= \sum_m \Big( \sum_j \phi_{ij}^T W \phi_{mj} \Big) \alpha_m.

    Each invariant L_i changes by :math:`h \sum_j \phi_{ij}^T \sigma'_j`, which the last line
    makes 0 up to the error of the quadrature. As ``alpha = O(h^{2s})``, the order
    of HBVM(k, s) is preserved.

    Properties, each asserted in ``tests/integrators/kernel/line``:

    * order 2s (`test_order`); symmetric (`test_symmetry`);
    * all named invariants are conserved in practice, once k is so large that the
      quadrature error is below round-off (`test_sitnikov`, `test_kepler`,
      `test_poisson`), also with adaptive step size (`test_varying`);
    * bodies that mirror each other keep doing so to the last bit (`test_sitnikov`).

    Rounding is taken back: before each step the invariants are evaluated at the
    present state, and what they have lost since the start enters the equations for
    alpha, provided that it is no more than rounding accounts for: 2^-46 of the largest
    terms so far. So their errors do not grow with the number of steps. What the quadrature
    loses (k too small) is not hidden by this: it stays lost, and `Solution.warnings` says how much
    that is.

    Limits: keeping invariants is not accuracy. Invariants that are not named are
    kept only as far as the order does; momentum, say, which plain HBVM keeps. An
    invariant that follows from others is left out (``stats.extra["left_out"]``);
    one that is none stops the integration (status ``not_invariant``). The
    nonlinear equations are solved by fixed-point iteration: stiff problems need
    short steps.

    Parameters
    ----------
    k : int
        Nodes of the quadrature, k > s: with k = s the correction is identically 0.
    s : int
        Degree of the polynomial, s >= 1; the order is 2s.
    h : float, optional
        Step size, > 0; backward integration uses -h. With ``tol``, the initial step size.
    tol : float, optional
        Local error per step, relative to the size of each block of the state (the
        positions or the momenta of one body, else each component), as estimated by ``h |gamma_s|^2 /
        max_{j<=3} |gamma_j|``. The step size is then adaptive.
    atol : float or sequence of float, optional
        With ``tol``: absolute tolerance; see `HBVM`.
    invariants : sequence of str
        Invariants to conserve: names of the problem's invariants, such as ``"energy"``; of a
        vector all components, or ``"lenz[1]"``, one.

    Raises
    ------
    problems.errors.InputError
        For values outside these ranges, or if neither ``h`` nor ``tol`` is given.

    Notes
    -----
    W is 1/m for positions and m for momenta where H = sum p^2/(2m) + V(q), and 1
    otherwise. It does not depend on the state.

    References
    ----------
    L. Brugnano, F. Iavernaro, *Line integral methods which preserve all invariants of
    conservative problems*, J. Comput. Appl. Math. 236 (2012) 3905-3919.

    Examples
    --------
    >>> import problems
    >>> from integrators import LineIntegral, integrate
    >>> method = LineIntegral(k=12, s=3, h=0.1, invariants=("energy", "angular_momentum"))
    >>> errors = integrate(problems.load("kepler", e=0.6), method, [0.0, 100.0]).errors()
    >>> bool(max(errors["energy"].max(), errors["angular_momentum"].max()) < 1e-13)
    True
    """

    k: Stages
    s: Stages
    h: Step | None = None
    tol: Tolerance | None = None
    atol: Absolute | None = None
    invariants: Annotated[Sequence[str], _Names()]

    built = "compiled on this machine by numba"
    computes_with = ("numpy", "numba", "llvmlite")
    citation = cite("BrugnanoIavernaro2012", "BrugnanoIavernaro2016")
    family = "line integral"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.k <= self.s:
            raise InputError(
                f"LineIntegral needs k > s, not k={self.k}, s={self.s}: {self.k} nodes see no more of the "
                f"field than {self.s} coefficients hold, and the correction is identically 0; raise k."
            )
        if self.h is None and self.tol is None:
            raise InputError("LineIntegral needs a step h, or a tolerance tol for an adaptive step size.")
        if self.tol is None and self.atol is not None:
            raise InputError(
                f"LineIntegral takes atol with a tolerance only, not with h={self.h!r} alone; give tol."
            )

    @property
    def order(self) -> int:
        """Order of convergence, 2s."""
        return 2 * self.s

    def accepts(self, problem: Problem) -> str | None:
        """Accept every system given by a formula that has these invariants."""
        if not problem.system.traced:
            return (
                "it needs the field as a formula, beside those of its invariants; write it as a VectorField."
            )
        from integrators.kernel.line.kept import function_of

        try:
            for name in self.invariants:
                function_of(problem.system, name)
        except InputError as error:
            return str(error)
        return None

    def caveat(self, problem: Problem) -> str | None:
        """Name a field with discontinuities: they are not looked for."""
        return undetected(problem, "line integral methods do not detect discontinuities")

    def conserved(self, system: System) -> dict[str, float]:
        """Return the invariants that are conserved, if the step size is adaptive."""
        tol, names = self.tol, system.invariants
        return {} if tol is None else {name: tol for name in self.invariants if name in names}

    def compile(self, system: System) -> Program:
        """Compile the vector field and the gradients, and the kernel if this machine has not yet.

        Raises
        ------
        problems.errors.InputError
            For an invariant that the system does not have, or that depends on time.
        """
        from integrators.kernel.program import compiled

        return compiled(self, system)

    def plan(self, system: System) -> Plan:
        """Return k, s and all else that the steps follow from."""
        return Plan(k=self.k, s=self.s, h=self.h, tol=self.tol, keep=self.invariants, atol=self.atol)
