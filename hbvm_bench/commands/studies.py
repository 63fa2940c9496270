"""``hbvm-bench race | endure | automatic``: shipped campaigns by name, in part or on another processor."""

import os
from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.shorter import chosen, quick_run, with_rounds
from hbvm_bench.commands.listing import as_json as run_as_json
from hbvm_bench.commands.run import as_typed, carry_out, refuse_died, show
from hbvm_bench.measure import machine, reading
from hbvm_bench.report import terminal
from hbvm_bench.store.files import ensure_writable

REPORT = "report"  # the folder of the report in that of the store

Problems = Annotated[
    list[str] | None, typer.Option("-p", "--problem", help="Run only this problem; may be repeated.")
]
Quick = Annotated[
    bool, typer.Option("--quick", help="A tenth of the integration intervals and few settings and rounds.")
]
Rounds = Annotated[int | None, typer.Option(min=2, help="Number of interleaved timing rounds.")]
Avx2 = Annotated[bool, typer.Option("--avx2", help=machine.AVX2)]
Out = Annotated[
    Path | None, typer.Option("--out", help="Directory of the results and the report; default runs/NAME.")
]
Json = Annotated[bool, typer.Option("--json", help="Print all results as JSON.")]


def race(
    context: typer.Context,
    problem: Problems = None,
    quick: Quick = False,
    rounds: Rounds = None,
    avx2: Avx2 = False,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Time HBVM and Gauss against the other libraries at equal energy and position error."""
    _run("race", context, problem, quick, rounds, avx2, out, as_json)


def endure(
    context: typer.Context,
    quick: Quick = False,
    rounds: Rounds = None,
    avx2: Avx2 = False,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Measure the energy error of the outer Solar System over a million years, for all libraries."""
    _run("endure", context, None, quick, rounds, avx2, out, as_json)


def automatic(
    context: typer.Context,
    problem: Problems = None,
    quick: Quick = False,
    rounds: Rounds = None,
    avx2: Avx2 = False,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Compare `HBVM()` with default settings with heyoka's `Taylor(tol=1e-15)`."""
    _run("automatic", context, problem, quick, rounds, avx2, out, as_json)


def _run(
    name: str,
    context: typer.Context,
    problems: list[str] | None,
    quick: bool,
    rounds: int | None,
    avx2: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Run a shipped campaign, or a part of it, and write its report beside its results."""
    from hbvm_bench.commands.publishing import report_on  # what draws costs seconds to import

    campaign = chosen(load(name), problems or [])
    campaign = with_rounds(quick_run(campaign) if quick else campaign, rounds)
    os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
    directory = out or Path("runs") / (name + "-quick" * quick + "-avx2" * avx2)
    ensure_writable(directory)
    store = carry_out(campaign, directory, as_typed(context))
    report_on([store], directory / REPORT)
    if as_json:
        terminal.print_json(run_as_json(store.index(), reading.records(store)))
    else:
        show(campaign, store)
    refuse_died(store)
