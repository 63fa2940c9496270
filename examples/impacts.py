"""Impacts and dry friction: a block on a spring slides over a rough floor and bounces off a wall.

Steps end by themselves where friction turns around; the impact is an event that changes the state. With
heyoka both are events with callbacks. bouncing_ball.py has the same in a loop around SciPy's solve_ivp.
"""

from functools import cache, partial
from math import acos, hypot, sin

import heyoka as hy
import numpy as np
from side_by_side import Comparison, tolerances

import integrators
import problems

FRICTION, WALL, KEPT, END = 5e-4, -0.3, 0.999, 400.0  # KEPT: the part of the speed after an impact

TOLERANCES = (1e-15, 1e-13, 1e-11, 1e-9)


def exact() -> np.ndarray:
    """Return the times of the impacts: between two turns the block swings around a shifted centre."""
    times, t, x = [], 0.0, 1.0  # at rest at x
    while True:
        radius = x - FRICTION
        angle = acos((WALL - FRICTION) / radius)
        if t + angle >= END:
            return np.array(times)
        times.append(t + angle)
        speed, from_centre = KEPT * radius * sin(angle), WALL + FRICTION
        radius = hypot(from_centre, speed)
        t += angle + acos(from_centre / radius)
        x = radius - FRICTION


WALL_HIT = integrators.Event(  # made once, as heyoka's integrator
    lambda y: y[0] - WALL, direction=-1, then=lambda y: [WALL, -KEPT * y[1]], name="wall"
)


def by_event(problem: problems.Problem, tol: float) -> np.ndarray:
    """Return the times of impacts, each an event whose action turns the speed around."""
    return integrators.integrate(problem, integrators.HBVM(tol=tol), [END], events=WALL_HIT).events["wall"].t


@cache  # made once, as its users do
def heyokas(tol: float) -> tuple[hy.taylor_adaptive_dbl, list[float]]:
    """Return heyoka's integrator, and the list in which its callback puts the times of impacts."""
    x, v = hy.make_vars("x", "v")
    times: list[float] = []

    def bounced(ta, sign: int) -> bool:
        times.append(ta.time)
        ta.state[1] *= -KEPT
        ta.pars[0] = 1.0
        return True

    def turned(ta, sign: int) -> bool:
        ta.pars[0] = sign
        return True

    wall = hy.t_event(x - WALL, callback=bounced, direction=hy.event_direction.negative)
    turn = hy.t_event(v, callback=turned)
    equations = [(x, v), (v, -x - hy.par[0] * FRICTION)]
    return hy.taylor_adaptive(equations, np.zeros(2), pars=[-1.0], tol=tol, t_events=[wall, turn]), times


def by_heyoka(tol: float) -> np.ndarray:
    """Return the same by heyoka: callbacks change the speed, and the sign of the friction."""
    ta, times = heyokas(tol)
    times.clear()
    ta.reset_cooldowns()
    ta.time, ta.pars[0], ta.state[:] = 0.0, -1.0, [1.0, 0.0]
    ta.propagate_until(END)
    return np.array(times)


def compare() -> Comparison:
    """Compare the times of all impacts with the exact ones."""
    block = problems.VectorField(
        lambda y, m: [y[1], -y[0] - m.where(y[1] > 0, FRICTION, -FRICTION)], dim=2, name="block"
    )
    problem = problems.Problem(block, y0=[1.0, 0.0], t_end=END)
    true = exact()

    def error(found: np.ndarray) -> float:
        return np.abs(found - true).max() if found.size == true.size else np.inf

    made = Comparison(f"Impacts and dry friction: {true.size} impacts", "times of the impacts", 1e-8)
    made.add("HBVM, Event(then=...)", tolerances(partial(by_event, problem), *TOLERANCES), error)
    made.add("heyoka, callbacks", tolerances(by_heyoka, *TOLERANCES), error)
    return made


if __name__ == "__main__":
    print(compare())
