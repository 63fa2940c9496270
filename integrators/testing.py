"""The conformance kit: checks that any method, ours or a third party's, can be run through.

With pytest, one test per check::

    @pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
    def test_conforms(check):
        check(IAS15(), testing.two_bodies())

Each check raises `AssertionError` with a sentence when the method breaks a
rule of `integrators.protocol`, and returns the reason as a string where the
rule does not apply to the method. `check_method` runs them all.
"""

import ast
import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np

from integrators import registry
from integrators.exercises import blow_up, pendulum, two_bodies
from integrators.integrate import integrate
from integrators.protocol import SAMPLINGS, MethodBase, Program, Samples, Stats, Status, Stepper
from problems import Problem, emit
from problems.errors import InputError, UnknownNameError

Check = Callable[[MethodBase, Problem], str | None]

ENERGY_BOUND = 0.05
"""Largest relative energy error that passes: a wrong sign exceeds it, a coarse step does not."""


def check_method(method: MethodBase, problem: Problem) -> dict[str, str | None]:
    """Run ``method`` through all checks on ``problem``, which it must accept.

    Returns
    -------
    dict
        Name of the check -> ``None``, or why it does not apply.

    Raises
    ------
    AssertionError
        At the first broken rule.
    """
    return {name_of(check): check(method, problem) for check in CHECKS}


def name_of(check: Check) -> str:
    """Return the name of a check, to be used as a test's id."""
    return check.__name__


def describes_itself(method: MethodBase, problem: Problem) -> str | None:
    """Check that the class has a library, a citation, a docstring; order is None or positive."""
    cls = type(method)
    _require(
        bool(cls.library) and bool(cls.citation.strip()), f"{cls.__name__} names its library and citation"
    )
    # A dataclass without a docstring gets its signature as one: Name(*, option: type).
    doc = cls.__doc__ or ""
    _require(bool(doc) and not doc.startswith(f"{cls.__name__}(*"), f"{cls.__name__} has a docstring")
    order = method.order
    _require(
        order is None or (isinstance(order, int) and order >= 1), f"order is None or positive, not {order!r}"
    )
    return None


def is_a_value(method: MethodBase, problem: Problem) -> str | None:
    """Check that the method is frozen, comparable, hashable, picklable, and prints as its own call."""
    for name in method.options(defaults=True):
        try:
            setattr(method, name, None)
        except AttributeError:
            continue
        _require(False, f"{method!r} is frozen; {name} could be set")
    name, options = _parse(repr(method))
    _require(name == type(method).__name__, f"{method!r} prints its own name")
    twin = type(method)(**options)
    _require(twin == method and hash(twin) == hash(method), f"{method!r} equals what its text makes")
    _require(pickle.loads(pickle.dumps(method)) == method, f"{method!r} survives pickling")
    if name not in registry.names() or registry.get(name) is not type(method):
        return f"{name} is not registered under its own name"
    _require(registry.create(name, **options) == method, f"the registry makes {method!r} from its text")
    return None


def refuses_unknown_options(method: MethodBase, problem: Problem) -> str | None:
    """Check that a wrong option name fails, by the class and by the registry."""
    name = type(method).__name__
    options = {**method.options(), "no_such_option": 1}
    _raises(UnknownNameError, lambda: type(method)(**options), f"{name} refuses an unknown option")
    if name not in registry.names():
        return f"{name} is not registered"
    _raises(UnknownNameError, lambda: registry.create(name, **options), f"the registry refuses it for {name}")
    return None


def accepts_gives_a_reason(method: MethodBase, problem: Problem) -> str | None:
    """Check that ``accepts`` returns None, or the reason as a sentence."""
    reason = method.accepts(problem)
    _require(reason is None, f"{method!r} accepts the problem of the check, but says: {reason}")
    for other in (pendulum(), two_bodies(), blow_up()):
        reason = method.accepts(other)
        _require(
            reason is None or (isinstance(reason, str) and len(reason) > 10),
            f"accepts gives a sentence, not {reason!r}",
        )
    return None


