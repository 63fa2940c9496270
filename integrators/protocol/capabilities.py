"""What a method, a program or a stepper may offer besides."""

import inspect
import threading
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Protocol

from numpy.typing import ArrayLike

from integrators.protocol.protocol import MethodBase
from integrators.protocol.values import Array, Samples, Trajectories
from problems.problem import Problem


class Samplings(Protocol):
    """A stepper that does not support all of `integrators.protocol.SAMPLINGS`, or has another default.

    Attributes
    ----------
    samplings : tuple of str
        The samplings that its ``advance`` supports, the default first; it refuses all others.
    """

    samplings: tuple[str, ...]


class Destination(Protocol):
    """A stepper that knows the end of the whole integration, which ``advance`` reaches in pieces.

    It does not evaluate the vector field beyond it: the last step is shortened. A stepper that detects
    stalled integrations compares its progress with this distance, not with that of a piece.

    Attributes
    ----------
    destination : float or None
        The end time; ``None``: each ``advance`` is a separate integration.
    """

    destination: float | None


class KeptError(Protocol):
    """A stepper that stores the exception raised by a user function.

    Attributes
    ----------
    error : Exception or None
        The original exception, if the status is ``USER_ERROR``, or if a field is not defined where the
        integration has failed.
    """

    error: Exception | None


class Checkpoints(Protocol):
    """A stepper whose integration can be continued later, bitwise identical to one without a break."""

    def checkpoint(self) -> Any:
        """Return all data that the continuation depends on, as a value that can be pickled (not a view)."""
        ...

    def restore(self, checkpoint: Any) -> None:
        """Restore a checkpoint of this program; the continuation is bitwise identical.

        The checkpoint may be that of another stepper of the program, or of another program of the
        same method and system. It does not contain the parameters: the stepper must have been started with
        the same ones.

        Raises
        ------
        problems.errors.InputError
            For any other checkpoint: of another method, other options, another system or other parameters
            (`integrators.running.checkpoints.Identity`). The stepper is not changed.
        """
        ...


class Interruptible(Protocol):
    """A stepper that another thread can interrupt, and that returns after a time limit.

    Attributes
    ----------
    stop : threading.Event or None
        If it is set, ``advance`` soon raises `KeyboardInterrupt`; its samples are discarded.
    time_limit : float
        Seconds after which ``advance`` returns the samples that it has, if there are any, as
        ``FINISHED``; called with the remaining times it continues as if it had not returned. Initially
        infinite.
    """

    stop: threading.Event | None
    time_limit: float


class Actions(Protocol):
    """A program whose events may change the state and the parameters (``Event(then=...)``).

    A stepper that looks for such events has ``par``, the present parameters, shape (n_par,), and its
    ``search`` passes those after each event to `integrators.events.finder.EventLog`.

    Attributes
    ----------
    acts : bool
        Whether they may.
    """

    acts: bool


class Variations(Protocol):
    """A stepper that can propagate tangent vectors.

    Attributes
    ----------
    variations : ndarray, shape (m, dim, n), or None
        The vectors at the samples of the last ``advance``.
    """

    variations: Array | None

    def follow(self, state: ArrayLike, parameters: ArrayLike) -> None:
        """Propagate tangent vectors along the trajectory from here on.

        They are the derivatives of the steps that are taken, with fixed step sizes.

        Parameters
        ----------
        state : array_like, shape (dim, n)
            Their components in the state.
        parameters : array_like, shape (n_par, n)
            Their components in the parameters.

        Raises
        ------
        problems.errors.InputError
            For a system without a formula, and steps that are not those of a Runge-Kutta method.
        """
        ...

    def scale(self, factors: ArrayLike) -> None:
        """Multiply the vectors by numbers, from the end of the last step on.

        Powers of 2 cause no rounding errors.

        Parameters
        ----------
        factors : array_like, shape (n,)
            One for each vector; their components in the parameters must be 0.
        """
        ...


class Gradients(Protocol):
    """A stepper whose steps can be recorded for the adjoint equations."""

    def march(self, end: float, most: int) -> Samples:
        """Take at most ``most`` steps, none beyond the time ``end``, and return their ends."""
        ...

    def recorder(self, capacity: int) -> Any:
        """Return memory for the records of ``capacity`` steps: it has a ``len``, and a size in ``bytes``.

        Raises
        ------
        problems.errors.InputError
            For a system without a formula, and steps that are not those of a Runge-Kutta method.
        """
        ...

    def record(self, records: Any) -> None:
        """Record the steps from here on, including partial steps."""
        ...

    def adjoint(self, *, parameters: bool) -> Any:
        """Return an integrator of the adjoint equations over recorded steps.

        ``begin(gradient)`` sets the derivatives with respect to the last state, ``follow(records)``
        integrates back to the state before the first of these steps; ``gradient`` has the derivatives with
        respect to that state and, with ``parameters``, with respect to the parameters.
        """
        ...


