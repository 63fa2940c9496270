"""The tables of a race, as text cells: the terminal and both reports print these."""

from collections.abc import Mapping, Sequence
from statistics import median

from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Spread
from hbvm_bench.studies.race import standings
from hbvm_bench.studies.race.results import Outcome, Probe, Race
from hbvm_bench.studies.race.settings import FAMILIES, OURS
from hbvm_bench.studies.race.standings import LEVELS, POSITION_OVER_ENERGY, Comparison
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import NONE, Table

CACHES = {
    "empty": "nothing",
    "kernel": "our kernel, not this problem",
    "full": "everything",
}


def headline(races: Sequence[Race]) -> Table:
    """Return every contest at the accuracy it asks for: the peers' best times over ours."""
    peers = [f for f in FAMILIES if f != OURS and any(f in standings.present(race) for race in races)]
    rows = []
    for race in races:
        energy, position = asked(race)
        ours = standings.best(race, OURS, energy, position)
        rows.append(
            (
                race.contest.title,
                f"{power(energy)}, {power(position)}",
                time_of(ours) if ours else "not reached",
                *(_headline_cell(race, peer, standings.at(race, peer, energy, position)) for peer in peers),
            )
        )
    return Table(
        "How many times as long as our fastest setting each peer's fastest takes, at the same accuracy",
        ("problem", "energy, position", "ours", *(FAMILIES[peer].short for peer in peers)),
        rows,
        "The median of the ratio within each interleaved round, in brackets its quartiles. A ratio below 1 "
        "means that the peer is faster.",
    )


def behind(races: Sequence[Race]) -> Table:
    """Return the settings whose times `headline` compares."""
    peers = [
        f for f in FAMILIES if f != OURS and any(standings.best(race, f, *asked(race)) for race in races)
    ]
    rows = []
    for race in races:
        best = (standings.best(race, family, *asked(race)) for family in (OURS, *peers))
        rows.append((race.contest.title, *(NONE if one is None else one.setting.method for one in best)))
    return Table(
        "The settings behind these ratios",
        ("problem", "ours", *(FAMILIES[peer].short for peer in peers)),
        rows,
        words=range(len(peers) + 2),
    )


def kinds(by_kind: Mapping[str, Sequence[Race]]) -> Table:
    """Return the peers' best times over ours, one column for each kind of processor."""
    keys = dict.fromkeys(race.contest.key for races in by_kind.values() for race in races)
    rows = []
    for key in keys:
        of_kind = {kind: race for kind, races in by_kind.items() for race in races if race.contest.key == key}
        shown = {peer: None for race in of_kind.values() for peer in standings.present(race) if peer != OURS}
        for peer in shown:
            cells = [
                _headline_cell(race, peer, standings.at(race, peer, *asked(race)))
                if (race := of_kind.get(kind)) is not None
                else "not run"
                for kind in by_kind
            ]
            if any(cell.endswith((")", "×")) for cell in cells):
                first = next(iter(of_kind.values()))
                rows.append((first.contest.title, FAMILIES[peer].short, *cells))
    return Table(
        "The same ratios by kind of processor",
        ("problem", "peer", *by_kind),
        rows,
        "How many times as long as our fastest setting each peer's fastest takes. "
        + machine.COLUMNS
        + " Left out: peers without a ratio anywhere.",
        words=(0, 1),
    )


def goals(races: Sequence[Race]) -> Table:
    """Return what the project asked of itself before, and what was measured."""
    rows = []
    for race in races:
        for goal in race.contest.goals:
            found = standings.verdict(race, goal)
            position = "no worse than the peer's" if goal.position is None else power(goal.position)
            rows.append(
                (
                    race.contest.title,
                    FAMILIES[goal.family].short,
                    f"{power(goal.energy)}, {position}",
                    f"≥ {goal.ratio:g}",
                    ratio_text(found.comparison.ratio),
                    "reached" if found.reached else "missed",
                )
            )
    return Table(
        "Goals declared before the race",
        ("problem", "peer", "energy, position", "goal", "measured", "verdict"),
        rows,
        words=(0, 1, 5),
    )


def fastest(race: Race) -> Table:
    """Return the fastest setting of every family at the accuracy asked for."""
    energy, position = asked(race)
    ours = standings.best(race, OURS, energy, position)
    rows = []
    for family in standings.present(race):
        found = standings.best(race, family, energy, position)
        name = FAMILIES[family].title
        if found is None:
            rows.append((name, _why_none(race, family), *[NONE] * 6))
            continue
        ratio = "1" if family == OURS else ratio_text(standings.compare(ours, found).ratio)
        rows.append(
            (
                name,
                found.setting.method,
                time_of(found),
                error(found.energy),
                error(found.position),
                count(found.steps),
                count(found.evaluations),
                ratio,
            )
        )
    return Table(
        f"The fastest settings with energy error ≤ {power(energy)} and position error ≤ {power(position)}",
        ("family", "setting", "time", "energy", "position", "steps", "evaluations", "× ours"),
        rows,
        words=(0, 1),
    )


