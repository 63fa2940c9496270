"""Indicators of chaos where their values are known."""

import math

import numpy as np
import pytest
import scipy.linalg

import problems
from integrators import HBVM, Gauss, Status, integrate
from integrators.dynamics import finite_time_exponent, gali, indicator_map, lyapunov, megno, sali
from problems import Hamiltonian, InputError, Problem, VectorField


def quartic(q, p):
    """Two coupled oscillators, far from linear."""
    return (p[0] ** 2 + p[1] ** 2) / 2 + q[0] ** 4 + q[1] ** 4 / 3 + q[0] ** 2 * q[1] ** 2 / 10


def linear(q, p):
    return (p[0] ** 2 + p[1] ** 2 + q[0] ** 2 + 2 * q[1] ** 2) / 2


REGULAR = Problem(Hamiltonian(quartic, dof=2), q0=[1.0, 0.3], p0=[0.3, 1.2], t_end=1e4)
CHAOTIC = problems.load("henon_heiles")  # at an energy of 0.1657


@pytest.mark.parametrize(
    "problem",
    [
        pytest.param(REGULAR, id="quartic", marks=pytest.mark.slow),
        pytest.param(problems.load("henon_heiles", energy=1 / 12, q2=0.05), id="henon_heiles"),
    ],
)
def test_megno_of_a_quasi_periodic_orbit_is_2(problem):
    found = megno(problem, HBVM(), t_end=1e6)
    assert found.status is Status.FINISHED
    assert found.t[-1] == 1e6
    assert abs(found.value - 2.0) < 2e-4  # measured: 1.99993, 1.99999


def test_megno_does_not_depend_on_the_number_of_samples():
    for method in (HBVM(), Gauss(s=6, h=0.25)):
        few, many = (megno(CHAOTIC, method, t_end=1000.0, samples=n) for n in (16, 2048))
        common, in_few, in_many = np.intersect1d(few.t, many.t, return_indices=True)
        assert common[-1] == 1000.0
        assert 10 < common.size < many.t.size
        assert np.array_equal(few.values[in_few], many.values[in_many])


def test_megno_of_a_linear_oscillator_is_0():
    problem = Problem(Hamiltonian(linear, dof=2), q0=[1.0, 0.5], p0=[0.3, 0.2], t_end=2e4)
    assert abs(megno(problem, Gauss(s=6, h=0.1)).value) < 1e-3  # measured: 1e-4


def test_megno_of_a_chaotic_orbit_is_half_of_exponent_times_time():
    method, end = Gauss(s=6, h=0.25), 5000.0
    exponent = lyapunov(CHAOTIC, method, t_end=end, count=1).exponents[0]
    value = megno(CHAOTIC, method, t_end=end).value
    assert abs(value / (exponent * end / 2) - 1.0) < 0.05  # measured: 0.02


def test_alignment_indices_tell_chaos():
    method = Gauss(s=6, h=0.1)
    for problem, low, high in ((REGULAR, 0.2, 1.5), (CHAOTIC, 0.0, 1e-12)):  # measured: 0.79, 1e-16
        index = sali(problem, method, t_end=1e3)
        assert low <= index.value <= high
    volumes = [gali(REGULAR, method, k=k, t_end=1e4) for k in (2, 3, 4)]
    assert volumes[0].value > 0.2  # measured: 0.73
    for volume, power in zip(
        volumes[1:], (2, 4), strict=True
    ):  # like t^-(2 (k - 2)) on a torus of 2 dimensions
        late = volume.t > 300.0
        slope = np.polyfit(np.log(volume.t[late]), np.log(volume.values[late]), 1)[0]
        assert abs(slope + power) < 0.5, power


@pytest.mark.parametrize("coupling", [0.0, 0.01, 0.05])
def test_volumes_on_a_torus_of_three_dimensions_follow_their_powers(coupling):
    """GALI_k is constant for k <= 3, then falls like t^-(2 (k - 3)) (Skokos et al. 2007)."""

    def energy(q, p):
        oscillators = q[0] ** 4 + q[1] ** 4 / 3 + q[2] ** 4 / 2
        between = q[0] ** 2 * q[1] ** 2 + q[1] ** 2 * q[2] ** 2
        return (p[0] ** 2 + p[1] ** 2 + p[2] ** 2) / 2 + oscillators + coupling * between

    problem = Problem(Hamiltonian(energy, dof=3), q0=[1.0, 0.3, 0.7], p0=[0.3, 1.2, 0.5], t_end=1e4)
    for k in range(2, 7):
        volume = gali(problem, Gauss(s=6, h=0.1), k=k)
        late = volume.t > 1000.0
        slope = np.polyfit(np.log(volume.t[late]), np.log(volume.values[late]), 1)[0]
        assert abs(slope + 2 * max(k - 3, 0)) < 0.1, k  # measured: at most 0.023
        if k <= 3:
            assert volume.value > 0.1  # measured: 0.15 to 0.58


