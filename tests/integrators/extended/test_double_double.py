"""Gauss in double-double arithmetic: order, invariants and digits far below the rounding of doubles."""

import mpmath
import numpy as np
import pytest

import problems
from hbvm_bench.reference import solutions
from integrators import (
    HBVM,
    Gauss,
    Status,
    gradient,
    integrate,
    integrate_many,
    load,
    lyapunov,
    section,
    start,
    testing,
)
from problems import InputError, Opaque, Problem, VectorField
from problems.catalogue import kepler

DIGITS = 50
KEPLER = problems.load("kepler")


def method(s=12, h=1 / 16):
    return Gauss(s=s, h=h, precision="double-double")


def miss(problem, solution, i=-1):
    """Return the largest error of a state of Kepler's problem."""
    with mpmath.workdps(DIGITS):
        exact = kepler.exact_state(problem, mpmath.mpf(float(solution.t[i])))
        return max(abs(a - b) for a, b in zip(solution.to_mpmath()[i], exact, strict=True))


@pytest.mark.parametrize(("s", "steps"), [(4, [24, 32, 48]), (8, [48, 64, 80])])
def test_the_order_is_2s_far_below_double_rounding(s, steps):
    problem = problems.load("kepler", e=0.5)
    errors = [float(miss(problem, integrate(problem, method(s, 2.0 / n), [4.0]))) for n in steps]
    slopes = np.diff(np.log(errors)) / -np.diff(np.log(steps))
    assert np.abs(slopes - 2 * s).max() < 0.2  # measured: 7.94, 7.97; 15.95, 15.95
    assert errors[-1] < (1e-11 if s == 4 else 1e-28)  # measured: 1.9e-12, 3.0e-29
    finest = integrate(problem, method(s, 2.0 / 128), [4.0])
    assert s == 4 or miss(problem, finest) < 1e-29  # measured: 3e-31


def test_times_are_the_doubles_that_are_given():
    problem = problems.load("kepler", e=0.6)
    # .3 is not the end of the third step of .1, which is 3e-17 later; 1/3 is within a step
    found = integrate(problem, method(16, 0.1), [0.3, 1.0 / 3.0, 7.0])
    assert max(miss(problem, found, i) for i in range(3)) < 1e-29  # measured: 8.8e-31
    back = integrate(problem, method(16, 0.1), [-0.3, -7.0])
    assert max(miss(problem, back, i) for i in range(2)) < 1e-29
    stopped = integrate(problem, method(16, 0.1), [0.3, 1.0 / 3.0, 7.0], sample="stop")
    assert max(miss(problem, stopped, i) for i in range(3)) < 1e-29  # measured: 2.3e-30


def test_quadratic_invariants_stay_to_32_digits_and_the_energy_with_short_steps():
    problem = problems.load("kepler", e=0.5)
    coarse = integrate(problem, method(2, 0.05), [50.0]).errors()
    assert coarse["angular_momentum"][0] < 1e-30  # measured: 9.3e-32
    assert coarse["energy"][0] > 1e-9  # measured: 2.1e-7
    fine = integrate(problem, method(14, 1 / 16), [50.0, 100.0]).errors()
    assert max(error.max() for error in fine.values()) < 5e-30  # measured: 3.3e-31


@pytest.mark.parametrize("name", ["pendulum", "henon_heiles"])
def test_the_taylor_method_in_128_bits_agrees(name):
    pytest.importorskip("heyoka")
    problem = problems.load(name)
    found = integrate(problem, method(16, 1 / 8), [3.7, 10.0])
    other = solutions.taylor(problem, np.array([0.0, 3.7, 10.0]), solutions.TOLERANCE)
    with mpmath.workdps(DIGITS):
        gaps = [
            abs(a - mpmath.mpf(str(b)))
            for row, kept in zip(found.to_mpmath(), other[1:], strict=True)
            for a, b in zip(row, kept, strict=True)
        ]
    assert max(gaps) < 1e-29  # measured: 1.2e-30


def test_numbers_of_mpmath_go_in_and_come_out_with_all_digits():
    with mpmath.workdps(40):
        begin = [mpmath.mpf(2) / 5, mpmath.mpf(1) / 7, -mpmath.mpf(1) / 3, mpmath.sqrt(2)]
    problem = Problem(problems.load("kepler").system, y0=begin, t_end=4.0)
    whole = integrate(problem, method(), [0.0, 2.0, 4.0], start=begin)
    with mpmath.workdps(DIGITS):
        assert max(abs(a - b) for a, b in zip(whole.to_mpmath()[0], begin, strict=True)) < 1e-32
    rounded = integrate(problem, method(), [0.0, 2.0, 4.0])
    assert not rounded.pairs[0, :, 1].any()
    assert 1e-19 < np.abs((whole.pairs - rounded.pairs)[-1]).max() < 1e-13
    # begun anew in the middle, in either form: the same bits
    middle = Problem(problem.system, y0=whole.y[1], t0=2.0, t_end=4.0)
    for given in (whole.to_mpmath()[1], whole.pairs[1]):
        rest = integrate(middle, method(), [4.0], start=given)
        assert np.array_equal(rest.pairs[0], whole.pairs[2])


