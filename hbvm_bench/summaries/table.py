"""Tables of text: what the summaries of a run say in rows."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

NONE = "–"  # in a cell: there is no such number


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""  # what the columns mean, under the table
    words: Collection[int] = (0,)  # which columns hold words; the others hold numbers
    key: str = ""  # anchor and file name, where it has one
    groups: tuple[tuple[str, int], ...] = ()  # labels over columns, each with how many it is over

    @property
    def flat_head(self) -> list[str]:
        """One head per column, with the label over it before it."""
        labels = [label for label, width in self.groups for _ in range(width)] or [""] * len(self.head)
        return [f"{label}: {word}" if label else word for label, word in zip(labels, self.head, strict=True)]
