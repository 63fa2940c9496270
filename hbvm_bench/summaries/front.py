"""Which settings are worth more rounds: those near the fastest, and those that a comparison chooses."""

from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np

from hbvm_bench.store.records import Record, Timing
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.points import accurate, by_family, number

ERRORS = ("energy_max", "position_end")
FACTOR = 2.0
RULE = f"at every error that it reaches it takes more than {FACTOR:g} times as long as another setting"
WHY = f"not timed in all compilations: {RULE}"


def behind(records: Sequence[Record], timings: Sequence[Timing]) -> set[str]:
    """Return the ids of the settings that are far from the fastest wherever they are accurate enough.

    A setting is far behind where another one, at least as accurate, takes less than a half of its time. One
    without times, or without errors, is not behind.
    """
    errors = np.array(
        [[np.inf if (e := number(record, key)) is None else e for key in ERRORS] for record in records]
    )
    seconds = np.array([median(timing.samples) if timing.samples else np.nan for timing in timings])
    found = set()
    for i, record in enumerate(records):
        as_accurate = (errors <= errors[i]).all(axis=1) & np.isfinite(errors[i]).any()
        if (FACTOR * seconds[as_accurate] < seconds[i]).any():
            found.add(record.id)
    return found


def chosen(records: Sequence[Record], asked: Sequence[Mapping[str, float]]) -> set[str]:
    """Return the ids of the settings with which each method is compared at the errors that are ``asked`` for.

    They are chosen as in every table, by the times that the records have by then.
    """
    found = set()
    for members in by_family(records).values():
        for within in asked:
            able = [
                (seconds, record.id)
                for record in members
                if (seconds := standings.choosing(record)) and accurate(record, within)
            ]
            found |= {min(able)[1]} if able else set()
    return found