def levels(race: Race) -> Table:
    """Return the same at looser and tighter accuracy."""
    peers = [family for family in standings.present(race) if family != OURS]
    rows = []
    for level in LEVELS:
        position = level * POSITION_OVER_ENERGY
        ours = standings.best(race, OURS, level, position)
        rows.append(
            (
                f"{power(level)}, {power(position)}",
                ours.setting.method if ours else "not reached",
                time_of(ours) if ours else NONE,
                *(_level_cell(standings.at(race, peer, level, position)) for peer in peers),
            )
        )
    return Table(
        "At other accuracies",
        ("energy, position ≤", "our fastest", "time", *(f"{FAMILIES[p].short} × ours" for p in peers)),
        rows,
        words=(0, 1),
    )


def defaults(race: Race) -> Table | None:
    """Return the peers at their defaults beside the fastest of ours that is as accurate; ``None`` without."""
    rows = []
    for family in standings.present(race):
        found = standings.untuned(race, family)
        if found.theirs is None:
            continue
        ours = found.ours
        rows.append(
            (
                found.theirs.setting.method,
                time_of(found.theirs),
                error(found.theirs.energy),
                error(found.theirs.position),
                ours.setting.method if ours else "none is as accurate",
                time_of(ours) if ours else NONE,
                ratio_text(found.ratio),
            )
        )
    if not rows:
        return None
    return Table(
        "At the libraries' defaults, against the fastest of ours that is no worse in energy nor in position",
        ("default", "time", "energy", "position", "ours", "time", "× ours"),
        rows,
        "A fixed step has no default: ours is chosen, theirs is not.",
        words=(0, 4),
    )


def compiling(race: Race) -> Table | None:
    """Return the compile times in fresh processes; ``None`` where they were not measured."""
    if not race.probes:
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
    for outcome in race.outcomes:
        remark = outcome.void or outcome.reason or outcome.untimed
        status = "" if outcome.status == "finished" else outcome.status.replace("_", " ")
        rows.append(
            (
                outcome.setting.method,
                time_of(outcome),
                error(outcome.energy, void=bool(outcome.void)),
                error(outcome.position, void=bool(outcome.void)),
                count(outcome.steps),
                count(outcome.evaluations),
                seconds(outcome.call_seconds) if outcome.call_seconds else NONE,
                ": ".join(part for part in (status, remark) if part),
            )
        )
    return Table(
        f"All {len(rows)} settings, as declared before the run",
        ("setting", "time", "energy", "position", "steps", "evaluations", "call", "remark"),
        rows,
        "Time: median of a run, with its quartiles. Call: a run that goes next to nowhere, which bounds the "
        "overhead in each time. Brackets: void.",
        words=(0, 7),
    )


def asked(race: Race) -> tuple[float, float]:
    """Return the energy and position errors that a contest asks for."""
    return race.contest.energy, race.contest.position


def ratio_text(ratio: Spread | None) -> str:
    """Write a ratio with its quartiles."""
    if ratio is None:
        return NONE
    spread = "" if ratio.low is None or ratio.high is None else f" ({number(ratio.low)}–{number(ratio.high)})"
    return f"{number(ratio.median)}×{spread}"


def number(value: float) -> str:
    """Write a ratio with two or three digits."""
    return f"{value:.0f}" if value >= 99.5 else f"{value:.1f}" if value >= 9.95 else f"{value:.2f}"


def power(value: float) -> str:
    """Write an error level: ``1e-13``."""
    return f"{value:.0e}"


def error(value: float | None, *, void: bool = False) -> str:
    """Write an error; void ones in brackets."""
    if value is None:
        return NONE
    text = "0" if value == 0 else f"{value:.1e}"
    return f"({text})" if void else text


def count(value: int | None) -> str:
    """Write a counter in groups of three digits."""
    return NONE if value is None else f"{value:,}".replace(",", "\u202f")


def time_of(outcome: Outcome) -> str:
    """Write the median time of a run with its quartiles."""
    time = outcome.time
    if time is None:
        return NONE
    spread = "" if time.low is None or time.high is None else f" ({seconds(time.low)} – {seconds(time.high)})"
    return f"{seconds(time.median)}{spread}"


def _headline_cell(race: Race, peer: str, found: Comparison) -> str:
    if peer not in standings.present(race):
        return NONE
    if found.theirs is None:
        return _why_none(race, peer)
    return ratio_text(found.ratio) if found.ours is not None else "only the peer reaches it"


def _level_cell(found: Comparison) -> str:
    if found.theirs is None:
        return "not reached"
    return ratio_text(found.ratio) if found.ours is not None else f"{time_of(found.theirs)} alone"


def _why_none(race: Race, family: str) -> str:
    outcomes = [o for o in race.outcomes if o.setting.family == family]
    if outcomes and all(o.status == "refused" for o in outcomes):
        return "does not apply"
    if outcomes and all(not o.counts for o in outcomes):
        return "no valid run"
    return "not reached"


def _probe_cells(probe: Probe) -> tuple[str, str]:
    if probe.reason or not probe.compile_seconds:
        return probe.reason or NONE, NONE
    return seconds(median(probe.compile_seconds)), seconds(median(probe.process_seconds))
