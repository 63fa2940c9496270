"""docs/compile_times.md: how long it takes until the vector field of a large system runs."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import machine
from hbvm_bench.report.markdown import printed
from hbvm_bench.summaries.table import Table
from integrators.kernel.native import stages
from problems import targets
from problems.problem import Problem

CASES = (
    "cluster(n=10)",
    "cluster(n=50)",
    "cluster(n=200)",
    "outer_solar_system()",
    "solar_system()",
    "lennard_jones(rings=5)",
    "fput(n=1000)",
    "toda(n=1000)",
    "sine_gordon(n=1000)",
    "nonlinear_wave(n=1000)",
)
LANES = 8

HEAD = """<!-- made by: python -m docs.problem_pages --compile-times -->
# From a Hamiltonian to machine code

In `m.sum(term, index)` the term is traced once and stays a loop: the code has the length of the term, however
many bodies there are. CPU seconds of one process on {processor} ({python}) with empty caches and numba
loaded.

- trace: running the function on symbols, and differentiating it;
- emit: writing the source, `lines` long;
- compile: by numba, for one state (as SciPy's solvers call it), and of what HBVM calls on {lanes}
  stages at once (the force of a separable system, otherwise the vector field).

"""


class Times(NamedTuple):
    """What one system took, in processor seconds."""

    problem: str
    unknowns: int
    trace: float
    emit: float
    lines: int  # of the emitted source
    scalar: float  # numba for one state
    lanes: float  # and for `LANES` stages at once


def measure(text: str) -> Times:
    """Trace, emit and compile the vector field of a problem, as it prints, from nothing."""
    traced, problem = _seconds(lambda: _traced(text))
    emitted, source = _seconds(lambda: targets.source(problem.system, "field", "numba"))
    scalar, lanes = _seconds(lambda: _compiled(problem))[0], _seconds(lambda: _on_lanes(problem))[0]
    lines = source.text.count("\n")
    return Times(repr(problem), problem.system.dim, traced, emitted, lines, scalar, lanes)


def page() -> str:
    """Measure `CASES` and return the page; it takes half a minute."""
    for text in ("pendulum()", "cluster(n=4)"):
        measure(text)  # what is done only once in a process is not the systems'
    rows = [measure(text) for text in CASES]
    here = machine.describe()
    compiled = ("compile, one state (s)", f"compile, {LANES} stages (s)")
    columns = ("problem", "unknowns", "trace (ms)", "emit (ms)", "lines", *compiled)
    cells = [
        (
            *(row.problem, str(row.unknowns), f"{1e3 * row.trace:.1f}", f"{1e3 * row.emit:.1f}"),
            *(str(row.lines), f"{row.scalar:.2f}", f"{row.lanes:.2f}"),
        )
        for row in rows
    ]
    table = Table("", columns, cells)
    head = HEAD.format(processor=here["processor"], python=here["python"], lanes=LANES)
    return f"{head}{printed(table)}\n"


def _seconds(action: Callable[[], Any]) -> tuple[float, Any]:
    started = time.process_time()
    result = action()
    return time.process_time() - started, result


def _traced(text: str) -> Problem:
    problem = make_problem(text)
    assert problem.system.field is not None
    return problem


def _compiled(problem: Problem) -> None:
    import numba

    vector = numba.types.Array(numba.types.float64, 1, "C")
    kinds = (numba.types.float64, vector, vector, vector)
    numba.njit(kinds, error_model="numpy")(_function(problem, "field"))


def _on_lanes(problem: Problem) -> None:
    name = "force" if problem.system.separable else "field"
    stages.build(_function(problem, name), LANES)


def _function(problem: Problem, name: str) -> Any:
    return targets.numba(problem.system, name).py_func
