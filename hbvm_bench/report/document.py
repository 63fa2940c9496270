"""What every report is made of: blocks, which `markdown` and `html` print, each in its way.

A text is a ``str``. What stands between two single backquotes in it is code; nothing else in it means
anything.
A report is a `Document`, a paragraph of it is a text, and everything else is one of the blocks below, a
`Table` or a `Picture`. A picture is described once, where it is drawn: its title, caption and numbers.
"""

import re
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from hbvm_bench.measure.metrics import Metric
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.style import Look
from hbvm_bench.summaries.rows import Row
from hbvm_bench.summaries.table import Table

VERDICTS = {"holds": "confirmed", "partly": "confirmed in part", "no": "not found"}


@dataclass(frozen=True)
class Note:
    """A paragraph in small print."""

    text: str


@dataclass(frozen=True)
class Notice:
    """A paragraph that a reader must not miss: in short, and what to know of it."""

    head: str
    text: str


@dataclass(frozen=True)
class Items:
    """A list; ``cards`` are the few sentences that stand out, side by side where there is room."""

    items: Sequence[str]
    kind: Literal["plain", "numbered", "cards"] = "plain"


@dataclass(frozen=True)
class Commands:
    """What to type, a command a line."""

    text: str


@dataclass(frozen=True)
class Claim:
    """A sentence of a publication beside what was measured."""

    words: str
    paper: str  # what the publication gives for it: a number, a figure
    here: str  # what was measured
    verdict: str  # see `VERDICTS`


@dataclass(frozen=True)
class Claims:
    """Claims in groups, each group with its title and the anchor of the section that it is of."""

    groups: Sequence[tuple[str, str, Sequence[Claim]]]
    given: str = "paper"  # what the column of the publication is called

    @property
    def counts(self) -> dict[str, int]:
        """How many claims have which verdict."""
        verdicts = [claim.verdict for _, _, claims in self.groups for claim in claims]
        return {verdict: verdicts.count(verdict) for verdict in VERDICTS}


@dataclass(frozen=True)
class Ranked:
    """The rows of one problem: its title, how it is written, and its groups of rows with their titles."""

    title: str
    problem: str
    groups: Sequence[tuple[str, Sequence[Row]]]


@dataclass(frozen=True)
class CaseTable:
    """Cases as rows, which a page sorts and filters."""

    columns: Sequence[Metric]
    problems: Sequence[Ranked]  # the section of the i-th, counted from 1, has the anchor ``problem-i``
    looks: Mapping[str, Look]  # by family
    numbers: Mapping[str, int]  # of the cases, by their ids

    @property
    def libraries(self) -> list[str]:
        """The libraries of the cases, each once."""
        rows = (row for problem in self.problems for _, rows in problem.groups for row in rows)
        return list(dict.fromkeys(row.record.library for row in rows))


@dataclass(frozen=True)
class Files:
    """Files to save, by their path beside the document."""

    text: str
    files: Sequence[str]


@dataclass(frozen=True)
class Links:
    """Links to the pages of a long document: the title of each, its code, and where it lies."""

    links: Sequence[tuple[str, str, str]]


@dataclass(frozen=True)
class Failed:
    """A part that could not be made, and why."""

    title: str
    reason: str
    trace: str = ""


@dataclass(frozen=True)
class Details:
    """Blocks that a page folds away behind a line of words."""

    summary: str
    blocks: Sequence["Block"]
    open: bool = False


@dataclass(frozen=True)
class Section:
    """Blocks under a heading."""

    title: str
    blocks: Sequence["Block"]
    key: str  # its anchor
    code: str = ""  # what stands after the title as code, such as the problem
    nav: str = ""  # what a page's navigation calls it; empty for what is not in there


Block = (
    str | Note | Notice | Items | Commands | Claims | CaseTable | Files | Failed | Details | Section
    | Table | Picture | Links
)  # fmt: skip


Maker = tuple[str, Callable[[], Block | Sequence[Block] | None]]
"""What makes a block, or several, or none, with its name for the case that it fails."""


@dataclass(frozen=True)
class Document:
    """A whole report."""

    title: str
    lead: Sequence[str]  # paragraphs before everything else
    blocks: Sequence[Block]
    looks: Sequence[Look] = ()  # of what has a colour in its figures; no two have one number

    def walk(self) -> Iterator[Block]:
        """Yield every block, in order; what holds blocks comes before them."""
        waiting = list(reversed(self.blocks))
        while waiting:
            block = waiting.pop()
            yield block
            if isinstance(block, Section | Details):
                waiting.extend(reversed(block.blocks))

    @property
    def pictures(self) -> list[Picture]:
        """All figures, in order."""
        return [block for block in self.walk() if isinstance(block, Picture)]

    @property
    def failed(self) -> list[Failed]:
        """What could not be made."""
        return [block for block in self.walk() if isinstance(block, Failed)]


def attempt(*makers: Maker) -> list[Block]:
    """Return the blocks that are made; in the place of one that raises, a `Failed` that says so.

    A report is made once, after hours of computing: one figure that cannot be drawn must not
    take the others with it.
    """
    blocks: list[Block] = []
    for title, make in makers:
        try:
            block = make()
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            block = Failed(title, reason, traceback.format_exc())
        if isinstance(block, Sequence) and not isinstance(block, str):
            blocks.extend(block)
        elif block is not None:
            blocks.append(block)
    return blocks


def pieces(text: object) -> list[tuple[str, bool]]:
    """Return a text on one line in pieces, each with whether it is code."""
    split = re.split(r"(?<!`)`([^`]+)`(?!`)", " ".join(str(text).split()))
    return [(piece, i % 2 == 1) for i, piece in enumerate(split) if piece]


def is_call(text: str) -> bool:
    """Whether a cell of a table is the call of a method or of a problem, which is set as code."""
    return re.fullmatch(r"[A-Za-z_]\w*\(.*\)", text) is not None
