"""The tables of the plugins' pages: ``python docs/plugins/costs.py scipy | diffrax | rebound | leak``.

What our methods cost inside other libraries: a plugin, the native kernel and the host's own, in turn. A row
is a call of another library's solver with our method in it, and not a method that the bench runs, so that it
is no campaign. Every row is compiled and run once before it is timed; then all rows run one after the other,
several rounds of it, so that what else the machine does meets them all.
"""

import argparse
import gc
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from timeit import timeit
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
import problems
from hbvm_bench.campaign.identity import kernel_digest
from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION, position_error
from hbvm_bench.measure.timing import busy, interleaved, load_between
from hbvm_bench.report.markdown import printed
from hbvm_bench.report.provenance import measured_on
from hbvm_bench.store.records import Load
from hbvm_bench.summaries.table import Table
from problems.catalogue.pendulum import exact_state
from problems.problem import Problem

Array = NDArray[np.float64]
Run = Callable[[], Array]
PENDULUM = 100.0  # time units
PLANETS = 100_000.0  # REBOUND's time units, 1.6e4 years


@dataclass(frozen=True)
class Cost:
    """A row of the table.

    Attributes
    ----------
    name : str
        What ran.
    energy, position : float
        Largest relative error of the energy over the states it returned, and the position error
        at the end (`hbvm_bench.measure.measured.POSITION`, with the true start and end for stored
        times).
    seconds : ndarray
        One of each round.
    """

    name: str
    energy: float
    position: float
    seconds: Array


def measure(host: str, rounds: int) -> tuple[list[Cost], Load | None]:
    """Measure the rows of one host, ``"scipy"``, ``"diffrax"`` or ``"rebound"``, and the load meanwhile.

    Raises
    ------
    problems.errors.InputError
        If it is not installed.
    """
    problem, reference, rows = HOSTS[host]()
    first = [run() for _, run in rows]

    samples = [partial(timeit, run, setup=gc.enable, number=1) for _, run in rows]
    before = busy()
    seconds = np.array(interleaved(samples, rounds, order="as given"))
    load = load_between(before, busy())
    energies = [float(problem.errors(y)["energy"].max()) for y in first]
    true = np.stack([problem.y0, reference])
    positions = [float(position_error(problem, (y[-1] - reference)[None], true)[0]) for y in first]
    names = (name for name, _ in rows)
    return [Cost(*row) for row in zip(names, energies, positions, seconds, strict=True)], load


def table(rows: list[Cost]) -> Table:
    """Return medians, fastest and slowest rounds, and ratios of the fastest to the first row's.

    What else a machine does only ever adds to a time, so ratios are of the fastest rounds.
    """
    base = 1e3 * float(rows[0].seconds.min())
    cells = []
    for row in rows:
        low, middle, high = (1e3 * float(f(row.seconds)) for f in (np.min, np.median, np.max))
        errors = f"{row.energy:.1e}", f"{row.position:.1e}"
        cells.append((row.name, *errors, f"{middle:.3g} ms", f"{low:.3g} .. {high:.3g}", f"{low / base:.3g}"))
    last = "fastest round, to the native kernel's"
    return Table("", ("method", "energy", "position", "median", "rounds", last), cells)


def _native(problem: Problem, method: Any) -> tuple[str, Run]:
    program = method.compile(problem.system)
    times = np.linspace(problem.t0, problem.t_end, 11)[1:]

    def run() -> Array:
        return program.start(problem.y0, problem.par, problem.t0).advance(times).y

    return f"native kernel `{method!r}`", run


def _pendulum() -> tuple[Problem, Array]:
    problem = problems.load("pendulum", t_end=PENDULUM)
    return problem, np.array([float(x) for x in exact_state(problem, PENDULUM)])


