"""Parts of a campaign: some of its problems, or a quick run of it."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from msgspec.structs import replace

from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Campaign, Goal, MethodEntry, ProblemEntry, name_of, text_of
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.spec import Spec, parse_spec
from hbvm_bench.campaign.sweep import fill
from hbvm_bench.reference import solutions
from problems.errors import unknown

T = TypeVar("T", MethodEntry, Goal)

QUICK_SHARE = 0.1
"""Of the interval, or of an ensemble's trajectories, in a quick run."""

QUICK_ROUNDS = 3


def chosen(campaign: Campaign, names: list[str]) -> Campaign:
    """Return a campaign with these of its problems, in its order; all for none.

    Raises
    ------
    problems.errors.UnknownNameError
        For a name that it does not have, with the nearest ones.
    """
    known = [name_of(entry) for entry in campaign.entries()]
    for name in names:
        if name not in known:
            raise unknown(f"problem of {campaign.name}", name, known)
    kept = [entry for entry in campaign.entries() if not names or name_of(entry) in names]
    here = {name_of(entry) for entry in kept}

    def of_these(entries: Sequence[T]) -> list[T]:
        pairs = ((entry, [name for name in entry.only if name in here]) for entry in entries)
        return [replace(entry, only=only) for entry, only in pairs if only or not entry.only]

    return replace(
        campaign, problems=kept, methods=of_these(campaign.methods), goals=of_these(campaign.goals)
    )


def with_rounds(campaign: Campaign, rounds: int | None) -> Campaign:
    """Return a campaign with another number of rounds of timing; with its own for ``None``.

    Every compilation keeps at least two rounds.
    """
    if not rounds:
        return campaign
    compilations = max(1, min(campaign.timing.compilations, rounds // 2))
    front = campaign.timing.front and compilations > 1
    timing = replace(campaign.timing, rounds=rounds, compilations=compilations, front=front)
    return replace(campaign, timing=timing)


def quick_run(campaign: Campaign) -> Campaign:
    """Return a campaign over a tenth of each interval, with the settings marked for it and fewer rounds.

    Of ensembles, a tenth of the trajectories.
    """
    short = replace(
        campaign,
        problems=[_shortened(entry) for entry in campaign.entries()],
        ensembles=[
            replace(ensemble, count=max(1, int(QUICK_SHARE * ensemble.count)))
            for ensemble in campaign.ensembles
        ],
        quick=True,
    )
    return with_rounds(short, min(campaign.timing.rounds, QUICK_ROUNDS))


def _shortened(entry: ProblemEntry) -> ProblemEntry:
    """Return an entry without a sweep, ended near a tenth of its interval at a state of its reference.

    A problem in a Python file keeps its interval: its function need not take another.
    """
    if own.is_file(text_of(entry)):
        return entry
    text = fill(entry.use, entry.values)
    problem, spec = make_problem(text), parse_spec(text)
    end = problem.t0 + QUICK_SHARE * (problem.t_end - problem.t0)
    known = solutions.find(problem)
    if known is not None and known.t.size > 1:
        end = float(known.t[1 + np.argmin(np.abs(known.t[1:] - end))])
    return replace(
        entry, use=str(Spec(spec.name, spec.arguments | {"t_end": end})), name=name_of(entry), end=None
    )
