"""A campaign: how accurate is DOP853 after a hundred revolutions of Kepler's problem, by its tolerance?

A campaign also has processes with limits, results that are stored, timings in turn and a report, for which a
loop of one's own has no code here. own_campaign.py has a problem of one's own.
"""

import contextlib
import io
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import Comparison

import problems
from hbvm_bench import cli
from hbvm_bench.measure import reading
from hbvm_bench.store.store import Store
from problems.catalogue.kepler import solution

TOLERANCES = (1e-6, 1e-8, 1e-10)
CAMPAIGN = """
name = "tolerances"
title = "Which tolerance?"
timing = { rounds = 1 }
[[problems]]
use = "kepler()"
[[methods]]
use = "DOP853(rtol={tol}, atol={tol})"
sweep = { tol = [1e-6, 1e-8, 1e-10] }
"""


def by_campaign() -> np.ndarray:
    """Return the position errors of `hbvm-bench run tolerances.toml --report report`."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        run, file = Path(folder) / "run", Path(folder) / "tolerances.toml"
        file.write_text(CAMPAIGN)
        cli.main(["run", str(file), "--out", str(run), "--report", str(Path(folder) / "report")])
        found = [record.result.metrics["position_end"].value for record in reading.records(Store(run))]
    return np.sort(found)[::-1]


def gravity(t: float, y: np.ndarray) -> list[float]:
    """Return the derivative, by hand."""
    cube = (y[0] ** 2 + y[1] ** 2) ** 1.5
    return [y[2], y[3], -y[0] / cube, -y[1] / cube]


def by_loop(true: np.ndarray | None = None) -> np.ndarray:
    """Return the same by a loop around SciPy; where the truth is not given, a run at 1e-13 stands for it."""
    problem = problems.load("kepler")

    def end(tol: float) -> np.ndarray:
        return solve_ivp(gravity, (0.0, problem.t_end), problem.y0, "DOP853", rtol=tol, atol=tol).y[:2, -1]

    true = end(1e-13) if true is None else true
    return np.array([np.linalg.norm(end(tol) - true) for tol in TOLERANCES]) / np.linalg.norm(true)


def compare() -> Comparison:
    """Compare how well both know the error of each run."""
    problem = problems.load("kepler")
    known = by_loop(solution(problem, [problem.t_end])[0, :2])

    def error(found: np.ndarray) -> float:
        return np.abs(found / known - 1.0).max()

    made = Comparison("A campaign: DOP853 at three tolerances", "the errors that it finds, relative", 0.1)
    made.add("hbvm-bench run", {"three tolerances": by_campaign}, error)
    made.add("a loop around SciPy", {"three tolerances": by_loop}, error)
    return made


if __name__ == "__main__":
    print(compare())
