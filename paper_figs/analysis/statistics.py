"""Means over seeds as figures and tables show them. Independent seeds are the only source of uncertainty."""

from __future__ import annotations

import math
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
    """Episodes per plotted point of a learning curve, the fewest that give at most so many points."""
    return math.ceil(episodes / points)


def bin_means(values: np.ndarray, width: int) -> np.ndarray:
    """Means of [..., episodes] over so many episodes each, [..., bins]; the last bin may have fewer."""
    bins = np.split(values, range(width, values.shape[-1], width), axis=-1)
    return np.stack([of_bin.mean(axis=-1) for of_bin in bins], axis=-1)
