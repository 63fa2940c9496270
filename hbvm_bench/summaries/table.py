"""Tables of text: what the summaries of a run say in rows."""

from dataclasses import dataclass, field


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
