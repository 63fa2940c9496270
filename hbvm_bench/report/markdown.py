"""The report as markdown, for a code forge."""

import re
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined

from hbvm_bench.summaries.rows import Row, seconds

if TYPE_CHECKING:  # so that the escapes below cost no plotting library
    from collections.abc import Sequence

    from hbvm_bench.measure.metrics import Metric
    from hbvm_bench.report.content import Content


def markdown(content: "Content") -> str:
    """Return the report as markdown with relative links to its figures."""
    environment = Environment(
        loader=PackageLoader("hbvm_bench.report", "templates"),
        autoescape=False,  # markdown has its own escapes, see `plain`
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    from hbvm_bench.report.cells import in_markdown  # which itself needs the escapes below

    environment.filters |= {"plain": plain, "code": code, "one_line": one_line, "table": in_markdown}
    environment.globals |= {"row_cells": row_cells}
    text = environment.get_template("report.md.j2").render(c=content)
    return re.sub(r"\n{3,}", "\n\n", text).lstrip("\n")


def one_line(text: object) -> str:
    """Return text without line breaks."""
    return " ".join(str(text).split())


def plain(text: object) -> str:
    """Make any text harmless inside a line or a table cell of markdown."""
    return re.sub(r"([\\`*_{}\[\]<>#|~$])", r"\\\1", one_line(text))


def code(text: object) -> str:
    """Return text as inline code that can stand in a table cell."""
    escaped = one_line(text).replace("|", "\\|")
    fence = "`" * (max((len(run) for run in re.findall("`+", escaped)), default=0) + 1)
    pad = " " if "`" in escaped else ""
    return f"{fence}{pad}{escaped}{pad}{fence}"


def block(text: object) -> str:
    """Return text as a block of code, which nothing in it can end."""
    return "\n".join(f"    {one_line(line)}" for line in str(text).splitlines())


def row_cells(columns: "Sequence[Metric]", row: Row) -> list[str]:
    """Return the cells of a row: void ones in brackets, times with their quartiles."""
    made = []
    for metric in columns:
        cell = row.cells.get(metric.key)
        text = "–" if cell is None else f"({cell.text})" if cell.void else cell.text
        if metric.key == "warm_seconds" and row.record.timing is not None and row.record.timing.samples:
            summary = row.record.timing.summary
            text += f" [{seconds(summary['q1'])}, {seconds(summary['q3'])}]"
        made.append(text)
    return made
