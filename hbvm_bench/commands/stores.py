"""``hbvm-bench compare | merge | export``: what is done with runs."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from hbvm_bench.report import terminal
from hbvm_bench.store import merge as merging
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.store.store import Store
from hbvm_bench.summaries import compare as comparing
from hbvm_bench.summaries import export as exporting
from hbvm_bench.summaries.table import Table

CHANGED = 1


def compare(
    first: Annotated[Path, typer.Argument(help="A run, as in runs/sitnikov.")],
    second: Annotated[Path, typer.Argument(help="Another run of the same campaign.")],
    as_json: Annotated[bool, typer.Option("--json", help="JSON output.")] = False,
) -> None:
    """Compare two runs; report changes that exceed the noise.

    Exit code 0 if there are none, 1 if there are some or a case is missing in one of the runs.
    """
    comparison = comparing.compare(Store(first), Store(second))
    if as_json:
        terminal.print_json(asdict(comparison))
    else:
        _print(comparison, terminal.console(), str(first), str(second))
    if not comparison.unchanged:
        raise typer.Exit(CHANGED)


def _print(comparison: comparing.RunComparison, console: Console, first: str, second: str) -> None:
    for where, names in ((first, comparison.only_first), (second, comparison.only_second)):
        for name in names:
            console.print(Text(f"only in {where}: {name}"))
    if comparison.behind:
        console.print(Text(f"reason: {'; '.join(comparison.behind)}"))
    numbers = comparison.equal + comparison.rounded
    changed = sum(change.quantity != "outcome" for change in comparison.changed)
    endings = len(comparison.changed) - changed
    console.print(
        f"numerical metrics of {comparison.cases} cases: {numbers + changed} compared, "
        f"{comparison.equal} equal, {comparison.rounded} within rounding, {changed} changed; "
        f"{endings} outcomes changed"
    )
    _table(comparison.changed, first, second)
    if comparison.noise is not None:
        within = comparison.timed - len(comparison.slower) - len(comparison.faster)
        console.print(
            f"times, each divided by the calibration beside it: {comparison.timed} compared, {within} within "
            f"noise (a factor of {comparison.noise:.2f} in a typical case), {len(comparison.slower)} slower, "
            f"{len(comparison.faster)} faster"
        )
    _table([*comparison.slower, *comparison.faster], first, second)
    for sentence in comparison.untimed:
        console.print(Text(f"time not compared: {sentence}"))
    if comparison.unchanged:
        console.print("no change exceeds the noise.")


def _table(changes: Sequence[comparing.Change], first: str, second: str) -> None:
    rows = [
        (change.problem, change.method, change.quantity, change.before, change.after) for change in changes
    ]
    if rows:
        head = ("problem", "method", "quantity", first, second)
        terminal.print_table(Table("", head, rows, words=range(len(head))))


def merge(
    runs: Annotated[list[Path], typer.Argument(help="Two or more runs.")],
    out: Annotated[Path, typer.Option("--out", help="A new directory.")],
) -> None:
    """Merge several runs into a new one; of duplicates, keep the most complete."""
    cases, records, left_out = merging.merge(merging.stores(runs), Store(out))
    print(f"{records} of {cases} cases in {out}")
    if left_out:
        print(f"{left_out} left out: damaged; run them again")


def export(
    directory: Annotated[Path, typer.Argument(help="A run, as in runs/sitnikov, or a report.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="A file that ends in .csv or .parquet.")],
    table: Annotated[
        str, typer.Option(help="cases; timings, one row per sample; or series, one row per number.")
    ] = "cases",
) -> None:
    """Write a run as a flat table, for a spreadsheet or a data frame."""
    ensure_writable(out.parent)
    print(f"{exporting.export([directory], out, table)} rows in {out}")
