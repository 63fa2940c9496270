"""Times at several accuracies, from loose to tight: where another library is faster, and where it is not."""

from collections.abc import Sequence

from hbvm_bench.campaign.file import Campaign
from hbvm_bench.measure.timing import Spread
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import ratio_text
from hbvm_bench.summaries.points import by_family, is_hbvm_or_gauss
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import NONE, Table

LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)
"""Position errors at the end."""


def table(campaign: Campaign, records: Sequence[Record]) -> Table | None:
    """Return the time of each library's fastest setting at each accuracy, relative to HBVM and Gauss.

    ``None`` where no setting was timed that is accurate to any level.
    """
    titled = [(standings.title_of(entry), here) for entry, here in standings.entries(campaign, records)]
    others = [record for _, here in titled for record in here if not is_hbvm_or_gauss(record)]
    peers = list(by_family(others))
    rows = [
        (title, f"{level:g}", *_cells(here, level, peers))
        for title, here in titled
        for level in LEVELS
        if _fastest(here, level) is not None
    ]
    if not rows:
        return None
    return Table(
        "Time of each library's fastest setting relative to the fastest of HBVM and Gauss, by position error",
        ("problem", "position error ≤", "HBVM and Gauss", *peers),
        rows,
        "The fastest setting whose position error at the end is at most the level: the median of the ratio "
        "within the rounds, in brackets its quartiles. Below 1 the other library is faster. A time alone: "
        "neither HBVM nor Gauss is as accurate. –: no setting is as accurate, or the library does not apply. "
        "A level that no setting of any library reaches has no row.",
        words=(0,),
        key="times-at-accuracies",
    )


def _cells(records: Sequence[Record], level: float, peers: Sequence[str]) -> list[str]:
    ours = _fastest(standings.among(records, ""), level)
    cells = [NONE if ours is None else _time(ours)]
    for peer in peers:
        theirs = _fastest(standings.among(records, peer), level)
        if theirs is None:
            cells.append(NONE)
        elif ours is None:
            cells.append(_time(theirs))
        else:
            cells.append(ratio_text(standings.compare(ours, theirs, chosen=True).ratio))
    return cells


def _fastest(records: Sequence[Record], level: float) -> Record | None:
    return standings.best(records, {"position_end": level})


def _time(record: Record) -> str:
    return seconds(Spread.from_samples([*standings.by_round(record).values()]).median)