def satisfies_the_protocol(method: MethodBase, problem: Problem) -> str | None:
    """Check that programs and steppers have the protocol's attributes and start where they are told."""
    program = method.compile(problem.system)
    _require(isinstance(program, Program), f"{type(program).__name__} is a Program")
    _require(program.compile_seconds >= 0.0, "compile_seconds is a number of seconds")
    _require(program.from_cache in (None, True, False), "from_cache is None, True or False")
    stepper = program.start(problem.y0, problem.par, problem.t0)
    _require(isinstance(stepper, Stepper), f"{type(stepper).__name__} is a Stepper")
    _require(
        stepper.t == problem.t0 and np.array_equal(stepper.y, problem.y0), "a stepper starts at t0 with y0"
    )
    _require(stepper.status is Status.RUNNING and stepper.reason == "", "a stepper starts as running")
    _counters(stepper.stats, least=0)
    status = stepper.step()
    _require(status is Status.RUNNING and stepper.t != problem.t0, "step takes one step and goes on running")
    _counters(stepper.stats, least=1)
    return None


def leaves_its_input_alone(method: MethodBase, problem: Problem) -> str | None:
    """Check that neither the caller's arrays nor the stepper's own state are shared."""
    y0, par = problem.y0.copy(), problem.par.copy()
    stepper = method.compile(problem.system).start(y0, par, problem.t0)
    y0[:], par[:] = np.nan, np.nan
    samples = stepper.advance(_grid(problem, 5))
    _require(bool(np.isfinite(samples.y).all()), "a stepper copies y0 and par")
    before = stepper.y.copy()
    seen = stepper.y
    if seen.flags.writeable:
        seen[:] = np.nan
    _require(np.array_equal(stepper.y, before), "writing into stepper.y does not change the trajectory")
    return None


def returns_the_times_asked_for(method: MethodBase, problem: Problem) -> str | None:
    """Check that all times come back exactly as asked, with finite states, as finished."""
    for grid in (_grid(problem, 17), _grid(problem, 17)[1:], _irregular(problem)):
        stepper = _start(method, problem)
        samples = stepper.advance(grid)
        _finished(samples, method)
        _require(np.array_equal(samples.t, grid), f"{method!r} returns the times it was asked for")
        _require(
            samples.y.shape == (grid.size, problem.system.dim), f"y has shape (n, dim), not {samples.y.shape}"
        )
        _require(bool(np.isfinite(samples.y).all()), "all states are finite")
        if grid[0] == problem.t0:
            _require(np.array_equal(samples.y[0], problem.y0), "the state at t0 is y0, to the last bit")
        _counters(stepper.stats, least=1)
    return None


def repeats_itself(method: MethodBase, problem: Problem) -> str | None:
    """Check that the same call gives the same bits."""
    first, second = (_start(method, problem).advance(_grid(problem, 9)) for _ in range(2))
    _require(np.array_equal(first.y, second.y), f"{method!r} repeats itself bit for bit")
    return None


def pieces_equal_the_whole(method: MethodBase, problem: Problem) -> str | None:
    """Check that advancing in pieces gives the same bits as one call."""
    grid = _irregular(problem)
    whole = _start(method, problem).advance(grid)
    stepper = _start(method, problem)
    pieces = [stepper.advance(piece) for piece in np.array_split(grid, 4)]
    _require(
        np.array_equal(np.concatenate([piece.y for piece in pieces]), whole.y),
        f"{method!r} in pieces equals {method!r} in one go",
    )
    return None


def checkpoints_continue_bit_for_bit(method: MethodBase, problem: Problem) -> str | None:
    """Check that a restored checkpoint continues with the same bits, here and in a new stepper."""
    grid = _irregular(problem)
    head, tail = grid[:7], grid[7:]
    program = method.compile(problem.system)
    stepper = program.start(problem.y0, problem.par, problem.t0)
    stepper.advance(head)
    checkpoint = stepper.checkpoint()
    there = (stepper.t, stepper.y.copy())
    first = stepper.advance(tail)
    stepper.restore(checkpoint)
    _require(
        stepper.t == there[0] and np.array_equal(stepper.y, there[1]), "restore goes back to the checkpoint"
    )
    again = stepper.advance(tail)
    other = program.start(problem.y0, problem.par, problem.t0)
    other.restore(checkpoint)
    fresh = other.advance(tail)
    for samples, where in ((again, "the same stepper"), (fresh, "a new stepper")):
        _finished(samples, method)
        _require(np.array_equal(samples.y, first.y), f"{method!r} continues bit for bit in {where}")
    return None


