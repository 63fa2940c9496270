"""Many trajectories on the JAX solver: what ``integrate_many(..., backend="jax")`` runs."""

import importlib
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM
from integrators.plugins import diffrax as plugin  # says what is missing, if JAX or diffrax is
from integrators.protocol import Array, MethodBase, Status, Trajectories
from integrators.refusals import check_batch, check_times
from integrators.running.times import plan
from problems import targets
from problems.errors import InputError
from problems.systems.base import System

import diffrax as dx  # isort: skip
import jax  # isort: skip
import jax.numpy as jnp  # isort: skip

# Newer versions of JAX have it at the top only.
DOUBLE: Any = (
    jax.enable_x64 if hasattr(jax, "enable_x64") else importlib.import_module("jax.experimental").enable_x64
)

SIDE_BY_SIDE = {"cpu": 256, "gpu": 1 << 17}
"""Trajectories that go through the solver at once: what fits in a processor's caches, what fills a GPU."""


class JaxProgram:
    """HBVM(k, s) or Gauss(s) with a fixed step on JAX's default device, in double precision.

    All trajectories of a piece take their steps at the same time; where an iteration has ended for one,
    its values stay.

    Parameters
    ----------
    system : System
        Traced.
    method : MethodBase
        `integrators.HBVM` or `integrators.Gauss` with ``h``.

    Raises
    ------
    problems.errors.InputError
        For a method that the JAX solver does not have, or has not for this system, or without JAX and
        diffrax.
    """

    from_cache = None

    def __init__(self, system: System, method: MethodBase):
        options = method.options(defaults=True)
        h = options.get("h")
        if not isinstance(method, HBVM | Gauss) or h is None:
            raise InputError(
                f"{method} has no form on JAX; use HBVM(k, s, h) or Gauss(s, h), or leave backend= out."
            )
        if options.get("solver") not in (None, "auto", "fixed_point"):
            raise InputError(f"{method} iterates by fixed point on JAX; leave solver= out.")
        if not system.traced:
            raise InputError(
                f"{system.name} has no form on JAX, since its code is not traced; leave backend= out."
            )
        gauss = isinstance(method, Gauss)
        if system.kind == "poisson" and not gauss and options["k"] > options["s"]:
            raise InputError(
                f"{method} has no form on JAX that conserves the energy of a Poisson system such as "
                f"{system.name}; use Gauss(s, h), or leave backend= out."
            )
        kind: Any = plugin.Gauss if gauss else plugin.HBVM
        self._solver = kind(**{name: options[name] for name in ("k", "s") if name in options})
        self._term = dx.ODETerm(targets.jax(system, "field"))
        self.system, self.h, self.compile_seconds = system, float(h), 0.0
        self.piece = SIDE_BY_SIDE.get(jax.default_backend(), SIDE_BY_SIDE["gpu"])
        self._made: dict[tuple[int, float], Any] = {}

    def batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Trajectories:
        """Integrate every start to all times; see `integrators.protocol.Batches`."""
        grid = check_times(times, t0)
        starts, parameters = check_batch(Y0, par, grid, self.system)
        h = -self.h if grid[-1] < t0 else self.h
        targets, parts = plan(grid, np.full(grid.size, t0), h)
        n = len(starts)
        y, taken = np.full((n, grid.size, self.system.dim), np.nan), np.zeros(n, dtype=np.int64)
        with DOUBLE(True):
            run = self._compiled(h, starts[:1], parameters[:1], targets, parts, t0)
            for first in range(0, n, self.piece):
                here = np.minimum(np.arange(first, first + self.piece), n - 1)  # the last one fills the piece
                states, steps = run(starts[here], parameters[here], targets, parts, t0)
                rest = min(self.piece, n - first)
                y[first : first + rest], taken[first : first + rest] = states[:rest], steps[:rest]
        arrived: Any = np.isfinite(y[:, -1]).all(axis=1)
        stop = np.where(arrived, grid[-1], t0 + taken * h)
        reasons = [
            "" if good else f"the step from t = {t:.6g} was not solved."
            for good, t in zip(arrived, stop, strict=True)
        ]
        status = [Status.FINISHED if good else Status.NONLINEAR_DIVERGENCE for good in arrived]
        return Trajectories(grid, y, status, reasons, stop, taken)

    def _compiled(self, h: float, start: Array, par: Array, *plans: Any) -> Any:
        """Return the compiled function of a piece; the number of samples and the step make another one."""
        key = (len(plans[0]), h)
        if key not in self._made:
            began = perf_counter()
            starts, parameters = (np.repeat(rows, self.piece, axis=0) for rows in (start, par))
            function = jax.jit(
                jax.vmap(lambda *given: self._trajectory(h, *given), in_axes=(0, 0, None, None, None))
            )
            self._made[key] = function.lower(starts, parameters, *plans).compile()
            self.compile_seconds += perf_counter() - began
        return self._made[key]

    def _trajectory(
        self, h: float, start: Any, par: Any, targets: Any, parts: Any, t0: Any
    ) -> tuple[Any, Any]:
        """Return the states of one trajectory at all samples, and the steps that were solved."""
        solver, term = self._solver, self._term

        def step(t: Any, length: Any, y: Any, carried: Any) -> tuple[Any, Any]:
            y, _, _, carried, _ = solver.step(term, t, t + length, y, par, carried, made_jump=False)
            return y, carried

        def own(n: Any, now: Any) -> Any:
            y, carried, solved = now
            y, carried = step(t0 + n * h, h, y, carried)
            return y, carried, solved + jnp.isfinite(y).all()

        def sample(now: Any, asked: Any) -> Any:
            n, target, part = asked
            now = jax.lax.fori_loop(n, target, own, now)
            y, carried, _ = now
            there = jax.lax.cond(part == 0.0, lambda: y, lambda: step(t0 + target * h, part, y, carried)[0])
            return now, there

        carried = solver.init(term, t0, t0 + h, start, par)
        begun = jnp.concatenate([jnp.zeros(1, targets.dtype), targets[:-1]])
        (_, _, solved), states = jax.lax.scan(sample, (start, carried, 0), (begun, targets, parts))
        return states, solved
