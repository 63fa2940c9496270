"""The timing of a contest: all settings in one process, interleaved round by round in shuffled order."""

import gc
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from hbvm_bench.measure.timing import calibrate, repeats_for
from hbvm_bench.studies.race.accuracy import Entry
from hbvm_bench.studies.race.results import Load, Outcome

SHORTEST = 0.02
"""Seconds that a sample lasts at least: as many runs one after the other as that takes."""

BUDGET = 8.0
"""Seconds of sampling per setting; slow settings take part in fewer rounds, one at least."""

ORDER_SEED = 2026


def time_rounds(
    entries: Sequence[Entry], rounds: int, tell: Callable[[int], None] = lambda number: None
) -> tuple[list[Outcome], list[float], Load | None]:
    """Take the samples.

    In every round each setting has one sample, in an order shuffled anew, after one of
    the calibration. Garbage collection is off while a sample is taken.

    Parameters
    ----------
    entries : sequence of Entry
        Those without a run are left out; so are those on another trajectory, whose time
        has no meaning.
    rounds : int
        How many.
    tell : callable, optional
        Called with the number of each round before it begins.

    Returns
    -------
    outcomes : list of Outcome
        As given, with their samples.
    calibration : list of float
        Seconds of the fixed computation, round by round.
    load : Load or None
        What else the machine did meanwhile; ``None`` where it does not tell.
    """
    timed = [i for i, entry in enumerate(entries) if entry.run is not None and not entry.outcome.void]
    repeats = {i: repeats_for(entries[i].first, SHORTEST) for i in timed}
    turns = {i: _turns(entries[i].first * repeats[i], rounds) for i in timed}
    seconds: dict[int, list[float | None]] = {i: [None] * rounds for i in timed}
    shuffle = np.random.default_rng(ORDER_SEED)
    calibration: list[float] = []
    before = _clocks()
    for number in range(rounds):
        tell(number)
        gc.collect()
        calibration.append(calibrate())
        for i in shuffle.permutation(timed).tolist():
            run = entries[i].run
            if run is not None and number in turns[i]:
                seconds[i][number], _ = run.seconds(repeats[i])
    load = _load(before, _clocks())
    outcomes = [
        msgspec.structs.replace(
            entry.outcome,
            seconds=seconds.get(i, []),
            repeats=repeats.get(i, 0),
            untimed=_why(entry, len(turns.get(i, ())), rounds),
        )
        for i, entry in enumerate(entries)
    ]
    return outcomes, calibration, load


def _turns(seconds: float, rounds: int) -> set[int]:
    """Return the rounds in which a setting takes part, spread evenly."""
    count = max(1, min(rounds, int(BUDGET / seconds)))
    return {number * rounds // count for number in range(count)}


def _why(entry: Entry, taken: int, rounds: int) -> str:
    if entry.run is None:
        return "did not finish"
    if entry.outcome.void:
        return "on another trajectory, so that its time has no meaning"
    if taken < rounds:
        return f"{taken} of {rounds} rounds: a run takes {entry.first:.2g} s"
    return ""


def _clocks() -> tuple[float, float, float, float] | None:
    """Return, in seconds, the busy and stolen time of all cores, our own, and the wall clock's."""
    try:
        fields = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0].split()[1:]
    except OSError:
        return None
    tick = os.sysconf("SC_CLK_TCK")
    user, nice, system, _, _, irq, softirq, steal = (int(field) / tick for field in fields[:8])
    own = os.times()
    return user + nice + system + irq + softirq, steal, own.user + own.system, own.elapsed


def _load(before: tuple[float, ...] | None, after: tuple[float, ...] | None) -> Load | None:
    if before is None or after is None or after[3] <= before[3]:
        return None
    busy, stolen, own, wall = (b - a for a, b in zip(before, after, strict=True))
    return Load(others=round(max(busy - own, 0.0) / wall, 3), stolen=round(stolen / wall, 3))
