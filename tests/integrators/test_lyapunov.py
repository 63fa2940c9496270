"""Exponents of systems where they are known, and what must hold of all."""

import math
import re

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Status
from integrators.dynamics import lyapunov, lyapunov_map
from integrators.kernel.tangent.frames import Frames
from problems import InputError, Problem, VectorField


def lorenz(y, par):
    return [par.s * (y[1] - y[0]), y[0] * (par.r - y[2]) - y[1], y[0] * y[1] - par.b * y[2]]


def test_lorenz():
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    problem = Problem(system, y0=[1.0, 1.0, 20.0], t_end=1000.0)
    found = lyapunov(problem, Gauss(s=6, h=0.02), skip=20.0)
    # 0.90563: the known value for these parameters
    assert found.intervals[0, 0] < 0.90563 < found.intervals[0, 1]
    assert found.intervals[0, 1] - found.intervals[0, 0] < 0.05
    assert found.intervals[1, 0] < 0.0 < found.intervals[1, 1]
    assert abs(found.sum + 41.0 / 3.0) < 1e-10


def rossler(y):
    return [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - 5.7)]


def sprott_a(y):
    """The oscillator of Nose and Hoover; its divergence is y[2]."""
    return [y[1], y[1] * y[2] - y[0], 1.0 - y[1] ** 2]


def forced(t, y, par, m):
    """A divergence that depends on the time and a parameter too."""
    return [
        y[1],
        -m.sin(y[0]) - par.c * y[1] ** 3 + m.cos(1.3 * t),
        -y[2] * (1.0 + m.sin(t) ** 2 * y[0] ** 2),
    ]


VARYING = {
    "rossler": (VectorField(rossler, dim=3), [-9.0, 0.0, 0.0]),
    "sprott_a": (VectorField(sprott_a, dim=3), [0.0, 5.0, 0.0]),
    "forced": (VectorField(forced, dim=3, parameters={"c": 0.05}), [0.1, 0.2, 1.0]),
}


@pytest.mark.parametrize("name", VARYING)
@pytest.mark.parametrize("method", [HBVM(), Gauss(s=6, h=0.02), Gauss(s=5, tol=1e-11)], ids=repr)
def test_the_sum_is_the_mean_divergence_where_that_varies(name, method):
    system, y0 = VARYING[name]
    found = lyapunov(Problem(system, y0=y0, t_end=150.0), method, skip=20.0)
    assert found.divergence is not None
    # measured: at most 1.4e-14; 2.7e-8 for Gauss(s=5, tol=1e-11) on Roessler's, whose vectors shrink by
    # exp(1.8) in one step of its
    assert abs(found.sum - found.divergence) < (
        1e-7 if name == "rossler" and method.options().get("tol") else 1e-12
    )


def test_the_sum_differs_from_the_mean_divergence_by_the_local_errors():
    system, y0 = VARYING["rossler"]
    errors = []
    for h in (0.1, 0.05):
        found = lyapunov(Problem(system, y0=y0, t_end=60.0), Gauss(s=2, h=h))
        errors.append(abs(found.sum - found.divergence))
    assert 3.5 < math.log2(errors[0] / errors[1]) < 4.5  # measured: 4.08, from 1.1e-2 and 6.2e-4


def test_the_divergence_is_exact_where_it_is_constant():
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    problem = Problem(system, y0=[1.0, 1.0, 20.0], t_end=50.0)
    assert lyapunov(problem, Gauss(s=6, h=0.02)).divergence == -10.0 - 1.0 - 8.0 / 3.0
    assert lyapunov(problem, Gauss(s=6, h=0.02), count=2).divergence == -10.0 - 1.0 - 8.0 / 3.0
    assert lyapunov(problems.load("henon_heiles"), Gauss(s=6, h=0.25), t_end=50.0).divergence == 0.0
    ring = VectorField(lambda y: [y[1], y[2], y[0]], dim=3)
    assert lyapunov(Problem(ring, y0=[0.0] * 3, t_end=50.0), Gauss(s=4, h=0.1)).divergence == 0.0


