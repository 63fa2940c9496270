"""The tables of a race, as text cells: the terminal and both reports print these."""

import math
from collections.abc import Mapping, Sequence
from statistics import median

from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Spread
from hbvm_bench.store.records import Record
from hbvm_bench.studies.race.families import FAMILIES, OURS, FamilyRow
from hbvm_bench.studies.race.probe import Probe
from hbvm_bench.studies.race.results import ERRORS, Race, counts
from hbvm_bench.summaries import accuracies, compilations, outcomes, standings
from hbvm_bench.summaries.goals import ratio_text
from hbvm_bench.summaries.goals import table as goals_table
from hbvm_bench.summaries.rows import format_metric, group_of, seconds, status_of
from hbvm_bench.summaries.standings import SettingComparison
from hbvm_bench.summaries.table import NONE, Table

LEVELS = tuple(10.0**-digits for digits in range(8, 15))
POSITION_OVER_ENERGY = 1e3
"""At each level the position error may be this much larger than the energy error, as in the targets."""

SHOWN = (*ERRORS, "steps", "evaluations")

CACHES = {
    "empty": "nothing",
    "kernel": "the kernel, not this problem",
    "full": "everything",
}


def headline(races: Sequence[Race]) -> Table:
    """Return the ratios of the libraries' best times to those of HBVM and Gauss at the required accuracy."""
    ours = [row for row in dict.fromkeys(row for race in races for row in race.rows) if row.family == OURS]
    peers = [f for f in FAMILIES if f != OURS and any(f in race.families for race in races)]
    rows = []
    for race in races:
        energy, position = race.asked
        best = (race.best(row, energy, position) for row in ours)
        rows.append(
            (
                race.title,
                f"{power(energy)}, {power(position)}",
                *("not reached" if record is None else time_of(record) for record in best),
                *(_headline_cell(race, peer, race.at(peer, energy, position)) for peer in peers),
            )
        )
    return Table(
        "Time of each library's fastest setting relative to the fastest of HBVM and Gauss, at the same "
        "accuracy",
        (
            "problem",
            "energy, position",
            *(f"HBVM and Gauss, {row.steps}" for row in ours),
            *(FAMILIES[peer].short for peer in peers),
        ),
        rows,
        "A ratio compares the fastest of the same number of settings of every family: of HBVM and Gauss and "
        "of IAS15, which have a fixed and an adaptive step size, every second setting of either kind takes "
        "part, in the order of declaration. The two columns of times are chosen from all settings of their "
        "kind. Median of the ratio within each interleaved round, in brackets its quartiles. Below 1 the "
        "other library is faster. Not reached: no declared setting is as accurate; a smaller step or "
        "tolerance may be.",
    )


def behind(races: Sequence[Race]) -> Table:
    """Return the settings whose times `headline` compares."""
    peers = [f for f in FAMILIES if f != OURS and any(race.best(f, *race.asked) for race in races)]
    rows = []
    for race in races:
        best = (race.best(family, *race.asked) for family in (OURS, *peers))
        rows.append((race.title, *(NONE if record is None else record.case.method for record in best)))
    return Table(
        "The settings behind these ratios",
        ("problem", "HBVM and Gauss", *(FAMILIES[peer].short for peer in peers)),
        rows,
        words=range(len(peers) + 2),
    )


def overview(races: Sequence[Race]) -> Table:
    """Return the fastest setting on every problem, and the best times of all methods relative to it."""
    shown = ("HBVM", "Gauss", *(f for f in FAMILIES if f != OURS))
    rows = []
    for race, title in zip(races, short([race.title for race in races]), strict=True):
        within: dict[str, float] = dict(zip(ERRORS, race.asked, strict=True))
        able = {
            record: standings.among(race.records, record) for record in ("HBVM", "Gauss")
        } | race.competing
        best = {name: standings.best(able.get(name, []), within) for name in shown}
        first = standings.best([record for record in best.values() if record is not None], within)
        if first is None:
            continue
        cells = [
            NONE if record is None else "1" if record is first else _relative(first, record)
            for record in best.values()
        ]
        rows.append((title, first.case.method, time_of(first).partition(" (")[0], *cells))
    kept = [i for i in range(3 + len(shown)) if any(row[i] != NONE for row in rows)]
    head = ("problem", "fastest setting", "time", "HBVM", "Gauss", *(FAMILIES[f].short for f in shown[2:]))
    return Table(
        "The fastest setting, and the time of each method relative to it",
        tuple(head[i] for i in kept),
        [tuple(row[i] for i in kept) for row in rows],
        "At the accuracy named in the next table; HBVM and Gauss are chosen from 15 to 17 settings each, "
        "the others from 16. Some rounds chose the setting, the others are compared: it can be below 1. The "
        "ratios of the next table are smaller where HBVM and Gauss together have as many settings as "
        "another library.",
        words=(0, 1),
    )


