import functools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hbvm_bench.measure import drift
from problems.errors import InputError

T = np.unique(np.rint(np.geomspace(10, 1e6, 120)))


@functools.cache
def walks(seed, starts=8, every=10.0):
    """Return random walks of unit steps, looked at the times `T`."""
    steps = np.random.default_rng(seed).standard_normal((starts, int(T[-1] / every)))
    return np.cumsum(steps, axis=1)[:, (T / every).astype(int) - 1]


@pytest.mark.parametrize("seed", range(12))
def test_a_random_walk_grows_like_the_square_root_and_has_no_drift(seed):
    """Of these twelve none is a false alarm; how many there are see below."""
    growth = drift.fit(T, walks(seed))
    assert growth.kind == "power"
    # measured over 200 seeds: slope 0.36 to 0.66
    assert 0.25 < growth.slope < 0.8
    assert growth.rate_low < growth.rate < growth.rate_high


def test_the_interval_of_the_drift_of_random_walks_holds_zero_as_often_as_it_says():
    held = 0
    for seed in range(60):
        found = drift.mean(T, walks(seed))
        held += found.rate_low < 0.0 < found.rate_high
    # 95 % of 60 is 57; measured 56
    assert held >= 50


SCATTER = math.sqrt(1e5)  # of the end of a walk of 100 000 steps


@pytest.mark.parametrize("seed", [2, 5])
def test_a_walk_that_drifts_slowly_is_called_a_drift_whatever_its_power(seed):
    # with three times its scatter at the end: 8.5 standard errors of the mean of eight
    growth = drift.fit(T, walks(seed) - 3.0 * SCATTER * T / T[-1])
    assert growth.kind == "drift"
    assert growth.positive <= 1


def test_the_mean_finds_a_drift_of_known_size():
    found = [drift.mean(T, walks(seed) - 3.0 * SCATTER * T / T[-1]) for seed in range(100)]
    # measured: 100 and 2.7 standard errors of the mean of eight
    assert sum(drift.drifts(one) is True for one in found) >= 97
    assert max(abs(one.mean + 3.0 * SCATTER) for one in found) < 4.0 * SCATTER / math.sqrt(8.0)


@pytest.mark.parametrize(("starts", "share", "called"), [(8, "2 %", 2), (3, "5 %", 4)])
def test_random_walks_are_called_a_drift_as_seldom_as_the_pages_say(starts, share, called):
    assert drift.told(starts).endswith(f"chance exceeds this in {share} of all runs")
    # of 100 walks 2 +- 1.4 and 5 +- 2.2 are expected
    assert sum(drift.drifts(drift.mean(T, walks(seed, starts))) is True for seed in range(100)) == called


def test_an_offset_is_no_drift():
    """What the evaluation adds from the first sample on is taken off before the end is looked at."""
    growth = drift.fit(T, 100.0 + walks(3))
    assert drift.drifts(growth) is False
    assert growth.kind == "power"
    moved = drift.fit(T, 100.0 + walks(3) - 3.0 * 316.0 * T / T[-1])
    assert drift.drifts(moved) is True


def test_an_amplitude_that_all_starts_share_is_bounded_and_no_drift():
    growth = drift.fit(T, 1e-9 * np.sin(1.3 * T) + 1e-16 * walks(3))
    assert growth.kind == "bounded"


@pytest.mark.parametrize(("starts", "limit"), [(2, 12.71), (3, 4.30), (4, 3.18), (8, 3.0), (16, 3.0)])
def test_few_starts_need_more_standard_errors(starts, limit):
    assert drift.limit(starts) == pytest.approx(limit, abs=0.005)  # Student's t, 95 %, from any table


def test_one_start_cannot_tell_a_drift():
    found = drift.mean(T, walks(1, starts=1) + T)
    assert drift.drifts(found) is None
    assert found.mean_error is None


@given(st.floats(1e-20, 1e-3), st.sampled_from([-1.0, 1.0]), st.integers(0, 1000))
@settings(max_examples=8, deadline=None)
def test_a_biased_walk_drifts_and_its_rate_is_the_bias(bias, sign, seed):
    growth = drift.fit(T, sign * bias * T + bias * walks(seed))
    assert growth.kind == "drift"
    assert abs(growth.slope - 1.0) < 0.02  # measured 2e-3
    assert growth.rate_low <= sign * bias <= growth.rate_high or abs(growth.rate - sign * bias) < 0.01 * bias


