"""What the commands share that write a report."""

from pathlib import Path

import typer

from hbvm_bench.report import terminal
from hbvm_bench.report.document import Document
from hbvm_bench.report.write import write
from hbvm_bench.store import archive
from hbvm_bench.store.archive import Contents


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
    if contents is not None:
        archive.write(directory / archive.NAME, contents)
    for path in write(document, directory):
        terminal.console(stderr=stderr).print(str(path), style="dim" if stderr else "")
    for part in document.failed:
        terminal.console(stderr=True).print(
            f"hbvm-bench: not made: {part.title}: {part.reason}\n{part.trace}"
        )
    if document.failed:
        raise typer.Exit(1)
