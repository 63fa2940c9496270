"""HBVM(k, s) and Gauss(s) as solvers of diffrax.

    import diffrax, jax.numpy as jnp
    from integrators.plugins.diffrax import HBVM

    jax.config.update("jax_enable_x64", True)
    term = diffrax.ODETerm(lambda t, y, args: jnp.stack([y[1], -jnp.sin(y[0])]))
    solution = diffrax.diffeqsolve(
        term, HBVM(k=8, s=4), 0.0, 100.0, 0.1, jnp.array([0.0, 1.9]),
        saveat=diffrax.SaveAt(steps=True),
    )

All features of diffrax are supported: jit, vmap, any PyTree as a state,
dense output, step size controllers, events, all of its adjoints. A term of a traced
system is ``diffrax.ODETerm(problems.targets.jax(system, "field"))`` with ``args=par``.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from integrators.coefficients.legendre import polynomials, tables
from integrators.kernel.tolerance import error_order, left_out
from integrators.options import Stages
from integrators.peers import load
from problems.checks import checked
from problems.errors import InputError

load("diffrax", "diffrax", "equinox", "jax", "lineax", "optimistix")

import diffrax as dx  # noqa: E402
import equinox as eqx  # noqa: E402
import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import lineax as lx  # noqa: E402
import optimistix as optx  # noqa: E402

from integrators.plugins.diffrax.arithmetic import add, apply, real  # noqa: E402
from integrators.plugins.diffrax.fixed_point import FixedPoint  # noqa: E402
from integrators.plugins.diffrax.interpolation import LegendreInterpolation  # noqa: E402
from integrators.plugins.diffrax.states import end_state, states  # noqa: E402
from integrators.plugins.rule import FARTHEST, FLOOR, MODES  # noqa: E402

__all__ = ["HBVM", "FixedPoint", "Gauss", "end_state", "states"]

DENSE = 48  # unknowns up to which derivatives solve by LU; GMRES beyond


class _Carried(eqx.Module):
    """What one step hands to the next: what was rounded off, and the coefficients to guess from."""

    rest: Any
    coefficients: Any
    length: Any


class _LineIntegral(dx.AbstractImplicitSolver[_Carried], dx.AbstractAdaptiveSolver[_Carried]):
    """What HBVM and Gauss share: the step."""

    k: eqx.AbstractVar[int]
    s: eqx.AbstractVar[int]
    root_finder: optx.AbstractRootFinder = eqx.field(default_factory=FixedPoint, kw_only=True)  # pyright: ignore[reportIncompatibleVariableOverride]
    root_find_max_steps: int = eqx.field(default=400, static=True, kw_only=True)  # pyright: ignore[reportIncompatibleVariableOverride]
    linear_solver: lx.AbstractLinearSolver | None = eqx.field(default=None, kw_only=True)

    term_structure: ClassVar = dx.AbstractTerm
    interpolation_cls: ClassVar[Callable[..., LegendreInterpolation]] = LegendreInterpolation

    def order(self, terms: Any) -> int:
        """Order of convergence, 2s."""
        return 2 * self.s

    def error_order(self, terms: Any) -> int:
        """Order of the error estimate of a step, 2s + 1."""
        return int(error_order(self.s))

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        """Evaluate the vector field."""
        return terms.vf(t0, y0, args)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> _Carried:
        """Return the state before the first step: no rounding, no previous step."""
        return _Carried(
            rest=jax.tree.map(jnp.zeros_like, y0),
            coefficients=jax.tree.map(lambda y: jnp.zeros((self.s, *jnp.shape(y)), jnp.result_type(y)), y0),
            length=jnp.zeros_like(t1 - t0),
        )

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: _Carried, made_jump: Any
    ) -> tuple[Any, Any, dict[str, Any], _Carried, Any]:
        """Take one step; see `diffrax.AbstractSolver.step`."""
        table = tables(self.k, self.s)
        control = terms.contr(t0, t1)
        h = t1 - t0
        times = t0 + jnp.asarray(table.nodes.hi, jnp.result_type(h)) * h
        guess, guessed = self._guess(solver_state, h, made_jump)
        rest = jax.lax.stop_gradient(solver_state.rest)
        solved = optx.root_find(
            _Equations(self.k, self.s),
            self.root_finder,
            guess,
            (terms, control, times, y0, rest, args),
            options={"state": jax.lax.stop_gradient(y0), "guessed": guessed},
            has_aux=True,
            max_steps=self.root_find_max_steps,
            adjoint=optx.ImplicitAdjoint(self._linear_solver(guess)),
            throw=False,
        )
        G = solved.value
        y1, rest = add(y0, rest, jax.tree.map(lambda g: g[0], G))
        result = dx.RESULTS.promote(solved.result)
        good = dx.is_okay(result)
        error = self._estimate(terms, t0, y0, args, control, G, jax.lax.stop_gradient(solved.aux))
        error = jax.tree.map(lambda e: jnp.where(good, e, jnp.inf), error)
        # Controllers put y0 in the place of what is not a number, but divide by what is infinite.
        y1 = jax.tree.map(lambda y: jnp.where(good, y, jnp.nan), y1)
        carried = jax.lax.stop_gradient(_Carried(rest, G, h))
        return y1, error, {"y0": y0, "coefficients": G}, carried, result

    def _guess(self, before: _Carried, h: Any, made_jump: Any) -> tuple[Any, Any]:
        """Extrapolate the previous step's polynomial; return it, and whether there was one."""
        table, modes = tables(self.k, self.s), min(self.s, MODES)
        length = jnp.where(before.length == 0.0, jnp.inf, before.length)
        ratio = jax.lax.stop_gradient(h / length)
        guessed = (ratio > 0.0) & (ratio <= FARTHEST) & ~jnp.asarray(made_jump)
        ratio = jnp.where(guessed, ratio, 0.0)
        nodes, projection = (jnp.asarray(x.hi, ratio.dtype) for x in (table.nodes, table.projection))
        beyond = jnp.stack(polynomials(1.0 + ratio * nodes, modes), axis=1)
        matrix = jnp.where(guessed, ratio * (projection @ beyond), 0.0)
        guess = jax.tree.map(lambda G: apply(matrix, G[:modes]), before.coefficients)
        return jax.lax.stop_gradient(guess), guessed

    def _estimate(self, terms: Any, t0: Any, y0: Any, args: Any, control: Any, G: Any, values: Any) -> Any:
        """Estimate the error of a step: ``h |gamma_s| (|gamma_s| / |gamma_0|)``, of order 2s + 1.

        gamma_s is the next Legendre coefficient of the field along the step. For
        k > s the stages give it. At k = s nodes P_s vanishes, and what the
        polynomial misses at the start of the step takes its place. The ratio in
        brackets is taken over each leaf of the state.
        """
        if self.k > self.s:
            next_row = tables(self.k, self.s + 1).projection.hi[self.s]
            beyond = jax.tree.map(lambda f: apply(next_row[None], f)[0], values)
        else:
            start = np.array(polynomials(0.0, self.s + 1))
            field = terms.vf_prod(t0, y0, args, control)
            beyond = jax.tree.map(
                lambda f, g: (f - apply(start[None, :-1], g)[0]) / float(start[-1]), field, G
            )

        def estimate(y: Any, g: Any, b: Any) -> Any:
            if b.size == 0:
                return jnp.zeros(y.shape, real(y.dtype))
            size = jnp.abs(y) + jnp.max(jnp.abs(g), axis=0)
            size = jnp.maximum(size, FLOOR * jnp.max(size) + jnp.finfo(size.dtype).tiny)
            top, bottom = (jnp.sqrt(jnp.sum((jnp.abs(x) / size) ** 2)) for x in (b, g[0]))
            return left_out(jnp.abs(b), top, jnp.where(bottom == 0.0, 1.0, bottom))

        return jax.lax.stop_gradient(jax.tree.map(estimate, y0, G, beyond))

    def _linear_solver(self, unknowns: Any) -> lx.AbstractLinearSolver:
        if self.linear_solver is not None:
            return self.linear_solver
        if sum(x.size for x in jax.tree.leaves(unknowns)) <= DENSE:
            return lx.AutoLinearSolver(well_posed=True)
        tolerance = 100.0 * max(float(jnp.finfo(x.dtype).eps) for x in jax.tree.leaves(unknowns))
        return lx.GMRES(rtol=tolerance, atol=tolerance)