@given(st.floats(1e-18, 1e-2), st.integers(0, 1000))
@settings(max_examples=8, deadline=None)
def test_noise_of_one_size_is_bounded(size, seed):
    growth = drift.fit(T, size * np.random.default_rng(seed).standard_normal((8, T.size)))
    assert growth.kind == "bounded"
    assert abs(growth.floor / size - 1.0) < 0.3  # measured 0.1


def test_an_oscillation_is_bounded():
    assert drift.fit(T, 1e-9 * np.sin(1.3 * T)).kind == "bounded"


def test_an_unstable_orbit_is_exponential_and_its_rate_is_found():
    noise = np.random.default_rng(3).standard_normal((4, T.size))
    growth = drift.fit(T, 1e-15 * (np.exp(T / 5e4) + noise))
    assert growth.kind == "exponential"
    assert abs(growth.exponential_rate * 5e4 - 1.0) < 0.1  # measured 1e-3


def test_growth_above_a_floor_is_seen_as_growth():
    growth = drift.fit(T, 1e-16 * (walks(5) + 30.0 * np.random.default_rng(5).standard_normal((8, T.size))))
    assert growth.kind == "power"
    assert 1e-15 < growth.floor < 1e-14  # measured 3.0e-15


def test_a_power_of_t_has_its_exponent():
    growth = drift.fit(T, 1e-18 * T**2)
    assert growth.kind == "power"
    assert abs(growth.slope - 2.0) < 0.02  # measured 3e-3


@given(st.floats(1e-12, 1e12), st.floats(1e-6, 1e6))
@settings(max_examples=8, deadline=None)
def test_the_growth_does_not_depend_on_the_units(scale, unit):
    errors = walks(11)
    plain, other = drift.fit(T, errors), drift.fit(unit * T, scale * errors)
    assert other.kind == plain.kind
    assert math.isclose(other.slope, plain.slope, abs_tol=1e-3)
    assert math.isclose(other.rate, plain.rate * scale / unit, rel_tol=1e-9)


def test_one_start_has_a_slope_but_no_interval_for_its_rate():
    growth = drift.fit(T, walks(1, starts=1)[0])
    assert growth.starts == 1
    assert math.isfinite(growth.slope_low)
    assert growth.rate_high is None


def test_an_error_of_exactly_zero_is_bounded_by_zero():
    growth = drift.fit(T, np.zeros((4, T.size)))
    assert (growth.kind, growth.floor, growth.slope) == ("bounded", 0.0, 0.0)


def test_too_few_samples_have_no_growth_and_say_why():
    growth = drift.fit([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
    assert growth.kind is None
    assert "windows" in growth.why


def test_errors_without_a_sign_have_no_rate():
    assert drift.fit(T, np.abs(walks(2)), signed=False).rate is None


@pytest.mark.parametrize(
    ("t", "errors", "words"),
    [
        ([1.0, 2.0], [1.0], "do not belong"),
        ([0.0, 2.0], [1.0, 1.0], "positive"),
        ([2.0, 1.0], [1.0, 1.0], "ascending"),
    ],
)
def test_what_is_no_series_is_refused(t, errors, words):
    with pytest.raises(InputError, match=words):
        drift.fit(t, errors)


def test_what_is_not_finite_ends_the_series():
    whole = drift.fit(T[:90], walks(3)[:, :90])
    rows = walks(3)
    rows[2, 90] = math.nan
    found = drift.fit(T, rows)
    assert (found.kind, found.slope, found.rate, found.end) == (whole.kind, whole.slope, whole.rate, T[89])
    assert found.why.startswith(f"only to t = {T[89]:.4g}")
    assert drift.fit(T, np.full((1, T.size), np.nan)).kind is None


def test_the_rms_is_over_the_trajectories_and_does_not_overflow():
    assert drift.rms([[3e200, 0.0], [4e200, 0.0]]).tolist() == pytest.approx([math.sqrt(12.5) * 1e200, 0.0])
