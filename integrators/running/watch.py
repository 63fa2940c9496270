"""Progress, checkpoint files and Ctrl-C of long integrations."""

import hashlib
import io
import json
import os
import pickle
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from integrators.protocol import Array, MethodBase, Stats
from integrators.solution.files import write_whole
from problems import targets
from problems.errors import InputError, shown
from problems.problem import Problem
from problems.systems.code_digest import code_digest

MAGIC, VERSION = b"hbvm-bench checkpoint ", 2
SOON = 0.1  # seconds from one look to the next, about


@dataclass(frozen=True)
class Progress:
    """Progress of an integration.

    Attributes
    ----------
    t : float
        The time reached.
    fraction : float
        Completed fraction, from 0 to 1.
    steps : int
        Steps so far.
    seconds, left : float
        Seconds since the start or the resumption, and the estimated remaining seconds; infinite as long as
        there is no estimate.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, integrate
    >>> said = []
    >>> made = integrate(problems.load("pendulum"), Gauss(s=4, h=0.1), [10.0], progress=said.append)
    >>> said[-1].fraction, said[-1].steps
    (1.0, 100)
    """

    t: float
    fraction: float
    steps: int
    seconds: float
    left: float

    def __str__(self) -> str:
        """Return one line, such as ``t = 12.5, 25%, 1,024 steps, 3 s, 9 s left``."""
        left = f"{self.left:.2g} s left" if isfinite(self.left) else "time left unknown"
        return f"t = {self.t:.6g}, {self.fraction:.0%}, {self.steps:,} steps, {self.seconds:.2g} s, {left}"


Report = Callable[[Progress], object]


class Watch:
    """Looks at an integration between its pieces.

    Parameters
    ----------
    t0, end : float
        The way.
    report : callable or None
        Called with a `Progress`.
    path : Path or None
        Where to keep what the continuation depends on.
    every : float
        Seconds from one file to the next.
    identity : mapping
        What is integrated, and how, as `identity` returns it.
    """

    def __init__(
        self, t0: float, end: float, report: Report | None, path: Path | None, every: float,
        identity: Mapping[str, str],
    ):  # fmt: skip
        self._t0, self._end = t0, end
        self._report, self._path, self._every, self._identity = report, path, every, identity
        self._began = self._written = perf_counter()
        self._first: float | None = None
        self._kept: dict[str, Any] | None = None
        self.failure = ""
        """Why the file could not be written, when that was tried last."""
        self.looks = report is not None or path is not None
        """Whether anybody wants to know of the way between two samples."""

    @property
    def keeps(self) -> bool:
        """Whether there is a file to write."""
        return self._path is not None

    @property
    def due(self) -> bool:
        """Whether it is time to write the file."""
        return self.keeps and perf_counter() - self._written >= self._every

    def keep(self, kept: dict[str, Any]) -> None:
        """Take note of what the continuation depends on, and write the file if it is time."""
        self._kept = kept
        if self.due:
            self.write()

    def look(self, t: float, steps: int) -> None:
        """Report that the integration is at ``t`` after so many steps."""
        if self._report is not None:
            now = perf_counter()
            way = (t - self._t0) / (self._end - self._t0) if self._end != self._t0 else 1.0
            fraction = min(max(way, 0.0), 1.0)
            self._first = fraction if self._first is None else self._first
            seconds, progress = now - self._began, fraction - self._first
            left = seconds * (1.0 - fraction) / progress if progress > 0.0 else float("inf")
            self._report(Progress(t, fraction, steps, seconds, left))

    def write(self) -> None:
        """Write the file now, if there is one and anything to keep; note where that cannot be done."""
        if self._path is None or self._kept is None:
            return
        kept = pickle.dumps(self._kept, protocol=5)
        head = json.dumps(self._identity).encode()
        parts = [MAGIC + str(VERSION).encode(), head, hashlib.sha256(kept).hexdigest().encode(), kept]
        try:
            write_whole(self._path, lambda file: file.write(b"\n".join(parts)))
            self.failure = ""
        except InputError as error:  # a full disk: the solution is worth more than its checkpoint
            self.failure = f"the last checkpoint is not of the end: {error}"
        self._written = perf_counter()


def identity(
    problem: Problem,
    method: MethodBase,
    times: Array,
    sample: str | None,
    events: Mapping[str, Any],
    variations: Any = None,
    begin: Any = None,
) -> dict[str, str]:
    """Return what a checkpoint belongs to, by name, as texts."""
    start = np.concatenate([[problem.t0], problem.y0 if begin is None else begin.ravel()])
    return {
        "problem": problem.written(),
        "system": targets.fingerprint(problem.system),
        "start": hashlib.sha256(start.tobytes()).hexdigest(),
        "parameters": hashlib.sha256(problem.par.tobytes()).hexdigest(),
        "method": repr(method),
        "times": f"{times.size} times, {hashlib.sha256(times.tobytes()).hexdigest()}",
        "sample": str(sample),
        "events": ", ".join(
            f"{name} {code_digest(event.g, event.direction, str(event.last))}"
            + ("" if event.then is None else f" {code_digest(event.then, 0, 'then')}")
            for name, event in events.items()
        ),
    } | ({} if variations is None else {"variations": _digest(variations)})


