"""Gauss with reversible adaptive steps: the energy does not drift, and the way back leads to the start."""

import pickle

import numpy as np
import pytest

import problems
from integrators import Gauss, Status, integrate, load, order_of
from problems import InputError, targets

TWO_PI = 2.0 * np.pi


def run(problem, method, revolutions, samples=200):
    """Return a stepper and the states at some times of so many revolutions."""
    stepper = method.compile(problem.system).start(problem.y0, problem.par, problem.t0)
    made = stepper.advance(np.linspace(0.0, TWO_PI * revolutions, samples + 1)[1:])
    assert made.status is Status.FINISHED
    return stepper, made.y


def drift(problem, y):
    """Return the change of the mean relative energy from the first to the last quarter, and its scatter."""
    energy = targets.numpy(problem.system, "hamiltonian")(0.0, y.T, problem.par)[0]
    parts = np.array_split(energy / energy[0], 4)
    return parts[-1].mean() - parts[0].mean(), np.std(energy / energy[0])


def way_back(problem, method, steps):
    """Return how far from the start a run of so many steps is after as many back."""
    stepper = method.compile(problem.system).start(problem.y0, problem.par, problem.t0)
    there = stepper.take(steps)
    stepper.advance([np.nextafter(there.t[-1], -np.inf)])  # turns
    back = stepper.take(steps)
    size = np.abs(problem.y0).max()
    return np.abs(back.y[-1] - problem.y0).max() / size, abs(back.t[-1] - problem.t0)


@pytest.mark.parametrize("e", [0.9, 0.99])
def test_the_energy_of_kepler_s_problem_stays_where_ordinary_steps_let_it_drift(e):
    problem = problems.load("kepler", e=e)
    moved = []
    for steps in ("reversible", None):
        _, y = run(problem, Gauss(s=3, tol=1e-6, steps=steps), 400)
        moved.append(abs(drift(problem, y)[0]))
        assert problem.errors(y)["angular_momentum"].max() < 1e-14  # measured: 1.6e-15
    # measured: 8e-15 beside 1.7e-6 for e = .9, 1.2e-11 beside 1.4e-5 for e = .99
    assert moved[0] < 1e-4 * moved[1]


@pytest.mark.parametrize(
    ("name", "options"), [("kepler", {"e": 0.9}), ("sitnikov", {"e": 0.9}), ("pendulum", {})]
)
def test_the_way_back_repeats_the_steps(name, options):
    problem = problems.load(name, **options)
    place, time = way_back(problem, Gauss(s=6, tol=1e-10, steps="reversible"), 200)
    assert place < 1e-12  # measured: at most 1.1e-14
    assert time < 1e-12  # measured: at most 5e-15
    ordinary, _ = way_back(problem, Gauss(s=6, tol=1e-10), 200)
    assert ordinary > 1e-3  # measured: at least .019, as other steps lead back


def test_where_it_stops_chaos_multiplies_rounding():
    problem = problems.load("henon_heiles")
    place, _ = way_back(problem, Gauss(s=6, tol=1e-10, steps="reversible"), 20_000)
    assert place > 1e-3  # measured: 0.7


def test_checkpoints_and_samples_leave_the_steps_alone():
    problem = problems.load("kepler", e=0.9)
    program = Gauss(s=4, tol=1e-8, steps="reversible").compile(problem.system)
    whole = program.start(problem.y0, problem.par).take(300)
    parts = program.start(problem.y0, problem.par)
    parts.advance([0.1, 0.37, 2.0])
    kept, rest = parts.checkpoint(), parts.take(30)
    parts.restore(kept)
    assert np.array_equal(parts.take(30).y, rest.y)
    places = np.searchsorted(whole.t, rest.t)
    assert np.array_equal(whole.y[places], rest.y)


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.9, 0.99])
def test_over_1e5_revolutions_the_energy_error_is_a_random_walk(e):
    problem = problems.load("kepler", e=e)
    _, y = run(problem, Gauss(s=8, tol=1e-12, steps="reversible"), 100_000, 4000)
    errors = problem.errors(y)
    assert errors["energy"].max() < 5e-12  # measured: 1.9e-13 for e = .9
    assert errors["angular_momentum"].max() < 1e-13  # measured: 1.5e-14


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"h": 0.1, "steps": "reversible"}, "with tol|without h"),
        ({"tol": 1e-9, "steps": "reversible", "max_step": 1.0}, "without max_step"),
        ({"tol": 1e-9, "steps": "backwards"}, "backwards"),
    ],
)
def test_what_cannot_be_is_said(keywords, words):
    with pytest.raises(InputError, match=words):
        Gauss(s=4, **keywords)


def test_it_is_no_hbvm_which_would_take_other_steps():
    method = Gauss(s=4, tol=1e-9, steps="reversible")
    for use in (method.as_hbvm, lambda: order_of(method)):
        with pytest.raises(InputError, match=r"no HBVM.*leave steps= out"):
            use()


@pytest.mark.parametrize("name", ["rigid_body", "charged_particle"])
def test_systems_without_it_are_refused(name):
    problem = problems.load(name)
    refusal = Gauss(s=4, tol=1e-9, steps="reversible").accepts(problem)
    assert refusal is None or "reversible" in refusal
    assert (refusal is None) == (problem.system.dof is not None)


def test_a_solution_can_be_saved_and_its_problem_sent_to_a_worker(tmp_path):
    problem = problems.load("kepler", e=0.5)
    solution = integrate(problem, Gauss(s=4, tol=1e-10, steps="reversible"), times=[1.0, 2.0])
    solution.save(tmp_path / "kepler.npz")
    loaded = load(tmp_path / "kepler.npz")
    assert np.array_equal(loaded.y, solution.y)
    again = integrate(pickle.loads(pickle.dumps(problem)), solution.method, times=[1.0, 2.0])
    assert np.array_equal(again.y, solution.y)
