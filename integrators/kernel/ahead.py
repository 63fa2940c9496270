"""Compile the kernel before it is needed."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from integrators.kernel.engines import (
    follow,
    iterations,
    lanes,
    line,
    look,
    orthonormal,
    pull,
    record,
    run,
    run_own,
    solver,
    steps,
    work,
)
from integrators.kernel.native import shipped
from integrators.kernel.routes import FEW_ROWS

ENGINES = {
    "steps": steps,
    "implicit solvers": solver,
    "line integrals": line,
    "ensembles": run,
    "ensembles with adaptive steps": run_own,
    "events": look,
    "variations": follow,
    "exponents": orthonormal,
    "recorded steps": record,
    "threads": work,
    "adjoints": pull,
}

FORMS = [
    (lanes, rows, by_columns)
    for rows in range(1, FEW_ROWS + 1)
    for lanes, by_columns in ((8, True), (16, False), (16, True))
]
"""Of whole iterations; see `integrators.kernel.step.fused`."""

WIDTHS = [(8, 8), (16, 8), (32, 8), (8, 4), (16, 4)]
"""Of trajectories side by side, and of a register; see `integrators.kernel.ensemble.prepared.width_for`."""


def compile_ahead(processes: int = 1) -> dict[str, float | None]:
    """Compile what every system needs, and keep it on disk: what is left is a part of a second per system.

    Parameters
    ----------
    processes : int
        How many compile at once. More than one start Python again, so a script that asks
        for them must be importable (``if __name__ == "__main__":``).

    Returns
    -------
    dict
        Seconds for each part of the kernel; ``None`` where it was on disk already.
    """
    if processes == 1:
        return dict(map(_compile, ENGINES))
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        return dict(pool.map(_compile, ENGINES))


def ship() -> None:
    """Write what every machine of this system can start from, where the package is built."""
    codes = {key: code for engine in ENGINES.values() for key, code in engine.for_levels().items()}
    texts = {
        around.key(form): around.lower(form)
        for around, forms in ((iterations, FORMS), (lanes, WIDTHS))
        for form in forms
    }
    shipped.write(codes, texts)


def _compile(name: str) -> tuple[str, float | None]:
    code = ENGINES[name].code()
    return name, None if code.from_cache else code.seconds
