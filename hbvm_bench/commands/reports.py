"""``hbvm-bench report | headline | gallery``: pages from what is stored."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.gallery import compile_times, pages
from hbvm_bench.measure import machine
from hbvm_bench.report.markdown import plain, printed
from hbvm_bench.store.archive import opened
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.studies import automatic
from hbvm_bench.studies.race import results, tables
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
    pages: Annotated[
        Path | None,
        typer.Option(
            "--pages", metavar="DIR", help="Draw index.html of every report in DIR from its stored results."
        ),
    ] = None,
) -> None:
    """Write the report of one or more runs: report.md, index.html, figures, archive; nothing is run again."""
    if not runs and index is None and pages is None:
        raise InputError("give at least one run, as in runs/sitnikov, or --index DIR, or --pages DIR.")
    if runs:
        from hbvm_bench.commands.publishing import publish
        from hbvm_bench.report.archived import contents
        from hbvm_bench.report.campaign import document

        stores = opened(runs)
        for store in stores:
            store.index()
        target = out or runs[0] / "report"
        ensure_writable(target, keep=False)
        made = document(stores)
        publish(made, target, contents(made, stores), stderr=False)
        if show:
            webbrowser.open((target / "index.html").resolve().as_uri())
    if pages is not None:
        from hbvm_bench.studies.pages import write

        for path in write(pages):
            print(path)
    if index is not None:
        from hbvm_bench.report.index import write_index

        print(write_index(index))


def headline(
    reports: Annotated[Path, typer.Argument(help="Where race/ and automatic/ lie.")] = Path("reports"),
) -> None:
    """Print the tables of the race and of `automatic` as markdown, from stored results alone.

    For every kind of processor the ratios, the goals with what was measured, and the settings
    that were compared; then HBVM() against heyoka's Taylor method, one column for each kind.
    """
    races = results.by_kind(reports / "race")
    duels = automatic.by_kind(reports / "automatic")
    if not races and not duels:
        raise InputError(f"there is no result of a race or of automatic under {str(reports)!r}.")
    parts = []
    for kind, found in races.items():
        parts += [f"**{plain(kind)}**", *map(plain, machine.sentences(race.machine for race in found))]
        shown = [tables.headline(found), tables.goals(found), tables.behind(found)]
        parts += [printed(table) for table in shown if table.rows]
    parts += [printed(tables.kinds(races))] if len(races) > 1 else []
    if duels:
        parts += [printed(automatic.ratios(duels))]
        for kind, runs in duels.items():
            parts += [plain(f"{kind}: {said}") for said in machine.sentences(run.machine for run in runs)]
    print("\n\n".join(parts))


def gallery(
    directory: Annotated[Path, typer.Argument(help="Where problems.md goes, as in docs.")],
    pictures: Annotated[bool, typer.Option(help="Draw the pictures again.")] = True,
    times: Annotated[
        bool, typer.Option("--compile-times", help="Only measure how long compiling takes: compile_times.md.")
    ] = False,
) -> None:
    """Write the pages on problems and engines, with formulas and pictures, from the problems themselves."""
    ensure_writable(directory)
    if times:
        path = directory / "compile_times.md"
        path.write_text(compile_times.page(), encoding="utf-8")
        print(path)
        return
    for path in pages.write(directory, with_pictures=pictures):
        print(path)
