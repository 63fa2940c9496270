"""The table of the page on gradients: ``python docs/plugins/gradients.py``.

The gradient of one number with respect to 4 and to 400 parameters: by the adjoint of our steps, and by
diffrax's two adjoints of its explicit method of order 8. Beside each its error, the time of a value and a
gradient (after compilation), and the memory that they took. The error is relative to the largest component,
against the gradient of `Gauss(s=12)` with steps of a quarter. Memory: of our steps the records; of
diffrax what XLA says of its temporary buffers.
"""

import argparse
from collections.abc import Callable
from functools import partial
from timeit import timeit
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
import problems
from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import interleaved
from hbvm_bench.report.markdown import printed
from hbvm_bench.summaries.table import Table
from integrators.dynamics.recorded import Recorded
from problems import Problem, targets

Array = NDArray[np.float64]
WIDTH = 20
END = 20.0
H = 0.25


def chain(q: Any, p: Any, par: Any) -> Any:
    """Return the energy of two oscillators with four parameters."""
    a, b, c, d = (par.w[i] for i in range(4))
    return (p[0] ** 2 + p[1] ** 2 + a * q[0] ** 2 + b * q[1] ** 2) / 2 + c * q[0] ** 2 * q[1] + d * q[1] ** 4


def net(y: Any, par: Any, m: Any) -> Any:
    """Return a field of 20 components with 400 weights."""
    return [
        m.tanh(m.sum(lambda j, i=i: par.w[WIDTH * i + j] * y[j], range(WIDTH))) - y[i] / 10
        for i in range(WIDTH)
    ]


def problem_of(count: int) -> Problem:
    """Return a problem with so many parameters, 4 or 400."""
    if count == 4:
        system: Any = problems.Hamiltonian(chain, dof=2, parameters={"w": [1.0, 1.5, 0.3, 0.2]})
        return Problem(system, q0=[0.3, -0.2], p0=[0.1, 0.4], t_end=END)
    weights = np.random.default_rng(0).standard_normal(WIDTH**2) / WIDTH**0.5
    system = problems.VectorField(net, dim=WIDTH, parameters={"w": weights.tolist()})
    return Problem(system, y0=np.linspace(-1.0, 1.0, WIDTH), t_end=END)


def loss(y: Any) -> Any:
    """Return a number at the end."""
    return y[0] ** 2 + y[1] * y[2]


def native(problem: Problem, method: Any) -> tuple[Callable[[], Array], float]:
    """Return what calculates the gradient, and bytes."""
    kept = Recorded(method.compile(problem.system), problem, [END]).kept
    return lambda: integrators.gradient(problem, method, loss, ["w"])[1]["w"], kept


def host(problem: Problem, adjoint: Any, h: float | None, tolerance: float | None) -> tuple[Any, float]:
    """Return the same of diffrax."""
    import diffrax as dx
    import jax

    term = dx.ODETerm(targets.jax(problem.system, "field"))
    controller = dx.ConstantStepSize() if tolerance is None else dx.PIDController(tolerance, tolerance)

    def value(par: Any) -> Any:
        solution: Any = dx.diffeqsolve(
            term, dx.Dopri8(), 0.0, END, h, jax.numpy.asarray(problem.y0), args=par, max_steps=4096,
            stepsize_controller=controller, adjoint=adjoint,
        )  # fmt: skip
        return loss(solution.ys[-1])

    compiled = jax.jit(jax.value_and_grad(value)).lower(jax.numpy.asarray(problem.par)).compile()
    analysis: Any = compiled.memory_analysis()
    return lambda: np.asarray(compiled(problem.par)[1]), analysis.temp_size_in_bytes


def rows(count: int) -> dict[str, tuple[Callable[[], Array], float]]:
    """Return the rows of the table for so many parameters."""
    import diffrax as dx
    import jax

    jax.config.update("jax_enable_x64", True)
    problem = problem_of(count)
    ours = [
        integrators.Gauss(s=8, h=H), integrators.HBVM(k=16, s=8, h=H), integrators.HBVM(tol=1e-10),
    ]  # fmt: skip
    theirs = {
        "`RecursiveCheckpointAdjoint`": dx.RecursiveCheckpointAdjoint(),
        "`BacksolveAdjoint`": dx.BacksolveAdjoint(),
    }
    found = {f"`integrators.gradient`, `{method!r}`": native(problem, method) for method in ours}
    for adjoint in theirs:
        name = f"`{type(adjoint).__name__}`"
        found[f"{name}, `Dopri8`, `dt0={H / 5}`"] = host(problem, adjoint, H / 5, None)
        found[f"{name}, `Dopri8`, tolerances 1e-10"] = host(problem, adjoint, None, 1e-10)
    return found


def table(count: int, rounds: int) -> Table:
    """Return the table for so many parameters."""
    found = rows(count)
    problem = problem_of(count)
    exact = integrators.gradient(problem, integrators.Gauss(s=12, h=H / 4), loss, ["w"])[1]["w"]
    first = [run() for run, _ in found.values()]
    samples = [partial(timeit, run, number=1) for run, _ in found.values()]
    seconds = np.array(interleaved(samples, rounds, order="as given"))
    cells = []
    for (name, (_, size)), gradient, times in zip(found.items(), first, seconds, strict=True):
        error = np.abs(gradient - exact).max() / np.abs(exact).max()
        cells.append((name, f"{error:.1e}", f"{1e3 * times.min():.3g} ms", f"{size / 1024:.0f} KiB"))
    return Table("", (f"{count} parameters", "error", "fastest round", "memory"), cells)


def main() -> None:
    """Print what the page shows."""
    parser = argparse.ArgumentParser(description="The table of the page on gradients.")
    parser.add_argument("--rounds", type=int, default=5, help="how often each row is timed")
    asked = parser.parse_args()
    for count in (4, 400):
        print(printed(table(count, asked.rounds)), "\n", flush=True)
    print(machine.sentence(machine.describe(measure=True)))


if __name__ == "__main__":
    main()
