"""An integration that is advanced step by step, and may be changed between steps."""

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import registry
from integrators.caveats import of_tables, warnings
from integrators.events.event import Event
from integrators.protocol import (
    Array,
    Destination,
    DoubleDouble,
    MethodBase,
    Samples,
    Status,
    check_problem,
    offers,
)
from integrators.refusals import check_interval, check_parameters, check_state, check_times
from integrators.running.digits import as_pairs, check_digits, pairs
from integrators.running.integrate import prepared, started, wanted_events
from integrators.solution.exports import as_mpmath
from integrators.solution.occurrences import Occurrences
from problems.analysis import invariants
from problems.analysis.tables import check_tables
from problems.checks import checked_arguments
from problems.errors import InputError
from problems.problem import Problem
from problems.quantities import PlainArray

CLOSE = 64  # units in the last place: nothing happens in a time as short


@checked_arguments
def start(
    problem: Problem,
    method: MethodBase | None = None,
    events: Event | Callable[..., Any] | Sequence[Event | Callable[..., Any]] = (),
    *,
    start: Any = None,
) -> "Run":
    """Start an integration that is then advanced step by step.

    Parameters
    ----------
    problem : Problem
        The problem to integrate. Its ``t_end`` only bounds the first step.
    method : MethodBase, optional
        The method; ``HBVM()`` by default.
    events : Event or callable, or a sequence of them, optional
        Events to locate; see `integrators.events.Event`.
    start : array_like, shape (dim,) or (dim, 2), optional
        The initial state with more digits than doubles have; see `integrate`.

    Returns
    -------
    Run

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or does not support events, or if doubles are too coarse
        for the problem's interval.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, start
    >>> run = start(problems.load("pendulum"), Gauss(s=4, h=0.1))
    >>> run.step(), run.t
    (<Status.RUNNING: 'running'>, 0.1)
    >>> run.y = run.y * [1.0, 0.5]  # a kick
    >>> run.until(2.0).shape, run.t
    ((2,), 2.0)
    """
    if method is None:
        method = registry.create("HBVM")
    check_problem(problem, method)
    check_interval(problem.t0, problem.t_end)
    return Run(problem, method, events, start)


