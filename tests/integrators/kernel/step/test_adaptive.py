"""Steps of varying length: energy at round-off whatever they are, errors that follow the tolerance."""

from itertools import pairwise

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Gauss, testing
from integrators.kernel import tables
from integrators.methods.automatic import QUADRATURE_ERRORS, choose
from integrators.protocol import Status
from problems import Problem, VectorField
from problems.errors import InputError

METHODS = [HBVM(), HBVM(tol=1e-8), HBVM(k=6, s=3, tol=1e-6), Gauss(s=4, tol=1e-8, h=0.01)]


@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
def test_conforms(check, method):
    reason = check(method, testing.two_bodies())
    rare = (
        testing.the_size_of_a_piece_is_a_count,
        testing.shared_steps_are_the_same,
        testing.pairs_hold_twice_the_digits,
        testing.batches_along_are_single_trajectories,
    )
    assert reason is None or check in rare


def kepler(revolutions, e=0.6):
    return problems.load("kepler", e=e, t_end=2 * np.pi * revolutions)


def position_error(problem, solution):
    exact = problems.catalogue.kepler.solution(problem, solution.t[-1:])[0]
    return np.abs(solution.y[-1] - exact).max()


def test_energy_stays_at_round_off_over_1000_revolutions_and_gauss_drifts_at_the_same_steps():
    problem = kepler(1000)
    loose = integrators.integrate(problem, HBVM(k=16, s=4, tol=1e-4), sample="steps")
    assert loose.status is Status.FINISHED
    assert loose.errors()["energy"].max() <= 1e-13  # measured 2.5e-14
    lengths = np.diff(loose.t)
    assert lengths.max() > 3 * lengths.min()
    # Landing on each of these times makes them the steps of Gauss too.
    times = loose.t[: np.searchsorted(loose.t, 50 * 2 * np.pi)]
    same = integrators.integrate(problem, Gauss(s=4, h=1e6), times, sample="stop")
    assert same.stats.extra["partial_steps"] == times.size - 1
    assert same.errors()["energy"].max() > 1e-6  # measured 6.1e-4


def test_adaptive_gauss_loses_energy_at_a_tolerance_at_which_hbvm_keeps_it():
    problem = kepler(100)
    gauss = integrators.integrate(problem, Gauss(s=4, tol=1e-6), sample="steps")
    hbvm = integrators.integrate(problem, HBVM(k=16, s=4, tol=1e-6), sample="steps")
    assert gauss.errors()["energy"].max() > 1e-8  # measured 1.7e-7
    assert hbvm.errors()["energy"].max() < 1e-13  # measured 5.4e-15


def test_the_error_follows_the_tolerance():
    problem = kepler(4)
    found = [
        position_error(problem, integrators.integrate(problem, HBVM(k=16, s=5, tol=tol), [problem.t_end]))
        for tol in (1e-4, 1e-6, 1e-8, 1e-10)
    ]
    assert found[0] < 0.1  # measured 5e-7 to 8e-5
    for loose, tight in pairwise(found):
        assert tight < loose
    assert found[-1] < 1e-8  # measured 2e-11 to 4e-11


def test_states_between_steps_have_the_energy_of_the_steps_and_the_polynomial_has_not():
    problem = kepler(10)
    times = np.linspace(0.0, problem.t_end, 777)
    side, dense = (
        integrators.integrate(problem, HBVM(k=20, s=4, tol=1e-6), times, sample=how).errors()["energy"].max()
        for how in ("partial", "dense")
    )
    assert side < 1e-14  # measured 1.2e-15
    assert dense > 1e-9  # measured 4.3e-4


def test_adaptive_steps_do_not_depend_on_the_times_asked_for():
    problem = kepler(5)
    program = HBVM().compile(problem.system)
    few, many = (program.start(problem.y0, problem.par, 0.0) for _ in range(2))
    few.advance([problem.t_end])
    many.advance(np.linspace(0.1, problem.t_end, 333))
    assert few.t == many.t
    assert np.array_equal(few.y, many.y)


def test_steps_add_up_to_the_times_they_are_at():
    problem = kepler(20)
    program = HBVM(tol=1e-10).compile(problem.system)
    stepper = program.start(problem.y0, problem.par, 0.0)
    steps = stepper.advance([0.0, problem.t_end], sample="steps")
    exact = problems.catalogue.kepler.solution(problem, steps.t)
    assert np.abs(steps.y - exact).max() < 1e-7  # measured 1.6e-10
    assert steps.t[-1] <= problem.t_end
    assert steps.t.size == stepper.stats.steps + 1


