"""Many trajectories of one problem, each of which is available as a solution."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.caveats import (
    LOOKED_AT,
    expected,
    lost_invariants,
    of_atol,
    of_losses,
    of_tables,
    warnings,
)
from integrators.protocol import Array, MethodBase, Stats, Status, Trajectories
from integrators.solution.exports import library
from integrators.solution.files import (
    check_extra,
    compilation,
    fields,
    occurrences,
    of_type,
    read_file,
    write,
)
from integrators.solution.occurrences import Occurrences
from integrators.solution.plain import (
    doubles,
    packed,
    packed_method,
    packed_problem,
    unpacked,
    unpacked_method,
)
from integrators.solution.record import Solution, States
from integrators.solution.segments import Segments
from problems.analysis import deviations, invariants
from problems.checks import File, checked_arguments, readable
from problems.errors import printable, shown
from problems.problem import Problem

KIND = "ensemble"  # of files


@readable
@dataclass(frozen=True, eq=False, repr=False)
class Solutions(States, Trajectories):
    """Many trajectories of a problem; see `Trajectories` for ``t``, ``y``, ``status`` and the rest.

    ``solutions[i]`` is trajectory i as a `Solution`; iteration is supported. A slice, an array of booleans or
    a list of indices selects some of them: ``solutions[solutions.arrived]``.

    Attributes
    ----------
    t : ndarray, shape (m,) or (n, m)
        Times; one row for each trajectory if they differ, padded with NaN.
    starts : ndarray, shape (n, dim)
        Initial states.
    par : ndarray, shape (n, n_par)
        Parameters, as `System.unpack` takes them.
    compile_seconds : float
        Seconds spent compiling, before the first step.
    from_cache : bool or None
        Whether the compiled code came from a cache; ``None`` where nothing is compiled.
    problem, method
        The problem that was integrated, and the method.
    warnings : list of tuple of str
        Warnings about each trajectory, as `Solution.warnings`.
    events : list of dict of str to Occurrences
        Occurrences of the events in each trajectory, by name; none in an interrupted one. Empty without
        events.
    reduced : dict of str to ndarray
        Results of the reductions of `integrators.reduce`, by name.
    directions : tuple of ndarray, or None
        Initial tangent vectors of each trajectory: components in the state, (n, dim, k), and in the
        parameters, (n, n_par, k), if ``variations`` were requested.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, integrate_many
    >>> pendulum, method = problems.load("pendulum"), Gauss(s=4, h=0.1)
    >>> made = integrate_many(pendulum, method, starts=[[0, 1], [0, 1.5]], times=[5.0])
    >>> made.y.shape, [str(status) for status in made.status]
    ((2, 1, 2), ['finished', 'finished'])
    >>> bool(made[1].errors()["energy"].max() < 1e-9), made.q.shape
    (True, (2, 1, 1))
    """

    starts: Array
    par: Array
    compile_seconds: float
    from_cache: bool | None
    problem: Problem
    method: MethodBase
    events: list[dict[str, Occurrences]] = field(default_factory=list)
    reduced: Mapping[str, Array] = field(default_factory=dict)
    directions: tuple[Array, Array] | None = None

    def __len__(self) -> int:
        return len(self.status)

    def __iter__(self) -> Iterator[Solution]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, which: Any) -> Any:
        """Return a trajectory as a `Solution`, or some of them as `Solutions`.

        Raises
        ------
        IndexError
            For a number that none of them has.
        """
        numbers = np.arange(len(self))[which]
        return self._single(int(numbers)) if np.ndim(numbers) == 0 else self._some(numbers)

    def _single(self, i: int) -> Solution:
        times, system = self._times[i], self.problem.system
        there = np.isfinite(times) & ~np.isnan(self.y[i]).any(axis=1)
        asked = times[np.isfinite(times)]
        parameters: dict[str, Any] = {**system.unpack(self.par[i])}
        t, y = times[there], self.y[i][there]
        if not t.size and self.status[i] is Status.EVENT and self.variations is None:
            t, y = self._at_event(i)
        end = float(asked[-1]) if asked.size and asked[-1] != self.problem.t0 else self.problem.t_end
        return Solution(
            t=t,
            y=y,
            status=self.status[i],
            reason=self.reason[i],
            t_stop=float(self.t_stop[i]),
            stats=Stats(steps=int(self.steps[i]), extra=dict(self.extra.get(i, {}))),
            compile_seconds=self.compile_seconds,
            from_cache=self.from_cache,
            problem=Problem(
                system,
                y0=self.starts[i],
                parameters=parameters,
                t0=self.problem.t0,
                t_end=end,
            ),
            method=self.method,
            events=self.events[i] if self.events else {},
            variations=None if self.variations is None else self.variations[i][there],
            directions=None if self.directions is None else (self.directions[0][i], self.directions[1][i]),
        )

    def _at_event(self, i: int) -> tuple[Array, Array]:
        """Return the time and the state of the terminal event that ended trajectory i, as rows."""
        for hits in self.events[i].values():
            if hits.t[-1:].tolist() == [self.t_stop[i]]:
                return hits.t[-1:], (hits.y if hits.after is None else hits.after)[-1:]
        return np.empty(0), np.empty((0, self.y.shape[2]))

    def _some(self, numbers: NDArray[np.int64]) -> "Solutions":
        chosen = numbers.tolist()
        return Solutions(
            t=self.t if self.t.ndim == 1 else self.t[numbers],
            y=self.y[numbers],
            status=[self.status[i] for i in chosen],
            reason=[self.reason[i] for i in chosen],
            t_stop=self.t_stop[numbers],
            steps=self.steps[numbers],
            starts=self.starts[numbers],
            par=self.par[numbers],
            compile_seconds=self.compile_seconds,
            variations=None if self.variations is None else self.variations[numbers],
            directions=None
            if self.directions is None
            else (self.directions[0][numbers], self.directions[1][numbers]),
            from_cache=self.from_cache,
            problem=self.problem,
            method=self.method,
            events=[self.events[i] for i in chosen] if self.events else [],
            extra={new: self.extra[i] for new, i in enumerate(chosen) if i in self.extra},
        )

    @property
    def _times(self) -> Array:
        return np.broadcast_to(self.t, self.y.shape[:2])

    @property
    def arrived(self) -> Any:
        """Which trajectories reached the last time: a boolean array of length n."""
        return np.array([status is Status.FINISHED for status in self.status])

    @property
    def warnings(self) -> list[tuple[str, ...]]:
        """Warnings about each trajectory, as `integrators.Solution.warnings`."""
        problem = self.problem
        caveat, conserved = self.method.caveat(problem), self.method.conserved(problem.system)
        atol, held = self.method.options(defaults=True).get("atol"), expected(problem.system, conserved)
        acted = any(hits.after is not None for events in self.events for hits in events.values())
        lost = [{}] * len(self) if acted else lost_invariants(  # whose actions may change them
            problem.system, held, self.starts, self._times, self.y, self.par, self.steps
        )  # fmt: skip
        return [
            warnings(problem, start, par, y[-1], caveat, self.extra.get(i, {}))
            + of_atol(problem, atol, start, y)
            + of_losses(losses, conserved)
            + of_tables(problem.system, par, t, y, (problem.t0, start))
            for i, (start, par, t, y, losses) in enumerate(
                zip(self.starts, self.par, self._times, self.y, lost, strict=True)
            )
        ]

    def invariants(self) -> dict[str, Array]:
        """Return the invariants, shape (n, m), or (n, m, k) of a vector, by name."""
        par, _, owner = self._segments()
        system, (n, m, dim) = self.problem.system, self.y.shape
        found = invariants.invariants(system, par[owner].T, self.y.reshape(-1, dim), self._times.reshape(-1))
        return {name: values.reshape(n, m, *values.shape[1:]) for name, values in found.items()}

    def errors(self) -> dict[str, Array]:
        """Return the deviation of each invariant from its initial value, shape (n, m), by name.

        As `problems.Problem.errors`; NaN at times that a trajectory did not reach. After an event that
        changes the state they are relative to the state after it, as in `Solution.errors`.
        """
        par, starts, owner = self._segments()
        states, times = self.y.reshape(-1, self.y.shape[2]), self._times.reshape(-1)
        found = deviations.errors(self.problem.system, par.T, states, times, starts=starts, owner=owner)
        return {name: values.reshape(self.y.shape[:2]) for name, values in found.items()}

    def _segments(self) -> tuple[Array, tuple[Array, Array], NDArray[np.int64]]:
        """Return the segments of all trajectories between events that change the state or the parameters.

        Their parameters, their times and states, and the number of the one that each state belongs to.
        """
        n, m, t0 = len(self), self.y.shape[1], self.problem.t0
        acted = [any(hits.after is not None for hits in events.values()) for events in self.events]
        if not any(acted):
            return self.par, (np.full(n, t0), self.starts), np.repeat(np.arange(n), m)
        segments = [
            Segments.from_events(t0, start, par, events, 1.0 if stop >= t0 else -1.0)
            for start, par, events, stop in zip(self.starts, self.par, self.events, self.t_stop, strict=True)
        ]
        first = np.cumsum([0, *(part.t.size for part in segments[:-1])])
        owner = [
            number + part.places(t, y)
            for number, part, t, y in zip(first, segments, self._times, self.y, strict=True)
        ]
        par, t, y = (np.concatenate([getattr(part, name) for part in segments]) for name in ("par", "t", "y"))
        return par, (t, y), np.concatenate(owner)

    def __repr__(self) -> str:
        return printable(
            f"Solutions({self.problem!s}, {self.method!r}, {len(self)} trajectories, "
            f"{int(self.arrived.sum())} finished)"
        )

    def __str__(self) -> str:
        counts = Counter(map(str, self.status))
        ended = ", ".join(f"{n} {status}" for status, n in counts.most_common())
        stops, m = self.t_stop, self.y.shape[1]
        where = f"t = {stops.max():g}" if np.ptp(stops) == 0.0 else f"t = {stops.min():g} to {stops.max():g}"
        lines = [
            str(self.problem),
            repr(self.method),
            f"{len(self)} trajectories to {where}, {m} {'state' if m == 1 else 'states'} of each: {ended}",
        ]
        failed = [i for i, status in enumerate(self.status) if status.failed]
        if failed:
            i = failed[0]
            lines.append(f"the first that failed, number {i}, at t = {self.t_stop[i]!r}: {self.reason[i]}")
        cached = ", from a cache" if self.from_cache else ""
        low, middle, most = np.percentile(self.steps, [0, 50, 100]).astype(int)
        lines.append(
            f"{self.steps.sum():,} steps ({low} to {most}, half of them up to {middle}); "
            f"compiled in {self.compile_seconds:.2g} s{cached}"
        )
        lines += self._largest()
        if self.events:
            counter = Counter({name: len(hits) for events in self.events for name, hits in events.items()})
            for events in self.events[1:]:
                counter.update(dict.fromkeys(events, 0))
            totals = {
                name: sum(len(events[name]) for events in self.events if name in events) for name in counter
            }
            lines.append("events found: " + ", ".join(f"{name} {n}" for name, n in totals.items()))
        if self.reduced:
            lines.append("reduced: " + ", ".join(f"{k} {np.shape(v)}" for k, v in self.reduced.items()))
        told = [(i, said) for i, said in enumerate(self.warnings) if said]
        if told:
            lines.append(
                f"warnings of {len(told)} trajectories; of the first, number {told[0][0]}: {told[0][1][0]}"
            )
        return printable("\n".join(lines))

    def _largest(self) -> list[str]:
        """Return the largest errors of the invariants at the last states, of some trajectories."""
        some = self[:: -(-len(self) // LOOKED_AT)]
        last = Solutions(**{**vars(some), "t": some._times[:, -1:], "y": some.y[:, -1:]})
        largest = {name: error for name, error in last.errors().items() if not np.isnan(error).all()}
        told = ", ".join(f"{name} {float(np.nanmax(error)):.1e}" for name, error in largest.items())
        where = "" if len(some) == len(self) else f" of {len(some)} of them"
        return [f"largest errors at the end{where}: {told}"] if told else []

    def to_pandas(self) -> Any:
        """Return a ``pandas.DataFrame`` with a row for each trajectory and time that was reached.

        The index is (trajectory, t), the columns are q0, q1 ... p0 ... (or y0 ...).

        Raises
        ------
        problems.errors.MissingLibraryError
            If pandas is not installed.
        """
        pandas = library("pandas")
        there = ~np.isnan(self.y).any(axis=2)
        number = np.broadcast_to(np.arange(len(self))[:, np.newaxis], there.shape)
        index = pandas.MultiIndex.from_arrays([number[there], self._times[there]], names=["trajectory", "t"])
        frame = pandas.DataFrame(self.y[there], index=index, columns=self._columns())
        frame.attrs = self._about()
        return frame

    def to_xarray(self) -> Any:
        """Return an ``xarray.Dataset``: q and p (or y) along ``trajectory``, ``time`` and ``i``.

        Raises
        ------
        problems.errors.MissingLibraryError
            If xarray is not installed.
        """
        xarray = library("xarray")
        parts: dict[str, Any] = {x: (("trajectory", "time", "i"), y) for x, y in self._parts().items()}
        parts["status"] = ("trajectory", [str(status) for status in self.status])
        along = ("time",) if self.t.ndim == 1 else ("trajectory", "time")
        return xarray.Dataset(parts, coords={"t": (along, self.t)}, attrs=self._about())

    @checked_arguments
    def save(self, path: File) -> None:
        """Write the ensemble to a file that `integrators.load` reads: arrays and JSON in NumPy's npz format.

        As `Solution.save`, the file contains traced formulas and no code.

        Raises
        ------
        problems.errors.InputError
            For a method that is not registered, or a file that cannot be written.
        """
        arrays: dict[str, NDArray[Any]] = {name: getattr(self, name) for name in _ARRAYS}
        names = list(dict.fromkeys(name for events in self.events for name in events))
        for name in names:
            found = [events.get(name) for events in self.events]
            lengths = np.array([0 if hits is None else len(hits) for hits in found], dtype=np.int64)
            arrays[f"event_counts:{name}"] = lengths
            known = next(hits for hits in found if hits is not None)
            more = [key for key in ("after", "par") if getattr(known, key) is not None]
            for key in ("t", "y", "direction", *more):
                parts = [getattr(hits, key) for hits in found if hits is not None]
                arrays[f"event_{key}:{name}"] = np.concatenate(parts)
        if self.variations is not None and self.directions is not None:
            arrays["variations"] = self.variations
            arrays["directions_state"], arrays["directions_parameters"] = self.directions
        arrays |= {f"reduced:{name}": np.asarray(values) for name, values in self.reduced.items()}
        words = {
            "kind": KIND,
            "problem": packed_problem(self.problem, arrays),
            "method": packed_method(self.method, arrays),
            "status": list(map(str, self.status)),
            "reason": self.reason,
            "extra": packed({str(i): extra for i, extra in self.extra.items()}, arrays),
            "events": names if self.events else None,
            "reduced": list(self.reduced),
            "compile_seconds": self.compile_seconds,
            "from_cache": self.from_cache,
        }
        write(Path(path), words, arrays)


_ARRAYS = ("t", "y", "starts", "par", "t_stop", "steps")


@checked_arguments
def load(path: File, problem: Problem | None = None) -> Any:
    """Return the `Solution` or `Solutions` that ``save`` wrote to a file, bitwise identical.

    Parameters
    ----------
    path : str or path-like
        The file.
    problem : Problem, optional
        The problem that was integrated, if its field is code, which files do not contain.

    Raises
    ------
    problems.errors.InputError
        For a file that does not exist, is damaged, or is not such a file.

    Examples
    --------
    >>> import tempfile, problems
    >>> from pathlib import Path
    >>> from integrators import Gauss, integrate, load
    >>> path = Path(tempfile.mkdtemp()) / "pendulum.npz"
    >>> integrate(problems.load("pendulum"), Gauss(s=2, h=0.1), [0.0, 1.0]).save(path)
    >>> load(path).method
    Gauss(s=2, h=0.1)
    """
    readers = {None: lambda *of: Solution(**fields(*of)), KIND: _from_file}
    return read_file(path, problem, readers)


def _from_file(words: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], problem: Problem) -> Solutions:
    n, m, dim = np.shape(arrays["y"])
    t = arrays["t"]
    status = [Status(word) for word in words["status"]]
    reasons = [of_type(str, word) for word in words["reason"]]
    if len(status) != n or len(reasons) != n or dim != problem.system.dim:
        raise TypeError("its parts belong to other numbers of trajectories")
    steps = doubles(arrays["steps"], (n,), "steps")
    extra = {int(i): of_type(dict, value) for i, value in unpacked(words["extra"], arrays).items()}
    for values in extra.values():
        check_extra(values)
    return Solutions(
        t=doubles(t, (m,) if np.ndim(t) == 1 else (n, m), "t"),
        y=doubles(arrays["y"], (n, m, dim), "y"),
        status=status,
        reason=reasons,
        t_stop=doubles(arrays["t_stop"], (n,), "t_stop"),
        steps=steps.astype(np.int64),
        starts=doubles(arrays["starts"], (n, dim), "starts"),
        par=doubles(arrays["par"], (n, problem.system.n_par), "par"),
        **compilation(words),
        problem=problem,
        method=unpacked_method(words["method"], arrays),
        events=[] if words["events"] is None else _events(words["events"], arrays, n, problem),
        reduced={name: _numbers(arrays[f"reduced:{of_type(str, name)}"]) for name in words["reduced"]},
        extra=extra,
        **_variations(arrays, (n, m, dim, problem.system.n_par)),
    )


def _variations(arrays: Mapping[str, NDArray[Any]], shape: tuple[int, int, int, int]) -> dict[str, Any]:
    """Return tangent vectors at the times and at the starts, which a file has both or none of."""
    if "variations" not in arrays:
        return {}
    n, m, dim, n_par = shape
    vectors, state = arrays["variations"], arrays["directions_state"]
    k = vectors.shape[-1]
    parameters = doubles(arrays["directions_parameters"], (n, n_par, k), "directions_parameters")
    return {
        "variations": doubles(vectors, (n, m, dim, k), "variations"),
        "directions": (doubles(state, (n, dim, k), "directions_state"), parameters),
    }


def _numbers(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind not in "fiu":
        raise TypeError("a reduction is no array of numbers")
    return values


def _events(
    names: list[str], arrays: Mapping[str, NDArray[Any]], n: int, problem: Problem
) -> list[dict[str, Occurrences]]:
    events: list[dict[str, Occurrences]] = [{} for _ in range(n)]
    for name in names:
        counts = arrays[f"event_counts:{name}"]
        if counts.dtype.kind != "i" or counts.shape != (n,) or counts.min(initial=0) < 0:
            raise TypeError(f"the counts of {shown(name)} are not as many as the trajectories")
        whole = occurrences(name, arrays, problem)
        if counts.sum() != len(whole):
            raise TypeError(f"the times of {shown(name)} are not as many as its counts")
        ends = np.cumsum(counts)
        for i, (low, high) in enumerate(zip(ends - counts, ends, strict=True)):
            changed = (None if rows is None else rows[low:high] for rows in (whole.after, whole.par))
            events[i][name] = Occurrences(
                whole.t[low:high], whole.y[low:high], whole.direction[low:high], *changed
            )
    return events
