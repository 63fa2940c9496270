"""``hbvm-bench endure``."""

from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from hbvm_bench.commands.listing import as_json as run_as_json
from hbvm_bench.commands.run import as_typed, carry_out
from hbvm_bench.measure import machine
from hbvm_bench.report import terminal
from hbvm_bench.studies.endure import law, runs
from hbvm_bench.studies.endure.runs import Endurance
from hbvm_bench.summaries.goals import as_data as goals_as_data
from problems.errors import InputError

LEAST_YEARS = 100.0
MOST_YEARS = 1e9


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
    redraw: Annotated[
        bool, typer.Option("--redraw", help="Draw the report of --out again; run nothing.")
    ] = False,
) -> None:
    """Follow the energy error of the outer Solar System over a million years, ours beside the peers'."""
    directory = out or Path("runs") / ("endure-quick" if quick else "endure")
    if not redraw:
        span = years if years is not None else runs.QUICK_YEARS if quick else None
        if span is not None and not (LEAST_YEARS <= span <= MOST_YEARS and span == round(span)):
            raise InputError(
                f"--years must be a whole number from {LEAST_YEARS:g} to {MOST_YEARS:g}, not {span!r}."
            )
        asked = runs.campaign(span, starts or (runs.QUICK_STARTS if quick else None), method)
        carry_out(asked, directory, as_typed(context))
    result = runs.read(directory)
    from hbvm_bench.commands.publishing import publish
    from hbvm_bench.studies.endure import report

    if as_json:
        terminal.print_json(as_data(result))
    else:
        for table in report.tables(result):
            terminal.print_table(table)
        terminal.console().print(machine.sentence(result.run.machine), highlight=False)
    publish(report.document(result), directory)


def as_data(result: Endurance) -> dict[str, Any]:
    """Return the result with what is read off it, as plain data for JSON."""
    return {
        "lines": [_line(line) for line in law.lines(result)],
        "goals": goals_as_data(law.goals(result)),
        "result": run_as_json(result.run.index, result.run.records),
    }


def _line(line: law.Line) -> dict[str, Any]:
    rms = {f"{year:g}": value for year, value in line.rms.items()}
    return msgspec.to_builtins(line) | {"rms": rms}
