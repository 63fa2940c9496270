"""Which integrator did what on which problem: a matrix with reasons."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import by_family, by_problem
from hbvm_bench.summaries.rows import group_of, status_of

State = Literal["ok", "off", "ended", "refused", "absent"]

STATES: dict[State, str] = {
    "ok": "reached the end on the trajectory that was asked for",
    "off": "reached the end on another trajectory: a symmetry was lost",
    "ended": "did not reach the end",
    "refused": "the method does not accept the problem",
    "absent": "not in the campaign",
}


ORDER: tuple[State, ...] = ("ok", "off", "ended", "refused")
"""From best to worst, of the cases there are."""


@dataclass(frozen=True)
class Outcome:
    """What became of all settings of a family on a problem.

    Attributes
    ----------
    state : str
        The best that any of them did, a key of `STATES`.
    reached, settings : int
        How many of how many reached the end on the trajectory.
    reasons : list of str
        Why the others did not, each once, with the setting it is said of.
    """

    state: State
    reached: int
    settings: int
    reasons: list[str]


def matrix(records: Sequence[Record]) -> tuple[list[str], dict[str, dict[str, Outcome]]]:
    """Return the families in order, and for each problem the outcome of each family."""
    here = {problem: by_family(members) for problem, members in by_problem(records).items()}
    families = list(by_family([record for record in records if record.case.ensemble is None]))
    rows = {
        problem: {family: _outcome(members.get(family, [])) for family in families}
        for problem, members in here.items()
    }
    return families, rows


def reason_of(record: Record) -> str:
    """Return one sentence on why a case did not reach the end on its trajectory; empty if it did."""
    result = record.result
    if group_of(record) == "on":
        return ""
    if group_of(record) == "off":
        return result.violation
    status = status_of(record)
    return f"{status}: {result.reason}" if result.reason else status


def _outcome(records: Sequence[Record]) -> Outcome:
    states: list[State] = [_state(record) for record in records]
    said: dict[str, list[str]] = {}
    for record, state in zip(records, states, strict=True):
        if state != "ok":
            said.setdefault(reason_of(record), []).append(record.case.method)
    reasons = [reason if _same(records) else f"{', '.join(who)}: {reason}" for reason, who in said.items()]
    best: State = "absent"
    for state in reversed(ORDER):
        best = state if state in states else best
    return Outcome(best, states.count("ok"), len(states), reasons)


def _same(records: Sequence[Record]) -> bool:
    return len({reason_of(record) for record in records}) == 1


def _state(record: Record) -> State:
    if record.result.outcome == "refused":
        return "refused"
    states: dict[str, State] = {"on": "ok", "off": "off", "ended": "ended"}
    return states[group_of(record)]
