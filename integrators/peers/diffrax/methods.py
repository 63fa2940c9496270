"""diffrax's symplectic and reversible solvers, Dopri8, Tsit5 and Kvaerno5, on the CPU in double precision."""

import os
from dataclasses import dataclass
from typing import ClassVar

from integrators.options import NotNegative, Share, Step
from integrators.peers import UNTRACED
from integrators.peers.diffrax.steps import DiffraxProgram
from integrators.protocol import MethodBase, cite
from problems.errors import InputError
from problems.problem import Problem, System

NO_FMA = ("xla_cpu_max_isa=AVX ", "xla_cpu_max_isa=SSE4_2 ")
"""Settings of XLA_FLAGS, followed by a space, with which XLA has no instruction that fuses."""


@dataclass(frozen=True, kw_only=True, repr=False)
class DiffraxMethod(MethodBase):
    """What diffrax's methods share.

    ``stats.extra["compile_seconds"]`` counts what had to be compiled after
    `compile`: integrating backwards in time needs code of its own. The plain solve of ``"end"`` is compiled
    when it is first asked for; whoever times it runs it once before.
    """

    evaluations: ClassVar[int | None]  # of a step; None: not known
    library = "diffrax"
    built = "compiled on this machine by XLA"
    computes_with = ("jax", "jaxlib", "equinox", "lineax", "optimistix")
    to_end = "end"
    citation = cite("Kidger2021")

    def refuses(self, system: System) -> str | None:
        """Refuse what is not traced."""
        return None if system.traced else UNTRACED

    def caveat(self, problem: Problem) -> str | None:
        """Say that XLA's contractions break a symmetry that rounding would keep."""
        if not problem.system.guards or any(isa in f"{os.environ.get('XLA_FLAGS', '')} " for isa in NO_FMA):
            return None
        return (
            "JAX's compiler fuses multiplications with additions, which rounds mirror images differently and "
            "breaks the problem's symmetry; XLA_FLAGS=--xla_cpu_max_isa=AVX in the environment prevents it."
        )

    def compile(self, system: System) -> DiffraxProgram:
        """Have JAX compile the solve for ``system``."""
        return DiffraxProgram(system, self)


@dataclass(frozen=True, kw_only=True, repr=False)
class _FixedMethod(DiffraxMethod):
    h: Step

    evaluations = 1


