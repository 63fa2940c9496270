"""integrate_many: named parameters, statuses, progress, every method."""

import doctest
from pathlib import Path

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Status, integrate, integrate_many, registry
from problems import Hamiltonian, Opaque, Problem

rng = np.random.default_rng(3)


def morse(D=1.0, a=1.0):
    def H(q, p, par, m):
        rise = 1.0 - m.exp(-par.a * q[0])
        return p[0] * p[0] / 2 + par.D * rise * rise

    system = Hamiltonian(H, dof=1, parameters={"D": 1.0, "a": 1.0}, name="morse")
    return Problem(system, q0=[0.5], p0=[0.1], parameters={"D": D, "a": a}, t_end=5.0)


@pytest.mark.parametrize(
    ("method", "close"),
    [
        (Gauss(s=6, h=0.25), 2e-15),  # measured 3e-16
        (HBVM(k=12, s=4, h=0.25), 2e-15),
        (HBVM(k=8, s=4, tol=1e-10), 1e-8),  # steps end at the times: measured 1e-9
        (HBVM(k=8, s=4, tol=1e-10, max_step=0.3), 0.0),
        (HBVM(k=18, s=2, h=0.25), 0.0),
        ("Taylor", 1e-13),  # its batch lands on the times: measured 3e-15
        ("DOP853", 0.0),
    ],
    ids=str,
)
def test_each_trajectory_is_that_of_integrate(method, close):
    if isinstance(method, str):
        pytest.importorskip("heyoka" if method == "Taylor" else "scipy")
        options = {} if method == "Taylor" else {"rtol": 1e-10, "atol": 1e-10}
        method = registry.create(method, **options)
    n = 11
    depths, widths = rng.uniform(0.8, 1.2, n), rng.uniform(0.8, 1.2, n)
    starts = rng.uniform(-0.1, 0.3, (n, 2))
    times = [0.5, 1.3, 5.0]
    made = integrate_many(morse(), method, starts=starts, parameters={"D": depths, "a": widths}, times=times)
    assert made.y.shape == (n, 3, 2)
    assert made.arrived.all()
    assert np.array_equal(made.par, np.stack([depths, widths], axis=1))
    for i in range(n):
        one = morse(depths[i], widths[i])
        values = {"D": depths[i], "a": widths[i]}
        one = Problem(one.system, y0=starts[i], parameters=values, t_end=5.0)
        alone = integrate(one, method, times)
        assert np.abs(made.y[i] - alone.y).max() <= close


def test_the_problem_says_what_is_not_given():
    problem, method = morse(), Gauss(s=8, h=0.2)
    made = integrate_many(problem, method, parameters={"D": [0.9, 1.0, 1.1]})
    assert len(made) == 3
    assert made.t.tolist() == [problem.t_end]
    assert np.array_equal(made.starts, [problem.y0] * 3)
    same = integrate_many(problem, method, starts=[problem.y0] * 2, parameters={"D": 1.1})
    assert np.array_equal(same.y[1], made.y[2])


def test_a_parameter_that_is_a_list_is_given_as_lists():
    problem = problems.load("outer_solar_system")
    masses = problem.system.unpack(problem.par)["m"] * np.array([[1.0], [1.001]])
    made = integrate_many(problem, Gauss(s=8, h=1.0), parameters={"m": masses}, times=[10.0])
    same = {"m": masses[1]}
    one = integrate_many(problem, Gauss(s=8, h=1.0), starts=[problem.y0], parameters=same, times=[10.0])
    assert np.array_equal(made.y[1], one.y[0])
    assert not np.array_equal(made.y[0], made.y[1])


def test_one_that_fails_has_its_status_and_the_others_are_there():
    def H(q, p, m):
        return p[0] * p[0] / 2 - q[0] * m.sqrt(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="root"), q0=[1.0], p0=[0.0], t_end=4.0)
    made = integrate_many(problem, Gauss(s=4, h=0.25), starts=[[1.0, 0.0], [1.0, -2.0], [2.0, 0.5]])
    assert made.arrived.tolist() == [True, False, True]
    assert made.status[1].failed
    assert "t = " in made.reason[1]
    assert 0.25 <= made.t_stop[1] < 1.5
    assert np.isnan(made.y[1]).all()
    assert np.isfinite(made.y[[0, 2]]).all()


def test_a_field_of_foreign_code_goes_one_by_one_and_its_errors_are_told():
    def f(t, y):
        if y[0] > 2.0:
            raise ValueError("too far")
        return [y[1], 0.0]

    problem = Problem(Opaque(f, dim=2), y0=[0.0, 0.1], t_end=3.0)
    made = integrate_many(problem, HBVM(k=4, s=2, h=0.1), starts=[[0.0, 0.1], [0.0, 1.0], [3.0, 0.0]])
    assert made.status[0] is Status.FINISHED
    for i, reached in ((1, "t = 2.0"), (2, "t = 0.0")):
        assert made.status[i].failed
        assert reached in made.reason[i]


@pytest.mark.parametrize("method", [Gauss(s=4, h=0.1), HBVM(k=8, s=4, tol=1e-8)], ids=str)
def test_progress_is_told(method):
    told = []
    made = integrate_many(morse(), method, starts=np.tile([0.1, 0.1], (200, 1)), progress=told.append)
    assert [one.fraction for one in told] == sorted(one.fraction for one in told)
    assert len(told) > 1
    assert told[-1].fraction == 1.0
    assert told[-1].left == 0.0
    assert told[-1].steps == made.steps.sum()


@pytest.mark.parametrize("method", [Gauss(s=4, h=0.1), HBVM(k=8, s=4, tol=1e-8)], ids=str)
def test_ctrl_c_returns_what_was_reached(method):
    def press(at):
        if at.fraction > 0.5:
            raise KeyboardInterrupt

    made = integrate_many(morse(), method, starts=np.tile([0.1, 0.1], (1000, 1)), progress=press)
    reached = made.arrived.sum()
    assert 500 < reached < 1000
    assert np.isfinite(made.y[:reached]).all()
    assert made.status[reached:] == [Status.INTERRUPTED] * (1000 - reached)
    assert np.isnan(made.y[reached:]).all()
    assert "Ctrl-C" in made.reason[-1]
    assert made.t_stop[-1] == 0.0


def test_the_accurate_choice_for_lanes_takes_no_steps_that_gain_nothing():
    problem = problems.load("kepler", e=0.6, t_end=60.0)
    starts = problem.y0 * np.linspace(0.99, 1.01, 64)[:, None]
    chosen, finer, single = (
        integrate_many(problem, method, starts=starts)
        for method in (HBVM(), HBVM(k=8, s=7, tol=3e-16), HBVM(k=16, s=14, tol=3e-16))
    )
    assert chosen.steps.sum() < 0.85 * finer.steps.sum()  # measured .81
    off, least = (np.abs(made.y - single.y).max() for made in (chosen, finer))
    assert off < 2.0 * least
    assert least < 1e-12


def test_without_a_method_it_is_the_one_that_chooses_for_itself():
    made = integrate_many(morse(), starts=[[0.1, 0.1]])
    assert made.method == HBVM()
    assert made.arrived.all()


def test_the_page_says_what_happens():
    page = Path(__file__).parents[3] / "docs" / "ensembles.md"
    assert doctest.testfile(str(page), module_relative=False).failed == 0
