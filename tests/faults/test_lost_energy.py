"""An energy that the method conserves and that has changed is told; ensembles tell what `integrate` tells."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, LineIntegral, integrate, integrate_many, load
from problems import Hamiltonian, Problem, VectorField

from .fault import sentence

BUMP = Hamiltonian(
    lambda q, p, m: p[0] ** 2 / 2 + q[0] ** 2 / 2 - 0.2 * m.exp(-((q[0] - 1.3) ** 2) * 4e10), dof=1
)
"""An oscillator that crosses a narrow well: a force no node sees."""

LEDGE = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + q[0] ** 2 / 2 + 0.2 * m.tanh(1e6 * (q[0] - 1.0)), dof=1)
"""An oscillator with a step in its potential: what is lost on the way up comes back on the way down."""

VALLEY = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.abs(q[0]), dof=1)


def starts(n):
    return np.column_stack([np.linspace(0.0, 1.2995, n), np.full(n, 0.5)])


def test_a_lost_energy_is_told():
    # A sample lies in the well, to which the energy that it has there belongs: no step saw it.
    end = float(np.arcsin(0.65))
    problem = Problem(BUMP, q0=[0.0], p0=[2.0], t_end=0.8)
    solution = integrate(problem, HBVM(), [end, 0.8])
    assert solution.errors()["energy"][0] > 0.05  # measured 0.091
    (warning,) = solution.warnings
    sentence(
        warning,
        "energy has changed by 9.1e-02 relative to its terms .* narrower than the steps; give breakpoints or",
    )
    seen = integrate(problem, HBVM(max_step=1e-3), [end])
    assert seen.warnings == ()
    assert seen.errors()["energy"][-1] < 1e-10  # measured 8.6e-15


@pytest.mark.parametrize(
    "method",
    [HBVM(), HBVM(tol=1e-4), HBVM(k=8, s=7, tol=1e-12), HBVM(k=8, s=4, tol=1e-4),
     LineIntegral(k=8, s=4, tol=1e-8, invariants=["energy"])],
    ids=repr,
)  # fmt: skip
def test_no_false_alarm_on_the_catalogue(method):
    for name in ("kepler", "sitnikov", "pythagorean", "lennard_jones", "cr3bp", "pendulum", "lotka_volterra"):
        problem = problems.load(name)
        if method.accepts(problem) is not None:
            continue
        end = problem.t0 + min(problem.t_end - problem.t0, 70.0)
        times = np.linspace(problem.t0, end, 200)
        assert integrate(problem, method, times).warnings == (), name


def test_an_energy_that_nearly_cancels_is_measured_by_its_terms():
    # H = 1e-10 of terms of size 1: rounding alone changes it by 1e-6 of itself.
    problem = Problem(
        Hamiltonian(lambda q, p: p[0] ** 2 / 2 - q[0] ** 2 / 2 + q[0] ** 4 / 4, dof=1),
        q0=[1.0], p0=[float(np.sqrt(0.5 + 2e-10))], t_end=50.0,
    )  # fmt: skip
    solution = integrate(problem, HBVM(), [50.0])
    assert solution.warnings == ()


@pytest.mark.parametrize("times", [[1.5, 2.9], [0.1, 1.5, 2.9, 3.0]], ids=str)
def test_an_energy_that_comes_back_is_told_with_the_time_at_which_it_was_gone(times):
    # No warning before: at the end the energy is as at the start.
    problem = Problem(LEDGE, q0=[0.0], p0=[2.0], t_end=3.0)
    solution = integrate(problem, HBVM(), times)
    assert solution.errors()["energy"][-1] < 1e-10  # measured 2e-16
    (warning,) = solution.warnings
    sentence(warning, r"energy has changed by 1.8e-01 relative to its terms \(first seen at t = 1.5\)")
    made = integrate_many(problem, HBVM(), starts=[[0.0, 2.0], [0.0, 0.9]], times=times)
    assert made.warnings == [(warning,), ()]


def test_an_energy_that_comes_back_is_seen_at_a_checkpoint(tmp_path):
    problem, kept = Problem(LEDGE, q0=[0.0], p0=[2.0], t_end=2.9), tmp_path / "kept"
    options = {"checkpoint": kept, "every_seconds": 0.0}
    solution = integrate(problem, HBVM(), [2.9], **options)
    (warning,) = solution.warnings
    sentence(
        warning, r"energy has changed by 1.8e-01 relative to its terms \(first seen at t = (0.[5-9]|[12].)"
    )
    assert integrate(problem, HBVM(), [2.9]).warnings == ()  # seen by nobody without it
    assert integrate(problem, HBVM(), [2.9], resume=kept).warnings == (warning,)
    solution.save(tmp_path / "solution.npz")
    assert load(tmp_path / "solution.npz").warnings == (warning,)


def test_dense_samples_conserve_nothing_and_are_not_judged():
    problem = problems.load("kepler", e=0.6)
    solution = integrate(problem, HBVM(k=16, s=4, tol=1e-3), [9.87, 12.0], sample="dense")
    assert solution.errors()["energy"][0] > 1e-8  # measured 2.8e-6
    assert solution.warnings == ()


@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=7, tol=1e-12)], ids=repr)
def test_an_ensemble_tells_which_trajectories_lost_their_energy(method):
    given = starts(5)
    made = integrate_many(Problem(BUMP, q0=[0.0], p0=[0.5], t_end=1.0), method, starts=given, times=[2.6])
    for start, end, told in zip(given, made.y[:, -1], made.warnings, strict=True):
        problem = Problem(BUMP, q0=[start[0]], p0=[start[1]], t_end=1.0)
        lost = problem.errors(end)["energy"][0] > 1e-6
        assert [one[:18] for one in told] == (["energy has changed"] if lost else [])


@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=7, tol=1e-12), Gauss(s=4, tol=1e-10)], ids=repr)
def test_an_ensemble_tells_what_integrate_tells_of_kinks(method):
    given, problem = [[0.1, 0.0], [2.0, 0.0], [9.0, 0.0]], Problem(VALLEY, q0=[1.0], p0=[0.0], t_end=3.0)
    made = integrate_many(problem, method, starts=given, times=[3.0])
    alone = [integrate(Problem(VALLEY, q0=[q], p0=[p], t_end=3.0), method, [3.0]).warnings for q, p in given]
    assert made.warnings == alone
    assert [len(sentences) for sentences in alone] == [1, 1, 0]
    assert made.extra[0]["kinks"]


def test_a_field_that_is_not_looked_at_is_told_of_every_trajectory():
    kinked = VectorField(lambda y, m: [y[1], -m.abs(y[0])], dim=2)
    made = integrate_many(
        Problem(kinked, y0=[1.0, 0.0], t_end=1.0), HBVM(k=4, s=2, h=0.1), starts=[[1, 0], [2, 0]]
    )
    assert [len(sentences) for sentences in made.warnings] == [1, 1]
