"""The command ``hbvm-bench export``."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.store.files import ensure_writable
from hbvm_bench.store.store import Store
from hbvm_bench.summaries import export as exporting


def export(
    directory: Annotated[Path, typer.Argument(help="A run, as in runs/sitnikov.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="A file that ends in .csv or .parquet.")],
    table: Annotated[
        str, typer.Option(help="cases; timings, one row per sample; or series, one row per number.")
    ] = "cases",
) -> None:
    """Write a run as a flat table, for a spreadsheet or a data frame."""
    ensure_writable(out.parent)
    print(f"{exporting.export(Store(directory), out, table)} rows in {out}")


__all__ = ["export"]
