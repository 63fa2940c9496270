"""HBVM that chooses everything itself against heyoka's Taylor method: no setting on our side.

Results of several kinds of processor lie side by side, one file each::

    DIR/<kind>.json     e.g. znver4-256bit.json, znver4-256bit-avx2.json
    DIR/README.md       all of them, one column for each kind, and index.html the same
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace

from hbvm_bench.campaign.file import Campaign, load
from hbvm_bench.campaign.shorter import chosen
from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Spread
from hbvm_bench.store import kept
from hbvm_bench.store.kept import Kept
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.points import accurate
from hbvm_bench.summaries.rows import status_of
from hbvm_bench.summaries.table import NONE
from problems.errors import InputError

NAME = "automatic"
AGAINST = "Taylor"
NO_WORSE = {"energy_max": 1.0, "position_mean": 1.0}
"""Our errors are at most so many times theirs where a ratio is compared."""


@dataclass(frozen=True)
class Duel:
    """What came out on one problem, against the goal on it, where there is one.

    Attributes
    ----------
    verdict : Verdict or None
        On the goal; ``None`` where none was declared.
    ours, theirs : Record
        Both cases, whether they are as accurate as was asked for or not.
    """

    verdict: Verdict | None
    ours: Record
    theirs: Record

    @property
    def problem(self) -> str:
        """The problem, as the campaign writes it."""
        return self.theirs.case.problem

    @property
    def goal(self) -> str:
        """How many times as long the Taylor method should take."""
        return NONE if self.verdict is None else self.verdict.asked

    @property
    def ratio(self) -> Spread | None:
        """Their time over ours within each round."""
        return standings.compare(self.ours, self.theirs).ratio

    @property
    def words(self) -> str:
        """``reached``, ``missed``, ``not as accurate``, or why there is no ratio; ``""`` without a goal."""
        if self.ratio is None:
            return next(
                (status_of(one) for one in (self.ours, self.theirs) if not one.timing), "not compared"
            )
        if not accurate(self.ours, standings.no_worse(self.theirs, NO_WORSE)):
            return "not as accurate"
        return "" if self.verdict is None else self.verdict.verdict


def campaign(names: Sequence[str], rounds: int | None = None) -> Campaign:
    """Return the campaign, or a part of it.

    Raises
    ------
    problems.errors.InputError
        For an unknown name, or fewer than two rounds.
    """
    made = chosen(load(NAME), list(names))
    if rounds is None:
        return made
    if rounds < 2:
        raise InputError(f"rounds must be at least 2, not {rounds}.")
    return replace(made, timing=replace(made.timing, rounds=rounds))


def keep(run: Kept, directory: Path) -> None:
    """Write a run beside those of other kinds of processor.

    Problems that were not run this time are kept from the file of the same kind, with the
    machine, the versions, the command and the date that they were measured with.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written, or what lies there is no result.
    """
    kept.keep(run, directory / f"{machine.kind(run.machine)}.json", NAME)


def by_kind(directory: Path) -> dict[str, list[Kept]]:
    """Return the runs in a directory by the kind of processor."""
    return {path.stem: kept.load(path, NAME) for path in sorted(directory.glob("*.json"))}


def duels(run: Kept) -> list[Duel]:
    """Return what came out, problem by problem."""
    campaign, found = run.index.campaign, []
    judged = {verdict.entry.use: verdict for verdict in verdicts(campaign, run.records)}
    for entry, records in standings.entries(campaign, run.records):
        ours, theirs = standings.among(records, ""), standings.among(records, AGAINST)
        if ours and theirs:
            found.append(Duel(judged.get(entry.use), ours[0], theirs[0]))
    return found
