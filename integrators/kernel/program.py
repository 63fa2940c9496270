"""HBVM(k, s) compiled for one system: a `Program` over the compiled kernel."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from integrators.kernel import layout, tables
from integrators.kernel.batch import Batch, prepare_batch
from integrators.kernel.context import Context, Shape
from integrators.kernel.implicit.workspace import SOLVERS, Linearization, Workspace, linearization
from integrators.kernel.implicit.workspace import solver as implicit_solver
from integrators.kernel.native import binary as native
from integrators.kernel.native import engine
from integrators.kernel.native import field as fields
from integrators.kernel.native.foreign import field_of
from integrators.kernel.stepper import HBVMStepper
from integrators.protocol import Array, check_parameters, check_start, check_state
from integrators.times import Counts
from problems import emit
from problems.errors import InputError
from problems.problem import System

TOLERANCE = 1e-16


class HBVMProgram:
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
        How the stage equations are solved; see `integrators.hbvm.HBVM`.
    """

    varying = False
    """Whether steps vary in length."""

    def __init__(
        self, system: System, *, k: int, s: int, h: float, form: str | None = None, solver: str = "auto"
    ):
        started = native.clock()
        self.system = system
        self.h = h
        self.solver, self._named = SOLVERS[solver], solver
        self.second = (system.separable and solver != "blended") if form is None else form == "second"
        if self.second and not system.separable:
            raise InputError(f"{system.name} is not separable with constant masses; use form='first'.")
        lanes = tables.lanes_for(k)
        self.constants = tables.constants(k, s, self.second, lanes)
        self.field = field_of(system, "force" if self.second else "field", lanes)
        kernel = engine.kernel()
        block, group = blocks(system)
        rows = system.dim
        if self.second:
            assert system.dof is not None
            rows = system.dof
            block = block[:rows]
            group = group[: block[-1] + 1]
        self._known_velocity: tuple[bytes, Array] = (b"?", np.empty(0))
        unit = tables.unit(self.constants, self._velocity(np.full(system.n_par, np.nan)))
        self.fused = self._sweeps(rows, lanes) if unit else None
        self.shape = Shape(
            rows, self.second, unit, self.field.address, self.fused.address if self.fused else 0,
            system.n_par, block, group, self.constants,
        )  # fmt: skip
        self._fixed = tables.fixed(self.constants)
        self._scaled: dict[float, dict[str, Array]] = {}
        self._fresh: dict[bool, Context] = {}
        self.from_cache = all(
            made.from_cache for made in (self.field, kernel, self.fused) if made is not None
        )
        self._linearization: Linearization | None = None
        if self.solver.strategy == layout.ALWAYS_IMPLICIT:
            self.implicit()
        self.compile_seconds = native.clock() - started

    def _sweeps(self, rows: int, lanes: int) -> native.Native | None:
        """Return whole sweeps for a system with a few rows, if they can be compiled with its field."""
        if rows > fields.FUSED_ROWS or self.constants.route not in (8, 16) or not self.lanes:
            return None
        return fields.compile_sweeps(self.system, "force" if self.second else "field", lanes, rows)

    @property
    def description(self) -> str:
        """The method with all that steps depend on, as text."""
        c, form = self.constants, "second" if self.second else "first"
        return f"HBVM(k={c.k}, s={c.s}, h={self.h!r}, form={form!r}, solver={self._named!r})"

    @property
    def lanes(self) -> bool:
        """Whether the vector field runs on all stages at once, or on one after another."""
        return self.field.note == fields.ON_LANES

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> HBVMStepper:
        """Return a stepper at ``t0``; ``par`` defaults to the system's own parameters.

        Raises
        ------
        problems.errors.InputError
            If ``y0`` is not finite, or ``y0`` or ``par`` is not of the system's length.
        """
        values = check_parameters(par, self.system)
        return HBVMStepper(self, check_state(y0, self.system.dim), values, check_start(t0))

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
        """Integrate many starts to the same times, several of them at once.

        Each trajectory is bit for bit the one that ``start`` and ``advance`` give.

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
        sample : {"side", "land", "dense"}, optional
            How states between steps are made; see `HBVMStepper`.
        threads : int
            Threads to share the trajectories among.

        Raises
        ------
        problems.errors.InputError
            For starts, parameters or times that cannot be used.
        """
        return prepare_batch(self, Y0, par, times, check_start(t0), sample, threads)()

    def prepare_batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Callable[[], Batch]:
        """Check and allocate all that `batch` needs; return what then does it, once."""
        return prepare_batch(self, Y0, par, times, check_start(t0))

    def implicit(self) -> Workspace:
        """Return memory for the implicit solver; its code is compiled, or loaded, the first time."""
        if self._linearization is None:
            made = implicit_solver()
            self._linearization = linearization(self.system, second=self.second)
            self.from_cache = self.from_cache and made.from_cache
        return Workspace(self.shape, self.solver.kind, self._linearization)

    def scaled(self, h: float) -> dict[str, Array]:
        """Return the tables for steps of h, which may be negative."""
        if h not in self._scaled:
            squared = self.second and self.shape.unit
            self._scaled[h] = tables.scaled(self.constants, h, squared=squared)
        return self._scaled[h]

    def context(self, *, side: bool = False) -> Context:
        """Return fresh memory for a trajectory, or for its partial steps."""
        if side not in self._fresh:
            scaled = self.scaled(self.h)
            shared = {"PROJECTION": scaled["PROJECTION"]} if side else scaled
            made = Context(self.shape, {**self._fixed, **shared})
            made.reals[layout.TOLERANCE] = TOLERANCE
            self._fresh[side] = made  # when it is complete: another thread may copy it at once
        return self._fresh[side].copy()

    def load(self, context: Context, par: Array) -> None:
        """Put parameters, and the velocities that follow from them, into a context."""
        context["PAR"][:] = par
        if self.second:
            context["VELOCITY"][: self.shape.rows] = self._velocity(par)

    def _velocity(self, par: Array) -> Array:
        """Q' = velocity * p, of unit momenta; shape (dof,), empty in first-order form."""
        if not self.second:
            return np.ones(0)
        key = par.tobytes()
        known, velocity = self._known_velocity  # read once: another thread may replace it
        if known != key:
            velocity = emit.numpy(self.system, "velocity_scale")(0.0, np.zeros(self.system.dim), par)
            self._known_velocity = (key, velocity)
        return velocity


def blocks(system: System) -> tuple[Counts, Counts]:
    """Return the block of each component, and the group (q or p) of each block.

    The change of an iteration is measured relative to the size of a block: the
    coordinates or momenta of one body, where the system says that it has bodies, so
    that a planetoid's tiny momentum is resolved, and else every component by itself.
    """
    dim, dof = system.dim, system.dof
    bodies = getattr(system, "bodies", None)
    width = bodies.dimension if bodies is not None else 1
    block = np.arange(dim) // width
    group = np.zeros(dim // width, dtype=np.int64)
    if dof is not None:
        group[dof // width :] = 1
    return block, group
