"""What the commands share that write a report."""

from collections.abc import Sequence
from pathlib import Path

import typer

from hbvm_bench.report import terminal
from hbvm_bench.report.page import Results, beside, gather, page_of, parts_in
from hbvm_bench.report.stored import contents, joined
from hbvm_bench.report.write import write
from hbvm_bench.store.store import PACKED, Store


def report_on(
    stores: Sequence[Store], directory: Path, study: Path | None = None, *, stderr: bool = True
) -> Results:
    """Write the page of runs with the rows that it is made of, say where it is, and return these.

    ``study`` is the folder with the blocks that a campaign has of its own; see `gather`.

    Where its campaign has results of several kinds of processor side by side, those that lie there stay.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written.
    typer.Exit
        With 1 where a part of the page could not be made.
    """
    if len(stores) == 1 and stores[0].index().campaign.page.by_processor:
        stores = joined(stores[0], directory / PACKED)
    results = gather(stores, beside(directory) or study)
    document = page_of(results, parts_in(directory))
    for path in write(document, directory, {PACKED: contents(results, stores).packed()}):
        terminal.console(stderr=stderr).print(str(path), style="dim" if stderr else "")
    for part in document.failed:
        terminal.console(stderr=True).print(
            f"hbvm-bench: not made: {part.title}: {part.reason}\n{part.trace}"
        )
    if document.failed:
        raise typer.Exit(1)
    return results
