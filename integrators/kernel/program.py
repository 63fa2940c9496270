"""HBVM(k, s) compiled for one system, with fixed or adaptive step size: a `Program`."""

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from integrators.caveats import FEWEST, detects_discontinuities
from integrators.events.event import Event
from integrators.kernel import routes, tables, tolerance
from integrators.kernel.along import batch_along
from integrators.kernel.batch import Batch, prepare_batch
from integrators.kernel.batch_events import WithEvents
from integrators.kernel.breakpoints import Breakpoints
from integrators.kernel.context import Context, Shape, blocks, width_of_blocks
from integrators.kernel.engines import iterations, look, solver, steps
from integrators.kernel.ensemble.prepared import Lanes, compiled_lanes, lanes_of
from integrators.kernel.fixed import FixedStepper
from integrators.kernel.implicit.workspace import SOLVERS, Workspace, linearization
from integrators.kernel.inside.functions import Action, EventFunction
from integrators.kernel.line.kept import Kept
from integrators.kernel.native import binary, machine
from integrators.kernel.native import field as fields
from integrators.kernel.native.foreign import field_of
from integrators.kernel.native.memory import aligned
from integrators.kernel.native.stages import ON_LANES
from integrators.kernel.parts.implicit import ALWAYS_IMPLICIT
from integrators.kernel.parts.surfaces import MOST_SURFACES
from integrators.kernel.simd.emit import WIDTH
from integrators.kernel.spare import Pair, Spare
from integrators.kernel.step.rule import (
    LOG_RESIDUAL,
    LOG_RESIDUAL_VARYING,
    LONGEST,
    MOST_TRUSTED,
    PART_OF_TOLERANCE,
    STAGNATION,
    TOLERANCE,
    TRUSTED,
    UNTESTED,
)
from integrators.kernel.stepper import HBVMStepper
from integrators.kernel.tangent.lanes import VectorLanes
from integrators.kernel.varying import AdaptiveStepper
from integrators.protocol import Array, Compiled
from integrators.refusals import check_parameters, check_start, check_state
from problems import targets
from problems.analysis.sides import sides
from problems.analysis.structure import depends_on_time
from problems.analysis.switches import Switches
from problems.errors import InputError
from problems.problem import Problem, System
from problems.targets.time_scale import time_scale

OF_A_BODY, OF_A_COMPONENT = 1e-6, 1e-4
"""What the field of a block counts as at least, as a part of the largest in its group.

A light body is an object of its own; single components next to nodes or turning points
of a lattice are moved by the others' rounding.
"""

ENERGY_LANES = 8
"""States at which the energy is evaluated at a time, all of them the same."""

SCOUTED = 256
"""Ordinary adaptive steps that tell how long reversible ones are."""

MOST_EPSILON = 0.2
"""Reversible steps are no longer than this part of the field's time scale, whose density longer ones lose."""

LEAST_NEGLIGIBLE = 1e-12
"""Part of a block's size that the error at a discontinuity of the field may always be."""


