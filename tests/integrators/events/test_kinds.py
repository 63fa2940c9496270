"""Events with every kind of system and solver."""

import numpy as np

import problems
from integrators import HBVM, Event, Gauss, integrate, section
from integrators.protocol import Status


def test_events_of_a_poisson_system_keep_its_energy():
    problem = problems.load("lotka_volterra", t_end=30.0)
    made = section(problem, HBVM(k=10, s=4, h=0.05), lambda y: y[1] - 1.5, direction=0)
    assert len(made.t) == 21
    assert np.abs(made.y[:, 1] - 1.5).max() < 1e-13  # measured 8.4e-15
    assert made.errors()["energy"].max() < 1e-14  # measured 2.3e-16


def test_events_of_stiff_steps_that_newton_solves():
    problem = problems.load("stiff_chain", omega=1e3, t_end=20.0)
    made = section(problem, HBVM(k=8, s=4, h=0.05), lambda q: q[0], direction=0)
    assert made.status is Status.FINISHED
    assert made.stats.solver is not None
    assert "Newton" in made.stats.solver
    assert len(made.t) == 6
    assert np.abs(made.y[:, 0]).max() < 1e-13  # measured 9.5e-16
    assert made.errors()["energy"].max() < 1e-14  # measured 1.1e-15


def test_events_of_large_systems():
    problem = problems.load("sine_gordon", n=256, t_end=5.0)
    made = integrate(problem, Gauss(s=3, h=0.05), events=Event(lambda q: q[128], name="middle"))
    assert made.status is Status.FINISHED
    assert len(made.events["middle"]) == 1
    assert np.abs(made.events["middle"].y[:, 128]).max() < 1e-14  # measured 1.1e-15
