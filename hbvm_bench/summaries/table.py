"""Tables of text: what the summaries of a run say in rows."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

NONE = "–"  # in a cell: there is no such number


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    title : str
        One line.
    head : tuple of str
        Column heads.
    rows : sequence of tuple of str
        Cells.
    note : str
        What the columns mean, under the table.
    words : collection of int
        Which columns hold words; the others hold numbers.
    key : str
        Anchor and file name, where it has one.
    groups : tuple of (str, int)
        Labels over columns, each with how many it is over; may be empty.
    """

    title: str
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""
    words: Collection[int] = (0,)
    key: str = ""
    groups: tuple[tuple[str, int], ...] = ()

    @property
    def flat_head(self) -> list[str]:
        """One head per column, with the label over it before it."""
        labels = [label for label, width in self.groups for _ in range(width)] or [""] * len(self.head)
        return [f"{label}: {word}" if label else word for label, word in zip(labels, self.head, strict=True)]
