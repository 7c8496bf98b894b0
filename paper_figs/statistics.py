"""Statistics of results over seeds. Independent seeds are the only source of uncertainty that is claimed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import stats


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


def bins_of(episodes: int, points: int = 100) -> int:
    """Episodes per plotted point of a learning curve: the smallest divisor of `episodes` giving at most `points`."""
    return next(width for width in range(1, episodes + 1) if episodes % width == 0 and episodes // width <= points)
