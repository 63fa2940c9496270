"""General and stiff systems against their known end values: ours beside SciPy's Radau and DOP853.

The end value of van der Pol's equation is that of F. Mazzia, C. Magherini, *Test Set for Initial
Value Problem Solvers*, release 2.4. Of Robertson's at t = 40, the example of LSODE (A. C. Hindmarsh,
ODEPACK, 1983) prints 7.158e-01 9.185e-06 2.842e-01; two of the methods here, at tight tolerances, agree
on the further digits. Arenstorf's orbit ends where it began, after the period that E. Hairer,
S. P. Norsett and G. Wanner print. For the driven pendulum no value is published: its end was computed with
30 digits by Taylor series of two lengths of step. The stiff chain is judged
by HBVM() with resolved oscillations.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import problems
from hbvm_bench.campaign.identity import make_method
from integrators.protocol import Status, Stepper
from problems.errors import InputError, unknown
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian
from problems.systems.vector_field import VectorField

Array = NDArray[np.float64]

METHODS = ("HBVM()", "Radau(rtol=1e-10, atol=1e-14)", "DOP853(rtol=1e-10, atol=1e-14)")
CHAIN_METHODS = (
    'HBVM(k=8, s=4, h=8e-4, solver="fixed_point")',
    "HBVM(k=8, s=4, h=8e-2)",
    "Radau(rtol=1e-8, atol=1e-8)",
    "DOP853(rtol=1e-8, atol=1e-8)",
)
"""A step at which the fixed-point iteration fails, and one a hundred times as long."""

DRIVEN = (-17.474847840041407, -0.690607186089025)
"""Angle and momentum of the driven pendulum at t = 20."""

PIECES = 100  # between two looks at the clock and at the energy
QUICK = 1.0  # seconds; a run that takes less is timed by itself
REPEATS = 3


@dataclass(frozen=True)
class Case:
    """A problem, where it ends, and what is run on it.

    Attributes
    ----------
    problem : Problem
        With its span.
    end : callable
        Returns the known end of the first components, or of all.
    relative : bool
        Whether errors are relative, component by component.
    methods : tuple of str
        As they are written on the command line.
    """

    problem: Problem
    end: Callable[[Problem], Array]
    relative: bool = False
    methods: tuple[str, ...] = METHODS


@dataclass(frozen=True)
class Outcome:
    """What one method made of one problem.

    Attributes
    ----------
    problem, method : str
        Which.
    ending : str
        Empty, or why the end was not reached.
    error : float
        Of the end, the largest of all components compared; NaN without an end.
    energy : float
        Largest error of the energy on the way; NaN if there is none to keep, or no end.
    steps, evaluations : int
        Of the run. An evaluation is one of the field at one state.
    solver : str
        Of the stage equations, where the method tells.
    seconds : float
        Of the processor's time: of the run at one go, the least of three; else, of slow
        ones, with a hundred states on the way.
    """

    problem: str
    method: str
    ending: str
    error: float
    energy: float
    steps: int
    evaluations: int
    solver: str
    seconds: float


def van_der_pol() -> Problem:
    """Return van der Pol's equation with mu = 1000, time in units of mu."""
    system = VectorField(
        lambda y, par: [y[1], par.stiffness * ((1 - y[0] ** 2) * y[1] - y[0])],
        dim=2,
        parameters={"stiffness": 1e6},
        name="van_der_pol",
    )
    return Problem(system, y0=[2.0, 0.0], t_end=2.0, name="van_der_pol")


def robertson() -> Problem:
    """Return Robertson's three reactions, with rates 0.04, 1e4 and 3e7."""
    system = VectorField(
        lambda y: [
            -0.04 * y[0] + 1e4 * y[1] * y[2],
            0.04 * y[0] - 1e4 * y[1] * y[2] - 3e7 * y[1] ** 2,
            3e7 * y[1] ** 2,
        ],
        dim=3,
        name="robertson",
    )
    return Problem(system, y0=[1.0, 0.0, 0.0], t_end=40.0, name="robertson")


def driven_pendulum() -> Problem:
    """Return a pendulum that a torque 0.9 cos(2t/3) drives."""
    system = Hamiltonian(
        lambda q, p, t, m: p[0] ** 2 / 2 - m.cos(q[0]) - 0.9 * q[0] * m.cos(2 * t / 3),
        dof=1,
        name="driven_pendulum",
    )
    return Problem(system, y0=[0.2, 0.0], t_end=20.0, name="driven_pendulum")


