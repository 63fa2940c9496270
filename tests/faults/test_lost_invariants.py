"""An invariant that is lost, or an atol above the size of the state, is told for every method, and only then.

Lost is an invariant that has changed by a tenth of its terms (`integrators.caveats.LOST_BY_ANY`).
"""

import numpy as np
import pytest

import integrators
import problems
from integrators import integrate, integrate_many
from problems import Hamiltonian, Problem

CHARGE, MASS, EPSILON, RADIUS = 1.602176634e-19, 9.1093837015e-31, 8.8541878128e-12, 5.29177e-11
FORCE = CHARGE**2 / (4 * np.pi * EPSILON)


def hydrogen():
    """Return a classical hydrogen atom, lengths of 5e-11 m, ten turns."""
    speed = np.sqrt(FORCE / (MASS * RADIUS))
    system = Hamiltonian(
        lambda q, p, par, m: (p[0] ** 2 + p[1] ** 2) / (2 * par.m) - par.k / m.sqrt(q[0] ** 2 + q[1] ** 2),
        dof=2,
        parameters={"m": MASS, "k": FORCE},
    )
    start = {"q0": [RADIUS, 0.0], "p0": [0.0, 0.8 * MASS * speed]}
    return Problem(system, **start, t_end=10 * 2 * np.pi * RADIUS / speed)


def made(name, **options):
    return integrators.registry.create(name, **options)


ATOL = [
    made("DOP853", rtol=1e-12, atol=1e-12),
    made("Radau", rtol=1e-6, atol=1e-9),
    made("LSODA", rtol=1e-8, atol=1e-12),
    integrators.HBVM(tol=1e-12, atol=1e-12),
    integrators.Gauss(s=4, tol=1e-12, atol=1e-12),
]


@pytest.mark.parametrize("method", ATOL, ids=repr)
def test_an_atol_above_the_size_of_the_state_is_told(method):
    # Before: finished, the energy wrong by its own size, no warning.
    problem = hydrogen()
    solution = integrate(problem, method, [problem.t_end])
    told = [said for said in solution.warnings if "is above the size of all p" in said]
    assert len(told) == 1, solution.warnings
    many = integrate_many(problem, method, starts=[problem.y0] * 2, times=[problem.t_end])
    assert all(any("is above the size of all p" in said for said in one) for one in many.warnings)


def test_a_lost_energy_is_told_for_a_method_that_does_not_conserve_it():
    problem = hydrogen()
    solution = integrate(problem, ATOL[0])
    assert solution.errors()["energy"].max() > 0.1  # measured 0.93
    (told,) = [said for said in solution.warnings if said.startswith("energy has changed by")]
    assert "it is lost, and the trajectory with it; give a smaller tolerance or step" in told
    assert "though the method conserves" not in told


def test_nothing_is_told_where_the_units_suit_the_tolerance():
    problem = hydrogen()
    for method in (
        made("DOP853", rtol=1e-12, atol=1e-40),
        integrators.HBVM(),
        integrators.HBVM(tol=1e-10),
        integrators.Gauss(s=4, tol=1e-10),
    ):
        solution = integrate(problem, method)
        assert solution.errors()["energy"].max() < 1e-8  # measured 4.4e-12 with DOP853
        assert solution.warnings == ()


def kepler_in_units(rng):
    """Return Kepler's problem with lengths, times and masses in random units, and the sizes of q and p."""
    length, time, mass = 10.0 ** rng.uniform(-15, 15, 3)
    e = rng.uniform(0.0, 0.6)
    mu = mass * length**3 / time**2
    system = Hamiltonian(
        lambda q, p, par, m: (p[0] ** 2 + p[1] ** 2) / (2 * par.m) - par.mu / m.sqrt(q[0] ** 2 + q[1] ** 2),
        dof=2,
        parameters={"m": mass, "mu": mu},
        invariants={"momentum": lambda q, p: q[0] * p[1] - q[1] * p[0]},
    )
    momentum = mass * length / time * np.sqrt((1 + e) / (1 - e))
    return Problem(system, q0=[(1 - e) * length, 0.0], p0=[0.0, momentum], t_end=20 * time)


METHODS = [
    lambda atol: made("DOP853", rtol=1e-10, atol=atol),
    lambda atol: made("BDF", rtol=1e-6, atol=atol),
    lambda atol: made("LSODA", rtol=1e-8, atol=atol),
    lambda atol: made("Radau", rtol=1e-6, atol=atol),
    lambda atol: integrators.HBVM(tol=1e-8, atol=atol),
    lambda atol: integrators.Gauss(s=4, tol=1e-8, atol=atol),
    lambda atol: made("Taylor", tol=1e-12),
    lambda atol: integrators.HBVM(),
]


def check_units(seed):
    """Check that a run in random units is right, or says that it is not; return whether it was wrong."""
    rng = np.random.default_rng(seed)
    problem = kepler_in_units(rng)
    method = METHODS[seed % len(METHODS)](10.0 ** rng.uniform(-20, 0))
    with np.errstate(all="ignore"):
        solution = integrate(problem, method)
    if solution.status.failed:
        return False
    wrong = max(error.max() for error in solution.errors().values()) > 0.1
    assert not wrong or solution.warnings, (seed, problem, method)
    small = np.abs(solution.y).max(axis=0).reshape(2, 2).max(axis=1) < (
        method.options(defaults=True).get("atol") or 0.0
    )
    assert bool(solution.warnings) == bool(wrong or small.any()), (seed, solution.warnings)
    return wrong


def test_a_run_in_random_units_is_right_or_says_that_it_is_not():
    assert sum(check_units(seed) for seed in range(24)) >= 1  # measured 2 of 24 wrong, all told


@pytest.mark.slow
def test_many_runs_in_random_units_are_right_or_say_that_they_are_not():
    assert sum(check_units(seed) for seed in range(24, 600)) >= 1


ORDINARY = [
    integrators.HBVM(), integrators.HBVM(tol=1e-6), integrators.HBVM(k=8, s=4, tol=1e-8),
    integrators.Gauss(s=4, tol=1e-8), made("DOP853", rtol=1e-8, atol=1e-8),
    made("LSODA", rtol=1e-6, atol=1e-9),
    made("Radau", rtol=1e-6, atol=1e-9), made("BDF", rtol=1e-6, atol=1e-9),
    made("Taylor", tol=1e-12, compact_mode=True),  # else it warns of a field that takes long to compile
    made("IAS15"), integrators.Gauss(s=4, h=0.05), integrators.HBVM(k=8, s=4, h=0.05),
    made("Leapfrog", h=0.01),
]  # fmt: skip
QUICK = ("kepler", "henon_heiles", "pendulum", "lotka_volterra")


def check_ordinary(name, end):
    problem = problems.load(name)
    span = problem.t_end - problem.t0
    for method in ORDINARY:
        if method.accepts(problem) is not None:
            continue
        with np.errstate(all="ignore"):
            solution = integrate(problem, method, np.linspace(problem.t0, problem.t0 + min(span, end), 200))
        worst = max((error.max(initial=0.0) for error in solution.errors().values()), default=0.0)
        told = [said for said in solution.warnings if "lost" in said or "atol" in said]
        assert not told or worst > 0.1 or solution.status.failed, (method, told)


@pytest.mark.parametrize("name", QUICK)
def test_ordinary_runs_of_all_methods_are_not_warned_of(name):
    check_ordinary(name, 20.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in problems.names() if name not in QUICK])
def test_ordinary_runs_of_the_whole_catalogue_are_not_warned_of(name):
    check_ordinary(name, 100.0)