def test_a_run_has_the_digits_of_integrate():
    with mpmath.workdps(DIGITS):
        begin = [mpmath.mpf(2) / 5, 0, 0, mpmath.mpf(2) + mpmath.mpf(10) ** -20]
    problem = Problem(KEPLER.system, y0=begin, t_end=4.0)
    times = [0.0, 1.0, 2.3, 4.0]
    run, solution = start(problem, method(), start=begin), integrate(problem, method(), times, start=begin)
    assert run.to_mpmath().tolist() == solution.to_mpmath()[0].tolist()
    for t, expected in zip(times[1:], solution.pairs[1:], strict=True):
        run.step()
        run.until(t)
        assert np.array_equal(run.pairs, expected)
        assert np.array_equal(run.pairs[:, 0], run.y)
    again = start(problem, method(), start=begin)
    again.pairs = run.to_mpmath()
    assert np.array_equal(again.pairs, run.pairs)
    assert again.t == 0.0
    kept = run.pairs
    run.par = run.par  # begins anew with the same digits
    assert np.array_equal(run.pairs, kept)
    run.y = run.y
    assert not run.pairs[:, 1].any()


def test_a_choice_is_one_of_its_parts_in_all_digits():
    def chosen(y, m):
        return [y[1], -m.where(y[0] > -2.0, m.sin(y[0]), y[0] ** 3)]

    fields = (chosen, lambda y, m: [y[1], -m.sin(y[0])])
    runs = [
        integrate(Problem(VectorField(f, dim=2), y0=[1.0, 0.3], t_end=4.0), method(), [1.0, 4.0])
        for f in fields
    ]
    assert (runs[0].to_mpmath() == runs[1].to_mpmath()).all()


def test_the_digits_of_a_run_are_those_at_the_double_that_is_its_time():
    """Three steps of the double next to 0.1 end 2.8e-17 before the double that is its time."""
    run = start(KEPLER, method(h=0.1))
    for _ in range(3):
        run.step()
    exact = integrate(KEPLER, method(h=0.1), [run.t])
    assert np.abs(run.to_mpmath() - exact.to_mpmath()[0]).max() < 1e-30  # measured: 0
    run.par = run.par
    after = integrate(KEPLER, method(h=0.1), [1.0])
    run.until(1.0)
    assert np.abs(run.to_mpmath() - after.to_mpmath()[0]).max() < 1e-30  # measured: 3e-32


def test_a_run_with_doubles_has_no_more_digits():
    run = start(KEPLER, Gauss(s=4, h=0.1))
    for call in (
        lambda: run.pairs,
        run.to_mpmath,
        lambda: setattr(run, "pairs", run.y),
        lambda: start(KEPLER, Gauss(s=4, h=0.1), start=run.y),
    ):
        with pytest.raises(InputError, match="double-double"):
            call()


def test_a_solution_keeps_its_digits(tmp_path):
    problem = problems.load("kepler", e=0.6)
    solution = integrate(problem, method(16), [1.0, 6.0])
    assert np.array_equal(solution.pairs_at(6.0), solution.pairs[1])
    with mpmath.workdps(DIGITS):
        exact = kepler.exact_state(problem, mpmath.mpf(2.7))
        gaps = [mpmath.mpf(a) + b - x for (a, b), x in zip(solution.pairs_at(2.7), exact, strict=True)]
    assert max(map(abs, gaps)) < 1e-29
    solution.save(tmp_path / "kept.npz")
    kept = load(tmp_path / "kept.npz")
    assert np.array_equal(kept.pairs, solution.pairs)
    assert np.array_equal(kept.errors()["energy"], solution.errors()["energy"])
    assert kept.method == solution.method
    with np.load(tmp_path / "kept.npz") as file:
        np.savez(tmp_path / "half.npz", **{name: file[name] for name in file.files if name != "start"})
    with pytest.raises(InputError, match="is damaged"):
        load(tmp_path / "half.npz")
    with pytest.raises(InputError, match="has doubles only; integrate with Gauss"):
        integrate(problem, HBVM(), [1.0]).to_mpmath()


def test_a_run_that_was_broken_off_goes_on_with_all_digits(tmp_path):
    problem = problems.load("kepler", e=0.6)
    path, times = tmp_path / "kept", np.linspace(0.0, 20.0, 41)
    whole = integrate(problem, method(), times)

    def stop(progress):
        if progress.t > 7.0:
            raise KeyboardInterrupt

    part = integrate(problem, method(), times, progress=stop, checkpoint=path, every_seconds=0.0)
    assert part.status is Status.INTERRUPTED
    rest = integrate(problem, method(), times, checkpoint=path, resume=path)
    assert np.array_equal(rest.pairs, whole.pairs)
    begin = np.stack([problem.y0, 1e-20 * problem.y0], axis=1)
    with pytest.raises(InputError, match="with other start"):
        integrate(problem, method(), times, start=begin, resume=path)


