"""Fields that know nothing outside the interval: there they raise, return no number, or note the call.

``python -m tests.faults.search.past_end 500 3`` tries 500 of them from seed 3.
"""

import math
import sys

import numpy as np

from integrators import BDF, DOP853, HBVM, LSODA, Event, Gauss, Radau, integrate, integrate_many, start
from problems import Opaque, Problem, VectorField

METHODS = (
    HBVM(tol=1e-8), HBVM(), HBVM(max_step=0.7), HBVM(atol=1e-12), HBVM(k=8, s=4, tol=1e-7),
    HBVM(solver="newton"), Gauss(s=5, tol=1e-9), HBVM(k=8, s=4, h=0.3), Gauss(s=6, h=0.17),
    HBVM(k=4, s=2, h=0.11, solver="newton"),
    HBVM(k=6, s=3, h=0.23, solver="blended"), DOP853(rtol=1e-9, atol=1e-9), Radau(rtol=1e-7, atol=1e-7),
    BDF(rtol=1e-6, atol=1e-8), LSODA(rtol=1e-8, atol=1e-8),
)  # fmt: skip
OURS = (HBVM, Gauss)
WAYS = ("plain", "stop", "dense", "steps", "until", "many", "event", "acts", "acts, steps", "acts, many")
TOLERANCE = 1e-3  # of BDF, the worst: 3e-5; fixed steps of Gauss(6): 1e-9


class OutsideError(Exception):
    """What a field raises outside its interval."""


def field_on(t0, end, w, outside, asked):
    """Return an oscillator that is driven by data on the interval [t0, end] only."""
    first, last = min(t0, end), max(t0, end)

    def f(t, y):
        if not first <= t <= last:
            asked.append(t)
            if outside == "raises":
                raise OutsideError(f"no data at {t}")
            if outside == "nan":
                return [math.nan, math.nan]
        return [y[1], -y[0] - 0.1 * y[1] + math.sin(w * t)]

    return f


def reached(problem, method, way, times):
    """Return the status at the end of an interval, and the state there."""
    end = problem.t_end
    if way == "until":
        run = start(problem, method)
        for t in times:
            run.until(t)
        return run.status.value, run.y
    if way == "many":
        many = integrate_many(problem, method, starts=[problem.y0, problem.y0], times=times)
        return many.status[0].value, many.y[0, -1]
    if way.startswith("acts"):
        # An event that changes the state to what it is.
        acting = Event(lambda y: float(y[0]) - 0.1, then=lambda y: [y[0], y[1]], name="level")
        if way.endswith("many"):
            many = integrate_many(
                problem, method, starts=[problem.y0, problem.y0], times=times, events=acting
            )
            return many.status[0].value, many.y[0, -1]
        made = integrate(problem, method, times, "steps" if way.endswith("steps") else None, events=acting)
        return made.status.value, made.y[-1]
    if way == "event":
        made = integrate(problem, method, times, events=Event(lambda y: float(y[0]) - 0.1, name="level"))
        return made.status.value, made.y[-1]
    sample = None if way == "plain" else way
    made = integrate(problem, method, [end] if way == "steps" else times, sample)
    return made.status.value, made.y[-1]


def tried(rng):
    """Return what went wrong with a random field, method and way; empty: nothing."""
    t0, length = float(rng.choice([0.0, -1.0, 3.7, 1000.0])), float(rng.uniform(0.5, 9.0))
    end = t0 + length * rng.choice([1.0, -1.0])
    w, outside = float(rng.uniform(0.5, 5.0)), str(rng.choice(["raises", "nan", "notes"]))
    method, way, asked = METHODS[rng.integers(len(METHODS))], str(rng.choice(WAYS)), []
    if (way in ("dense", "event") or way.startswith("acts")) and not isinstance(method, OURS):
        way = "plain"
    problem = Problem(Opaque(field_on(t0, end, w, outside, asked), dim=2), y0=[0.3, 0.0], t0=t0, t_end=end)
    times = t0 + (end - t0) * np.append(np.sort(rng.uniform(0.02, 0.999, rng.integers(0, 4))), 1.0)
    times[-1] = end
    status, state = reached(problem, method, way, times)
    free = Problem(
        VectorField(lambda t, y, m: [y[1], -y[0] - 0.1 * y[1] + m.sin(w * t)], dim=2),
        y0=[0.3, 0.0], t0=t0, t_end=end,
    )  # fmt: skip
    exact = integrate(free, HBVM(), [end]).y[-1]
    whole_steps = way.endswith("steps") and getattr(method, "h", None) is not None  # which end before
    wrong = not whole_steps and not np.abs(state - exact).max() < TOLERANCE
    if asked or status not in ("finished", "running") or wrong:
        beyond = max((max(min(t0, end) - t, t - max(t0, end)) for t in asked), default=0.0)
        where = f"{method} {way} {outside} [{t0}, {end}]: {status}"
        return f"{where}, asked {len(asked)}, {beyond:.1e} beyond, {state - exact}"
    return ""


if __name__ == "__main__":
    count, seed = (int(argument) for argument in sys.argv[1:])
    made = [tried(np.random.default_rng([seed, i])) for i in range(count)]
    print("\n".join(filter(None, made)))
    print(f"{sum(map(bool, made))} of {count}")
