"""``hbvm-bench race | endure | automatic``: campaigns with a page of their own."""

import os
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer
from rich.text import Text

from hbvm_bench.campaign.file import Campaign, load, name_of
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.campaign.shorter import chosen, quick_run, with_rounds
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.commands.listing import as_json as run_as_json
from hbvm_bench.commands.run import as_typed, carry_out, refuse_died
from hbvm_bench.measure import machine
from hbvm_bench.measure.computation import VALUE, packed
from hbvm_bench.report import terminal
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.store.store import Store
from hbvm_bench.studies.race.families import FIXED, OURS, row_of
from hbvm_bench.studies.race.probe import probe
from hbvm_bench.studies.race.probe import row_of as row_of_probes
from hbvm_bench.summaries import goals
from problems.errors import InputError

if TYPE_CHECKING:  # it brings what draws, which costs seconds to import
    from hbvm_bench.studies.race.results import Race

RACE = "race"
REPORT = "report"  # the folder of the report in that of the store
LEAST_YEARS = 100.0
MOST_YEARS = 1e9

Avx2 = Annotated[bool, typer.Option("--avx2", help=machine.AVX2)]


def race(
    context: typer.Context,
    problem: Annotated[
        list[str] | None, typer.Option("-p", "--problem", help="Run only this problem; may be repeated.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A tenth of the integration intervals and few settings.")
    ] = False,
    rounds: Annotated[int | None, typer.Option(min=2, help="Number of interleaved timing rounds.")] = None,
    compile_times: Annotated[
        bool | None,
        typer.Option("--compile/--no-compile", help="Compile times in fresh processes; not with --quick."),
    ] = None,
    avx2: Avx2 = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Directory of the results and the report; default runs/race.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all results and ratios as JSON.")] = False,
    declare: Annotated[
        bool, typer.Option("--settings", help="Print the settings that would run, and nothing else.")
    ] = False,
) -> None:
    """Time HBVM and Gauss against the other libraries at equal energy and position error."""
    from hbvm_bench.commands.publishing import report_on  # what draws costs seconds to import
    from hbvm_bench.studies.race import results, tables

    campaign = chosen(load(RACE), problem or [])
    keys = [name_of(entry) for entry in campaign.entries()]
    directory = out or Path("runs") / ("race" + "-quick" * quick + "-avx2" * avx2)
    campaign = with_rounds(quick_run(campaign) if quick else campaign, rounds)
    if declare:
        _declare(campaign, error=False)
        return
    os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
    ensure_writable(directory)
    _declare(campaign, error=True)
    store = carry_out(campaign, directory, as_typed(context))
    if not quick if compile_times is None else compile_times:
        _probe(campaign, store)
    races = results.races_of(report_on([store], directory / REPORT))
    if as_json:
        terminal.print_json(race_as_data(races))
        return
    shown = [contest for contest in races if contest.key in keys]
    for table in [tables.headline(shown), tables.goals(shown), *map(tables.fastest, shown)]:
        if table.rows:
            terminal.print_table(table)
    for said in machine.sentences(race.machine for race in shown):
        terminal.console().print(said, highlight=False)
    refuse_died(store)


def race_as_data(races: "Sequence[Race]") -> dict[str, Any]:
    """Return the results and the quantities derived from them, as plain data for JSON."""
    from hbvm_bench.studies.race import tables

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


def _probe(campaign: Campaign, store: Store) -> None:
    """Measure compile times; those of problems that were not run this time stay."""
    for entry in campaign.entries():
        cases = chosen(campaign, [name_of(entry)]).cases()
        families = list(dict.fromkeys(row_of(case).family for case in cases))
        ours = next(case for case in cases if row_of(case) == (OURS, FIXED))
        h = float(parse_spec(ours.method).arguments["h"])
        row = row_of_probes(name_of(entry), machine.describe(), version("hbvm-bench"))
        store.save(row, {VALUE: packed(probe(name_of(entry), ours.problem, h, families))})


def _declare(campaign: Campaign, *, error: bool) -> None:
    console = terminal.console(stderr=error)
    console.print("Settings, declared before the run:")
    for entry in campaign.entries():
        cases = chosen(campaign, [name_of(entry)]).cases()
        console.print(Text(f"{name_of(entry)}: {cases[0].problem}", style="bold"))
        for row in dict.fromkeys(map(row_of, cases)):
            methods = [resolve(case).case.method for case in cases if row_of(case) == row]
            console.print(Text(f"  {row.title}, {len(methods)}: {'  '.join(methods)}"))


def endure(
    context: typer.Context,
    years: Annotated[float | None, typer.Option(help="Years to integrate; default a million.")] = None,
    starts: Annotated[
        int | None,
        typer.Option(
            min=1, help="Trajectories of each method, from perturbed initial conditions; default 16."
        ),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("-m", "--method", help="Other methods than the declared ones.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="10 000 years from 3 initial conditions; under a minute.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Directory of the results and the report; default runs/endure."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the result and the fitted error growth as JSON.")
    ] = False,
) -> None:
    """Measure the energy error of the outer Solar System over a million years, for all libraries."""
    from hbvm_bench.commands.publishing import report_on  # what draws costs seconds to import
    from hbvm_bench.studies import endure as endurance

    directory = out or Path("runs") / ("endure-quick" if quick else "endure")
    span = years if years is not None else endurance.QUICK_YEARS if quick else None
    if span is not None and not (LEAST_YEARS <= span <= MOST_YEARS and span == round(span)):
        raise InputError(
            f"--years must be a whole number from {LEAST_YEARS:g} to {MOST_YEARS:g}, not {span!r}."
        )
    asked = endurance.campaign(span, starts or (endurance.QUICK_STARTS if quick else None), method)
    store = carry_out(asked, directory, as_typed(context))
    result = endurance.measured_last(report_on([store], directory / REPORT))
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
    refuse_died(store)


def automatic(
    context: typer.Context,
    problems: Annotated[list[str] | None, typer.Argument(help="Problems; all by default.")] = None,
    rounds: Annotated[
        int | None, typer.Option(help="Number of interleaved timing samples, against heyoka.")
    ] = None,
    avx2: Avx2 = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Directory of the report; results of other kinds of processor in it are kept."
        ),
    ] = None,
) -> None:
    """Compare `HBVM()` with default settings with heyoka's `Taylor(tol=1e-15)`.

    Results are stored in runs/automatic; a rerun computes only what is missing.
    """
    from hbvm_bench.commands.publishing import report_on  # what draws costs seconds to import
    from hbvm_bench.studies import automatic

    campaign = automatic.campaign(problems or [], rounds)
    os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
    directory = Path("runs") / ("automatic" + "-avx2" * avx2)
    ensure_writable(out or directory)
    store = carry_out(campaign, directory, as_typed(context))
    run = report_on([store], out or directory / REPORT).runs[-1]
    terminal.print_table(automatic.sides(automatic.head_to_heads(run)))
    terminal.console().print(machine.sentence(run.machine), highlight=False)
    refuse_died(store)
