"""The annotations of options that several methods have; `problems.checks` checks them.

A method writes ``h: Step`` and nothing else: `integrators.protocol.MethodBase` refuses what is
no step, and keeps what is one as a float.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from problems import limits
from problems.checks import AtLeast, Between, number, refusal
from problems.errors import shown

SMALLEST = 2.0**-52
"""The smallest tolerance of a step: a smaller error cannot be told from rounding."""

SHORTEST = 2.0**-48
"""Of the time: a shorter step cannot be told from none; as in `integrators.kernel.control`."""

Step = Annotated[
    float, Between(0.0, open=True, words="a step above 0; the sign of time is that of the times asked for")
]
"""Length of a step."""

Tolerance = Annotated[
    float,
    Between(
        SMALLEST, 1.0,
        words=f"a tolerance from {SMALLEST:.1e} to below 1: an error smaller than this cannot be told "
        "from rounding",
    ),
]  # fmt: skip
"""Local error per step."""

NotNegative = Annotated[float, Between(0.0)]
"""A finite number, 0 or above."""

Share = Annotated[float, Between(0.0, 1.0, open=True)]
"""A number between 0 and 1, such as a relative tolerance."""

Count = Annotated[int, AtLeast(1)]
"""A whole number from 1 on."""


class _Stages(AtLeast):
    def checked(self, owner: str, name: str, value: Any) -> int:
        given = super().checked(owner, name, value)
        limits.check(f"{owner} with {name}={shown(value)}", "STAGES", given)
        return given


Stages = Annotated[int, _Stages(1)]
"""A whole number from 1 on, not above what `problems.limits` allow."""


@dataclass(frozen=True)
class _Landings:
    def checked(self, owner: str, name: str, value: Any) -> tuple[float, ...]:
        listed = value.tolist() if isinstance(value, np.ndarray) else value
        times = [number(t) for t in listed] if isinstance(listed, list | tuple) else [math.nan]
        if not all(map(math.isfinite, times)):
            raise refusal(owner, name, value, f"a list of finite times, such as {name}=[1.0, 2.5]")
        kept: list[float] = []
        for t in sorted(times):
            if not kept or t - kept[-1] > SHORTEST * max(abs(t), abs(kept[-1])):
                kept.append(t)
        return tuple(kept)


Landings = Annotated[Sequence[float], _Landings()]
"""A list or array of times, kept in ascending order; of those that no step could tell apart, the first."""
