"""The command ``hbvm-bench plugins``."""

import math
from typing import Annotated

import typer

from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.studies.plugins import costs
from problems.errors import InputError


def plugins(
    host: Annotated[str, typer.Argument(help="scipy, diffrax, rebound, or leak.")],
    rounds: Annotated[int, typer.Option("--rounds", help="How often each row is timed.")] = 5,
    span: Annotated[float, typer.Option("--span", help="Time units of the leak.")] = 1e5,
) -> None:
    """Measure our methods inside another library beside its own and the native kernel.

    ``leak`` shows the energy of DOP853 and of HBVM in the same call of ``solve_ivp``.
    """
    if rounds < 1 or not 0.0 < span < math.inf:
        raise InputError(
            f"plugins needs rounds >= 1 and a finite span > 0, not rounds={rounds}, span={span:g}."
        )
    if host == "leak":
        print("| t | DOP853 | HBVM |\n|--:|--:|--:|")
        for t, errors in costs.leak(span):
            print(f"| {t:.0f} | {errors['DOP853']:.2e} | {errors['HBVM']:.2e} |", flush=True)
        return
    from hbvm_bench.report.markdown import printed  # what draws costs seconds to import

    print(printed(costs.table(costs.measure(host, rounds))))
    print(f"\n{POSITION} Here those are its start and its end.")
    print(f"\n{machine.sentence(machine.describe(measure=True))}")
