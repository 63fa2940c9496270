import copy
import re

import numpy as np
import pytest

import integrators.testing as testing
import problems
from hbvm_bench.reference import solutions
from integrators import Event, Status, integrate, integrate_many
from integrators.peers.heyoka.taylor import COLD, EPS, Taylor
from problems import Hamiltonian, Problem, VectorField
from problems.errors import InputError


def test_the_default_tolerance_is_the_library_s_own_and_is_not_printed():
    heyoka = pytest.importorskip("heyoka")
    x, v = heyoka.make_vars("x", "v")
    assert heyoka.taylor_adaptive([(x, v), (v, -x)], [1.0, 0.0]).tol == EPS == Taylor().tol
    assert repr(Taylor()) == "Taylor()"


def test_the_options_reach_the_library():
    program = Taylor(tol=1e-9, high_accuracy=True, compact_mode=True, fast_math=True).compile(
        testing.pendulum().system
    )
    ta = program.template
    assert (ta.tol, ta.high_accuracy, ta.compact_mode) == (1e-9, True, True)
    assert all(state.fast_math for state in np.atleast_1d(ta.llvm_state))
    plain = Taylor().compile(testing.pendulum().system).template
    assert (plain.high_accuracy, plain.compact_mode) == (False, False)
    assert not any(state.fast_math for state in np.atleast_1d(plain.llvm_state))


def test_samples_leave_the_steps_alone_bit_for_bit():
    problem = testing.two_bodies()
    program = Taylor().compile(problem.system)
    alone, sampled = (program.start(problem.y0, problem.par) for _ in range(2))
    few = alone.advance([300.0])
    many = sampled.advance(np.sort(np.append(np.linspace(0.01, 299.0, 700), 300.0)))
    assert np.array_equal(few.y[-1], many.y[-1])
    assert alone.stats.steps == sampled.stats.steps > 500
    steps = program.start(problem.y0, problem.par).advance([300.0], sample="steps")
    assert alone.stats.steps - 1 <= steps.t.size <= alone.stats.steps


class Counting:
    """heyoka's integrator, with a count of all steps that it is made to take."""

    def __init__(self, integrator):
        vars(self).update(integrator=integrator, taken=0)

    def __getattr__(self, name):
        return getattr(self.integrator, name)

    def __setattr__(self, name, value):
        setattr(self.integrator, name, value)

    def step(self, **options):
        vars(self)["taken"] += 1
        return self.integrator.step(**options)

    def propagate_until(self, *arguments, **options):
        made = self.integrator.propagate_until(*arguments, **options)
        vars(self)["taken"] += made[3]
        return made


@pytest.mark.parametrize("times", [1, 100, 20_000])
@pytest.mark.parametrize("sample", ["partial", "stop"])
def test_every_step_that_heyoka_takes_is_counted(sample, times):
    problem = problems.load("kepler", e=0.6)
    program = Taylor().compile(problem.system)
    stepper = program.start(problem.y0, problem.par)
    stepper._ta = Counting(stepper._ta)
    stepper.advance(np.linspace(0.0, problem.t_end, times + 1)[1:], sample=sample)
    steps, aside = stepper.stats.steps, stepper.stats.extra["side_steps"]
    assert stepper._ta.taken == steps + aside
    assert aside <= times if sample == "partial" else aside == 0
    if times == 1:  # what heyoka takes alone
        alone = copy.copy(program.template)
        alone.state[:], alone.pars[:] = problem.y0, problem.par
        assert steps == alone.propagate_until(problem.t_end)[3]


def test_a_sample_is_what_a_partial_step_gives():
    problem = testing.pendulum()
    stepper = Taylor().compile(problem.system).start(problem.y0, problem.par)
    ta = stepper.checkpoint().inner[0]
    sample = stepper.advance([0.05]).y[0]
    ta.step(max_delta_t=0.05)
    assert ta.time == 0.05
    assert np.max(np.abs(sample - ta.state)) <= 2.3e-16  # 0


def test_stops_and_partial_steps_agree_and_stops_take_more_steps():
    problem = testing.two_bodies()
    grid = np.linspace(0.0, 15.0, 301)
    side, land = (integrate(problem, Taylor(), grid, sample=how) for how in ("partial", "stop"))
    assert np.max(np.abs(side.y - land.y)) < 1e-12  # 4e-14
    assert land.stats.steps > side.stats.steps


