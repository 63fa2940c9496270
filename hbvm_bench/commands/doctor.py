"""The command ``hbvm-bench doctor``."""

from dataclasses import asdict
from typing import Annotated

import msgspec
import typer
from rich.table import Table
from rich.text import Text

from hbvm_bench import doctor as examining
from hbvm_bench import terminal

UNHEALTHY = 1
HEADINGS = {"installed": "What is installed", "timings": "Whether times measured here can be trusted"}
MARKS = {"ok": ("ok", "green"), "note": ("note", "yellow"), "bad": ("bad", "bold red")}


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Everything, for programs.")] = False,
) -> None:
    """Say what is missing on this machine, and whether times measured here can be trusted.

    Exit code 0 when nothing is bad, 1 when a peer is missing or times are doubtful.
    """
    findings = examining.examine()
    healthy = examining.healthy(findings)
    if as_json:
        content = {key: [asdict(one) for one in group] for key, group in findings.items()}
        print(msgspec.json.format(msgspec.json.encode(content | {"healthy": healthy}), indent=1).decode())
    else:
        _print(findings)
    if not healthy:
        raise typer.Exit(UNHEALTHY)


def _print(findings: dict[str, list[examining.Finding]]) -> None:
    console = terminal.console()
    for key, group in findings.items():
        console.print(Text(HEADINGS[key], style="bold"))
        table = Table.grid(padding=(0, 2))
        for one in group:
            words, style = MARKS[one.state]
            found = Text(one.found)
            if one.advice:
                found.append(f"; {one.advice}", style="dim")
            table.add_row("", Text(words, style=style), Text(one.what), found)
        console.print(table)
    installed, timings = (
        all(one.state != "bad" for one in findings[key]) for key in ("installed", "timings")
    )
    console.print(
        f"{'Nothing is missing' if installed else 'Something is missing'}; times measured here now "
        f"{'can be trusted' if timings else 'are doubtful'}."
    )


__all__ = ["doctor"]
