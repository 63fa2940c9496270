"""How fair a run was: settings per family, what was left out and why, what is doubtful."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Index
from hbvm_bench.summaries.outcomes import reason_of
from hbvm_bench.summaries.points import family_of, problems_of
from hbvm_bench.summaries.rows import group_of

UNDISTURBED = 0.9  # of a core, in the timing pass
STEADY = 1.5  # quartiles of the calibration around a timing sample


@dataclass(frozen=True)
class FamilySettings:
    """The settings that a family had.

    Attributes
    ----------
    family, library, version : str
        The method, the library that does the work, its version.
    kinds : dict of int
        How many settings of each kind: default, recommended, as published, outside its domain.
    texts : list of str
        The settings as they print, on the first problem that has them all.
    per_problem : (int, int)
        Least and most settings on a problem that the method accepts.
    """

    family: str
    library: str
    version: str
    kinds: dict[str, int]
    texts: list[str]
    per_problem: tuple[int, int]


@dataclass(frozen=True)
class Excluded:
    """Cases that have no number, or whose number must not be compared.

    Attributes
    ----------
    problem, method : str
        As they print.
    kind : {"refused", "ended", "off", "missing"}
        Refused by the method, did not reach the end, on another trajectory, not run yet.
    reason : str
        One sentence.
    """

    problem: str
    method: str
    kind: str
    reason: str


@dataclass(frozen=True)
class Fairness:
    """All of it; the rules themselves are `hbvm_bench.report.words.RULES`.

    Attributes
    ----------
    families : list of FamilySettings
        In the order of the run.
    equal : int or None
        Settings of every family on every problem, where they are equally many.
    excluded : list of Excluded
        In the order of the run.
    doubts : list of str
        Sentences on what to distrust in this run; empty where nothing is known.
    """

    families: list[FamilySettings]
    equal: int | None
    excluded: list[Excluded]
    doubts: list[str]


def fairness(index: Index, records: Sequence[Record]) -> Fairness:
    """Return how fair a run was.

    Parameters
    ----------
    index : Index
        What was asked for.
    records : sequence of Record
        What is there of it.
    """
    singles = [record for record in records if record.case.ensemble is None]
    families = [_settings(family, singles) for family in dict.fromkeys(family_of(r) for r in singles)]
    numbers = {number for family in families for number in family.per_problem}
    excluded = [
        Excluded(record.case.problem, record.case.method, _kind(record), reason_of(record))
        for record in records
        if group_of(record) != "on"
    ]
    present = {record.id for record in records}
    excluded += [
        Excluded(case.problem, case.method, "missing", "it has not run yet")
        for case_id, case in index.listed()
        if case_id not in present
    ]
    equal = numbers.pop() if len(numbers) == 1 else None
    return Fairness(families, equal, excluded, doubts(records))


def sentences(records: Sequence[Record]) -> list[str]:
    """Return what to know of this run beside the rules: how many settings each method had, and doubts."""
    singles = [record for record in records if record.case.ensemble is None]
    families = [_settings(family, singles) for family in dict.fromkeys(family_of(r) for r in singles)]
    counts = {number for family in families for number in family.per_problem}
    said: list[str] = []
    if len(counts) == 1:
        number = counts.pop()
        said.append(
            f"In this run every method has {number} {'setting' if number == 1 else 'settings'} on every "
            "problem that it accepts, declared before the run."
        )
    elif counts:
        listed = ", ".join(f"{family.family} {_range(family.per_problem)}" for family in families)
        said.append(f"In this run the methods do not have equally many settings on a problem: {listed}.")
    return said + doubts(records)


def doubts(records: Sequence[Record]) -> list[str]:
    """Return sentences on what to distrust: times taken on a busy machine, several machines, limits."""
    said: list[str] = []
    rounds = [one for record in records if record.timing for one in record.timing.rounds]
    shares = [one.share for one in rounds]
    if shares and median(shares) < UNDISTURBED:
        said.append(
            f"The times are disturbed: the machine had other work and left half of the visits less "
            f"than {median(shares):.0%} of a core. Ratios below 2 say nothing."
        )
    calibrations = sorted(seconds for one in rounds for seconds in one.calibration)
    if len(calibrations) >= 4:
        low, high = calibrations[len(calibrations) // 10], calibrations[-1 - len(calibrations) // 10]
        if high > STEADY * low:
            said.append(
                f"The speed of the machine was not steady: a fixed computation took {high / low:.1f} times "
                "as long at the slow end as at the fast end, the outermost tenths left out."
            )
    if not rounds and any(group_of(record) == "on" for record in records):
        said.append(
            "No times were taken: work is counted in steps and evaluations, and seconds of compilation are "
            "those of cases that ran side by side."
        )
    machines = {tuple(sorted((k, str(v)) for k, v in record.machine.items())) for record in records}
    if len(machines) > 1:
        said.append(f"The cases ran on {len(machines)} different machines; times do not compare.")
    timeouts = Counter(family_of(r) for r in records if r.result.outcome == "timeout")
    if timeouts:
        which = ", ".join(f"{family} {count}" for family, count in timeouts.items())
        said.append(
            f"The time limit ended {timeouts.total()} cases ({which}); a faster machine may finish some."
        )
    return said


def _settings(family: str, records: Sequence[Record]) -> FamilySettings:
    mine = [record for record in records if family_of(record) == family]
    accepted = [record for record in mine if record.result.outcome != "refused"] or mine
    by_problem = {p: [r for r in accepted if r.case.problem == p] for p in problems_of(accepted)}
    fullest = max(by_problem.values(), key=len)
    lengths = [len(cases) for cases in by_problem.values()]
    library = mine[0].library
    return FamilySettings(
        family=family,
        library=library,
        version=next((r.versions[library.lower()] for r in mine if library.lower() in r.versions), ""),
        kinds=dict(Counter(record.case.settings for record in fullest)),
        texts=[record.case.method for record in fullest],
        per_problem=(min(lengths), max(lengths)),
    )


def _range(numbers: tuple[int, int]) -> str:
    return f"{numbers[0]}" if numbers[0] == numbers[1] else f"{numbers[0]} to {numbers[1]}"


def _kind(record: Record) -> str:
    if record.result.outcome == "refused":
        return "refused"
    return group_of(record)
