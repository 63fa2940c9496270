"""Which settings are worth more rounds: those that come near the front of their method in time and errors."""

from collections.abc import Sequence
from statistics import median

import numpy as np

from hbvm_bench.campaign.identity import Resolved, fixed_step
from hbvm_bench.store.records import Record, Timing
from hbvm_bench.summaries.points import family_of, number

ERRORS = ("energy_max", "position_end")
FACTOR = 2.0
WHY = (
    f"timed in the first compilation alone: it takes more than {FACTOR:g} times as long as another setting "
    "of its method that is as accurate"
)


def behind(cases: Sequence[Resolved], records: Sequence[Record], timings: Sequence[Timing]) -> list[bool]:
    """Return of each setting whether another one, at least as accurate, takes less than a half of its time.

    Settings of one method are compared, those with a fixed and those with an adaptive step size apart. One
    without times, or without errors, is not behind.
    """
    kinds = [
        (family_of(record), fixed_step(case.method) is None)
        for case, record in zip(cases, records, strict=True)
    ]
    errors = np.array(
        [[np.inf if (e := number(record, key)) is None else e for key in ERRORS] for record in records]
    )
    seconds = np.array([median(timing.samples) if timing.samples else np.nan for timing in timings])
    found = []
    for i, kind in enumerate(kinds):
        alike = np.array([other == kind for other in kinds])
        as_accurate = alike & (errors <= errors[i]).all(axis=1) & np.isfinite(errors[i]).any()
        found.append(bool((FACTOR * seconds[as_accurate] < seconds[i]).any()))
    return found
