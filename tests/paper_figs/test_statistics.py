"""Intervals against what is known exactly, and in worlds where earlier methods were wrong."""

import numpy as np
import pytest
from scipy import stats

from paper_figs.analysis import statistics
from paper_figs.analysis.censored import earlier, reached_by, typical
from paper_figs.analysis.intervals import (
    clustered_share,
    interquartile_mean,
    mean_effect,
    probability_of_improvement,
    proportion_effect,
    ratio_effect,
    relative_effect,
)
from paper_figs.analysis.pointwise import every_point, trend, up_to

STUDIES = 4000


def rng(seed=0):
    return np.random.default_rng(seed)


def coverage(interval, truth):
    return np.mean((interval.low <= truth) & (truth <= interval.high))


# --- means ----------------------------------------------------------------------------------------------------------


def test_without_skewness_the_interval_of_a_mean_is_students():
    half = rng().normal(size=6)
    values = np.concatenate([3 + half, 3 - half])
    reference = stats.ttest_1samp(values, 0).confidence_interval(0.95)
    np.testing.assert_allclose(mean_effect(values), [3, reference.low, reference.high])


def test_a_long_tail_moves_both_limits_to_its_side():
    values = rng().exponential(size=20)
    value, low, high = mean_effect(values)
    reference = stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert reference.low < low < value < reference.high < high
    np.testing.assert_allclose(mean_effect(-values), [-value, -high, -low])
    np.testing.assert_allclose(mean_effect(1 + 5 * values), 1 + 5 * np.array([value, low, high]))


@pytest.mark.parametrize("n", [10, 30])
def test_intervals_of_exponential_values_cover_what_students_do_not(n):
    values = rng(n).exponential(size=(n, STUDIES))
    half = stats.t.ppf(0.975, n - 1) * values.std(axis=0, ddof=1) / np.sqrt(n)
    assert np.mean(abs(values.mean(axis=0) - 1) <= half) < 0.93
    assert 0.93 < coverage(mean_effect(values), 1.0) < 0.97


def test_seeds_that_agree_leave_no_width_and_one_seed_no_limits():
    np.testing.assert_array_equal(mean_effect(np.full(5, 2.0)), (2.0, 2.0, 2.0))
    for interval in (mean_effect(np.ones(1)), ratio_effect(np.ones(1), np.ones(1)), interquartile_mean(np.ones(1))):
        assert np.isnan(interval.low)
        assert np.isnan(interval.high)


def test_means_of_a_figure_have_the_interval_of_each_point():
    values = rng().exponential(size=(7, 3))
    mean = statistics.mean_over_seeds(values)
    np.testing.assert_allclose(mean[:3], np.transpose([mean_effect(values[:, i]) for i in range(3)]))
    assert mean.n_seeds == 7


def test_interquartile_means_ignore_the_tails():
    values = np.array([-1e9, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1e9])
    value, low, high = interquartile_mean(values)
    assert value == stats.trim_mean(values, 0.25) == 3.5
    assert 0 < low < value < high < 7


# --- ratios ---------------------------------------------------------------------------------------------------------


def test_the_limits_of_a_ratio_are_where_the_contrast_may_just_be_zero():
    a, b = rng(1).gamma(4.0, size=(2, 12))
    value, low, high = ratio_effect(a, b)
    assert value == a.mean() / b.mean()
    assert abs(mean_effect(a - low * b).low) < 1e-9
    assert abs(mean_effect(a - high * b).high) < 1e-9
    np.testing.assert_allclose(ratio_effect(-a, -b), (value, low, high))
    np.testing.assert_allclose(relative_effect(a, b), (1 - value, 1 - high, 1 - low))


def test_a_ratio_to_what_may_be_zero_has_no_bounds():
    a, b = np.ones(6) + 0.1 * rng().normal(size=6), np.array([-1.0, 1.0, -2.0, 2.0, -3.0, 3.1])
    assert ratio_effect(a, b)[1:] == (-np.inf, np.inf)


def test_the_ratio_of_a_learner_to_itself_is_one():
    a = rng().normal(5.0, size=9)
    value, low, high = ratio_effect(a, a)
    assert value == 1
    assert 1 - 1e-5 < low <= 1 <= high < 1 + 1e-5


# --- shares ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "n"), [(0, 10), (3, 10), (10, 10), (5, 5), (400, 1000)])
def test_the_limits_of_a_share_are_mid_p(count, n):
    value, low, high = proportion_effect(count, n)
    assert value == count / n
    if count:
        np.testing.assert_allclose(stats.binom.sf(count, n, low) + stats.binom.pmf(count, n, low) / 2, 0.025, rtol=1e-6)
    if count < n:
        np.testing.assert_allclose(
            stats.binom.cdf(count - 1, n, high) + stats.binom.pmf(count, n, high) / 2, 0.025, rtol=1e-6
        )
    assert (low == 0) == (count == 0)
    assert (high == 1) == (count == n)


def test_of_nothing_any_share_is_possible():
    assert proportion_effect(0, 0)[1:] == (0.0, 1.0)


def test_improvement_counts_runs_of_different_seeds():
    a, b = rng(3).integers(0, 5, size=(2, 8)).astype(float)
    pairs = [np.sign(a[i] - b[j]) / 2 + 0.5 for i in range(8) for j in range(8) if i != j]
    value, low, high = probability_of_improvement(a, b)
    np.testing.assert_allclose(value, np.mean(pairs))
    assert low < value < high