def _scipy() -> tuple[Problem, Array, list[tuple[str, Run]]]:
    import numba
    from scipy.integrate import solve_ivp

    from integrators.plugins.scipy import HBVM, field

    problem, end = _pendulum()
    njit: Any = numba.njit

    @njit
    def compiled(t, y):
        return np.array([y[1], -np.sin(y[0])])

    def python(t: float, y: Array) -> list[float]:
        return [y[1], -np.sin(y[0])]

    def columns(t: Any, y: Array) -> Array:
        return np.stack([y[1], -np.sin(y[0])])

    def run(fun: Any, **options: Any) -> Run:
        span = problem.t0, problem.t_end
        return lambda: solve_ivp(fun, span, problem.y0, atol=options["rtol"], **options).y.T

    ours = {"method": HBVM, "k": 12, "s": 6, "rtol": 1e-10}
    native = integrators.HBVM(k=12, s=6, tol=1e-10)
    traced, times = field(problem), np.linspace(problem.t0, problem.t_end, 1001)
    untraced = Problem(problems.Opaque(compiled, dim=2), y0=problem.y0, t_end=problem.t_end)
    return (
        problem,
        end,
        [
            _native(problem, native),
            ("native kernel, numba function", _native(untraced, native)[1]),
            ("plugin, traced right-hand side", run(traced, **ours)),
            ("plugin, traced right-hand side, `every=100`", run(traced, every=100, **ours)),
            ("plugin, traced right-hand side, `t_eval` of 1001 times", run(traced, t_eval=times, **ours)),
            ("plugin, numba function", run(compiled, **ours)),
            ("plugin, numba function, `every=100`", run(compiled, every=100, **ours)),
            ("plugin, Python function", run(python, **ours)),
            ("plugin, Python function, `vectorized=True`", run(columns, vectorized=True, **ours)),
            *(
                (f"`{method}`, {what}, `rtol=atol={rtol:g}`", run(fun, method=method, rtol=rtol))
                for method, what, fun, rtol in (
                    ("DOP853", "Python function", python, 1e-10),
                    ("DOP853", "numba function", compiled, 1e-10),
                    ("DOP853", "Python function", python, 3e-14),
                    ("Radau", "Python function", python, 1e-8),
                )
            ),
        ],
    )


def _diffrax() -> tuple[Problem, Array, list[tuple[str, Run]]]:
    from integrators.plugins.diffrax import HBVM

    import diffrax as dx  # isort: skip -- the plugin says what to install where it is missing
    import jax

    from problems import targets

    jax.config.update("jax_enable_x64", True)
    problem, end = _pendulum()
    term = dx.ODETerm(targets.jax(problem.system, "field"))
    par, times = map(jax.numpy.asarray, (problem.par, np.linspace(0.0, problem.t_end, 11)[1:]))

    def run(solver: Any, h: float | None, tolerance: float | None = None) -> Run:
        controller = dx.ConstantStepSize() if tolerance is None else dx.PIDController(tolerance, tolerance)

        @jax.jit
        def solve(y0: Any) -> Any:
            return dx.diffeqsolve(
                term, solver, problem.t0, problem.t_end, h, y0, args=par, max_steps=100_000,
                stepsize_controller=controller, saveat=dx.SaveAt(ts=times), adjoint=dx.ForwardMode(),
            ).ys  # fmt: skip

        return lambda: np.asarray(solve(problem.y0))

    return (
        problem,
        end,
        [
            _native(problem, integrators.HBVM(k=8, s=4, h=0.1)),
            ("plugin `HBVM(k=8, s=4)`, `dt0=0.1`", run(HBVM(k=8, s=4), 0.1)),
            ("`Dopri8`, tolerances 1e-10", run(dx.Dopri8(), None, 1e-10)),
            ("`Dopri8`, `dt0=0.05`", run(dx.Dopri8(), 0.05)),
            ("`Kvaerno5`, tolerances 1e-8", run(dx.Kvaerno5(), None, 1e-8)),
        ],
    )


