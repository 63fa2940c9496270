"""Checks of what a method computes: the states at the times asked for, the counters, the end."""

import numpy as np

from integrators.protocol import SAMPLINGS, MethodBase, Program, Stats, Status, Stepper
from integrators.running.integrate import integrate
from integrators.testing.exercises import blow_up
from integrators.testing.rules import finished, irregular, raises, regular, require, start
from problems import Problem
from problems.errors import InputError

ENERGY_BOUND = 0.05
"""Largest relative energy error that passes: a wrong sign exceeds it, a coarse step does not."""


def satisfies_the_protocol(method: MethodBase, problem: Problem) -> str | None:
    """Check that programs and steppers have the protocol's attributes and start where they are told."""
    program = method.compile(problem.system)
    require(isinstance(program, Program), f"{type(program).__name__} is a Program")
    require(program.compile_seconds >= 0.0, "compile_seconds is a number of seconds")
    require(program.from_cache in (None, True, False), "from_cache is None, True or False")
    stepper = program.start(problem.y0, problem.par, problem.t0)
    require(isinstance(stepper, Stepper), f"{type(stepper).__name__} is a Stepper")
    require(
        stepper.t == problem.t0 and np.array_equal(stepper.y, problem.y0), "a stepper starts at t0 with y0"
    )
    require(stepper.status is Status.RUNNING and stepper.reason == "", "a stepper starts as running")
    _counters(stepper.stats, least=0)
    status = stepper.step()
    require(status is Status.RUNNING and stepper.t != problem.t0, "step takes one step and goes on running")
    _counters(stepper.stats, least=1)
    return None


def leaves_its_input_alone(method: MethodBase, problem: Problem) -> str | None:
    """Check that neither the caller's arrays nor the stepper's own state are shared."""
    y0, par = problem.y0.copy(), problem.par.copy()
    stepper = method.compile(problem.system).start(y0, par, problem.t0)
    y0[:], par[:] = np.nan, np.nan
    samples = stepper.advance(regular(problem, 5))
    require(bool(np.isfinite(samples.y).all()), "a stepper copies y0 and par")
    before = stepper.y.copy()
    seen = stepper.y
    if seen.flags.writeable:
        seen[:] = np.nan
    require(np.array_equal(stepper.y, before), "writing into stepper.y does not change the trajectory")
    return None


def returns_the_times_asked_for(method: MethodBase, problem: Problem) -> str | None:
    """Check that all times come back exactly as asked, with finite states, as finished."""
    for grid in (regular(problem, 17), regular(problem, 17)[1:], irregular(problem)):
        stepper = start(method, problem)
        samples = stepper.advance(grid)
        finished(samples, method)
        require(np.array_equal(samples.t, grid), f"{method!r} returns the times it was asked for")
        require(
            samples.y.shape == (grid.size, problem.system.dim), f"y has shape (n, dim), not {samples.y.shape}"
        )
        require(bool(np.isfinite(samples.y).all()), "all states are finite")
        if grid[0] == problem.t0:
            require(np.array_equal(samples.y[0], problem.y0), "the state at t0 is y0, to the last bit")
        _counters(stepper.stats, least=1)
    return None


def repeats_itself(method: MethodBase, problem: Problem) -> str | None:
    """Check that the same call gives bitwise identical results."""
    first, second = (start(method, problem).advance(regular(problem, 9)) for _ in range(2))
    require(np.array_equal(first.y, second.y), f"{method!r} repeats itself bit for bit")
    return None


def pieces_equal_the_whole(method: MethodBase, problem: Problem) -> str | None:
    """Check that advancing in pieces is bitwise identical to one call."""
    grid = irregular(problem)
    whole = start(method, problem).advance(grid)
    stepper = start(method, problem)
    pieces = [stepper.advance(piece) for piece in np.array_split(grid, 4)]
    require(
        np.array_equal(np.concatenate([piece.y for piece in pieces]), whole.y),
        f"{method!r} in pieces equals {method!r} in one go",
    )
    return None


def samples_leave_the_steps_alone(method: MethodBase, problem: Problem) -> str | None:
    """Check that states made beside the steps change nothing of the steps that follow."""
    grid = irregular(problem)
    try:
        often = start(method, problem).advance(grid, sample="partial")
    except InputError:
        return "it makes no states beside its steps"
    once = start(method, problem).advance(grid[-1:], sample="partial")
    require(
        np.array_equal(often.y[-1], once.y[-1]), f"samples leave the steps of {method!r} alone, bit for bit"
    )
    return None


