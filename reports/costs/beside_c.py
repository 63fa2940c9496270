"""Gauss(8) on Kepler's problem beside the same algorithm in C, compiled by the system's compiler.

A compiler is never required: where there is none, the block says so. `gauss8.c` has the steps; its tables
and the numbers of its stopping rule are the kernel's own, so that iterations and errors can be compared.
"""

import ctypes
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import problems
from integrators import Gauss, integrate
from integrators.protocol import Status
from problems import Problem
from problems.catalogue import kepler
from problems.errors import InputError

from .experiments import Times, taken_on_a_core

SOURCE = Path(__file__).with_name("gauss8.c")
FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-shared", "-fPIC")
STEP = 0.1
OURS, IN_C = "Gauss(s=8, h=0.1)", "the same in C"
ECCENTRICITY = 0.6
LIMIT = 120.0  # seconds that the compiler may take
WARNED = "no C compiler"

TABLES = (
    "nodes", "nodes_low", "weights", "weights_low", "position_weights", "position_weights_low",
    "matrix", "extrapolation", "extrapolation_two",
)  # fmt: skip
"""The arrays of ``Tables`` in `SOURCE`, in order."""


def _rule() -> tuple[float, ...]:
    """Return the numbers of ``Rule`` there, in order."""
    from integrators.kernel.step import rule, stopping  # imports numba

    return (
        rule.TOLERANCE, rule.ROUNDING, rule.STAGNATION, rule.LEAST, rule.FLOOR, rule.FIRST_RATE,
        rule.LOG_RESIDUAL, stopping.LOG_TRUSTED, stopping.LOG_FAST_RATE, stopping.LOG_NEGLIGIBLE,
        stopping.LOG_TOTAL_DECREASE,
        stopping.FASTEST, stopping.SLOWEST, stopping.MOST_EXTRA,
    )  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What an integration has cost and how accurate it is.

    Attributes
    ----------
    steps, iterations : int
    energy, position : float
        Errors at the end: of the energy relative to its value, and of the position by its largest
        component, beside the exact solution.
    """

    steps: int
    iterations: int
    energy: float
    position: float


@dataclass(frozen=True)
class BesideC:
    """Seconds a step of both, interleaved, and their outcomes; none where there is no C compiler.

    Attributes
    ----------
    compiler : str
        What the compiler says of its version, and its flags; or why there is none.
    outcomes : dict of Outcome
        By `OURS` and `IN_C`; empty without a compiler.
    times : Times or None
    """

    compiler: str
    outcomes: dict[str, Outcome]
    times: Times | None


def compiler() -> list[str]:
    """Return the command of the system's C compiler, ``$CC`` or ``cc``; empty where there is none."""
    command = shlex.split(os.environ.get("CC", "")) or ["cc"]
    return command if shutil.which(command[0]) else []


def compiled(folder: Path) -> tuple[Any, str]:
    """Compile `SOURCE` into a folder; return the function and the compiler's version, or None and why."""
    command = compiler()
    if not command:
        return None, WARNED
    library = folder / "gauss8.so"
    try:
        said = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=LIMIT)
        made = subprocess.run(
            [*command, *FLAGS, "-o", str(library), str(SOURCE), "-lm"],
            capture_output=True, text=True, timeout=LIMIT,
        )  # fmt: skip
        if made.returncode:
            first = (made.stderr.strip().splitlines() or ["it said nothing"])[0]
            return None, f"{WARNED} that compiles {SOURCE.name}: {' '.join(command)}: {first}"
        function = ctypes.CDLL(str(library)).gauss8
    except (OSError, subprocess.TimeoutExpired) as failure:
        return None, f"{WARNED} that works: {' '.join(command)}: {failure}"
    function.restype = ctypes.c_int64
    function.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double, ctypes.c_int64] + [
        ctypes.c_void_p
    ] * 2
    version = (said.stdout.strip().splitlines() or ["a compiler without a version"])[0]
    return function, f"{version}; {' '.join(FLAGS[:4])}"


class InC:
    """The C function on a problem; `run` integrates from its start."""

    def __init__(self, function: Any, problem: Problem):
        from integrators.kernel.plan import Plan
        from integrators.kernel.program import HBVMProgram

        self._function, self._problem = function, problem
        made = HBVMProgram(problem.system, Plan(k=8, s=8, h=STEP)).start(problem.y0, problem.par)
        tables = made._context.tables
        self._tables = np.concatenate([np.asarray(getattr(tables, name), float) for name in TABLES])
        self._rule = np.array(_rule())

    def run(self, steps: int) -> tuple[np.ndarray, int]:
        """Return the state after so many steps, and the iterations."""
        y, error = self._problem.y0.astype(float), np.zeros(4)
        iterations = self._function(
            self._tables.ctypes.data, self._rule.ctypes.data, STEP, steps, y.ctypes.data, error.ctypes.data
        )
        if iterations < 0:
            raise InputError("the steps in C did not converge.")
        return y, iterations


def beside_c(steps: int, rounds: int) -> BesideC:
    """Compare the kernel's steps on Kepler's problem with the same in C, by time, iterations and errors."""
    problem = problems.load("kepler", e=ECCENTRICITY, t_end=steps * STEP)
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-", ignore_cleanup_errors=True) as folder:
        function, said = compiled(Path(folder))
        if function is None:
            return BesideC(said, {}, None)
        in_c = InC(function, problem)
        ours = integrate(problem, Gauss(s=8, h=STEP), [problem.t_end])
        if ours.status is not Status.FINISHED or ours.stats.steps != steps:
            raise InputError(f"{OURS} ended as {ours.status.value} after {ours.stats.steps} steps.")
        y, iterations = in_c.run(steps)
        outcomes = {
            OURS: _outcome(problem, ours.y[-1], steps, ours.stats.iterations or 0),
            IN_C: _outcome(problem, y, steps, iterations),
        }
        samples: dict[str, Callable[[], float]] = {
            OURS: partial(_seconds, lambda: integrate(problem, Gauss(s=8, h=STEP), [problem.t_end]), steps),
            IN_C: partial(_seconds, partial(in_c.run, steps), steps),
        }
        return BesideC(said, outcomes, taken_on_a_core(samples, rounds))


def _seconds(run: Callable[[], Any], steps: int) -> float:
    begun = perf_counter()
    run()
    return (perf_counter() - begun) / steps


def _outcome(problem: Problem, y: np.ndarray, steps: int, iterations: int) -> Outcome:
    exact = kepler.solution(problem, np.array([problem.t_end]))[0]
    energy = float(np.max(problem.errors(y[None])["energy"]))
    return Outcome(steps, iterations, energy, float(np.abs(y - exact)[:2].max()))