def test_the_divergence_of_declared_sums():
    """A sum that stays a loop: the diagonal of its Jacobian stands in a list."""

    def cubic(y, m):
        return m.each(lambda i: -m.sum(lambda j: y[i] * y[j] ** 2, range(40)), range(40))

    system = VectorField(cubic, dim=40)
    problem = Problem(system, y0=np.linspace(0.1, 0.5, 40), t_end=2.0)
    found = lyapunov(problem, Gauss(s=6, h=0.01))
    assert abs(found.sum - found.divergence) < 1e-12 * abs(found.sum)  # measured: 3e-16


def test_what_is_printed():
    system, y0 = VARYING["rossler"]
    text = str(lyapunov(Problem(system, y0=y0, t_end=150.0), Gauss(s=6, h=0.02), skip=20.0)).splitlines()
    assert "Lyapunov exponents in 1/time" in text[0]
    assert "95 %" in text[0]
    assert [" ± " in line for line in text] == [False, True, True, True, False]
    assert [("(log T)/T" in line) for line in text] == [False, True, True, False, False]
    assert re.fullmatch(
        r"sum -5\.\d+, mean divergence along the trajectory -5\.\d+: difference \de-1\d", text[4]
    )
    text = str(lyapunov(problems.load("henon_heiles"), Gauss(s=6, h=0.25), t_end=500.0, count=4))
    assert "pairs of opposite sign: to" in text
    text = str(lyapunov(problems.load("henon_heiles"), Gauss(s=6, h=0.25), t_end=500.0, count=1))
    assert "difference" not in text
    assert "pairs" not in text


@pytest.mark.parametrize("t_end", [1e2, 1e3, 1e4])
def test_on_regular_motion_intervals_are_a_bound_of_convergence(t_end):
    problem = problems.load("henon_heiles", energy=1 / 12, q2=0.05)
    found, bound = lyapunov(problem, Gauss(s=6, h=0.25), t_end=t_end), math.log(t_end) / t_end
    assert (found.intervals[:, 0] < 0.0).all()
    assert (found.intervals[:, 1] > 0.0).all()
    assert found.exponents[0] < 2.0 * bound  # measured: 0.37, 0.62 and 0.72 times the bound
    halves = np.diff(found.intervals)[:, 0] / 2.0
    assert (halves < 4.0 * bound).all()  # measured: 1.3 to 2.2 times
    assert (halves > bound).all()


def test_exponents_of_gauss_come_in_pairs_on_a_hamiltonian():
    found = lyapunov(problems.load("henon_heiles"), Gauss(s=8, h=0.5), t_end=1000.0)
    assert found.pairs is not None
    assert found.pairs < 1e-10
    assert abs(found.sum) < 1e-10


def test_a_linear_field_has_its_eigenvalues():
    system = VectorField(lambda y: [0.3 * y[0], -0.2 * y[1] + y[0]], dim=2)
    found = lyapunov(Problem(system, y0=[1e-3, 1.0], t_end=50.0), HBVM(k=6, s=6, h=0.1), count=1, skip=25.0)
    assert abs(found.exponents[0] - 0.3) < 1e-5  # the second has died out by exp(-0.5 * 25)


def test_strong_growth_takes_more_rounds():
    """The first component grows by exp(80,000) over the time."""
    system = VectorField(lambda y: [40.0 * y[0] + y[1], -30.0 * y[1] + y[2], y[2]], dim=3)
    problem = Problem(system, y0=[0.0, 0.0, 0.0], t_end=2000.0)
    found = lyapunov(problem, Gauss(s=6, h=0.025), skip=10.0)
    assert np.abs(found.exponents - [40.0, 1.0, -30.0]).max() < 1e-7  # measured: 1e-11
    assert found.rounds > 10000  # measured: 14,335


