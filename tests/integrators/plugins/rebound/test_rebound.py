"""HBVM and Gauss inside REBOUND: what they conserve there, and what of REBOUND goes on working."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rebound = pytest.importorskip("rebound")

import integrators  # noqa: E402
from integrators import HBVM, Gauss  # noqa: E402
from problems.errors import InputError  # noqa: E402

COSTS = Path(__file__).parents[4] / "docs" / "plugins" / "costs.py"
STEPS, H = 3000, 6.0


def install(simulation: Any, method: Any) -> Any:
    """Install a method; the import compiles for ten seconds once, which is not for collecting tests."""
    from integrators.plugins.rebound import install

    return install(simulation, method)


def planets() -> Any:
    simulation = rebound.Simulation()
    simulation.add("outer solar system")
    simulation.move_to_com()
    return simulation


def two_bodies(method: Any) -> Any:
    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(m=1e-3, a=1.0, e=0.3)
    simulation.move_to_com()
    install(simulation, method)
    return simulation


def state(simulation: Any) -> np.ndarray:
    return np.array([[*body.xyz, *body.vxyz] for body in simulation.particles])


@pytest.mark.parametrize("method", [Gauss(s=8, h=H), HBVM(k=10, s=8, h=H)])
def test_energy_and_angular_momentum_are_conserved_as_in_the_native_kernel(method: Any) -> None:
    simulation = planets()
    masses = np.array([body.m for body in simulation.particles])

    def flat() -> np.ndarray:
        y = state(simulation)
        return np.concatenate([y[:, :3].ravel(), (masses[:, None] * y[:, 3:]).ravel()])

    def momentum(y: np.ndarray) -> np.ndarray:
        q, p = y.reshape(2, -1, 3)
        return np.cross(q, p).sum(axis=0)

    problem = runpy.run_path(str(COSTS))["_planets"](masses, flat())
    install(simulation, method)
    simulation.steps(STEPS)
    plugin = flat()
    solution = integrators.integrate(problem, method, times=np.array([0.0, STEPS * H]))
    native, start = solution.y[-1], problem.y0
    energies = [problem.errors(y[None])["energy"][0] for y in (plugin, native)]
    momenta = [
        np.linalg.norm(momentum(y) - momentum(start)) / np.linalg.norm(momentum(start))
        for y in (plugin, native)
    ]
    assert max(energies) < 2e-14  # measured 1e-15 to 1e-14 over 1e5 time units, the native kernel's the same
    assert max(momenta) < 1e-14  # measured 1e-15 to 5e-15
    assert np.abs(plugin[:18] - native[:18]).max() < 1e-8  # measured up to 7e-10 over 1e5 time units


def test_the_order_is_2s() -> None:
    def error(h: float) -> float:
        simulation = two_bodies(Gauss(s=2, h=h))
        simulation.integrate(6.4, exact_finish_time=0)
        fine = two_bodies(Gauss(s=8, h=0.1))
        fine.integrate(simulation.t)
        return float(np.abs(state(simulation)[:, :3] - state(fine)[:, :3]).max())

    assert np.log2(error(0.1) / error(0.05)) == pytest.approx(4.0, abs=0.15)


def test_exact_finish_times_outputs_and_the_heartbeat_work() -> None:
    simulation = two_bodies(HBVM(k=8, s=8, h=0.1))
    seen: list[float] = []
    simulation.heartbeat = lambda pointer: seen.append(pointer.contents.t)
    reference = two_bodies(HBVM(k=8, s=8, h=0.05))
    for t in (0.33, 1.0, 2.71):
        simulation.integrate(t)
        reference.integrate(t)
        assert simulation.t == t
        assert np.abs(state(simulation) - state(reference)).max() < 1e-13  # measured 2e-15
    assert len(seen) >= 28
    simulation.integrate(0.0)  # and back
    assert np.abs(state(simulation) - state(two_bodies(HBVM(k=8, s=8, h=0.1)))).max() < 1e-13


def test_a_simulation_goes_on_bit_for_bit_from_an_archive_and_from_a_copy(tmp_path: Path) -> None:
    simulation = two_bodies(HBVM(k=9, s=6, h=0.1))
    simulation.steps(20)
    file = str(tmp_path / "archive.bin")
    simulation.save_to_file(file)
    others = [rebound.Simulationarchive(file)[0], simulation.copy()]
    simulation.steps(30)
    for other in others:
        assert str(other.integrator) == str(rebound.Simulationarchive(file)[0].integrator)
        assert (other.integrator.k, other.integrator.s, other.dt) == (9, 6, 0.1)
        other.steps(30)
        assert np.array_equal(state(simulation), state(other))


def test_additional_forces_that_depend_on_velocities_act() -> None:
    simulation = rebound.Simulation()
    simulation.add(m=0.0, x=1.0, vx=1.0)
    simulation.force_is_velocity_dependent = 1

    def drag(pointer: Any) -> None:
        body = pointer.contents.particles[0]
        body.ax -= 0.5 * body.vx

    simulation.additional_forces = drag
    install(simulation, HBVM(k=6, s=6, h=0.1))
    simulation.integrate(2.0)
    assert simulation.particles[0].vx == pytest.approx(np.exp(-1.0), rel=1e-14)  # measured 3e-16
    assert simulation.particles[0].x == pytest.approx(1.0 + 2.0 * (1.0 - np.exp(-1.0)), rel=1e-14)


def test_particles_may_be_added_and_removed_on_the_way() -> None:
    simulation = two_bodies(Gauss(s=6, h=0.05))
    simulation.steps(10)
    simulation.add(m=0.0, a=3.0)
    simulation.steps(10)
    simulation.remove(2)
    simulation.steps(10)
    other = two_bodies(Gauss(s=6, h=0.05))
    other.steps(30)
    assert np.abs(state(simulation) - state(other)).max() < 1e-13  # measured 1e-15: a massless guest


def eccentric(h: float) -> Any:
    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(m=1e-3, a=1.0, e=0.99, f=np.pi)
    simulation.move_to_com()
    install(simulation, HBVM(k=8, s=8, h=h))
    return simulation


@pytest.mark.parametrize("h", [0.01, 0.003])
def test_a_pericentre_that_the_steps_do_not_resolve_is_not_stepped_over(h: float) -> None:
    # The equations of the step are solved, and it makes a = 5.97 after three pericentres, or 1.13.
    simulation = eccentric(h)
    with pytest.raises(RuntimeError, match=r"A step of HBVM is too long.* t = 3\.1\d+"):
        simulation.integrate(20.0)
    orbit = simulation.particles[1].orbit(primary=simulation.particles[0])
    assert simulation.t < np.pi
    assert orbit.a == pytest.approx(1.0, abs=1e-7)  # measured 3e-11 and 7e-9: it stands before the encounter
    simulation.dt = 0.0005
    simulation.integrate(5.0)
    orbit = simulation.particles[1].orbit(primary=simulation.particles[0])
    assert orbit.a == pytest.approx(1.0, abs=1e-7)  # measured 2e-11 and 7e-9


@pytest.mark.parametrize("method", [HBVM(k=2, s=1), HBVM(k=4, s=1), HBVM(k=4, s=2)], ids=str)
@pytest.mark.parametrize("eccentricity", [0.0, 0.3])
@pytest.mark.parametrize("moves", [True, False], ids=["centre of mass", "the first at rest"])
def test_twenty_steps_an_orbit_are_not_too_long(method: HBVM, eccentricity: float, moves: bool) -> None:
    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(m=1e-3, a=1.0, e=eccentricity)
    if moves:
        simulation.move_to_com()
    install(simulation, method)
    simulation.dt = 2 * np.pi / 20
    before = simulation.energy()
    simulation.integrate(6 * np.pi, exact_finish_time=0)
    assert abs(simulation.energy() / before - 1) < 3e-3  # measured 7.1e-4


def test_the_largest_error_of_a_step_is_the_users() -> None:
    simulation = eccentric(0.01)
    simulation.integrator.largest_error = np.inf
    simulation.integrate(5.0)
    orbit = simulation.particles[1].orbit(primary=simulation.particles[0])
    assert abs(orbit.a - 1.0) > 1e-3  # measured 1.4e-2
    simulation = eccentric(0.001)
    simulation.integrator.largest_error = 1e-12
    with pytest.raises(RuntimeError, match="largest_error"):  # estimated 6e-10
        simulation.integrate(5.0)


@pytest.mark.parametrize(
    ("method", "energy"),
    [
        (HBVM(s=8, tol=1e-12), 4e-13),  # measured 8e-14: kinetic and potential energy are 200 times as large
        (HBVM(k=10, s=8, tol=1e-12), 6e-13),  # measured 1.3e-13
        (HBVM(k=8, s=4, h=0.01, tol=1e-10), 4e-13),  # measured 7.8e-14
        (Gauss(s=8, tol=1e-12), 1e-9),  # measured 1.2e-10: symplectic, and the steps change
    ],
    ids=str,
)
def test_adaptive_steps_pass_an_encounter(method: HBVM | Gauss, energy: float) -> None:
    simulation = eccentric(0.01)
    install(simulation, method)
    before = simulation.energy()
    copied = simulation.copy()
    for one in (simulation, copied):
        one.integrate(20.0)
        one.integrate(40.0)
    assert simulation.t == 40.0
    assert simulation.steps_done < 1000  # measured 272, 272, 595 and 275
    assert abs(simulation.energy() / before - 1) < energy
    assert copied == simulation
    simulation.dt *= -1
    simulation.integrate(0.0)
    assert abs(simulation.energy() / before - 1) < energy


def test_without_h_the_timestep_is_the_simulations() -> None:
    simulation = rebound.Simulation()
    simulation.dt = 0.02
    install(simulation, HBVM(k=10, s=6))
    assert (simulation.dt, simulation.integrator.k, simulation.integrator.s) == (0.02, 10, 6)


def test_without_k_there_are_as_many_nodes_as_keep_the_energy() -> None:
    simulation = planets()
    install(simulation, HBVM(s=8, tol=1e-12))
    assert (simulation.integrator.k, simulation.integrator.tol) == (16, 1e-12)
    before = simulation.energy()
    simulation.integrate(3e4)
    assert abs(simulation.energy() / before - 1) < 3e-14  # measured 6e-15; 1.6e-12 with k = 10


@pytest.mark.parametrize("method", [HBVM(s=8), HBVM(s=8, tol=1e-9)], ids=str)
@pytest.mark.parametrize("name", ["m", "y", "vz"])
def test_a_particle_that_is_not_a_number_is_named(method: HBVM, name: str) -> None:
    simulation = planets()
    install(simulation, method)
    setattr(simulation.particles[2], name, np.nan)
    with pytest.raises(RuntimeError, match=rf"Particle 2 has {name} = nan, .*remove\(2\)\. .* t = 0\.0"):
        simulation.steps(1)


def test_a_force_that_is_not_a_number_is_named_by_the_particle_that_it_acts_on() -> None:
    simulation = planets()
    install(simulation, HBVM(s=8, tol=1e-9))

    def force(pointer: Any) -> None:
        if pointer.contents.t > 100.0:
            pointer.contents.particles[3].ay = np.nan

    simulation.additional_forces = force
    with pytest.raises(RuntimeError, match=r"Particle 3 has ay = nan, .* t = 9\d\.|t = 100\.0"):
        simulation.integrate(1000.0)


def test_what_cannot_be_done_is_said() -> None:
    simulation = two_bodies(Gauss(s=4, h=0.1))
    with pytest.raises(InputError, match="install takes HBVM"):
        install(simulation, "ias15")
    simulation.integrator.s = 9
    with pytest.raises(RuntimeError, match="k >= s >= 1"):
        simulation.steps(1)
    simulation = two_bodies(Gauss(s=8, h=28.0))
    with pytest.raises(RuntimeError, match=r"did not converge; take a smaller sim\.dt"):
        simulation.steps(1)
    assert str(rebound.Simulation().integrator) != "hbvm"


def test_an_absolute_tolerance_is_refused() -> None:
    with pytest.raises(InputError, match="atol= is not available in REBOUND"):
        install(rebound.Simulation(), HBVM(k=8, s=8, tol=1e-12, atol=1e-10))