def test_time_runs_backwards_from_ahead_of_the_last_sample():
    problem = testing.two_bodies()
    stepper = Taylor().compile(problem.system).start(problem.y0, problem.par)
    stepper.advance([7.3])
    back = stepper.advance([5.0, 0.0])
    assert back.status is Status.FINISHED
    assert np.max(np.abs(back.y[-1] - problem.y0)) < 1e-12  # 2e-14


def test_time_dependent_fields_start_at_their_time():
    problem = Problem(VectorField(lambda t, y, m: [m.cos(t)], dim=1), y0=[np.sin(2.0)], t0=2.0, t_end=9.0)
    solution = integrate(problem, Taylor(), [3.0, 9.0])
    assert np.max(np.abs(solution.y[:, 0] - np.sin([3.0, 9.0]))) < 1e-14  # 4e-16


def test_a_pole_is_reported_where_it_is():
    solution = integrate(testing.blow_up(), Taylor(), np.linspace(0.0, 2.0, 41))
    assert solution.status is Status.NOT_FINITE
    assert solution.t_stop == pytest.approx(1.0, abs=1e-10)
    assert solution.t.size == 20


def test_a_cold_compilation_uses_no_cache(monkeypatch):
    system = testing.pendulum().system
    Taylor().compile(system)
    assert Taylor().compile(system).from_cache is True
    monkeypatch.setenv(COLD, "1")
    cold = Taylor().compile(system)
    assert cold.from_cache is False
    assert cold.compile_seconds > 0.005  # 0.06; from memory 0.003
    monkeypatch.setenv(COLD, "0")
    assert Taylor().compile(system).from_cache is True


def test_a_start_that_takes_over_an_integrator_is_a_start_anew():
    problem = problems.load("kepler", e=0.6, t_end=30.0)
    program, times = Taylor().compile(problem.system), np.array([7.0, 7.3, 30.0])
    fresh = program.start(problem.y0, problem.par)
    expected = fresh.advance(times)
    other = program.start(problem.y0 * 1.1, problem.par, 2.0)
    other.advance(np.array([-40.0]))
    integrator = other._ta
    del other
    again = program.start(problem.y0, problem.par)
    assert again._ta is integrator
    samples = again.advance(times)
    assert np.array_equal(samples.y, expected.y)
    assert again.stats == fresh.stats


def test_a_step_stops_at_one_time_as_at_several():
    problem = problems.load("kepler", e=0.6, t_end=30.0)
    program = Taylor().compile(problem.system)
    one, same = (program.start(problem.y0, problem.par) for _ in range(2))
    end = np.array([30.0])
    landed, listed = one.advance(end, sample="stop"), same.advance([30.0], sample="stop")
    assert np.array_equal(landed.y, listed.y)
    assert (one.t, one.status, landed.status) == (30.0, same.status, Status.FINISHED)
    assert np.array_equal(one.y, landed.y[0])
    landed.y[:], end[:] = 0.0, 1.0  # what was returned and what was given are not the stepper's
    assert np.array_equal(one.y, same.y)
    assert landed.t.tolist() == [30.0]
    with pytest.raises(InputError, match="finite"):
        one.advance(np.array([np.inf]), sample="stop")
    assert one.advance(np.array([30.0]), sample="stop").t.tolist() == [30.0]


def test_a_start_at_rest_that_heyoka_cannot_leave_is_a_status():
    # What is wrong here is loud: HBVM() comes to 1.986171412 (tests/integrators/kernel/step/test_rest.py).
    system = VectorField(lambda t, y, m: [-y[0] + m.tanh(4 * (t - 5)) + 1], dim=1)
    solution = integrate(Problem(system, y0=[0.0], t_end=10.0), Taylor(), [10.0])
    assert solution.status is Status.NOT_FINITE
    assert "from t = 0.0" in solution.reason