def test_a_stiff_ratio_of_rates():
    system = VectorField(lambda y: [-0.1 * y[0] + y[1], -1000.0 * y[1], 0.2 * y[2]], dim=3)
    problem = Problem(system, y0=[0.0, 0.0, 0.0], t_end=100.0)
    found = lyapunov(problem, Gauss(s=6, h=2e-3), skip=60.0)
    assert np.abs(found.exponents - [0.2, -0.1, -1000.0]).max() < 5e-6  # measured: 8e-7, Gauss's error


def test_rounds_that_were_too_long_are_repeated(monkeypatch):
    """Rates that come to 200 and -200 within some steps, and are small before and after."""

    def burst(t, y, m):
        rate = 0.1 + 400.0 / math.sqrt(math.pi) * m.exp(-((t - 250.3) ** 2) / 0.25)
        return [rate * y[0], -rate * y[1]]

    system = VectorField(burst, dim=2)
    problem = Problem(system, y0=[0.0, 0.0], t_end=500.0)
    repeated, back_to = [], Frames._back_to
    monkeypatch.setattr(Frames, "_back_to", lambda *given: repeated.append(1) or back_to(*given))
    found = lyapunov(problem, Gauss(s=6, h=0.005), skip=150.0)
    exact = 200.0 + 0.1 * found.time
    assert np.abs(found.exponents * found.time - [exact, -exact]).max() < 1e-8  # measured: 5e-11
    assert found.rounds > 2048  # measured: 2081
    assert repeated
    assert abs(found.divergence) < 1e-15


def test_few_steps_are_taken_again_where_rounds_are_often_repeated():
    system = VectorField(lambda y: [y[1], y[2], y[1] ** 2 - 2.017 * y[2] - y[0]], dim=3)
    problem = Problem(system, y0=[-0.9, 0.0, 0.5], t_end=16000.0)
    # measured 25,425, with 492 rounds repeated; 57,928 with checkpoints 64 rounds apart
    assert lyapunov(problem).steps < 32_000


def test_too_much_growth_in_one_step_is_refused():
    """The implicit midpoint rule multiplies by (1 + hz/2)/(1 - hz/2), here 2e11."""
    system = VectorField(lambda y: [4.0 * (1.0 - 1e-11) * y[0], y[1]], dim=2)
    with pytest.raises(InputError, match="take shorter steps"):
        lyapunov(Problem(system, y0=[0.0, 0.0], t_end=1e4), Gauss(s=1, h=0.5))


def test_a_skip_that_leaves_too_little_is_refused():
    problem = problems.load("henon_heiles")
    for skip in (99.5, 99.9999):
        with pytest.raises(InputError, match="skip="):
            lyapunov(problem, Gauss(s=6, h=0.25), t_end=100.0, skip=skip)


@pytest.mark.slow
def test_lorenz_over_a_long_time():
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    problem = Problem(system, y0=[1.0, 1.0, 20.0], t_end=1e5)
    found = lyapunov(problem, Gauss(s=6, h=0.02), skip=20.0)
    # measured: 0.90513 with the interval 0.90428 to 0.90597, -3e-6, -14.57179; sum + 41/3: 3e-12
    assert found.intervals[0, 0] < 0.90563 < found.intervals[0, 1]
    assert np.diff(found.intervals[0]) < 0.003
    assert abs(found.exponents[1]) < 1e-4
    assert abs(found.sum + 41.0 / 3.0) < 1e-10
    assert found.rounds > 1e5  # 155,572


