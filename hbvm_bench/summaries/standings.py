"""Run times at required accuracies, from the records of a problem, the same way for every family.

Times that chose a setting do not compare it; see `hbvm_bench.measure.timing.chooses`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from hbvm_bench.campaign.entries import Accuracy
from hbvm_bench.campaign.file import Campaign, Goal, ProblemEntry, chosen, name_of
from hbvm_bench.campaign.identity import printed
from hbvm_bench.campaign.sweep import fill
from hbvm_bench.measure.timing import Spread, chooses
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import accurate, family_of, is_hbvm_or_gauss, number
from hbvm_bench.summaries.rows import Task, tasks

TIME = "warm_seconds"


@dataclass(frozen=True)
class SettingComparison:
    """A peer's best setting beside our best one."""

    ours: Record | None  # what takes least of the settings that are accurate enough
    theirs: Record | None
    ratio: Spread | None = None  # theirs over ours; of times within each round of the timing pass
    chosen_by_them: bool = False  # whether the times that chose the settings are those that are compared


def entries(campaign: Campaign, records: Sequence[Record]) -> list[tuple[ProblemEntry, list[Record]]]:
    """Return the problems of a campaign, then its ensembles, each with the records of its cases."""
    tables = tasks(records)
    return [(entry, tables.get(task, [])) for entry, task in tasks_of(campaign)]


def tasks_of(campaign: Campaign) -> list[tuple[ProblemEntry, Task]]:
    """Return what the problems of a campaign and then its ensembles ask for, each with its entry."""
    problems = [
        (entry, Task.on(printed(fill(entry.use, values)), entry.grid or campaign.grid))
        for entry in campaign.entries()
        for values in chosen(entry)
    ]
    ensembles = [
        (many.entry, Task.on(printed(many.problem), ensemble=many.ensemble)) for many in campaign.ensembles
    ]
    return problems + ensembles


def asked(campaign: Campaign) -> dict[str, list[Accuracy]]:
    """Return the errors that a campaign asks for, by itself and by goals, by the problem as it prints."""
    return {
        task.problem: [
            within
            for within in (entry.within, *(goal.within for goal in goals_of(campaign, entry)))
            if within
        ]
        for entry, task in tasks_of(campaign)
        if task.ensemble is None
    }


def goals_of(campaign: Campaign, entry: ProblemEntry) -> list[Goal]:
    """Return the goals of a campaign that are about a problem."""
    return [goal for goal in campaign.goals if not goal.only or name_of(entry) in goal.only]


def title_of(entry: ProblemEntry) -> str:
    """Return what a page calls a problem."""
    return entry.title or name_of(entry)


def among(records: Sequence[Record], who: str) -> list[Record]:
    """Return the records of a family or of one setting; for ``""`` of HBVM and Gauss, without projections."""
    if not who:
        return [record for record in records if is_hbvm_or_gauss(record)]
    return [record for record in records if who in (family_of(record), record.case.method)]


def best(records: Sequence[Record], within: Mapping[str, float], metric: str = TIME) -> Record | None:
    """Return the case that takes least of those that are accurate enough; ``None`` if there is none.

    Times are those of the rounds that choose, see `choosing`.
    """
    able = [
        setting for setting in records if accurate(setting, within) and number(setting, metric) is not None
    ]

    def least(record: Record) -> float:
        seconds = choosing(record) if metric == TIME else None
        return seconds or number(record, metric) or 0.0

    return min(able, key=least, default=None)


def choosing(record: Record) -> float | None:
    """Return the median seconds of the rounds that choose; of all where none does, ``None`` without any."""
    rounds = by_round(record)
    return median([rounds[key] for key in rounds if chooses(key)] or rounds.values()) if rounds else None


def compare(
    ours: Record | None, theirs: Record | None, metric: str = TIME, *, chosen: bool = False
) -> SettingComparison:
    """Compare two cases of one problem; where they were ``chosen``, in the rounds that did not choose."""
    if ours is None or theirs is None:
        return SettingComparison(ours, theirs)
    if metric == TIME:
        base = by_round(ours)
        ratio_of = {key: seconds / base[key] for key, seconds in by_round(theirs).items() if key in base}
        by_others = all(any(map(chooses, by_round(record))) for record in (ours, theirs))
        apart = [ratio for key, ratio in ratio_of.items() if by_others and not chooses(key)]
        ratios = (apart if chosen else []) or [*ratio_of.values()]
        ratio = Spread.from_samples(ratios) if ratios else None
        return SettingComparison(ours, theirs, ratio, chosen and bool(ratios) and not apart)
    numbers = number(theirs, metric), number(ours, metric)
    ratio = numbers[0] / numbers[1] if numbers[0] is not None and numbers[1] else None
    return SettingComparison(ours, theirs, None if ratio is None else Spread.from_samples([ratio]))


def by_round(record: Record) -> dict[int, float]:
    """Return the seconds of a case by the round of the timing pass, from 0, in which they were taken."""
    rounds = record.timing.rounds if record.timing else []
    return {
        place if round_.number is None else round_.number: median(round_.samples)
        for place, round_ in enumerate(rounds)
    }


def no_worse(theirs: Record, factors: Mapping[str, float]) -> dict[str, float]:
    """Return the errors that HBVM and Gauss may have at most where they are to be so many times a peer's."""
    bounds = {key: (factor, number(theirs, key)) for key, factor in factors.items()}
    return {key: -1.0 if error is None else factor * error for key, (factor, error) in bounds.items()}