@dataclass(frozen=True, kw_only=True, repr=False)
class SemiImplicitEuler(_FixedMethod):
    """diffrax's semi-implicit Euler method, its only symplectic one: q from p, then p from the new q.

    Parameters
    ----------
    h : float
        Length of a step, > 0.

    Examples
    --------
    >>> import problems
    >>> from integrators import SemiImplicitEuler, integrate
    >>> integrate(problems.load("pendulum"), SemiImplicitEuler(h=0.01), [0.0, 10.0]).stats.steps
    1000
    """

    order = 1
    family = "splitting"

    def refuses(self, system: System) -> str | None:
        """Return None for H = sum of c p^2/2 + V(q, t), else the reason."""
        if system.separable or not system.traced:
            return super().refuses(system)
        return (
            "it needs a separable Hamiltonian, H = sum of c p^2/2 + V(q, t), to take q' from p and p' from q."
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class LeapfrogMidpoint(_FixedMethod):
    """diffrax's leapfrog/midpoint method, y_{n+1} = y_{n-1} + 2 h f(y_n): order 2, not symplectic.

    A sample between steps uses the same formula with a shorter last step.

    Parameters
    ----------
    h : float
        Length of a step, > 0.

    Examples
    --------
    >>> import problems
    >>> from integrators import LeapfrogMidpoint, integrate
    >>> integrate(problems.load("pendulum"), LeapfrogMidpoint(h=0.01), [0.0, 10.0]).stats.steps
    1000
    """

    order = 2
    family = "multistep"
    citation = cite("Kidger2021", "Shampine2009")


@dataclass(frozen=True, kw_only=True, repr=False)
class ReversibleHeun(_FixedMethod):
    """diffrax's reversible Heun method: order 2, algebraically reversible in its pair of states.

    Parameters
    ----------
    h : float
        Length of a step, > 0.

    Examples
    --------
    >>> import problems
    >>> from integrators import ReversibleHeun, integrate
    >>> integrate(problems.load("pendulum"), ReversibleHeun(h=0.01), [0.0, 10.0]).stats.steps
    1000
    """

    order = 2
    family = "reversible"
    citation = cite("Kidger2021", "KidgerFosterLiLyons2021")


@dataclass(frozen=True, kw_only=True, repr=False)
class _EitherMethod(DiffraxMethod):
    """An explicit Runge-Kutta method at a fixed step size or an adaptive one."""

    h: Step | None = None
    rtol: Share | None = None
    atol: NotNegative | None = None

    family = "runge-kutta"

    def __post_init__(self) -> None:
        super().__post_init__()
        name = type(self).__name__
        tolerances = self.rtol is not None or self.atol is not None
        if (self.h is None) != tolerances or (tolerances and (self.rtol is None or self.atol is None)):
            raise InputError(
                f"{name} needs either h, as in {name}(h=0.1), or both tolerances, as in "
                f"{name}(rtol=1e-9, atol=1e-12), not h={self.h!r}, rtol={self.rtol!r}, atol={self.atol!r}."
            )


@dataclass(frozen=True, kw_only=True, repr=False)
class Dopri8(_EitherMethod):
    """diffrax's Runge-Kutta method of order 8(7) of Prince and Dormand, at a fixed step or adaptive.

    Give either ``h`` or both tolerances.

    Parameters
    ----------
    h : float, optional
        Length of a step, > 0.
    rtol, atol : float, optional
        Tolerances of diffrax's default (integral) controller.

    Notes
    -----
    Adaptive: the last step before each sample is shortened onto it and the next is of
    the length the controller wanted before (``"stop"``); ``"steps"`` gives the
    steps that are taken without samples.

    Examples
    --------
    >>> import problems
    >>> from integrators import Dopri8, integrate
    >>> solution = integrate(problems.load("pendulum"), Dopri8(rtol=1e-10, atol=1e-12), [0.0, 10.0])
    >>> bool(solution.errors()["energy"].max() < 1e-8)
    True
    """

    order = 8
    evaluations = 13
    citation = cite("Kidger2021", "PrinceDormand1981")


@dataclass(frozen=True, kw_only=True, repr=False)
class Tsit5(_EitherMethod):
    """diffrax's Runge-Kutta method of order 5(4) of Tsitouras, at a fixed step size or adaptive.

    Give either ``h`` or both tolerances.

    Parameters
    ----------
    h : float, optional
        Length of a step, > 0.
    rtol, atol : float, optional
        Tolerances of diffrax's default (integral) controller.

    Notes
    -----
    Samples as of `Dopri8`.

    Examples
    --------
    >>> import problems
    >>> from integrators import Tsit5, integrate
    >>> solution = integrate(problems.load("pendulum"), Tsit5(rtol=1e-8, atol=1e-10), [0.0, 10.0])
    >>> bool(solution.errors()["energy"].max() < 1e-6)
    True
    """

    order = 5
    evaluations = 6
    citation = cite("Kidger2021", "Tsitouras2011")


@dataclass(frozen=True, kw_only=True, repr=False)
class Kvaerno5(DiffraxMethod):
    """diffrax's singly diagonally implicit Runge-Kutta method of order 5(4) of Kvaerno, for stiff systems.

    Parameters
    ----------
    rtol, atol : float
        Tolerances of diffrax's default (integral) controller, and of the Newton iteration.

    Notes
    -----
    Samples as of `Dopri8`. Evaluations are not counted: diffrax does not tell how many iterations it takes.
    The method's third node is at 1.23 of a step: the field is evaluated beyond the last time.

    Examples
    --------
    >>> import problems
    >>> from integrators import Kvaerno5, integrate
    >>> integrate(problems.load("pendulum"), Kvaerno5(rtol=1e-6, atol=1e-8), [0.0, 10.0]).status
    <Status.FINISHED: 'finished'>
    """

    rtol: Share
    atol: NotNegative

    h: ClassVar[None] = None
    order = 5
    evaluations = None
    family = "runge-kutta"
    citation = cite("Kidger2021", "Kvaerno2004")
