"""Gradients of a number at the end with respect to start and parameters, beside diffrax and heyoka.

diffrax has two adjoints, heyoka variational equations, and we have both: `integrators.gradient` and
``integrate(..., variations=...)``. All of them run in turn in one process, compiled before.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hbvm_bench.measure.computation import Task
from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Maker, Note
from hbvm_bench.report.parts import Part, PartResults
from hbvm_bench.summaries.goals import ratio_text
from hbvm_bench.summaries.rows import seconds as in_words
from hbvm_bench.summaries.table import Table
from integrators import HBVM, Gauss, gradient, integrate
from integrators.protocol import Array
from problems import Hamiltonian, Problem, VectorField, targets

from .experiments import Times, finished, seconds_of, taken_on_a_core
from .variations import Variational

KEY, TITLE = "gradients", "Gradients"
WIDTH, END = 6, 20.0
OURS = "HBVM: gradient, HBVM()"
ACCURATE = 1e-9  # errors of the settings that the sentence compares
WRT = ("y0", "w")


def oscillators() -> Problem:
    """Return two coupled oscillators, with four components and four parameters."""

    def energy(q: Any, p: Any, par: Any) -> Any:
        a, b, c, d = (par.w[i] for i in range(4))
        potential = a * q[0] ** 2 / 2 + b * q[1] ** 2 / 2 + c * q[0] ** 2 * q[1] + d * q[1] ** 4
        return (p[0] ** 2 + p[1] ** 2) / 2 + potential

    system = Hamiltonian(energy, dof=2, parameters={"w": [1.0, 1.5, 0.3, 0.2]})
    return Problem(system, q0=[0.3, -0.2], p0=[0.1, 0.4], t_end=END)


def net() -> Problem:
    """Return a neural network as a vector field, with six components and 36 weights."""

    def field(y: Any, par: Any, m: Any) -> Any:
        return [
            m.tanh(m.sum(lambda j, i=i: par.w[WIDTH * i + j] * y[j], range(WIDTH))) - y[i] / 10
            for i in range(WIDTH)
        ]

    weights = np.random.default_rng(0).standard_normal(WIDTH**2) / WIDTH**0.5
    system = VectorField(field, dim=WIDTH, parameters={"w": weights.tolist()})
    return Problem(system, y0=np.linspace(-1.0, 1.0, WIDTH), t_end=END)


PROBLEMS = {"two oscillators": oscillators, "a neural network": net}


@dataclass(frozen=True)
class Gradients:
    """Times, and errors relative to the largest component, by library and setting.

    Attributes
    ----------
    times : Times
        Of a value with all its derivatives.
    errors : dict of float
        Against `Gauss(s=12)` with short steps.
    numbers : int
        How many derivatives there are.
    """

    times: Times
    errors: dict[str, float]
    numbers: int


def loss(y: Any) -> Any:
    """Return a number at the end."""
    return y[0] ** 2 + y[1] * y[2]


def measured(name: str, rounds: int) -> Gradients:
    """Return the times and errors for a problem of `PROBLEMS`, the first round left out."""
    problem = PROBLEMS[name]()
    exact, runs = by_adjoint(problem, Gauss(s=12, h=END / 320)), settings(problem)
    errors = {key: float(np.abs(run() - exact).max() / np.abs(exact).max()) for key, run in runs.items()}
    times = taken_on_a_core({key: partial(seconds_of, run) for key, run in runs.items()}, rounds)
    return Gradients(times, errors, exact.size)


def settings(problem: Problem) -> dict[str, Callable[[], Array]]:
    """Return what computes the gradient, start first, by library and setting."""
    import diffrax

    runs: dict[str, Callable[[], Array]] = {
        OURS: partial(by_adjoint, problem, HBVM()),
        "HBVM: gradient, HBVM(tol=1e-10)": partial(by_adjoint, problem, HBVM(tol=1e-10)),
        "HBVM: variations, HBVM()": partial(by_variations, problem),
    }
    for tol in (1e-13, 1e-10):
        for adjoint in (diffrax.RecursiveCheckpointAdjoint(), diffrax.BacksolveAdjoint()):
            runs[f"diffrax: {type(adjoint).__name__}, Dopri8, tol={tol:g}"] = by_diffrax(
                problem, adjoint, tol
            )
    for tol in (1e-15, 1e-10):
        runs[f"heyoka: var_ode_sys, tol={tol:g}"] = by_heyoka(problem, tol)
    return runs


def by_adjoint(problem: Problem, method: HBVM | Gauss) -> Array:
    """Return the gradient by the adjoint of our steps."""
    return np.concatenate([*gradient(problem, method, loss, WRT)[1].values()])


def by_variations(problem: Problem) -> Array:
    """Return the gradient from our tangent vectors."""
    solution = finished(integrate(problem, HBVM(), [END], variations=WRT))
    return _chained(solution.y[-1], solution.variations[-1])


def by_heyoka(problem: Problem, tol: float) -> Callable[[], Array]:
    """Return the same of heyoka; compact mode is what its authors recommend for large systems."""
    dim, numbers = problem.system.dim, problem.system.dim + problem.par.size
    compiled = Variational(problem, dim, parameters=problem.par.size, tol=tol, compact_mode=dim == WIDTH)

    def run() -> Array:
        state = compiled.run()
        return _chained(state[:dim], state[dim:].reshape(dim, numbers))

    return run


def by_diffrax(problem: Problem, adjoint: Any, tol: float) -> Callable[[], Array]:
    """Return the same of diffrax, compiled by JAX for doubles."""
    import diffrax
    import jax

    term = diffrax.ODETerm(targets.jax(problem.system, "field"))
    controller = diffrax.PIDController(tol, tol)

    def value(y0: Any, par: Any) -> Any:
        solution: Any = diffrax.diffeqsolve(
            term, diffrax.Dopri8(), 0.0, END, None, y0, args=par,
            stepsize_controller=controller, adjoint=adjoint,
        )  # fmt: skip
        return loss(solution.ys[-1])

    given = jax.numpy.asarray(problem.y0), jax.numpy.asarray(problem.par)
    compiled = jax.jit(jax.value_and_grad(value, argnums=(0, 1))).lower(*given).compile()
    return lambda: np.concatenate(compiled(*given)[1])


def _chained(y: Array, derivatives: Array) -> Array:
    """Return the gradient of `loss` from the end and its derivatives, shape (dim, n)."""
    return 2 * y[0] * derivatives[0] + y[2] * derivatives[1] + y[1] * derivatives[2]


def part(rounds: int) -> Part:
    """Return the computations and their section."""
    tasks = [Task(name, partial(measured, name, rounds), timed=True) for name in PROBLEMS]

    def blocks(results: PartResults) -> list[Maker]:
        return [(f"gradients of {name}", partial(shown, name, results)) for name in PROBLEMS]

    return Part(KEY, TITLE, tasks, lambda results: [], blocks)


def shown(name: str, results: PartResults) -> list[Note | Table]:
    """Return the sentence and the table of one problem."""
    return [Note(sentence(name, results[name])), table(name, results[name])]


def sentence(name: str, found: Gradients) -> str:
    """Return which library is the fastest with accurate settings, and how long the others take."""
    best: dict[str, float] = {}
    for key, seconds in found.times.seconds.items():
        if found.errors[key] <= ACCURATE:
            library, median = key.partition(":")[0], Spread.from_samples(seconds).median
            best[library] = min(best.get(library, median), median)
    fastest, *others = sorted(best, key=best.__getitem__)
    ratios = ", ".join(f"{library} {best[library] / best[fastest]:.2g}" for library in others)
    return (
        f"{name.capitalize()}, {found.numbers} derivatives with errors of at most {ACCURATE:g}: {fastest} is "
        f"the fastest. Times relative to it: {ratios}."
    )


def table(name: str, found: Gradients) -> Table:
    """Return the errors and times for one problem."""
    rows = []
    for key, seconds in found.times.seconds.items():
        pairs = zip(seconds, found.times.seconds[OURS], strict=True)
        rows.append(
            (
                *key.split(": ", 1),
                f"{found.errors[key]:.1e}",
                in_words(Spread.from_samples(seconds).median),
                "1" if key == OURS else ratio_text(Spread.from_samples([t / ours for t, ours in pairs])),
                found.times.verdict,
            )
        )
    return Table(
        f"A number at the end and its {found.numbers} derivatives: {name}",
        ("library", "setting", "error", "time", f"× {OURS}", "verdict"),
        rows,
        f"With respect to start and parameters, at t = {END:g}. Errors relative to the largest derivative, "
        "against Gauss(s=12) with short steps. Times: the median after compiling (`jax.jit` and doubles in "
        "diffrax); `integrators.gradient` traces the function once a call. Ratios: the median within each "
        "round, in brackets the quartiles.",
        words=(0, 1, 5),
        key=f"costs-gradients-{name.split()[-1]}",
    )
