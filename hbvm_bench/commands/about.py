"""``hbvm-bench inspect | engines | advise``: the analysis of a problem."""

from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table as Grid
from rich.text import Text

import problems
from hbvm_bench.campaign.identity import typed_problem
from hbvm_bench.report import terminal
from hbvm_bench.summaries import findings
from hbvm_bench.summaries.table import Table
from problems.errors import unknown


def inspect(
    system: Annotated[
        str, typer.Argument(help='A formula, as in "p^2/2 - cos(q)", or a problem, as in "kepler(e=0.9)".')
    ],
    parameters: Annotated[str, typer.Option("--par", help='Values in a formula, as in "k=2, m=0.5".')] = "",
    as_json: Annotated[bool, typer.Option("--json", help="JSON output.")] = False,
) -> None:
    """Analyse a Hamiltonian: degree, exact k, separability, cyclic coordinates, engines."""
    result = findings.inspect(system, parameters)
    if as_json:
        terminal.print_json(asdict(result))
        return
    table = Grid.grid(padding=(0, 2))
    for heading, sentence in findings.lines(result):
        table.add_row(Text(heading, style="bold"), Text(sentence))
    terminal.console().print(table)


def engines(
    names: Annotated[list[str] | None, typer.Argument(help="Problems by name; all by default.")] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print a Markdown table.")] = False,
) -> None:
    """Print which engine and which method accepts which problem, and why others do not."""
    for name in names or []:
        if name not in problems.names():
            raise unknown("problem", name, problems.names())
    table, reasons = findings.engines(names or [])
    if markdown:
        from hbvm_bench.report.markdown import printed  # what draws costs seconds to import

        print(printed(table), "", *(f"{i}. {reason}" for i, reason in enumerate(reasons, start=1)), sep="\n")
        return
    terminal.print_table(table)
    for i, reason in enumerate(reasons, start=1):
        terminal.console().print(f"{i}. {reason}", highlight=False)


def advise(
    problem: Annotated[str, typer.Argument(help='A problem, as in "kepler(e=0.6)".')],
    accuracy: Annotated[float, typer.Option(help="Largest relative position error at the end.")] = 1e-10,
    as_json: Annotated[bool, typer.Option("--json", help="JSON output.")] = False,
) -> None:
    """Recommend HBVM or Gauss settings for an accuracy, with their cost, from some thirty runs."""
    from integrators.methods.advice import advise as advise_

    advice = advise_(typed_problem(problem), accuracy)
    if as_json:
        terminal.print_json(
            {
                "problem": repr(advice.problem),
                "accuracy": accuracy,
                "reached": advice.reached,
                "until": advice.until,
                "horizon": advice.horizon,
                "why": advice.why,
                "proposals": [
                    {**vars(proposal), "method": repr(proposal.method)} for proposal in advice.proposals
                ],
            }
        )
        return
    rows = [
        (
            repr(proposal.method),
            f"{proposal.position:.1e}",
            "" if proposal.energy is None else f"{proposal.energy:.1e}",
            f"{proposal.seconds:.2g}",
            f"{proposal.steps:,}",
        )
        for proposal in advice.proposals
    ]
    head = ("method", "position", "energy", "seconds", "steps")
    terminal.print_table(Table(f"{advice.problem!r}, accuracy {accuracy:g}", head, rows))
    terminal.console().print(str(advice), highlight=False, markup=False, soft_wrap=True)
