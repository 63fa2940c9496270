"""Table 1 and what the paper says of the period annulus, one sentence per test."""

import numpy as np
import pytest

from hbvm_bench.studies.paper.experiments import period_annulus as experiment
from hbvm_bench.studies.paper.experiments.period_annulus import DEGREES, PRINTED, STEPS
from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM
from problems.catalogue.period_annulus import C_STAR, H_STAR, P1, P2


@pytest.fixture(scope="module")
def cells():
    return {(h, s): experiment.cell(s, h) for h in STEPS for s in DEGREES}


def test_the_gauss_errors_of_table_1_agree_with_the_printed_ones(cells):
    ratios = {key: found["gauss"].error / PRINTED[key][1] for key, found in cells.items()}
    # 1.00 0.64 0.80 0.99, 0.99 1.07 0.95 1.07: within a factor 2. Which of many boundaries a single bisection
    # finds depends on the last bit of everything: from other ends the ratios range from 0.06 to 1.9.
    assert all(0.1 <= ratio <= 3.0 for ratio in ratios.values()), ratios


@pytest.mark.slow
def test_the_typical_gauss_error_agrees_within_a_factor_3_in_all_eight_cells():
    ratios = {
        (h, s): np.median(experiment.spread(s, h, ends=experiment.ENDS[:9])) / error
        for (h, s), (_, error, _, _) in PRINTED.items()
    }
    # 1.00 0.56 0.63 0.99, 0.75 0.90 1.00 0.92; of five ends instead of nine .37 is met: they scatter so much
    assert all(1.0 / 3.0 <= ratio <= 3.0 for ratio in ratios.values()), ratios


def test_the_hbvm_points_of_table_1_are_exact_over_the_paper_s_span(cells):
    errors = {key: found["hbvm"].error for key, found in cells.items()}
    assert max(errors.values()) <= 1e-14, errors  # 5.5e-15


def test_the_hbvm_points_of_table_1_are_exact_over_a_short_span(cells):
    errors = {key: found["hbvm_short"].error for key, found in cells.items()}
    assert max(errors.values()) <= 2e-15, errors  # 4.6e-16


def test_the_error_over_the_long_span_is_the_rise_of_h_up_to_the_departure(cells):
    for (h, s), found in cells.items():
        time, rise = experiment.limit(s, h)
        assert abs(rise - found["hbvm"].error) < 3e-15, (h, s)  # 1.5e-15
        assert 30 <= time <= experiment.SPAN  # 66 to 1866: two revolutions at least, 31 each


def test_the_printed_points_have_the_printed_errors():
    for gauss, gauss_error, hbvm, _ in PRINTED.values():
        assert experiment.error_of(float(gauss)) == pytest.approx(gauss_error, rel=0.01)
        assert experiment.error_of(float(hbvm)) < 2e-15  # 1.2e-15


def test_p1_and_p2_are_saddles():
    for point in (P1, P2):
        pair = experiment.eigenvalues(point)
        assert np.abs(pair.imag).max() == 0.0
        assert pair.real.prod() < 0
        assert abs(pair.sum()) < 1e-6 * np.abs(pair).max()  # 1e-9: plus and minus


def test_the_level_of_the_loop_is_that_of_p1():
    assert experiment.energy(np.array([P1]))[0] == pytest.approx(H_STAR, rel=2e-16)


def test_the_period_grows_as_the_logarithm_of_the_distance():
    rows = np.array(experiment.periods((1e-4, 1e-6, 1e-8)))
    slope = np.polyfit(np.log(rows[:, 0]), rows[:, 1], 1)[0]
    assert slope * experiment.saddle_rate() == pytest.approx(-1.0, rel=2e-3)  # -1.00002


def test_the_period_near_the_centre_is_that_of_the_linearised_motion():
    ((_, period),) = experiment.periods((1 - 1e-4,))
    assert period == pytest.approx(2 * np.pi, rel=1e-6)  # 3e-9


def test_every_start_inside_stays_under_hbvm_and_gauss_loses_some():
    gaps = np.geomspace(1e-6, 1e-3, 12).tolist()
    hbvm = [time for _, time in experiment.fates(HBVM(k=5, s=2, h=1.0), gaps, span=1000.0)]
    gauss = [time for _, time in experiment.fates(Gauss(s=2, h=1.0), gaps, span=1000.0)]
    assert hbvm == [None] * len(gaps)
    assert None not in gauss


def test_the_orbit_on_the_edge_passes_through_the_saddle():
    found = experiment.edge(HBVM(k=5, s=2, h=1.0), experiment.SHORT_SPAN)
    t, y = experiment.orbit(HBVM(k=5, s=2, h=1.0), found.low, experiment.SHORT_SPAN)
    assert t[-1] == experiment.SHORT_SPAN
    assert np.hypot(*(y - P1).T).min() < 1e-5  # 1e-7 to 1e-8
    assert np.ptp(experiment.energy(y)) < 1e-14  # 6e-16


def test_the_bisection_ends_at_neighbouring_points_around_the_edge():
    found = experiment.edge(HBVM(k=8, s=3, h=0.5), experiment.SHORT_SPAN)
    assert found.high - found.low <= 2.0**-52
    assert abs(found.c - C_STAR) < 1e-15  # 1e-16
