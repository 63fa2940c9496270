"""``hbvm-bench report``: pages from what is stored."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.store.files import ensure_writable
from hbvm_bench.store.store import opened
from problems.errors import InputError


def report(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="RUN...", help="Runs, as in runs/sitnikov; several are merged."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Directory of the report; default: RUN/report of the first run."),
    ] = None,
    study: Annotated[
        Path | None,
        typer.Option("--study", help="Folder of the study whose page it is, where it has blocks of its own."),
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    index: Annotated[
        Path | None,
        typer.Option("--index", metavar="DIR", help="Write README.md, the list of the reports in DIR."),
    ] = None,
    pages: Annotated[
        Path | None,
        typer.Option(
            "--pages", metavar="DIR", help="Draw index.html of every report in DIR from its stored results."
        ),
    ] = None,
) -> None:
    """Write the report of one or more runs: report.md, index.html, figures, rows; nothing is run again."""
    if not runs and index is None and pages is None:
        raise InputError("give at least one run, as in runs/sitnikov, or --index DIR, or --pages DIR.")
    if runs:
        from hbvm_bench.commands.publishing import report_on
        from hbvm_bench.report.page import beside

        stores = opened(runs)
        for store in stores:
            store.index()
        target = out or runs[0] / "report"
        ensure_writable(target, keep=False)
        report_on(stores, target, study or beside(runs[0]), stderr=False)
        if show:
            webbrowser.open((target / "index.html").resolve().as_uri())
    if pages is not None:
        from hbvm_bench.report.index import write_pages

        for path in write_pages(pages):
            print(path)
    if index is not None:
        from hbvm_bench.report.index import write_index

        print(write_index(index))
