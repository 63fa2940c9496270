"""The command ``hbvm-bench automatic``."""

from typing import Annotated

import typer
from rich import box
from rich.table import Table

from hbvm_bench import automatic as automatic_
from hbvm_bench import terminal


def automatic(
    problems: Annotated[list[str] | None, typer.Argument(help="Problems; all four by default.")] = None,
    rounds: Annotated[int, typer.Option(help="Interleaved timing samples.")] = 25,
) -> None:
    """Race HBVM that chooses everything itself, HBVM(), against heyoka's Taylor(tol=1e-15)."""
    console = terminal.console()
    table = Table(
        "problem", "goal", "Taylor / HBVM", "quartiles", "method", "steps", "energy", "position",
        box=box.SIMPLE_HEAD, pad_edge=False,
    )  # fmt: skip
    with console.status("compiling") as status:
        found = automatic_.duels(problems or [], rounds, lambda key: status.update(f"running {key}"))
    for duel in found:
        low, high = duel.quartiles
        verdict = "reached" if duel.reached else "missed" if duel.as_accurate else "not as accurate"
        for first, side in ((True, duel.ours), (False, duel.theirs)):
            table.add_row(
                duel.problem if first else "",
                f"≥ {duel.goal:g}" if first else verdict,
                f"{duel.ratio:.2f}" if first else "",
                f"{low:.2f} … {high:.2f}" if first else "",
                side.method, str(side.steps), f"{side.energy:.1e}", f"{side.position:.1e}",
            )  # fmt: skip
    console.print(table)


__all__ = ["automatic"]
