"""Which settings are worth more rounds: those that come near the fastest in time and errors."""

from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np

from hbvm_bench.store.records import Record, Timing
from hbvm_bench.summaries.points import accurate, family_of, number

ERRORS = ("energy_max", "position_end")
FACTOR = 2.0
RULE = (
    f"at every error that it reaches it takes more than {FACTOR:g} times as long as another setting, and at "
    "those that the problem or a goal asks for as another one of its method"
)
WHY = f"timed in the first compilation alone: {RULE}"


def behind(
    records: Sequence[Record], timings: Sequence[Timing], asked: Sequence[Mapping[str, float]]
) -> list[bool]:
    """Return of each setting of a problem whether it is far from the fastest wherever it is accurate enough.

    A setting is far behind where another one, at least as accurate, takes less than a half of its time. At
    the errors that are ``asked`` for, those of its method alone are its rivals, so that the fastest of each
    method is timed in all rounds. One without times, or without errors, is not behind.
    """
    errors = np.array(
        [[np.inf if (e := number(record, key)) is None else e for key in ERRORS] for record in records]
    )
    seconds = np.array([median(timing.samples) if timing.samples else np.nan for timing in timings])
    families = np.array([family_of(record) for record in records])
    able = [np.array([accurate(record, within) for record in records]) for within in asked]
    found = []
    for i in range(len(records)):
        as_accurate = (errors <= errors[i]).all(axis=1) & np.isfinite(errors[i]).any()
        rivals = [as_accurate, *((families == families[i]) & reach for reach in able if reach[i])]
        found.append(all((FACTOR * seconds[among] < seconds[i]).any() for among in rivals))
    return found