def _rebound() -> tuple[Problem, Array, list[tuple[str, Run]]]:
    from integrators.plugins.rebound import install, rebound

    def make() -> Any:
        simulation = rebound.Simulation()
        simulation.add("outer solar system")
        simulation.move_to_com()
        return simulation

    bodies = make().particles
    masses = np.array([body.m for body in bodies])

    def state(simulation: Any) -> Array:
        q = np.array([body.xyz for body in simulation.particles]).ravel()
        v = np.array([body.vxyz for body in simulation.particles]).ravel()
        return np.concatenate([q, np.repeat(masses, 3) * v])

    def run(prepare: Callable[[Any], None]) -> Run:
        def go() -> Array:
            simulation, states = make(), []
            prepare(simulation)
            for t in np.linspace(0.0, PLANETS, 11)[1:]:
                simulation.integrate(t)
                states.append(state(simulation))
            return np.array(states)

        return go

    def whfast(h: float) -> Callable[[Any], None]:
        def prepare(simulation: Any) -> None:
            simulation.integrator = "whfast"
            options: Any = simulation.integrator  # not the name, but what holds its options
            options.corrector, options.kernel, options.safe_mode = 17, "LAZY", 0
            simulation.dt = h

        return prepare

    problem = _planets(masses, state(make()))
    reference = integrators.integrate(problem, integrators.Taylor(high_accuracy=True, compact_mode=True)).y[
        -1
    ]
    step = 8.0
    ours = [integrators.Gauss(s=8, h=step), integrators.HBVM(k=10, s=8, h=step)]
    return (
        problem,
        reference,
        [
            _native(problem, ours[0]),
            *((f"plugin `{method!r}`", run(lambda sim, m=method: install(sim, m))) for method in ours),
            ("`ias15`", run(lambda sim: setattr(sim, "integrator", "ias15"))),
            *(
                (f"`whfast`, corrector 17, kernel LAZY, dt = {h:g}", run(whfast(h)))
                for h in (4.0, 1.0, 0.5, 0.25)
            ),
        ],
    )


def _planets(masses: Array, y0: Array) -> Problem:
    """Return the gravitating bodies that REBOUND has, as a problem; G = 1."""
    n = len(masses)

    def H(q: Any, p: Any, par: Any, m: Any) -> Any:
        def kinetic(i: Any) -> Any:
            return sum(p[3 * i + d] * p[3 * i + d] for d in range(3)) / (2 * par.mass[i])

        def pair(i: Any, j: Any) -> Any:
            squares = [(q[3 * i + d] - q[3 * j + d]) * (q[3 * i + d] - q[3 * j + d]) for d in range(3)]
            return par.mass[i] * par.mass[j] / m.sqrt(sum(squares))

        pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
        return m.sum(kinetic, range(n)) - m.sum(pair, pairs)

    system = problems.Hamiltonian(H, dof=3 * n, parameters={"mass": masses.tolist()}, name="planets")
    return Problem(system, q0=y0[: 3 * n], p0=y0[3 * n :], t_end=PLANETS)


HOSTS = {"scipy": _scipy, "diffrax": _diffrax, "rebound": _rebound}


def leak(span: float, parts: int = 10) -> Iterator[tuple[float, dict[str, float]]]:
    """Yield times, and the relative energy errors of DOP853 and HBVM there, in equal parts of ``span``.

    The same call of ``solve_ivp`` but for the method: the pendulum, ``rtol=atol=1e-8``.
    """
    from scipy.integrate import solve_ivp

    from integrators.plugins.scipy import HBVM

    methods: dict[str, Any] = {"DOP853": "DOP853", "HBVM": HBVM}
    problem = problems.load("pendulum")
    states = dict.fromkeys(methods, problem.y0)
    for i in range(parts):
        for name, method in methods.items():
            solution = solve_ivp(
                lambda t, y: [y[1], -np.sin(y[0])], (i * span / parts, (i + 1) * span / parts), states[name],
                method=method, rtol=1e-8, atol=1e-8,
            )  # fmt: skip
            states[name] = solution.y[:, -1]
        yield (
            (i + 1) * span / parts,
            {name: float(problem.errors(y[None])["energy"][0]) for name, y in states.items()},
        )


def main() -> None:
    """Print what a page shows."""
    parser = argparse.ArgumentParser(description="The tables of the plugins' pages.")
    parser.add_argument("host", choices=[*HOSTS, "leak"])
    parser.add_argument("--rounds", type=int, default=5, help="how often each row is timed")
    parser.add_argument("--span", type=float, default=1e5, help="time units of the leak")
    asked, today = parser.parse_args(), datetime.now(UTC).date().isoformat()
    if asked.host == "leak":
        print("| t | DOP853 | HBVM |\n|--:|--:|--:|")
        for t, errors in leak(asked.span):
            print(f"| {t:.0f} | {errors['DOP853']:.2e} | {errors['HBVM']:.2e} |", flush=True)
        print(f"\n{measured_on(today, kernel_digest(), [])}")
        return
    rows, load = measure(asked.host, asked.rounds)
    print(printed(table(rows)))
    print(f"\n{POSITION} Here those are its start and its end.")
    print(f"\n{machine.sentence(machine.describe(measure=True))}")
    print(f"\n{measured_on(today, kernel_digest(), [load] if load else [])}")


if __name__ == "__main__":
    main()