@pytest.mark.parametrize(
    ("field", "y0", "status"),
    [
        (lambda y: [y[0] ** 2], [1.0], {Status.NOT_FINITE, Status.NONLINEAR_DIVERGENCE}),
        (lambda y: [-1.0 / y[0]], [0.0], {Status.NOT_FINITE}),
        (lambda y, m: [m.sqrt(y[0]) - 4.0], [1.0], {Status.NOT_FINITE, Status.NONLINEAR_DIVERGENCE}),
    ],
    ids=["a pole", "a division by zero", "a root below zero"],
)
def test_a_failure_is_a_status_that_keeps_what_was_reached(field, y0, status):
    solution = integrate(
        Problem(VectorField(field, dim=1), y0=y0, t_end=2.0), method(4, 0.125), [0.0, 0.1, 2.0]
    )
    assert solution.status in status
    assert "take a step below 0.125" in solution.reason
    assert solution.t_stop < 1.5
    assert np.isfinite(solution.pairs).all()
    assert len(solution.pairs) == len(solution.t)


def test_too_long_a_step_is_a_status():
    solution = integrate(KEPLER, method(8, 16.0), [32.0])
    assert solution.status is Status.NONLINEAR_DIVERGENCE
    assert "take a step below 16.0" in solution.reason


@pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
def test_conforms(check):
    reason = check(method(4, 0.05), testing.pendulum())
    assert reason is None or check in (
        testing.keeps_the_error_of_a_user_s_function,  # it takes no functions
        testing.a_destination_leaves_the_samples_alone,
        testing.comes_back_when_it_is_stopped,
        testing.finds_events_beside_its_steps,
        testing.events_may_change_the_state,
        testing.batches_are_single_trajectories,
        testing.batches_find_the_events_of_single_trajectories,
        testing.prepared_batches_are_batches,
        testing.threads_change_no_bits,
        testing.the_size_of_a_piece_is_a_count,
        testing.shared_steps_are_the_same,
        testing.tangents_follow_and_change_nothing,
        testing.batches_along_are_single_trajectories,
        testing.adjoints_are_what_tangents_say,
        testing.is_the_hbvm_that_it_names,
        testing.failure_is_a_status,
    )


def ours(**options):
    return Gauss(s=4, precision="double-double", **options)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ours(tol=1e-9), "with s and h alone; leave out tol"),
        (lambda: ours(h=0.1, solver="newton"), "leave out solver"),
        (lambda: Gauss(s=4, h=0.1, precision="quad"), "unknown precision of Gauss 'quad'"),
        (lambda: ours(h=0.1).as_hbvm(), "leave precision= out"),
        (lambda: integrate(KEPLER, ours(h=0.1), events=lambda q: q[0]), "has no events; leave out"),
        (lambda: integrate(KEPLER, ours(h=0.1), variations="y0"), "has no variations; leave out"),
        (lambda: integrate_many(KEPLER, ours(h=0.1), starts=[KEPLER.y0]), "one trajectory at a time"),
        (lambda: gradient(KEPLER, ours(h=0.1), lambda q: q[0]), "no adjoint"),
        (lambda: lyapunov(KEPLER, ours(h=0.1)), "has no variations"),
        (lambda: section(KEPLER, ours(h=0.1), lambda q: q[0]), "has no events"),
        (lambda: start(KEPLER, ours(h=0.1), events=lambda q: q[0]), "has no events"),
        (lambda: integrate(KEPLER, HBVM(), start=KEPLER.y0), "calculates with doubles; leave out start="),
        (lambda: integrate(KEPLER, ours(h=0.1), start=KEPLER.y0 * 2), r"start\[0\] rounds to"),
        (lambda: integrate(KEPLER, ours(h=0.1), start=["a"] * 4), "4 finite numbers"),
        (lambda: integrate(KEPLER, ours(h=0.1), start=[1.0]), "4 finite numbers"),
        (lambda: integrate(KEPLER, ours(h=0.1), start=np.full((4, 2), np.nan)), "4 finite numbers"),
        (
            lambda: integrate(Problem(Opaque(lambda t, y: -y, dim=1), y0=[1.0], t_end=1.0), ours(h=0.1)),
            "its field is code; leave out precision=",
        ),
        (
            lambda: integrate(
                Problem(VectorField(lambda y, m: [m.erf(y[0])], dim=1), y0=[1.0], t_end=1.0), ours(h=0.1)
            ),
            "its formula has m.erf",
        ),
    ],
)
def test_what_cannot_be_is_said(call, words):
    with pytest.raises(InputError, match=words):
        call()