def samplings_work_or_are_refused(method: MethodBase, problem: Problem) -> str | None:
    """Check that each sampling serves the times or is refused; unknown ones are refused."""
    grid = irregular(problem)
    for sample in SAMPLINGS:
        stepper = start(method, problem)
        try:
            samples = stepper.advance(grid, sample=sample)
        except InputError as error:
            require(stepper.t == problem.t0, f"a refusal ({error}) leaves the stepper where it was")
            continue
        finished(samples, method)
        if sample == "steps":
            require(samples.t.size == samples.y.shape[0], "as many states as steps")
            require(bool(np.all(np.diff(samples.t) > 0)), "steps come in order")
        else:
            require(np.array_equal(samples.t, grid), f"sample={sample!r} returns the times asked for")
    raises(
        InputError, lambda: start(method, problem).advance(grid, sample="no such"), "unknown samplings fail"
    )
    finished(start(method, problem).advance(grid[-1:], sample=method.to_end), method)
    return None


def energy_stays_sane(method: MethodBase, problem: Problem) -> str | None:
    """Check that the relative energy error stays below `ENERGY_BOUND`."""
    if "energy" not in problem.invariants(problem.y0[None, :]):
        return "the problem has no energy"
    solution = integrate(problem, method, regular(problem, 33))
    worst = float(np.max(solution.errors()["energy"]))
    require(worst < ENERGY_BOUND, f"{method!r} conserves the energy within {ENERGY_BOUND}, not {worst:.2g}")
    return None


def failure_is_a_status(method: MethodBase, problem: Problem) -> str | None:
    """Check that the method stops with a status and a reason where the solution ceases to exist."""
    hopeless = blow_up()
    refusal = method.accepts(hopeless)
    if refusal is not None:
        return refusal
    stepper = start(method, hopeless)
    grid = regular(hopeless, 41)
    samples = stepper.advance(grid)
    if samples.status is Status.FINISHED:
        require(bool(np.isfinite(samples.y).all()), "no silent NaN")
        return "its steps jump over the singularity"
    require(
        samples.status.failed and len(samples.reason) > 10, f"a failure has a reason, not {samples.reason!r}"
    )
    require(stepper.status is samples.status, "the stepper's status is that of its last samples")
    n = samples.t.size
    require(n < grid.size and np.array_equal(samples.t, grid[:n]), "what was computed before is returned")
    require(samples.y.shape == (n, hopeless.system.dim), "a state for each time")
    require(bool(np.isfinite(samples.y).all()), "what is returned is finite")
    require(bool(np.isfinite(stepper.t)), "the time of the failure is known")
    late = n and samples.t[-1] > stepper.t + 4.0 * np.spacing(stepper.t)
    require(not late, "no state comes back that lies after the failure")
    return None


def refuses_bad_times(method: MethodBase, problem: Problem) -> str | None:
    """Check that times that are empty, not finite or not monotone raise InputError."""
    t0, end = problem.t0, problem.t_end
    for bad in ([], [t0, np.nan], [np.inf], [t0, end, (t0 + end) / 2], [end, end], [[t0, end]]):
        stepper = start(method, problem)
        raises(InputError, lambda s=stepper, b=bad: s.advance(np.array(b)), f"times {bad} are refused")
        require(stepper.t == t0, "a refusal leaves the stepper where it was")
    return None


def refuses_bad_states(method: MethodBase, problem: Problem) -> str | None:
    """Check that initial states that are not finite or of the wrong shape raise InputError."""
    program = method.compile(problem.system)
    nan = problem.y0.copy()
    nan[-1] = np.nan
    for bad in (nan, problem.y0[:-1], np.full_like(problem.y0, np.inf)):
        raises(
            InputError,
            lambda b=bad: program.start(b, problem.par, problem.t0),
            "bad initial states are refused",
        )
    return None


def _counters(stats: Stats, least: int) -> None:
    require(isinstance(stats.steps, int) and stats.steps >= least, f"steps counts steps, not {stats.steps!r}")
    for name in ("rejections", "evaluations", "iterations"):
        value = getattr(stats, name)
        require(
            value is None or (isinstance(value, int) and value >= 0),
            f"{name} is None or a count, not {value!r}",
        )
