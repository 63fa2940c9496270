"""The command ``hbvm-bench automatic``."""

import math
import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hbvm_bench.commands.run import as_typed, carry_out
from hbvm_bench.measure import machine, reading
from hbvm_bench.report import terminal
from hbvm_bench.store import kept
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.studies.automatic import runs as automatic_
from hbvm_bench.studies.general import runs as general_
from hbvm_bench.summaries.table import Table
from problems.errors import InputError


def automatic(
    context: typer.Context,
    problems: Annotated[list[str] | None, typer.Argument(help="Problems; all by default.")] = None,
    rounds: Annotated[int | None, typer.Option(help="Interleaved timing samples, against heyoka.")] = None,
    general: Annotated[
        bool, typer.Option("--general", help="General and stiff systems instead, beside SciPy's methods.")
    ] = False,
    limit: Annotated[
        float, typer.Option(help="With --general: seconds after which a run is given up.")
    ] = 30.0,
    avx2: Annotated[bool, typer.Option("--avx2", help=machine.AVX2)] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Keep the result there, as <kind of processor>.json, with a page of all."),
    ] = None,
    redraw: Annotated[
        bool, typer.Option("--redraw", help="Draw the report of --out again; run nothing.")
    ] = False,
) -> None:
    """Race HBVM that chooses everything itself, HBVM(), against heyoka's Taylor(tol=1e-15).

    The cases are kept in runs/automatic, and a rerun does only what is missing there.
    With --general: van der Pol's equation, Robertson's chemistry, a driven pendulum and Arenstorf's
    orbit against their known end values, HBVM() beside Radau and DOP853; and a stiff chain
    at a step a hundred times as long as one at which the fixed-point iteration fails.
    """
    console = terminal.console()
    if general and (avx2 or out is not None):
        raise InputError("--avx2 and --out do not go with --general; leave them out.")
    if general:
        _general(console, problems or [], limit)
        return
    from hbvm_bench.studies.automatic import report

    if redraw:
        _publish(out or Path("reports/automatic"))
        return
    campaign = automatic_.campaign(problems or [], rounds)
    os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
    if out is not None:
        ensure_writable(out)
    store = carry_out(campaign, Path("runs") / ("automatic" + "-avx2" * avx2), as_typed(context))
    run = kept.of(store, automatic_.NAME, reading.records(store))
    terminal.print_table(report.sides(automatic_.duels(run)))
    console.print(machine.sentence(run.machine), highlight=False)
    if out is not None:
        automatic_.keep(run, out)
        _publish(out)


def _publish(directory: Path) -> None:
    from hbvm_bench.commands.publishing import publish
    from hbvm_bench.studies.automatic import report

    found = automatic_.by_kind(directory)
    if not found:
        raise InputError(f"there is no result of automatic in {str(directory)!r}; run it with --out first.")
    publish(report.document(found), directory)


def _general(console: Console, names: list[str], limit: float) -> None:
    with console.status("compiling") as status:
        found = general_.outcomes(names, limit, lambda text: status.update(f"running {text}"))
    rows = [
        (
            "" if before is not None and run.problem == before.problem else run.problem,
            run.method,
            "" if math.isnan(run.error) else f"{run.error:.1e}",
            "" if math.isnan(run.energy) else f"{run.energy:.1e}",
            str(run.steps),
            str(run.evaluations),
            f"{1e3 * run.seconds:.3g}",
            run.ending or run.solver,
        )
        for before, run in zip((None, *found), found, strict=False)
    ]
    head = ("problem", "method", "end", "energy", "steps", "evaluations", "ms", "solver")
    note = (
        "end: error of the end, of van der Pol and Robertson relative; energy: largest error on the way. "
        "An evaluation is one of the field at one state; ours evaluates 8 or 16 at a time."
    )
    terminal.print_table(Table("", head, rows, note, words=(0, 1, 7)))


__all__ = ["automatic"]
