"""Maps of MEGNO and of exponents in lanes: what one trajectory after another has, with any forces."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Status, lyapunov
from integrators.dynamics import indicator_map, lyapunov_map, megno, megno_map
from integrators.dynamics.together import Together
from integrators.dynamics.vectors import random_vectors
from problems import InputError, nbody
from problems.bodies import J2, Migration, Orbit, RadiationPressure, starts

METHOD = Gauss(s=6, h=0.02)
FORCES = [J2(J2=1e-3, R=0.01), RadiationPressure(beta=0.01, c=1e4, bodies=[2]), Migration(tau_e=1e4, body=2)]


def _belt(t_end=20.0, forces=FORCES):
    problem = nbody(
        [1.0, 1e-3], orbits=[Orbit(a=1.0, e=0.05), Orbit(a=0.6)], massless=1, forces=forces, t_end=t_end
    )
    a, e = np.linspace(0.6, 0.66, 3), np.array([0.0, 0.2])
    return problem, starts(problem, -1, Orbit(a=a[:, np.newaxis], e=e)), a, e


def test_megno_in_lanes_is_that_of_each_trajectory():
    problem, rows, _, _ = _belt()
    assert Together(problem, METHOD, random_vectors(18, 1), 1).available
    found = megno_map(problem, METHOD, starts=rows)
    alone = [megno(problem.replace(y0=row), METHOD).value for row in rows]
    assert found.status == [Status.FINISHED] * 6
    assert found.values == pytest.approx(alone, abs=1e-9)  # measured 2e-12


@pytest.mark.parametrize("count", [1, 2])
def test_exponents_in_lanes_are_those_of_each_trajectory(count):
    rows = [[0.0, 0.1, 0.1, 0.0], [0.0, 0.5, 0.35611546, 0.19454676], [0.0, -0.2, 0.4, 0.0]]
    problem, method = problems.load("henon_heiles"), Gauss(s=6, h=0.25)
    found = lyapunov_map(problem, method, starts=rows, count=count, t_end=150.0)
    for i, row in enumerate(rows):
        alone = lyapunov(problem.replace(y0=row), method, count=count, t_end=150.0)
        # measured 2e-9 on the chaotic orbit, where rounding grows to 1 at t = 300, and 1e-16 on the others
        assert found.exponents[i] == pytest.approx(alone.exponents, abs=1e-7)
        assert found.intervals[i] == pytest.approx(alone.intervals, abs=1e-7)


def test_a_trajectory_that_fails_leaves_the_others():
    def falls(q, p, m):
        return p[0] ** 2 / 2 - q[0] ** 4

    problem = problems.Problem(problems.Hamiltonian(falls, dof=1), q0=[0.0], p0=[0.0], t_end=20.0)
    found = megno_map(problem, Gauss(s=2, h=0.01), starts=[[0.0, 0.0], [1.0, 1.0], [0.0, 1e-9]])
    assert [status.failed for status in found.status] == [False, True, False]
    assert np.isnan(found.values).tolist() == [False, True, False]
    assert found.reason[1] != ""
    assert found.reason[0] == ""


def test_a_map_in_lanes_that_was_broken_off_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr("integrators.dynamics.together.PIECE", 2)
    problem, rows, _, _ = _belt(t_end=5.0)
    whole, seen = megno_map(problem, METHOD, starts=rows), []

    def stop(progress):
        seen.append(progress.t)
        if progress.t >= 4.0:
            raise KeyboardInterrupt

    file = tmp_path / "map"
    broken = megno_map(problem, METHOD, starts=rows, checkpoint=file, every_seconds=0.0, progress=stop)
    assert [status is Status.INTERRUPTED for status in broken.status] == [False] * 4 + [True] * 2
    assert seen == [2.0, 4.0]
    resumed = megno_map(problem, METHOD, starts=rows, resume=file)
    assert resumed.values.tolist() == whole.values.tolist()


def test_what_has_no_lanes_is_followed_one_by_one():
    problem, rows, _, _ = _belt(t_end=5.0)
    assert not Together(problem, HBVM(), random_vectors(18, 1), 1).available
    adaptive = megno_map(problem, HBVM(), starts=rows[:2])
    fixed = megno_map(problem, METHOD, starts=rows[:2])
    assert adaptive.values == pytest.approx(fixed.values, abs=0.01)  # other sums of trapezoids


def test_a_map_is_drawn_over_its_grid():
    problem, rows, a, e = _belt(t_end=2.0)
    found = megno_map(problem, METHOD, starts=rows)
    with mpl.rc_context():
        plt.switch_backend("Agg")
        mesh = found.draw(a, e, cmap="viridis")
        assert mesh.get_array().shape == (2, 3)
        assert mesh.get_array()[1, 2] == found.values[5]
        with pytest.raises(InputError, match="does not have the 6 points"):
            found.draw(a, e[:1])
        plt.close("all")


@pytest.mark.slow
def test_random_grids_and_forces_have_the_values_of_each_trajectory():
    rng = np.random.default_rng(3)
    for _ in range(10):
        forces = [force for force in FORCES if rng.random() < 0.5]
        problem, _, _, _ = _belt(t_end=float(rng.uniform(2.0, 30.0)), forces=forces)
        rows = starts(problem, -1, Orbit(a=rng.uniform(0.4, 1.6, 9), e=rng.uniform(0.0, 0.4, 9)))
        method = Gauss(s=int(rng.integers(4, 8)), h=float(rng.uniform(0.01, 0.03)))
        found = indicator_map(problem, "megno", method, starts=rows)
        alone = [megno(problem.replace(y0=row), method).value for row in rows]
        assert found.values == pytest.approx(alone, rel=1e-6, abs=1e-8)
