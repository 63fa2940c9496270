"""``hbvm-bench paper | chaos``: campaigns with computations beside their cases, and a page of these."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.shorter import quick_run
from hbvm_bench.commands.run import as_typed, carry_out

PAPER = "paper"
CHAOS = "chaos"


def paper(
    context: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Directory of the results and the report; default runs/paper."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of processes; default one per core.")
    ] = None,
) -> None:
    """Repeat the original paper's experiments and report each claim beside the result.

    Results are stored as they are computed; an interrupted run resumes.
    """
    from hbvm_bench.commands.publishing import report_on  # what draws costs seconds to import

    directory = out or Path("runs") / PAPER
    store = carry_out(load(PAPER), directory, as_typed(context), jobs=jobs)
    report_on([store], directory / "report", stderr=False)


def chaos(
    context: typer.Context,
    quick: Annotated[
        bool, typer.Option("--quick", help="A fiftieth of the times and few points of the maps.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Directory of the results and the report; default runs/chaos."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of processes; default one per core.")
    ] = None,
) -> None:
    """Compute Lyapunov exponents of known systems and maps of chaos, and write the report.

    Results are stored as they are computed; an interrupted run resumes. Timings run one after another, while
    nothing else of this run is running.
    """
    from hbvm_bench.commands.publishing import report_on  # what draws costs seconds to import

    campaign = quick_run(load(CHAOS)) if quick else load(CHAOS)
    directory = out or Path("runs") / (CHAOS + "-quick" * quick)
    store = carry_out(campaign, directory, as_typed(context), jobs=jobs)
    report_on([store], directory / "report", stderr=False)
