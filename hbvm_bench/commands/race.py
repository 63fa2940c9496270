"""``hbvm-bench race``."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from msgspec.structs import replace
from rich.text import Text

from hbvm_bench.campaign.file import Campaign, name_of
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.campaign.shorter import QUICK_ROUNDS, chosen, quick_run
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.commands.listing import as_json as run_as_json
from hbvm_bench.commands.run import as_typed, carry_out
from hbvm_bench.measure import machine, reading
from hbvm_bench.report import terminal
from hbvm_bench.store import kept
from hbvm_bench.store.files import ensure_writable, write_json
from hbvm_bench.studies.race import results, tables
from hbvm_bench.studies.race.families import FIXED, OURS, row_of
from hbvm_bench.studies.race.probe import PROBES, Probe, load_probes, probe
from hbvm_bench.studies.race.results import Race
from hbvm_bench.summaries import goals


def race(
    context: typer.Context,
    problem: Annotated[
        list[str] | None, typer.Option("-p", "--problem", help="Only this problem; may be repeated.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A tenth of the spans and few settings.")] = False,
    rounds: Annotated[int | None, typer.Option(min=2, help="Interleaved rounds of timing.")] = None,
    compile_times: Annotated[
        bool | None,
        typer.Option("--compile/--no-compile", help="Compile times in fresh processes; not with --quick."),
    ] = None,
    avx2: Annotated[bool, typer.Option("--avx2", help=machine.AVX2)] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Where the results and the report go; default runs/race.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all results and ratios as JSON.")] = False,
    redraw: Annotated[
        bool, typer.Option("--redraw", help="Draw the report of --out again; run nothing.")
    ] = False,
    declare: Annotated[
        bool, typer.Option("--settings", help="Print the settings that would run, and nothing else.")
    ] = False,
) -> None:
    """Time our integrators against the peers, side by side, at equal energy and position error."""
    campaign = chosen(results.declared(), problem or [])
    keys = [name_of(entry) for entry in campaign.entries()]
    directory = out or Path("runs") / ("race" + "-quick" * quick + "-avx2" * avx2)
    campaign = quick_run(campaign, QUICK_ROUNDS) if quick else campaign
    if rounds:
        campaign = replace(campaign, timing=replace(campaign.timing, rounds=rounds))
    if declare:
        _declare(campaign, error=False)
        return
    if not redraw:
        os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
        ensure_writable(directory)
        _declare(campaign, error=True)
        store = carry_out(campaign, directory, as_typed(context))
        kept.keep(
            kept.of(store, results.NAME, reading.records(store)), directory / results.FILE, results.NAME
        )
        if not quick if compile_times is None else compile_times:
            _probe(campaign, directory)
    races = results.load(directory)
    if as_json:
        terminal.print_json(as_data(races))
    else:
        _show([one for one in races if one.key in keys])
    from hbvm_bench.commands.publishing import publish
    from hbvm_bench.studies.race import report

    publish(report.document(races, results.by_kind(directory)), directory)


def as_data(races: Sequence[Race]) -> dict[str, Any]:
    """Return the results with what is read off them, as plain data for JSON."""
    return {
        "goals": goals.as_data([verdict for race in races for verdict in race.goals]),
        "ratios": [
            {
                "problem": race.key,
                "peer": family,
                "energy": energy,
                "position": position,
                **goals.ratio_data(race.at(family, energy, position)),
            }
            for race in races
            for family in race.families
            if family != OURS
            for energy, position in [
                race.asked,
                *((level, level * tables.POSITION_OVER_ENERGY) for level in tables.LEVELS),
            ]
        ],
        "races": [
            {"problem": race.key, **run_as_json(race.run.index, race.records), "goals": []} for race in races
        ],
    }


def _probe(campaign: Campaign, directory: Path) -> None:
    """Measure compile times, and keep them beside those of problems that were not run this time."""
    path = directory / PROBES
    fresh: list[Probe] = []
    for entry in campaign.entries():
        part = chosen(campaign, [name_of(entry)])
        cases = part.cases()
        families = list(dict.fromkeys(row_of(case).family for case in cases))
        ours = next(case for case in cases if row_of(case) == (OURS, FIXED))
        h = float(parse_spec(ours.method).arguments["h"])
        fresh += probe(name_of(entry), ours.problem, h, families)
    names = {one.problem for one in fresh}
    old = load_probes(path) if path.is_file() else []
    write_json(path, [*(one for one in old if one.problem not in names), *fresh])


def _declare(campaign: Campaign, *, error: bool) -> None:
    console = terminal.console(stderr=error)
    console.print("Settings, declared before the run:")
    for entry in campaign.entries():
        cases = chosen(campaign, [name_of(entry)]).cases()
        console.print(Text(f"{name_of(entry)}: {cases[0].problem}", style="bold"))
        for row in dict.fromkeys(map(row_of, cases)):
            methods = [resolve(case).case.method for case in cases if row_of(case) == row]
            console.print(Text(f"  {row.title}, {len(methods)}: {'  '.join(methods)}"))


def _show(races: Sequence[Race]) -> None:
    for table in [tables.headline(races), tables.goals(races), *map(tables.fastest, races)]:
        if table.rows:
            terminal.print_table(table)
    for said in machine.sentences(race.machine for race in races):
        terminal.console().print(said, highlight=False)
