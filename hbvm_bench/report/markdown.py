"""A document as markdown, for a code forge."""

import re
from collections.abc import Collection, Iterable, Sequence

from hbvm_bench.measure.metrics import Metric
from hbvm_bench.report import document as blocks
from hbvm_bench.report.document import VERDICTS, Block, Document, is_call, pieces
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.summaries.rows import Row, seconds
from hbvm_bench.summaries.table import Table


def markdown(document: Document) -> str:
    """Return a document as markdown with relative links to its files."""
    parts = [f"# {words(document.title)}", *map(words, document.lead)]
    return joined([*parts, *map(printed, document.blocks)]) + "\n"


def printed(block: Block, level: int = 2) -> str:
    """Return a block as markdown; ``level`` is that of the next heading in it."""
    heading = "#" * level
    match block:
        case str():
            return words(block)
        case blocks.Note():
            return words(block.text)
        case blocks.Notice():
            return f"**{words(block.head)}** {words(block.text)}"
        case blocks.Items():
            signs = (f"{i}." if block.kind == "numbered" else "-" for i in range(1, len(block.items) + 1))
            return "\n".join(f"{sign} {words(item)}" for sign, item in zip(signs, block.items, strict=True))
        case blocks.Commands():  # a block of code, which nothing in it can end
            return "\n".join(f"    {one_line(line)}" for line in block.text.splitlines())
        case blocks.Claims():
            return _claims(block, heading)
        case blocks.CaseTable():
            return _results(block, level)
        case blocks.Files():
            links = ", ".join(f"[{path.rpartition('/')[2]}]({path})" for path in block.files)
            return f"{words(block.text)}: {links}."
        case blocks.Links():
            listed = (f"- {words(title)} {words(text)}: {code(place)}" for title, text, place in block.links)
            return "\n".join(listed)
        case blocks.Failed():
            return f"**Not made: {words(block.title)}** ({words(block.reason)})"
        case blocks.Details():
            inner = "\n\n".join(printed(inner_block, level) for inner_block in block.blocks)
            return f"<details>\n<summary>{plain(block.summary)}</summary>\n\n{inner}\n\n</details>"
        case blocks.Section():
            title = words(block.title) + (f": {code(block.code)}" if block.code else "")
            return joined(
                [f"{heading} {title}", *(printed(inner_block, level + 1) for inner_block in block.blocks)]
            )
        case Table():
            rows = [[cell(text) for text in row] for row in block.rows]
            table = lined([words(head) for head in block.flat_head], rows, block.words)
            return joined((f"**{words(block.title)}**" * bool(block.title), table, words(block.note)))
        case Picture():
            title = words(block.title)
            image = f"![{title}]({block.file})"
            return joined((f"{heading} {title}", image, words(block.caption)))


def joined(parts: Iterable[str]) -> str:
    """Return those of the paragraphs that are not empty."""
    return "\n\n".join(part for part in parts if part)


def _claims(block: blocks.Claims, heading: str) -> str:
    parts = [" · ".join(f"**{count}** {VERDICTS[key]}" for key, count in block.counts.items())]
    for title, _, claims in block.groups:
        rows = [
            (words(claim.words), words(claim.paper), words(claim.here), VERDICTS[claim.verdict])
            for claim in claims
        ]
        parts += [
            f"{heading} {words(title)}",
            lined(("claim", block.given, "here", "verdict"), rows, range(4)),
        ]
    return "\n\n".join(parts)


def _results(block: blocks.CaseTable, level: int) -> str:
    parts = []
    several = len(block.problems) > 1
    head = ("#", "method", "settings", *(words(metric.short) for metric in block.columns))
    for problem in block.problems:
        if several:
            parts.append(f"{'#' * level} {words(problem.title)}: {code(problem.problem)}")
        for title, rows in problem.groups:
            lines = []
            for row in rows:
                case, number = row.record.case, str(block.numbers[row.record.id])
                lines.append(
                    (number, code(case.method), words(case.settings), *row_cells(block.columns, row))
                )
            remarks = [row for row in rows if row.remark]
            parts += [
                f"{'#' * (level + several)} {words(title)}",
                lined(head, lines, (1, 2)),
                "\n".join(f"- {code(r.record.case.method)}: {words(r.remark)}." for r in remarks),
            ]
    parts.append(
        "Times are medians with their quartiles. In round brackets: excluded, because the run left its "
        "trajectory or did not reach the end."
    )
    return joined(parts)


def row_cells(columns: Sequence[Metric], row: Row) -> list[str]:
    """Return the cells of a row: excluded ones in brackets, times with their quartiles."""
    cells = []
    for metric in columns:
        text = row.shown(metric.key)
        if metric.key == "warm_seconds" and row.record.timing is not None and row.record.timing.samples:
            summary = row.record.timing.summary
            text += f" [{seconds(summary['q1'])}, {seconds(summary['q3'])}]"
        cells.append(text)
    return cells


def lined(head: Sequence[str], rows: Sequence[Sequence[str]], left: Collection[int]) -> str:
    """Return a table of cells that are markdown already; the columns ``left`` are words."""
    rule = [":--" if index in left else "--:" for index in range(len(head))]
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
