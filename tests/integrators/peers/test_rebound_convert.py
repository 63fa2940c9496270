"""From a simulation of REBOUND to a problem, and back."""

from typing import Any

import numpy as np
import pytest

import problems
from integrators import HBVM, Event, from_rebound, integrate, to_rebound
from problems import InputError

rebound = pytest.importorskip("rebound")


def _planets(*, massless: int = 2):
    simulation = rebound.Simulation()
    simulation.units = ("au", "yr", "Msun")
    simulation.add(m=1.0, name="Sun")
    simulation.add(m=9.5e-4, a=5.2, e=0.05, inc=0.02, name="Jupiter")
    simulation.add(m=2.9e-4, a=9.5, e=0.06, f=1.0, name="Saturn")
    for i in range(massless):
        simulation.add(a=2.5 + 0.3 * i, e=0.1, inc=0.1, f=i)
    simulation.N_active = 3
    simulation.t = 7.0
    return simulation


@pytest.mark.parametrize("massless", [0, 2])
def test_it_moves_as_rebound_moves_it(massless):
    simulation = _planets(massless=massless)
    problem = from_rebound(simulation, t_end=30.0)
    assert problem.t0 == 7.0
    end = to_rebound(problem, integrate(problem, HBVM(), [30.0]).y[-1], t=30.0, simulation=simulation.copy())
    simulation.integrator = "ias15"
    simulation.integrate(30.0)
    assert end.t == simulation.t
    assert end.particles["Jupiter"].x == end.particles[1].x
    assert end.units == simulation.units
    for i in range(simulation.N):
        assert end.particles[i].xyz == pytest.approx(simulation.particles[i].xyz, abs=1e-11)  # measured 4e-13
        assert end.particles[i].vxyz == pytest.approx(simulation.particles[i].vxyz, abs=1e-11)


@pytest.mark.parametrize("massless", [0, 2])
def test_there_and_back_again(massless):
    simulation = _planets(massless=massless)
    again = to_rebound(from_rebound(simulation, t_end=30.0))
    assert (again.G, again.t, again.N, again.N_active) == (simulation.G, 7.0, 3 + massless, 3)
    for one, other in zip(again.particles, simulation.particles, strict=True):
        assert one.m == other.m
        assert one.xyz == other.xyz
        assert one.vxyz == pytest.approx(other.vxyz, rel=4e-16)  # v = p/m


def test_a_solution_whose_masses_an_event_has_changed():
    problem = from_rebound(_planets(massless=0), t_end=20.0)
    lighter = Event(
        lambda t: t - 9.0, then=lambda y, par: ([*y], {"m": [0.5 * m for m in par.m]}), name="lighter"
    )
    found: Any = integrate(problem, HBVM(), [20.0], events=lighter)
    masses: Any = problem.system.unpack(problem.par)["m"]
    end = to_rebound(found)
    assert len(found.events["lighter"]) == 1
    assert [p.m for p in end.particles] == [0.5 * m for m in masses]
    assert end.particles[1].vxyz == pytest.approx(found.v[-1, 3:6], rel=4e-16)  # v = p/m


def test_names_are_taken_over_where_all_bodies_have_one():
    assert from_rebound(_planets(massless=0), t_end=10.0).bodies == ("Sun", "Jupiter", "Saturn")
    assert from_rebound(_planets(), t_end=10.0).bodies == ()


def test_forces_of_rebound_that_are_given_again_are_taken():
    simulation = _planets(massless=0)
    simulation.additional_forces = lambda s: None
    flat = problems.bodies.J2(J2=1e-3, R=0.5)
    assert from_rebound(simulation, t_end=10.0, forces=[flat]).system.dof == 9


def test_forces_that_are_added():
    simulation = _planets(massless=0)
    flat = problems.bodies.J2(J2=1e-3, R=0.5)
    found = from_rebound(simulation, t_end=10.0, forces=[flat])
    assert found.system.bodies is None
    assert "angular_momentum" not in found.system.invariants


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: setattr(s, "gravity", "tree"), "its gravity is 'tree'"),
        (lambda s: setattr(s, "collision", "direct"), "it looks for collisions"),
        (lambda s: setattr(s, "boundary", "open"), "it has a boundary .'open'."),
        (lambda s: setattr(s, "N_ghost_y", 1), "it has ghost boxes .N_ghost_y=1."),
        (lambda s: setattr(s, "OMEGA", 1.0), "its frame rotates .OMEGA=1.0., as SEI's does"),
        (lambda s: setattr(s, "testparticle_type", 1), "its test particles pull"),
        (lambda s: setattr(s.particles[1], "m", 0.0), "must be the last ones"),
        (lambda s: setattr(s, "additional_forces", lambda s: None), "additional_forces.* again as forces="),
        (lambda s: setattr(s, "heartbeat", lambda s: None), "heartbeat"),
        (lambda s: setattr(s, "pre_timestep_modifications", lambda s: None), "pre_timestep_modifications"),
        (lambda s: setattr(s, "post_timestep_modifications", lambda s: None), "post_timestep_modifications"),
        (lambda s: setattr(s, "exit_max_distance", 100.0), "exit_max_distance=100.0.*use an event"),
        (lambda s: setattr(s, "exit_min_distance", 0.01), "exit_min_distance=0.01.*use an event"),
        (lambda s: s.create_ode(length=1), "create_ode"),
    ],
)
def test_what_cannot_be_taken_over(change, words):
    simulation = _planets()
    change(simulation)
    with pytest.raises(InputError, match=words):
        from_rebound(simulation, t_end=30.0)


def test_what_is_no_simulation_and_what_has_no_bodies():
    with pytest.raises(InputError, match=r"no rebound\.Simulation"):
        from_rebound(3, t_end=1.0)
    with pytest.raises(InputError, match="has no bodies in space"):
        to_rebound(problems.load("kepler"))
    with pytest.raises(InputError, match="has 5 bodies"):
        to_rebound(problems.load("outer_solar_system"), np.zeros(36), simulation=_planets())
