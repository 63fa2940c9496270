"""Warm seconds of whole integrations, honestly: compiled before, without output, samples kept.

All settings of a problem are timed in one process, in turn.
"""

import gc
import math
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from statistics import median, quantiles
from typing import Any, Literal

import numpy as np
import psutil
from numpy.typing import NDArray

from hbvm_bench.campaign.file import TimingPlan
from hbvm_bench.store.records import Compile, Load, Timing, TimingRound
from integrators.protocol import MethodBase, Program, Samples, Status
from problems.problem import Problem

WARM_UP = 0.01  # of the interval: everything has run once
CALIBRATION_LOOPS = 800_000
ORDER_SEED = 2026
LOADING = 0.5  # seconds; machine code that is loaded at a first close encounter took 0.04 of a run of 0.001
NOWHERE = 1e-7  # of the interval: what a call takes that goes next to nowhere; IAS15 may hang in 1e-9 of it
CALLS = 20
CLOCKS: dict[str, Callable[[], float]] = {
    "wall": time.perf_counter,
    "thread": time.thread_time,
    "process": time.process_time,
}


class Timeable(ABC):
    """What can be timed, compiled: an integration, or an ensemble."""

    program: Program

    @abstractmethod
    def once(self, clock: Callable[[], float]) -> tuple[float, Samples]:
        """Return the seconds of one run, all but setting up, and what it returned."""

    @abstractmethod
    def until(self, share: float) -> "Timeable":
        """Return a shorter run, over the first ``share`` of the interval."""

    def seconds(
        self, repeats: int = 1, clock: Callable[[], float] = time.perf_counter
    ) -> tuple[float, Samples]:
        """Return the mean seconds of runs in a row, garbage collection off, and what the last returned."""
        with no_collection():
            spent, samples = self.once(clock)
            for _ in range(repeats - 1):
                taken, samples = self.once(clock)
                spent += taken
        return spent / repeats, samples


@dataclass(frozen=True, eq=False)
class SingleRun(Timeable):
    """A whole integration that returns its end state only."""

    program: Program
    y0: NDArray[np.float64]
    par: NDArray[np.float64]
    t0: float
    t_end: float
    sample: str | None  # how the end time is met; see `integrators.protocol.MethodBase.to_end`

    @classmethod
    def compiled(cls, problem: Problem, method: MethodBase, program: Program | None = None) -> "SingleRun":
        """Return the run of a method, compiled if it is not yet, which meets its end as its library does."""
        program = method.compile(problem.system) if program is None else program
        return cls(program, problem.y0, problem.par, problem.t0, problem.t_end, method.to_end)

    def once(self, clock: Callable[[], float]) -> tuple[float, Samples]:
        end = np.array([self.t_end])
        stepper = self.program.start(self.y0, self.par, self.t0)
        start = clock()
        samples = stepper.advance(end, sample=self.sample)
        return clock() - start, samples

    def until(self, share: float) -> "SingleRun":
        return replace(self, t_end=self.t0 + share * (self.t_end - self.t0))


