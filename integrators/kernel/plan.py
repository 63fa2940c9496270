"""What a method does with one system, as data: from it a program is made."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Plan:
    """HBVM(k, s) for one system; `integrators.kernel.program.Program` is made of it.

    Attributes
    ----------
    k, s : int
        Stages and degree, k >= s >= 1; k > 1 where there is a tolerance.
    h : float or None
        Length of a step, > 0; with a tolerance of the first one, ``None``: chosen.
    tol : float or None
        Local error per step, relative to the size of each block of the state; ``None``: all steps have
        the length h.
    quadrature_error : float or None
        The same for the error of the quadrature, by which the energy changes; ``None``: any.
    form : {"first", "second"} or None
        Whether stages hold the whole state, or only positions (q'' = a(q), for separable systems: half the
        unknowns, half the iterations). ``None``: the second-order form wherever the system has one, but for
        blended iteration.
    solver : {"auto", "fixed_point", "newton", "blended"}
        How the stage equations are solved; see `integrators.methods.hbvm.HBVM`.
    keep : sequence of str or None
        Invariants to keep by line integrals, by name; ``name[i]`` for one component of a vector. If there is
        none in it, the energy of a Poisson system. First-order form, fixed point.
    max_step : float or None
        Length that no step exceeds.
    breakpoints : sequence of float
        Times that steps end at, besides those at which the formulas switch.
    max_steps : int or None
        Steps of a trajectory, at most.
    atol : float, sequence of float or None
        Local error per step that is always allowed, of all components or of each.
    projected : bool
        Whether steps are solved to a part of the tolerance and then moved to the energy of the start; see
        `integrators.kernel.step.projection`.
    reversible : bool
        Whether steps are the same backwards, about as long as ordinary ones of the tolerance; k = s, for
        traced systems without time. See `integrators.kernel.reversible`.
    many : Plan or None
        What is done with many trajectories, if they go in lanes; ``None``: the same.
    """

    k: int
    s: int
    h: float | None = None
    tol: float | None = None
    quadrature_error: float | None = None
    form: str | None = None
    solver: str = "auto"
    keep: Sequence[str] | None = None
    max_step: float | None = None
    breakpoints: Sequence[float] = ()
    max_steps: int | None = None
    atol: float | Sequence[float] | None = None
    projected: bool = False
    reversible: bool = False
    many: "Plan | None" = None
