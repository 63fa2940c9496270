"""Hamiltonian Boundary Value Methods, HBVM(k, s), with fixed or adaptive step size."""

from dataclasses import dataclass, replace
from typing import Any, Literal

from integrators.caveats import undetected, undetected_in_time, unknown_discontinuities, why_undetected
from integrators.kernel.plan import Plan
from integrators.methods.automatic import ACCURATE_IN_LANES, WIDE, choose, choose_projected, nodes_of
from integrators.options import Absolute, Breakpoints, Count, Stages, Step, Tolerance
from integrators.protocol import MethodBase, Program, cite
from problems.errors import InputError
from problems.graph.nodes import T
from problems.problem import Problem, System

TOLERANCE = 3e-16
"""The tolerance of a method that is given neither a step nor a tolerance."""

Solver = Literal["auto", "fixed_point", "newton", "blended"]
Projection = Literal["energy"]


@dataclass(frozen=True, kw_only=True, repr=False)
class HBVM(MethodBase):
    r"""HBVM(k, s): the polynomial of degree s whose line integral of grad H vanishes.

    With the orthonormal shifted Legendre polynomials ``P_j`` and the k-point
    Gauss rule ``(c_l, b_l)`` on [0, 1], one step of length h from ``y_0`` is

    .. math::

        \gamma_j &= \sum_{l=1}^k b_l P_j(c_l) f(t_0 + c_l h, Y_l), \quad j = 0, \dots, s-1, \\
        Y_l &= y_0 + h \sum_{j=0}^{s-1} \gamma_j \int_0^{c_l} P_j(x)\,dx, \quad l = 1, \dots, k, \\
        y_1 &= y_0 + h \gamma_0.

    As a Runge-Kutta method: :math:`A = I P^T \Omega` (rank s), weights b, nodes c.

    Properties, each asserted in ``tests/integrators``:

    * order 2s for every k >= s (`test_order`);
    * symmetric and perfectly A-stable: ``|R(iy)| = 1`` (`test_tableau`, `test_hbvm`);
    * k = s is the Gauss-Legendre method, which is symplectic and conserves quadratic invariants; methods with
      k > s do not have these two properties (`test_energy`);
    * a polynomial Hamiltonian of degree nu is conserved to round-off if and only
      if k >= nu s / 2 (`test_energy`); any other smooth one in practice, once k is
      large enough that the quadrature error is below round-off (`test_sitnikov`).

    With a tolerance the step size is adaptive: each step is as long as its estimated local error allows. An
    energy-conserving method can vary its steps without an energy drift; a symplectic one, such as Gauss,
    cannot (`test_adaptive`). If k and s are not given, they are chosen to minimize the cost per unit of time,
    for one trajectory or for many in SIMD lanes (`integrators.methods.automatic`), and the step size is
    bounded such that the quadrature error, which changes the energy, is at round-off. Stiff systems can be
    integrated: the method is A-stable, but it is not L-stable, so that a transient does not decay below the
    tolerance and requires shorter steps than a method that damps it (`test_general`, Robertson's chemistry).

    Limits: energy is not accuracy. At a step too large for the trajectory the
    energy is still conserved and the trajectory is wrong; other invariants, such as the angular momentum, are
    conserved only up to the error of the method (`LineIntegral` conserves several).

    A step evaluates the right-hand side only at its k nodes. A pulse or a narrow force shorter than the
    distance between nodes may be missed, and no error estimate can detect it. For such right-hand sides give
    ``breakpoints`` (times) or ``max_step``. Discontinuities of the right-hand side or of its
    derivative that affect the values at the nodes, such as those of ``m.abs`` and ``m.where``, are detected,
    and the steps are shortened until their effect is negligible; ``stats.extra["kinks"]`` has their times,
    and the solution's ``warnings`` report them. With adaptive steps (``tol``) the formula determines the
    states at which these functions and tables switch, so that weak discontinuities are found as well.
    Switches in time, and those of fields that are code, are detected from the values at the nodes: with at
    least eight nodes, or four for a formula with these functions, in steps that the fixed-point iteration
    solves. With ``h``, and for Poisson systems, discontinuities are not detected; ``warnings`` say so for a
    field that has them (`test_adaptive_steps`, `test_weak_discontinuities`).

    These equations do not conserve the energy of a Poisson system y' = B(y) grad H(y)
    whose structure B varies. There, with :math:`G_i = \sum_l b_l P_i(c_l) \nabla H(Y_l)`,

    .. math::

        \gamma_j = \sum_{l=1}^k b_l P_j(c_l) B(Y_l) \sum_{i=0}^{s-1} P_i(c_l) G_i

    replaces the first equation. It is identical for constant B and for k = s, has the same order, and
    conserves the energy because B is skew-symmetric; it does not conserve the Casimirs of B
    (``tests/integrators/kernel/line/test_poisson``).

    Parameters
    ----------
    k : int, optional
        Nodes of the quadrature, k >= s. With ``s`` and ``tol`` it may be left out: as many as conserve the
        energy exactly, nu s/2, where this is a polynomial of degree nu, else 2s; at least s + 1.
    s : int, optional
        Degree of the polynomial, s >= 1; the order is 2s. Without k and s, both are chosen from ``tol`` and
        the system.
    h : float, optional
        Step size, > 0; backward integration uses -h. With ``tol``, the initial step size.
    tol : float, optional
        Local error per step, relative to the size of each block of the state (the
        momenta of one body, else each component), as estimated by
        ``h |gamma_s|^2 / max_{j<=3} |gamma_j|``. The step size is then adaptive. Default: 3e-16 if ``h`` is
        not given either, as accurate as double precision allows. In ensembles in SIMD lanes the default is
        1e-14.
    solver : {"auto", "fixed_point", "newton", "blended"}
        How the stage equations are solved. The fixed-point iteration contracts while h
        times the largest frequency is below about s. ``"newton"``: simplified Newton
        with the stage system block-diagonalized, one complex matrix of the size of the
        system (of half its size for q'' = a(q)) per pair of stages, sparse where the
        system is large. ``"blended"``: blended iteration, one real matrix. ``"auto"``:
        fixed-point iteration; Newton's method is used from where the iteration fails or needs a hundred
        iterations per step until it would converge fast again. With ``tol`` the steps are short enough for
        the fixed-point iteration until the error would allow steps four to twelve times as long, with which
        Newton's method costs less; then Newton's method is used. The Jacobian is derived from the formula, or
        approximated by differences; its factorization is reused as long as it converges. ``stats`` has the
        number of steps of each solver. Poisson systems: fixed-point iteration.

    max_step : float, optional
        Maximum step size, > 0; with ``tol``. For a right-hand side with pulses that are shorter than the
        steps that the error estimate allows.
    breakpoints : sequence of float, optional
        Times at which the right-hand side or one of its derivatives is discontinuous, in any order; with
        ``tol``. A step ends at each of them, and the next one uses no information from before it. Times at
        which a formula switches need not be given if they follow from conditions and tables whose arguments
        are affine in the time,
        such as ``m.where(t < par.c, ...)``, ``m.abs(2*t - 3)`` and ``m.table(t/par.T, ...)``.
    max_steps : int, optional
        Maximum number of steps of a trajectory; with ``tol``. A run that needs more ends with the status
        ``max_steps``. Default: no limit.
    atol : float or sequence of float, optional
        With ``tol``: absolute tolerance of the local error per step, in the units of the state; one for all
        components, or one for each (the smallest of a block, or of a body, is used; for q'' = a(q) those of
        the momenta). A step is accepted if its error is at most ``max(tol * size, atol)``. 0: errors are
        always relative. The default is 0, except where shorter steps do not reduce the relative error below
        the tolerance, as at a start from rest: there errors may be relative to the largest size that a block
        reaches in the interval, divided by the growth of errors until then, both estimated from coarse
        auxiliary trajectories.
    projection : {"energy"}, optional
        With ``tol`` and k > s: the stage equations are solved only to a hundredth of the tolerance, and the
        end of each step is then projected onto the initial energy H_0. With the gradient g of the energy H
        and the sizes s_i of the blocks,

        .. math::

            y_i \leftarrow y_i - \frac{s_i^2 g_i}{\sum_j (s_j g_j)^2} (H(y) - H_0),

        repeated until the residual is at round-off. For loose tolerances: a run takes about half the time,
        since conservation without the projection requires stage equations and a quadrature that are accurate
        to round-off. The energy is corrected by the projection, not conserved by the equations, and therefore
        says nothing about the error of the trajectory, which follows the tolerance; the step is not
        symmetric, and other invariants are conserved only to the tolerance. For systems whose energy is a
        formula without the time; not for Poisson systems, and not with ``variations``. Trajectories of an
        ensemble are integrated one after another, not in SIMD lanes. States by ``sample="dense"`` are not
        projected. Default: no projection (`test_projection`).

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

    Examples
    --------
    >>> import problems
    >>> from integrators import HBVM, integrate
    >>> problem = problems.load("henon_heiles", t_end=1000.0)
    >>> solution = integrate(problem, HBVM(k=6, s=4, h=0.5), [0.0, 1000.0])
    >>> bool(solution.errors()["energy"].max() < 1e-14)  # degree 3: 6 nodes suffice
    True
    >>> integrate(problem, HBVM(), [1000.0]).status  # automatic order and step size
    <Status.FINISHED: 'finished'>
    """

    k: Stages | None = None
    s: Stages | None = None
    h: Step | None = None
    tol: Tolerance | None = None
    solver: Solver = "auto"
    max_step: Step | None = None
    breakpoints: Breakpoints = ()
    max_steps: Count | None = None
    atol: Absolute | None = None
    projection: Projection | None = None

    built = "compiled on this machine by numba"
    computes_with = ("numpy", "numba", "llvmlite")
    citation = cite("BrugnanoIavernaro2016")
    family = "hbvm"

    def __repr__(self) -> str:
        """Return the call that makes it, without the tolerance that it has by default."""
        told = self.options()
        if self.h is None and self.tol == TOLERANCE:
            del told["tol"]
        return f"HBVM({', '.join(f'{name}={value!r}' for name, value in told.items())})"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.h is None and self.tol is None:
            object.__setattr__(self, "tol", TOLERANCE)
        if self.k is not None and self.s is None:
            raise InputError(f"HBVM needs s with k={self.k!r}; give s too.")
        if self.k is None and self.tol is None:
            raise InputError(
                f"HBVM needs k and s with a fixed step, h={self.h!r}; or give tol, and they are chosen."
            )
        given = [*self.control(), *(["projection"] if self.projection else [])]
        if self.tol is None and given:
            raise InputError(
                f"HBVM takes {', '.join(given)} with a tolerance only, not with h={self.h!r} alone; give tol "
                "too, or leave that out."
            )
        if self.k is not None and self.s is not None and self.k < self.s:
            raise InputError(f"HBVM needs k >= s; k={self.k} is less than s={self.s}: raise k or lower s.")
        if self.projection and self.k is not None and self.k == self.s:
            raise InputError(
                f"projection={self.projection!r} needs k > s; k = s = {self.k} is the Gauss method, whose "
                "quadratic invariants need equations solved to rounding: raise k, or leave it out."
            )
        if self.k == 1 and self.tol is not None:
            raise InputError(
                "HBVM needs k > 1 with a tolerance: one stage tells nothing about its error; give h instead."
            )

    @property
    def order(self) -> int | None:
        """Order of convergence, 2s; ``None`` where s is chosen."""
        return None if self.s is None else 2 * self.s

    def _nodes(self, system: System) -> int | None:
        """Return k, ``None`` where it is chosen together with s."""
        return nodes_of(system, self.s) if self.k is None and self.s is not None else self.k

    def caveat(self, problem: Problem) -> str | None:
        """Name a field with discontinuities that these options do not look for; see the class."""
        k, poisson = self._nodes(problem.system), problem.system.kind == "poisson"
        why = (
            "the steps that keep a Poisson system's energy do not detect discontinuities" if poisson else None
        )
        why = why or why_undetected(k, self.tol, self.solver)
        discontinuities = (
            undetected(problem, why) if poisson or self.tol is None else undetected_in_time(problem, why)
        )
        return discontinuities or unknown_discontinuities(problem, k, self.tol, self.breakpoints)

    def conserved(self, system: System) -> dict[str, float]:
        """Return the energy, with a tolerance: at rounding where s is chosen, or with a projection.

        Of a system with constraints also these.
        """
        if self.tol is not None and system.on_manifold:
            return {name: 0.0 for name in system.invariants if name in system.on_manifold}
        if self.tol is None or "energy" not in system.invariants:
            return {}
        if system.energy is None and self.projection is None:
            return {}
        return {"energy": 0.0 if self.s is None or self.projection else self.tol}

    def as_hbvm(self) -> "HBVM":
        """Return this method itself."""
        return self

    def control(self) -> dict[str, Any]:
        """Return those of ``max_step``, ``breakpoints``, ``max_steps`` and ``atol`` that are given."""
        names = ("max_step", "breakpoints", "max_steps", "atol")
        return {name: value for name, value in self.options().items() if name in names}

    def refuses(self, system: System) -> str | None:
        """Refuse Poisson systems but for fixed-point iteration, and with a projection one without energy."""
        if self.projection and (why := _not_projected(system)):
            return f"projection={self.projection!r} {why}; leave it out."
        kept = "a Poisson system's energy" if system.kind == "poisson" else "constraints"
        if not (system.kind == "poisson" or system.on_manifold) or self.solver in ("auto", "fixed_point"):
            return None
        return (
            f"the equations that keep {kept} are solved by fixed-point iteration only; "
            f"leave out solver={self.solver!r}, or use Gauss."
        )

    def compile(self, system: System) -> Program:
        """Compile the vector field of ``system``, and the kernel if this machine has not yet."""
        from integrators.kernel.program import compiled  # numba is for those who integrate

        return compiled(self, system)

    def plan(self, system: System) -> Plan:
        """Return k, s and all else that the steps follow from."""
        keep = () if system.kind == "poisson" else tuple(system.invariants) if system.on_manifold else None
        tol = self.tol
        if tol is None:
            assert self.k is not None
            assert self.s is not None
            return Plan(k=self.k, s=self.s, h=self.h, solver=self.solver, keep=keep)

        def planned(choice: tuple[int, int, float | None], tol: float = tol) -> Plan:
            k, s, quadrature_error = choice
            return Plan(
                k=k, s=s, tol=tol, quadrature_error=quadrature_error, h=self.h, solver=self.solver, keep=keep,
                projected=self.projection is not None, **self.control(),
            )  # fmt: skip

        if self.s is not None:
            k = self._nodes(system)
            assert k is not None
            return planned((k, self.s, None))
        if self.projection:
            return planned(choose_projected(tol))
        alone, many = choose(system, tol), choose(system, tol, lanes=True)
        if many == alone or keep is not None:
            return planned(alone)
        accurate = many[0] < WIDE and tol == TOLERANCE
        return replace(planned(alone), many=planned(many, ACCURATE_IN_LANES if accurate else tol))


def _not_projected(system: System) -> str | None:
    """Return why steps cannot end on a surface of the system's energy; ``None`` if they can."""
    energy = system.invariants.get("energy")
    if system.on_manifold:
        return "is not for systems with constraints, whose line integrals conserve the energy"
    if system.kind == "poisson":
        return "is not for Poisson systems, whose line integrals conserve the energy"
    if energy is None or not system.traced:
        return f"needs a field and an energy that are formulas, the energy without time; not {system.name}"
    if len(energy.outputs) != 1 or any(node.flags & T for node in energy.roots):
        return f"needs an energy that is one number and does not depend on the time, unlike {system.name}'s"
    return None
