"""The command ``hbvm-bench advise``."""

from typing import Annotated

import typer

from hbvm_bench.campaign.identity import typed_problem
from hbvm_bench.report import terminal
from hbvm_bench.summaries.table import Table


def advise(
    problem: Annotated[str, typer.Argument(help='A problem, as in "kepler(e=0.6)".')],
    accuracy: Annotated[
        float, typer.Option(help="Largest error of the positions wanted at the end, relative.")
    ] = 1e-10,
    as_json: Annotated[bool, typer.Option("--json", help="Everything, for programs.")] = False,
) -> None:
    """Say which of our methods and which step reach an accuracy, at what cost: a few short runs."""
    from integrators.advice import advise as advise_

    advice = advise_(typed_problem(problem), accuracy)
    if as_json:
        terminal.print_json(
            {
                "problem": repr(advice.problem),
                "accuracy": accuracy,
                "reached": advice.reached,
                "why": advice.why,
                "proposals": [
                    {
                        "method": repr(one.method),
                        "position": one.position,
                        "energy": one.energy,
                        "seconds": one.seconds,
                        "steps": one.steps,
                    }
                    for one in advice.proposals
                ],
            }
        )
        return
    rows = [
        (
            repr(one.method),
            f"{one.position:.1e}",
            "" if one.energy is None else f"{one.energy:.1e}",
            f"{one.seconds:.2g}",
            f"{one.steps:,}",
        )
        for one in advice.proposals
    ]
    head = ("method", "position", "energy", "seconds", "steps")
    terminal.print_table(Table(f"{advice.problem!r}, accuracy {accuracy:g}", head, rows))
    terminal.console().print(str(advice), highlight=False, markup=False, soft_wrap=True)


__all__ = ["advise"]
