"""``hbvm-bench paper``: the study that ships, with its page."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.campaign.file import file_of, load
from hbvm_bench.commands.run import as_typed, carry_out

PAPER = "paper"


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
    store = carry_out(load(PAPER), directory, as_typed(context), study=file_of(PAPER).parent, jobs=jobs)
    report_on([store], directory / "report", stderr=False)
