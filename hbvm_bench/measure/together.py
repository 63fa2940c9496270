"""The times of all settings of one problem, taken in one process, in turn."""

import gc
import os
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from hbvm_bench.campaign.file import TimingPlan
from hbvm_bench.measure.timing import WARM_UP, Timeable, calibrate, interleaved, repeats_for, spread_evenly
from hbvm_bench.store.records import Compile, Load, Timing, TimingRound
from integrators.protocol import Status

NOWHERE = 1e-9  # of the span: what a call takes that goes next to nowhere
CALLS = 20
CLOCKS: dict[str, Callable[[], float]] = {"wall": time.perf_counter, "thread": time.thread_time}


def time_together(runs: Sequence[Timeable], plan: TimingPlan) -> list[Timing | str]:
    """Take all samples of the runs of one problem, interleaved round by round in this process.

    Every round begins with a garbage collection and one sample of the calibration. A run
    that is too slow for all rounds within the plan's budget takes part in fewer of them.

    Parameters
    ----------
    runs : sequence of Timeable
        Compiled.
    plan : TimingPlan
        How many rounds, in which order and by which clock.

    Returns
    -------
    list of Timing or str
        For each run; a sentence where it does not reach the end.
    """
    clock = CLOCKS[plan.clock]
    firsts, calls = [], []
    for run in runs:
        run.until(WARM_UP).seconds()
        firsts.append(run.seconds(clock=clock))
        calls.append(run.until(NOWHERE).seconds(CALLS, clock)[0])
    fine = [i for i, (_, reached) in enumerate(firsts) if reached.status is Status.FINISHED]
    repeats = {i: repeats_for(firsts[i][0], plan.shortest) for i in fine}
    turns = {
        i: spread_evenly(int(plan.budget / max(firsts[i][0] * repeats[i], 1e-9)), plan.rounds) for i in fine
    }
    calibration: list[float] = []

    def begin(number: int) -> None:
        gc.collect()
        calibration.append(calibrate())

    before = busy()
    taken = interleaved(
        [partial(_mean_seconds, runs[i], repeats[i], clock) for i in fine],
        plan.rounds,
        order=plan.order,
        turns=[turns[i] for i in fine],
        begin=begin,
    )
    load = load_between(before, busy())
    made: list[Timing | str] = [
        f"not timed: the integration ended as {reached.status.value}" for _, reached in firsts
    ]
    for i, seconds in zip(fine, taken, strict=True):
        program = runs[i].program
        compiled = Compile(seconds=float(program.compile_seconds), cached=program.from_cache)
        made[i] = Timing(
            rounds=[
                TimingRound(
                    samples=[sample],
                    repeats=repeats[i],
                    compile=compiled,
                    calibration=[calibration[n]],
                    number=n,
                )
                for n, sample in zip(turns[i], seconds, strict=True)
            ],
            why=""
            if len(seconds) == plan.rounds
            else f"{len(seconds)} of {plan.rounds} rounds: a run takes {firsts[i][0]:.2g} s",
            call=calls[i],
            load=load,
        )
    return made


def _mean_seconds(run: Timeable, repeats: int, clock: Callable[[], float]) -> float:
    return run.seconds(repeats, clock)[0]


def busy() -> tuple[float, float, float, float] | None:
    """Return, in seconds, the busy and stolen time of all cores, our own, and the wall clock's."""
    try:
        fields = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0].split()[1:]
    except OSError:
        return None
    tick = os.sysconf("SC_CLK_TCK")
    user, nice, system, _, _, irq, softirq, steal = (int(field) / tick for field in fields[:8])
    own = os.times()
    return user + nice + system + irq + softirq, steal, own.user + own.system, own.elapsed


def load_between(before: tuple[float, ...] | None, after: tuple[float, ...] | None) -> Load | None:
    """Return what else the machine did between two looks at `busy`; ``None`` where it does not tell."""
    if before is None or after is None or after[3] <= before[3]:
        return None
    all_, stolen, own, wall = (b - a for a, b in zip(before, after, strict=True))
    return Load(others=round(max(all_ - own, 0.0) / wall, 3), stolen=round(stolen / wall, 3))
