"""Text, code and tables in markdown."""

import re

from hbvm_bench.summaries.table import Table


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


def in_markdown(table: Table) -> str:
    """Return a table in markdown, with its title before and its note after it."""
    rule = (":--" if index in table.words else "--:" for index in range(len(table.head)))
    lines = [table.head, *table.rows]
    text = [f"| {' | '.join(plain(cell) for cell in line)} |" for line in lines]
    text.insert(1, f"| {' | '.join(rule)} |")
    parts = [f"**{plain(table.title)}**", "\n".join(text), plain(table.note)]
    return "\n\n".join(part for part in parts if part)
