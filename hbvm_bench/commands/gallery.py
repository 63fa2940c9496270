"""The command ``hbvm-bench gallery``."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.gallery import compile_times, pages
from hbvm_bench.store.files import ensure_writable


def gallery(
    directory: Annotated[Path, typer.Argument(help="Where problems.md goes, as in docs.")],
    pictures: Annotated[bool, typer.Option(help="Draw the pictures again.")] = True,
    times: Annotated[
        bool, typer.Option("--compile-times", help="Only measure how long compiling takes: compile_times.md.")
    ] = False,
) -> None:
    """Write the pages on problems and engines, with formulas and pictures, from the problems themselves."""
    ensure_writable(directory)
    if times:
        path = directory / "compile_times.md"
        path.write_text(compile_times.page(), encoding="utf-8")
        print(path)
        return
    for path in pages.write(directory, with_pictures=pictures):
        print(path)