def _count(name: str) -> Any:
    """Return a field for a number of stages, checked as the option of `integrators.HBVM` is."""
    return eqx.field(static=True, kw_only=True, converter=lambda n: checked("the solver", name, n, Stages))


class HBVM(_LineIntegral):
    """HBVM(k, s), which conserves the energy, as a solver of diffrax.

    It does not conserve the energy of a Poisson system y' = B(y) grad H(y) with variable B, because a term
    does not contain B.

    Equations and properties: see `integrators.HBVM`. The step size is that of `diffrax.diffeqsolve`, constant
    or chosen by a controller; the energy is conserved for any sequence of step sizes. The error estimate is
    ``h |gamma_s|^2 / |gamma_0|``.

    Parameters
    ----------
    k, s : int
        Nodes of the quadrature and degree of the polynomial, k >= s >= 1; the order is 2s.
    root_finder : optimistix.AbstractRootFinder
        Default: a fixed-point iteration to round-off (`FixedPoint`). For stiff
        systems give ``optimistix.Newton(rtol=1e-13, atol=1e-13)`` or ``Chord``.
    root_find_max_steps : int
        Iterations after which a step counts as failed.
    linear_solver : lineax.AbstractLinearSolver, optional
        For derivatives, which are computed by the implicit function theorem, at the cost of one linear solve
        per step. Default: LU up to 48 unknowns
        (s times the size of the state), GMRES beyond.

    Raises
    ------
    problems.errors.InputError
        If not k >= s >= 1.
    """

    k: int = _count("k")
    s: int = _count("s")

    def __check_init__(self) -> None:
        if self.k < self.s:
            raise InputError(f"HBVM needs k >= s; k={self.k} is less than s={self.s}: raise k or lower s.")


class Gauss(_LineIntegral):
    """Gauss(s), the symplectic collocation method of order 2s, as a solver of diffrax.

    Identical to ``HBVM(k=s, s=s)``. With a variable step size it loses the long-time behaviour of a
    symplectic method; HBVM still conserves the energy.

    Parameters
    ----------
    s : int
        Number of stages, s >= 1.
    root_finder, root_find_max_steps, linear_solver
        As for `HBVM`.
    """

    s: int = _count("s")

    @property
    def k(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Number of nodes, s."""
        return self.s


class _Equations(eqx.Module):
    """``G - P' Omega h f(t_l, y + (rest + I G))``, with the field's values as auxiliary output."""

    k: int = eqx.field(static=True)
    s: int = eqx.field(static=True)

    def __call__(self, G: Any, given: Any) -> tuple[Any, Any]:
        terms, control, times, y0, rest, args = given
        table = tables(self.k, self.s)
        stages = jax.tree.map(lambda y, e, g: y[None] + (e[None] + apply(table.integrals.hi, g)), y0, rest, G)
        values = jax.vmap(lambda t, y: terms.vf_prod(t, y, args, control))(times, stages)
        values = jax.tree.map(lambda f, g: f.astype(g.dtype), values, G)
        return jax.tree.map(lambda g, f: g - apply(table.projection.hi, f), G, values), values
