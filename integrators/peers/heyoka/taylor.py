"""heyoka's adaptive Taylor integrator."""

import copy
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.caveats import undetected
from integrators.events.event import Event
from integrators.options import Share
from integrators.peers import UNTRACED, load
from integrators.peers.gravity import check_gravity
from integrators.peers.heyoka import model
from integrators.peers.heyoka.batch import Lanes
from integrators.peers.heyoka.events import TaylorSearch, heyoka_events
from integrators.protocol import Array, MethodBase, Status, Trajectories, cite
from integrators.running.watchdog import STALL_STEPS, stall_detector
from integrators.stepping import ProgramBase, RestorableStepper
from problems.errors import InputError
from problems.problem import Problem, System

EPS = float(np.finfo(np.float64).eps)

COLD = "HBVM_BENCH_COLD_COMPILE"
"""Environment variable: set to 1, heyoka compiles anew, using neither of its caches."""

NEAR = 8
"""Times its last step that a sample must be away for the compiled loop to be called."""

STEPS_BEYOND = 256
"""Steps that may be taken in vain beyond a terminal event."""

LINES, SECONDS = 166, 3.0
"""Lines of the field of six bodies, and what heyoka needs to compile it without loops: as their square."""

PATIENCE = 10.0
"""Seconds of compiling of which a user is told."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Taylor(MethodBase):
    """heyoka's Taylor integrator: adaptive step, order from the tolerance, compiled for the problem.

    Parameters
    ----------
    tol : float
        Tolerance, 0 < tol < 1; the order is ceil(1 - ln(tol)/2), so 20 by default.
        heyoka's own default is the double's epsilon, 2.2e-16.
    high_accuracy : bool
        Compensated summation in evaluating the Taylor polynomials.
    compact_mode : bool
        Loops in place of unrolled code. heyoka's default is off, and so it is here.
        Compile times without it grow fast: 0.5, 3 and 22 s for 3, 6 and 10 bodies,
        against 0.2 s; from six bodies on, switch it on.
    fast_math : bool
        Let the compiler reorder and contract operations.
    nbody : bool
        heyoka's own model of gravitating bodies, ``heyoka.model.nbody``, in place of the system's formula:
        .6 to .9 of the time. Masses are compiled in, so that other masses are compiled anew; and the order
        of its sums is heyoka's, which breaks symmetries of a start that the formula keeps.

    Notes
    -----
    The right-hand sides are the traced operations in the user's order. heyoka gives
    the step's Taylor polynomial itself, so that a state between steps (``"partial"``) is
    what a partial step would give, bit for bit and at no loss of order, and the
    sequence of steps does not depend on the samples. The step to a sample that is far ahead
    is taken twice, for heyoka's compiled loop shortens its last one; these are counted apart,
    in ``stats.extra["side_steps"]``. ``"stop"`` shortens steps onto the samples, as
    heyoka's ``propagate_until`` does. heyoka does not count right-hand-side evaluations.

    Examples
    --------
    >>> import problems
    >>> from integrators import Taylor, integrate
    >>> solution = integrate(problems.load("kepler", e=0.6), Taylor(tol=1e-15), [0.0, 100.0])
    >>> bool(solution.errors()["energy"].max() < 1e-13)
    True
    """

    tol: Share = EPS
    high_accuracy: bool = False
    compact_mode: bool = False
    fast_math: bool = False
    nbody: bool = False

    library = "heyoka"
    built = "compiled on this machine by LLVM"
    citation = cite("BiscaniIzzo2021")
    family = "taylor"
    to_end = "stop"

    def accepts(self, problem: Problem) -> str | None:
        """Accept every system that is traced; with ``nbody`` only bodies in space."""
        if not problem.system.traced:
            return UNTRACED
        return model.refuses(problem.system, problem.par) if self.nbody else None

    def caveat(self, problem: Problem) -> str | None:
        """Name a field that is not smooth: heyoka differentiates ``abs`` as if no step went over 0."""
        return undetected(
            problem, "a Taylor series on one side of a discontinuity does not describe the other side"
        )

    def compile(self, system: System) -> "TaylorProgram":
        """Have heyoka compile the integrator for ``system``."""
        return TaylorProgram(system, self)


class TaylorProgram(ProgramBase):
    """A heyoka integrator, compiled for one system; each start has a copy of it, new or left by another.

    heyoka keeps compiled code in memory and on disk (``~/.cache/heyoka``).
    ``from_cache`` is True where the code was found in memory, or the disk cache did
    not grow; another process that compiles at the same moment can make it wrong.
    """

    def __init__(self, system: System, method: Taylor):
        super().__init__(system, method)
        hy = load("heyoka")
        self._options = method.options(defaults=True)
        self._nbody = self._options.pop("nbody")
        if method.nbody:
            self._check_bodies(system.pack())
        _say_if_long(system, method)
        started = perf_counter()
        with _caches(hy) as use:
            before = hy.llvm_state.get_memcache_size(), hy.llvm_state.get_diskcache_size()
            self.template = self._integrator(system.pack())
            after = hy.llvm_state.get_memcache_size(), hy.llvm_state.get_diskcache_size()
        self.from_cache = use and (after[0] == before[0] or after[1] == before[1])
        self.compile_seconds = perf_counter() - started
        self._lanes: dict[bytes, Lanes] = {}  # by what of the parameters is compiled in
        # Copying takes a millisecond, and a copy's code is not in the processor's caches yet: the first
        # tenth of a millisecond would be slower than the library is.
        self._spare: dict[bytes, list[Any]] = {}
        self._templates = {self._compiled_in(system.pack()): self.template}

    def _compiled_in(self, par: Array) -> bytes:
        """Return what of the parameters is compiled in: all of them, or none."""
        return par.tobytes() if self._nbody else b""

    def _equations(self, par: Array) -> list[Any]:
        from problems import targets

        return model.equations(self.system, par) if self._nbody else targets.heyoka(self.system)

    def _integrator(self, par: Array, **more: Any) -> Any:
        """Return an integrator; heyoka compiles what it has not in a cache.

        It has the parameters up to the last one that its formulas contain.
        """
        return load("heyoka").taylor_adaptive(
            self._equations(par), [0.0] * self.system.dim, **self._options, **more
        )

    def with_events(
        self, problem: Problem, events: Mapping[str, Event]
    ) -> Callable[[ArrayLike, ArrayLike | None, float, float], "TaylorStepper"]:
        """Return what starts a trajectory in which heyoka looks for events.

        Its arguments are those of ``start``, and the time up to which is looked. The events are heyoka's
        own: zeros of the function's Taylor polynomial, at the accuracy of the steps. Where the function
        touches zero and turns back, heyoka sees nothing.

        Raises
        ------
        problems.errors.InputError
            For a function that cannot be traced.
        """
        started = perf_counter()
        self._integrator(problem.par, nt_events=heyoka_events(problem, events))
        self.compile_seconds += perf_counter() - started

        def start(y0: ArrayLike, par: ArrayLike | None, t0: float, end: float) -> TaylorStepper:
            stepper: Any = self.start(y0, par, t0)
            search = self._integrator(stepper.par, nt_events=heyoka_events(problem, events))
            stepper.look_for(events, search, end)
            return stepper

        return start

    def batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Trajectories:
        """Integrate many initial conditions to the same times by heyoka's batch integrator.

        It is compiled when this is first called. Every lane has steps of its own; the
        last one to each time is shortened onto it. See `integrators.protocol.Batches` for the rest.
        """
        return self.prepare_batch(Y0, par, times=times, t0=t0)()

    def prepare_batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Callable[[], Trajectories]:
        """Compile, check and allocate all that `batch` needs; return what then does it, once.

        Raises
        ------
        problems.errors.InputError
            With ``nbody``, for trajectories with different parameters, since masses are compiled in.
        """
        first = self.system.pack()
        if self._nbody and par is not None:
            rows = np.atleast_2d(np.asarray(par, dtype=np.float64))
            first = rows[0]
            if (rows != first).any():
                raise InputError("nbody=True needs the same parameters in all trajectories; leave it out.")
        key = self._compiled_in(first)
        if key not in self._lanes:
            if self._nbody:
                self._check_bodies(first)
                check_gravity(self.system, first, t0, np.atleast_2d(np.asarray(Y0, dtype=np.float64))[0])
            self._lanes[key] = Lanes(self.system, self._equations(first), self._options)
            self.compile_seconds += self._lanes[key].compile_seconds
        return self._lanes[key].prepare(Y0, par, times, t0)

    def stepper(self, y: Array, par: Array, t: float) -> "TaylorStepper":
        """Return a trajectory.

        Raises
        ------
        problems.errors.InputError
            With ``nbody``, for a system that is not of bodies, or whose forces are not their gravity.
        """
        if self._nbody:
            self._check_bodies(par)
            check_gravity(self.system, par, t, y)
        key = self._compiled_in(par)
        spare = self._spare.setdefault(key, [])
        try:
            integrator = spare.pop()
        except IndexError:  # there was none, or another thread has taken the last one
            if key not in self._templates:
                self._templates[key] = self._integrator(par)
            integrator = copy.copy(self._templates[key])
        stepper = TaylorStepper(integrator, y, par, t)
        stepper.lent = integrator, spare
        return stepper

    def _check_bodies(self, par: Array) -> None:
        reason = model.refuses(self.system, par)
        if reason is not None:
            raise InputError(f"{self.method!r} cannot integrate {self.system.name}: {reason}")


def _say_if_long(system: System, method: Taylor) -> None:
    """Warn of a field that takes long to compile without loops."""
    from problems import targets

    lines = targets.source(system, "field", "heyoka").text.count("\n")
    seconds = SECONDS * (lines / LINES) ** 2
    if not method.compact_mode and seconds > PATIENCE:
        warnings.warn(
            f"heyoka writes the field of {system.name} out, {lines} lines, and compiles them for about "
            f"{seconds:.0f} s if it has not done so before; Taylor(compact_mode=True) takes one.",
            stacklevel=3,
        )


@contextmanager
def _caches(hy: Any) -> Iterator[bool]:
    """Say whether heyoka may use its caches of compiled code, and see to it."""
    if os.environ.get(COLD, "") in ("", "0"):
        yield True
        return
    enabled = hy.llvm_state.get_diskcache_enabled()
    hy.llvm_state.set_diskcache_enabled(False)
    hy.llvm_state.clear_memcache()
    try:
        yield False
    finally:
        hy.llvm_state.set_diskcache_enabled(enabled)


class TaylorStepper(RestorableStepper):
    """A trajectory of heyoka's; ``"partial"`` (default), ``"steps"`` or ``"stop"``, see `Taylor`."""

    samplings = ("partial", "steps", "stop")
    search: TaylorSearch | None = None
    """What keeps the events, see `look_for`."""
    lent: tuple[Any, list[Any]] | None = None
    """The program's integrator that it has, and the list that it comes back to."""

    def __del__(self) -> None:
        if self.lent:
            integrator, spare = self.lent
            spare.append(integrator)

    def __init__(self, integrator: Any, y: Array, par: Array, t: float):
        super().__init__(y, t)
        self._stats.extra["side_steps"] = 0
        self._ta, self._sign, self._stepped = integrator, 1.0, False
        self._outcome = load("heyoka").taylor_outcome
        self.par = par
        integrator.pars[:] = par[: len(integrator.pars)]
        self._place(t, y)

    def look_for(self, events: Mapping[str, Event], integrator: Any, end: float) -> None:
        """Go on with an integrator that finds events, and keep them up to a time."""
        integrator.pars[:] = self.par[: len(integrator.pars)]
        self._ta = integrator
        self._place(self._t, self._y)
        self.search = TaylorSearch(events, self._y, self._t, end, lambda: self._t)
        self.search.watch(integrator)

    def look_to(self, end: float) -> Status:
        """Keep the events up to a time in the step ahead too."""
        if self.search is not None and self._status is Status.RUNNING:
            if end != self._t:
                self._serve(np.array([end]), "partial")
            self.search.finish(end)
        return self._status

    def _ends(self, t: float | None = None) -> bool:
        """Whether a terminal event has happened, before ``t``: it ends the integration."""
        if self.search is None or self.search.over is None:
            return False
        if t is not None and self._sign * (t - self.search.over) <= 0.0:
            return False
        self.search.finish(self.search.over)
        hits = self.search.hits
        self._fail(Status.EVENT, *hits.last(), hits.reason)
        return True

    def _place(self, t: float, y: Array) -> None:
        self._ta.time = t
        self._ta.state[:] = y

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        sign = self._towards(float(grid[-1]))
        states = np.empty((grid.size, self._y.size))
        for i, t in enumerate(grid.tolist()):
            if not (self._step_to(t) if how == "stop" else self._pass(t, sign)):
                return grid[:i], states[:i]
            states[i] = self._ta.state if self._ta.time == t else self._ta.update_d_output(t)
        return grid, states

    def _step_states(self, end: float) -> tuple[Array, Array]:
        sign = self._towards(end)
        times, states = [self._t], [self._y]
        while not self._ends() and (self._ta.time != times[-1] or self._step() is not None):
            if sign * (self._ta.time - end) > 0.0:
                break
            times.append(self._ta.time)
            states.append(self._ta.state.copy())
        return np.array(times[1:]), np.array(states)[1:]

    def _one_step(self) -> tuple[float, Array] | None:
        if self._ends() or (self._ta.time == self._t and self._step() is None):
            return None
        return self._ta.time, self._ta.state

    def _towards(self, end: float) -> float:
        """Return the sign of the direction to ``end``; a library that is ahead the other way comes back."""
        sign = 1.0 if end > self._t else -1.0
        if sign * (self._ta.time - self._t) < 0.0:
            self._place(self._t, self._y)
        self._sign = sign
        return sign

    def _step(self, goal: float | None = None) -> float | None:
        """Take one step and return its length, or note the failure and return ``None``.

        A terminal event in it is such a failure, unless it comes after the ``goal``.
        """
        t = self._ta.time
        outcome, h = (self._ta.step if self._sign > 0.0 else self._ta.step_backward)(write_tc=True)
        if outcome == self._outcome.success:
            self._stats.steps, self._stepped = self._stats.steps + 1, True
            return None if self._ends(goal) else abs(h)
        self._broken(t, self._ta.tc[:, 0])
        return None

    def _step_to(self, t: float, *, write_tc: bool = False) -> bool:
        """Go to ``t`` by a shortened last step; return whether that succeeded."""
        watch = stall_detector(self, self._ta.time, t)
        few = self.search is not None and self.search.terminates
        most = STEPS_BEYOND if few else STALL_STEPS
        while True:
            before = self._ta.time
            outcome, _, _, steps, *_ = self._ta.propagate_until(t, max_steps=most, write_tc=write_tc)
            self._stats.steps, self._stepped = self._stats.steps + steps, self._stepped or steps > 0
            if self._ends():
                return False
            if outcome == self._outcome.time_limit:
                return True
            if outcome == self._outcome.err_nf_state:
                if not write_tc:  # the coefficients have the state before the step that failed
                    self._place(self._t, self._y)
                    self._ta.propagate_until(t, write_tc=True)
                self._broken(self._ta.time if np.isfinite(self._ta.time) else before, self._ta.tc[:, 0])
            elif stalled := watch.update(self._ta.time, steps):
                self._fail(Status.STALLED, self._ta.time, self._ta.state, stalled)
            if self._status is not Status.RUNNING:
                return False

    def _pass(self, t: float, sign: float) -> bool:
        """Take steps until one passes ``t``; return whether that succeeded.

        heyoka's compiled loop shortens its last step to end at the time it is given, which would make
        the steps depend on the samples. That one step is taken back and taken at its own length.
        (`propagate_grid` will not do: it forgets the low part of heyoka's clock.)
        """
        ta = self._ta
        if self._ends(t):
            return False
        while sign * (ta.time - t) < 0.0:
            if not self._stepped or abs(t - ta.time) > NEAR * abs(ta.last_h):  # else last_h is another's
                if not self._step_to(t, write_tc=True):
                    return False
                self._take_back()
            if self._step(t) is None:
                return False
        return True

    def _take_back(self) -> None:
        """Go back to the start of the last step, whose state is the first of its Taylor coefficients."""
        ta = self._ta
        (high, low), h = ta.dtime, ta.last_h
        start = high - h
        back = start - high
        lost = (high - (start - back)) - (h + back) + low  # what high - h was rounded by, and the low part
        ta.state[:] = ta.tc[:, 0]
        ta.dtime = start + lost, lost - ((start + lost) - start)
        self._stats.steps -= 1
        if self.search is not None:
            self.search.take_back(ta.time)
        self._stats.extra["side_steps"] += 1

    def _broken(self, t: float, y: Array) -> None:
        reason = f"heyoka met a state that is not finite in the step from t = {t!r}"
        tc = np.asarray(self._ta.tc)
        infinite: NDArray[np.bool_] = ~np.all(np.isfinite(tc), axis=0)
        if infinite.any() and not infinite[:2].any():  # the state and the field are finite
            order, most = int(infinite.argmax()), tc.shape[1] - 1
            reason += (
                f": the Taylor coefficients from order {order} of {most} leave the range of doubles. "
                "The motion has a singularity here, or is many orders of magnitude faster than the unit "
                "of time; in SI units of atoms or molecules take a shorter one"
            )
        self._fail(Status.NOT_FINITE, t, y, f"{reason}.")

    def _save(self) -> Any:
        return copy.copy(self._ta), self._sign, self._stepped

    def _load(self, inner: Any) -> None:
        self._ta, self._sign, self._stepped = copy.copy(inner[0]), *inner[1:]
        if self.search is not None:
            self.search.watch(self._ta)
