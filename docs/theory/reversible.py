"""The tables of drifts on the page on adaptive steps: ``python docs/theory/reversible.py kepler 0.9 100000``.

Mean energies over 20 parts of a long run, and their slope by least squares with its 95 % interval, beside
ordinary adaptive steps and other libraries. A run that takes more than `SECONDS` of CPU time ends there.
Then the method goes back to t = 0, and the last column says by how much it misses the start.
"""

import argparse
from time import process_time
from typing import Any

import numpy as np

import problems
from integrators import HBVM, IAS15, Gauss, Status, Taylor
from problems import targets

PARTS = 20
STUDENT = 2.1009  # the 97.5 % quantile of Student's distribution with PARTS - 2 degrees of freedom
SAMPLES, PIECE = 4000, 200
SECONDS = 300.0
METHODS = (
    Gauss(s=8, tol=1e-12, steps="reversible"),
    Gauss(s=4, tol=1e-9, steps="reversible"),
    Gauss(s=4, tol=1e-9),
    Gauss(s=8, tol=1e-12),
    HBVM(),
    Taylor(),
    IAS15(),
)


def row(problem: problems.Problem, method: Any, revolutions: int) -> str:
    """Return a line of the table."""
    stepper = method.compile(problem.system).start(problem.y0, problem.par, problem.t0)
    times = np.linspace(0.0, 2.0 * np.pi * revolutions, SAMPLES + 1)[1:]
    states, began = [], process_time()
    for i in range(0, SAMPLES, PIECE):
        made = stepper.advance(times[i : i + PIECE])
        if made.status is not Status.FINISHED:
            return f"| `{method!r}` | {made.reason} | | | | |"
        states.append(made.y)
        if process_time() - began > SECONDS:
            break
    y = np.concatenate(states)
    done, taken = len(y) / SAMPLES * revolutions, stepper.stats.steps
    stepper.step()  # to the end of a step, from which reversible steps are the same backwards
    back = stepper.advance(np.array([problem.t0]))
    miss = f"{np.abs(back.y[-1] - problem.y0).max():.1e}" if back.status is Status.FINISHED else back.reason
    energy = targets.numpy(problem.system, "hamiltonian")(
        0.0, np.column_stack([problem.y0, y.T]), problem.par
    )[0]
    error = (energy[1:] / energy[0] - 1.0).reshape(PARTS, -1)
    at = (np.arange(PARTS) + 0.5) / PARTS * done
    away = at - at.mean()
    means = error.mean(axis=1)
    slope = float(away @ means / (away @ away))
    rest = means - means.mean() - slope * away
    half = STUDENT * float(np.sqrt((rest @ rest) / (PARTS - 2) / (away @ away)))
    moment = float(problem.errors(y)["angular_momentum"].max())
    name, steps = f"`{method!r}`", taken / done
    if done < revolutions:
        name += f" ({done:.0f} revolutions)"
    largest = np.abs(error).max()
    return f"| {name} | {steps:.1f} | {slope:.2e} ± {half:.1e} | {largest:.1e} | {moment:.1e} | {miss} |"


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description="Drifts of the energy.")
    parser.add_argument("problem", choices=["kepler", "sitnikov"])
    parser.add_argument("e", type=float)
    parser.add_argument("revolutions", type=int)
    asked = parser.parse_args()
    print("| method | steps per revolution | drift per revolution | energy | angular momentum | start |")
    print("|:--|--:|--:|--:|--:|--:|")
    for method in METHODS:
        print(row(problems.load(asked.problem, e=asked.e), method, asked.revolutions), flush=True)


if __name__ == "__main__":
    main()
