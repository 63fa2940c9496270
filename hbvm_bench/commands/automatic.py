"""The command ``hbvm-bench automatic``."""

import os
from pathlib import Path
from typing import Annotated

import typer
from msgspec.structs import replace

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.shorter import chosen
from hbvm_bench.commands.run import as_typed, carry_out, opened, show
from hbvm_bench.measure import machine, reading
from hbvm_bench.report import terminal
from hbvm_bench.store import kept
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.studies.automatic import runs as automatic_
from problems.errors import InputError

GENERAL = "general"


def automatic(
    context: typer.Context,
    problems: Annotated[list[str] | None, typer.Argument(help="Problems; all by default.")] = None,
    rounds: Annotated[int | None, typer.Option(help="Interleaved timing samples, against heyoka.")] = None,
    general: Annotated[
        bool, typer.Option("--general", help="General and stiff systems instead, beside SciPy's methods.")
    ] = False,
    limit: Annotated[
        float, typer.Option(help="With --general: seconds after which a case is given up.")
    ] = 120.0,
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
    With --general: the campaign general, or a part of it: stiff, driven and decaying systems against their
    known ends, HBVM() beside SciPy's Radau and DOP853 and heyoka.
    """
    if general and (avx2 or out is not None):
        raise InputError("--avx2 and --out do not go with --general; leave them out.")
    if general:
        _general(context, problems or [], limit)
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
    terminal.console().print(machine.sentence(run.machine), highlight=False)
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


def _general(context: typer.Context, names: list[str], limit: float) -> None:
    if not 0.0 < limit <= 1e300:
        raise InputError(f"--limit={limit} must be above 0 and at most 1e300 seconds.")
    declared = load(GENERAL)
    limits = replace(declared.limits, wall_seconds=limit)
    campaign = opened(chosen(replace(declared, limits=limits), names), GENERAL)
    show(campaign, carry_out(campaign, Path("runs") / GENERAL, as_typed(context)))
