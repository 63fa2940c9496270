"""``hbvm-bench race``."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.text import Text

from hbvm_bench.commands import measuring
from hbvm_bench.measure import machine
from hbvm_bench.report import terminal
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.studies.race import results, standings, tables
from hbvm_bench.studies.race.child import Request
from hbvm_bench.studies.race.contests import CONTESTS, chosen
from hbvm_bench.studies.race.results import Contest, Race
from hbvm_bench.studies.race.settings import FAMILIES, settings

ROUNDS = 9
QUICK_ROUNDS = 3


def race(
    problem: Annotated[
        list[str] | None, typer.Option("-p", "--problem", help="Only this problem; may be repeated.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A tenth of the spans, few settings; under a minute.")
    ] = False,
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
    contests = chosen(problem)
    directory = out or Path("runs") / ("race" + "-quick" * quick + "-avx2" * avx2)
    if declare:
        _declare(contests, quick, error=False)
        return
    failed: list[str] = []
    if not redraw:
        environment = machine.restricted_to_avx2() if avx2 else {}
        ensure_writable(directory)
        _declare(contests, quick, error=True)
        request = Request(
            contests=[contest.key for contest in contests],
            out=str(directory),
            quick=quick,
            rounds=rounds or (QUICK_ROUNDS if quick else ROUNDS),
            probes=not quick if compile_times is None else compile_times,
            command=_command(problem, quick, rounds, compile_times, avx2, directory),
        )
        failed = _run(request, environment)
    races = results.load(directory, list(CONTESTS))
    if as_json:
        terminal.print_json(as_data(races))
    else:
        _show([one for one in races if one.contest.key in {contest.key for contest in contests}])
    from hbvm_bench.commands.publishing import publish
    from hbvm_bench.studies.race import report

    if failed:
        print(f"hbvm-bench: these did not end and have no result: {', '.join(failed)}.", file=sys.stderr)
    publish(report.document(races, results.by_kind(directory, list(CONTESTS))), directory)
    if failed:
        raise typer.Exit(1)


def as_data(races: Sequence[Race]) -> dict[str, Any]:
    """Return the results with what is read off them, as plain data for JSON."""
    verdicts = [(race, standings.verdict(race, goal)) for race in races for goal in race.contest.goals]
    return {
        "schema": results.SCHEMA,
        "goals": [
            {
                "contest": race.contest.key,
                "peer": verdict.goal.family,
                "energy": verdict.goal.energy,
                "position": verdict.goal.position,
                "goal": verdict.goal.ratio,
                **_ratio(verdict.comparison),
                "reached": verdict.reached,
            }
            for race, verdict in verdicts
        ],
        "ratios": [
            {
                "contest": race.contest.key,
                "peer": family,
                "energy": energy,
                "position": position,
                **_ratio(standings.at(race, family, energy, position)),
            }
            for race in races
            for family in standings.present(race)
            if family != tables.OURS
            for energy, position in [
                tables.asked(race),
                *((level, level * standings.POSITION_OVER_ENERGY) for level in standings.LEVELS),
            ]
        ],
        "races": [msgspec.to_builtins(race) for race in races],
    }


def _ratio(found: standings.Comparison) -> dict[str, Any]:
    ratio = found.ratio
    return {
        "ratio": ratio.median if ratio else None,
        "low": ratio.low if ratio else None,
        "high": ratio.high if ratio else None,
        "ours": found.ours.setting.method if found.ours else None,
        "ours_seconds": found.ours.median if found.ours else None,
        "theirs": found.theirs.setting.method if found.theirs else None,
        "theirs_seconds": found.theirs.median if found.theirs else None,
    }


def _run(request: Request, environment: Mapping[str, str]) -> list[str]:
    """Run the contests, each in a process of its own (all in one with ``--quick``); return what failed."""
    keys = request.contests
    failed: list[str] = []
    for group in [keys] if request.quick else [[key] for key in keys]:
        asked = msgspec.structs.replace(request, contests=group)
        kept = f"the problems that had ended are kept in {request.out}"
        if measuring.measure("hbvm_bench.studies.race.child", asked, environment, kept) != 0:
            failed += group
    return failed


def _declare(contests: Sequence[Contest], quick: bool, *, error: bool) -> None:
    console = terminal.console(stderr=error)
    console.print("Settings, declared before the run:")
    for contest in contests:
        console.print(Text(f"{contest.key}: {contest.problem}", style="bold"))
        chosen_settings = settings(contest.key, quick=quick)
        for family in dict.fromkeys(setting.family for setting in chosen_settings):
            methods = [setting.method for setting in chosen_settings if setting.family == family]
            console.print(Text(f"  {FAMILIES[family].title}, {len(methods)}: {'  '.join(methods)}"))


def _show(races: Sequence[Race]) -> None:
    for table in [tables.headline(races), tables.goals(races), *map(tables.fastest, races)]:
        if table.rows:
            terminal.print_table(table)
    for said in machine.sentences(race.machine for race in races):
        terminal.console().print(said, highlight=False)


def _command(
    problem: list[str] | None,
    quick: bool,
    rounds: int | None,
    compile_times: bool | None,
    avx2: bool,
    out: Path,
) -> str:
    words = ["race"]
    words += [word for key in problem or [] for word in ("--problem", key)]
    words += ["--quick"] if quick else []
    words += ["--rounds", str(rounds)] if rounds else []
    words += [] if compile_times is None else ["--compile" if compile_times else "--no-compile"]
    words += ["--avx2"] if avx2 else []
    return measuring.command(words, out)
