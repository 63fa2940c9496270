"""How the scripts beside this one time a computation, and how they compare ours with another library."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import inf, isnan
from statistics import median
from time import perf_counter
from typing import TypeVar

T = TypeVar("T")

CALLS, SECONDS = 7, 0.5  # further calls that are timed, and the time after which no more follow


def timed(compute: Callable[[], T], calls: int = CALLS) -> tuple[T, float, float]:
    """Return the result, the seconds of the first call, which compiles, and the median of further ones.

    heyoka's integrator is made anew by every call; whoever keeps one saves that time, which is left out.
    """
    began = perf_counter()
    result = compute()
    first = perf_counter() - began
    warm: list[float] = []
    while len(warm) < calls and sum(warm) < SECONDS:
        began = perf_counter()
        result = compute()
        warm.append(perf_counter() - began - getattr(result, "compile_seconds", 0.0))
    return result, first, median(warm or [first])


def settings(run: Callable[..., T], *methods: object) -> dict[str, Callable[[], T]]:
    """Return the settings that `Comparison.add` tries: methods, by how they print."""
    return {repr(method): partial(run, method) for method in methods}


def tolerances(run: Callable[[float], T], *values: float, name: str = "tol") -> dict[str, Callable[[], T]]:
    """Return the settings that `Comparison.add` tries: values of a tolerance, or of a step size."""
    return {f"{name}={value:g}": partial(run, value) for value in values}


def clocked(name: str, compute: Callable[[], T]) -> T:
    """Compute twice, print the times of both, and return the result."""
    result, first, warm = timed(compute, calls=1)
    print(f"{name}: {1e3 * warm:.2f} ms, the first call {first:.2f} s")
    return result


@dataclass(frozen=True)
class Row:
    """A method on a task, at the chosen setting: seconds of the first call and of a further one, errors.

    Times are ``None`` where other work disturbed them. ``tried`` is the number of its settings; ``energy`` is
    the largest relative error of the energy, ``None`` where nothing is conserved; ``error`` is that of what
    the task asks for.
    """

    library: str
    setting: str
    tried: int
    first: float | None
    seconds: float | None
    energy: float | None
    error: float


@dataclass
class Comparison:
    """A task as several libraries do it.

    Attributes
    ----------
    task : str
        What is computed.
    error : str
        What the error is of, with its unit.
    asked : float
        The largest error that is accepted.
    rows : list of Row
        Those of this package first.
    """

    task: str
    error: str
    asked: float
    rows: list[Row] = field(default_factory=list)

    def add(
        self,
        library: str,
        settings: Mapping[str, Callable[[], T]],
        error: Callable[[T], float],
        energy: Callable[[T], float] | None = None,
    ) -> None:
        """Try the settings of a method, and add the fastest whose error is accepted.

        Where no setting is accurate enough, it is the most accurate one.
        """
        trials = []
        for setting, compute in settings.items():
            result, first, seconds = timed(compute, calls=1)
            off = float(error(result))
            off = inf if isnan(off) else off
            accepted = off <= self.asked
            trials.append((not accepted, seconds if accepted else off, setting, first, off, result))
        _, _, setting, first, off, result = min(trials, key=lambda trial: trial[:2])
        _, _, seconds = timed(settings[setting])
        conserved = None if energy is None else float(energy(result))
        self.rows.append(Row(library, setting, len(settings), first, seconds, conserved, off))

    @property
    def accurate(self) -> list[Row]:
        """The rows whose error is accepted, the fastest first."""
        return sorted(
            (row for row in self.rows if row.error <= self.asked), key=lambda row: row.seconds or 0.0
        )

    def verdict(self) -> str:
        """Say which of those that are accurate enough is the fastest, and by how much."""
        if not self.accurate:
            return "none is accurate enough"
        if any(row.seconds is None for row in self.accurate):
            return "Not timed; accurate enough: " + ", ".join(row.library for row in self.accurate)
        first, *others = self.accurate
        if not others:
            return f"only {first.library} is accurate enough"
        ratios = [row.seconds / first.seconds for row in others]
        said = (
            f"{row.library} takes {ratio:.{1 if ratio < 10 else 0}f} times as long"
            for row, ratio in zip(others, ratios, strict=True)
        )
        return f"{first.library} is the fastest; " + ", ".join(said)

    def __str__(self) -> str:
        names = [f"{row.library}, {row.setting}" for row in self.rows]
        width = max(map(len, names))
        lines = [f"{self.task}. Error: {self.error}, at most {self.asked:g}"]
        lines.append(f"{'':{width}}      time  first call   energy    error")
        for name, row in zip(names, self.rows, strict=True):
            energy = "       –" if row.energy is None else f"{row.energy:8.1e}"
            times = f"{1e3 * row.seconds:6.4g} ms {row.first:9.2f} s"
            lines.append(f"{name:{width}} {times} {energy} {row.error:8.1e}")
        lines.append("accurate: " + ", ".join(row.library for row in self.rows if row in self.accurate))
        return "\n".join([*lines, f"verdict: {self.verdict()}"])
