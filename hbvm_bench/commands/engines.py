"""The command ``hbvm-bench engines``."""

from typing import Annotated

import typer

import problems
from hbvm_bench.report import terminal
from hbvm_bench.summaries import engines as engines_
from hbvm_bench.summaries.table import Table
from problems.errors import unknown


def engines(
    names: Annotated[list[str] | None, typer.Argument(help="Problems by name; all by default.")] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="As a Markdown table.")] = False,
) -> None:
    """Say which engine and which method accepts which problem, and why not."""
    for name in names or []:
        if name not in problems.names():
            raise unknown("problem", name, problems.names())
    if markdown:
        print(engines_.markdown(names or []), end="")
        return
    columns, rows = engines_.matrix(names or [])
    listed = engines_.notes(rows)
    cells = [
        (name, *("yes" if row[c] is None else str(listed.index(row[c] or "") + 1) for c in columns))
        for name, row in rows.items()
    ]
    terminal.print_table(Table("", ("problem", *columns), cells, words=range(len(columns) + 1)))
    for i, reason in enumerate(listed, start=1):
        terminal.console().print(f"{i}. {reason}", highlight=False)


__all__ = ["engines"]
