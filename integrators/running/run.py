"""A trajectory that is taken step by step, and changed between steps."""

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import registry
from integrators.events.event import Event
from integrators.protocol import Array, Destination, DoubleDouble, MethodBase, Status, check_problem, offers
from integrators.refusals import check_parameters, check_state, check_times
from integrators.running.digits import as_pairs, check_digits, pairs
from integrators.running.integrate import prepared, started, wanted_events
from integrators.solution import Occurrences, as_mpmath
from problems.analysis import invariants
from problems.checks import checked_arguments
from problems.errors import InputError
from problems.problem import Problem


@checked_arguments
def start(
    problem: Problem,
    method: MethodBase | None = None,
    events: Event | Callable[..., Any] | Sequence[Event | Callable[..., Any]] = (),
    *,
    start: Any = None,
) -> "Run":
    """Return a trajectory at the problem's start, which is then taken step by step.

    Parameters
    ----------
    problem : Problem
        What to integrate. Its end is none here, and tells only how long a first step may be.
    method : MethodBase, optional
        How; ``HBVM()`` by default.
    events : Event or callable, or a sequence of them, optional
        What to look for in the steps; see `integrators.events.Event`.
    start : array_like, shape (dim,) or (dim, 2), optional
        The problem's start with more digits than doubles have; see `integrate`.

    Returns
    -------
    Run

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or cannot find events.

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
    return Run(problem, method, events, start)


class Run:
    """A trajectory under way; `start` makes it.

    Its steps are those of `integrate` to the problem's end, bit for bit, and so are the states at other
    times. The state and the parameters can be set between steps: the method then begins anew, at this time.

    Attributes
    ----------
    problem, method
        What is integrated, and how.

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
        self._shown: tuple[float, Array] | None = None
        digits = start is not None or method.precision != "double"
        if digits:
            check_digits(method, events=bool(self._wanted), variations=False)
        begin = pairs(problem.y0 if start is None else start, problem) if digits else problem.y0
        self._begin(begin, problem.t0)

    def _begin(self, y: Array, t: float) -> None:
        """Begin at a state, or at its pairs."""
        if y.ndim == 2:
            self._stepper = cast("DoubleDouble", self._program).start_pairs(y, self._par, t)
            return
        last = self.problem.t_end
        end = sys.float_info.max if last >= self.problem.t0 else -sys.float_info.max
        self._stepper = started(self._program, self.method, self.problem, self._wanted, y, self._par, t, end)
        if offers(self._stepper, Destination):  # how long an interval is says how long a first step may be
            self._stepper.destination = last
            self._stepper.advance(np.array([t]))
            self._stepper.destination = None

    def _anew(self, y: Array, par: Array) -> None:
        t, self._par = self.t, par
        if self._wanted:
            self._before.append(self._stepper.search.hits.occurrences())
        self._begin(y, t)
        self._shown = None

    @property
    def t(self) -> float:
        """The present time."""
        return self._stepper.t if self._shown is None else self._shown[0]

    @property
    def y(self) -> Array:
        """The present state, shape (dim,), q then p; it can be set, as a whole."""
        return _frozen(self._stepper.y if self._shown is None else self._shown[1])

    @y.setter
    def y(self, state: ArrayLike) -> None:
        values = check_state(state, self.problem.system.dim)
        self._anew(values if self.method.precision == "double" else as_pairs(values, values.size), self._now)

    @property
    def pairs(self) -> Array:
        """The present state with twice the digits of a double, shape (dim, 2), at exactly the time ``t``.

        It can be set, as pairs or as numbers of mpmath, for ``Gauss(..., precision="double-double")``. A step
        may end a rounding error of ``t`` away, so the last bits of ``y`` may be others.

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
        return _frozen(self._stepper.pairs)

    @pairs.setter
    def pairs(self, state: Any) -> None:
        self._check_digits()
        self._anew(as_pairs(state, self.problem.system.dim, label="pairs"), self._par)

    def to_mpmath(self) -> NDArray[Any]:
        """Return the present state as numbers of mpmath, exactly; shape (dim,).

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
        """The present parameters, shape (n_par,), as `System.pack` has them; they can be set, by name too."""
        return _frozen(self._now)

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
        """How it stands: ``RUNNING``, ``EVENT`` after a terminal event, or why it failed."""
        return self._stepper.status

    @property
    def reason(self) -> str:
        """One sentence on a failure; empty otherwise."""
        return self._stepper.reason

    @property
    def events(self) -> dict[str, Occurrences]:
        """What was found in the steps so far, by name."""
        if not self._wanted:
            return {}
        parts = [*self._before, self._stepper.search.hits.occurrences()]

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
        """Take a step of the method's own length; after a failure or a terminal event do nothing.

        After `until` that is the rest of the step in which that time lies.
        """
        if self._stepper.status is Status.RUNNING:
            self._stepper.step()
            self._shown = None
        return self._stepper.status

    def until(self, t: float) -> Array:
        """Go to a time, ahead or back, and return the state there.

        The method's steps do not depend on it: the state is what `integrate` returns for this time, and the
        next step goes on to where it would have ended. Where the method fails before, `status` and `reason`
        say so, and the time and the state are those that were reached.

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
            If it is no finite number.
        """
        (goal,) = check_times([t], self.t).tolist()
        if self._stepper.status is Status.RUNNING and goal != self.t:
            samples = self._stepper.advance(np.array([goal]))
            self._shown = (goal, samples.y[0]) if samples.t.size else None
        return self.y

    def energy(self) -> float:
        """Return the energy at the present state, with the present parameters.

        Raises
        ------
        problems.errors.InputError
            If the system has none that is conserved.
        """
        system = self.problem.system
        if "energy" not in system.invariants:
            raise InputError(f"{system.name} has no conserved energy.")
        values = invariants.invariants(system, self._now, self.y[np.newaxis], np.array([self.t]))
        return float(values["energy"][0])

    def __repr__(self) -> str:
        return f"Run({self.problem!r}, {self.method!r}, {self.status} at t = {self.t!r})"


def _frozen(array: Array) -> Array:
    """Return a copy that cannot be written to: what is written to it would change nothing."""
    copy = array.copy()
    copy.flags.writeable = False
    return copy