def _digest(variations: Any) -> str:
    """Return a text that tells tangent vectors, or names, from others."""
    array = np.asarray(variations)
    return f"{array.shape}, {hashlib.sha256(array.tobytes()).hexdigest()}"


def check_progress(progress: Any) -> None:
    """Refuse what is no way of showing progress.

    Raises
    ------
    problems.errors.InputError
        If it is none.
    """
    if not callable(progress) and not isinstance(progress, bool):
        raise InputError(f"progress={shown(progress)} must be True, False or a function of the progress.")


def files(checkpoint: Any, resume: Any, belongs: Mapping[str, str]) -> tuple[Path | None, Any]:
    """Return the path of the file to be written, and what the file to resume holds.

    ``None`` where there is none; with the same path for both, a first integration begins at the start.
    """
    path = None if checkpoint is None else Path(checkpoint)
    earlier = None if resume is None else Path(resume)
    if earlier is None or (earlier == path and not earlier.exists()):
        return path, None
    return path, read(earlier, belongs)


def read(path: str | os.PathLike[str], wanted: Mapping[str, str]) -> dict[str, Any]:
    """Return what was kept of the same integration.

    Raises
    ------
    problems.errors.InputError
        If there is no such file, it is damaged, or it is another integration's.
    """
    where = shown(str(path))
    try:
        magic, head, digest, kept = Path(path).read_bytes().split(b"\n", 3)
        whole = magic.startswith(MAGIC) and hashlib.sha256(kept).hexdigest().encode() == digest
        stored, version = (json.loads(head), int(magic.removeprefix(MAGIC))) if whole else ({}, 0)
    except FileNotFoundError:
        raise InputError(f"there is no checkpoint {where} to resume; leave out resume=.") from None
    except (OSError, ValueError):
        whole, stored, kept, version = False, {}, b"", 0
    if not whole:
        raise InputError(f"{where} is not a checkpoint of integrate, or is damaged; leave out resume=.")
    if version not in READERS:
        raise InputError(
            f"{where} is a checkpoint of format {version}, and this version reads "
            f"{' and '.join(map(str, READERS))}; resume it with the version that wrote it."
        )
    for key, value in wanted.items():
        if stored.get(key) != value:
            other = f"{stored.get('method')} on {stored.get('problem')}"
            raise InputError(
                f"{where} is a checkpoint of {other}, with other {key} than here ({shown(value)}); "
                "resume that integration, or leave out resume=."
            )
    return READERS[version](_Unpickler(io.BytesIO(kept)).load())


class _Unpickler(pickle.Unpickler):
    """Finds the class of a checkpoint of format 1, whose module has moved."""

    def find_class(self, module: str, name: str) -> Any:
        moved = "integrators.running.checkpoints" if module == "integrators.checkpoints" else module
        return super().find_class(moved, name)


READERS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {
    1: lambda kept: kept["way"],
    VERSION: lambda kept: kept,
}
"""What is kept, from a file of this format or the last one."""


def both(before: Stats, now: Stats) -> Stats:
    """Return the counters of all the work, that before a break and that since."""
    total = now.copy()
    if not before.steps:
        return total
    for name in ("steps", "rejections", "evaluations", "iterations"):
        counts = [count for count in (getattr(now, name), getattr(before, name)) if count is not None]
        setattr(total, name, sum(counts) if counts else None)
    names = [name for solver in (before.solver, now.solver) if solver for name in solver.split(", ")]
    total.solver = ", ".join(dict.fromkeys(names)) or None
    total.extra = _with_those_before(now.extra, before.extra)
    return total


_SETTINGS = ("k", "s")  # whole numbers in ``Stats.extra`` that count nothing


def _with_those_before(now: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is told of an integration beside its counters, with what was told before a break."""
    joined = {**before, **now}
    for key in before.keys() & now.keys():
        match before[key], now[key]:
            case dict() as first, dict() as second:
                joined[key] = _with_those_before(second, first)
            case bool(), _:
                pass
            case (int() | float()) as first, (int() | float()) as second if key not in _SETTINGS:
                joined[key] = first + second
            case list() as first, list() as second if key == "kinks":
                known = second[: len(first)] == first  # a stepper that was restored knows them
                joined[key] = second if known else first + second
            case _:
                pass
    return joined


class Bar:
    """A bar of progress on a terminal; nothing where there is none."""

    def __enter__(self) -> Report:
        rich = import_module("rich.progress")
        console = import_module("rich.console").Console(file=sys.stderr)
        columns = ["t = {task.fields[t]:.6g}", rich.BarColumn(), rich.TaskProgressColumn()]
        columns += ["{task.fields[steps]:,} steps", rich.TimeElapsedColumn(), rich.TimeRemainingColumn()]
        self._bar = rich.Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task("", total=1.0, t=0.0, steps=0)
        self._bar.start()
        return self._show

    def _show(self, progress: Progress) -> None:
        self._bar.update(self._task, completed=progress.fraction, t=progress.t, steps=progress.steps)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
