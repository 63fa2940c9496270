"""The command ``hbvm-bench merge``."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.store import merge as merging
from hbvm_bench.store.store import Store


def merge(
    runs: Annotated[list[Path], typer.Argument(help="Two runs or more.")],
    out: Annotated[Path, typer.Option("--out", help="A new directory.")],
) -> None:
    """Put several runs together in a new one; of a case in several, the one that got further."""
    cases, records, left_out = merging.merge(merging.stores(runs), Store(out))
    print(f"{records} of {cases} cases in {out}")
    if left_out:
        print(f"{left_out} left out: damaged, or measured by another version of hbvm-bench; run them again")


__all__ = ["merge"]
