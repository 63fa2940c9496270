"""What the paper says of Sitnikov's problem, one sentence per test."""

import dataclasses

import numpy as np
import pytest

import problems
from hbvm_bench.studies.paper.experiments import sitnikov
from hbvm_bench.studies.paper.experiments.axis_motion import Growth
from hbvm_bench.studies.paper.sitnikov_part import dynamics, largest_step, oscillates, trajectories
from integrators import integrate
from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM


@pytest.fixture(scope="module")
def runs():
    return sitnikov.orbits()


@pytest.fixture(scope="module")
def steps():
    return sitnikov.by_step(2, (1 / 16, 1 / 8, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6))


@pytest.mark.parametrize(
    ("reached", "off", "verdict"), [(1.01, 0.01, "holds"), (1.01, 0.5, "partly"), (1.5, 0.01, "no")]
)
def test_the_verdict_on_the_planetoids_motion_follows_from_its_numbers(reached, off, verdict):
    assert oscillates(reached * np.array([0.0, 1.0, -1.0]), np.array([0.0, 1.0, -1.0]), off) == verdict


def verdicts(runs, steps):
    """Return the verdicts by the first words of the claims, from made-up scans for what is not varied."""
    growth = [Growth(e, [(70, 6e-3), (1000, 5e-4)], 0.8, None) for e in (0.7, 0.75)]
    found = [*trajectories(runs, [100.0] * 20 + [None] * 12), *dynamics(steps, growth)]
    return {claim.words[:14]: claim.verdict for claim in found}


def said(runs, words):
    """Return what was measured beside the claim that begins so."""
    found = trajectories(runs, [100.0] * 20 + [None] * 12)
    return next(claim.here for claim in found if claim.words.startswith(words))


def test_the_sentences_follow_from_the_verdicts(runs):
    assert "because rounding preserves the symmetry" in said(runs, "Both methods")
    astray = {key: dataclasses.replace(run, off_axis=0.1, plane=0.0) for key, run in runs.items()}
    assert said(astray, "Both methods") == "off the axis: 0.1. The plane drifts along z by up to 0"
    assert "But z itself is off" in said(runs, "Under HBVM")
    alike = runs | {"hbvm": dataclasses.replace(runs["hbvm"], z=runs["truth"].z)}
    assert ". z itself is off by up to 0.00" in said(alike, "Under HBVM")


def test_verdicts_change_with_what_was_measured(runs, steps):
    before = verdicts(runs, steps)
    assert before["Both methods l"] == "partly"
    assert before["The large step"] == "holds"
    flat = {key: dataclasses.replace(run, plane=0.0) for key, run in runs.items()}
    assert verdicts(flat, steps)["Both methods l"] == "holds"
    astray = {key: dataclasses.replace(run, off_axis=0.1) for key, run in runs.items()}
    assert verdicts(astray, steps)["Both methods l"] == "no"
    wild = [dataclasses.replace(row, unsteady=99.0) for row in steps]
    assert verdicts(runs, wild)["The large step"] == "partly"


def test_gauss_loses_the_planetoid():
    times = sitnikov.neighbours()
    lost = [time for time in times if time is not None]
    assert len(lost) > len(times) / 2  # 29 of 32
    assert max(lost) < sitnikov.T_END


def test_hbvm_keeps_the_planetoid_bounded(runs):
    assert np.abs(runs["hbvm"].z).max() < 1.70  # 1.6923; the true motion 1.6869
    assert np.abs(runs["truth"].z).max() < 1.69


def test_hbvm_conserves_the_energy_to_round_off(runs):
    assert runs["hbvm"].energy.max() <= 1e-13  # 2.7e-14


def test_gauss_makes_an_error_in_the_energy(runs):
    assert runs["gauss"].energy.max() > 1e-2  # 0.23 to 0.6, decided by the last bit


def test_gauss_conserves_the_angular_momentum(runs):
    assert runs["gauss"].momentum.max() <= 1e-12  # 2.4e-15 to 9e-15


def test_hbvm_has_a_bounded_oscillating_error_in_the_angular_momentum(runs, steps):
    error = runs["hbvm"].momentum
    half = error.size // 2
    assert error.max() == pytest.approx(2.24e-3, rel=0.01)  # 2.243e-3; 3.388e-3 of the initial value
    assert error[half:].max() == pytest.approx(error[:half].max(), rel=0.01)  # 2.243e-3 in both
    period = next(row for row in steps if row.family == "hbvm" and row.h == 0.5).beat
    assert period == pytest.approx(391, abs=3)  # 391.2; the dips of the error are 390, 780, 1180
    index = runs["hbvm"].t.searchsorted([period - 50, period + 50, 1.5 * period - 50, 1.5 * period + 50])
    assert error[index[0] : index[1]].min() < 1e-5  # 4e-6: the dip
    assert error[index[2] : index[3]].max() > 2e-3  # 2.232e-3


