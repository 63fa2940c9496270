"""SciPy's DOP853, Radau, BDF and LSODA, with compiled vector fields."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from integrators.options import NotNegative, Share
from integrators.peers.scipy.steps import SciPyProgram
from integrators.protocol import MethodBase, cite
from problems.errors import InputError
from problems.problem import System

RTOL_FLOOR = 100 * float(np.finfo(np.float64).eps)
"""SciPy silently raises a smaller rtol to this (`scipy.integrate._ivp.common.validate_tol`)."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SciPyMethod(MethodBase):
    """What SciPy's methods share; see `SciPyStepper` for the sampling.

    The tolerances hold for the local error: ``atol + rtol |y|`` in each component.
    """

    rtol: Share
    atol: NotNegative

    solver: ClassVar[str]
    implicit: ClassVar[bool] = False  # whether it takes a Jacobian
    multistep: ClassVar[bool] = False
    library = "scipy"
    built = "generic wheel; vector field compiled on this machine by numba"
    computes_with = ("numpy", "numba")
    to_end = "stop"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rtol < RTOL_FLOOR:
            raise InputError(
                f"rtol={self.rtol!r} is below what SciPy attains (100 times the double's epsilon); "
                f"the least is rtol={RTOL_FLOOR!r}."
            )

    def compile(self, system: System) -> "SciPyProgram":
        """Compile the vector field of ``system``."""
        return SciPyProgram(system, self)


@dataclass(frozen=True, kw_only=True, repr=False)
class DOP853(SciPyMethod):
    """SciPy's explicit Runge-Kutta method of order 8(5,3) of Dormand and Prince, adaptive.

    Parameters
    ----------
    rtol : float
        Relative tolerance, at least 100 times the double's epsilon (2.2e-14).
    atol : float
        Absolute tolerance, >= 0.

    Notes
    -----
    The step loop is SciPy's and runs in Python: 12 evaluations of the compiled
    field a step at about 3 microseconds each, most of it not the field.

    Examples
    --------
    >>> import problems
    >>> from integrators import DOP853, integrate
    >>> solution = integrate(problems.load("pendulum"), DOP853(rtol=1e-12, atol=1e-14), [0.0, 10.0])
    >>> bool(solution.errors()["energy"].max() < 1e-10)
    True
    """

    solver = "DOP853"
    citation = cite("Virtanen2020", "HairerNorsettWanner1993")
    family = "runge-kutta"

    order = 8


@dataclass(frozen=True, kw_only=True, repr=False)
class Radau(SciPyMethod):
    """SciPy's implicit Radau IIA method of order 5, adaptive, for stiff systems.

    Parameters
    ----------
    rtol : float
        Relative tolerance, at least 100 times the double's epsilon (2.2e-14).
    atol : float
        Absolute tolerance, >= 0.

    Notes
    -----
    The Jacobian is the traced system's own (`problems.System.jacobian`), as our implicit methods have
    it; SciPy's finite differences where there is none. It is L-stable, so it damps oscillations:
    no method for conserving energy.

    Examples
    --------
    >>> import problems
    >>> from integrators import Radau, integrate
    >>> integrate(problems.load("pendulum"), Radau(rtol=1e-6, atol=1e-8), [0.0, 10.0]).status
    <Status.FINISHED: 'finished'>
    """

    solver = "Radau"
    implicit = True
    citation = cite("Virtanen2020", "HairerWanner1996")
    family = "runge-kutta"

    order = 5


@dataclass(frozen=True, kw_only=True, repr=False)
class BDF(SciPyMethod):
    """SciPy's backward differentiation formulas of order 1 to 5, in quasi-constant steps, for stiff systems.

    Parameters
    ----------
    rtol : float
        Relative tolerance, at least 100 times the double's epsilon (2.2e-14).
    atol : float
        Absolute tolerance, >= 0.

    Notes
    -----
    The Jacobian is the traced system's own, as for `Radau`. It damps oscillations: no method for conserving
    energy.

    Examples
    --------
    >>> import problems
    >>> from integrators import BDF, integrate
    >>> integrate(problems.load("pendulum"), BDF(rtol=1e-6, atol=1e-8), [0.0, 10.0]).status
    <Status.FINISHED: 'finished'>
    """

    solver = "BDF"
    implicit = multistep = True
    citation = cite("Virtanen2020", "ShampineReichelt1997")
    family = "multistep"


@dataclass(frozen=True, kw_only=True, repr=False)
class LSODA(SciPyMethod):
    """ODEPACK's LSODA in SciPy: Adams' and backward differentiation formulas, changed over where stiff.

    Parameters
    ----------
    rtol : float
        Relative tolerance, at least 100 times the double's epsilon (2.2e-14).
    atol : float
        Absolute tolerance, >= 0.

    Notes
    -----
    The Jacobian is the traced system's own, as a full matrix. There are no checkpoints.

    Examples
    --------
    >>> import problems
    >>> from integrators import LSODA, integrate
    >>> integrate(problems.load("pendulum"), LSODA(rtol=1e-9, atol=1e-11), [0.0, 10.0]).status
    <Status.FINISHED: 'finished'>
    """

    solver = "LSODA"
    implicit = multistep = True
    citation = cite("Virtanen2020", "Petzold1983")
    family = "multistep"
