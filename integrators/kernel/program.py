"""HBVM(k, s) compiled for one system, with fixed or adaptive step size: a `Program`."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.events.event import Event
from integrators.kernel import routes, tables
from integrators.kernel.adaptive import Adaptive
from integrators.kernel.batch import Batch, batch_along, prepare_batch
from integrators.kernel.batch_events import WithEvents
from integrators.kernel.context import Context, Shape, blocks
from integrators.kernel.engines import iterations, look, solver, steps
from integrators.kernel.ensemble.prepared import Lanes, compiled_lanes, lanes_of
from integrators.kernel.fixed import FixedStepper
from integrators.kernel.implicit.workspace import SOLVERS, Workspace, linearization
from integrators.kernel.inside.functions import Action, EventFunction
from integrators.kernel.inside.search import Sought
from integrators.kernel.line.kept import Kept
from integrators.kernel.native import binary, machine
from integrators.kernel.native.field import compile_part
from integrators.kernel.native.foreign import field_of
from integrators.kernel.native.stages import ON_LANES
from integrators.kernel.parts.implicit import ALWAYS_IMPLICIT
from integrators.kernel.plan import Plan
from integrators.kernel.reversible import Reversible
from integrators.kernel.simd.emit import WIDTH
from integrators.kernel.step.rule import (
    LOG_RESIDUAL,
    STAGNATION,
    TOLERANCE,
)
from integrators.kernel.stepper import HBVMStepper
from integrators.kernel.tangent.lanes import VectorLanes
from integrators.kernel.varying import AdaptiveStepper
from integrators.protocol import Array, Compiled
from integrators.refusals import check_parameters, check_start, check_state
from problems import targets
from problems.errors import InputError
from problems.problem import Problem, System

SEARCHES = 8
"""For events, that are kept at most; see `HBVMProgram.with_events`."""


class HBVMProgram(Compiled):
    """HBVM(k, s), compiled for one system; satisfies `integrators.protocol.Program`.

    Parameters
    ----------
    system : System
        What to integrate.
    plan : Plan
        How.

    Attributes
    ----------
    varying : bool
        Whether steps vary in length.
    adaptive : Adaptive or None
        What such steps have besides.

    Raises
    ------
    problems.errors.InputError
        For a form that the system does not have; for an invariant that it does not have, or that depends
        on time; for as many absolute tolerances as no state has components.
    """

    threaded = True
    """Whether `batch` takes threads."""

    def __init__(self, system: System, plan: Plan):
        started = binary.clock()
        self.system, self.plan = system, plan
        self.varying = plan.tol is not None
        form, named = (plan.form, plan.solver) if plan.keep is None else ("first", "fixed_point")
        self.h = 1.0 if plan.h is None else plan.h
        self.solver, self._named = SOLVERS[named], named
        self.second = (system.separable and named != "blended") if form is None else form == "second"
        if self.second and not system.separable:
            raise InputError(f"{system.name} is not separable with constant masses; use form='first'.")
        lanes = tables.lanes_for(plan.k)
        self.constants = tables.constants(plan.k, plan.s, self.second, lanes)
        self.kept = None if plan.keep is None else Kept(system, self.constants, plan.keep)
        quantity = self.kept.values if self.kept else "force" if self.second else "field"
        self._quantity, self.field = quantity, field_of(system, quantity, lanes)
        kernel = steps.code()
        block, group = blocks(system)
        rows = system.dim
        if self.second:
            assert system.dof is not None
            rows = system.dof
            block = block[:rows]
            group = group[: block[-1] + 1]
        anywhere = self._velocity_scale(np.full(system.n_par, np.nan))
        self._velocity_is_fixed = bool(np.isfinite(anywhere).all())  # whatever the parameters
        unit = tables.unit(self.constants, anywhere)
        self.fused = self._iterations(quantity, rows, lanes) if unit and not self.kept else None
        self.shape = Shape(
            rows, self.second, unit, self.field, self.fused,
            system.n_par, block, group, self.constants,
        )  # fmt: skip
        self._fixed = tables.fixed(self.constants)
        if self.varying and self.constants.route != tables.THROUGH:
            self._fixed["raw_matrix"] = tables.rounded(self.constants)
        self.adaptive = self._adaptive()
        self._fresh: tuple[bytes, Context, Context] | None = None
        self._over: list[tuple[Context, Context]] = []
        self.vectors: dict[tuple[int, bool], Context] = {}
        """Contexts of tangent vectors, by their number and whether they move parameters, to be copied."""
        parts = [self.field, kernel, self.fused, *(self.kept.code if self.kept else ())]
        parts += self.adaptive.code if self.adaptive else []
        self.from_cache = all(part.from_cache for part in parts if part is not None)
        self._searches: dict[tuple[tuple[str, int], ...], WithEvents] = {}  # they hold the events
        self._workspace: Workspace | None = None
        self._lanes: dict[tuple[int, ...], Any] = {}  # by vectors' number and whether they move parameters
        self._many: HBVMProgram | None = None
        if self.solver.strategy == ALWAYS_IMPLICIT:
            self.implicit()
        self.compile_seconds = binary.clock() - started

    def _adaptive(self) -> Adaptive | None:
        """Return what steps of a tolerance have besides, if they are such."""
        if not self.varying:
            return None
        if not self.plan.reversible:
            return Adaptive(self.system, self.plan, self.shape, keeps=self.kept is not None)
        ordinary = HBVMProgram(self.system, replace(self.plan, reversible=False, solver="auto"))
        return Reversible(self.system, self.plan, self.shape, ordinary)

    def _iterations(self, quantity: targets.Quantity, rows: int, lanes: int) -> binary.Native | None:
        """Return whole iterations for a system with a few rows, if they can be compiled with its field."""
        if rows > routes.FEW_ROWS or self.constants.route not in (8, 16) or not self.lanes:
            return None
        by_columns = lanes == WIDTH or machine.many_registers()
        return iterations.code(self.system, quantity, lanes, (lanes, rows, by_columns))

    @property
    def description(self) -> str:
        """The method with all that steps depend on, as text."""
        c, form = self.constants, "second" if self.second else "first"
        kept = f", {self.kept.description}" if self.kept else ""
        if self.adaptive:
            return self.adaptive.description(self._named, kept)
        return f"HBVM(k={c.k}, s={c.s}, h={self.h!r}, form={form!r}, solver={self._named!r}{kept})"

    @property
    def free(self) -> bool:
        """Whether nothing but time and tolerance says where steps end, whatever the parameters."""
        return self.adaptive is None or self.adaptive.free

    @property
    def acts(self) -> bool:
        """Whether an event may change the state: no invariants of the start are kept that it would change."""
        return self.kept is None or not self.kept.names

    @property
    def renews(self) -> bool:
        """Whether other parameters leave the velocities by momentum as they are."""
        return not self.second or self._velocity_is_fixed

    @property
    def lanes(self) -> bool:
        """Whether the vector field runs on all stages at once, or on one after another."""
        return self.field.note == ON_LANES

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> HBVMStepper:
        """Return a stepper at ``t0``; ``par`` defaults to the system's own parameters.

        Raises
        ------
        problems.errors.InputError
            If ``y0`` is not finite, or ``y0`` or ``par`` is not of the system's length.
        """
        values = check_parameters(par, self.system)
        state, time = check_state(y0, self.system.dim), check_start(t0)
        return (FixedStepper if self.adaptive is None else AdaptiveStepper)(self, state, values, time)

    def with_events(self, problem: Problem, events: Mapping[str, Event]) -> WithEvents:
        """Compile the functions of events; return what starts a trajectory that looks for them.

        Its arguments are those of `start`, and the time up to which is looked. The last ones are kept, for
        the same events; not those that Python is called for, which know what they have raised.

        Raises
        ------
        problems.errors.InputError
            If a function can neither be traced nor called with numbers.
        """
        started, key = binary.clock(), tuple((name, id(event)) for name, event in events.items())
        if (kept := self._searches.get(key)) is not None:
            return kept
        functions = [EventFunction(name, event.g, problem) for name, event in events.items()]
        actions = {
            name: Action(name, event.then, problem)
            for name, event in events.items()
            if event.then is not None
        }
        look.code()
        self.compile_seconds += binary.clock() - started
        search = WithEvents(self, Sought(events, functions, actions, self.shape))
        if not any(function.calls_back for function in (*functions, *actions.values())):
            if len(self._searches) >= SEARCHES:
                self._searches.pop(next(iter(self._searches)), None)
            self._searches[key] = search
        return search

    def batch(
        self,
        Y0: ArrayLike,
        par: ArrayLike | None = None,
        *,
        times: ArrayLike,
        t0: float = 0.0,
        sample: str | None = None,
        threads: int = 1,
    ) -> Batch:
        """Integrate many starts to the same times, one in each lane of the vector unit.

        The numbers of a trajectory depend on nothing in the others, nor on their order or the
        threads. They are those of ``start`` and ``advance`` up to rounding, or where k and s
        are chosen, and others for lanes, up to the tolerance; bit for bit where
        trajectories go one by one, see `integrators.kernel.batch`.

        Parameters
        ----------
        Y0 : array_like, shape (n, dim)
            Starts.
        par : array_like, shape (n_par,) or (n, n_par), optional
            Parameters, for all or for each; the system's own by default.
        times : array_like, shape (m,)
            Times asked for, strictly monotone from ``t0``.
        t0 : float
            Time of the starts.
        sample : {"partial", "stop", "dense"}, optional
            How states between steps are made; see `HBVMStepper`.
        threads : int
            Threads to share the trajectories among.

        Raises
        ------
        problems.errors.InputError
            For starts, parameters or times that cannot be used.
        """
        program = self.program_of_lanes() if sample in (None, "partial") else self
        return prepare_batch(program, Y0, par, times, check_start(t0), sample, threads)()

    def prepare_batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Callable[[], Batch]:
        """Check and allocate all that `batch` needs; return what then does it, once."""
        return prepare_batch(self.program_of_lanes(), Y0, par, times, check_start(t0))

    def program_of_lanes(self) -> "HBVMProgram":
        """Return the program for many trajectories: itself, unless another takes them in lanes."""
        if self.plan.many is None:
            return self
        if self._many is None:
            program = HBVMProgram(self.system, self.plan.many)
            self._many = self if program.in_lanes() is None else program
            self.compile_seconds += program.compile_seconds
            self.from_cache = self.from_cache and program.from_cache
        return self._many

    def in_lanes(self) -> Lanes | None:
        """Return the method on trajectories in lanes, compiled the first time; ``None`` where it has none."""
        shape = self.second, self.shape.unit, self.varying
        return self._by_lanes((), self.free, lambda: lanes_of(self.system, self.constants, *shape))

    def in_lanes_along(self, count: int, moves: bool) -> VectorLanes | None:
        """Return the method on trajectories in lanes, each with so many tangent vectors, if it has one.

        Parameters
        ----------
        count : int
            Vectors of each trajectory.
        moves : bool
            Whether they have parts in the parameters.

        Returns
        -------
        VectorLanes or None
            ``None`` for adaptive steps, whose lengths would depend on the vectors' errors, for what has no
            lanes or no formula, and for more components and vectors than `VectorLanes.take` allows.
        """
        can = not self.varying and self.system.traced
        return self._by_lanes((count, moves), can, lambda: self._compiled_along(count, moves))

    def _by_lanes(self, key: tuple[int, ...], can: bool, compile_: Callable[[], tuple[Any, float]]) -> Any:
        """Return what runs on lanes, compiled the first time, and count the seconds; ``None``: it cannot."""
        if key not in self._lanes:
            lanes_, seconds = None, 0.0
            if can and self.lanes and not self.kept and self.solver.strategy != ALWAYS_IMPLICIT:
                lanes_, seconds = compile_()
            self.compile_seconds += seconds
            self.from_cache = self.from_cache and (lanes_ is None or lanes_.from_cache)
            self._lanes[key] = lanes_
        return self._lanes[key]

    def _compiled_along(self, count: int, moves: bool) -> tuple[VectorLanes | None, float]:
        """Return the lanes for so many vectors, if they are few enough, and the seconds that took."""
        constants, unit = self.constants, self.shape.unit
        if self.second and moves and not self._velocity_is_fixed:
            # q' = v(par) p, whose derivative is no multiple of a momentum
            constants, unit = tables.constants(constants.k, constants.s, False, constants.lanes), True
        if not VectorLanes.take(self.system, constants, count):
            return None, 0.0
        return compiled_lanes(lambda: VectorLanes(self.system, constants, unit, count, moves))

    def goes_along(self, directions: tuple[Array, Array]) -> bool:
        """Whether `batch_along` has lanes for such vectors; compiled the first time."""
        return self.in_lanes_along(*_vectors_of(directions)) is not None

    def batch_along(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0,
        directions: tuple[Array, Array], threads: int = 1,
    ) -> Batch:  # fmt: skip
        """Integrate many starts with tangent vectors; see `integrators.protocol.BatchesAlong`."""
        lanes = self.in_lanes_along(*_vectors_of(directions))
        if lanes is None:
            raise InputError(f"{self.description} has no lanes for such vectors; integrate one by one.")
        return batch_along(self, lanes, Y0, par, times, check_start(t0), directions, threads)

    def field_of_eight(self) -> binary.Native:
        """Return the field on eight of the stages that lie side by side, compiled or loaded."""
        return field_of(self.system, self._quantity, 8, self.constants.lanes)

    def part_of_field(self) -> binary.Native | None:
        """Return what sets some rows of the field, compiled or loaded, if there is such a function."""
        return self._part

    @cached_property
    def _part(self) -> binary.Native | None:
        if not (self.system.traced and self.lanes):
            return None
        return compile_part(self.system, self._quantity, self.constants.lanes)

    def implicit(self) -> Workspace:
        """Return memory for the implicit solver; its code is compiled, or loaded, the first time."""
        if self._workspace is None:
            native = solver.code()
            self.from_cache = self.from_cache and native.from_cache
            linear = linearization(self.system, second=self.second)
            self._workspace = Workspace(self.shape, self.solver.kind, linear)
        return self._workspace.copy()

    def scaled(self, h: float) -> dict[str, Array]:
        """Return the tables for steps of h, which may be negative."""
        return tables.scaled(self.constants, h, squared=self.second and self.shape.unit)

    def contexts(self, par: Array) -> tuple[Context, Context]:
        """Return memory for a trajectory with these parameters, and for its partial steps.

        It is that of a trajectory that is over, if there is one; see `give_back`.
        """
        key, fresh = par.tobytes(), self._fresh  # read once: another thread may replace it
        if fresh is None or fresh[0] != key:
            own, partial = (
                (self._new_context(partial=False), self._new_context(partial=True))
                if fresh is None
                else (fresh[1].copy(), fresh[2].copy())
            )
            self.renew(own, partial, par)
            self._fresh = fresh = key, own, partial
        try:
            own, partial = self._over.pop()
        except IndexError:
            own, partial = fresh[1].copy(), fresh[2].copy()
        else:
            own.become(fresh[1])
            partial.become(fresh[2])
        if self.kept:
            self.kept.share(own, partial)
        return own, partial

    def give_back(self, own: Context, partial: Context) -> None:
        """Take the memory of a trajectory that is over, for the next one; that of one is enough."""
        if not self._over:
            self._over.append((own, partial))

    def _new_context(self, *, partial: bool) -> Context:
        """Return fresh memory, without parameters."""
        tables = {**self._fixed, **({} if partial or self.varying else self.scaled(self.h))}
        more = self.adaptive.more if self.adaptive else {}
        kept = self.kept
        context = kept.context(self.shape, tables) if kept else Context(self.shape, tables, more)
        context.solver.tolerance, context.solver.stagnation = TOLERANCE, STAGNATION
        context.solver.log_residual = LOG_RESIDUAL
        if self.adaptive:
            self.adaptive.set(context)
        if not partial:
            context.h, context.implicit.strategy = self.h, self.solver.strategy
            context.controller.next_length = (self.plan.h or 0.0) if self.varying else 0.0
        return context

    def renew(self, own: Context, partial: Context, par: Array) -> None:
        """Put parameters and the velocities by momentum that they make into the memory of a trajectory."""
        for context in (own, partial):
            context.par[:] = par
        if self.second:
            velocity, speed = self._velocity_scale(par), np.ones(self.shape.group.size)
            speed[self.shape.block] = np.where(velocity == 0.0, 1.0, np.abs(velocity))
            for context in (own, partial):
                context.factors.velocity[: self.shape.rows] = velocity
                context.blocks.speed[:], context.blocks.mass[:] = speed, 1.0 / speed
        if self.adaptive:
            self.adaptive.renew(own, par)

    def begin(self, own: Context, partial: Context, y: Array, par: Array, t0: float) -> None:
        """Put what a trajectory from (t0, y) begins with besides into its memory."""
        if self.kept:
            self.kept.load((own, partial), y, par, t0)
        if self.adaptive:
            self.adaptive.begin(own, y, par, t0)

    def _velocity_scale(self, par: Array) -> Array:
        """Q' = velocity * p, of unit momenta; shape (dof,), empty in first-order form."""
        if not self.second:
            return np.ones(0)
        return targets.numpy(self.system, "velocity_scale")(0.0, np.zeros(self.system.dim), par)


def _vectors_of(directions: tuple[Array, Array]) -> tuple[int, bool]:
    """Return how many vectors each trajectory has, and whether they have parts in the parameters."""
    return directions[0].shape[2], bool(directions[1].any())


def compiled(method: Any, system: System) -> HBVMProgram:
    """Return the program of what a method plans for a system."""
    program = HBVMProgram(system, method.plan(system))
    program.method = method
    return program