def refuses_other_checkpoints(method: MethodBase, problem: Problem) -> str | None:
    """Check that no checkpoint but those of this method, system and parameters is taken."""
    grid = _irregular(problem)
    stepper = _start(method, problem)
    stepper.advance(grid[:7])
    others: dict[str, Any] = {"None": None, "a number": 1.5, "an empty tuple": (), "an array": problem.y0}
    for name, value in method.options(defaults=True).items():
        if isinstance(value, float):
            try:
                changed = dataclasses.replace(method, **{name: value / 2.0})
            except InputError:
                continue
            if changed.accepts(problem) is None:
                others[f"that of {changed!r}"] = _start(changed, problem).checkpoint()
                break
    for other in (pendulum(), two_bodies(), blow_up()):
        same = emit.fingerprint(other.system) == emit.fingerprint(problem.system)
        if not same and method.accepts(other) is None:
            others[f"that of {other.system.name}"] = _start(method, other).checkpoint()
    if problem.par.size:
        twice = method.compile(problem.system).start(problem.y0, problem.par * 2.0, problem.t0)
        others["that of other parameters"] = twice.checkpoint()
    there = (stepper.t, stepper.y, stepper.status)
    for what, checkpoint in others.items():
        _raises(InputError, lambda c=checkpoint: stepper.restore(c), f"{what} is refused as a checkpoint")
        _require(
            (stepper.t, stepper.status) == (there[0], there[2]) and np.array_equal(stepper.y, there[1]),
            f"the refusal of {what} leaves the stepper where it was",
        )
    twin = _start(method, problem)
    twin.advance(grid[:7])
    _require(
        np.array_equal(stepper.advance(grid[7:]).y, twin.advance(grid[7:]).y),
        "refused checkpoints do not change what follows",
    )
    return None


def energy_stays_sane(method: MethodBase, problem: Problem) -> str | None:
    """Check that the relative energy error stays below `ENERGY_BOUND`."""
    if "energy" not in problem.invariants(problem.y0[None, :]):
        return "the problem has no energy"
    solution = integrate(problem, method, _grid(problem, 33))
    worst = float(np.max(solution.errors()["energy"]))
    _require(worst < ENERGY_BOUND, f"{method!r} keeps the energy within {ENERGY_BOUND}, not {worst:.2g}")
    return None


def samplings_work_or_are_refused(method: MethodBase, problem: Problem) -> str | None:
    """Check that each sampling serves the times or is refused; unknown ones are refused."""
    grid = _irregular(problem)
    for sample in SAMPLINGS:
        stepper = _start(method, problem)
        try:
            samples = stepper.advance(grid, sample=sample)
        except InputError as error:
            _require(stepper.t == problem.t0, f"a refusal ({error}) leaves the stepper where it was")
            continue
        _finished(samples, method)
        if sample == "steps":
            _require(samples.t.size == samples.y.shape[0], "as many states as steps")
            _require(bool(np.all(np.diff(samples.t) > 0)), "own steps come in order")
        else:
            _require(np.array_equal(samples.t, grid), f"sample={sample!r} returns the times asked for")
    _raises(
        InputError, lambda: _start(method, problem).advance(grid, sample="no such"), "unknown samplings fail"
    )
    _finished(_start(method, problem).advance(grid[-1:], sample=method.to_end), method)
    return None


def refuses_bad_times(method: MethodBase, problem: Problem) -> str | None:
    """Check that times that are empty, not finite or not monotone raise InputError."""
    t0, end = problem.t0, problem.t_end
    for bad in ([], [t0, np.nan], [np.inf], [t0, end, (t0 + end) / 2], [end, end], [[t0, end]]):
        stepper = _start(method, problem)
        _raises(InputError, lambda s=stepper, b=bad: s.advance(np.array(b)), f"times {bad} are refused")
        _require(stepper.t == t0, "a refusal leaves the stepper where it was")
    return None


