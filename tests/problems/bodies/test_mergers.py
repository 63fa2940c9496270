"""Bodies that touch, and what they merge to: against conserved quantities and against REBOUND."""

import numpy as np
import pytest

from integrators import HBVM, Event, Status, integrate, start
from problems import InputError, nbody
from problems.bodies import bodies_of, contacts, merge

MASSES = [1.0, 3e-4, 1e-4, 2e-4]
POSITIONS = [[0, 0, 0], [1, 0, 0], [1.05, 0, 0.001], [0, 1.8, 0]]
VELOCITIES = [[0, 0, 0], [0, 1, 0], [0, 0.93, 0], [-0.745, 0, 0.01]]
RADII = [0.005, 0.004, 0.003, 0.004]
END = 40.0


def events(radii, massless=0):
    return [Event(g, direction=-1, terminal=True) for g in contacts(radii, massless)]


def collided():
    """Return the run that stands at the first contact of four bodies."""
    run = start(nbody(MASSES, POSITIONS, VELOCITIES, t_end=END), HBVM(), events(RADII))
    run.until(END)
    assert run.status is Status.EVENT
    return run


def test_after_a_merger_bodies_move_as_in_rebound():
    rebound = pytest.importorskip("rebound")
    run = collided()
    before = bodies_of(run.problem, run.y, run.t)
    after = merge(*before, RADII)
    rest = nbody(after.masses, after.positions, after.velocities, t0=run.t, t_end=END)
    found = integrate(rest, HBVM(), [END], events=events(after.radii))
    assert found.status is Status.FINISHED
    simulation = rebound.Simulation()
    for m, x, v, r in zip(MASSES, POSITIONS, VELOCITIES, RADII, strict=True):
        simulation.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2], r=r)
    simulation.integrator = "ias15"
    simulation.integrate(run.t)
    simulation.collision, simulation.collision_resolve, simulation.dt = "direct", "merge", 1e-10
    for _ in range(100):  # it looks for overlaps at the ends of steps
        if simulation.N == 3:
            break
        simulation.steps(1)
    simulation.integrate(END)
    masses, x, v = bodies_of(rest, found.y[-1])
    assert after.kept.tolist() == [0, 1, 3]
    assert masses == pytest.approx([p.m for p in simulation.particles], rel=1e-15)  # measured 1.4e-16
    assert after.radii == pytest.approx([p.r for p in simulation.particles], rel=1e-15)  # measured 0
    assert np.abs(x - [p.xyz for p in simulation.particles]).max() < 1e-11  # measured 7e-14
    assert np.abs(v - [p.vxyz for p in simulation.particles]).max() < 1e-11  # measured 7e-14
    assert found.errors()["energy"].max() < 1e-14  # measured 2e-16


def test_mass_momentum_and_centre_of_mass_stay_and_energy_is_lost():
    run = collided()
    before = bodies_of(run.problem, run.y, run.t)
    after = merge(*before, RADII)
    for rows_before, rows_after in zip(before[1:], after[1:3], strict=True):
        total = before[0] @ rows_before
        assert np.abs(after.masses @ rows_after - total).max() < 1e-18  # measured 5e-20
    assert after.masses.sum() == pytest.approx(before[0].sum(), rel=1e-15)
    kinetic = [m @ (v**2).sum(axis=1) for m, v in ((before[0], before[2]), (after.masses, after.velocities))]
    assert kinetic[1] < kinetic[0]


def test_a_chain_of_bodies_merges_to_one_and_massless_ones_leave_no_trace():
    x = [[0, 0, 0], [1.5, 0, 0], [2.9, 0, 0], [0.5, 0.5, 0], [9, 0, 0], [9, 0, 0]]
    v = [[1, 0, 0], [0, 0, 0], [0, 3, 0], [5, 5, 5], [0, 0, 1], [0, 0, 2]]
    merged = merge([1.0, 1.0, 1.0], x, v, [1.0, 1.0, 1.0, 0.0, 0.1, 0.1])
    assert merged.masses.tolist() == [3.0]
    assert merged.kept.tolist() == [0, 4, 5]  # those without mass do not touch each other
    assert merged.velocities[0] == pytest.approx([1 / 3, 1.0, 0.0])
    assert merged.radii[0] == pytest.approx(3.0 ** (1 / 3))
    alone = nbody(merged.masses, merged.positions[:1], merged.velocities[:1], t_end=3.0)
    y = integrate(alone, HBVM(), [3.0]).y[0]
    assert y[:3] == pytest.approx(merged.positions[0] + 3.0 * merged.velocities[0], abs=1e-14)  # measured 0


def test_a_massless_body_falls_onto_one_with_mass():
    problem = nbody([1.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0.2, 0]], massless=1, t_end=9.0)
    run = start(problem, HBVM(), events([0.1, 0.0], massless=1))
    y = run.until(9.0)
    assert np.hypot(y[3], y[4]) == pytest.approx(0.1, abs=1e-14)  # measured 1e-17
    masses, x, v = bodies_of(problem, y, run.t)
    merged = merge(masses, x, v, [0.1, 0.0])
    assert (len(merged.positions), merged.velocities.tolist()) == (1, [[0.0, 0.0, 0.0]])


def test_pairs_that_never_touch_have_no_function():
    names = [g.__name__ for g in contacts([1.0, 0.0, 0.0, 2.0], massless=2)]
    assert names == ["contact_0_1", "contact_0_2", "contact_0_3", "contact_1_3"]


def test_what_is_no_radius_or_no_body_is_refused():
    with pytest.raises(InputError, match="not negative"):
        contacts([1.0, -1.0])
    with pytest.raises(InputError, match="massless=2 of contacts must be less than the number of radii, 2"):
        contacts([1.0, 1.0], massless=2)
    with pytest.raises(InputError, match="1 numbers for 4 bodies"):
        merge(MASSES, POSITIONS, VELOCITIES, [1.0])
    with pytest.raises(InputError, match="positions must be finite"):
        merge(MASSES, POSITIONS[:2], VELOCITIES, RADII)
    problem = nbody(MASSES, POSITIONS, VELOCITIES, t_end=END)
    for y in ([1.0], "y", [None] * 24, [np.nan] * 24):
        with pytest.raises(InputError, match="a state of bodies_4, 24 numbers, all finite"):
            bodies_of(problem, y)
