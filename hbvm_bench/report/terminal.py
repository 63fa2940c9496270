"""What the command line shows of results: tables that fit."""

from collections.abc import Sequence
from typing import Any

import msgspec
from rich import box
from rich.console import Console, Group, RenderableType
from rich.table import Table as RichTable
from rich.text import Text

from hbvm_bench.campaign.file import Campaign
from hbvm_bench.measure.metrics import Metric
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import goals
from hbvm_bench.summaries.rows import Row, at_once, columns, grouped, numbers, rows, tasks
from hbvm_bench.summaries.table import Table

NARROWEST = 24  # characters for the methods
# Where a terminal is narrow, these columns are left out, in this order.
GIVEN_UP = (
    *("compile_seconds", "evaluations", "observable_end", "steps", "observable_error"),
    *("guard_max", "angular_momentum_max", "exponent", "megno"),
)
PIPE_WIDTH = 200  # characters; a table that is piped away should not be folded at 80


def console(*, stderr: bool = False) -> Console:
    """Return a console that does not fold tables when its output is a file or a pipe.

    Nor does it take brackets in a text for a style: what is printed may be somebody else's.
    """
    result = Console(stderr=stderr, highlight=False, markup=False)
    if not result.is_terminal:
        result.width = PIPE_WIDTH
    return result


def print_json(value: Any) -> None:
    """Print a value for programs."""
    print(msgspec.json.format(msgspec.json.encode(value), indent=1).decode())


def empty(title: str) -> RichTable:
    """Return a table without columns, in the style of all."""
    return RichTable(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)


def print_table(table: Table) -> None:
    """Print a table of text."""
    printed = empty(table.title)
    printed.caption = table.note
    for index, head in enumerate(table.head):
        justify = "left" if index in table.words else "right"
        printed.add_column(Text(head), justify=justify, overflow="fold", min_width=6)
    for row in table.rows:
        printed.add_row(*(Text(cell) for cell in row))
    console().print(printed)


def print_results(
    records: Sequence[Record], keys: Sequence[str] | None = None, sort: str | None = None
) -> None:
    """Print the tables of `results` as wide as the terminal is."""
    terminal = console()
    for table in results(records, keys, sort, terminal.width):
        terminal.print(table)


def print_goals(campaign: Campaign, records: Sequence[Record]) -> None:
    """Print the verdicts on what a campaign asked for; nothing where it asked for nothing."""
    if verdicts := goals.verdicts(campaign, records):
        print_table(goals.table(verdicts))


def results(
    records: Sequence[Record],
    keys: Sequence[str] | None = None,
    sort: str | None = None,
    width: int = PIPE_WIDTH,
) -> list[RenderableType]:
    """Return, for each problem and each ensemble, its table and the remarks on its rows.

    The metrics are those of ``keys``, or the headline ones that fit into the width, in characters.
    """
    records_of = tasks(records)
    return [
        _results(task.problem + at_once(task.ensemble) + task.sampled(records_of), members, keys, sort, width)
        for task, members in records_of.items()
    ]


def _results(
    title: str, records: Sequence[Record], keys: Sequence[str] | None, sort: str | None, width: int
) -> RenderableType:
    shown = columns(records, keys)
    lines = rows(records, sort)
    hidden = 0 if keys else len(shown) - len(shown := _fitting(shown, lines, width))
    number_of = numbers(records)
    table = empty(title)
    table.add_column("#", justify="right", no_wrap=True)
    table.add_column("method", overflow="fold", min_width=NARROWEST)
    for metric in shown:
        table.add_column(metric.short, justify="right", no_wrap=True)
    remarks = RichTable.grid(padding=(0, 2))
    for title, members in grouped(lines):
        table.add_section()
        table.add_row("", Text(title, style="bold italic"))
        for row in members:
            number, method = str(number_of[row.record.id]), row.record.case.method
            name = Text(method, style="bold cyan" if row.record.role == "ours" else "")
            table.add_row(number, name, *(_cell(row, metric.key) for metric in shown))
            if row.remark:
                remarks.add_row(Text(number, justify="right"), Text(f"{method}: {row.remark}."))
    note = "In brackets: excluded, because the run left its trajectory or did not reach the end."
    if hidden:
        note += f" {hidden} columns do not fit; a wider terminal or --metric shows them."
    return Group(table, Text(note, style="dim"), remarks, "")


def _fitting(shown: list[Metric], lines: Sequence[Row], width: int) -> list[Metric]:
    """Return the columns that fit beside the methods, the least telling given up first."""
    needed: dict[str, int] = {}
    for metric in shown:
        cells = (row.cells[metric.key] for row in lines if metric.key in row.cells)
        needed[metric.key] = 3 + max(len(metric.short), *(len(cell.text) + 2 for cell in cells), 0)
    for key in GIVEN_UP:
        if 5 + NARROWEST + sum(needed.values()) <= width:
            break
        needed.pop(key, None)
    return [metric for metric in shown if metric.key in needed]


def _cell(row: Row, key: str) -> Text:
    cell = row.cells.get(key)
    return Text(row.shown(key), style="dim" if cell is None or cell.excluded else "")
