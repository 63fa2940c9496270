"""HBVM that chooses everything itself against heyoka's Taylor method: no setting on our side.

Results of several kinds of processor lie side by side, one file each::

    DIR/<kind>.json     e.g. znver4-256bit.json, znver4-256bit-avx2.json
    DIR/README.md       all of them, one column for each kind, and index.html the same
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hbvm_bench.campaign.file import Campaign, load
from hbvm_bench.campaign.shorter import chosen, with_rounds
from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Spread
from hbvm_bench.store import kept
from hbvm_bench.store.kept import Kept
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.rows import status_of
from problems.errors import InputError

NAME = "automatic"


@dataclass(frozen=True)
class Duel:
    """What came out on one problem, against the goal on it.

    Attributes
    ----------
    verdict : Verdict
        On the goal.
    ours, theirs : Record
        Both cases, whether they are as accurate as was asked for or not.
    """

    verdict: Verdict
    ours: Record
    theirs: Record

    @property
    def problem(self) -> str:
        """The problem, as the campaign writes it."""
        return self.theirs.case.problem

    @property
    def goal(self) -> float:
        """How many times as long the Taylor method should take."""
        return self.verdict.goal.ratio or 0.0

    @property
    def ratio(self) -> Spread | None:
        """Their time over ours within each round."""
        return standings.compare(self.ours, self.theirs).ratio

    @property
    def words(self) -> str:
        """``reached``, ``missed``, ``not as accurate``, or why there is no ratio."""
        if self.ratio is None:
            return next(
                (status_of(one) for one in (self.ours, self.theirs) if not one.timing), "not compared"
            )
        accurate = self.verdict.comparison.ours is not None
        return self.verdict.verdict if accurate else "not as accurate"


def campaign(names: Sequence[str], rounds: int | None = None) -> Campaign:
    """Return the campaign, or a part of it.

    Raises
    ------
    problems.errors.InputError
        For an unknown name, or fewer than two rounds.
    """
    if rounds is not None and rounds < 2:
        raise InputError(f"rounds must be at least 2, not {rounds}.")
    return with_rounds(chosen(load(NAME), list(names)), rounds)


def keep(run: Kept, directory: Path) -> None:
    """Write a run beside those of other kinds of processor; see `hbvm_bench.store.kept.keep`."""
    kept.keep(run, directory / f"{machine.kind(run.machine)}.json", NAME)


def by_kind(directory: Path) -> dict[str, list[Kept]]:
    """Return the runs in a directory by the kind of processor."""
    return {path.stem: kept.load(path, NAME) for path in sorted(directory.glob("*.json"))}


def duels(run: Kept) -> list[Duel]:
    """Return what came out, problem by problem."""
    found = []
    for verdict in verdicts(run.index.campaign, run.records):
        ours = standings.among(verdict.records, "")
        theirs = standings.among(verdict.records, verdict.goal.against)
        if ours and theirs:
            found.append(Duel(verdict, ours[0], theirs[0]))
    return found