def test_backwards_returns_to_the_start():
    problem = kepler(3)
    stepper = HBVM().compile(problem.system).start(problem.y0, problem.par, 0.0)
    end = stepper.advance([problem.t_end], sample="stop").y[-1]
    back = stepper.advance([0.0], sample="stop").y[-1]
    assert np.abs(end - problem.y0).max() < 1e-12  # measured 2.2e-14
    assert np.abs(back - problem.y0).max() < 1e-12  # measured 2.5e-14


def test_pieces_equal_the_whole_with_every_sampling():
    problem = kepler(2)
    program = HBVM(tol=1e-9).compile(problem.system)
    times = np.linspace(0.3, problem.t_end, 40)
    for sample in ("partial", "stop", "dense"):
        whole = program.start(problem.y0, problem.par, 0.0).advance(times, sample=sample)
        stepper = program.start(problem.y0, problem.par, 0.0)
        parts = [stepper.advance(part, sample=sample).y for part in np.array_split(times, 7)]
        assert np.array_equal(np.concatenate(parts), whole.y)


def test_a_close_approach_needs_no_setting():
    problem = kepler(10, e=0.99)
    solution = integrators.integrate(problem, HBVM(), sample="steps")
    assert solution.status is Status.FINISHED
    assert solution.errors()["energy"].max() < 1e-12  # measured 8.3e-14
    assert (
        position_error(problem, solution) < 1e-7
    )  # measured 9.0e-9, at a pericentre, where the velocity is 14
    lengths = np.diff(solution.t)
    assert lengths.max() > 100 * lengths.min()


@pytest.mark.parametrize(
    ("name", "options", "energy"),
    [  # measured: error of the end, what the last bit of the start makes of it, error of the energy
        ("kepler", {"e": 0.999, "t_end": 200.0}, 1e-11),  # 1.4e-9, 1.3e-9, 9.7e-13
        ("cr3bp", {"loops": 4}, 1e-13),  # 2.1e-11, 2.6e-10, 3.7e-15
        ("cr3bp", {"loops": 3}, 1e-13),  # 8.9e-11, 2.1e-10, 1.2e-14
        ("pythagorean", {"t_end": 15.8}, 1e-9),  # 4.3e-9, 1.1e-8, 3.6e-13
        ("pythagorean", {"t_end": 70.0}, 1e-9),  # 0.63, 5.2, 2.9e-11
    ],
    ids=repr,
)
def test_close_encounters_cost_no_more_than_the_last_bit_of_the_start(name, options, energy):
    pytest.importorskip("heyoka")
    problem = problems.load(name, **options)
    ours = integrators.integrate(problem, HBVM(), [problem.t_end])
    assert ours.status is Status.FINISHED
    assert ours.errors()["energy"].max() < energy
    series = integrators.Taylor(tol=1e-18, high_accuracy=True).compile(problem.system)

    def end(y0):
        return series.start(y0, problem.par, problem.t0).advance([problem.t_end]).y[0]

    last, ways = end(problem.y0), np.random.default_rng(0)
    bits = [np.nextafter(problem.y0, problem.y0 + ways.choice([-1, 1], last.size)) for _ in range(6)]
    allowed = max(np.abs(end(y0) - last).max() for y0 in bits)
    assert np.abs(ours.y[0] - last).max() <= 2 * allowed  # the series too have errors of that size


def test_the_planetoid_stays_on_the_axis():
    problem = problems.load("sitnikov", t_end=300.0)
    solution = integrators.integrate(problem, HBVM(), np.linspace(0.0, 300.0, 601))
    assert solution.guards()["off_axis"].max() == 0.0
    assert solution.errors()["energy"].max() < 1e-13  # measured 2.9e-15


def test_fast_modes_at_rest_do_not_make_the_iteration_slow():
    problem = problems.load("fput", n=32, t_end=500.0)  # the lowest mode only
    stats = integrators.integrate(problem, HBVM(), [500.0]).stats
    assert stats.iterations / stats.steps < 40  # measured 19
    assert stats.rejections < stats.steps


def test_rounding_at_the_nodes_of_a_standing_wave_is_no_kink():
    problem = problems.load("nonlinear_wave", n=16, t_end=5.0)
    stats = integrators.integrate(problem, HBVM(), [5.0]).stats
    assert stats.steps < 50  # measured 17; 1429 where rounding there was taken for kinks
    assert "kinks" not in stats.extra


