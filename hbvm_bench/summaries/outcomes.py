"""What became of the cases: which integrator did what on which problem, and what to doubt of a run."""

from collections import Counter
from collections.abc import Sequence
from statistics import median
from typing import Literal, NamedTuple

from hbvm_bench.store.records import Load, Record, TimingRound
from hbvm_bench.summaries.points import by_family, by_problem, family_of, short_name, singles
from hbvm_bench.summaries.rows import group_of, reached, reason_of
from hbvm_bench.summaries.table import Table

STEADY = 1.5  # quartiles of the calibration around a timing sample

State = Literal["on", "apart", "uncompared", "off", "ended", "refused", "absent"]

SIGNS: dict[State, str] = {
    "on": "●", "apart": "◑", "uncompared": "◎", "off": "◐", "ended": "○", "refused": "–", "absent": ""
}  # fmt: skip
"""From best to worst."""


class Outcome(NamedTuple):
    """What became of all settings of a family on a problem."""

    state: State  # the best that any of them did, a key of `SIGNS`
    reached: int  # settings that reached the end with their symmetry and energy
    settings: int
    reasons: list[str]  # why the others did not, each once, with the setting it is said of


def matrix(records: Sequence[Record]) -> tuple[list[str], dict[str, dict[str, Outcome]]]:
    """Return the families in order, and for each problem the outcome of each family."""
    here = {problem: by_family(members) for problem, members in by_problem(records).items()}
    families = list(by_family(singles(records)))
    rows = {
        problem: {family: _outcome(members.get(family, [])) for family in families}
        for problem, members in here.items()
    }
    return families, rows


def table(records: Sequence[Record]) -> tuple[Table, list[str]] | None:
    """Return the matrix as a table, with the reasons; ``None`` for one problem alone."""
    families, rows = matrix(records)
    if len(rows) < 2:
        return None
    reasons = [
        f"{short_name(problem)}, {family}: {reason}"
        for problem, row in rows.items()
        for family, outcome in row.items()
        for reason in outcome.reasons
        if reason
    ]
    result = Table(
        "Which integrator on which problem",
        ("problem", *families),
        [(short_name(problem), *map(_sign, row.values())) for problem, row in rows.items()],
        "● reached the end on its trajectory; ◑ with a large position error; ◎ without a reference "
        "solution; ◐ lost the symmetry or the energy; ○ did not reach the end; – refused. Numbers: how "
        "many of its settings reached the end, where not all did.",
    )
    return result, reasons


def _sign(outcome: Outcome) -> str:
    some = 0 < outcome.reached < outcome.settings
    return SIGNS[outcome.state] + (f" {outcome.reached}/{outcome.settings}" if some else "")


def _outcome(records: Sequence[Record]) -> Outcome:
    states: list[State] = []
    said: dict[str, list[str]] = {}
    for record in records:
        states.append("refused" if record.result.outcome == "refused" else group_of(record))
        if not reached(record):
            said.setdefault(reason_of(record), []).append(record.case.method)
    same = len({reason_of(record) for record in records}) == 1
    reasons = [reason if same else f"{', '.join(who)}: {reason}" for reason, who in said.items()]
    present: list[State] = [state for state in SIGNS if state in states]
    return Outcome(present[0] if present else "absent", sum(map(reached, records)), len(states), reasons)


def sentences(records: Sequence[Record]) -> list[str]:
    """Return what to know of this run beside the rules: how many settings each method had, and doubts."""
    families = {family: _settings(members) for family, members in by_family(singles(records)).items()}
    counts = {number for numbers in families.values() for number in numbers}
    said: list[str] = []
    if len(counts) == 1:
        number = counts.pop()
        said = [
            f"In this run every method has {number} {'setting' if number == 1 else 'settings'} on every "
            "problem that it accepts, declared before the run."
        ]
    elif counts:
        ranges = {family: " to ".join(map(str, sorted(set(each)))) for family, each in families.items()}
        listed = ", ".join(f"{family} {numbers}" for family, numbers in ranges.items())
        said = [f"In this run the methods do not have equally many settings on a problem: {listed}."]
    return said + doubts(records)


def doubts(records: Sequence[Record]) -> list[str]:
    """Return sentences on what to distrust: times taken on a busy machine, several machines, limits."""
    said = beside(records)
    rounds = _rounds(records)
    calibrations = sorted(seconds for round_ in rounds for seconds in round_.calibration)
    if len(calibrations) >= 4:
        low, high = calibrations[len(calibrations) // 10], calibrations[-1 - len(calibrations) // 10]
        if high > STEADY * low:
            said.append(
                f"The speed of the machine was not steady: the calibration loop took {high / low:.1f} "
                "times as long in its slowest tenth as in its fastest."
            )
    if not rounds and any(map(reached, records)):
        said.append(
            "Nothing was timed: work is counted in steps and evaluations, and compile times are those of "
            "cases that ran in parallel."
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


def disturbed(records: Sequence[Record]) -> list[str]:
    """Return a sentence where the machine had so much other work that the times are doubtful."""
    return beside(records) if any(load.verdict() for load in _loads(records)) else []


def beside(records: Sequence[Record]) -> list[str]:
    """Return a sentence on what else ran while interleaved times were taken, where that was looked at."""
    return [other_work(loads)] if (loads := _loads(records)) else []


def other_work(loads: Sequence[Load]) -> str:
    """Say what else ran while times were taken, from at least one look at it."""
    others, steal = (_shares([getattr(load, name) for load in loads]) for name in ("others", "steal"))
    doubt = "; the times are doubtful" if any(load.verdict() for load in loads) else ""
    return (
        f"While times were taken, other processes used {others} of a core, and the steal time was "
        f"{steal} of one{doubt}."
    )


def shares(records: Sequence[Record]) -> tuple[str, str]:
    """Return what other processes used of a core while times were taken, and the host; else why not known."""
    if loads := _loads(records):
        return _shares([load.others for load in loads]), _shares([load.steal for load in loads])
    why = "not recorded" if _rounds(records) else "no case timed"
    return why, why


def compilations(records: Sequence[Record]) -> list[str]:
    """Return a sentence on how the times of several compilations differ, where there are several."""
    ratios = sorted(
        (max(times) / min(times), record.case.method)
        for record in records
        if len(times := by_compilation(record)) > 1
    )
    if not ratios:
        return []
    (middle, _), (most, which) = ratios[len(ratios) // 2], ratios[-1]
    return [f"Scatter between compilations: {middle - 1:.0%} (median), {most - 1:.0%} (largest, {which})."]


def by_compilation(record: Record) -> list[float]:
    """Return the median times of the compilations of a case."""
    samples_of: dict[int, list[float]] = {}
    for round_ in record.timing.rounds if record.timing else ():
        samples_of.setdefault(round_.compilation, []).extend(round_.samples)
    return [median(samples) for samples in samples_of.values() if samples]


def _loads(records: Sequence[Record]) -> list[Load]:
    return [record.timing.load for record in records if record.timing and record.timing.load]


def _shares(values: Sequence[float]) -> str:
    low, high = f"{min(values):.0%}", f"{max(values):.0%}"
    return low if low == high else f"{low} to {high}"


def _rounds(records: Sequence[Record]) -> list[TimingRound]:
    return [round_ for record in records if record.timing for round_ in record.timing.rounds]


def _settings(records: Sequence[Record]) -> tuple[int, int]:
    """Return the least and the most settings of a family on a problem that it accepts."""
    accepted = [record for record in records if record.result.outcome != "refused"]
    counts = [len(members) for members in by_problem(accepted or records).values()]
    return min(counts), max(counts)
