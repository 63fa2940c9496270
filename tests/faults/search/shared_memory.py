"""One option of `integrate_many` in a fresh process: two threads first, and then one, to the same bits.

What threads fill at once in the first call of a process, tables and contexts, is filled there only once: each
option has a process of its own. ``python -m tests.faults.search.shared_memory NAME ...`` prints what differs.
"""

import sys

import numpy as np

from integrators import HBVM, Event, Gauss, LineIntegral, integrate_many
from problems import Hamiltonian, Opaque, Problem


def oscillators(w):
    """Return two coupled oscillators."""
    system = Hamiltonian(
        lambda q, p, par: (
            (p[0] ** 2 + p[1] ** 2) / 2 + par.w * q[0] ** 2 / 2 + q[1] ** 2 / 2 + q[0] ** 2 * q[1] / 5
        ),
        dof=2,
        parameters={"w": w},
    )
    return Problem(system, q0=[1.0, 0.3], p0=[0.2, 0.4], t_end=12.0)


def in_python(t, y, par):
    """Return the field of the same oscillators."""
    x, z = y[:2]
    return [y[2], y[3], -par[0] * x - 0.4 * x * z, -z - x * x / 5]


def crossings():
    """Return an event that changes the state, and one that changes nothing."""
    return [
        Event(lambda q: q[0], then=lambda q, p: [q[0], q[1], -0.9 * p[0], p[1]], name="bounce"),
        Event(lambda p: p[1], name="turn"),
    ]


def called_crossings():
    """Return the same in Python."""

    def left(y):
        return float(np.float64(y[0]))

    def bounce(y):
        return np.array([y[0], y[1], -0.9 * float(y[2]), y[3]])

    return [Event(left, then=bounce, name="bounce")]


FIXED = HBVM(k=4, s=2, h=0.05)
OPTIONS = {
    "fixed steps and actions": (FIXED, {"events": crossings}),
    "fixed steps and an ordinary event": (FIXED, {"events": lambda: crossings()[1:]}),
    "fixed steps": (FIXED, {"sample": "stop"}),
    "wide": (HBVM(k=20, s=4, h=0.1), {"events": crossings}),
    "by coefficients": (HBVM(k=40, s=4, h=0.1), {}),
    "adaptive steps with a longest one": (HBVM(max_step=0.5), {"events": crossings}),
    "adaptive steps": (HBVM(), {"events": crossings}),
    "adaptive steps and an absolute tolerance": (HBVM(atol=1e-14), {}),
    "reversible": (Gauss(s=6, tol=1e-9, steps="reversible"), {"events": lambda: crossings()[1:]}),
    "Newton": (HBVM(k=4, s=2, h=0.1, solver="newton"), {"events": crossings}),
    "Newton in adaptive steps": (HBVM(solver="newton"), {}),
    "blended": (HBVM(k=6, s=3, h=0.1, solver="blended"), {}),
    "line integral": (LineIntegral(k=8, s=4, h=0.1, invariants=["energy"]), {}),
    "events in Python": (FIXED, {"events": called_crossings}),
    "projected": (HBVM(tol=1e-8, projection="energy"), {}),
    "dense": (FIXED, {"sample": "dense"}),
    "vectors": (HBVM(max_step=0.5), {"variations": ["w"]}),
    "vectors and an implicit solver": (HBVM(k=4, s=2, h=0.1, solver="newton"), {"variations": ["w"]}),
    "a field in Python": (HBVM(k=4, s=2, h=0.2), {}),
    "a field in Python with Newton": (HBVM(k=4, s=2, h=0.2, solver="newton"), {}),
}


def differences(name, members=24, times=(6.0, 12.0)):
    """Return how many trajectories differ between two threads, the first call, and one."""
    method, given = OPTIONS[name]
    rng = np.random.default_rng(1)
    problem, ws = oscillators(1.0), rng.uniform(0.5, 2.0, members)
    if "in Python" in name and "events" not in given:
        members = 6
        problem = Problem(Opaque(in_python, dim=4, parameters={"w": 1.0}), y0=problem.y0, t_end=12.0)
    starts, ws = problem.y0 + 0.2 * rng.normal(size=(members, 4)), ws[:members]
    given = {key: value() if callable(value) else value for key, value in given.items()}

    def made(threads):
        return integrate_many(
            problem, method, starts=starts, parameters={"w": ws}, times=times, threads=threads, **given
        )

    two, one = made(2), made(1)
    return sum(
        not (np.array_equal(a, b, equal_nan=True) and how == other)
        for a, b, how, other in zip(two.y, one.y, two.status, one.status, strict=True)
    )


if __name__ == "__main__":
    for option in sys.argv[1:]:
        print(option, differences(option))
