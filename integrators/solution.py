"""The solution of an initial value problem: samples, statistics and warnings."""

import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.caveats import (
    LOOKED_AT,
    expected,
    lost_invariants,
    of_atol,
    of_losses,
    of_tables,
    warnings,
)
from integrators.plain import (
    doubles,
    packed,
    packed_method,
    packed_problem,
    unpacked,
    unpacked_method,
    unpacked_problem,
)
from integrators.protocol import Array, DoubleDouble, MethodBase, Program, Stats, Status
from integrators.segments import Segments
from problems.analysis import deviations, invariants
from problems.bodies import Elements, elements
from problems.checks import File, checked_arguments, readable
from problems.double_double import DD
from problems.errors import InputError, MissingLibraryError, printable, shown
from problems.problem import Problem
from problems.quantities import plain_numbers

FORMAT = 1  # of files
ROUNDING = 1e-14  # relative to its largest size, how far a component may be from a sample that is met
EXACT_BITS = 2200  # of the sum of any two doubles
FAR, MOST_AT_ONCE = 4, 1024  # intervals between samples: not gone through for nothing, and at a time


@dataclass(frozen=True, eq=False)
class Occurrences:
    """Occurrences of one event.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times, in the order of integration.
    y : ndarray, shape (n, dim)
        States at these times, each the end of a partial step.
    direction : ndarray of int, shape (n,)
        1 where g increases, -1 where it decreases, 0 where it touches zero without a change of sign.
    after : ndarray, shape (n, dim), optional
        The states after the event's action; ``None`` for an event without one.
    par : ndarray, shape (n, n_par), optional
        The parameters from then on, as `System.unpack` takes them; ``None`` for an event without an action.
    """

    t: Array
    y: Array
    direction: NDArray[np.int64]
    after: Array | None = None
    par: Array | None = None

    def __len__(self) -> int:
        return self.t.size

    def select(self, which: NDArray[Any]) -> "Occurrences":
        """Return some of them, by a mask or indices."""
        after = None if self.after is None else self.after[which]
        par = None if self.par is None else self.par[which]
        return Occurrences(self.t[which], self.y[which], self.direction[which], after, par)