def _resolved(problem: Problem) -> Array:
    """Return the positions of the soft springs as HBVM() has them, which follows the fast oscillations."""
    program = make_method("HBVM()").compile(problem.system)
    samples = program.start(problem.y0, problem.par, problem.t0).advance(np.array([problem.t_end]))
    if samples.status is not Status.FINISHED:
        raise InputError(f"HBVM() did not finish {problem.name}: {samples.reason}")
    return samples.y[-1, :3]


def cases() -> dict[str, Case]:
    """Return all cases by name."""
    pol = np.array([1.706167732170483, -0.8928097010247975])
    chemistry = np.array([0.7158270687193941, 0.9185534764557763e-5, 0.2841637457458413])
    driven = np.array(DRIVEN)
    return {
        "van_der_pol": Case(van_der_pol(), lambda problem: pol, relative=True),
        "robertson": Case(robertson(), lambda problem: chemistry, relative=True),
        "driven_pendulum": Case(driven_pendulum(), lambda problem: driven),
        "arenstorf": Case(problems.load("cr3bp"), lambda problem: problem.y0),
        "stiff_chain": Case(
            problems.load("stiff_chain", omega=1e4, t_end=10.0), _resolved, methods=CHAIN_METHODS
        ),
    }


def outcomes(
    names: Sequence[str] = (),
    limit: float = 30.0,
    tell: Callable[[str], None] = lambda name: None,
) -> list[Outcome]:
    """Run the methods of each case.

    Parameters
    ----------
    names : sequence of str
        Of `cases`; all by default.
    limit : float
        Seconds of the processor's time after which a run of SciPy's is given up.
    tell : callable
        Called with what is about to run.

    Raises
    ------
    problems.errors.InputError
        For an unknown name, or a limit that is not positive.
    """
    if not limit > 0.0:
        raise InputError(f"limit must be positive, not {limit}.")
    known = cases()
    for name in names:
        if name not in known:
            raise unknown("problem", name, list(known))
    found = []
    for name in names or known:
        case = known[name]
        end = case.end(case.problem)
        for text in case.methods:
            tell(f"{name}: {text}")
            found.append(_outcome(name, case, end, text, limit))
    return found


def _outcome(name: str, case: Case, end: Array, text: str, limit: float) -> Outcome:
    """Run a method in pieces, for what happens on the way; then at one go, which is what is timed."""
    problem, method = case.problem, make_method(text)
    program = method.compile(problem.system)

    def stepper() -> Stepper:
        return program.start(problem.y0, problem.par, problem.t0)

    ours = method.library == "hbvm-bench"
    limit = np.inf if ours else limit  # the first run of ours may compile the implicit solver on its way
    times = np.linspace(problem.t0, problem.t_end, PIECES + 1)[1:]
    found = replace(_run(name, case, end, stepper(), times, limit, None), method=repr(method))
    if found.ending:
        return found
    repeats = REPEATS if ours or found.seconds < QUICK else 1
    whole = [_run(name, case, end, stepper(), times[-1:], limit, method.to_end) for _ in range(repeats)]
    last, seconds = whole[-1], min(run.seconds for run in whole)
    return replace(last, method=repr(method), energy=found.energy, seconds=seconds)


def _run(
    name: str, case: Case, end: Array, stepper: Stepper, times: Array, limit: float, sample: str | None
) -> Outcome:
    """Return what one run comes to; its method is not named yet."""
    problem = case.problem
    keeps = "energy" in problem.system.invariant_names
    energy, spent, ending, y = 0.0, 0.0, "", problem.y0
    for t in times:
        begun = time.thread_time()
        samples = stepper.advance(np.array([t]), sample=sample)
        spent += time.thread_time() - begun
        if samples.status is not Status.FINISHED:
            ending = f"{samples.status.value}: {samples.reason}"
            break
        y = samples.y[-1]
        if keeps:
            energy = max(energy, float(problem.errors(samples.y, samples.t)["energy"].max()))
        if spent > limit and t < times[-1]:
            ending = f"given up after {spent:.0f} s at t = {t:g} of {problem.t_end:g}"
            break
    stats = stepper.stats
    error = np.abs(y[: end.size] - end)
    if case.relative:
        error = error / np.abs(end)
    return Outcome(
        name, "", ending,
        np.nan if ending else float(error.max()),
        np.nan if ending or not keeps else energy,
        stats.steps, stats.evaluations or 0, stats.solver or "", spent,
    )  # fmt: skip
