"""The report as markdown, for a code forge."""

import re
from collections.abc import Sequence

from jinja2 import Environment, PackageLoader, StrictUndefined

from hbvm_bench.measure.metrics import Metric
from hbvm_bench.report.content import Content
from hbvm_bench.report.markdown import code, in_markdown, one_line, plain
from hbvm_bench.summaries.rows import Row, seconds


def markdown(content: Content) -> str:
    """Return the report as markdown with relative links to its figures."""
    environment = Environment(
        loader=PackageLoader("hbvm_bench.report", "templates"),
        autoescape=False,  # markdown has its own escapes, see `plain`
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters |= {"plain": plain, "code": code, "one_line": one_line, "table": in_markdown}
    environment.globals |= {"row_cells": row_cells}
    text = environment.get_template("report.md.j2").render(c=content)
    return re.sub(r"\n{3,}", "\n\n", text).lstrip("\n")


def row_cells(columns: Sequence[Metric], row: Row) -> list[str]:
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