@contextmanager
def no_collection() -> Iterator[None]:
    """Keep garbage collection off, for something to be timed."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


Order = Literal["alternating", "shuffled", "as given"]


def interleaved(
    samples: Sequence[Callable[[], float]],
    rounds: int,
    *,
    order: Order = "alternating",
    takes_part: Callable[[int, int], bool] = lambda i, number: True,
    begin: Callable[[int], None] = lambda number: None,
) -> list[list[float]]:
    """Take one sample of each in every round, so that what else the machine does meets them all.

    A sample is taken by a call that returns its seconds. The order of the rounds is that given, another in
    each, or backwards in every other one. ``takes_part(i, number)`` says, right before, whether the i-th has
    a sample in the round with this number, from 0; ``begin`` is called with the number of a round before it.
    Returned are the seconds of each.
    """
    taken: list[list[float]] = [[] for _ in samples]
    shuffle = np.random.default_rng(ORDER_SEED)
    for number in range(rounds):
        begin(number)
        places = list(range(len(samples)))
        if order == "shuffled":
            places = shuffle.permutation(places).tolist()
        elif order == "alternating" and number % 2:
            places.reverse()
        for i in places:
            if takes_part(i, number):
                taken[i].append(samples[i]())
    return taken


def chooses(number: int) -> bool:
    """Whether a round of the timing pass, from 0, chooses settings; the others compare what was chosen.

    The fastest of many settings is partly the luckiest, and the times that chose it would flatter whoever has
    more settings. Each kind has as many rounds in either order where these alternate.
    """
    return number % 4 in (0, 3)


def shared(rounds: int, compilations: int) -> list[list[int]]:
    """Return the rounds of each process: those that choose are not in one with those that compare."""
    if compilations == 1:
        return [list(range(rounds))]
    kinds = [[round_ for round_ in range(rounds) if chooses(round_) is kind] for kind in (True, False)]
    counts = compilations - compilations // 2, compilations // 2
    parts = [kind[place::count] for kind, count in zip(kinds, counts, strict=True) for place in range(count)]
    return [part for part in parts if part]


def spread_evenly(count: int, rounds: Sequence[int]) -> list[int]:
    """Return so many of the rounds, at least two and at most all, spread evenly.

    Where some of the rounds choose settings and others compare them, so do those returned.
    """
    most = len(rounds)
    count = max(min(2, most), min(most, count))
    chosen = [rounds[place * most // count] for place in range(count)]
    if len({*map(chooses, chosen)}) == 1 < len({*map(chooses, rounds)}):
        both = [next(round_ for round_ in rounds if chooses(round_) is kind) for kind in (True, False)]
        chosen = sorted({*both, *(round_ for round_ in chosen[1:] if round_ > max(both))})[:count]
    return chosen


@dataclass(frozen=True)
class Spread:
    """The median of samples with their quartiles, which a single sample does not have."""

    median: float
    low: float | None
    high: float | None

    @classmethod
    def from_samples(cls, samples: Sequence[float]) -> "Spread":
        """Return the spread of samples, at least one."""
        low, high = quantiles(samples, n=4, method="inclusive")[::2] if len(samples) > 1 else (None, None)
        return cls(median(samples), low, high)


def repeats_for(seconds: float, shortest: float) -> int:
    """Return how many runs of ``seconds`` make a sample that lasts ``shortest``, with a reserve."""
    return max(1, math.ceil(1.2 * shortest / max(seconds, 1e-9))) if seconds < shortest else 1


def time_together(
    runs: Sequence[Timeable], plan: TimingPlan, rounds: Sequence[int], compilation: int = 0
) -> list[Timing]:
    """Take the samples of the runs of one problem, interleaved round by round in this process.

    ``rounds`` are the numbers of this process's, its ``compilation`` among the plan's. Every round begins
    with a garbage collection and one sample of the calibration. Before the first, every run has gone a
    hundredth of its interval, and in the first all of it where this takes less than `LOADING`: what a library
    loads when it first needs it is then there. A whole run tells how many make a sample, and is the sample
    where one does. A run that is too slow for all rounds within the plan's budget takes part in fewer of
    them; one that does not reach the end has none, with the reason.
    """
    clock, budget = CLOCKS[plan.clock], plan.budget * len(rounds) / plan.rounds
    calls = []
    for run in runs:
        run.until(WARM_UP).seconds()
        calls.append(run.until(NOWHERE).seconds(CALLS, clock)[0])
    firsts: dict[int, tuple[float, Samples]] = {}
    repeats = [1] * len(runs)
    turns = [list(rounds) for _ in runs]
    calibration: list[float] = []

    def begin(place: int) -> None:
        del place
        gc.collect()
        calibration.append(calibrate(clock))

    def sample(i: int) -> float:
        if i in firsts:
            return runs[i].seconds(repeats[i], clock)[0]
        spent, reached = firsts[i] = runs[i].seconds(clock=clock)
        if spent < LOADING and reached.status is Status.FINISHED:
            spent, reached = firsts[i] = runs[i].seconds(clock=clock)
        if reached.status is not Status.FINISHED:
            turns[i] = [rounds[0]]
            return spent
        repeats[i] = repeats_for(spent, plan.shortest)
        turns[i] = spread_evenly(int(budget / max(spent * repeats[i], 1e-9)), rounds)
        return spent if repeats[i] == 1 else sample(i)

    before = busy()
    taken = interleaved(
        [partial(sample, i) for i in range(len(runs))],
        len(rounds),
        order=plan.order,
        takes_part=lambda i, place: rounds[place] in turns[i],
        begin=begin,
    )
    load = load_between(before, busy())
    timings = []
    for i, (run, seconds, call) in enumerate(zip(runs, taken, calls, strict=True)):
        first, reached = firsts[i]
        if reached.status is not Status.FINISHED:
            timings.append(Timing(why=f"not timed: the integration ended as {reached.status.value}"))
            continue
        fixed = {"repeats": repeats[i], "compile": _compilation(run), "compilation": compilation}
        taking = [
            TimingRound(samples=[sample], calibration=[calibration[rounds.index(n)]], number=n, **fixed)
            for n, sample in zip(turns[i], seconds, strict=True)
        ]
        few = f"{len(taking)} of {len(rounds)} rounds: a run takes {first:.2g} s"
        why = few * (len(taking) < len(rounds))
        timings.append(Timing(rounds=taking, why=why, call=call, load=load))
    return timings


def _compilation(run: Timeable) -> Compile:
    return Compile(seconds=float(run.program.compile_seconds), cached=run.program.from_cache)


def busy() -> tuple[float, float, float, float]:
    """Return, in seconds, the busy and steal time of all cores, our own, and the wall clock's.

    Our own is that of this process and of those that it started and that have ended.
    """
    all_, own = psutil.cpu_times(), os.times()
    spent = sum(getattr(all_, name, 0.0) for name in ("user", "nice", "system", "irq", "softirq"))
    return spent, steal_seconds(), sum(own[:4]), time.monotonic()


def steal_seconds() -> float:
    """Return the steal time of all cores in seconds; 0 where the system does not tell it."""
    return getattr(psutil.cpu_times(), "steal", 0.0)


def load_between(before: tuple[float, ...], after: tuple[float, ...]) -> Load | None:
    """Return what else the machine did between two looks at `busy`; ``None`` where they are one."""
    all_, steal, own, wall = (b - a for a, b in zip(before, after, strict=True))
    if wall <= 0.0:
        return None
    return Load(others=round(max(all_ - own, 0.0) / wall, 3), steal=round(steal / wall, 3))


def calibrate(clock: Callable[[], float] = time.perf_counter) -> float:
    """Return the seconds, by the clock of the samples, of the calibration loop without any integrator.

    It divides out how fast the machine is at the moment: square roots, divisions and
    multiply-adds in four independent chains, compiled, about 10 ms.
    """
    loop = _calibration_loop()
    loop(1000)
    start = clock()
    loop(CALIBRATION_LOOPS)
    return clock() - start


@cache
def _calibration_loop() -> Any:
    import numba

    # it calls nothing else that is compiled, so numba's own cache cannot be stale; a second saved per visit
    @numba.njit(cache=True)
    def loop(n: int) -> float:
        a, b, c, d = 1.1, 1.2, 1.3, 1.4
        for _ in range(n):
            a = 1.0 / math.sqrt(1.0 + a * a) + 0.5
            b = 1.0 / math.sqrt(1.0 + b * b) + 0.5
            c = 1.0 / math.sqrt(1.0 + c * c) + 0.5
            d = 1.0 / math.sqrt(1.0 + d * d) + 0.5
        return a + b + c + d

    return loop
