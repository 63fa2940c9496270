"""Threads share the steps of a large system, and no bit depends on their number."""

import numba
import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Leapfrog, LineIntegral, integrate
from integrators.running import integrate as module
from problems import InputError

SITES = 700  # three blocks of rows, the last one shorter
CHAIN = problems.load("fput", n=SITES, beta=0.5, start="thermal")
WAVE = problems.load("sine_gordon", n=SITES)
BODIES = problems.load("cluster", n=100)


def hops(n):
    """Return a chain with three ranges of springs: an output has summands of several loops."""

    def energy(q, p, m):
        kinetic = m.sum(lambda i: p[i] ** 2 / 2, range(n))
        near = m.sum(lambda i: 1.0 - m.cos(q[i + 1] - q[i]), range(n - 1))
        far = m.sum(lambda i: (q[i + 3] - q[i]) ** 4 / 4, range(n - 3))
        return kinetic + near + far + m.sum(lambda i: (q[i] - q[i + 100]) ** 2 / 9, range(n - 100))

    p0 = np.cos(np.arange(n) ** 2)
    return problems.Problem(problems.Hamiltonian(energy, dof=n), q0=np.zeros(n), p0=p0, t_end=1.0)


def rotors(n):
    """Return rotors in a row, driven; first-order form."""

    def f(t, y, m):
        inner = m.each(lambda i: m.sin(y[i - 1] - y[i]) + m.sin(y[i + 1] - y[i]) + m.cos(t), range(1, n - 1))
        return [y[1] - y[0], *inner, y[n - 2] - y[n - 1]]

    return problems.Problem(problems.VectorField(f, dim=n), y0=np.sin(np.arange(n) ** 2), t_end=1.0)


def numba_ring(n):
    """Return coupled rotors with a right-hand side that numba compiles; first-order form."""

    @numba.njit
    def f(t, y, dy):
        for i in range(n):
            dy[i] = 1.0 + np.sin(y[(i + 1) % n] - y[i]) + 0.1 * np.cos(t)

    y0 = np.linspace(0.0, 6.0, n)
    return problems.Problem(problems.Opaque(f, dim=n), y0=y0, t_end=1.0)


@pytest.fixture(autouse=True)
def cores(monkeypatch):
    """Let there be three cores, whatever the machine has."""
    monkeypatch.setattr(module.os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)


@pytest.mark.parametrize(
    ("problem", "method", "end"),
    [
        (CHAIN, HBVM(k=8, s=4, h=0.25), 2.0),
        (CHAIN, HBVM(k=12, s=6, h=0.25), 2.0),
        (CHAIN, HBVM(k=16, s=16, h=0.25), 2.0),
        (CHAIN, HBVM(k=40, s=4, h=0.25), 1.0),
        (CHAIN, HBVM(k=24, s=20, h=0.25), 1.0),
        (CHAIN, HBVM(), 2.0),
        (WAVE, HBVM(k=8, s=4, h=0.02), 0.1),
        (hops(600), HBVM(k=16, s=8, h=0.1), 0.5),
        (rotors(600), HBVM(), 0.5),
        (rotors(600), Gauss(s=8, h=0.1), 0.5),
        (BODIES, Gauss(s=12, h=1e-3), 0.01),
        (BODIES, HBVM(), 0.01),
        (numba_ring(20), Gauss(s=16, h=0.1), 0.5),
        (numba_ring(300), HBVM(), 0.5),
    ],
    ids=repr,
)
def test_the_number_of_threads_changes_no_bit(problem, method, end):
    times = np.linspace(problem.t0, problem.t0 + end, 4)[1:]
    one, *others = (integrate(problem, method, times, threads=threads) for threads in (1, 2, 3))
    assert one.status == "finished"
    for other in others:
        assert np.array_equal(one.y, other.y)
        assert (one.stats.steps, one.stats.iterations) == (other.stats.steps, other.stats.iterations)


def test_a_step_that_fails_fails_with_threads_too():
    method = HBVM(k=8, s=4, h=10.0, solver="fixed_point")
    one, two = (integrate(CHAIN, method, [100.0], threads=threads) for threads in (1, 2))
    assert one.status == two.status == "nonlinear_divergence"
    assert one.reason == two.reason


@pytest.mark.parametrize(
    ("problem", "method", "threads", "sentence"),
    [
        (CHAIN, HBVM(), 0, "whole number of at least 1"),
        (CHAIN, HBVM(), -2, "whole number of at least 1"),
        (CHAIN, HBVM(), 4, "threads=4 is more than the 3 cores"),
        (CHAIN, Leapfrog(h=0.1), 2, "in one thread; leave out threads="),
        (CHAIN, LineIntegral(k=4, s=2, h=0.1, invariants=["energy"]), 2, "a line integral are not"),
        (problems.load("kepler"), HBVM(), 2, "kepler are shared from 257 rows on, and it has 2"),
        (numba_ring(20), Gauss(s=8, h=0.1), 2, "eight stages of .* are evaluated in one thread"),
        (
            problems.Problem(problems.Opaque(lambda t, y: -y, dim=2), y0=[1.0, 2.0], t_end=1.0),
            HBVM(), 2, "is Python's, which one thread runs",
        ),
    ],
)  # fmt: skip
def test_threads_that_save_no_time_are_refused(problem, method, threads, sentence):
    with pytest.raises(InputError, match=sentence):
        integrate(problem, method, threads=threads)


def test_ctrl_c_ends_an_integration_that_threads_share():
    def interrupt(progress):
        if progress.steps:
            raise KeyboardInterrupt

    method, times = HBVM(k=8, s=4, h=0.25), np.linspace(0.0, 1e5, 100_001)
    solution = integrate(CHAIN, method, times, threads=2, progress=interrupt)
    assert solution.status == "interrupted"
    assert 0.0 < solution.t_stop < 1e5
    assert np.array_equal(solution.y[:1], integrate(CHAIN, method, solution.t[:1]).y)