@readable
@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """A trajectory and the work it took; ``print`` shows a summary.

    Call it with times to evaluate it there: `__call__`. It can be pickled, with any problem; `save` and
    `load` store it in a file.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times reached; all output times if ``status`` is ``FINISHED``. If a method fails before the first of
        them, the time that it reached.
    y : ndarray, shape (n, dim)
        States: q then p for Hamiltonian problems.
    status : Status
        How the integration ended; a failure is a value, not an exception.
    reason : str
        One sentence on a failure; empty otherwise.
    t_stop : float
        Time at which the integration stopped: the last output time, or the time of the failure.
    stats : Stats
        Counters of the work done.
    compile_seconds : float
        Seconds spent compiling, before the first step.
    from_cache : bool or None
        Whether the compiled code came from a cache; ``None`` where nothing is compiled.
    problem, method
        The problem that was integrated, and the method.
    events : dict of str to Occurrences
        Times, states and directions of the requested events, by name.
    variations : ndarray, shape (n, dim, m), or None
        Tangent vectors at these times, if requested: columns in the order of the request.
    directions : tuple of ndarray, or None
        Their components in the initial state, (dim, m), and in the parameters, (n_par, m).
    low : ndarray, shape (n, dim), or None
        Low parts of the states, if they have twice the digits of a double; see `pairs`.
    start : ndarray, shape (dim, 2), or None
        The initial state of these, in pairs.
    error : Exception or None
        The exception raised by a user function, if ``status`` is ``USER_ERROR``.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, integrate
    >>> solution = integrate(problems.load("pendulum"), Gauss(s=4, h=0.1), [0.0, 5.0, 10.0])
    >>> solution.status, solution.stats.steps, solution.q.shape, solution(2.5).shape
    (<Status.FINISHED: 'finished'>, 100, (3, 1), (2,))
    """

    t: Array
    y: Array
    status: Status
    reason: str
    t_stop: float
    stats: Stats
    compile_seconds: float
    from_cache: bool | None
    problem: Problem
    method: MethodBase
    events: Mapping[str, Occurrences] = field(default_factory=dict)
    error: Exception | None = None
    variations: Array | None = None
    directions: tuple[Array, Array] | None = None
    low: Array | None = None
    start: Array | None = None

    def __call__(self, t: ArrayLike) -> Array:
        """Return the states at arbitrary times within the computed interval.

        The method integrates from the last sample before each time. The states therefore have the method's
        order and conserve the energy; the cost is at most the steps between two samples. At the time of a
        sample it returns that sample.

        Parameters
        ----------
        t : array_like
            Times of any shape and order, between the problem's ``t0`` and the last one reached.

        Returns
        -------
        ndarray, shape (..., dim)

        Raises
        ------
        problems.errors.InputError
            For times outside the interval, or if the integration from the previous sample fails.
        """
        return self._at(t)[..., : self.problem.system.dim]

    def variations_at(self, t: ArrayLike) -> Array:
        """Return the variations at arbitrary times within the computed interval.

        Parameters
        ----------
        t : array_like
            Times of any shape and order, between the problem's ``t0`` and the last one reached.

        Returns
        -------
        ndarray, shape (..., dim, n)

        Raises
        ------
        problems.errors.InputError
            As for states; and for a solution without variations.

        Examples
        --------
        >>> import problems
        >>> from integrators import Gauss, integrate
        >>> solution = integrate(problems.load("pendulum"), Gauss(s=4, h=0.1), 2.0, variations="y0")
        >>> solution.variations_at(1.2345).shape
        (2, 2)
        """
        if self.directions is None:
            raise InputError("the solution has no variations; give integrate(..., variations=).")
        rows = self._at(t)[..., self.problem.system.dim :]
        return rows.reshape(*rows.shape[:-1], *self.directions[0].shape)

    def pairs_at(self, t: ArrayLike) -> Array:
        """Return the states at arbitrary times within the computed interval, in pairs of doubles.

        Parameters
        ----------
        t : array_like
            Times of any shape and order, between the problem's ``t0`` and the last one reached.

        Returns
        -------
        ndarray, shape (..., dim, 2)

        Raises
        ------
        problems.errors.InputError
            As for states; and for a solution that has doubles only.
        """
        self._check_digits()
        rows = self._at(t)
        return np.stack(np.split(rows, 2, axis=-1), axis=-1)

    def _check_digits(self) -> None:
        if self.low is None:
            raise InputError(
                "the solution has doubles only; integrate with Gauss(s=, h=, precision='double-double')."
            )

    def _at(self, t: ArrayLike) -> Array:
        """Return the states at times with, where there are any, variations or low parts; shape (..., m)."""
        times, dim = plain_numbers("t", t), self.problem.system.dim
        before = self.t.size == 0 or self.t[0] != self.problem.t0
        at = np.concatenate([[self.problem.t0][: int(before)], self.t])
        states = np.concatenate([self.problem.y0[np.newaxis][: int(before)], self.y])
        if self.directions is not None and self.variations is not None:
            first = self.directions[0][np.newaxis][: int(before)]
            vectors = np.concatenate([first, self.variations])
            states = np.concatenate([states, vectors.reshape(len(vectors), -1)], axis=1)
        if self.low is not None and self.start is not None:
            first = self.start[np.newaxis, :, 1][: int(before)]
            states = np.concatenate([states, np.concatenate([first, self.low])], axis=1)
        end = float(at[-1])
        segments = self._segments
        if segments.t.size > 1:  # states that events have made, in between; at one time the sample counts
            at, states = np.append(at, segments.t[1:]), np.concatenate([states, segments.y[1:]])
            _, order = np.unique(segments.sign * at, return_index=True)
            at, states = at[order], states[order]
        segment = segments.places(at, states[:, :dim])
        if not self.status.failed and (self.t_stop - end) * (end - self.problem.t0) >= 0.0:
            end = self.t_stop  # a terminal event, after the last sample
        sign = 1.0 if end >= self.problem.t0 else -1.0
        wanted, places = np.unique(sign * times, return_inverse=True)
        inside = (wanted >= sign * at[0]) & (wanted <= sign * end)
        if not inside.all():
            wrong = float(sign * wanted[int(np.argmin(inside))])
            raise InputError(
                f"t={wrong!r} is not between t = {float(at[0])!r} and {end!r}, which the solution covers."
            )
        states_ = np.empty((wanted.size, states.shape[1]))
        sample = np.searchsorted(sign * at, wanted, side="right") - 1
        close = max(ROUNDING, self.method.options(defaults=True).get("tol") or 0.0) * np.abs(
            states[:, :dim]
        ).max(axis=0)
        intervals, first, count = np.unique(sample), 0, 1
        while first < intervals.size:
            group = intervals[first : first + count]
            far = np.flatnonzero(np.diff(group) > FAR)
            group = group[: far[0] + 1] if far.size else group
            mine = np.flatnonzero((sample >= group[0]) & (sample <= group[-1]))
            ends = sign * at[group]
            goals = np.union1d(wanted[mine], ends[1:])
            goals = goals[goals > ends[0]]
            reached = states[:0]
            if goals.size:
                start = float(at[group[0]])
                stepper = self._begun(states[group[0]], start, segments.par[segment[group[0]]])
                if self.directions is not None:
                    stepper.follow(states[group[0], dim:].reshape(dim, -1), self.directions[1])
                advanced = stepper.advance(sign * goals)
                if advanced.status.failed and group.size > 1:
                    count = 1
                    continue
                if advanced.status.failed:
                    raise InputError(f"{self.method!r} does not go on from t = {start!r}: {advanced.reason}")
                reached = advanced.y
                if self.directions is not None:
                    reached = np.concatenate([reached, stepper.variations.reshape(len(reached), -1)], axis=1)
                if self.low is not None:
                    reached = np.concatenate([reached, stepper.low], axis=1)
            goals, reached = np.append(ends[0], goals), np.concatenate([states[group[:1]], reached])
            # As long as the samples are met the method goes on from where it is, else from them.
            met = (np.abs((reached[np.searchsorted(goals, ends)] - states[group])[:, :dim]) <= close).all(
                axis=1
            )
            met &= segment[group] == segment[group[0]]
            done = group.size if met.all() else int(np.argmin(met))
            mine = mine[sample[mine] <= group[done - 1]]
            states_[mine] = reached[np.searchsorted(goals, wanted[mine])]
            first += done
            count = min(2 * count, MOST_AT_ONCE) if done == group.size else done
        own = wanted == sign * at[sample]
        states_[own] = states[sample[own]]
        return states_[places.reshape(times.shape)]

    def _begun(self, row: Array, t: float, par: Array) -> Any:
        """Return a stepper at a state, which may have low parts behind it."""
        dim, program = self.problem.system.dim, self._program
        if self.low is None:
            return program.start(row[:dim], par, t)
        pairs = np.stack([row[:dim], row[dim:]], axis=1)
        return cast("DoubleDouble", program).start_pairs(pairs, par, t)

    @property
    def _acted(self) -> bool:
        """Whether an event has changed the state or the parameters."""
        return any(happened.after is not None and happened.t.size for happened in self.events.values())

    @property
    def _segments(self) -> Segments:
        """The segments between events that change the state or the parameters."""
        problem, sign = self.problem, 1.0 if self.t_stop >= self.problem.t0 else -1.0
        return Segments.from_events(problem.t0, problem.y0, problem.par, self.events, sign)

    @cached_property
    def _program(self) -> Program:
        return self.method.compile(self.problem.system)

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != "_program"}

    @property
    def q(self) -> Array | None:
        """Positions (n, dof), a view of ``y``; ``None`` for systems that have no positions and momenta."""
        dof = self.problem.system.dof
        return None if dof is None else self.y[:, :dof]

    @property
    def p(self) -> Array | None:
        """Momenta (n, dof), a view of ``y``; ``None`` as for ``q``."""
        dof = self.problem.system.dof
        return None if dof is None else self.y[:, dof:]

    @property
    def v(self) -> Array | None:
        """Velocities (n, dof) of a Lagrangian, or a Hamiltonian with constant masses, else ``None``."""
        if not self._acted:
            return self.problem.velocity(self.y, self.t)
        segments = self._segments
        par = segments.par[segments.places(self.t, self.y)].T
        return invariants.velocity(self.problem.system, par, self.y, self.t)

    @property
    def multipliers(self) -> Array | None:
        """Multipliers of the constraints of a `problems.Constrained`, shape (n, m), else ``None``.

        The force of constraint j on coordinate i is ``-multipliers[:, j]`` times the derivative of the
        constraint by the coordinate.
        """
        return self.problem.multipliers(self.y, self.t)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about a solution that did not fail."""
        problem, extra = self.problem, self.stats.extra
        end = self.y[-1] if self.t.size else None
        said = warnings(problem, problem.y0, problem.par, end, self.method.caveat(problem), extra)
        if failure := extra.get("checkpoint"):
            said = (*said, failure)
        acted = any(happened.after is not None for happened in self.events.values())
        conserved = self.method.conserved(problem.system)
        held = {} if extra.get("sample") == "dense" else expected(problem.system, conserved)
        lost = {} if acted else lost_invariants(
            problem.system, held, problem.y0[None], self.t, self.y[None], problem.par[None],
            np.array([self.stats.steps]),
        )[0]  # fmt: skip
        for name, seen in extra.get("losses", {}).items():  # what was seen at checkpoints
            loss = tuple(seen) if len(seen) == 2 else (seen[0], seen[1] / seen[2])  # of version 0.1
            if name not in lost or abs(loss[0] - problem.t0) < abs(lost[name][0] - problem.t0):
                lost[name] = loss
        said += of_atol(problem, self.method.options(defaults=True).get("atol"), problem.y0, self.y)
        said += of_losses(lost, conserved)
        return said + of_tables(problem.system, problem.par, self.t, self.y, (problem.t0, problem.y0))

    def invariants(self) -> dict[str, Array]:
        """Return the problem's invariants along the trajectory, by name, with the parameters of each time."""
        return self._segments.invariants(self.problem.system, self.t, self.y)

    def errors(self) -> dict[str, Array]:
        """Return the errors of the invariants along the trajectory, see `problems.Problem.errors`.

        They are those of the integration: after an event that changes the state or the parameters
        (``Event(then=...)``) each invariant is compared with what it is right after that event, and not with
        the start. How much the events have changed it is in `invariants`.
        """
        return self._errors(slice(None))

    def _errors(self, which: Any) -> dict[str, Array]:
        problem = self.problem
        if self.low is None or self.start is None:
            return self._segments.errors(problem.system, self.t[which], self.y[which])
        states, begin = DD(self.y[which], self.low[which]), (problem.t0, DD(*self.start.T))
        return deviations.errors(problem.system, problem.par, states, self.t[which], starts=begin)

    @property
    def pairs(self) -> Array:
        """The states with twice the digits of a double, as unevaluated sums; shape (n, dim, 2).

        Raises
        ------
        problems.errors.InputError
            For a solution that has doubles only.

        Examples
        --------
        >>> import problems
        >>> from integrators import Gauss, integrate
        >>> method = Gauss(s=12, h=0.05, precision="double-double")
        >>> solution = integrate(problems.load("kepler", e=0.6), method, [10.0])
        >>> solution.pairs.shape, bool(solution.errors()["energy"].max() < 1e-29)
        ((1, 4, 2), True)
        """
        self._check_digits()
        return np.stack([self.y, np.asarray(self.low)], axis=-1)

    def to_mpmath(self) -> NDArray[Any]:
        """Return the states as numbers of mpmath, exactly; shape (n, dim).

        Raises
        ------
        problems.errors.InputError
            For a solution that has doubles only.
        """
        return as_mpmath(self.pairs)

    def elements(self, body: int | str, primary: int | str = 0) -> Elements:
        """Return the orbital elements of a body of `problems.nbody` at the samples.

        Parameters
        ----------
        body : int or str
            Which body, by its index or name.
        primary : int or str
            What the orbit is about: a body, ``"jacobi"`` for the centre of mass of all bodies before it, or
            ``"barycentric"`` for that of all.

        Returns
        -------
        Elements
            Arrays of shape (n,): a, e, inc, Omega, omega, f, M and T; see `problems.bodies.Elements`.

        Raises
        ------
        problems.errors.InputError
            For a problem without bodies in space, and a body that is not there.
        """
        return elements(self.problem, self.y, self.t, body=body, primary=primary)

    def guards(self) -> dict[str, Array]:
        """Return the quantities that are exactly zero by a symmetry, by name."""
        if not self._acted:
            return self.problem.guards(self.y, self.t)
        segments = self._segments
        par = segments.par[segments.places(self.t, self.y)].T
        return invariants.guards(self.problem.system, par, self.y, self.t)

    def __repr__(self) -> str:
        return printable(
            f"Solution({self.problem!s}, {self.method!r}, {self.status} at t = {self.t_stop!r}, "
            f"{self.t.size} states)"
        )

    def __str__(self) -> str:
        lines = [str(self.problem), self._with(), self._cost(), *self._kept()]
        if self.events:
            counts = ", ".join(f"{name} {len(happened)}" for name, happened in self.events.items())
            lines.append(f"events found: {counts}")
        lines += [f"warning: {sentence}" for sentence in self.warnings]
        return printable("\n".join(lines))  # a file that was loaded may hold any text

    def _with(self) -> str:
        """Return how it was integrated, with what the method chose itself, and how it ended."""
        method, extra, steps = self.method, self.stats.extra, self.stats.steps
        options = method.options(defaults=True)
        chosen = [f"{key}={extra[key]}" for key in "ks" if key in extra and options.get(key, 0) is None]
        if steps and (options.get("h") is None or options.get("tol") is not None):
            chosen.append(f"steps of {abs(self.t_stop - self.problem.t0) / steps:.3g} on average")
        words = f" ({', '.join(chosen)})" if chosen else ""
        ended = f"{self.status} at t = {self.t_stop:.15g}, {self.t.size} states"
        return f"{self.method!r}{words}\n{ended}{': ' + self.reason if self.reason else ''}"

    def _cost(self) -> str:
        stats = self.stats
        counts = {
            "rejected": stats.rejections,
            "evaluations of the field": stats.evaluations,
            "iterations": stats.iterations,
        }
        told = [f"{stats.steps} steps", *(f"{n} {name}" for name, n in counts.items() if n)]
        told += [f"solver: {stats.solver}"] if stats.solver else []
        cached = ", from a cache" if self.from_cache else ""
        return f"{', '.join(told)}; compiled in {self.compile_seconds:.2g} s{cached}"

    def _kept(self) -> list[str]:
        """Return the largest errors of the invariants; of long solutions, at some of the states."""
        if not self.t.size:
            return []
        every = -(-self.t.size // LOOKED_AT)
        places = np.unique(np.append(np.arange(0, self.t.size, every), self.t.size - 1))
        errors = self._errors(places)
        largest = ", ".join(f"{name} {float(error.max()):.1e}" for name, error in errors.items())
        where = f" at {places.size} of the states" if every > 1 else ""
        where += " since the last event that changes the state" if self._acted else ""
        return [f"largest errors{where}: {largest}"] if errors else []

    def to_pandas(self) -> Any:
        """Return a ``pandas.DataFrame``: the times are its index, q0, q1 ... p0 ... (or y0 ...) its columns.

        Raises
        ------
        problems.errors.MissingLibraryError
            If pandas is not installed.
        """
        pandas = library("pandas")
        names = [f"{x}{i}" for x, part in self._parts().items() for i in range(part.shape[1])]
        frame = pandas.DataFrame(self.y, index=pandas.Index(self.t, name="t"), columns=names)
        frame.attrs = self._about()
        return frame

    def to_xarray(self) -> Any:
        """Return an ``xarray.Dataset``: q and p (or y) along ``t`` and ``i``.

        Raises
        ------
        problems.errors.MissingLibraryError
            If xarray is not installed.
        """
        xarray = library("xarray")
        parts = {name: (("t", "i"), part) for name, part in self._parts().items()}
        return xarray.Dataset(parts, coords={"t": self.t}, attrs=self._about())

    def _parts(self) -> dict[str, Array]:
        return {"y": self.y} if self.q is None or self.p is None else {"q": self.q, "p": self.p}

    def _about(self) -> dict[str, str]:
        return {"problem": repr(self.problem), "method": repr(self.method), "status": str(self.status)}

    @checked_arguments
    def save(self, path: File) -> None:
        """Write the solution to a file that `load` reads: arrays and JSON in NumPy's npz format.

        The file contains the problem with its traced formulas, so that it can be loaded without your
        functions; the field of an `problems.Opaque` is code and is not stored. An existing file is replaced
        atomically.

        Raises
        ------
        problems.errors.InputError
            For a method that is not registered, or a file that cannot be written.
        """
        arrays: dict[str, NDArray[Any]] = {"t": self.t, "y": self.y}
        if self.variations is not None:
            arrays["variations"] = self.variations
        if self.directions is not None:
            arrays["directions_state"], arrays["directions_parameters"] = self.directions
        if self.low is not None and self.start is not None:
            arrays |= {"low": self.low, "start": self.start}
        for name, happened in self.events.items():
            arrays |= {
                f"event_{key}:{name}": value for key, value in vars(happened).items() if value is not None
            }
        words = {
            "format": FORMAT,
            "problem": packed_problem(self.problem, arrays),
            "method": packed_method(self.method, arrays),
            "stats": packed(asdict(self.stats), arrays),
            "events": list(self.events),
            "status": str(self.status),
            "error": None if self.error is None else [type(self.error).__name__, str(self.error)],
        }
        words |= {key: getattr(self, key) for key in _AS_THEY_ARE}
        arrays["words"] = np.frombuffer(json.dumps(words).encode(), dtype=np.uint8)
        write_whole(
            Path(path),
            lambda file: np.savez(file, **arrays),  # pyright: ignore[reportArgumentType]
        )


def as_mpmath(pairs: Array) -> NDArray[Any]:
    """Return pairs, shape (..., 2), as numbers of mpmath, exactly."""
    import mpmath  # for those who need it

    numbers = np.empty(pairs.shape[:-1], dtype=object)
    with mpmath.workprec(EXACT_BITS):
        for place in np.ndindex(numbers.shape):
            high, low = pairs[place].tolist()
            numbers[place] = mpmath.mpf(high) + low
    return numbers


_AS_THEY_ARE = ("reason", "t_stop", "compile_seconds", "from_cache")


def read_file(path: Any, problem: Any, readers: Mapping[str | None, Any]) -> Any:
    """Return what a file holds, by the reader of its kind: ``reader(words, arrays, problem)``.

    Raises
    ------
    problems.errors.InputError
        For a file that is not there, is damaged, or is none of these.
    """
    if not isinstance(problem, Problem | None):
        raise InputError(f"problem={shown(problem)} of load must be the Problem that was integrated.")
    try:
        with Path(path).open("rb") as handle, np.load(handle, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        words = json.loads(arrays["words"].tobytes())
        if words["format"] != FORMAT:
            raise InputError(f"{path} is of format {words['format']}, which this version does not read.")
        problem_ = unpacked_problem(words["problem"], arrays) or problem
        if problem_ is None:
            raise InputError(
                f"the field of the solution in {path} is code, which the file does not hold; "
                "load it with problem=, the one that was integrated."
            )
        return readers[words.get("kind")](words, arrays, problem_)
    except (InputError, FileNotFoundError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"there is no file {shown(str(path))}; give one that Solution.save wrote.") from None
    except Exception as error:  # whatever reading a file of any content raises
        why = f"{type(error).__name__}: {shown(str(error))}"
        raise InputError(
            f"{shown(str(path))} is not a solution, or is damaged ({why}); "
            "give a file that Solution.save wrote."
        ) from None


if TYPE_CHECKING:
    solution_of = Solution
else:

    def solution_of(**fields: Any) -> Solution:
        """Return ``Solution(**fields)``, given all of them; a frozen class sets each by a call."""
        solution = object.__new__(Solution)
        vars(solution).update(fields)
        return solution


def from_file(words: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], problem: Problem) -> Solution:
    """Return the solution that words and arrays of a file tell of."""
    dim, n = problem.system.dim, np.size(arrays["t"])
    return Solution(
        t=doubles(arrays["t"], (n,), "t"),
        y=doubles(arrays["y"], (n, dim), "y"),
        status=Status(words["status"]),
        stats=_stats(unpacked(words["stats"], arrays)),
        problem=problem,
        method=unpacked_method(words["method"], arrays),
        events={name: occurrences(name, arrays, problem) for name in words["events"]},
        variations=_variations(arrays, n, dim),
        directions=_directions(arrays, dim, problem.par.size),
        **_digits(arrays, n, dim),
        error=None if words["error"] is None else RuntimeError(": ".join(words["error"])),
        reason=of_type(str, words["reason"]),
        t_stop=of_type(float, words["t_stop"]),
        compile_seconds=of_type(float, words["compile_seconds"]),
        from_cache=None if words["from_cache"] is None else of_type(bool, words["from_cache"]),
    )


def of_type(kind: type[Any], value: Any) -> Any:
    """Return a stored value of a type; whole numbers are numbers too."""
    if type(value) is not kind and not (kind is float and type(value) is int):
        raise TypeError(f"{shown(value)} is no {kind.__name__}")
    return kind(value)


def _stats(stored: Any) -> Stats:
    stats = Stats(**stored)
    counts = (stats.rejections, stats.evaluations, stats.iterations)
    for count in (of_type(int, stats.steps), *(n for n in counts if n is not None)):
        of_type(int, count)
    if stats.solver is not None:
        of_type(str, stats.solver)
    check_extra(stats.extra)
    return stats


def check_extra(extra: Any) -> None:
    """Refuse stored ``extra`` of a trajectory whose parts that warnings are made of have other types."""
    of_type(dict, extra)
    for t, h in extra.get("kinks", ()):  # which `Solution.warnings` reads, as it does the next
        of_type(float, t)
        of_type(float, h)
    for t, change, size in of_type(dict, extra.get("lost", {})).values():
        for number in (t, change, size):
            of_type(float, number)
    of_type(str, extra.get("checkpoint", ""))
    of_type(int, extra.get("implicit", {"steps": 0})["steps"])


def occurrences(name: str, arrays: Mapping[str, NDArray[Any]], problem: Problem) -> Occurrences:
    """Return where an event happened, from the arrays of a file."""
    dim, n_par = problem.system.dim, problem.system.n_par
    t, y, direction = (arrays[f"event_{key}:{of_type(str, name)}"] for key in ("t", "y", "direction"))
    if direction.dtype.kind != "i" or direction.shape != t.shape:
        raise TypeError(f"the directions of {shown(name)} are not as many as its times")
    n = np.size(t)
    after, par = arrays.get(f"event_after:{name}"), arrays.get(f"event_par:{name}")
    return Occurrences(
        doubles(t, (n,), "t"), doubles(y, (n, dim), "y"), direction.astype(np.int64),
        None if after is None else doubles(after, (n, dim), "after"),
        None if par is None else doubles(par, (n, n_par), "par"),
    )  # fmt: skip


def _digits(arrays: Mapping[str, NDArray[Any]], n: int, dim: int) -> dict[str, Array]:
    """Return the low parts of states and the start in pairs, which a file has both or none of."""
    if "low" not in arrays and "start" not in arrays:
        return {}
    if "variations" in arrays or "directions_state" in arrays:
        raise TypeError("low parts and variations do not go together")
    return {
        "low": doubles(arrays["low"], (n, dim), "low"),
        "start": doubles(arrays["start"], (dim, 2), "start"),
    }


def _variations(arrays: Mapping[str, NDArray[Any]], n: int, dim: int) -> Array | None:
    vectors = arrays.get("variations")
    return None if vectors is None else doubles(vectors, (n, dim, vectors.shape[-1]), "variations")


def _directions(arrays: Mapping[str, NDArray[Any]], dim: int, n_par: int) -> tuple[Array, Array] | None:
    state, parameters = arrays.get("directions_state"), arrays.get("directions_parameters")
    if state is None or parameters is None:
        return None
    n = state.shape[-1]
    return doubles(state, (dim, n), "directions"), doubles(parameters, (n_par, n), "directions")


def write_whole(path: Path, write: Any) -> None:
    """Write a file under another name and give it its own when it is complete.

    Raises
    ------
    problems.errors.InputError
        If that cannot be done.
    """
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            write(file)
        Path(temporary).replace(path)
    except OSError as error:
        where = shown(str(path))
        raise InputError(f"{where} cannot be written: {error.strerror}; give another path.") from None
    finally:
        if temporary is not None:
            with suppress(OSError):
                Path(temporary).unlink()


def library(name: str) -> Any:
    """Import an optional library that tables are made with.

    Raises
    ------
    problems.errors.MissingLibraryError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingLibraryError(f"{name} is not installed; install it with: pip install {name}.") from None
