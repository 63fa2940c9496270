"""The command ``hbvm-bench headline``."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench.measure import machine
from hbvm_bench.report.markdown import plain, printed
from hbvm_bench.studies.automatic import report as automatic
from hbvm_bench.studies.automatic.runs import by_kind
from hbvm_bench.studies.race import results, tables
from problems.errors import InputError


def headline(
    reports: Annotated[Path, typer.Argument(help="Where race/ and automatic/ lie.")] = Path("reports"),
) -> None:
    """Print the README's tables of times as markdown, from stored results alone.

    For every kind of processor the ratios, the goals with what was measured, and the settings
    that were compared; then HBVM() against heyoka's Taylor method, one column for each kind.
    """
    races = results.by_kind(reports / "race")
    duels = by_kind(reports / "automatic")
    if not races and not duels:
        raise InputError(f"there is no result of a race or of automatic under {str(reports)!r}.")
    parts = []
    for kind, found in races.items():
        parts += [f"**{plain(kind)}**", *map(plain, machine.sentences(race.machine for race in found))]
        shown = [tables.headline(found), tables.goals(found), tables.behind(found)]
        parts += [printed(table) for table in shown if table.rows]
    parts += [printed(tables.kinds(races))] if len(races) > 1 else []
    if duels:
        parts += [printed(automatic.ratios(duels))]
        for kind, runs in duels.items():
            parts += [plain(f"{kind}: {said}") for said in machine.sentences(run.machine for run in runs)]
    print("\n\n".join(parts))


__all__ = ["headline"]
