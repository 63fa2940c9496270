"""Checks of checkpoints: they continue bitwise identically, and only where they belong."""

import dataclasses
from typing import Any

import numpy as np

from integrators.protocol import Checkpoints, MethodBase, offers
from integrators.testing.exercises import blow_up, pendulum, two_bodies
from integrators.testing.rules import finished, irregular, raises, require, start
from problems import Problem, targets
from problems.errors import InputError

NONE = "it has no checkpoints"


def checkpoints_continue_bit_for_bit(method: MethodBase, problem: Problem) -> str | None:
    """Check that a restored checkpoint continues bitwise identically, here and in a new stepper."""
    grid = irregular(problem)
    head, tail = grid[:7], grid[7:]
    program: Any = method.compile(problem.system)
    stepper = program.start(problem.y0, problem.par, problem.t0)
    if not offers(stepper, Checkpoints):
        return NONE
    stepper.advance(head)
    checkpoint = stepper.checkpoint()
    there = (stepper.t, stepper.y.copy())
    first = stepper.advance(tail)
    stepper.restore(checkpoint)
    require(
        stepper.t == there[0] and np.array_equal(stepper.y, there[1]), "restore goes back to the checkpoint"
    )
    again = stepper.advance(tail)
    other = program.start(problem.y0, problem.par, problem.t0)
    other.restore(checkpoint)
    fresh = other.advance(tail)
    for samples, where in ((again, "the same stepper"), (fresh, "a new stepper")):
        finished(samples, method)
        require(np.array_equal(samples.y, first.y), f"{method!r} continues bit for bit in {where}")
    return None


def refuses_other_checkpoints(method: MethodBase, problem: Problem) -> str | None:
    """Check that no checkpoint but those of this method, system and parameters is taken."""
    grid = irregular(problem)
    stepper = start(method, problem)
    if not offers(stepper, Checkpoints):
        return NONE
    stepper.advance(grid[:7])
    others: dict[str, Any] = {"None": None, "a number": 1.5, "an empty tuple": (), "an array": problem.y0}
    for name, value in method.options(defaults=True).items():
        if isinstance(value, float):
            try:
                changed = dataclasses.replace(method, **{name: value / 2.0})
            except InputError:
                continue
            if changed.accepts(problem) is None:
                others[f"that of {changed!r}"] = start(changed, problem).checkpoint()
                break
    for other in (pendulum(), two_bodies(), blow_up()):
        same = targets.fingerprint(other.system) == targets.fingerprint(problem.system)
        if not same and method.accepts(other) is None:
            others[f"that of {other.system.name}"] = start(method, other).checkpoint()
    if problem.par.size:
        program: Any = method.compile(problem.system)
        twice = program.start(problem.y0, problem.par * 2.0, problem.t0)
        others["that of other parameters"] = twice.checkpoint()
    there = (stepper.t, stepper.y, stepper.status)
    for label, checkpoint in others.items():
        raises(InputError, lambda c=checkpoint: stepper.restore(c), f"{label} is refused as a checkpoint")
        require(
            (stepper.t, stepper.status) == (there[0], there[2]) and np.array_equal(stepper.y, there[1]),
            f"the refusal of {label} leaves the stepper where it was",
        )
    twin = start(method, problem)
    twin.advance(grid[:7])
    require(
        np.array_equal(stepper.advance(grid[7:]).y, twin.advance(grid[7:]).y),
        "refused checkpoints do not change what follows",
    )
    return None
