"""The annotations of options that several methods have; `problems.checks` checks them.

A method writes ``h: Step`` and nothing else: `integrators.protocol.MethodBase` refuses what is
no step, and keeps what is one as a float.
"""

from collections.abc import Sequence
from typing import Annotated, Any

from problems import limits
from problems.checks import Must, at_least, checked, number, numbers, refusal
from problems.errors import shown

__all__ = ["Absolute", "Breakpoints", "Count", "NotNegative", "Share", "Stages", "Step", "Tolerance"]

SMALLEST = 2.0**-52
"""The smallest tolerance of a step: a smaller error cannot be told from rounding."""

SHORTEST = 2.0**-48
"""The shortest step, relative to the time: a shorter one cannot be told from none.

The same number is in `integrators.kernel.step.control`."""

Step = Annotated[
    float, Must("a finite step above 0; the sign of time is that of the times asked for", lambda h: h > 0)
]
"""Length of a step."""

Tolerance = Annotated[
    float,
    Must(
        f"a tolerance from {SMALLEST:.1e} to below 1: a smaller error cannot be told from rounding",
        lambda tol: SMALLEST <= tol < 1,
    ),
]
"""Local error per step."""

NotNegative = Annotated[float, Must("a finite number of at least 0", lambda x: x >= 0)]
"""A finite number, 0 or above."""


class _Absolute:
    def __repr__(self) -> str:
        return "an absolute tolerance"

    def checked(self, owner: str, name: str, value: Any) -> float | tuple[float, ...]:
        alone = number(value)
        each = numbers(value) if alone is None else (alone,)
        if not each or min(each) < 0.0:
            wanted = "a finite number of at least 0, or a list of them, one for each component"
            raise refusal(owner, name, value, wanted)
        return each if alone is None else alone


Absolute = Annotated[float | Sequence[float], _Absolute()]
"""Absolute tolerance, of all components or of each."""

Share = Annotated[float, Must("a number between 0 and 1", lambda x: 0 < x < 1)]
"""A number between 0 and 1, such as a relative tolerance."""

Count = Annotated[int, at_least(1)]
"""A whole number from 1 on."""


class _Stages:
    def __repr__(self) -> str:
        return "a number of stages"

    def checked(self, owner: str, name: str, value: Any) -> int:
        given = checked(owner, name, value, Count)
        limits.check(f"{owner} with {name}={shown(value)}", "STAGES", given)
        return given


Stages = Annotated[int, _Stages()]
"""A whole number from 1 on, not above what `problems.limits` allow."""


class _Breakpoints:
    def __repr__(self) -> str:
        return "finite times"

    def checked(self, owner: str, name: str, value: Any) -> tuple[float, ...]:
        times = numbers(value)
        if times is None:
            raise refusal(owner, name, value, f"a list of finite times, such as {name}=[1.0, 2.5]")
        kept: list[float] = []
        for t in sorted(times):
            if not kept or t - kept[-1] > SHORTEST * max(abs(t), abs(kept[-1])):
                kept.append(t)
        return tuple(kept)


Breakpoints = Annotated[Sequence[float], _Breakpoints()]
"""A list or array of times, kept in ascending order; of those that no step could tell apart, the first."""