def short(titles: Sequence[str]) -> list[str]:
    """Return as much of every title as tells it from the others: what is before its first or second comma."""
    begun = [title.split(",")[0] for title in titles]
    return [
        title_ if begun.count(title_) == 1 else ",".join(title.split(",")[:2])
        for title_, title in zip(begun, titles, strict=True)
    ]


def _relative(first: Record, other: Record) -> str:
    return ratio_text(standings.compare(first, other, chosen=True).ratio).partition(" (")[0].rstrip("×")


def kinds(by_kind: Mapping[str, Sequence[Race]]) -> Table:
    """Return the ratios of the best times, one column for each kind of processor."""
    keys = dict.fromkeys(race.key for races in by_kind.values() for race in races)
    rows = []
    for key in keys:
        of_kind = {kind: race for kind, races in by_kind.items() for race in races if race.key == key}
        shown = {peer: None for race in of_kind.values() for peer in race.families if peer != OURS}
        for peer in shown:
            cells = [
                _headline_cell(race, peer, race.at(peer, *race.asked))
                if (race := of_kind.get(kind)) is not None
                else "not run"
                for kind in by_kind
            ]
            if any(cell.endswith((")", "×")) for cell in cells):
                first = next(iter(of_kind.values()))
                rows.append((first.title, FAMILIES[peer].short, *cells))
    return Table(
        "The same ratios by kind of processor",
        ("problem", "peer", *by_kind),
        rows,
        "Time of each library's fastest setting relative to the fastest of HBVM and Gauss. "
        + machine.COLUMNS
        + " Left out: libraries without a ratio on any problem.",
        words=(0, 1),
    )


def goals(races: Sequence[Race]) -> Table:
    """Return what was asked for before, and what was measured."""
    return goals_table([verdict for race in races for verdict in race.goals])


def fastest(race: Race) -> Table:
    """Return the fastest setting of every family at the accuracy asked for."""
    energy, position = race.asked
    ours = race.best(OURS, energy, position)
    rows = []
    for row in race.rows:
        best = race.best(row, energy, position)
        if best is None:
            rows.append((row.title, _why_none(race, row), *[NONE] * 6))
            continue
        ratio = "1" if best is ours else ratio_text(standings.compare(ours, best, chosen=True).ratio)
        rows.append(
            (
                row.title,
                best.case.method,
                time_of(best),
                *(format_metric(best, key) for key in SHOWN),
                ratio,
            )
        )
    return Table(
        f"The fastest settings with energy error ≤ {power(energy)} and position error ≤ {power(position)}",
        ("family", "setting", "time", "energy", "position", "steps", "evaluations", "× HBVM and Gauss"),
        rows,
        "× HBVM and Gauss: relative to the fastest of their settings that compete with the other families.",
        words=(0, 1),
    )


def compiled(race: Race) -> Table | None:
    """Return the compilations of the fastest settings that compete; ``None`` where there is one of each."""
    best = {family: race.best(family, *race.asked) for family in race.families}
    names = {family: compilations.OURS if family == OURS else FAMILIES[family].short for family in best}
    return compilations.of_settings([(race.title, {names[f]: record for f, record in best.items()})])


def levels(race: Race) -> Table:
    """Return the same at looser and tighter accuracy."""
    pairs = [(energy, energy * POSITION_OVER_ENERGY) for energy in LEVELS]
    return _at_levels(
        race,
        "At other accuracies",
        "energy, position ≤",
        {f"{power(energy)}, {power(position)}": (energy, position) for energy, position in pairs},
    )


def positions(race: Race) -> Table | None:
    """Return the same at position errors from loose to tight; ``None`` where no setting reaches any."""
    asked = {power(position): (math.inf, position) for position in accuracies.LEVELS}
    reached = {
        name: errors for name, errors in asked.items() if any(race.best(f, *errors) for f in race.families)
    }
    if not reached:
        return None
    return _at_levels(
        race,
        "By position error, whatever the energy error",
        "position ≤",
        reached,
        "A level that no setting of any library reaches has no row.",
    )