def test_a_line_integral_method_keeps_both_laws(runs):
    run = runs["both"]
    assert run.energy.max() <= 5e-14  # 3.6e-15
    assert run.momentum.max() <= 5e-14  # 4.3e-16
    assert np.abs(run.z).max() < 1.70  # 1.6838


def test_hbvm_preserves_the_apocentre_distance_and_gauss_does_not(runs):
    low, high = runs["hbvm"].apocentres
    assert 4.99 < low < high < 5.001  # 4.9943, 5.0000
    low, high = runs["gauss"].apocentres
    assert high - low > 0.5  # 1.2 to 1.9


def test_the_planetoid_stays_on_the_axis_exactly(runs):
    assert {run.off_axis for run in runs.values()} == {0.0}


def test_the_primaries_leave_their_plane_only_with_the_barycentre(runs):
    assert runs["truth"].plane == pytest.approx(3.75e-3, rel=0.01)  # 3.751e-3 = m3 v3 t / M
    assert runs["hbvm"].plane == pytest.approx(runs["truth"].plane, rel=0.01)  # 3.742e-3


def test_the_sham_rotation_comes_with_the_order_and_not_with_the_energy(steps):
    rate = {(row.family, row.h): row.turn for row in steps}
    assert rate["hbvm", 0.5] == pytest.approx(3.0, rel=0.01)  # 2.997 degrees per revolution
    assert rate["hbvm", 1 / 8] == pytest.approx(rate["gauss", 1 / 8], rel=0.01)  # 0.01482, 0.01480
    slope = np.log2(rate["hbvm", 1 / 8] / rate["hbvm", 1 / 16])
    assert slope == pytest.approx(4.0, abs=0.05)  # 3.98


def test_hbvm_allows_larger_steps_than_gauss(steps):
    assert largest_step(steps, "hbvm") == 0.6
    assert largest_step(steps, "gauss") <= 0.25  # 0.2: the planetoid is lost at h = 0.25


def test_conservation_becomes_practical_as_k_grows():
    errors = {k: error for k, error, _ in sitnikov.energy_by_nodes(0.5, (2, 4, 8, 12, 16, 20))}
    assert errors[4] < 0.1 * errors[2]  # 0.2 to 0.4, 1.0e-3
    assert errors[8] < 1e-3 * errors[4]  # 1.1e-7
    assert errors[12] < 1e-2 * errors[8]  # 3.4e-10
    assert errors[16] < 1e-2 * errors[12]  # 3.3e-13
    assert errors[20] < 1e-13  # 8e-15


def test_conserving_the_energy_is_not_accuracy():
    problem = problems.load("sitnikov", e=sitnikov.E)
    paper, ours = (
        integrate(problem, method, times=[sitnikov.T_END]).y[0, 8]
        for method in (sitnikov.HBVM_18, sitnikov.TRUTH)
    )
    truth = -0.214290823774244  # 128-bit arithmetic
    assert abs(paper - truth) > 1.5  # 1.78
    assert abs(ours - truth) < 1e-8  # 5.8e-10


def test_turning_and_period_of_an_exact_ellipse_are_right():
    problem = problems.load("sitnikov", e=0.5, m3=1e-12, t_end=200.0)
    solution = integrate(problem, HBVM(k=16, s=8, h=0.1), times=[200.0], sample="steps")
    rate, unsteady = sitnikov.turning(solution)
    assert abs(rate) < 1e-9  # 3e-12 degrees per revolution
    assert unsteady < 1e-9
    period = 2 * np.pi * (5.0 / 1.5) ** 1.5 / np.sqrt(2.0)
    assert sitnikov.radial_period(solution) == pytest.approx(period, rel=1e-5)  # the parabolas leave 1e-7


def test_gauss_turns_the_ellipses_backwards_in_time_too():
    problem = problems.load("sitnikov", e=sitnikov.E, t_end=300.0)
    there = integrate(problem, Gauss(s=2, h=0.25), times=[300.0], sample="steps")
    assert sitnikov.turning(there)[0] == pytest.approx(0.222, rel=0.05)  # 0.2222 degrees per revolution