class Events(Protocol):
    """A program whose steps can be searched for events."""

    def with_events(
        self, problem: Problem, events: Mapping[str, Any]
    ) -> Callable[[ArrayLike, ArrayLike | None, float, float], Any]:
        """Compile the functions of events; return a function that starts a trajectory with a search for them.

        That function takes the arguments of ``start`` and the end time of the search. The stepper that it
        returns has besides the ``search``, an `integrators.events.finder.Finder` with the events found so
        far, and ``look_to(end)``, which searches from the last step to a time within the next step. The
        events do not affect the steps and samples; a terminal one ends the integration with the status
        ``EVENT``.

        Parameters
        ----------
        problem : Problem
            Its variables are the arguments of the functions.
        events : mapping of str to integrators.events.Event
            The events, by name.

        Raises
        ------
        problems.errors.InputError
            For a function that the program cannot use.
        """
        ...


class Batches(Protocol):
    """A program that integrates many initial conditions faster than one after another."""

    def batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Trajectories:
        """Integrate many starts to the same times.

        Each result is independent of the others. A trajectory that fails has its status, reason and time, and
        does not affect the others.

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
        """
        ...


class BatchesAlong(Protocol):
    """A program that integrates many trajectories with tangent vectors faster than one after another."""

    def goes_along(self, directions: tuple[Array, Array]) -> bool:
        """Whether it has for so many vectors; they are as for `batch_along`."""
        ...

    def batch_along(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0,
        directions: tuple[Array, Array], threads: int = 1,
    ) -> Trajectories:  # fmt: skip
        """Do what `Batches.batch` does, with vectors: the result has `Trajectories.variations`.

        Parameters
        ----------
        Y0, par, times, t0
            As for `Batches.batch`.
        directions : pair of ndarray, shapes (n, dim, k), (n, n_par, k)
            Parts of the tangent vectors in the starts and in the parameters.
        threads : int
            Threads to share the work among.

        Returns
        -------
        Trajectories

        Raises
        ------
        problems.errors.InputError
            Where `goes_along` says that it cannot, and as `Batches.batch`.
        """
        ...


class BatchesEvents(Protocol):
    """A function that `Events.with_events` returned and that also integrates many trajectories together."""

    def goes_in_batches(self) -> bool:
        """Whether `find_in_batch` can be called; it compiles what that needs."""
        ...

    def find_in_batch(
        self, Y0: ArrayLike, par: ArrayLike | None, times: ArrayLike, t0: float, threads: int
    ) -> tuple[Trajectories, list[dict[str, Any]]]:
        """Integrate as `Batches.batch` with a search for the events.

        The second result has the `integrators.solution.Occurrences` of each trajectory by the events' names.
        """
        ...


class PreparedBatches(Protocol):
    """A program whose batches can be prepared, so that the integration can be timed separately."""

    def prepare_batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Callable[[], Trajectories]:
        """Compile, check and allocate for `Batches.batch`; return a function that integrates, once."""
        ...


class Threads(Protocol):
    """A program whose ``batch`` also takes ``threads=``, a number of threads to share the work among.

    Attributes
    ----------
    threaded : bool
        Whether it does.
    """

    threaded: bool


class SharedSteps(Protocol):
    """A stepper whose steps several threads can share."""

    def share(self, threads: int) -> None:
        """Share the work of each step among so many threads; the samples are bitwise the same.

        Raises
        ------
        problems.errors.InputError
            Where that would save no time, with the reason.
        """
        ...


class PieceSize(Protocol):
    """A program whose ``batch`` has a recommended number of trajectories for its first call.

    Attributes
    ----------
    piece : int
        That number; later pieces have more where they take little time.
    """

    piece: int


class DoubleDouble(Protocol):
    """A program whose states have twice the digits of a double, unevaluated sums of two."""

    def start_pairs(self, pairs: Array, par: Array | None = None, t0: float = 0.0) -> Any:
        """Return a stepper at ``t0``.

        Its samples are states rounded to doubles; it has besides ``low``, their low parts at the last
        ``advance``, shape (m, dim), and ``pairs``, the state at the current time.

        Parameters
        ----------
        pairs : ndarray, shape (dim, 2)
            The state: the nearest doubles, and the low parts.
        par, t0
            As for `Program.start`.
        """
        ...


class AsHBVM(Protocol):
    """A method that is identical to HBVM(k, s) for certain k and s."""

    def as_hbvm(self) -> "MethodBase":
        """Return it as `integrators.HBVM`.

        Raises
        ------
        problems.errors.InputError
            If options that HBVM does not have change its steps.
        """
        ...


CAPABILITIES: tuple[type, ...] = (
    Samplings, Destination, KeptError, Checkpoints, Interruptible,
    Events, Actions, Batches, BatchesAlong, BatchesEvents, PreparedBatches, Threads, SharedSteps, PieceSize,
    Variations, Gradients, DoubleDouble, AsHBVM,
)  # fmt: skip
"""All of them."""


def offers(thing: Any, capability: type) -> bool:
    """Whether a method, a program or a stepper has everything that a capability names."""
    # Without a generator, which takes longer: `integrate` asks at each call.
    for name in members(capability):  # noqa: SIM110
        if not hasattr(thing, name):
            return False
    return True


@cache
def members(capability: type) -> tuple[str, ...]:
    """Return the names that a capability consists of."""
    named = {**inspect.get_annotations(capability), **vars(capability)}
    return tuple(name for name in named if not name.startswith("_"))
