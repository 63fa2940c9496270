"""Tables of text, and how the terminal and markdown show them."""

from dataclasses import dataclass, field

from rich import box
from rich.table import Table as RichTable
from rich.text import Text

from hbvm_bench.report.markdown import plain


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    title : str
        One line.
    head : tuple of str
        Column heads; the first column is text, the others are numbers unless in ``words``.
    rows : list of tuple of str
        Cells.
    note : str
        A sentence under the table.
    words : tuple of int
        Which other columns hold words.
    """

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    note: str = ""
    words: tuple[int, ...] = field(default=())

    def is_words(self, column: int) -> bool:
        """Whether a column holds words, to be read from the left."""
        return column == 0 or column in self.words


def on_terminal(table: Table) -> RichTable:
    """Return a table for a terminal."""
    made = RichTable(
        title=Text(table.title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, caption=table.note
    )
    for index, head in enumerate(table.head):
        made.add_column(
            Text(head), justify="left" if table.is_words(index) else "right", overflow="fold", min_width=6
        )
    for row in table.rows:
        made.add_row(*(Text(cell) for cell in row))
    return made


def in_markdown(table: Table) -> str:
    """Return a table in markdown, with its title before and its note after it."""
    rule = (":--" if table.is_words(index) else "--:" for index in range(len(table.head)))
    lines = [table.head, *table.rows]
    text = [f"| {' | '.join(plain(cell) for cell in line)} |" for line in lines]
    text.insert(1, f"| {' | '.join(rule)} |")
    parts = [f"**{plain(table.title)}**", "\n".join(text), plain(table.note)]
    return "\n\n".join(part for part in parts if part)
