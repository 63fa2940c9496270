"""Times by compilation: median and spread of each library's fastest setting, and its best beside them."""

from collections.abc import Mapping, Sequence
from statistics import median

from hbvm_bench.campaign.file import Campaign
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import accuracies, standings
from hbvm_bench.summaries.outcomes import by_compilation
from hbvm_bench.summaries.points import by_family, is_hbvm_or_gauss, number
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import NONE, Table

OURS = "HBVM and Gauss"
LOOSEST = {"position_end": accuracies.LEVELS[0]}
"""What a setting reaches where a problem asks for nothing."""
SPREAD = ("compilations", "median", "best", "slowest over best")
"""The columns of `spread`."""


def table(campaign: Campaign, records: Sequence[Record]) -> Table | None:
    """Return the times of the compilations of each library's fastest setting, problem by problem.

    Of the settings that reach what the problem asks for, or else `LOOSEST` where position errors are known.
    ``None`` where nothing was compiled several times.
    """
    fastest = []
    for entry, here in standings.entries(campaign, records):
        libraries = {OURS: standings.among(here, "")} | by_family(
            [setting for setting in here if not is_hbvm_or_gauss(setting)]
        )
        known = any(number(setting, key) is not None for setting in here for key in LOOSEST)
        within = entry.within or (LOOSEST if known else {})
        best = {name: standings.best(those, within) for name, those in libraries.items()}
        fastest.append((standings.title_of(entry), best))
    return of_settings(fastest)


def of_settings(fastest: Sequence[tuple[str, Mapping[str, Record | None]]]) -> Table | None:
    """Return the times of the compilations of given settings: by library, on each problem by its title.

    ``None`` where none of them was compiled several times.
    """
    rows = []
    for title, by_library in fastest:
        times = {name: by_compilation(record) for name, record in by_library.items() if record is not None}
        ours = min(times.get(OURS, []), default=None)
        for name, record in by_library.items():
            if record is None or len(times[name]) < 2:
                continue
            relative = NONE if ours is None else f"{min(times[name]) / ours:.3g}×"
            rows.append((title, name, record.case.method, *spread(times[name]), relative))
    if not rows:
        return None
    return Table(
        "Best and median of the compilations",
        ("problem", "library", "fastest setting", *SPREAD, "best over best of HBVM and Gauss"),
        rows,
        "The fastest setting that reaches the errors that the problem asks for, or a position error of "
        f"{LOOSEST['position_end']:g} where it asks for none. "
        "Each compilation, in a fresh process with empty caches, has the median of its samples. The same "
        "code may be slower at other addresses in memory: the best compilation is what a library can "
        "reach.",
        words=(0, 1, 2),
        key="compilations",
    )


def spread(times: Sequence[float]) -> tuple[str, str, str, str]:
    """Return how often something was compiled, its median and best time, and the slowest over the best."""
    best = min(times)
    return f"{len(times)}", seconds(median(times)), seconds(best), f"{max(times) / best:.2f}"
