"""The command ``hbvm-bench automatic``."""

import math
from typing import Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from hbvm_bench import automatic as automatic_
from hbvm_bench import general as general_
from hbvm_bench import terminal


def automatic(
    problems: Annotated[list[str] | None, typer.Argument(help="Problems; all by default.")] = None,
    rounds: Annotated[int, typer.Option(help="Interleaved timing samples, against heyoka.")] = 25,
    general: Annotated[
        bool, typer.Option("--general", help="General and stiff systems instead, beside SciPy's methods.")
    ] = False,
    limit: Annotated[
        float, typer.Option(help="With --general: seconds after which a run is given up.")
    ] = 30.0,
) -> None:
    """Race HBVM that chooses everything itself, HBVM(), against heyoka's Taylor(tol=1e-15).

    With --general: van der Pol's equation, Robertson's chemistry, a driven pendulum and Arenstorf's
    orbit against their known end values, HBVM() beside Radau and DOP853; and a stiff chain
    at a step a hundred times as long as one at which the fixed-point iteration fails.
    """
    console = terminal.console()
    if general:
        _general(console, problems or [], limit)
        return
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


def _general(console: Console, names: list[str], limit: float) -> None:
    table = Table(
        "problem", "method", "end", "energy", "steps", "evaluations", "ms", "solver",
        box=box.SIMPLE_HEAD, pad_edge=False,
    )  # fmt: skip
    with console.status("compiling") as status:
        found = general_.outcomes(names, limit, lambda text: status.update(f"running {text}"))
    before = ""
    for run in found:
        table.add_row(
            "" if run.problem == before else run.problem, run.method,
            "" if math.isnan(run.error) else f"{run.error:.1e}",
            "" if math.isnan(run.energy) else f"{run.energy:.1e}",
            str(run.steps), str(run.evaluations), f"{1e3 * run.seconds:.3g}", run.ending or run.solver,
        )  # fmt: skip
        before = run.problem
    console.print(table)
    console.print(
        "end: error of the end, of van der Pol and Robertson relative; energy: largest error on the way. "
        "An evaluation is one of the field at one state; ours evaluates 8 or 16 at a time.",
        style="dim",
    )


__all__ = ["automatic"]