def test_sali_falls_by_the_difference_of_the_two_largest_exponents():
    """Lorenz's model of the atmosphere, whose second exponent is positive too."""

    def ring(y, par):
        return [(y[(i + 1) % 8] - y[i - 2]) * y[i - 1] - y[i] + par.F for i in range(8)]

    system, method = VectorField(ring, dim=8, parameters={"F": 10.0}), Gauss(s=5, h=0.04)
    y0 = 10.0 + np.random.default_rng(2).standard_normal(8)
    problem = Problem(system, y0=y0, t_end=4020.0)
    known = lyapunov(problem, method, count=2, skip=20.0)
    # measured: 2.122 and 0.748, with intervals of +-0.032 and +-0.034
    difference, unsure = known.exponents[0] - known.exponents[1], np.diff(known.intervals).sum() / 2
    times, slopes = np.array([3.0, 15.0]), []
    for start in integrate(problem, method, np.arange(20.0, 1220.0, 4.0)).y:
        found = sali(Problem(system, y0=start, t_end=16.0), method, samples=40)
        first, last = np.interp(times, found.t, np.log(found.values))
        slopes.append((first - last) / np.diff(times)[0])
    scatter = 2.0 * np.std(slopes, ddof=1) / math.sqrt(len(slopes))
    # measured: 1.391 +- 0.053 beside 1.374
    assert abs(np.mean(slopes) - difference) < scatter + unsure
    assert scatter < 0.1


def test_the_volume_of_two_vectors_is_half_the_product_of_the_two_alignment_indices():
    method = Gauss(s=6, h=0.1)
    smaller, volume = sali(REGULAR, method, t_end=200.0).values, gali(REGULAR, method, t_end=200.0).values
    larger = np.sqrt(4.0 - smaller**2)  # |u - v|^2 + |u + v|^2 = 4
    assert np.abs(smaller * larger / 2 - volume).max() < 1e-12  # measured: 2e-15


def test_the_finite_time_exponent_is_that_of_the_norm_of_the_map():
    matrix = np.array([[0.1, 3.0, 0.0], [-0.2, -0.4, 0.5], [0.3, 0.0, 0.2]])
    system = VectorField(lambda y: [sum(a * x for a, x in zip(row, y, strict=True)) for row in matrix], dim=3)
    problem = Problem(system, y0=[0.0, 0.0, 0.0], t_end=1e4)
    for end in (2.0, 1000.0, 10000.0):  # the last map's norm is beyond the range of doubles
        found = finite_time_exponent(problem, Gauss(s=6, h=0.25), t_end=end)
        half = scipy.linalg.expm(matrix * min(end, 1000.0))
        exact = np.log(np.linalg.norm(half, 2)) / min(end, 1000.0)
        if end > 1000.0:
            rate = np.linalg.eigvals(matrix).real.max()
            exact = rate + (exact - rate) * 1000.0 / end
        assert abs(found.value - exact) < 1e-10, end  # measured: 2e-12


STARTS = [[0.0, q, 0.35, 0.1] for q in (-0.2, 0.0, 0.1, 0.3, 0.5)]
METHOD = Gauss(s=4, h=0.25)


def test_a_map_has_the_indicators_of_its_starts():
    for threads in (1, 2):
        found = indicator_map(CHAOTIC, "gali", METHOD, starts=STARTS, t_end=100.0, k=3, threads=threads)
        alone = [
            gali(Problem(CHAOTIC.system, y0=y0, t_end=100.0), METHOD, k=3, t_end=100.0).value for y0 in STARTS
        ]
        assert found.values.tolist() == alone
        assert set(found.status) == {Status.FINISHED}


def test_a_map_that_was_broken_off_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr("integrators.dynamics.together.PIECE", 1)

    def stop(progress):
        if progress.t >= 3:
            raise KeyboardInterrupt

    asked = {"starts": STARTS, "t_end": 100.0, "samples": 64}
    whole = indicator_map(CHAOTIC, "megno", METHOD, **asked)
    file = tmp_path / "file"
    broken = indicator_map(CHAOTIC, "megno", METHOD, **asked, checkpoint=file, progress=stop)
    assert np.isnan(broken.values).tolist() == [False] * 3 + [True] * 2
    assert broken.status[3:] == [Status.INTERRUPTED] * 2
    seen = []
    resumed = indicator_map(
        CHAOTIC, "megno", METHOD, **asked, resume=file, progress=lambda p: seen.append(p.t)
    )
    assert seen == [4.0, 5.0]
    assert np.array_equal(resumed.values, whole.values)
    with pytest.raises(InputError, match="checkpoint"):
        indicator_map(CHAOTIC, "sali", METHOD, **asked, resume=file)


def test_a_trajectory_that_fails_leaves_the_others():
    system = VectorField(lambda y, par: [par.a * y[0] ** 2, y[1]], dim=2, parameters={"a": 1.0})
    problem = Problem(system, y0=[1.0, 1.0], t_end=2.0)
    found = indicator_map(problem, "finite_time_exponent", Gauss(s=4, h=0.01), parameters={"a": [0.1, 1.0]})
    assert found.status[0] is Status.FINISHED
    assert found.status[1].failed
    assert found.reason[1]
    assert np.isnan(found.values).tolist() == [False, True]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: gali(CHAOTIC, METHOD, k=5), "5 tangent vectors"),
        (lambda: megno(CHAOTIC, METHOD, t_end=-1.0), "after t0"),
        (lambda: megno(CHAOTIC, METHOD, t_end=0.1), "no room"),
        (lambda: indicator_map(CHAOTIC, "megnoo", METHOD, starts=STARTS), "megnoo"),
        (lambda: indicator_map(CHAOTIC, "sali", METHOD, starts=STARTS, k=2), "k=2"),
        (lambda: indicator_map(CHAOTIC, "sali", METHOD), "indicator_map needs starts"),
    ],
)
def test_what_cannot_be_is_said(call, words):
    with pytest.raises(InputError, match=words):
        call()
