"""``hbvm-bench doctor | warm``: this machine."""

import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.shorter import with_rounds
from hbvm_bench.commands.listing import as_json as run_as_json
from hbvm_bench.commands.run import as_typed, carry_out
from hbvm_bench.measure import doctor as examining
from hbvm_bench.report import terminal
from problems.errors import InputError

UNHEALTHY = 1
PEERS = "peers"  # the campaign of --peers
HEADINGS = {"installed": "What is installed", "timings": "Whether times measured here can be trusted"}
MARKS = {"ok": ("ok", "green"), "note": ("note", "yellow"), "bad": ("bad", "bold red")}


def doctor(
    context: typer.Context,
    peers: Annotated[
        bool,
        typer.Option("--peers", help="Time every library through the bench and alone; takes some minutes."),
    ] = False,
    rounds: Annotated[
        int | None, typer.Option(min=2, help="With --peers: number of interleaved timings of each.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="With --peers: directory of the results; default runs/peers.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="JSON output.")] = False,
) -> None:
    """Check this machine: missing libraries, and whether timings are reliable.

    Exit code 0 if there is no problem, 1 if a library is missing or timings are unreliable. With --peers: 1
    if the benchmark adds more than a twentieth to the time of a library, or one did not run.
    """
    if peers:
        _peers(context, rounds, out, as_json)
        return
    if rounds is not None or out is not None:
        raise InputError("--rounds and --out belong to --peers: hbvm-bench doctor --peers --out DIR.")
    findings = examining.examine()
    healthy = examining.healthy(findings)
    if as_json:
        content = {key: [asdict(finding) for finding in group] for key, group in findings.items()}
        terminal.print_json(content | {"healthy": healthy})
    else:
        _print(findings)
    if not healthy:
        raise typer.Exit(UNHEALTHY)


def _peers(context: typer.Context, rounds: int | None, out: Path | None, as_json: bool) -> None:
    from hbvm_bench.commands.publishing import report_on  # what draws costs seconds to import
    from hbvm_bench.studies.peers import blocks

    directory = out or Path("runs") / PEERS
    store = carry_out(with_rounds(load(PEERS), rounds), directory, as_typed(context))
    results = report_on([store], directory / "report")
    pairs = blocks.pairs(results)
    if as_json:
        terminal.print_json(run_as_json(results.runs[-1].index, results.runs[-1].records))
    else:
        terminal.print_table(blocks.table(pairs))
        for pair in pairs:
            if pair.failed:
                print(f"{pair.bench.case.method} on {pair.task.problem} did not run: {pair.failed}")
    if not blocks.healthy(pairs):
        raise typer.Exit(UNHEALTHY)


def _print(findings: dict[str, list[examining.Finding]]) -> None:
    console = terminal.console()
    for key, group in findings.items():
        console.print(Text(HEADINGS[key], style="bold"))
        table = Table.grid(padding=(0, 2))
        for finding in group:
            words, style = MARKS[finding.state]
            text = Text(finding.observed)
            if finding.advice:
                text.append(f"; {finding.advice}", style="dim")
            table.add_row("", Text(words, style=style), Text(finding.subject), text)
        console.print(table)
    installed, timings = (all(finding.state != "bad" for finding in findings[key]) for key in HEADINGS)
    console.print(
        f"{'Nothing is missing' if installed else 'Something is missing'}; times measured here now "
        f"{'can be trusted' if timings else 'are doubtful'}."
    )


def warm() -> None:
    """Compile the kernel in advance (once per machine)."""
    from integrators.kernel.ahead import compile_ahead

    for name, seconds in compile_ahead(os.cpu_count() or 1).items():
        print(f"{name}: " + ("compiled before" if seconds is None else f"compiled in {seconds:.1f} s"))