def test_a_collision_is_a_step_underflow_and_what_was_computed_is_kept():
    fall = problems.Hamiltonian(lambda q, p: p[0] ** 2 / 2 - 1 / q[0], dof=1, name="fall")
    problem = problems.Problem(fall, q0=[1.0], p0=[0.0], t_end=2.0)
    solution = integrators.integrate(problem, HBVM(), np.linspace(0.0, 2.0, 41))
    assert solution.status is Status.STEP_UNDERFLOW
    assert "may end or be singular" in solution.reason
    assert abs(solution.t_stop - np.pi / 8**0.5) < 1e-3  # measured 5e-15
    assert solution.t.size == 23  # 0, 0.05, .. 1.1
    assert np.isfinite(solution.y).all()


def test_a_field_that_is_not_finite_from_some_place_on_says_so():
    wall = problems.VectorField(lambda y, m: [1.0 + 0.0 * m.sqrt(1.0 - y[0])], dim=1, name="wall")
    problem = problems.Problem(wall, y0=[0.0], t_end=2.0)
    solution = integrators.integrate(problem, HBVM(tol=1e-8), np.linspace(0.0, 2.0, 21))
    assert solution.status is Status.NOT_FINITE
    assert "not finite" in solution.reason
    assert 0.9 < solution.t_stop <= 1.0


def test_k_and_s_are_the_cheapest_under_the_bound_of_the_quadrature():
    tight, loose = 3e-16, 1e-3
    # Few components: sixteen stages cost little more than eight, and steps are three times as long.
    assert (
        choose(kepler(1).system, tight) == choose(kepler(1).system, loose) == (16, 14, QUADRATURE_ERRORS[16])
    )
    # Many: the product takes four times as long.
    planets = problems.load("outer_solar_system").system
    assert choose(planets, tight) == (16, 14, QUADRATURE_ERRORS[16])
    assert choose(planets, 1e-6) == (8, 7, QUADRATURE_ERRORS[8])
    # Trajectories side by side: the product takes four times as long for all.
    assert choose(kepler(1).system, tight, lanes=True) == (8, 7, QUADRATURE_ERRORS[8])
    # A polynomial: longer steps gain more than twelve stages cost, if none of them is exact with fewer.
    assert choose(problems.load("fput").system, tight, lanes=True) == (12, 11, QUADRATURE_ERRORS[12])
    assert choose(problems.load("henon_heiles").system, loose, lanes=True) == (8, 5, None)
    # A cubic energy is kept exactly, and needs no bound.
    k, s, quadrature_error = choose(problems.load("henon_heiles").system, loose)
    assert (k, quadrature_error) == (8, None)
    assert 2 * k >= 3 * s
    assert choose(problems.VectorField(lambda y: [-y[0]], dim=1), 1e-8)[2] is None


@pytest.mark.parametrize("tol", [1e-3, 1e-9])
@pytest.mark.parametrize(
    ("name", "options"),
    # Largest errors of the energy, at 1e-3, 1e-9 and 3e-16:
    [
        ("outer_solar_system", {"t_end": 600.0}),  # 7.4e-16, 7.4e-16, 2.1e-15
        ("kepler", {"e": 0.6, "t_end": 300.0}),  # 1.6e-15, 2.7e-15, 3.1e-15
        ("sitnikov", {"e": 0.75, "t_end": 200.0}),  # 1.8e-15, 2.1e-15, 1.4e-15
        ("fput", {"t_end": 100.0}),  # 4.1e-17, 6.1e-17, 6.2e-17
        ("double_pendulum", {"q1": 0.5, "q2": 0.7, "t_end": 60.0}),  # 6.7e-17, 6.7e-17, 4.4e-17
        ("cr3bp", {}),  # 6.2e-15, 1.0e-14, 7.3e-15
    ],
)
def test_the_energy_is_at_rounding_at_any_tolerance(name, options, tol):
    problem = problems.load(name, **options)
    solution = integrators.integrate(problem, HBVM(tol=tol), sample="steps")
    assert solution.errors()["energy"].max() < 2e-14


def test_a_polynomial_energy_is_conserved_at_any_tolerance():
    problem = problems.load("henon_heiles", t_end=1000.0)
    for tol in (1e-3, 1e-6):
        solution = integrators.integrate(problem, HBVM(tol=tol), sample="steps")
        assert solution.errors()["energy"].max() < 2e-14  # measured 5.5e-15


def test_poisson_systems_take_a_tolerance():
    problem = problems.load("rigid_body")
    solution = integrators.integrate(problem, HBVM(tol=1e-10), sample="steps")
    assert solution.status is Status.FINISHED
    assert solution.errors()["energy"].max() < 1e-13  # measured 1.2e-15