class HBVMProgram(Compiled):
    """HBVM(k, s) with step h, compiled for one system; satisfies `integrators.protocol.Program`.

    Parameters
    ----------
    system : System
        What to integrate.
    k, s : int
        Stages and degree, k >= s >= 1.
    h : float
        Length of a step, > 0.
    form : {"first", "second"}, optional
        Whether stages hold the whole state, or only positions (q'' = a(q), for
        separable systems: half the unknowns, half the iterations). By default the
        second-order form wherever the system has one, but for blended iteration.
    solver : {"auto", "fixed_point", "newton", "blended"}, optional
        How the stage equations are solved; see `integrators.methods.hbvm.HBVM`.
    keep : sequence of str, optional
        Invariants to keep by line integrals, by name; ``name[i]`` for one component of a vector. If there
        is none, the energy of a Poisson system. First-order form, fixed point.

    Raises
    ------
    problems.errors.InputError
        For a form that the system does not have; for an invariant that it does not have, or that depends
        on time.
    """

    varying = False
    """Whether steps vary in length."""
    first: float | None = None
    """Length of the first step, where steps vary; ``None``: chosen."""
    threaded = True
    """Whether `batch` takes threads."""
    _more: Mapping[str, int] = MappingProxyType({})
    for_many: "Callable[[], HBVMProgram] | None" = None
    """What makes the program that takes trajectories in lanes, where that is one of another k and s."""
    projected = False
    """Whether steps end on the surface of the start's energy; see `integrators.kernel.step.projection`."""
    _stepper: ClassVar[Callable[..., HBVMStepper]] = FixedStepper

    def __init__(
        self,
        system: System,
        *,
        k: int,
        s: int,
        h: float,
        form: str | None = None,
        solver: str = "auto",
        keep: Sequence[str] | None = None,
    ):
        started = binary.clock()
        self.system = system
        self.h = h
        if keep is not None:
            form, solver = "first", "fixed_point"
        self.solver, self._named = SOLVERS[solver], solver
        self.second = (system.separable and solver != "blended") if form is None else form == "second"
        if self.second and not system.separable:
            raise InputError(f"{system.name} is not separable with constant masses; use form='first'.")
        lanes = tables.lanes_for(k)
        self.constants = tables.constants(k, s, self.second, lanes)
        self.kept = None if keep is None else Kept(system, self.constants, keep)
        quantity = self.kept.values if self.kept else "force" if self.second else "field"
        self.field = field_of(system, quantity, lanes)
        kernel = steps.code()
        block, group = blocks(system)
        rows = system.dim
        if self.second:
            assert system.dof is not None
            rows = system.dof
            block = block[:rows]
            group = group[: block[-1] + 1]
        nothing = np.empty(0)
        self._known_velocity = b"?", (nothing, nothing, nothing)
        unit = tables.unit(self.constants, self._velocity_scale(np.full(system.n_par, np.nan)))
        self.fused = self._iterations(quantity, rows, lanes) if unit and not self.kept else None
        self.shape = Shape(
            rows, self.second, unit, self.field, self.fused,
            system.n_par, block, group, self.constants,
        )  # fmt: skip
        self._fixed = tables.fixed(self.constants)
        self._fresh: dict[bool, Context] = {}
        self.spare = Spare()
        self.vectors: dict[tuple[int, bool], Context] = {}
        """Contexts of tangent vectors, by their number and whether they move parameters, to be copied."""
        parts = [self.field, kernel, self.fused, *(self.kept.code if self.kept else ())]
        self.from_cache = all(part.from_cache for part in parts if part is not None)
        self._workspace: Workspace | None = None
        self._in_lanes: tuple[Lanes | None] | None = None
        self._along: dict[tuple[int, bool], VectorLanes | None] = {}
        self._many: HBVMProgram | None = None
        if self.solver.strategy == ALWAYS_IMPLICIT:
            self.implicit()
        self.compile_seconds = binary.clock() - started

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
        return f"HBVM(k={c.k}, s={c.s}, h={self.h!r}, form={form!r}, solver={self._named!r}{kept})"

    @property
    def free(self) -> bool:
        """Whether nothing but time and tolerance says where steps end."""
        return True

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
        return self._stepper(self, check_state(y0, self.system.dim), values, check_start(t0))

    def with_events(self, problem: Problem, events: Mapping[str, Event]) -> WithEvents:
        """Compile the functions of events; return what starts a trajectory that looks for them.

        Its arguments are those of `start`, and the time up to which is looked.

        Raises
        ------
        problems.errors.InputError
            If a function can neither be traced nor called with numbers.
        """
        started = binary.clock()
        functions = [EventFunction(name, event.g, problem) for name, event in events.items()]
        actions = {
            name: Action(name, event.then, problem)
            for name, event in events.items()
            if event.then is not None
        }
        look.code()
        self.compile_seconds += binary.clock() - started
        return WithEvents(self, events, functions, actions)

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
        if self.for_many is None:
            return self
        if self._many is None:
            program = self.for_many()
            self._many = self if program.in_lanes() is None else program
            self.compile_seconds += program.compile_seconds
            self.from_cache = self.from_cache and program.from_cache
        return self._many

    def in_lanes(self) -> Lanes | None:
        """Return the method on trajectories in lanes, compiled the first time; ``None`` where it has none."""
        if self._in_lanes is None:
            lanes_, seconds = None, 0.0
            if self.lanes and not self.kept and self.free and self.solver.strategy != ALWAYS_IMPLICIT:
                lanes_, seconds = lanes_of(
                    self.system, self.constants, self.second, self.shape.unit, self.varying
                )
            self.compile_seconds += seconds
            self.from_cache = self.from_cache and (lanes_ is None or lanes_.from_cache)
            self._in_lanes = (lanes_,)
        return self._in_lanes[0]

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
        if (count, moves) not in self._along:
            steps_are_fixed = not (self.varying or self.projected or self.kept)
            can = steps_are_fixed and self.lanes and self.system.traced
            lanes_, seconds = None, 0.0
            if can and self.solver.strategy != ALWAYS_IMPLICIT:
                lanes_, seconds = self._compiled_along(count, moves)
            self.compile_seconds += seconds
            self.from_cache = self.from_cache and (lanes_ is None or lanes_.from_cache)
            self._along[count, moves] = lanes_
        return self._along[count, moves]

    def _compiled_along(self, count: int, moves: bool) -> tuple[VectorLanes | None, float]:
        """Return the lanes for so many vectors, if they are few enough, and the seconds that took."""
        constants, unit = self.constants, self.shape.unit
        if self.second and moves and not self._velocity_is_fixed:
            # q' = v(par) p, whose derivative is no multiple of a momentum
            constants, unit = tables.constants(constants.k, constants.s, False, constants.lanes), True
        if not VectorLanes.take(self.system, constants, count):
            return None, 0.0
        return compiled_lanes(lambda: VectorLanes(self.system, constants, unit, count, moves))

    @property
    def _velocity_is_fixed(self) -> bool:
        """Whether velocities by momenta do not depend on parameters."""
        anywhere = self._velocity_scale(np.full(self.system.n_par, np.nan))
        return bool(np.isfinite(anywhere).all())

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

    def limit(self, context: Context, interval: float) -> None:
        """Set what an interval of a certain length says of the steps: nothing where all have one length."""

    def contexts(self) -> tuple[Context, Context]:
        """Return fresh memory for a trajectory, and for its partial steps."""
        own, partial = self._context(partial=False).copy(), self._context(partial=True).copy()
        if self.kept:
            self.kept.share(own, partial)
        return own, partial

    def _context(self, *, partial: bool) -> Context:
        if partial not in self._fresh:
            # when it is complete: another thread may copy it at once
            self._fresh[partial] = self._new_context(partial=partial)
        return self._fresh[partial]

    def pair(self, par: Array) -> Pair:
        """Return memory for a trajectory with these parameters, fresh or that of one that is over."""
        pair = self.spare.take()
        if pair is None:
            pair = Pair(*self.contexts())
            self._put(pair.own, pair.partial, par)
            return pair
        if not pair.renew():
            pair.own.become(self._context(partial=False))
            pair.partial.become(self._context(partial=True))
            if self.kept:
                self.kept.share(pair.own, pair.partial)
        if pair.par != (key := par.tobytes()):
            self._put(pair.own, pair.partial, par)
            pair.keep(key)
        return pair

    def _new_context(self, *, partial: bool) -> Context:
        tables = {**self._fixed, **({} if partial else self.scaled(self.h))}
        more = {"energy.rows": self.system.dim + 1} if self.projected else self._more
        context = self.kept.context(self.shape, tables) if self.kept else Context(self.shape, tables, more)
        context.solver.tolerance, context.solver.stagnation = TOLERANCE, STAGNATION
        context.solver.log_residual = LOG_RESIDUAL
        return context

    def _put(self, own: Context, partial: Context, par: Array) -> None:
        """Put parameters, and what follows from them, into fresh memory."""
        self.renew(own, partial, par)
        own.h, own.implicit.strategy = self.h, self.solver.strategy

    def renew(self, own: Context, partial: Context, par: Array) -> None:
        """Put parameters and the velocities by momentum that they make into the memory of a trajectory."""
        for context in (own, partial):
            context.par[:] = par
        if self.second:
            velocity, speed, mass = self._velocity(par)
            for context in (own, partial):
                (
                    context.factors.velocity[: self.shape.rows],
                    context.blocks.speed[:],
                    context.blocks.mass[:],
                ) = velocity, speed, mass

    def begin(self, pair: Pair, y: Array, par: Array, t0: float) -> None:
        """Put what a trajectory from (t0, y) begins with besides into its memory."""
        if self.kept:
            self.kept.load((pair.own, pair.partial), y, par, t0)

    def _velocity_scale(self, par: Array) -> Array:
        """Q' = velocity * p, of unit momenta; shape (dof,), empty in first-order form."""
        if not self.second:
            return np.ones(0)
        return targets.numpy(self.system, "velocity_scale")(0.0, np.zeros(self.system.dim), par)

    def _velocity(self, par: Array) -> tuple[Array, Array, Array]:
        """Return `_velocity_scale`, and `Blocks.speed` and `Blocks.mass` of blocks."""
        key = par.tobytes()
        known, velocities = self._known_velocity  # read once: another thread may replace it
        if known != key:
            velocity, speed = self._velocity_scale(par), np.ones(self.shape.group.size)
            speed[self.shape.block] = np.where(velocity == 0.0, 1.0, np.abs(velocity))
            self._known_velocity = key, velocities = key, (velocity, speed, 1.0 / speed)
        return velocities


