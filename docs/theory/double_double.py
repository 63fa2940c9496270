"""The table of speeds on the page on round-off: ``python docs/theory/double_double.py``.

Gauss in double-double arithmetic, heyoka's Taylor method in 128 bits and Gauss in doubles take turns, the
first two at settings that make them about as accurate. Errors are differences from heyoka
with a tighter tolerance.
"""

from statistics import median
from time import process_time
from typing import Any

import mpmath
import numpy as np

import problems
from hbvm_bench.reference import solutions
from integrators import Gauss

ROUNDS = 7
TOLERANCE, TIGHT = "1e-30", "1e-33"
CASES = (
    ("kepler", {"e": 0.6}, 16, 1 / 16, 20.0),
    ("pendulum", {}, 16, 1 / 8, 20.0),
    ("henon_heiles", {}, 16, 1 / 8, 20.0),
    ("figure_eight", {}, 16, 1 / 32, 5.0),
)


def seconds(work: Any, *arguments: Any) -> float:
    """Return the CPU time of a call."""
    began = process_time()
    work(*arguments)
    return process_time() - began


def numbers(rows: Any) -> Any:
    """Return rows of texts, or of numbers, as numbers of mpmath."""
    return np.array([mpmath.mpf(str(value)) for value in rows])


def row(name: str, options: dict[str, Any], s: int, h: float, end: float) -> str:
    """Return a line of the table."""
    problem = problems.load(name, **options)
    programs = [
        Gauss(s=s, h=h, precision=precision).compile(problem.system)
        for precision in ("double-double", "double")
    ]
    steppers, integrator = [], None
    times: list[list[float]] = [[], [], []]
    for _ in range(ROUNDS):
        steppers = [program.start(problem.y0, problem.par, problem.t0) for program in programs]
        integrator, real = solutions.taylor_integrator(problem, TOLERANCE)
        times[0].append(seconds(steppers[0].advance, np.array([end])))
        times[1].append(seconds(integrator.propagate_until, real(end)))
        times[2].append(seconds(steppers[1].advance, np.array([end])))
    exact = numbers(solutions.taylor(problem, np.array([problem.t0, end]), TIGHT)[-1])
    high, low = steppers[0].y.tolist(), steppers[0].low[0].tolist()
    found = np.array([mpmath.mpf(a) + b for a, b in zip(high, low, strict=True)])
    errors = [max(abs(each - exact)) for each in (found, numbers(integrator.state))]
    mine, *others = (median(values) for values in times)
    ratios = [mine / other for other in others]
    told = " | ".join(mpmath.nstr(error, 2) for error in errors)
    return f"| {problem!r} | {s}, {h:g} | {told} | {ratios[0]:.2f} | {ratios[1]:.0f} |"


def main() -> None:
    """Print the table."""
    print("| problem | s, h | error | error of heyoka | time relative to heyoka | ... to Gauss in doubles |")
    print("|:--|:--|--:|--:|--:|--:|")
    with mpmath.workdps(50):
        for case in CASES:
            print(row(*case), flush=True)


if __name__ == "__main__":
    main()