def test_a_learner_that_is_a_hair_better_on_each_seed_does_not_improve():
    seeds = rng().normal(size=3)
    assert probability_of_improvement(seeds + 1e-9, seeds).value == 0.5  # with pairs of one seed it would be 0.67
    assert probability_of_improvement(seeds, seeds).value == 0.5
    assert probability_of_improvement(np.arange(3.0) + 9, np.arange(3.0)).value == 1


def test_the_interval_of_improvement_covers_the_truth():
    for n in (5, 10, 50):
        a, b = rng(n).normal(size=(2, n, STUDIES))
        assert 0.93 < coverage(probability_of_improvement(a, b), 0.5) < 0.97


# --- several points -------------------------------------------------------------------------------------------------


def test_every_point_is_as_good_as_its_worst_with_a_high_limit_for_all():
    values = rng(2).normal([0.0, 0.1, 50.0], [1.0, 1.0, 9.0], size=(7, 3))
    each = mean_effect(values)
    found = every_point(values)
    assert found.value == each.value.min()
    assert found.low == each.low.min()
    assert found.high > each.high.min()
    far = every_point(values + np.array([0.0, 1e3, 1e3]))  # one candidate, which costs little
    np.testing.assert_allclose(far.high, mean_effect(values[:, 0], 0.9 * 0.025).high)


@pytest.mark.parametrize("n", [5, 10])
def test_leads_that_are_all_zero_are_rarely_contradicted(n):
    values = rng(n).normal(size=(n, 18, STUDIES))
    assert np.mean(every_point(values).high < 0) < 0.035
    assert np.mean(mean_effect(values).high.min(axis=0) < 0) > 0.2  # without a correction


@pytest.mark.parametrize("n", [5, 10])
def test_the_best_of_several_reductions_is_rarely_more_than_the_truth(n):
    a, b = (rng(n + i).normal(mean, 0.05, size=(n, 9, STUDIES // 4)) for i, mean in enumerate((0.33, 1.0)))
    assert np.mean(up_to(a, b).low > 0.67) < 0.035
    assert np.mean(relative_effect(a, b).low.max(axis=0) > 0.67) > 0.1


def test_a_rise_with_one_late_fall_is_not_a_rise():
    curve = np.arange(9.0) + 0.1 * rng().normal(size=(10, 9))
    assert trend(curve).low > 0
    fallen = curve - np.where(np.arange(9) == 8, 3.0, 0.0)
    assert trend(fallen).high < 0
    assert mean_effect(fallen[:, -1] - fallen[:, 0]).low > 0  # what end points alone would say


# --- convergence ----------------------------------------------------------------------------------------------------


def test_being_earlier_is_counted_by_seed_and_known_where_one_run_converges():
    a = np.array([1.0, 2.0, 9.0, np.inf, np.inf, 4.0])
    b = np.array([2.0, 2.0, np.inf, 3.0, np.inf, 5.0])
    assert earlier(a, b) == proportion_effect(3.5, 5)
    assert earlier(b, a) == proportion_effect(1.5, 5)


def test_a_study_in_which_nobody_converges_says_nothing():
    never = np.full(10, np.inf)
    value, low, high = earlier(never, never)
    assert np.isnan(value)
    assert (low, high) == (0, 1)
    assert typical(never).value == np.inf
    assert reached_by(never, 0, 100).value == 0


def test_identical_learners_are_neither_better_nor_worse():
    runs = rng().normal(5.0, size=(10, 9))
    for found in (every_point(runs - runs), up_to(runs, runs), trend(runs - runs)):
        assert found.low <= 0 <= found.high
    value, low, high = earlier(np.ceil(runs[:, 0]), np.ceil(runs[:, 0]))
    assert low < value == 0.5 < high


def test_the_median_has_order_statistics_as_limits():
    assert typical(np.arange(1.0, 6.0)) == (3, 1, 5)
    assert typical(np.array([1.0, 2.0, 3.0, np.inf, np.inf])) == (3, 1, np.inf)
    assert typical(np.array([1.0, 2.0, np.inf, np.inf, np.inf])).value == np.inf
    assert typical(np.arange(1.0, 5.0))[1:] == (0, np.inf)
    value, low, high = typical(np.arange(1.0, 11.0))
    assert value == 5
    assert 2 < low < 3
    assert low + high == 11


def test_ties_everywhere_leave_the_median_without_width():
    assert typical(np.full(10, 7.0)) == (7, 7, 7)


def test_reached_by_counts_runs_in_a_band():
    assert reached_by(np.array([10.0, 75.0, 225.0, 226.0, np.inf]), 75, 225) == proportion_effect(2, 5)


def test_a_share_of_points_in_clusters_has_an_interval_that_holds_the_truth():
    rng, clusters, right, naive = np.random.default_rng(3), np.repeat(np.arange(8), 64), 0, 0
    for _ in range(400):
        chances = rng.beta(2, 3, size=8)  # 0.4 on average, and other in each cluster
        holds = rng.random(len(clusters)) < chances[clusters]
        _, low, high = clustered_share(holds, clusters)
        right += low <= 0.4 <= high
        _, low, high = proportion_effect(holds.sum(), len(holds))
        naive += low <= 0.4 <= high
    assert 0.92 <= right / 400 <= 0.99
    assert naive / 400 < 0.7


def test_clusters_without_a_variance_between_them_are_single_points():
    holds = np.arange(40) % 4 == 0
    assert clustered_share(holds, np.zeros(40)) == proportion_effect(10, 40)
    assert clustered_share(holds, np.arange(40) // 8) == proportion_effect(10, 40)  # more alike than chance makes them
    assert clustered_share(np.zeros(40), np.arange(40) // 8) == proportion_effect(0, 40)
    assert np.isnan(clustered_share(np.zeros(0), np.zeros(0)).value)
