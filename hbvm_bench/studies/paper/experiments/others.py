"""Two of the paper's problems with the established libraries, at one setting each, chosen for accuracy."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from hbvm_bench.campaign.identity import make_method
from hbvm_bench.summaries.table import NONE, Table
from integrators import Solution, integrate
from integrators.protocol import MethodBase
from problems import Problem
from problems.catalogue.henon_heiles import beyond_triangle
from problems.errors import InputError

from . import henon_heiles, period_annulus

# Every family has the same number of settings here: one, chosen by us for accuracy; and
# the paper's two methods, at the paper's steps. heyoka's compact mode compiles in less
# time; what it costs in a run is not compared here.
TAYLOR = "Taylor(tol=1e-15, high_accuracy=True, compact_mode=True)"
GLOBAL = 'IAS15(mode="global")'
MAPS = ("WHFast(h=0.02)", "SemiImplicitEuler(h=0.02)")
EXPLICIT = ("Dopri8(rtol=1e-13, atol=1e-15)", "DOP853(rtol=3e-14, atol=1e-16)")
LIBRARIES = (TAYLOR, GLOBAL, "Leapfrog(h=0.05, order=8)", *MAPS, *EXPLICIT)
HENON_HEILES = ("Gauss(s=2, h=1.0)", "HBVM(k=4, s=2, h=1.0)", "HBVM(k=12, s=8, h=0.5)", *LIBRARIES)
PERIOD_ANNULUS = ("Gauss(s=2, h=1.0)", "HBVM(k=5, s=2, h=1.0)", "HBVM(k=15, s=6, h=0.25)", *LIBRARIES)
HENON_SPAN = 5000.0
LOOK = 4.0  # time between two looks at a library's orbit; one that departs blows up within it


@dataclass(frozen=True)
class MethodRow:
    """One method on one problem."""

    method: str  # as written
    numbers: dict[str, float]  # by name; those that have no meaning are missing
    remark: str  # why it refused, how it ended


Found = tuple[dict[str, float], str]  # the numbers, and how it ended
Columns = Mapping[str, tuple[str, Callable[[float], str]]]  # head: name of the number, how it is written


def table(key: str, rows: Mapping[str, MethodRow], columns: Columns, title: str, note: str) -> Table:
    """Return the results as a table."""

    def cells(row: MethodRow) -> list[str]:
        return [write(row.numbers[name]) if name in row.numbers else NONE for name, write in columns.values()]

    return Table(
        title,
        ("method", *columns, "remark"),
        [(row.method, *cells(row), row.remark) for row in rows.values()],
        note,
        words=(0, len(columns) + 1),
        key=key,
    )


def measured(place: str, text: str) -> MethodRow:
    """Run a method on one of the `PLACES`; one that refuses it, or whose library is missing, says why."""
    run, start = PLACES[place]
    method, problem = make_method(text), start()
    refused = method.accepts(problem)
    try:
        if refused is None:
            method.compile(problem.system)
    except InputError as error:
        refused = str(error)
    return MethodRow(text, {}, refused) if refused is not None else MethodRow(text, *run(method, problem))


def _on_henon_heiles(method: MethodBase, problem: Problem) -> Found:
    """Return the largest error of H, the distance beyond the triangle, and how long the orbit is true."""
    times = np.arange(0.0, HENON_SPAN + 1.0)
    solution = integrate(problem, method, times=times)
    truth = integrate(problem, henon_heiles.TRUTH, times=times).y[: len(solution.y)]
    finite = np.isfinite(solution.y).all(axis=1) & (np.abs(solution.y[:, :2]).max(axis=1) < henon_heiles.GONE)
    numbers = {
        "energy": float(solution.errors()["energy"][finite].max()),
        "outside": float(beyond_triangle(solution.y[finite]).max()),
        "agrees": henon_heiles.parted(solution.t, solution.y, truth),
    }
    return numbers, _ended(solution) if solution.status.failed else ""


def _on_period_annulus(method: MethodBase, _: Problem) -> Found:
    """Return the edge found over the short span and its error in H."""
    every = None if method.library == "hbvm-bench" else LOOK
    edge = period_annulus.edge(method, period_annulus.SHORT_SPAN, every=every)
    return {"c": edge.c, "error": period_annulus.error_of(edge.c)}, ""


def _ended(solution: Solution) -> str:
    return f"{solution.status.replace('_', ' ')} at t = {solution.t_stop:.5g}"


PLACES: dict[str, tuple[Callable[[MethodBase, Problem], Found], Callable[[], Problem]]] = {
    "henon-heiles": (_on_henon_heiles, partial(henon_heiles.start, HENON_SPAN)),
    "period-annulus": (_on_period_annulus, lambda: period_annulus.PROBLEM),
}