def _vectors_of(directions: tuple[Array, Array]) -> tuple[int, bool]:
    """Return how many vectors each trajectory has, and whether they have parts in the parameters."""
    return directions[0].shape[2], bool(directions[1].any())


class AdaptiveProgram(HBVMProgram):
    """HBVM(k, s) with steps as long as a tolerance allows, compiled for one system.

    Parameters
    ----------
    system : System
        What to integrate.
    k, s : int
        Stages and degree, k >= s >= 1, k > 1.
    tol : float
        Local error per step, relative to the size of each block of the state.
    quadrature_error : float, optional
        The same for the error of the quadrature, by which the energy changes; by default any.
    h : float, optional
        Length of the first step.
    solver : {"auto", "fixed_point", "newton", "blended"}, optional
        How the stage equations are solved; see `integrators.methods.hbvm.HBVM`.
    max_step : float, optional
        Length that no step exceeds.
    breakpoints : sequence of float, optional
        Times that steps end at, besides those at which the formulas switch.
    max_steps : int, optional
        Steps of a trajectory, at most.
    atol : float or sequence of float, optional
        Local error per step that is always allowed, of all components or of each.
    keep : sequence of str, optional
        What to keep by line integrals; see `HBVMProgram`.
    projected : bool, optional
        Whether steps are solved to a part of the tolerance and then moved to the energy of the start; see
        `integrators.kernel.step.projection`.
    """

    varying = True
    _stepper = AdaptiveStepper

    def __init__(
        self,
        system: System,
        *,
        k: int,
        s: int,
        tol: float,
        quadrature_error: float | None = None,
        h: float | None = None,
        solver: str = "auto",
        max_step: float | None = None,
        breakpoints: Sequence[float] = (),
        max_steps: int | None = None,
        keep: Sequence[str] | None = None,
        atol: float | Sequence[float] | None = None,
        projected: bool = False,
    ):
        super().__init__(system, k=k, s=s, h=1.0 if h is None else h, solver=solver, keep=keep)
        started = binary.clock()
        from integrators.coefficients.legendre import (
            legendre,  # 50 digits, which take their time to be imported
        )

        self.tol, self.quadrature_error, self.first = tol, quadrature_error, h
        self.max_step, self.max_steps, self.atol = max_step, max_steps, atol
        self._timed = not system.traced or depends_on_time(system)
        self._absolute = self._sizes(atol)
        self._given, self._switches = np.array(sorted(set(breakpoints)), float), Switches(system)
        c = self.constants
        if c.route != tables.THROUGH:
            self._fixed["raw_matrix"] = tables.rounded(c)
        self._extrapolations = tables.extrapolations(c) if c.route > tables.THROUGH else aligned(0)
        self.degree = tolerance.degree_of_error(k, s)
        basis = legendre(c.arrays["nodes"].reshape(-1), k) * c.arrays["weights"].reshape(-1)[:, None]
        middle = max(1, (k - 4) // 2)
        degrees = [*tables.degrees_judged(k, s), min(middle, k - 1), min(middle + 1, k - 1)]
        rows = [*basis.T[degrees], *(basis @ legendre(np.array([0.0, 1.0]), k).T).T]
        self._estimators = aligned(len(rows) * 8 * -(-k // 8))
        self._estimators.reshape(len(rows), -1)[:, :k] = rows
        # As much as rounding accounts for, and without a bound on the quadrature what the tolerance allows.
        self._negligible = LEAST_NEGLIGIBLE if quadrature_error is not None else max(tol, LEAST_NEGLIGIBLE)
        surfaces = (
            sides(system.function("force" if self.second else "field"), MOST_SURFACES)
            if system.traced and not self.kept
            else None
        )
        self._sides, self._surfaces = None, 0
        if surfaces is not None:
            self._sides = fields.compile_field(system, surfaces, tables.lanes_for(k))
            self._surfaces = len(surfaces.outputs) - 1
            self.from_cache = self.from_cache and self._sides.from_cache
        self.projected = projected
        self._energy = self._energy_code() if projected else None
        self._line = 2.0 ** (-52.0 / middle) if k >= FEWEST else 0.0  # where degrees from that on vanish
        looks = detects_discontinuities(k, system) and not self.kept
        self._doubt, self._slowest = _decays(k, self.degree, tol, middle, looks)
        self.compile_seconds += binary.clock() - started

    @property
    def free(self) -> bool:
        """Whether nothing but the tolerance says where steps end, whatever the parameters."""
        return (
            not self.projected
            and self.max_step is None
            and self.max_steps is None
            and self.atol is None
            and not self._given.size
            and not self._switches.any
            and self._sides is None
        )

    def _energy_code(self) -> binary.Native:
        """Return what writes the gradient of the energy and the energy itself."""
        energy = self.system.invariants["energy"]
        quantity = self.system.together(self.system.gradient(energy), energy)
        native = fields.compile_field(self.system, quantity, ENERGY_LANES)
        self.from_cache = self.from_cache and native.from_cache
        return native

    def _sizes(self, atol: float | Sequence[float] | None) -> Array:
        """Return an absolute tolerance as sizes that ``tol`` is relative to, one for each block."""
        shape = self.shape
        sizes = np.full(shape.group.size, 0.0 if atol is None else math.inf)
        if atol is not None:
            if np.ndim(atol) and np.shape(atol) != (self.system.dim,):
                raise InputError(
                    f"atol has {np.size(atol)} numbers, and {self.system.name} {self.system.dim} components; "
                    "give one, or as many."
                )
            each = np.broadcast_to(np.asarray(atol, float), self.system.dim)[-shape.rows :]
            np.minimum.at(sizes, shape.block, each / self.tol)
        return sizes

    def limit(self, context: Context, interval: float) -> None:
        """Set the longest steps of a trajectory over an interval of a certain length; 0: unknown."""
        most = math.inf if self.max_step is None else self.max_step
        part = LONGEST * interval if interval > 0.0 else math.inf
        controller = context.controller.numbers
        controller.longest_constant = min(most, part)
        controller.longest = controller.longest_constant if self._timed else most

    def breakpoints(self, par: Array) -> Breakpoints:
        """Return the times that steps end at: those given, and those of the formulas."""
        return Breakpoints(self._given, self._switches, par)

    @property
    def description(self) -> str:
        """The method with all that steps depend on, as text."""
        c, kept = self.constants, f", {self.kept.description}" if self.kept else ""
        projected = ", projection='energy'" if self.projected else ""
        return (
            f"HBVM(k={c.k}, s={c.s}, tol={self.tol!r}, defect={self.quadrature_error!r}, h={self.first!r}, "
            f"solver={self._named!r}, max_step={self.max_step!r}, breakpoints={self._given.tolist()!r}, "
            f"max_steps={self.max_steps!r}, atol={self.atol!r}{kept}{projected})"
        )

    def _put(self, own: Context, partial: Context, par: Array) -> None:
        """Put parameters, and what follows from them, into fresh memory."""
        super()._put(own, partial, par)
        own.controller.next_length = self.first or 0.0

    def begin(self, pair: Pair, y: Array, par: Array, t0: float) -> None:
        """Put what a trajectory from (t0, y) begins with besides into its memory."""
        super().begin(pair, y, par, t0)
        pair.own.discontinuities.numbers.doubt_end = t0

    def _new_context(self, *, partial: bool) -> Context:
        context = super()._new_context(partial=True)  # with a matrix of its own
        context.solver.log_residual = LOG_RESIDUAL_VARYING
        if self._energy:
            context.energy.code = self._energy
            context.energy.width = width_of_blocks(self.system)
            context.point({"energy.state_indices": self.shape.state_indices})
            context.solver.tolerance = max(PART_OF_TOLERANCE * self.tol, TOLERANCE)
            context.solver.log_residual = max(math.log2(context.solver.tolerance), LOG_RESIDUAL_VARYING)
        context.solver.trusted = min(TRUSTED * context.solver.tolerance, MOST_TRUSTED)
        context.solver.log_trusted = math.log2(UNTESTED * context.solver.tolerance)
        context.point({"estimate.estimators": self._estimators, "tables.extrapolation": self._extrapolations})
        context.varying = 1
        context.controller.error_degree = self.degree
        context.controller.allowed_error = self.tol
        bodies = getattr(self.system, "bodies", None) is not None
        context.estimate.least_slope = OF_A_BODY if bodies else OF_A_COMPONENT
        context.controller.allowed_quadrature_error = (
            math.inf if self.quadrature_error is None else self.quadrature_error
        )
        context.controller.error_aim = tolerance.aim(self.tol, self.degree)
        context.estimate.error_decay = tolerance.decay(self.tol, self.degree)
        if self.quadrature_error is not None:
            last = self.constants.k - 1
            context.controller.quadrature_error_aim = tolerance.aim(self.quadrature_error, last)
            context.estimate.quadrature_error_decay = tolerance.decay(self.quadrature_error, last)
        context.discontinuities.doubt, context.discontinuities.slowest_decay = self._doubt, self._slowest
        context.discontinuities.negligible = self._negligible
        context.surfaces.code = self._sides
        context.surfaces.count = self._surfaces
        context.estimate.absolute[:] = self._absolute
        context.estimate.line, context.estimate.called = self._line, int(not self.system.traced)
        context.estimate.asks = int(self.atol is None or np.any(np.greater(self.atol, 0.0)))
        self.limit(context, 0.0)
        context.controller.stop = context.controller.length_limit = math.inf
        return context


class ReversibleProgram(AdaptiveProgram):
    """Gauss with steps that are the same backwards, compiled for one system.

    Parameters
    ----------
    system : System
        Traced, not of the time.
    s : int
        Stages, s > 1.
    tol : float
        Local error per step, about: that of as many ordinary adaptive steps as `SCOUTED`.
    """

    def __init__(self, system: System, *, s: int, tol: float):
        super().__init__(system, k=s, s=s, tol=tol, solver="fixed_point")
        self._scale = time_scale(system.function("field"), system.n_par)
        self._pace = fields.compile_field(system, self._scale, self.constants.lanes)
        self._ordinary = AdaptiveProgram(system, k=s, s=s, tol=tol)
        self._more = {"pace.rows": system.dim, "pace.parameters": system.n_par + 1}

    @property
    def free(self) -> bool:
        """Whether nothing but the tolerance limits the steps: lanes have no such steps."""
        return False

    @property
    def description(self) -> str:
        """The method with all that steps depend on, as text."""
        return f"Gauss(s={self.constants.s}, tol={self.tol!r}, steps='reversible')"

    def _new_context(self, *, partial: bool) -> Context:
        context = super()._new_context(partial=partial)
        context.solver.log_residual = LOG_RESIDUAL
        return context

    def renew(self, own: Context, partial: Context, par: Array) -> None:
        """Put parameters, and what follows from them, into the memory of a trajectory."""
        super().renew(own, partial, par)
        own.pace.par[:-1] = par

    def begin(self, pair: Pair, y: Array, par: Array, t0: float) -> None:
        """Put what a trajectory from (t0, y) begins with besides into its memory."""
        super().begin(pair, y, par, t0)
        context = pair.own
        context.pace.code = self._pace
        ahead = self._ordinary.start(y, par, t0).take(SCOUTED)
        states = np.concatenate([y[np.newaxis], ahead.y]).T
        times = np.append(t0, ahead.t)
        rate = targets.numpy(self.system, self._scale)
        bare = rate(t0, states, np.append(par, 0.0))[0]
        order = np.argsort(bare)
        elapsed = np.cumsum(np.abs(np.gradient(times))[order])
        median = bare[order][np.searchsorted(elapsed, 0.5 * elapsed[-1])]  # over the time
        context.pace.par[:] = np.append(par, median)
        rates = rate(t0, states, context.pace.par)[0] ** 0.25
        lengths = np.diff(times) * (rates[:-1] + rates[1:]) / 2.0
        context.pace.epsilon = min(float(np.median(lengths[len(lengths) // 8 :])), MOST_EPSILON)


def _decays(k: int, m: int, tol: float, middle: int, looks: bool) -> tuple[float, float]:
    """Return `doubt` and `slowest_decay` of `Discontinuities`, which tell a smooth field from others.

    Where the error is the tolerance, coefficients of a smooth field fall off by
    ``tol^(1/2m)`` from one degree to the next. Those of a discontinuity fall off like 1/j^2, from the
    middle ones, of degrees ``middle`` and the next, to the last one. Infinite where
    nobody ``looks``.
    """
    if not looks:
        return math.inf, math.inf
    smooth, last = tolerance.decay(tol, m), k - 1
    at_discontinuity = ((middle + 0.5) / last) ** 2
    doubt = min(10.0 * smooth ** (last - min(3, m - 1)), 0.1 / last**2)
    return doubt, max(at_discontinuity / 4.0, 6.0 * smooth ** (last - middle - 1))