@pytest.mark.slow
def test_intervals_cover_the_known_exponent_of_lorenz_as_often_as_they_say():
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    starts = np.random.default_rng(1).uniform((-10.0, -10.0, 15.0), (10.0, 10.0, 35.0), (100, 3))
    found = [
        lyapunov(Problem(system, y0=y0, t_end=220.0), Gauss(s=5, h=0.025), count=1, skip=20.0).intervals[0]
        for y0 in starts
    ]
    covered = sum(low < 0.90563 < high for low, high in found)
    assert 88 <= covered <= 99  # 95 with a standard deviation of 2.2; measured: 98
    halves, scatter = np.diff(found, axis=1) / 2, np.std(np.mean(found, axis=1), ddof=1)
    # 2.31/1.96 = 1.18 is the price of 8 degrees of freedom; measured: 1.36
    assert np.median(halves) < 1.45 * 1.96 * scatter


@pytest.mark.slow
def test_intervals_of_another_mixing_system_cover_the_mean_of_all():
    """Lorenz's model of the atmosphere with eight sites, forced so that it is chaotic."""

    def ring(y, par):
        return [(y[(i + 1) % 8] - y[i - 2]) * y[i - 1] - y[i] + par.F for i in range(8)]

    system = VectorField(ring, dim=8, parameters={"F": 10.0})
    starts = 10.0 + np.random.default_rng(2).standard_normal((100, 8))
    found = [
        lyapunov(Problem(system, y0=y0, t_end=130.0), Gauss(s=5, h=0.04), count=1, skip=20.0) for y0 in starts
    ]
    mean = np.mean([each.exponents[0] for each in found])  # a tenth as uncertain as one of them
    covered = sum(each.intervals[0, 0] < mean < each.intervals[0, 1] for each in found)
    assert 2.0 < mean < 2.3  # measured: 2.148
    assert 88 <= covered <= 100  # 95 with a standard deviation of 2.2; measured: 98


RING = VectorField(
    lambda y, par: [(y[(i + 1) % 5] - y[i - 2]) * y[i - 1] - y[i] + par.F for i in range(5)],
    dim=5,
    parameters={"F": 10.0},
)
SHORT = {"count": 2, "t_end": 60.0, "skip": 10.0}


def test_a_map_has_the_exponents_of_its_parameters():
    problem, forces = Problem(RING, y0=[1.0, 2.0, 3.0, 4.0, 5.0], t_end=60.0), [6.0, 8.0, 10.0]
    for threads in (1, 2):
        found = lyapunov_map(
            problem, Gauss(s=4, h=0.05), parameters={"F": forces}, skip=10.0, threads=threads
        )
        for i, force in enumerate(forces):
            alone = lyapunov(problem.replace(parameters={"F": force}), Gauss(s=4, h=0.05), skip=10.0)
            assert np.array_equal(found.exponents[i], alone.exponents)
            assert np.array_equal(found.intervals[i], alone.intervals)
            assert (found.sum[i], found.divergence[i]) == (alone.sum, -5.0)
        assert np.isnan(found.pairs).all()
        assert found.status == [Status.FINISHED] * 3
        assert found.exponents.shape == (3, 5)


def test_a_map_that_was_broken_off_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr("integrators.dynamics.together.PIECE", 1)

    def stop(progress):
        if progress.t >= 2:
            raise KeyboardInterrupt

    starts = np.random.default_rng(0).uniform(0.0, 5.0, (4, 5))
    problem, method, file = Problem(RING, y0=starts[0], t_end=60.0), Gauss(s=4, h=0.05), tmp_path / "file"
    whole = lyapunov_map(problem, method, starts=starts, **SHORT)
    broken = lyapunov_map(problem, method, starts=starts, **SHORT, checkpoint=file, progress=stop)
    assert np.isnan(broken.exponents[:, 0]).tolist() == [False, False, True, True]
    assert broken.status[2:] == [Status.INTERRUPTED] * 2
    seen = []
    resumed = lyapunov_map(
        problem, method, starts=starts, **SHORT, resume=file, progress=lambda p: seen.append(p.t)
    )
    assert seen == [3.0, 4.0]
    assert np.array_equal(resumed.exponents, whole.exponents)
    assert np.array_equal(resumed.intervals, whole.intervals)
    assert whole.intervals.shape == (4, 2, 2)
    assert (whole.divergence == -5.0).all()
    with pytest.raises(InputError, match="checkpoint"):
        lyapunov_map(problem, method, starts=starts, **{**SHORT, "count": 1}, resume=file)


