"""An oscillator that starts at a late time: it is right, by SciPy to the spacing of doubles, or refused.

``python -m tests.faults.search.late_times 500 3`` tries 500 of them from seed 3.
"""

import math
import sys

import numpy as np

from integrators import DOP853, HBVM, Gauss, Radau, integrate, integrate_many, start
from problems import InputError, Problem, VectorField

METHODS = (
    HBVM(), HBVM(tol=1e-10), HBVM(k=8, s=4, h=0.11), Gauss(s=6, h=0.17), Gauss(s=5, tol=1e-12),
    HBVM(solver="newton"), DOP853(rtol=1e-12, atol=1e-12), Radau(rtol=1e-10, atol=1e-10),
)  # fmt: skip
WAYS = ("plain", "steps", "stop", "until", "many")
OSCILLATOR = VectorField(lambda y: [y[1], -y[0]], dim=2)
TOLERANCE = 1e-10  # 4.5e-12 measured, of DOP853
SPACINGS = 1.0  # of the doubles, where the library's own time is one
COARSEST = 2.0**-26  # a spacing relative to the interval that is refused


def state(problem, method, way):
    """Return the state at the end of a problem's interval, or say why there is none."""
    if way == "until":
        run = start(problem, method)
        y = run.until(problem.t_end)
        return y if run.t == problem.t_end else run.reason
    if way == "many":
        many = integrate_many(problem, method, starts=[problem.y0, problem.y0])
        return many.y[0, -1] if many.t[-1] == problem.t_end else many.reason[0]
    made = integrate(problem, method, [problem.t_end], sample=None if way == "plain" else way)
    return made.y[-1] if made.t[-1:] == [problem.t_end] else made.reason


def tried(rng):
    """Return what is wrong with one run, or an empty string."""
    method, way = METHODS[rng.integers(len(METHODS))], WAYS[rng.integers(len(WAYS))]
    t0 = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(0.0, 17.0))
    end = t0 + float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-1.0, 1.5))
    if way == "steps" and getattr(method, "h", None) is not None:  # whole steps, which end before
        way = "plain"
    if end == t0:
        return ""
    spacing = math.ulp(max(abs(t0), abs(end)))
    allowed = TOLERANCE + (SPACINGS * spacing if isinstance(method, DOP853 | Radau) else 0.0)
    problem = Problem(OSCILLATOR, y0=[1.0, 0.0], t0=t0, t_end=end)
    what = f"{method!r}, {way}, from {t0!r} to {end!r}"
    try:
        y = state(problem, method, way)
    except InputError as refused:
        fair = spacing > COARSEST * abs(end - t0) and "doubles are" in str(refused)
        return "" if fair else f"{what}: {refused}"
    if isinstance(y, str):
        return f"{what}: {y}"
    error = np.abs(y - [math.cos(end - t0), -math.sin(end - t0)]).max()
    return "" if error < allowed else f"{what}: error {error:.1e}"


if __name__ == "__main__":
    count, seed = (int(argument) for argument in sys.argv[1:])
    made = [tried(np.random.default_rng([seed, i])) for i in range(count)]
    print("\n".join(filter(None, made)))
    print(f"{sum(map(bool, made))} of {count}")
