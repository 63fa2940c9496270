"""Hamiltonian Boundary Value Methods, HBVM(k, s), with fixed or adaptive step size."""

from dataclasses import dataclass
from typing import Any, Literal

from integrators.caveats import blind, unknown_kinks, unseen, unseen_in_time
from integrators.options import Absolute, Breakpoints, Count, Stages, Step, Tolerance
from integrators.protocol import MethodBase, Program
from problems.errors import InputError
from problems.problem import Problem, System
from problems.trace.graph import T

CITATION = """\
@book{BrugnanoIavernaro2016,
  author = {Brugnano, Luigi and Iavernaro, Felice},
  title = {Line Integral Methods for Conservative Problems},
  publisher = {Chapman and Hall/CRC},
  year = {2016}
}
"""

TOLERANCE = 3e-16
"""The tolerance of a method that is given neither a step nor a tolerance."""

Solver = Literal["auto", "fixed_point", "newton", "blended"]
Projection = Literal["energy"]


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
    * symmetric and perfectly A-stable: ``|R(iy)| = 1`` (`test_tableau`, `test_hbvm`);
    * k = s is the Gauss-Legendre method, which is symplectic and keeps quadratic
      invariants; with k > s it is neither (`test_energy`);
    * a polynomial Hamiltonian of degree nu is conserved to round-off if and only
      if k >= nu s / 2 (`test_energy`); any other smooth one in practice, once k is
      large enough that the quadrature error is below round-off (`test_sitnikov`).

    With a tolerance the steps vary, each as long as its estimated local error allows.
    This costs an energy-preserving method nothing, whereas a symplectic one, such as
    Gauss, loses its long-time behaviour (`test_adaptive`). Without k and s these are
    chosen too, by what a unit of time costs, for one trajectory and for many side by side
    (`integrators.methods.automatic`), and the length of a step is bounded such that
    the error of the quadrature, by which the energy changes, is at round-off. Stiff
    systems run too: the method is A-stable, but it damps nothing, so that a transient that was
    left at the size of the tolerance stays and keeps the steps shorter than those of a method
    that damps it (`test_general`, Robertson's chemistry).

    Limits: energy is not accuracy. At a step too large for the trajectory the
    energy is still conserved and the trajectory is wrong; other invariants, such
    as the angular momentum, are kept only as far as the order does (`LineIntegral`
    keeps several).

    A step sees the field at its k nodes and nowhere else. With a tolerance, what lies
    between them - a pulse in time, or a narrow bump of the force, that is shorter than the
    step - is stepped over, and the run ends as finished: no estimate can tell. Where the
    field has such places, give ``breakpoints`` (times) or ``max_step``. Jumps and kinks of
    the field that nodes do see, such as those of ``m.abs`` and ``m.where``, are found, and steps cut until
    they do not matter; the places are in ``stats.extra["kinks"]`` and the solution's
    ``warnings`` say so. In adaptive steps (``tol``) the formulas tell where these and tables switch in
    the state, so that weak kinks are found as well. In time, and in fields that are code, the nodes have to
    show it: eight, or four on a formula with these, in steps that the fixed-point iteration solves.
    Kinks are not looked for with ``h`` and on Poisson systems; of a field with these, ``warnings`` say so
    (`test_adaptive_steps`, `test_weak_kinks`).

    These equations do not conserve the energy of a Poisson system y' = B(y) grad H(y)
    whose structure B varies. There, with ``G_i = sum_l b_l P_i(c_l) grad H(Y_l)``,

        gamma_j = sum_l b_l P_j(c_l) B(Y_l) sum_i P_i(c_l) G_i

    takes the place of the first: the same for constant B and for k = s, of the same
    order, and the energy is conserved because B is skew-symmetric; the Casimirs of B are
    not (``tests/integrators/kernel/line/test_poisson``).

    Parameters
    ----------
    k : int, optional
        Nodes of the quadrature, k >= s.
    s : int, optional
        Degree of the polynomial, s >= 1; the order is 2s. Left out, together with k:
        both are chosen, from ``tol`` and the system.
    h : float, optional
        Length of a step, > 0; integration backwards takes steps of -h. With ``tol``,
        the first step's.
    tol : float, optional
        Local error per step, relative to the size of each block of the state (the
        momenta of one body, else each component), as estimated by
        ``h |gamma_s|^2 / max_{j<=3} |gamma_j|``. The steps then vary. 3e-16 where neither
        ``h`` nor ``tol`` is given: as accurate as double precision allows. In lanes
        of an ensemble, whose methods have eight or twelve nodes, 1e-14 is that.
    solver : {"auto", "fixed_point", "newton", "blended"}
        How the stage equations are solved. The fixed-point iteration contracts while h
        times the largest frequency is below about s. ``"newton"``: simplified Newton
        with the stage system block-diagonalized, one complex matrix of the size of the
        system (of half its size for q'' = a(q)) per pair of stages, sparse where the
        system is large. ``"blended"``: blended iteration, one real matrix. ``"auto"``:
        fixed point, and Newton from where that fails or takes a hundred iterations a
        step until it would contract well again. With ``tol`` steps are as short as the
        fixed point needs, until errors would allow so much longer ones that Newton's cost
        less, four to twelve times; then Newton takes over. The Jacobian is traced, or taken
        by differences; its factors are kept while they serve. ``stats`` tells which solver did
        how much. Poisson systems: fixed point.

    max_step : float, optional
        Length that no step exceeds, > 0, in units of time; with ``tol``. For a field with pulses or
        bumps that are shorter than the steps the estimate allows.
    breakpoints : sequence of float, optional
        Times at which the right-hand side or one of its derivatives is discontinuous, in any order; with
        ``tol``. A step ends at each of them that is passed, and nothing from before it is used after it.
        The times at which formulas switch need not be given where they follow from conditions and
        tables of anything affine in the time,
        such as ``m.where(t < par.c, ...)``, ``m.abs(2*t - 3)`` and ``m.table(t/par.T, ...)``.
    max_steps : int, optional
        Steps of a trajectory from its start, at most; with ``tol``. A run that needs more ends
        with the status ``max_steps``. By default any number.
    atol : float or sequence of float, optional
        With ``tol``: local error per step, in the state's units, that is allowed whatever the size of the
        block; one for all components, or one for each (of a block, and of one body, the smallest counts; of
        q'' = a(q) those of the momenta). So a step is good enough where its error is at most
        ``max(tol * size, atol)``. 0: errors are relative, always. By default the same, but where a step does
        not become good enough by cutting it, as from rest, errors may there be relative to the
        largest size that a block will reach in the interval, divided by how much errors grow on the way;
        coarse further trajectories tell it.
    projection : {"energy"}, optional
        With ``tol`` and k > s: the stage equations are solved to a hundredth of the tolerance only, and the
        end of each step is then moved to the energy H_0 of the start. With the gradient g of the energy H
        and the sizes s_i of the blocks,

            y_i <- y_i - s_i^2 g_i (H(y) - H_0) / sum_j (s_j g_j)^2,

        repeated until the rest is rounding. This is for loose tolerances: a run takes about half the time,
        since without it the energy needs equations solved to rounding and a quadrature whose error is
        at rounding. The method is then a projection: the energy is put right, not conserved by the equations,
        and says nothing about the trajectory, whose error follows the tolerance; the step is not symmetric,
        and other invariants are kept only as far as the tolerance. Systems whose energy is a formula without
        the time; no Poisson systems, no ``variations``. Trajectories of an ensemble go one by one, not in
        lanes. States by ``sample="dense"`` are not projected. Left out: no projection (`test_projection`).

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
    >>> bool(solution.errors()["energy"].max() < 1e-14)  # of degree 3, so that 6 nodes do
    True
    >>> integrate(problem, HBVM(), [1000.0]).status  # chooses everything itself
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

    library = "hbvm-bench"
    citation = CITATION
    family = "hbvm"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.h is None and self.tol is None:
            object.__setattr__(self, "tol", TOLERANCE)
        if (self.k is None) != (self.s is None):
            missing = "k" if self.k is None else "s"
            raise InputError(f"HBVM needs k and s, or neither of them; give {missing} too.")
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

    def accepts(self, problem: Problem) -> str | None:
        """Accept every system; Poisson ones by fixed-point iteration, with a projection one with energy."""
        return self._refusal(problem.system)

    def caveat(self, problem: Problem) -> str | None:
        """Name a field with kinks that these options do not look for; see the class."""
        poisson = problem.system.kind == "poisson"
        why = (
            "the steps that keep a Poisson system's energy do not detect discontinuities" if poisson else None
        )
        why = why or blind(self.k, self.tol, self.solver)
        kinks = unseen(problem, why) if poisson or self.tol is None else unseen_in_time(problem, why)
        return kinks or unknown_kinks(problem, self.k, self.tol, self.breakpoints)

    def conserved(self, system: System) -> dict[str, float]:
        """Return the energy, with a tolerance: at rounding where k is chosen, or with a projection."""
        if self.tol is None or "energy" not in system.invariants:
            return {}
        if system.energy is None and self.projection is None:
            return {}
        return {"energy": 0.0 if self.k is None or self.projection else self.tol}

    def as_hbvm(self) -> "HBVM":
        """Return this method itself."""
        return self

    def control(self) -> dict[str, Any]:
        """Return those of ``max_step``, ``breakpoints``, ``max_steps`` and ``atol`` that are given."""
        names = ("max_step", "breakpoints", "max_steps", "atol")
        return {name: value for name, value in self.options().items() if name in names}

    def _refusal(self, system: System) -> str | None:
        if self.projection and (why := _not_projected(system)):
            return f"projection={self.projection!r} {why}; leave it out."
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
        program = self._compiled(system)
        program.method = self
        return program

    def _compiled(self, system: System) -> Any:
        keep = () if system.kind == "poisson" else None
        tol = self.tol
        if tol is not None:
            from integrators.kernel.program import AdaptiveProgram

            def program(choice: tuple[int, int, float | None], tol: float = tol) -> AdaptiveProgram:
                k, s, defect = choice
                return AdaptiveProgram(
                    system, k=k, s=s, tol=tol, defect=defect, h=self.h, solver=self.solver, keep=keep,
                    projected=self.projection is not None, **self.control(),
                )  # fmt: skip

            if self.k is not None and self.s is not None:
                return program((self.k, self.s, None))
            from integrators.methods.automatic import ACCURATE_IN_LANES, MANY, choose, choose_projected

            if self.projection:
                return program(choose_projected(tol))
            alone, many = choose(system, tol), choose(system, tol, lanes=True)
            single = program(alone)
            if many != alone:
                accurate = many[0] < MANY and tol == TOLERANCE
                single.for_many = lambda: program(many, ACCURATE_IN_LANES if accurate else tol)
            return single
        from integrators.kernel.program import HBVMProgram  # numba is for those who integrate

        assert self.h is not None
        assert self.k is not None
        assert self.s is not None
        return HBVMProgram(system, k=self.k, s=self.s, h=self.h, solver=self.solver, keep=keep)


def _not_projected(system: System) -> str | None:
    """Return why steps cannot end on a surface of the system's energy; ``None`` if they can."""
    energy = system.invariants.get("energy")
    if system.kind == "poisson":
        return "is not for Poisson systems, whose line integrals conserve the energy"
    if energy is None or not system.traced:
        return f"needs a field and an energy that are formulas, the energy without time; not {system.name}"
    if len(energy.outputs) != 1 or any(node.flags & T for node in energy.roots):
        return f"needs an energy that is one number and does not depend on the time, unlike {system.name}'s"
    return None