def test_parameters_that_the_formulas_do_not_contain():
    def energy(q, p, par):
        return par.b * p[0] ** 2 / 2 + q[0] ** 2 / 2

    def half(q, par):
        return q[0] - par.c[1] / 14

    system = Hamiltonian(energy, dof=1, parameters={"a": 3.0, "b": 1.0, "c": [5.0, 7.0]})
    problem = Problem(system, q0=[1.0], p0=[0.0], t_end=2.0)
    found = integrate(problem, Taylor(), [1.0, 2.0], events=Event(half))
    assert np.abs(found.y[:, 0] - np.cos([1.0, 2.0])).max() < 1e-15  # measured 1e-16
    assert abs(found.events["half"].t[0] - np.pi / 3) < 1e-14  # measured 2e-16
    many = integrate_many(problem, Taylor(), starts=[[1.0, 0.0]] * 5, times=[1.0, 2.0])
    assert np.abs(many.y[:, :, 0] - np.cos([1.0, 2.0])).max() < 1e-15  # measured 1e-16
    q = solutions.taylor(problem, np.array([0.0, 2.0]), "1e-28")[1][0]
    assert abs(float(q) - np.cos(2.0)) < 1e-16  # measured 0


def test_a_motion_too_fast_for_the_unit_of_time_is_told_so():
    """An electron about a proton in SI units: 4e16 radians a second, to the power 20."""

    def atom(q, p, m):
        return (p[0] ** 2 + p[1] ** 2) / 1.8218767403e-30 - 2.3070775523e-28 / m.sqrt(q[0] ** 2 + q[1] ** 2)

    system = Hamiltonian(atom, dof=2)
    problem = Problem(system, q0=[5.29177e-11, 0.0], p0=[0.0, 1.79e-24], t_end=1e-14)
    solution = integrate(problem, Taylor())
    assert solution.status is Status.NOT_FINITE
    assert re.search(
        r"order (19|20) of 20 leave the range of doubles.* unit of time.* shorter one\.", solution.reason
    )


def test_its_own_model_of_bodies_moves_them_as_the_formula_does() -> None:
    problem = problems.load("outer_solar_system", t_end=100.0)
    formula, own = (
        integrate(problem, Taylor(compact_mode=True, nbody=nbody), times=[0.0, 50.0, 100.0])
        for nbody in (False, True)
    )
    assert np.abs(own.y - formula.y).max() < 1e-12  # 3e-13
    assert not np.array_equal(own.y, formula.y)
    assert own.errors()["energy"].max() < 1e-14  # 7e-16


def test_its_own_model_has_the_masses_of_the_problem_and_finds_events() -> None:
    light = problems.load("outer_solar_system", t_end=20.0)
    heavy = light.replace(parameters={"m": [2.0, *light.system.parameters["m"][1:]]})
    program = Taylor(compact_mode=True, nbody=True).compile(light.system)
    ends = [
        program.start(p.y0, p.par).advance([20.0]).y[-1]  # the second has other masses compiled in
        for p in (light, heavy, light)
    ]
    assert np.abs(ends[1] - integrate(heavy, Taylor(compact_mode=True)).y[-1]).max() < 1e-12
    assert np.array_equal(ends[0], ends[2])
    crossing = Event(lambda q: q[4], name="node")
    found = [
        integrate(heavy, Taylor(compact_mode=True, nbody=nbody), events=crossing).events["node"].t
        for nbody in (False, True)
    ]
    assert found[0].size > 0
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)


def test_its_own_model_is_for_bodies_alone() -> None:
    with pytest.raises(InputError, match=r"nbody=True is for bodies in space.*leave it out"):
        integrate(problems.load("kepler", t_end=1.0), Taylor(nbody=True))
    problem = problems.load("outer_solar_system", t_end=1.0)
    program = Taylor(compact_mode=True, nbody=True).compile(problem.system)
    heavier = problem.par * np.array([[1.0], [1.01]])
    with pytest.raises(InputError, match=r"nbody=True needs the same parameters in all trajectories"):
        program.batch([problem.y0, problem.y0], heavier, times=[1.0])


def test_many_clusters_of_its_own_model_are_those_of_one_after_the_other() -> None:
    problem = problems.load("outer_solar_system", t_end=100.0)
    program = Taylor(compact_mode=True, nbody=True).compile(problem.system)
    starts = np.outer([1.0, 1.0001, 0.9999], problem.y0)
    made = program.batch(starts, np.tile(problem.par, (3, 1)), times=[50.0, 100.0])
    alone = [program.start(y0, problem.par).advance(np.array([50.0, 100.0])).y for y0 in starts]
    assert made.status == [Status.FINISHED] * 3
    assert np.abs(made.y - alone).max() < 1e-10  # measured 2e-13, of distances up to 41