def _at_levels(
    race: Race, caption: str, head: str, asked: Mapping[str, tuple[float, float]], note: str = ""
) -> Table:
    """Return the fastest of HBVM and Gauss, and the other libraries relative to it, at several accuracies."""
    peers = [family for family in race.families if family != OURS]
    rows = []
    for name, errors in asked.items():
        ours = race.best(OURS, *errors)
        rows.append(
            (
                name,
                ours.case.method if ours else "not reached",
                time_of(ours) if ours else NONE,
                *(_level_cell(race.at(peer, *errors)) for peer in peers),
            )
        )
    return Table(
        caption,
        (
            head,
            "fastest of HBVM and Gauss",
            "time",
            *(f"{FAMILIES[p].short} × HBVM and Gauss" for p in peers),
        ),
        rows,
        note,
        words=(0, 1),
    )


def defaults(race: Race) -> Table | None:
    """Return the default settings beside the fastest of HBVM and Gauss that is as accurate, or ``None``."""
    rows = []
    for family in race.families:
        comparison = standings.untuned(race.records, family, ERRORS)
        if comparison.theirs is None:
            continue
        ours = comparison.ours
        rows.append(
            (
                comparison.theirs.case.method,
                time_of(comparison.theirs),
                *(format_metric(comparison.theirs, key) for key in ERRORS),
                ours.case.method if ours else "none is as accurate",
                time_of(ours) if ours else NONE,
                ratio_text(comparison.ratio),
            )
        )
    if not rows:
        return None
    return Table(
        "At the libraries' defaults, against the fastest setting of HBVM and Gauss that is no less "
        "accurate in energy and position",
        ("default", "time", "energy", "position", "HBVM and Gauss", "time", "× HBVM and Gauss"),
        rows,
        "HBVM and Gauss are chosen from all their settings, the other libraries are not.",
        words=(0, 4),
    )


def compiling(race: Race) -> Table | None:
    """Return the compile times in fresh processes; ``None`` without any, or measured beside other work."""
    if not race.probes or outcomes.busy(race.records):
        return None
    return Table(
        "Before the first result, in a fresh process",
        ("method", "on disk before", "compiling", "whole process"),
        [
            (probe.method, CACHES.get(probe.caches, probe.caches), *_probe_cells(probe))
            for probe in race.probes
        ],
        "Medians. The whole process includes starting Python and importing everything.",
        words=(0, 1),
    )


def everything(race: Race) -> Table:
    """Return every setting that was declared."""
    rows = []
    for record in race.records:
        result, timing = record.result, record.timing
        remark = result.violation or result.reason or (timing.why if timing is not None else "did not finish")
        status = "" if group_of(record) != "ended" else status_of(record)
        rows.append(
            (
                record.case.method,
                time_of(record),
                *(format_metric(record, key) for key in SHOWN),
                seconds(timing.call) if timing is not None and timing.call else NONE,
                ": ".join(part for part in (status, remark) if part),
            )
        )
    return Table(
        f"All {len(rows)} settings, as declared before the run",
        ("setting", "time", "energy", "position", "steps", "evaluations", "call", "remark"),
        rows,
        "Time: median of a run, with its quartiles. Call: a run over a negligible interval, which bounds "
        "the overhead in each time. Brackets: excluded.",
        words=(0, 7),
    )


def power(value: float) -> str:
    """Write an error level: ``1e-13``."""
    return f"{value:.0e}"


def time_of(record: Record) -> str:
    """Write the median time of a run with its quartiles."""
    taken = record.timing.samples if record.timing is not None else []
    if not taken:
        return NONE
    time = Spread.from_samples(taken)
    spread = "" if time.low is None or time.high is None else f" ({seconds(time.low)} – {seconds(time.high)})"
    return f"{seconds(time.median)}{spread}"


def _headline_cell(race: Race, peer: str, comparison: SettingComparison) -> str:
    if peer not in race.families:
        return NONE
    if comparison.theirs is None:
        return _why_none(race, peer)
    return (
        ratio_text(comparison.ratio) if comparison.ours is not None else "reached only by the other library"
    )


def _level_cell(comparison: SettingComparison) -> str:
    if comparison.theirs is None:
        return "not reached"
    return (
        ratio_text(comparison.ratio) if comparison.ours is not None else f"{time_of(comparison.theirs)} alone"
    )


def _why_none(race: Race, who: str | FamilyRow) -> str:
    records = race.settings(who)
    if records and all(record.result.outcome == "refused" for record in records):
        return "does not apply"
    if records and not any(counts(record) for record in records):
        return "no valid run"
    return "not reached"


def _probe_cells(probe: Probe) -> tuple[str, str]:
    if probe.reason or not probe.compile_seconds:
        return probe.reason or NONE, NONE
    return seconds(median(probe.compile_seconds)), seconds(median(probe.process_seconds))
