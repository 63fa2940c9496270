"""``hbvm-bench race | endure | automatic``: campaigns with a page of their own."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from msgspec.structs import replace
from rich.text import Text

from hbvm_bench.campaign.file import Campaign, load, name_of
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.campaign.shorter import chosen, quick_run, with_rounds
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.commands.listing import as_json as run_as_json
from hbvm_bench.commands.run import as_typed, carry_out, opened, show
from hbvm_bench.measure import machine, reading
from hbvm_bench.report import terminal
from hbvm_bench.store import kept
from hbvm_bench.store.files import ensure_writable, write_json
from hbvm_bench.studies.race import results, tables
from hbvm_bench.studies.race.families import FIXED, OURS, row_of
from hbvm_bench.studies.race.probe import PROBES, Probe, load_probes, probe
from hbvm_bench.studies.race.results import Race
from hbvm_bench.summaries import goals
from problems.errors import InputError

GENERAL = "general"
LEAST_YEARS = 100.0
MOST_YEARS = 1e9

Avx2 = Annotated[bool, typer.Option("--avx2", help=machine.AVX2)]
Redraw = Annotated[bool, typer.Option("--redraw", help="Draw the report of --out again; run nothing.")]


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
    avx2: Avx2 = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Where the results and the report go; default runs/race.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all results and ratios as JSON.")] = False,
    redraw: Redraw = False,
    declare: Annotated[
        bool, typer.Option("--settings", help="Print the settings that would run, and nothing else.")
    ] = False,
) -> None:
    """Time our integrators against the peers, side by side, at equal energy and position error."""
    campaign = chosen(results.declared(), problem or [])
    keys = [name_of(entry) for entry in campaign.entries()]
    directory = out or Path("runs") / ("race" + "-quick" * quick + "-avx2" * avx2)
    campaign = with_rounds(quick_run(campaign) if quick else campaign, rounds)
    if declare:
        _declare(campaign, error=False)
        return
    if not redraw:
        os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
        ensure_writable(directory)
        _declare(campaign, error=True)
        store = carry_out(campaign, directory, as_typed(context))
        run = kept.of(store, results.NAME, reading.records(store))
        kept.keep(run, directory / results.FILE, results.NAME)
        if not quick if compile_times is None else compile_times:
            _probe(campaign, directory)
    races = results.load(directory)
    if as_json:
        terminal.print_json(race_as_data(races))
    else:
        _show_races([one for one in races if one.key in keys])
    from hbvm_bench.commands.publishing import publish  # what draws costs seconds to import
    from hbvm_bench.studies.race import report

    publish(report.document(races, results.by_kind(directory)), directory)


def race_as_data(races: Sequence[Race]) -> dict[str, Any]:
    """Return the results with what is read off them, as plain data for JSON."""
    levels = [(level, level * tables.POSITION_OVER_ENERGY) for level in tables.LEVELS]
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
            for energy, position in [race.asked, *levels]
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
        cases = chosen(campaign, [name_of(entry)]).cases()
        families = list(dict.fromkeys(row_of(case).family for case in cases))
        ours = next(case for case in cases if row_of(case) == (OURS, FIXED))
        h = float(parse_spec(ours.method).arguments["h"])
        fresh += probe(name_of(entry), ours.problem, h, families)
    names = {one.problem for one in fresh}
    write_json(path, [*(one for one in load_probes(path) if one.problem not in names), *fresh])


def _declare(campaign: Campaign, *, error: bool) -> None:
    console = terminal.console(stderr=error)
    console.print("Settings, declared before the run:")
    for entry in campaign.entries():
        cases = chosen(campaign, [name_of(entry)]).cases()
        console.print(Text(f"{name_of(entry)}: {cases[0].problem}", style="bold"))
        for row in dict.fromkeys(map(row_of, cases)):
            methods = [resolve(case).case.method for case in cases if row_of(case) == row]
            console.print(Text(f"  {row.title}, {len(methods)}: {'  '.join(methods)}"))


def _show_races(races: Sequence[Race]) -> None:
    for table in [tables.headline(races), tables.goals(races), *map(tables.fastest, races)]:
        if table.rows:
            terminal.print_table(table)
    for said in machine.sentences(race.machine for race in races):
        terminal.console().print(said, highlight=False)


def endure(
    context: typer.Context,
    years: Annotated[float | None, typer.Option(help="The span; default a million.")] = None,
    starts: Annotated[
        int | None,
        typer.Option(min=1, help="Trajectories of each method, from perturbed starts; default 16."),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("-m", "--method", help="Other methods than the declared ones.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="10 000 years from 3 starts; under a minute.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Where the results and the report go; default runs/endure.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result and its laws as JSON.")] = False,
    redraw: Redraw = False,
) -> None:
    """Follow the energy error of the outer Solar System over a million years, ours beside the peers'."""
    from hbvm_bench.commands.publishing import publish  # what draws costs seconds to import
    from hbvm_bench.studies import endure as endurance

    directory = out or Path("runs") / ("endure-quick" if quick else "endure")
    if not redraw:
        span = years if years is not None else endurance.QUICK_YEARS if quick else None
        if span is not None and not (LEAST_YEARS <= span <= MOST_YEARS and span == round(span)):
            raise InputError(
                f"--years must be a whole number from {LEAST_YEARS:g} to {MOST_YEARS:g}, not {span!r}."
            )
        asked = endurance.campaign(span, starts or (endurance.QUICK_STARTS if quick else None), method)
        carry_out(asked, directory, as_typed(context))
    result = endurance.read(directory)
    if as_json:
        lines = [
            msgspec.to_builtins(line) | {"rms": {f"{year:g}": value for year, value in line.rms.items()}}
            for line in endurance.lines(result)
        ]
        verdicts = goals.as_data(endurance.goals(result))
        run = run_as_json(result.run.index, result.run.records)
        terminal.print_json({"lines": lines, "goals": verdicts, "result": run})
    else:
        for table in endurance.tables(result):
            terminal.print_table(table)
        terminal.console().print(machine.sentence(result.run.machine), highlight=False)
    publish(endurance.document(result), directory)


