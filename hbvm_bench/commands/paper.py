"""``hbvm-bench paper``: run the paper's experiments and write the report."""

import os
import time
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

import typer

from hbvm_bench.report import terminal
from hbvm_bench.store.files import ensure_writable, write_all
from problems.errors import unknown

if TYPE_CHECKING:  # what computes costs seconds to import
    from collections.abc import Sequence

    from hbvm_bench.studies.paper.document import Part

PARTS = ("sitnikov", "henon-heiles", "period-annulus", "claims")
DEFAULT = Path("reports/paper")


def paper(
    part: Annotated[str | None, typer.Argument(help=f"One of {', '.join(PARTS)}; all by default.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Default: reports/paper, or runs/paper-PART for one part.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default one per core.")] = None,
) -> None:
    """Run the seed paper's experiments again and write the report: claim, paper, here."""
    if part is not None and part not in PARTS:
        raise unknown("part of the paper", part, PARTS)
    directory = out or (DEFAULT if part is None else Path("runs") / f"paper-{part}")
    ensure_writable(directory / "figures")
    command = "hbvm-bench paper" + (f" {part}" if part else "")
    seconds = write_report(
        PARTS if part is None else (part,), directory, jobs or len(os.sched_getaffinity(0)), command
    )
    terminal.console(stderr=True).print(f"{directory / 'index.html'} written in {seconds:.0f} s")


def write_report(names: tuple[str, ...], directory: Path, jobs: int, command: str) -> float:
    """Compute the named parts and write ``report.md``, ``index.html``, ``figures/`` and ``data/``.

    Parameters
    ----------
    names : tuple of str
        Among `PARTS`.
    directory : Path
        Made if missing.
    jobs : int
        Processes.
    command : str
        What to print as the way to get it again.

    Returns
    -------
    float
        Seconds that it took.
    """
    from hbvm_bench.studies.paper.tasks import run_all

    started = time.perf_counter()
    modules = [_module(name) for name in names]
    tasks = [task for module in modules for task in module.tasks()]
    console = terminal.console(stderr=True)
    count = 0

    def done(key: str, seconds: float) -> None:
        nonlocal count
        count += 1
        console.print(f"  {count}/{len(tasks)} {key}: {seconds:.1f} s", markup=False)

    results = run_all(tasks, jobs, done)
    write_parts([module.part(results) for module in modules], directory, command)
    return time.perf_counter() - started


def write_parts(parts: "Sequence[Part]", directory: Path, command: str) -> None:
    """Write the documents, figures and data of parts that are computed already."""
    from hbvm_bench.report.figures import canvas
    from hbvm_bench.studies.paper.page import as_csv, claims_csv, markdown, page

    files: dict[str, bytes] = {
        "report.md": markdown(parts, command).encode(),
        "index.html": page(parts, command).encode(),
        "data/claims.csv": claims_csv(parts).encode(),
    }
    for part in parts:
        files |= canvas.files(part.pictures)
        for table in part.tables:
            files[f"data/{table.key}.csv"] = as_csv([table.flat_head, *table.rows]).encode()
    write_all({directory / name: data for name, data in files.items()})


def _module(name: str) -> ModuleType:
    from hbvm_bench.studies.paper import (
        henon_heiles_part,
        period_annulus_part,
        properties_part,
        sitnikov_part,
    )

    modules = (sitnikov_part, henon_heiles_part, period_annulus_part, properties_part)
    return modules[PARTS.index(name)]