class Run:
    """An integration in progress; `start` returns it.

    Its steps, and its states at other times, are bitwise identical to those of `integrate` to the problem's
    end. The state and the parameters can be set between steps: the method then restarts at this time.

    Attributes
    ----------
    problem, method
        The problem, and the method.

    Examples
    --------
    >>> import problems
    >>> from integrators import start
    >>> run = start(problems.load("kepler", e=0.3))
    >>> while run.t < 1.0:
    ...     status = run.step()
    >>> run.status, abs(run.energy() + 0.5) < 1e-14
    (<Status.RUNNING: 'running'>, True)
    """

    def __init__(self, problem: Problem, method: MethodBase, events: Any, start: Any = None) -> None:
        self.problem, self.method = problem, method
        self._program, _ = prepared(method, problem.system)
        self._wanted = wanted_events(events, None)
        self._par = problem.par
        self._acts = any(event.then is not None for event in self._wanted.values())
        self._before: list[Mapping[str, Occurrences]] = []
        self._since = 0  # terminal events count what happens from here on in that list
        self._here: tuple[float, list[int]] = np.nan, []  # how events have changed their signs at that time
        self._shown: tuple[float, Array] | None = None
        self._terminates = any(event.last for event in self._wanted.values())
        self._over = False  # whether a terminal event has happened in the step ahead
        self._way = 1.0 if problem.t_end >= problem.t0 else -1.0
        digits = start is not None or method.precision != "double"
        if digits:
            check_digits(method, events=bool(self._wanted), variations=False)
        begin = pairs(problem.y0 if start is None else start, problem) if digits else problem.y0
        self._begin(begin, problem.t0)

    def _begin(self, y: Array, t: float) -> None:
        """Begin at a state, or at its pairs."""
        if y.ndim == 2:
            self._stepper: Any = cast("DoubleDouble", self._program).start_pairs(y, self._par, t)
        else:
            self._stepper = started(
                self._program, self.method, self.problem, self._wanted, y, self._par, t,
                self._way * sys.float_info.max,
            )  # fmt: skip
        if offers(self._stepper, Destination):  # how long an interval is says how long a first step may be
            last = self.problem.t_end
            if self._way * (last - t) <= 0.0:  # beyond it, or on the way back
                last = t + self._way * (abs(last - t) or abs(last - self.problem.t0))
            self._stepper.destination = last
            self._stepper.advance(np.array([t]))
        self._bound(t)

    def _bound(self, t: float) -> None:
        """Have no step from ``t`` pass the end of the problem's interval that lies ahead, if one does."""
        if offers(self._stepper, Destination):
            first, last = self.problem.t0, self.problem.t_end
            end = last if self._way * (last - first) > 0.0 else first
            self._stepper.destination = end if self._way * (end - t) > 0.0 else None

    def _anew(self, y: Array, par: Array, *, turn: bool = False) -> None:
        t, self._par = self.t, par
        if self._wanted:
            self._before.append(self._happened())
            if not turn:
                self._since = len(self._before)
        self._way *= -1.0 if turn else 1.0
        self._begin(y, t)
        self._shown, self._over = None, False
        if self._wanted:
            self._resume(t, turn)

    def _resume(self, t: float, turn: bool) -> None:
        """Let the search for events know what has happened, also at this very time."""
        last = [self._before[-1][name] for name in self._wanted]
        directions = [
            int(hits.direction[-1]) if len(hits) and abs(hits.t[-1] - t) <= _rounding(t) else 0
            for hits in last
        ]
        if not turn and self._here[0] == t:  # it is set once more
            directions = [new or old for new, old in zip(directions, self._here[1], strict=True)]
        self._here = t, directions
        if turn or any(directions):
            counts = [sum(len(part[name]) for part in self._before[self._since :]) for name in self._wanted]
            self._stepper.search.resume(counts, directions, again=turn)

    def _turn(self) -> None:
        """Begin anew at the present, in the other direction.

        The step ahead may contain events that have happened and others that have not. So the way back begins
        here and not at the last step. An event that has happened at this very time happens again.
        """
        self._anew(self.y, self._now, turn=True)

    def _happened(self) -> dict[str, Occurrences]:
        """Return the events since the method began anew: up to the present, which a step may contain."""
        search, t = self._stepper.search, self.t
        kept = None
        if self._shown is not None and self.status is Status.RUNNING:
            kept = search.save()
            self._stepper.look_to(t)
        found = {
            name: hits.select(self._way * (hits.t - t) <= _rounding(t))
            for name, hits in search.hits.occurrences().items()
        }
        if kept is not None and search.trouble is None:
            search.load(kept)  # the step is looked at as a whole when it is taken
        return found

    @property
    def _apart(self) -> tuple[float, Array] | None:
        """The present time and state where they lie within a step: asked for, or of a terminal event."""
        if self._wanted and self.status is Status.EVENT:
            return self._stepper.search.hits.last()
        return self._shown

    @property
    def t(self) -> float:
        """The current time; after a terminal event its time."""
        apart = self._apart
        return self._stepper.t if apart is None else apart[0]

    @property
    def y(self) -> Array:
        """The current state, shape (dim,), q then p; it can be set as a whole."""
        apart = self._apart
        state = self._stepper.y if apart is None else apart[1]
        return _frozen(state, "y = run.y.copy(), then run.y = y")

    @y.setter
    def y(self, state: ArrayLike) -> None:
        values = check_state(state, self.problem.system.dim)
        self._anew(values if self.method.precision == "double" else as_pairs(values, values.size), self._now)

    @property
    def pairs(self) -> Array:
        """The current state with twice the digits of a double, shape (dim, 2), at exactly the time ``t``.

        It can be set, as pairs or as numbers of mpmath, for ``Gauss(..., precision="double-double")``. The
        end of a step may differ from ``t`` by a rounding error, so the last bits of ``y`` may differ.

        Raises
        ------
        problems.errors.InputError
            For a method that calculates with doubles.

        Examples
        --------
        >>> import problems
        >>> from integrators import Gauss, start
        >>> run = start(problems.load("kepler"), Gauss(s=12, h=0.05, precision="double-double"))
        >>> run.until(1.0).shape, run.pairs.shape, run.to_mpmath().shape
        ((4,), (4, 2), (4,))
        """
        self._check_digits()
        return _frozen(self._stepper.pairs, "run.pairs = ...")

    @pairs.setter
    def pairs(self, state: Any) -> None:
        self._check_digits()
        self._anew(as_pairs(state, self.problem.system.dim, label="pairs"), self._par)

    def to_mpmath(self) -> NDArray[Any]:
        """Return the current state as numbers of mpmath, exactly; shape (dim,).

        Raises
        ------
        problems.errors.InputError
            For a method that calculates with doubles.
        """
        return as_mpmath(self.pairs)

    def _check_digits(self) -> None:
        check_digits(self.method, events=False, variations=False)

    @property
    def _now(self) -> Array:
        """The present parameters, which an event may have changed."""
        return self._stepper.par if self._acts else self._par

    @property
    def par(self) -> Array:
        """The current parameters, shape (n_par,), as `System.pack` has them; they can be set, by name too."""
        return _frozen(self._now, 'run.par = {"name": value}')

    @par.setter
    def par(self, values: ArrayLike | Mapping[str, Any]) -> None:
        system = self.problem.system
        if isinstance(values, Mapping):
            known: dict[str, Any] = {**system.unpack(self._now), **values}
            values = system.pack(known)
        self._anew(
            self.y if self.method.precision == "double" else self.pairs, check_parameters(values, system)
        )

    @property
    def status(self) -> Status:
        """Status: ``RUNNING``, ``EVENT`` after a terminal event, or the kind of failure."""
        if self._over:
            return Status.EVENT
        trouble = self._stepper.search.trouble if self._wanted else None
        return self._stepper.status if trouble is None else trouble[0]

    @property
    def reason(self) -> str:
        """One sentence on a failure or a terminal event; empty otherwise."""
        if self._over:
            return self._stepper.search.hits.reason
        trouble = self._stepper.search.trouble if self._wanted else None
        return self._stepper.reason if trouble is None else trouble[1]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the integration so far, as those of a `Solution`, and about the present state."""
        problem, par, y = self.problem, self._now, self.y
        said = warnings(problem, problem.y0, par, y, self.method.caveat(problem), self._stepper.stats.extra)
        return said + of_tables(problem.system, par, np.array([self.t]), np.asarray(y)[np.newaxis])

    @property
    def events(self) -> dict[str, Occurrences]:
        """Occurrences of the events so far, by name."""
        if not self._wanted:
            return {}
        parts = [*self._before, self._happened()]

        def joined(name: str, key: str) -> Any:
            return np.concatenate([getattr(part[name], key) for part in parts])

        return {
            name: Occurrences(
                joined(name, "t"),
                joined(name, "y"),
                joined(name, "direction"),
                *((joined(name, "after"), joined(name, "par")) if event.then is not None else ()),
            )
            for name, event in self._wanted.items()
        }

    def step(self) -> Status:
        """Take one step of the method; after a failure or a terminal event do nothing.

        After `until` it is the remainder of the step that contains that time.
        """
        status = self.status
        if status is Status.RUNNING:
            self._shown = None
            status = self._stepper.step()
        return self.status if self._wanted else status

    def until(self, t: float) -> Array:
        """Integrate to a time, forward or backward, and return the state there.

        The method's steps do not depend on it: the state is that of `integrate` at this time, and the next
        step ends where it would have ended without the call. With events this holds in one direction: on the
        way back the method restarts at the present state, and events happen again.

        If the method fails before, or a terminal event happens, `status` and `reason` describe it, and the
        time and the state are those that were reached.

        Parameters
        ----------
        t : float
            The time.

        Returns
        -------
        ndarray, shape (dim,)

        Raises
        ------
        problems.errors.InputError
            If ``t`` is not a finite number, or a table of the time has no data up to there.
        """
        (goal,) = check_times([t], self.t).tolist()
        check_tables(self.problem.system, self._now, self.t, goal)
        if self.status is Status.RUNNING and goal != self.t:
            if (goal - (self.t if self._wanted else self._stepper.t)) * self._way < 0.0:
                if self._wanted:
                    self._turn()
                else:  # the stepper does so itself
                    self._way *= -1.0
                    self._bound(self.t)
            samples = self._advance(goal)
            self._shown = (float(samples.t[0]), samples.y[0]) if samples.t.size else None
            if self._terminates and self._stepper.status is Status.RUNNING:
                self._look_to(goal)
        return self.y

    def _advance(self, goal: float) -> Samples:
        """Integrate to a time; where that lies beyond the end ahead, a step ends there."""
        end = self._stepper.destination if offers(self._stepper, Destination) else None
        if end is not None and (goal - end) * self._way > 0.0:
            if (end - self._stepper.t) * self._way > _rounding(end):
                samples = self._stepper.advance(np.array([end]))
                if samples.status is not Status.FINISHED:
                    return cast("Samples", samples)
            self._stepper.destination = None
        return cast("Samples", self._stepper.advance(np.array([goal])))

    def _look_to(self, goal: float) -> None:
        """Look whether a terminal event lies in the part of the step ahead that ends at ``goal``."""
        search = self._stepper.search
        kept = search.save()
        self._stepper.look_to(goal)
        self._over = search.hits.terminal is not None
        if not self._over and search.trouble is None:
            search.load(kept)  # the step is looked at as a whole when it is taken

    def energy(self) -> float:
        """Return the energy of the current state, with the current parameters.

        Raises
        ------
        problems.errors.InputError
            If the system has no conserved energy.
        """
        system = self.problem.system
        if "energy" not in system.invariants:
            raise InputError(f"{system.name} has no conserved energy.")
        values = invariants.invariants(system, self._now, self.y[np.newaxis], np.array([self.t]))
        return float(values["energy"][0])

    def __repr__(self) -> str:
        return f"Run({self.problem!s}, {self.method!r}, {self.status} at t = {self.t!r})"


def _rounding(t: float) -> float:
    """Return the difference of times that rounding of the time ``t`` may account for."""
    return CLOSE * float(np.spacing(abs(t)))


class _Whole(PlainArray):
    """A copy of what can be set as a whole only: what was written into it would change nothing."""

    setting = ""

    def __setitem__(self, key: Any, value: Any) -> None:
        if not self.setting:
            return super().__setitem__(key, value)
        raise InputError(f"its parts are read-only; set the whole: {self.setting}.")

    def __array_finalize__(self, obj: Any) -> None:
        self.setting = ""  # a view or a copy is an array like others

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        plain = (np.asarray(x) if isinstance(x, _Whole) else x for x in inputs)
        return getattr(ufunc, method)(*plain, **options)

    # run.y *= 0.99 sets the whole
    def __iadd__(self, other: Any) -> Any:
        return np.asarray(self) + other

    def __isub__(self, other: Any) -> Any:
        return np.asarray(self) - other

    def __imul__(self, other: Any) -> Any:
        return np.asarray(self) * other

    def __itruediv__(self, other: Any) -> Any:
        return np.asarray(self) / other

    def __repr__(self) -> str:
        return repr(np.asarray(self))

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str) and self.setting:
            raise InputError(f"{key!r} is no index of it; system.unpack(run.par)[{key!r}] is the parameter.")
        return super().__getitem__(key)


def _frozen(array: Array, setting: str) -> Array:
    """Return a copy that refuses to be written to, and says how to set the whole."""
    copy = array.copy().view(_Whole)
    copy.setting = setting
    copy.flags.writeable = False
    return copy
