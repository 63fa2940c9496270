"""``hbvm-bench paper``: run the paper's experiments and write the report."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.measure import machine
from hbvm_bench.report import terminal
from hbvm_bench.store.files import ensure_writable
from problems.errors import unknown

PARTS = ("sitnikov", "henon-heiles", "period-annulus", "claims")
DEFAULT = Path("reports/paper")


def paper(
    part: Annotated[str | None, typer.Argument(help=f"One of {', '.join(PARTS)}; all by default.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Default: reports/paper, or runs/paper-PART for one part.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default one per core.")] = None,
    redraw: Annotated[
        bool, typer.Option("--redraw", help="Draw the report of --out again; run nothing.")
    ] = False,
) -> None:
    """Run the seed paper's experiments again and write the report: claim, paper, here.

    What every computation returns is kept beside the report as soon as it has ended. A run that
    was interrupted goes on where it was, as long as the code is the same.
    """
    if part is not None and part not in PARTS:
        raise unknown("part of the paper", part, PARTS)
    from hbvm_bench.commands.publishing import publish  # what computes and draws costs seconds to import
    from hbvm_bench.studies.paper import report, results

    directory = out or (DEFAULT if part is None else Path("runs") / f"paper-{part}")
    names = PARTS if part is None else (part,)
    if redraw:
        kept = results.load(directory)
    else:
        ensure_writable((directory / results.NAME).parent)
        tasks = report.tasks(names)
        console, count = terminal.console(stderr=True), 0

        def done(key: str, said: str) -> None:
            nonlocal count
            count += 1
            console.print(f"  {count}/{len(tasks)} {key}: {said}")

        command = "hbvm-bench paper" + (f" {part}" if part else "")
        kept = results.run_all(tasks, jobs or len(machine.cores()), command, directory, done)
    publish(report.document(kept, names), directory)