def test_without_options_the_tolerance_is_that_of_round_off():
    assert HBVM() == HBVM(tol=3e-16)
    assert repr(HBVM()) == "HBVM()"
    assert HBVM().order is None
    assert HBVM(k=8, s=4, tol=1e-8).order == 8


def test_a_batch_takes_each_trajectory_through_steps_of_its_own():
    problem = kepler(2)
    program = HBVM(tol=1e-9).compile(problem.system)
    starts = np.array([problem.y0, 1.1 * problem.y0])
    batch = program.batch(starts, times=[3.0, 12.0], threads=2)
    for i, start in enumerate(starts):
        assert np.array_equal(batch.y[i], program.batch(starts[i : i + 1], times=[3.0, 12.0]).y[0])
        alone = program.start(start).advance([3.0, 12.0])  # which does not end steps at the times
        assert np.abs(batch.y[i] - alone.y).max() < 1e-9  # measured 1e-11
    assert batch.steps[0] != batch.steps[1]


def test_a_problem_alone_is_enough():
    problem = kepler(1)
    solution = integrators.integrate(problem)
    assert solution.method == HBVM()
    assert position_error(problem, solution) < 1e-13  # measured 8e-15


def test_what_cannot_be_done_is_refused_with_the_fix():
    for bad in (0.0, 1e-17, -1.0, 1.0, np.nan, "1e-8", True):
        with pytest.raises(InputError, match=r"tolerance from 2\.2e-16 to below 1"):
            HBVM(tol=bad)
    with pytest.raises(InputError, match="HBVM needs s with k=4; give s too"):
        HBVM(k=4, tol=1e-8)
    with pytest.raises(InputError, match="needs k and s with a fixed step"):
        HBVM(h=0.1)
    with pytest.raises(InputError, match="one stage tells nothing about its error"):
        HBVM(k=1, s=1, tol=1e-8)
    with pytest.raises(InputError, match="Gauss needs a step h, or a tolerance tol"):
        Gauss(s=2)
    with pytest.raises(InputError, match="Gauss needs k > 1"):
        Gauss(s=1, tol=1e-3)


def test_a_checkpoint_of_another_tolerance_is_refused():
    problem = testing.pendulum()
    checkpoint = HBVM(tol=1e-8).compile(problem.system).start(problem.y0).checkpoint()
    with pytest.raises(InputError, match="belongs to another method or system"):
        HBVM(tol=1e-9).compile(problem.system).start(problem.y0).restore(checkpoint)


def test_steps_that_have_collapsed_are_a_status_with_time_and_reason():
    def f(t, m):
        return [1.0 + 0.5 * m.sin(1e9 * t)]

    problem = Problem(VectorField(f, dim=1), y0=[0.0], t_end=1e6)
    for sample in ("partial", "steps"):
        found = integrators.integrate(problem, HBVM(tol=1e-10), [0.0, 1e6], sample=sample)
        assert found.status is Status.STALLED
        assert "the steps have collapsed" in found.reason
        assert 0.0 < found.stats.steps < 10**6


@pytest.mark.parametrize(("k", "s"), [(8, 6), (16, 14)])
def test_lengths_are_those_that_first_stages_have_tables_for(k, s):
    problem = problems.load("kepler", e=0.3)
    stepper = HBVM(k=k, s=s, tol=1e-13).compile(problem.system).start(problem.y0)
    stepper.take(5)  # the first ones grow as fast as they may
    taken = []
    for _ in range(60):
        stepper.take(1)
        taken.append((stepper._context.length, stepper.stats.rejections))
    ratios = np.array([after / before for (before, n), (after, m) in pairwise(taken) if n == m])
    ratios = ratios[ratios >= 0.5]  # beyond there is no table
    assert len(ratios) > 30  # measured 39 for k = 16
    gaps = np.abs(ratios[:, None] / tables.RATIOS - 1.0).min(axis=1)
    assert gaps.max() < 1e-15  # measured 2.2e-16


def test_the_tables_extrapolate_a_polynomial():
    c = tables.constants(16, 14, False, 16)
    nodes = c.arrays["nodes"].reshape(-1)
    made = tables.extrapolations(c).reshape(
        tables.RATIOS.size, 2, 16, 8
    )  # groups of eight stages, column by column
    for ratio, table in zip(tables.RATIOS, made, strict=True):
        stages = (table.transpose(0, 2, 1).reshape(16, 16)) @ nodes**3
        there = ((1.0 + ratio * nodes) ** 4 - 1.0) / (4.0 * ratio)
        # What rounding makes of high modes; measured 1.8e-8 at 1/2, 1.2e-5 at 1, 2.8e-2 of 10 at 2.
        assert np.abs(stages - there).max() < 1e-4 * ratio**11
