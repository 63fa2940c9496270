"""A document as markdown, for a code forge."""

import re
from collections.abc import Sequence
from functools import singledispatch

from hbvm_bench.measure.metrics import Metric
from hbvm_bench.report.document import (
    VERDICTS,
    Block,
    Claims,
    Commands,
    Details,
    Document,
    Failed,
    Files,
    Items,
    Note,
    Notice,
    Results,
    Section,
    is_call,
    pieces,
)
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.summaries.rows import Row, seconds
from hbvm_bench.summaries.table import NONE, Table


def markdown(document: Document) -> str:
    """Return a document as markdown with relative links to its files."""
    parts = [f"# {words(document.title)}", *map(words, document.lead)]
    parts += [printed(block, 2) for block in document.blocks]
    return "\n\n".join(part for part in parts if part) + "\n"


@singledispatch
def printed(block: Block, level: int = 2) -> str:
    """Return a block as markdown; ``level`` is that of the next heading in it."""
    raise TypeError(f"{type(block).__name__} is no block of a document.")


@printed.register
def _(block: str, level: int = 2) -> str:
    return words(block)


@printed.register
def _(block: Note, level: int = 2) -> str:
    return words(block.text)


@printed.register
def _(block: Notice, level: int = 2) -> str:
    return f"**{words(block.head)}** {words(block.text)}"


@printed.register
def _(block: Items, level: int = 2) -> str:
    signs = (f"{i}." if block.kind == "numbered" else "-" for i in range(1, len(block.items) + 1))
    return "\n".join(f"{sign} {words(item)}" for sign, item in zip(signs, block.items, strict=True))


@printed.register
def _(block: Commands, level: int = 2) -> str:
    """Return a block of code, which nothing in it can end."""
    return "\n".join(f"    {one_line(line)}" for line in block.text.splitlines())


@printed.register
def _(block: Claims, level: int = 2) -> str:
    parts = [" · ".join(f"**{count}** {VERDICTS[key]}" for key, count in block.counts.items())]
    for title, _, claims in block.groups:
        rows = [
            (words(claim.words), words(claim.paper), words(claim.here), VERDICTS[claim.verdict])
            for claim in claims
        ]
        parts += [
            f"{'#' * level} {words(title)}",
            lined(("claim", "paper", "here", "verdict"), rows, range(4)),
        ]
    return "\n\n".join(parts)


@printed.register
def _(block: Results, level: int = 2) -> str:
    parts = []
    for problem in block.problems:
        several = len(block.problems) > 1
        if several:
            parts.append(f"{'#' * level} {words(problem.title)}: {code(problem.problem)}")
        for title, rows in problem.groups:
            parts.append(f"{'#' * (level + several)} {words(title)}")
            head = ("#", "method", "settings", *(words(metric.short) for metric in block.columns))
            lines = [
                (
                    str(block.looks[row.record.case.method].number),
                    code(row.record.case.method),
                    words(row.record.case.settings),
                    *row_cells(block.columns, row),
                )
                for row in rows
            ]
            parts.append(lined(head, lines, (1, 2)))
            remarks = [row for row in rows if row.remark]
            parts.append("\n".join(f"- {code(r.record.case.method)}: {words(r.remark)}." for r in remarks))
    parts.append(
        "Times are medians with their quartiles. In round brackets: void, because the row is another "
        "trajectory, or only a part of the one that was asked for."
    )
    return "\n\n".join(part for part in parts if part)


def row_cells(columns: Sequence[Metric], row: Row) -> list[str]:
    """Return the cells of a row: void ones in brackets, times with their quartiles."""
    made = []
    for metric in columns:
        cell = row.cells.get(metric.key)
        text = NONE if cell is None else cell.shown
        if metric.key == "warm_seconds" and row.record.timing is not None and row.record.timing.samples:
            summary = row.record.timing.summary
            text += f" [{seconds(summary['q1'])}, {seconds(summary['q3'])}]"
        made.append(text)
    return made


@printed.register
def _(block: Files, level: int = 2) -> str:
    links = ", ".join(f"[{path.rpartition('/')[2]}]({path})" for path in block.files)
    return f"{words(block.text)}: {links}."


@printed.register
def _(block: Failed, level: int = 2) -> str:
    return f"**Not made: {words(block.title)}** ({words(block.reason)})"


@printed.register
def _(block: Details, level: int = 2) -> str:
    inner = "\n\n".join(printed(one, level) for one in block.blocks)
    return f"<details>\n<summary>{plain(block.summary)}</summary>\n\n{inner}\n\n</details>"


@printed.register
def _(block: Section, level: int = 2) -> str:
    title = words(block.title) + (f": {code(block.code)}" if block.code else "")
    parts = [f"{'#' * level} {title}", *(printed(one, level + 1) for one in block.blocks)]
    return "\n\n".join(part for part in parts if part)


@printed.register
def _(block: Table, level: int = 2) -> str:
    """Return a table with its title before and its note after it."""
    note = words(block.note) + (f" [CSV](data/{block.key}.csv)" if block.key else "")
    rows = [[cell(text) for text in row] for row in block.rows]
    table = lined([words(head) for head in block.flat_head], rows, block.words)
    return "\n\n".join(
        part for part in (f"**{words(block.title)}**" * bool(block.title), table, note) if part
    )


@printed.register
def _(block: Picture, level: int = 2) -> str:
    links = f"[SVG](figures/{block.key}.svg)"
    links += f", [its data](data/{block.key}.csv)" if block.plot is not None else ""
    title = words(block.title)
    return "\n\n".join(
        (
            f"{'#' * level} {title}",
            f"![{title}](figures/{block.key}.png)",
            words(block.summary),
            f"{words(block.caption)} {links}",
        )
    )


def lined(head: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int] | object) -> str:
    """Return a table of cells that are markdown already; the columns ``left`` are words."""
    rule = [":--" if index in left else "--:" for index in range(len(head))]  # type: ignore[operator]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rule, *rows))


def one_line(text: object) -> str:
    """Return text without line breaks."""
    return " ".join(str(text).split())


def plain(text: object) -> str:
    """Make any text harmless inside a line or a table cell of markdown."""
    return re.sub(r"([\\`*_{}\[\]<>#|~$])", r"\\\1", one_line(text))


def words(text: object) -> str:
    """Return a text with what stands between backquotes as code, and everything else harmless."""
    return "".join(code(piece) if is_code else _kept(piece) for piece, is_code in pieces(text))


def cell(text: str) -> str:
    """Return a cell of a table; calls are code."""
    return code(text) if is_call(text) else words(text)


def code(text: object) -> str:
    """Return text as inline code that can stand in a table cell."""
    escaped = one_line(text).replace("|", "\\|")
    fence = "`" * (max((len(run) for run in re.findall("`+", escaped)), default=0) + 1)
    pad = " " if "`" in escaped else ""
    return f"{fence}{pad}{escaped}{pad}{fence}"


def _kept(piece: str) -> str:
    # `plain` drops the spaces at the ends, where code may follow
    return " " * piece[:1].isspace() + plain(piece) + " " * (piece[-1:].isspace() and len(piece) > 1)