def test_a_trajectory_that_fails_leaves_the_others_of_a_map():
    system = VectorField(lambda y, par: [par.a * y[0] ** 2 - y[0], -y[1]], dim=2, parameters={"a": 0.1})
    problem = Problem(system, y0=[1.0, 1.0], t_end=20.0)
    found = lyapunov_map(problem, Gauss(s=4, h=0.01), parameters={"a": [0.1, 2.0]})
    assert found.status[0] is Status.FINISHED
    assert found.status[1].failed
    assert found.reason[1]
    assert np.isnan(found.exponents).tolist() == [[False] * 2, [True] * 2]
    growing = VectorField(lambda y, par: [par.a * y[0], y[1]], dim=2, parameters={"a": 0.1})
    problem = Problem(growing, y0=[0.0, 0.0], t_end=1e3)
    steep = 4.0 * (1.0 - 1e-11)  # as for a single trajectory above
    found = lyapunov_map(problem, Gauss(s=1, h=0.5), parameters={"a": [0.1, steep]})
    # s = 1 makes 1.0217 of the exponent 1, which is no FINISHED
    assert found.status == [Status.INACCURATE, Status.NOT_FINITE]
    assert "take shorter steps" in found.reason[1]


def test_what_a_map_cannot_be_is_said():
    problem = problems.load("pendulum")
    with pytest.raises(InputError, match="count=3"):
        lyapunov_map(problem, Gauss(s=4, h=0.1), starts=[[1.0, 0.0]], count=3)
    with pytest.raises(InputError, match="lyapunov_map needs starts"):
        lyapunov_map(problem, Gauss(s=4, h=0.1))


def test_too_many_exponents_are_refused():
    with pytest.raises(InputError, match="count=5"):
        lyapunov(problems.load("pendulum"), Gauss(s=4, h=0.1), count=5)


def limit_cycle(rates, seed=None):
    """A limit cycle (exponents 0 and -2) that directions contract to; in other coordinates, with a seed.

    With rates r: z_i' = -r_i (z_i - sin(x + i)), so that the exponents are 0, -2 and -r_i.
    """
    dim = 2 + len(rates)
    turn = (
        np.eye(dim) if seed is None else np.linalg.qr(np.random.default_rng(seed).normal(size=(dim, dim)))[0]
    )

    def field(t, y, m):
        x = [sum(float(turn[i, j]) * y[j] for j in range(dim)) for i in range(dim)]
        pull = 1.0 - x[0] ** 2 - x[1] ** 2
        slopes = [x[0] * pull - x[1], x[1] * pull + x[0]]
        slopes += [-rate * (x[2 + i] - m.sin(x[0] + i)) for i, rate in enumerate(rates)]
        return [sum(float(turn[j, i]) * slopes[j] for j in range(dim)) for i in range(dim)]

    start = turn.T @ np.array([1.0, 0.0, *np.full(len(rates), 0.5)])
    return VectorField(field, dim=dim), start, np.sort([0.0, -2.0, *(-rate for rate in rates)])[::-1]


@pytest.mark.parametrize("rate", [5.0, 50.0, 1000.0])
@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=7, tol=1e-10)], ids=repr)
def test_a_stiff_contracting_direction_has_its_exponent(rate, method):
    system, start, exact = limit_cycle([rate])
    found = lyapunov(Problem(system, y0=start, t_end=40.0), method, skip=5.0)
    # measured: 0.005 at most, of the fluctuations along the cycle, and with steps as long as the trajectory
    # allows an exponent of -2.6 for -300
    assert np.abs(found.exponents - exact).max() < 0.05
    assert found.status is Status.FINISHED
    assert abs(found.sum - found.divergence) < 1e-6 * rate  # measured: 1e-8 of the rate
    assert not found.warnings


