"""pynamicalsys' symplectic steps of Hamiltonian systems: Yoshida's composition and the midpoint rule.

Its exponents and sections, which follow trajectories by themselves, are compared in ``examples/exponents.py``
and ``examples/section.py``.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators.options import Count, NotNegative
from integrators.peers import load
from integrators.protocol import Array, cite
from integrators.stepping import FixedStep, March
from problems.problem import System


@dataclass(frozen=True, kw_only=True, repr=False)
class Yoshida4(FixedStep):
    """pynamicalsys' ``svy4``: Yoshida's composition of order 4 of three steps of the velocity Verlet method.

    It takes H = sum of c p^2/2 + V(q) without explicit time.

    Parameters
    ----------
    h : float
        Step size, > 0.

    Notes
    -----
    The library is no part of the extra ``peers``: ``pip install pynamicalsys``. Its compiled steps call the
    compiled force; there is no compensated summation, so that rounding errors grow as a random walk at best.

    Examples
    --------
    >>> import problems
    >>> from integrators import Yoshida4, integrate
    >>> pendulum = problems.load("pendulum")
    >>> solution = integrate(pendulum, Yoshida4(h=0.02), [0.0, 10.0])
    >>> bool(solution.errors()["energy"].max() < 1e-6)
    True
    """

    library = "pynamicalsys"
    built = "compiled on this machine by numba"
    computes_with = ("numpy", "numba")
    family = "splitting"
    order = 4
    evaluations = 6  # each of its steps of the velocity Verlet method has two
    citation = cite("Yoshida1990", "RolimSalesEtAl2025")

    def refuses(self, system: System) -> str | None:
        """Return None for H = sum of c p^2/2 + V(q), else the reason."""
        if not system.separable:
            return "it needs a separable Hamiltonian, H = sum of c p^2/2 + V(q), to drift and kick in turn."
        return _with_time(system)

    def march(self, system: System) -> March:
        """Return what takes steps: the library's own."""
        one_step, dof = _step("yoshida_4th_step"), system.dof or 0
        import numba

        grad_T, grad_V = gradients(system)

        @numba.njit(error_model="numpy")
        def march(t: float, h: float, first: int, n: int, y: Array, par: Array) -> None:
            q, p = y[:dof].copy(), y[dof:].copy()
            for _ in range(n):
                q, p = one_step(q, p, h, grad_T, grad_V, par)
            y[:dof], y[dof:] = q, p

        return march


@dataclass(frozen=True, kw_only=True, repr=False)
class ImplicitMidpoint(FixedStep):
    """pynamicalsys' ``imp``: the implicit midpoint rule, of order 2, solved by Newton's iteration.

    It takes any Hamiltonian without explicit time. The mathematical method is that of ``Gauss(s=1)``.

    Parameters
    ----------
    h : float
        Step size, > 0.
    tol : float
        The iteration ends where the residual's Euclidean norm, absolute, is below this.
    max_iter : int
        Iterations of a step at most.

    Notes
    -----
    The library is no part of the extra ``peers``: ``pip install pynamicalsys``. Where the iteration does not
    converge it prints so; the status is then ``NOT_FINITE``.

    Examples
    --------
    >>> import problems
    >>> from integrators import ImplicitMidpoint, integrate
    >>> pendulum = problems.load("double_pendulum", t_end=1.0)
    >>> solution = integrate(pendulum, ImplicitMidpoint(h=0.001))
    >>> bool(solution.errors()["energy"].max() < 1e-5)
    True
    """

    tol: NotNegative = 1e-12
    max_iter: Count = 50

    library = "pynamicalsys"
    built = "compiled on this machine by numba"
    computes_with = ("numpy", "numba")
    family = "Gauss"
    order = 2
    citation = cite("RolimSalesEtAl2025")

    def refuses(self, system: System) -> str | None:
        """Return None for a Hamiltonian without explicit time, else the reason."""
        if system.kind != "hamiltonian":
            return "it needs a Hamiltonian, H(q, p)."
        if system.jacobian() is None:
            return "it needs the second derivatives of H, which have too many entries here."
        return _with_time(system)

    def march(self, system: System) -> March:
        """Return what takes steps: the library's own."""
        one_step, dof = _step("implicit_midpoint_step"), system.dof or 0
        import numba

        motion, hessian = equations(system)
        tol, limit = self.tol, self.max_iter

        @numba.njit(error_model="numpy")
        def march(t: float, h: float, first: int, n: int, y: Array, par: Array) -> None:
            q, p = y[:dof].copy(), y[dof:].copy()
            for _ in range(n):
                try:
                    q, p = one_step(q, p, h, motion, hessian, par, tol, limit)
                except Exception:  # its iteration does not converge, or its matrix is singular
                    q, p = np.full(dof, np.nan), np.full(dof, np.nan)
                    break
            y[:dof], y[dof:] = q, p

        return march


def gradients(system: System) -> tuple[Any, Any]:
    """Return ``grad_T(p, par)`` and ``grad_V(q, par)`` of a separable Hamiltonian, compiled."""
    import numba

    from problems import targets

    force, scale = targets.numba(system, "force"), targets.numba(system, "velocity_scale")
    dof = system.dof or 0

    @numba.njit(error_model="numpy")
    def grad_T(p: Array, par: Array) -> Array:
        c = np.empty(dof)
        scale(0.0, p, par, c)  # of the parameters alone
        return c * p

    @numba.njit(error_model="numpy")
    def grad_V(q: Array, par: Array) -> Array:
        F = np.empty(dof)
        force(0.0, q, par, F)
        return -F

    return grad_T, grad_V


def equations(system: System) -> tuple[Any, Any]:
    """Return ``eom(q, p, par) -> (q', p')`` and ``hess_H(q, p, par)``, compiled."""
    import numba

    from problems import targets

    jacobian = system.jacobian()
    assert jacobian is not None
    field, entries = targets.numba(system, "field"), targets.numba(system, jacobian)
    dof, dim = system.dof or 0, system.dim
    # The Hessian of H has the rows of the field's Jacobian in other places: q' = H_p, p' = -H_q.
    rows = np.where(jacobian.rows < dof, jacobian.rows + dof, jacobian.rows - dof)
    columns, signs = np.asarray(jacobian.columns), np.where(jacobian.rows < dof, 1.0, -1.0)

    @numba.njit(error_model="numpy")
    def eom(q: Array, p: Array, par: Array) -> tuple[Array, Array]:
        slope = np.empty(dim)
        field(0.0, np.concatenate((q, p)), par, slope)
        return slope[:dof], slope[dof:]

    @numba.njit(error_model="numpy")
    def hess_H(q: Array, p: Array, par: Array) -> Array:
        values, matrix = np.empty(rows.size), np.zeros((dim, dim))
        entries(0.0, np.concatenate((q, p)), par, values)
        for i in range(rows.size):
            matrix[rows[i], columns[i]] = signs[i] * values[i]
        return matrix

    return eom, hess_H


def _step(name: str) -> Any:
    """Return one of the library's compiled steps."""
    return getattr(load("pynamicalsys", "pynamicalsys.hamiltonian_systems.fixed_step"), name)


def _with_time(system: System) -> str | None:
    """Return the reason why a Hamiltonian with explicit time is refused."""
    if "energy" in system.invariants:
        return None
    return "its functions of q and p take no time, but this Hamiltonian depends on it."
