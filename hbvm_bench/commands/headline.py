"""The command ``hbvm-bench headline``."""

from pathlib import Path
from typing import Annotated

import typer

from hbvm_bench import automatic, machine
from hbvm_bench.cells import in_markdown
from hbvm_bench.race import results, tables
from hbvm_bench.race.contests import CONTESTS
from hbvm_bench.report.markdown import plain
from problems.errors import InputError


def headline(
    reports: Annotated[Path, typer.Argument(help="Where race/ and automatic/ lie.")] = Path("reports"),
) -> None:
    """Print the README's tables of times as markdown, from stored results alone."""
    races = results.by_kind(reports / "race", list(CONTESTS))
    duels = automatic.by_kind(reports / "automatic")
    if not races and not duels:
        raise InputError(f"there is no result of a race or of automatic under {str(reports)!r}.")
    said = [one.machine for found in races.values() for one in found]
    parts = [f"{plain(kind)}\n\n{in_markdown(tables.headline(found))}" for kind, found in races.items()]
    parts += [in_markdown(tables.kinds(races))] if len(races) > 1 else []
    parts += [in_markdown(automatic.ratios(duels))] if duels else []
    said += [one.machine for runs in duels.values() for one in runs]
    parts += dict.fromkeys(plain(f"{machine.kind(one)}: {machine.sentence(one)}") for one in said)
    print("\n\n".join(parts))


__all__ = ["headline"]
