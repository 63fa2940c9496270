"""Numbers of the text from stored results: a page names a cell of a report's table, the build inserts it.

A report's text is drawn from its rows, ``results.sqlite.xz``, and from nothing else, so its tables are
the stored values with the digits that readers see.
"""

import re
from functools import cache
from itertools import pairwise
from pathlib import Path

TOP = Path(__file__).parents[2]
ESCAPED = re.compile(r"\\(.)")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Stored:
    """A function for pages: ``{{ stored("costs", "projection", "HBVM(tol=1e-06", "median") }}`` is 0.59.

    A class, because Sphinx keeps the configuration in a pickle.
    """

    def __call__(
        self, report: str, table: str, row: str, column: str, times: float = 1.0, digits: int = 0
    ) -> str:
        """Return the number that a cell of a report begins with.

        Parameters
        ----------
        report : str
            The report's folder.
        table : str
            Part of the line above the table: its caption or a heading; or of the head of the table.
        row : str
            Parts of the row's cells, separated by ``;``; each must be in another cell, or be
            the whole of it where it begins with ``=``.
        column : str
            The head of the column.
        digits
            The significant digits to round to; 0: those of the cell.

        Raises
        ------
        ValueError
            If not exactly one row has these, or the cell has no number.
        """
        wanted = [part.strip() for part in row.split(";")]
        found = [
            dict(zip(head, cells, strict=True))[column]
            for above, head, rows in tables(report)
            if (table in above or table in head) and column in head
            for cells in rows
            if all(any(_stands(part, cell) for cell in cells) for part in wanted)
        ]
        where = f"{row!r}, {column!r} of {table!r} in the report {report!r}"
        if len(found) != 1:
            raise ValueError(f"{len(found)} cells are {where}; name one.")
        number = NUMBER.match(found[0].replace("**", ""))
        if number is None:
            raise ValueError(f"{where} is {found[0]!r}, no number.")
        if not digits:
            return number.group()
        return f"{float(f'{float(number.group()):.{digits}g}'):g}"


@cache
def tables(report: str) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return the tables of a report: the text above, the head, the rows with the label of their group."""
    above, made = "", []
    lines = (TOP / "reports" / report / "report.md").read_text(encoding="utf-8").split("\n")
    for i, line in enumerate(lines):
        if not line.startswith("|"):
            above = line.strip() or above
        elif lines[i - 1].startswith("|"):
            made[-1][2].append(_cells(line))
        else:
            made.append((above, _cells(line), []))
    return [(above, head, _labelled(rows[1:])) for above, head, rows in made]


def _stands(part: str, cell: str) -> bool:
    return cell == part[1:] if part.startswith("=") else part in cell


def _cells(line: str) -> list[str]:
    return [ESCAPED.sub(r"\1", cell.strip()).replace("`", "") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def _labelled(rows: list[list[str]]) -> list[list[str]]:
    """Return the rows with an empty first cell filled from the row above."""
    for above, row in pairwise(rows):
        row[0] = row[0] or above[0]
    return rows
