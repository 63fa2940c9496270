"""The command ``hbvm-bench inspect``."""

from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from hbvm_bench.commands import findings
from hbvm_bench.report import terminal


def inspect(
    system: Annotated[
        str, typer.Argument(help='A formula, as in "p^2/2 - cos(q)", or a problem, as in "kepler(e=0.9)".')
    ],
    parameters: Annotated[str, typer.Option("--par", help='Values in a formula, as in "k=2, m=0.5".')] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Everything, for programs.")] = False,
) -> None:
    """Say what can be read off a Hamiltonian: degree, exact k, separability, cyclic coordinates, engines."""
    found = findings.inspect(system, parameters)
    if as_json:
        terminal.print_json(asdict(found))
        return
    table = Table.grid(padding=(0, 2))
    for heading, sentence in findings.lines(found):
        table.add_row(Text(heading, style="bold"), Text(sentence))
    terminal.console().print(table)
