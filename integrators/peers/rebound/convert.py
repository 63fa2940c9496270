"""Problems from REBOUND's simulations, and states back into them."""

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from integrators.peers import load
from integrators.refusals import check_state
from integrators.solution import Solution
from problems.bodies import bodies_of, nbody
from problems.checks import checked_arguments
from problems.errors import InputError, shown
from problems.problem import Problem, check_is_problem

UNSET = (False,)  # of a pointer to code
SET = (
    ("gravity", ("basic",), "its gravity is {!r}, not 'basic'"),
    ("collision", ("none",), "it looks for collisions ({!r})"),
    ("boundary", ("none",), "it has a boundary ({!r})"),
    *((f"N_ghost_{axis}", (0,), f"it has ghost boxes (N_ghost_{axis}={{!r}})") for axis in "xyz"),
    ("OMEGA", (0.0,), "its frame rotates (OMEGA={!r}), as SEI's does"),
    ("testparticle_type", (0,), "its test particles pull the others (testparticle_type={!r})"),
    ("N_var", (0,), "it has variational particles"),
    ("_gravity_custom", UNSET, "it has a gravity of its own (gravity_custom)"),
    ("_pre_timestep_modifications", UNSET, "it calls a function before a step (pre_timestep_modifications)"),
    ("_post_timestep_modifications", UNSET, "it calls a function after a step (post_timestep_modifications)"),
    ("_heartbeat", UNSET, "it calls a function after each step (heartbeat)"),
    ("_N_odes", (0,), "it integrates {!r} other systems of equations (create_ode)"),
    ("exit_max_distance", (0.0,), "it ends where a body is far away (exit_max_distance={!r}); use an event"),
    ("exit_min_distance", (0.0,), "it ends where two bodies are near (exit_min_distance={!r}); use an event"),
)
"""What of a simulation no problem has: its attribute, the values that are taken, and how others are told."""
ADDITIONAL = (
    "_additional_forces",
    UNSET,
    "it has forces that are code (additional_forces, or those of REBOUNDx); give them again as forces=",
)
"""The same, which is taken where forces are given."""


@checked_arguments
def from_rebound(simulation: Any, *, t_end: float, forces: Sequence[Any] = ()) -> Problem:
    """Return the bodies of a simulation as a problem, at its time.

    Parameters
    ----------
    simulation : rebound.Simulation
        With its own gravity. Bodies without mass, or beyond ``N_active``, must be the last ones.
    t_end : float
        The end of the integration, in the simulation's units, as everything is.
    forces : sequence
        What else acts, as for `problems.nbody`. REBOUND's additional forces are code: a simulation with them
        is taken only where they are given here again.

    Returns
    -------
    Problem
        As `problems.nbody` makes it.

    Raises
    ------
    problems.errors.InputError
        For a simulation with massless bodies between others, and with what a problem does not have:
        collisions, boundaries, ghost boxes, a rotating frame, another gravity, additional forces, functions
        that are called at each step, distances that end it. The sentence names it.

    Examples
    --------
    >>> import rebound
    >>> from integrators import HBVM, from_rebound, integrate, to_rebound
    >>> simulation = rebound.Simulation()
    >>> for x in ({"m": 1.0}, {"m": 1e-3, "a": 1.0}, {"a": 2.0}):
    ...     simulation.add(**x)
    >>> problem = from_rebound(simulation, t_end=10.0)
    >>> solution = integrate(problem, HBVM(), [10.0])
    >>> round(to_rebound(problem, solution.y[-1], t=10.0, simulation=simulation).particles[2].a, 2)
    2.0
    """
    if not hasattr(simulation, "particles") or not hasattr(simulation, "N_active"):
        raise InputError(f"{shown(simulation)} is no rebound.Simulation.")
    for name, taken, told in SET if forces else (*SET, ADDITIONAL):
        value = getattr(simulation, name)
        value = bool(value) if taken is UNSET else value
        if value not in taken:
            raise InputError(f"the simulation cannot be taken over: {told.format(value)}.")
    simulation.synchronize()
    particles = [simulation.particles[i] for i in range(simulation.N)]
    active = simulation.N if simulation.N_active < 0 else simulation.N_active
    masses = [particle.m if i < active else 0.0 for i, particle in enumerate(particles)]
    n = sum(mass != 0.0 for mass in masses)
    if any(mass == 0.0 for mass in masses[:n]):
        raise InputError(
            "bodies without mass must be the last ones; add them to the simulation after the others."
        )
    names = [body.name for body in particles]
    return nbody(
        masses[:n],
        [[body.x, body.y, body.z] for body in particles],
        [[body.vx, body.vy, body.vz] for body in particles],
        massless=len(particles) - n, forces=forces, G=simulation.G,
        softening=simulation.softening or None, names=names if all(names) else (),
        t0=simulation.t, t_end=t_end,
    )  # fmt: skip


@checked_arguments
def to_rebound(
    problem: Problem | Solution, y: ArrayLike | None = None, *, t: float | None = None, simulation: Any = None
) -> Any:
    """Return a simulation with the bodies of a problem in a state.

    Parameters
    ----------
    problem : Problem or Solution
        From `problems.nbody` or `from_rebound`, or any with bodies in space. Of a solution, its last state.
    y : array_like, shape (dim,), optional
        The state: a row of ``solution.y``; by default the problem's start.
    t : float, optional
        Its time; by default the problem's ``t0``.
    simulation : rebound.Simulation, optional
        One of the same bodies, in their order, that the state is written into: its names, units, radii and
        integrator remain. By default a new one, with the masses and the constant of gravitation.

    Raises
    ------
    problems.errors.InputError
        For a problem without bodies, and a simulation with another number of them.
    problems.errors.MissingLibraryError
        If REBOUND is not installed.

    Examples
    --------
    >>> import problems
    >>> from integrators import to_rebound
    >>> to_rebound(problems.load("outer_solar_system")).N
    6
    """
    if isinstance(problem, Solution):
        if y is not None or t is not None:
            raise InputError(
                "to_rebound(solution) takes its last state; for another give its problem, y= and t=."
            )
        if not problem.t.size:
            raise InputError(
                f"the solution has no state: it ended at t = {problem.t_stop!r}, {problem.reason}"
            )
        solution, segments = problem, problem._segments
        y, t = solution.y[-1], float(solution.t[-1])
        par = segments.par[segments.places(solution.t[-1:], solution.y[-1:])[0]]
        changed: Any = solution.problem.system.unpack(par)  # by events
        problem = solution.problem.replace(parameters=changed)
    check_is_problem(problem)

    time = problem.t0 if t is None else t
    masses, x, v = bodies_of(problem, None if y is None else check_state(y, problem.system.dim), time)
    n, values = len(x), problem.system.unpack(problem.par)
    if simulation is None:
        simulation = load("rebound").Simulation()
        simulation.G, simulation.softening = values.get("G", 1.0), values.get("eps", 0.0)
        for mass in [*masses.tolist(), *[0.0] * (n - masses.size)]:
            simulation.add(m=mass)
        simulation.N_active = masses.size
    elif n != simulation.N:
        raise InputError(f"the simulation has {simulation.N} bodies, and {problem!s} {n}.")
    simulation.t = time
    for i in range(n):
        particle = simulation.particles[i]
        particle.x, particle.y, particle.z = x[i].tolist()
        particle.vx, particle.vy, particle.vz = v[i].tolist()
    return simulation
