"""Times by compilation: median and spread of each library's fastest setting, and its best beside them."""

from collections.abc import Sequence
from statistics import median

from hbvm_bench.campaign.file import Campaign
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.outcomes import by_compilation
from hbvm_bench.summaries.points import by_family, is_hbvm_or_gauss
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import NONE, Table

OURS = "HBVM and Gauss"


def table(campaign: Campaign, records: Sequence[Record]) -> Table | None:
    """Return the times of the compilations of each library's fastest setting, problem by problem.

    Of the settings that reach what the problem asks for. ``None`` where nothing was compiled several times.
    """
    rows = []
    for entry, here in standings.entries(campaign, records):
        libraries = {OURS: standings.among(here, "")} | by_family(
            [setting for setting in here if not is_hbvm_or_gauss(setting)]
        )
        fastest = {name: standings.best(those, entry.within) for name, those in libraries.items()}
        times = {name: by_compilation(setting) for name, setting in fastest.items() if setting is not None}
        ours = min(times.get(OURS, []), default=None)
        for name, table_rows in times.items():
            if len(table_rows) < 2:
                continue
            record = fastest[name]
            best = min(table_rows)
            rows.append(
                (
                    standings.title_of(entry),
                    name,
                    NONE if record is None else record.case.method,
                    f"{len(table_rows)}",
                    seconds(median(table_rows)),
                    seconds(best),
                    f"{max(table_rows) / best:.2f}",
                    NONE if ours is None else f"{best / ours:.3g}×",
                )
            )
    if not rows:
        return None
    return Table(
        "The best of the compilations beside their median",
        (
            *("problem", "library", "fastest setting", "compilations"),
            *("median", "best", "slowest over best", "best over best of HBVM and Gauss"),
        ),
        rows,
        "Each compilation, in a fresh process with empty caches, has the median of its samples. The same "
        "code may be slower where it lies otherwise in memory: the best compilation is what a library can "
        "reach.",
        words=(0, 1, 2),
        key="compilations",
    )
