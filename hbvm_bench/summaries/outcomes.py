"""Which integrator did what on which problem: a matrix with reasons."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import by_family, by_problem, singles
from hbvm_bench.summaries.rows import group_of, reason_of
from hbvm_bench.summaries.table import Table

State = Literal["on", "off", "ended", "refused", "absent"]

SIGNS: dict[State, str] = {"on": "●", "off": "◐", "ended": "○", "refused": "–", "absent": ""}
"""From best to worst."""


class Outcome(NamedTuple):
    """What became of all settings of a family on a problem."""

    state: State  # the best that any of them did, a key of `SIGNS`
    reached: int  # settings that reached the end on the trajectory
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
    families, found = matrix(records)
    if len(found) < 2:
        return None
    reasons = [
        f"{problem}, {family}: {reason}"
        for problem, row in found.items()
        for family, one in row.items()
        for reason in one.reasons
        if reason
    ]
    made = Table(
        "Which integrator on which problem",
        ("problem", *families),
        [(problem, *map(_sign, row.values())) for problem, row in found.items()],
        "● reached the end on its trajectory; ◐ on another one; ○ did not reach the end; – refused. "
        "Numbers: how many of its settings reached the end, where not all did.",
    )
    return made, reasons


def _sign(one: Outcome) -> str:
    some = one.state == "on" and one.reached < one.settings
    return SIGNS[one.state] + (f" {one.reached}/{one.settings}" if some else "")


def _outcome(records: Sequence[Record]) -> Outcome:
    states: list[State] = []
    said: dict[str, list[str]] = {}
    for record in records:
        states.append("refused" if record.result.outcome == "refused" else group_of(record))
        if states[-1] != "on":
            said.setdefault(reason_of(record), []).append(record.case.method)
    same = len({reason_of(record) for record in records}) == 1
    reasons = [reason if same else f"{', '.join(who)}: {reason}" for reason, who in said.items()]
    found: list[State] = [state for state in SIGNS if state in states]
    return Outcome(found[0] if found else "absent", states.count("on"), len(states), reasons)
