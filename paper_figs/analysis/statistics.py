"""Means over seeds as figures and tables show them. Independent seeds are the only source of uncertainty."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paper_figs.analysis.intervals import ERROR, mean_effect

CONFIDENCE = 1 - 2 * ERROR
"""Coverage of every interval."""


class Mean(NamedTuple):
    """A mean over seeds with its 95 % confidence interval."""

    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    n_seeds: int


def mean_over_seeds(values: np.ndarray) -> Mean:
    """Mean over axis 0 (seeds) of [seeds, ...] with `mean_effect`'s interval, which is NaN for a single seed."""
    return Mean(*mean_effect(values), n_seeds=len(values))


def bins_of(episodes: int, points: int = 100) -> int:
    """Episodes per plotted point of a learning curve: the smallest divisor of `episodes` giving at most `points`."""
    return next(width for width in range(1, episodes + 1) if episodes % width == 0 and episodes // width <= points)