def refuses_bad_states(method: MethodBase, problem: Problem) -> str | None:
    """Check that initial states that are not finite or of the wrong shape raise InputError."""
    program = method.compile(problem.system)
    nan = problem.y0.copy()
    nan[-1] = np.nan
    for bad in (nan, problem.y0[:-1], np.full_like(problem.y0, np.inf)):
        _raises(
            InputError,
            lambda b=bad: program.start(b, problem.par, problem.t0),
            "bad initial states are refused",
        )
    return None


def failure_is_a_status(method: MethodBase, problem: Problem) -> str | None:
    """Check that the method stops with a status and a reason where the solution ceases to exist."""
    hopeless = blow_up()
    refusal = method.accepts(hopeless)
    if refusal is not None:
        return refusal
    stepper = _start(method, hopeless)
    grid = _grid(hopeless, 41)
    samples = stepper.advance(grid)
    if samples.status is Status.FINISHED:
        _require(bool(np.isfinite(samples.y).all()), "no silent NaN")
        return "its steps jump over the singularity"
    _require(
        samples.status.failed and len(samples.reason) > 10, f"a failure has a reason, not {samples.reason!r}"
    )
    _require(stepper.status is samples.status, "the stepper's status is that of its last samples")
    n = samples.t.size
    _require(n < grid.size and np.array_equal(samples.t, grid[:n]), "what was computed before is returned")
    _require(samples.y.shape == (n, hopeless.system.dim), "a state for each time")
    _require(bool(np.isfinite(samples.y).all()), "what is returned is finite")
    _require(bool(np.isfinite(stepper.t)), "the time of the failure is known")
    late = n and samples.t[-1] > stepper.t + 4.0 * np.spacing(stepper.t)
    _require(not late, "no state comes back that lies after the failure")
    return None


CHECKS: tuple[Check, ...] = (
    describes_itself,
    is_a_value,
    refuses_unknown_options,
    accepts_gives_a_reason,
    satisfies_the_protocol,
    leaves_its_input_alone,
    returns_the_times_asked_for,
    repeats_itself,
    pieces_equal_the_whole,
    checkpoints_continue_bit_for_bit,
    refuses_other_checkpoints,
    energy_stays_sane,
    samplings_work_or_are_refused,
    refuses_bad_times,
    refuses_bad_states,
    failure_is_a_status,
)


def _require(condition: bool, rule: str) -> None:
    # Not `assert`: the kit must also check under `python -O`.
    if not condition:
        raise AssertionError(f"broken: {rule}")


def _raises(error: type[Exception], call: Callable[[], object], rule: str) -> None:
    try:
        call()
    except error:
        return
    raise AssertionError(f"broken: {rule} (no {error.__name__} was raised)")


def _start(method: MethodBase, problem: Problem) -> Stepper:
    return method.compile(problem.system).start(problem.y0, problem.par, problem.t0)


def _grid(problem: Problem, n: int) -> np.ndarray:
    return np.linspace(problem.t0, problem.t_end, n)


def _irregular(problem: Problem) -> np.ndarray:
    """Return 23 times that fall between the steps of any fixed-step method."""
    fraction = np.linspace(0.01, 1.0, 23) ** 1.3
    return problem.t0 + (problem.t_end - problem.t0) * fraction


def _finished(samples: Samples, method: MethodBase) -> None:
    _require(
        samples.status is Status.FINISHED,
        f"{method!r} finishes, but: {samples.status} ({samples.reason or 'no reason'})",
    )


def _counters(stats: Stats, least: int) -> None:
    _require(
        isinstance(stats.steps, int) and stats.steps >= least, f"steps counts steps, not {stats.steps!r}"
    )
    for name in ("rejections", "evaluations", "iterations"):
        value = getattr(stats, name)
        _require(
            value is None or (isinstance(value, int) and value >= 0),
            f"{name} is None or a count, not {value!r}",
        )


def _parse(text: str) -> tuple[str, dict[str, Any]]:
    """Read ``Name(option=literal, ...)`` without evaluating it."""
    call = ast.parse(text, mode="eval").body
    _require(isinstance(call, ast.Call) and isinstance(call.func, ast.Name), f"{text} reads as one call")
    assert isinstance(call, ast.Call)
    assert isinstance(call.func, ast.Name)
    _require(not call.args and all(k.arg for k in call.keywords), f"{text} has keyword arguments only")
    return call.func.id, {str(k.arg): ast.literal_eval(k.value) for k in call.keywords}
