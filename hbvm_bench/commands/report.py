"""The command ``hbvm-bench report``."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.store.files import ensure_writable
from hbvm_bench.store.store import Store
from problems.errors import InputError


def report(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="RUN...", help="Runs, as in runs/sitnikov; several are merged."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Default: RUN/report of the first run.")
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    index: Annotated[
        Path | None,
        typer.Option("--index", metavar="DIR", help="Write README.md, the list of the reports in DIR."),
    ] = None,
) -> None:
    """Write the report of one or more runs: report.md, index.html, figures, data; nothing is run again."""
    if not runs and index is None:
        raise InputError("give at least one run, as in runs/sitnikov, or --index DIR.")
    if runs:
        from hbvm_bench.commands.publishing import publish
        from hbvm_bench.report.campaign import document

        stores = [Store(directory) for directory in runs]
        for store in stores:
            store.index()
        target = out or runs[0] / "report"
        ensure_writable(target, keep=False)
        publish(document(stores), target, stderr=False)
        if show:
            webbrowser.open((target / "index.html").resolve().as_uri())
    if index is not None:
        from hbvm_bench.report.index import write_index

        print(write_index(index))
