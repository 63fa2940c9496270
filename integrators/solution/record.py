"""The solution of an initial value problem: samples, statistics and warnings."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
from integrators.protocol import Array, MethodBase, Stats, Status
from integrators.solution.exports import as_mpmath, library
from integrators.solution.files import AS_THEY_ARE, write
from integrators.solution.interpolation import Interpolant
from integrators.solution.occurrences import Occurrences
from integrators.solution.plain import packed, packed_method, packed_problem
from integrators.solution.segments import Segments
from problems.analysis import deviations, invariants
from problems.bodies import Elements, elements
from problems.checks import File, checked_arguments, readable
from problems.double_double import DD
from problems.errors import InputError, printable
from problems.problem import Problem
from problems.quantities import plain_numbers


class States:
    """What one trajectory and many have in common: ``y``, whose last axis is that of the components."""

    y: Array
    problem: Problem
    method: MethodBase

    @property
    def q(self) -> Array | None:
        """Positions (..., dof), a view of ``y``; ``None`` for systems that have no positions and momenta."""
        dof = self.problem.system.dof
        return None if dof is None else self.y[..., :dof]

    @property
    def p(self) -> Array | None:
        """Momenta (..., dof), a view of ``y``; ``None`` as for ``q``."""
        dof = self.problem.system.dof
        return None if dof is None else self.y[..., dof:]

    def _parts(self) -> dict[str, Array]:
        return {"y": self.y} if self.q is None or self.p is None else {"q": self.q, "p": self.p}

    def _columns(self) -> list[str]:
        return [f"{x}{i}" for x, part in self._parts().items() for i in range(part.shape[-1])]

    def _about(self) -> dict[str, str]:
        return {"problem": repr(self.problem), "method": repr(self.method)}


@readable
@dataclass(frozen=True, eq=False, repr=False)
class Solution(States):
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
        return self._interpolant(plain_numbers("t", t))[..., : self.problem.system.dim]

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
        rows = self._interpolant(plain_numbers("t", t))[..., self.problem.system.dim :]
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
        rows = self._interpolant(plain_numbers("t", t))
        return np.stack(np.split(rows, 2, axis=-1), axis=-1)

    def _check_digits(self) -> None:
        if self.low is None:
            raise InputError(
                "the solution has doubles only; integrate with Gauss(s=, h=, precision='double-double')."
            )

    @cached_property
    def _interpolant(self) -> Interpolant:
        problem, end = self.problem, self.t_stop
        before = slice(None if self.t.size == 0 or self.t[0] != problem.t0 else 0)  # the start is no sample
        t, rows = [np.array([problem.t0])[before], self.t], [[problem.y0[np.newaxis][before], self.y]]
        if self.directions is not None and self.variations is not None:
            vectors = [self.directions[0][np.newaxis][before], self.variations]
            rows.append([part.reshape(len(part), self.directions[0].size) for part in vectors])
        if self.low is not None and self.start is not None:
            rows.append([self.start[np.newaxis, :, 1][before], self.low])
        last = float(np.concatenate(t)[-1])
        if self.status.failed or (end - last) * (last - problem.t0) < 0.0:
            end = last  # else a terminal event may lie after the last sample
        return Interpolant.from_samples(
            problem, self.method, np.concatenate(t), np.hstack([np.concatenate(parts) for parts in rows]),
            end, self._segments, tangent=None if self.directions is None else self.directions[1],
            pairs=self.low is not None,
        )  # fmt: skip

    @property
    def _acted(self) -> bool:
        """Whether an event has changed the state or the parameters."""
        return any(happened.after is not None and happened.t.size for happened in self.events.values())

    @property
    def _segments(self) -> Segments:
        """The segments between events that change the state or the parameters."""
        problem, sign = self.problem, 1.0 if self.t_stop >= self.problem.t0 else -1.0
        return Segments.from_events(problem.t0, problem.y0, problem.par, self.events, sign)

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != "_interpolant"}

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
        frame = pandas.DataFrame(self.y, index=pandas.Index(self.t, name="t"), columns=self._columns())
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

    def _about(self) -> dict[str, str]:
        return {**super()._about(), "status": str(self.status)}

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
            "problem": packed_problem(self.problem, arrays),
            "method": packed_method(self.method, arrays),
            "stats": packed(asdict(self.stats), arrays),
            "events": list(self.events),
            "status": str(self.status),
            "error": None if self.error is None else [type(self.error).__name__, str(self.error)],
        }
        write(Path(path), words | {key: getattr(self, key) for key in AS_THEY_ARE}, arrays)


if TYPE_CHECKING:
    solution_of = Solution
else:

    def solution_of(**fields: Any) -> Solution:
        """Return ``Solution(**fields)``, given all of them; a frozen class sets each by a call."""
        solution = object.__new__(Solution)
        vars(solution).update(fields)
        return solution
