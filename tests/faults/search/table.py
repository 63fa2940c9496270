"""The whole search as a table: class of systems and way of integration against what came of it.

From the root of the repository: ``python -m tests.faults.search.table [--group TEXT] [--list]``.
"""

import argparse
import math
import sys
from collections.abc import Iterable, Sequence
from time import perf_counter

import numpy as np

from . import at_rest, general, jumping, kinked, pulsed, singular, smooth, units
from .shape import Case, Shape
from .ways import FAILED, RIGHT, SILENT, WARNED, Outcome, outcomes

SHAPES: list[Shape] = [
    shape
    for module in (smooth, general, kinked, pulsed, at_rest, jumping, singular, units)
    for shape in module.SHAPES
]


def search(cases: Iterable[Case]) -> list[Outcome]:
    """Integrate each case in every way; overflow in a formula is for the methods to tell."""
    with np.errstate(all="ignore"):
        return [outcome for case in cases for outcome in outcomes(case)]


def table(found: Sequence[Outcome]) -> str:
    """Return counts by class and way."""
    rows = list(dict.fromkeys((outcome.group, outcome.way) for outcome in found))
    groups = list(dict.fromkeys(outcome.group for outcome in found))
    rows.sort(key=lambda row: groups.index(row[0]))
    lines = [
        f"{'class':30} {'way':26} {'runs':>5} {'silent':>6} {'warned':>6} {'failed':>6} "
        f"{'right, warned':>13} {'worst silent':>12}"
    ]
    for group, way in rows:
        mine = [outcome for outcome in found if (outcome.group, outcome.way) == (group, way)]
        counts = {kind: sum(outcome.verdict == kind for outcome in mine) for kind in (SILENT, WARNED, FAILED)}
        needless = sum(outcome.verdict == RIGHT and outcome.warned for outcome in mine)
        errors = [outcome.error for outcome in mine if outcome.verdict == SILENT]
        worst = f"{max(errors):.1e}" if errors else ""
        lines.append(
            f"{group:30} {way:26} {len(mine):5} {counts[SILENT]:6} {counts[WARNED]:6} {counts[FAILED]:6} "
            f"{needless:13} {worst:>12}"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--group", default="", help="classes whose name contains this")
    parser.add_argument("--shape", default="", help="formulas whose name contains this")
    parser.add_argument("--list", action="store_true", help="list what was wrong or failed")
    arguments = parser.parse_args()
    shapes = [shape for shape in SHAPES if arguments.group in shape.group and arguments.shape in shape.name]
    found: list[Outcome] = []
    for shape in shapes:
        began = perf_counter()
        found += search(shape.cases())
        print(f"{shape.group}: {shape.name}: {perf_counter() - began:.1f} s", file=sys.stderr, flush=True)
    if arguments.list:
        for one in found:
            if one.verdict != RIGHT:
                error = "" if math.isinf(one.error) else f"{one.error:.1e}"
                print(f"{one.verdict:15} {error:8} {one.way:26} {one.group}: {one.case}: {one.said[:150]}")
    print(f"{sum(shape.draws for shape in shapes)} systems, {len(found)} runs")
    print(table(found))


if __name__ == "__main__":
    main()
