"""Faults with our methods inside other libraries, and with events."""

from typing import Any

import numpy as np
import pytest

from integrators import HBVM, Event, Gauss, Status, integrate
from problems import Problem, VectorField

from .fault import Fault, is_met, sentence


def installed(**options: Any) -> object:
    rebound = pytest.importorskip("rebound")
    from integrators.plugins.rebound import install

    method = HBVM(**options) if "k" in options or not options else Gauss(**options)
    return install(rebound.Simulation(), method)


def encounter(h: float) -> object:
    rebound = pytest.importorskip("rebound")
    from integrators.plugins.rebound import install

    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(m=1e-3, a=1.0, e=0.99, f=3.14159)
    install(simulation, HBVM(k=8, s=8, h=h))
    return simulation.integrate(20.0)


FAULTS = (
    Fault(
        "REBOUND, a pericentre that the steps do not resolve",
        lambda: encounter(0.01),
        r"A step of HBVM is too long.* smaller sim\.dt.* t = 3\.1\d+, dt = 0\.01\.",
        RuntimeError,
    ),
    Fault(
        "REBOUND, a pericentre that cannot be solved",
        lambda: encounter(0.1),
        r"did not converge; take a smaller sim\.dt\. This was at t = 3\.1",
        RuntimeError,
    ),
    Fault("install(HBVM())", installed, r"chooses k and s .* HBVM\(s=8\)"),
    Fault(
        "install(HBVM(max_step=))", lambda: installed(k=8, s=4, tol=1e-9, max_step=1.0), "max_step= .* leave"
    ),
    Fault(
        "install(HBVM(solver=))", lambda: installed(k=8, s=4, h=0.1, solver="newton"), "'newton' .* leave it"
    ),
)


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_gets_its_sentence(fault: Fault) -> None:
    is_met(fault)


def test_an_event_that_no_samples_can_follow_costs_no_trajectory() -> None:
    slow = Problem(VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[1.0, 0.0], t_end=20.0)
    events = [
        Event(lambda t, m: m.sin(1e7 * (m.tanh(50.0 * (t - 15.0)) + 1.0)), name="fast"),
        Event(lambda y, m: y[0], name="plain"),
    ]
    times = np.linspace(0.0, 20.0, 41)
    found = integrate(slow, HBVM(k=8, s=4, h=0.25), times=times, events=events)
    assert found.status is Status.STALLED
    sentence(
        found.reason,
        r"'fast' varies too fast .* between t = 1\d\.\d+ and 1\d.* Events are known up to",
    )
    assert np.array_equal(found.t, times)  # the event changes nothing of the trajectory
    known = np.pi * (np.arange(6) + 0.5)
    kept = found.events["plain"].t
    assert kept.size >= 2
    assert np.allclose(kept, known[: kept.size], atol=1e-9)


def test_an_event_that_no_samples_can_follow_ends_the_search_with_a_status() -> None:
    slow = Problem(VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[1.0, 0.0], t_end=4.0)
    method = HBVM(k=8, s=4, h=0.5)
    fast = Event(lambda t, m: m.sin(1e7 * t), name="fast")
    made = integrate(slow, method, [1.0, 4.0], events=fast)
    assert made.status is Status.STALLED
    sentence(made.reason, r"'fast' varies too fast .* between t = 0\.0 and 0\.00\d+, .* shorter steps")
    sentence(made.reason, r"known up to t = 0\.0 only")
    assert np.array_equal(made.y, integrate(slow, method, [1.0, 4.0]).y)
