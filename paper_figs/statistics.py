"""Statistics of results over seeds. Independent seeds are the only source of uncertainty that is claimed."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import stats

_RESAMPLES = 10_000


class Mean(NamedTuple):
    """A mean over seeds with its 95 % confidence interval."""

    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    n_seeds: int


def mean_over_seeds(values: np.ndarray, confidence: float = 0.95) -> Mean:
    """Mean over axis 0 (seeds) with Student's t interval; the interval is NaN for a single seed.

    Args:
      values: [seeds, ...].
      confidence: coverage of the interval.
    """
    n = values.shape[0]
    mean = values.mean(axis=0)
    if n == 1:
        unknown = np.full_like(mean, np.nan)
        return Mean(mean, unknown, unknown, n)
    half = stats.t.ppf((1 + confidence) / 2, n - 1) * values.std(axis=0, ddof=1) / np.sqrt(n)
    return Mean(mean, mean - half, mean + half, n)


def bootstrap(
    values: np.ndarray, statistic: Callable[[np.ndarray], np.ndarray], seed: int = 0
) -> tuple[float, float, float]:
    """A statistic of means over seeds and its 95 % percentile bootstrap interval; the interval is NaN for one seed.

    Args:
      values: [seeds, ...].
      statistic: function of means [..., n], where the last axis counts resamples, to [n].
      seed: of the generator.
    """
    values = np.asarray(values, float)
    value = float(statistic(values.mean(axis=0)[..., None])[0])
    if len(values) < 2:
        return value, float("nan"), float("nan")
    draws = np.random.default_rng(seed).integers(len(values), size=(_RESAMPLES, len(values)))
    weights = np.stack([(draws == i).mean(axis=1) for i in range(len(values))])  # [seeds, resamples]
    low, high = np.quantile(statistic(np.tensordot(values, weights, axes=(0, 0))), [0.025, 0.975])
    return value, float(low), float(high)


def bins_of(episodes: int, points: int = 100) -> int:
    """Episodes per plotted point of a learning curve: the smallest divisor of `episodes` giving at most `points`."""
    return next(width for width in range(1, episodes + 1) if episodes % width == 0 and episodes // width <= points)
