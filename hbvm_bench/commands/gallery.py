"""The command ``hbvm-bench gallery``."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.gallery import pages
from hbvm_bench.store import ensure_writable


def gallery(
    directory: Annotated[Path, typer.Argument(help="Where problems.md goes, as in docs.")],
    pictures: Annotated[bool, typer.Option(help="Draw the pictures again.")] = True,
) -> None:
    """Write the page on the problems, with formulas and pictures, from the problems themselves."""
    ensure_writable(directory)
    for path in pages.write(directory, with_pictures=pictures):
        print(path)
