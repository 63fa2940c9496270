"""What the commands share that write a report."""

from collections.abc import Sequence
from pathlib import Path

import typer

from hbvm_bench.report import terminal
from hbvm_bench.report.archived import contents, joined
from hbvm_bench.report.document import Document
from hbvm_bench.report.page import Results, gather, page_of
from hbvm_bench.report.write import write
from hbvm_bench.store import archive
from hbvm_bench.store.archive import Archive, Contents
from hbvm_bench.store.store import Store


def report_on(
    stores: Sequence[Store] | Sequence[Archive], directory: Path, *, stderr: bool = True
) -> Results:
    """Write the page of runs with its archive, and return what it is made of.

    Where its campaign has results of several kinds of processor side by side, those that lie there stay.

    Raises
    ------
    problems.errors.InputError
        If a store holds no finished case, or the directory cannot be written.
    """
    together: list[Store | Archive] = list(stores)
    if len(stores) == 1 and isinstance(stores[0], Store) and stores[0].index().campaign.page.by_processor:
        together = joined(stores[0], directory / archive.NAME)
    results = gather(together)
    document = page_of(results)
    publish(document, directory, contents(document, together), stderr=stderr)
    return results


def publish(
    document: Document, directory: Path, contents: Contents | None = None, *, stderr: bool = True
) -> None:
    """Write a report, with the archive of its contents, and say where it is.

    Ends with exit code 1 where a part of it could not be made.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written.
    """
    beside = None if contents is None else {archive.NAME: archive.packed(contents)}
    for path in write(document, directory, beside):
        terminal.console(stderr=stderr).print(str(path), style="dim" if stderr else "")
    for part in document.failed:
        terminal.console(stderr=True).print(
            f"hbvm-bench: not made: {part.title}: {part.reason}\n{part.trace}"
        )
    if document.failed:
        raise typer.Exit(1)