def automatic(
    context: typer.Context,
    problems: Annotated[list[str] | None, typer.Argument(help="Problems; all by default.")] = None,
    rounds: Annotated[int | None, typer.Option(help="Interleaved timing samples, against heyoka.")] = None,
    general: Annotated[
        bool, typer.Option("--general", help="General and stiff systems instead, beside SciPy's methods.")
    ] = False,
    limit: Annotated[
        float, typer.Option(help="With --general: seconds after which a case is given up.")
    ] = 120.0,
    avx2: Avx2 = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Keep the result there, as <kind of processor>.json, with a page of all."),
    ] = None,
    redraw: Redraw = False,
) -> None:
    """Race HBVM that chooses everything itself, HBVM(), against heyoka's Taylor(tol=1e-15).

    The cases are kept in runs/automatic, and a rerun does only what is missing there.
    With --general: the campaign general, or a part of it: stiff, driven and decaying systems against their
    known ends, HBVM() beside SciPy's Radau and DOP853 and heyoka.
    """
    if general and (avx2 or out is not None):
        raise InputError("--avx2 and --out do not go with --general; leave them out.")
    if general:
        _general(context, problems or [], limit)
        return
    from hbvm_bench.commands.publishing import publish  # what draws costs seconds to import
    from hbvm_bench.studies import automatic as duels

    if not redraw:
        campaign = duels.campaign(problems or [], rounds)
        os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
        if out is not None:
            ensure_writable(out)
        store = carry_out(campaign, Path("runs") / ("automatic" + "-avx2" * avx2), as_typed(context))
        run = kept.of(store, duels.NAME, reading.records(store))
        terminal.print_table(duels.sides(duels.duels(run)))
        terminal.console().print(machine.sentence(run.machine), highlight=False)
        if out is None:
            return
        duels.keep(run, out)
    out = out or Path("reports/automatic")
    found = duels.by_kind(out)
    if not found:
        raise InputError(f"there is no result of automatic in {str(out)!r}; run it with --out first.")
    publish(duels.document(found), out)


def _general(context: typer.Context, names: list[str], limit: float) -> None:
    if not 0.0 < limit <= 1e300:
        raise InputError(f"--limit={limit} must be above 0 and at most 1e300 seconds.")
    declared = load(GENERAL)
    limits = replace(declared.limits, wall_seconds=limit)
    campaign = opened(chosen(replace(declared, limits=limits), names), GENERAL)
    show(campaign, carry_out(campaign, Path("runs") / GENERAL, as_typed(context)))