def test_steps_that_are_too_long_for_a_contracting_direction_have_a_status_and_a_warning():
    system, start, _ = limit_cycle([300.0])
    found = lyapunov(Problem(system, y0=start, t_end=40.0), Gauss(s=3, h=0.1))
    assert found.status is Status.INACCURATE
    assert found.status.failed
    (warning,) = found.warnings
    says = (
        r"the sum of the exponents, -[\d.]+, is not the mean divergence, -30[\d.]+, .* take shorter steps\."
    )
    assert re.fullmatch(says, warning)
    assert found.reason in str(found)


def searched(seed):
    """Check a random system of the kind; return how far its exponents are from the exact ones, in halves."""
    rng = np.random.default_rng(seed)
    rates = 10.0 ** rng.uniform(0.7, 3.0, int(rng.integers(1, 4)))
    system, start, exact = limit_cycle(rates.tolist(), seed)
    method = [HBVM(), HBVM(k=8, s=7, tol=1e-10), HBVM(s=4, tol=1e-8), Gauss(s=6, tol=1e-9)][seed % 4]
    span = 20.0 if seed % 4 < 2 else 5.0
    found = lyapunov(Problem(system, y0=start, t_end=span), method, skip=0.4 * span)
    told = found.status is Status.INACCURATE
    assert told or found.status is Status.FINISHED, (seed, found)
    halves = np.diff(found.intervals)[:, 0] / 2.0
    return told, float((np.abs(found.exponents - exact) / (halves + 1e-3 * np.abs(exact) + 0.3)).max())


@pytest.mark.parametrize("seed", range(4))
def test_random_systems_with_stiff_directions_have_their_exponents(seed):
    told, apart = searched(seed)
    assert told or apart < 1.0  # measured 0.11 at most


@pytest.mark.slow
def test_a_search_over_systems_with_stiff_directions_finds_no_wrong_exponent():
    wrong = [seed for seed in range(4, 60) if (found := searched(seed))[1] >= 1.0 and not found[0]]
    assert not wrong


def test_after_ctrl_c_there_are_the_averages_up_to_there(monkeypatch):
    calls, call = [], Frames._call

    def broken(frames):
        calls.append(1)
        if len(calls) == 40:
            raise KeyboardInterrupt
        return call(frames)

    monkeypatch.setattr(Frames, "_call", broken)
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    problem = Problem(system, y0=[1.0, 1.0, 20.0], t_end=5000.0)
    found = lyapunov(problem, Gauss(s=5, h=0.02))
    assert found.status is Status.INTERRUPTED
    assert 10.0 < found.time < 4000.0
    assert re.fullmatch(r"interrupted at t = \d+\.\d+\.", found.reason)
    assert found.intervals[0, 0] < 0.90563 < found.intervals[0, 1]
    calls[:] = [1] * 39
    with pytest.raises(KeyboardInterrupt):  # nothing to average yet
        lyapunov(problem, Gauss(s=5, h=0.02))


def test_fewer_exponents_have_a_mean_divergence_too():
    for system, y0 in (VARYING["rossler"], VARYING["forced"]):
        problem = Problem(system, y0=y0, t_end=150.0)
        some, every = (lyapunov(problem, Gauss(s=6, h=0.02), count=n, skip=20.0) for n in (1, 3))
        assert abs(some.divergence - every.divergence) < 2e-3  # measured 4e-5


def test_rounds_are_compiled(monkeypatch):
    """Python is there for a checkpoint every 64 rounds, and for Ctrl-C."""
    calls, call = [], Frames._call
    monkeypatch.setattr(Frames, "_call", lambda frames: calls.append(1) or call(frames))
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    found = lyapunov(Problem(system, y0=[1.0, 1.0, 20.0], t_end=200.0), Gauss(s=6, h=0.02))
    assert found.rounds > 2000
    assert len(calls) < found.rounds / 50  # measured 32 of 2048
