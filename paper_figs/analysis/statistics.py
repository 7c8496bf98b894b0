"""Statistics of results over seeds. Independent seeds are the only source of uncertainty that is claimed.

All points and learners of a study share their seeds, so a resample draws seeds, and takes with each all that was
measured with it. What was measured with other seeds is a stratum of its own, which is resampled by itself.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import stats

from paper_figs.analysis.intervals import Interval

RESAMPLES = 10_000
"""Bootstrap resamples behind an interval."""
CONFIDENCE = 0.95
"""Coverage of every interval."""


class Mean(NamedTuple):
    """A mean over seeds with its 95 % confidence interval."""

    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    n_seeds: int


Statistic = Callable[..., np.ndarray]
"""Means of each stratum [..., n], whose last axis counts resamples, to one effect [n] or to several [..., n]."""


def mean_over_seeds(values: np.ndarray, confidence: float = CONFIDENCE) -> Mean:
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


def proportion(count: np.ndarray | int, n: int) -> Mean:
    """Shares `count` / n with Wilson's 95 % interval, which holds at 0 and 1, too."""
    z = stats.norm.ppf((1 + CONFIDENCE) / 2)
    share = np.asarray(count) / n
    centre = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    return Mean(share, np.maximum(centre - half, 0.0), np.minimum(centre + half, 1.0), n)


@functools.lru_cache(maxsize=8)
def _weights(n: int, seed: int, stratum: int) -> np.ndarray:
    """How often each of n seeds is in each resample, as shares, [n, RESAMPLES]."""
    generator = np.random.default_rng((seed, stratum))
    return generator.multinomial(n, np.full(n, 1 / n), size=RESAMPLES).T / n


def _widening(n: int) -> float:
    """By what a bootstrap interval over n seeds is too narrow.

    Resampled means scatter by sqrt((n - 1) / n) too little, and the normal quantile stands where Student's belongs
    (Hesterberg 2015, The American Statistician 69(4), "expanded percentile").
    """
    probability = (1 + CONFIDENCE) / 2
    return float(stats.t.ppf(probability, n - 1) / stats.norm.ppf(probability) * np.sqrt(n / (n - 1)))


def resampled(strata: tuple[np.ndarray, ...], statistic: Statistic, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The effects [k] of a statistic of means over seeds, and those of RESAMPLES bootstrap resamples [k, RESAMPLES].

    Args:
      strata: [seeds, ...] each, with seeds of their own.
      statistic: see `Statistic`.
      seed: of the generator.
    """
    of_all = [values.mean(axis=0)[..., None] for values in strata]
    drawn = [np.tensordot(v, _weights(len(v), seed, i), axes=(0, 0)) for i, v in enumerate(strata)]
    effects, scattered = (np.asarray(statistic(*means)) for means in (of_all, drawn))
    return effects.reshape(-1), scattered.reshape(-1, RESAMPLES)


def bootstrap(
    values: np.ndarray | tuple[np.ndarray, ...],
    statistic: Statistic = lambda means: means,
    extreme: Callable[[np.ndarray], np.floating] | None = None,
    seed: int = 0,
) -> Interval:
    """A statistic of means over seeds with its symmetric 95 % bootstrap interval; the interval is NaN for one seed.

    The largest or smallest of several effects has the largest or smallest of their simultaneous limits, so that its
    interval holds whichever of them it is; it covers at least 95 %, more where several effects are about equal.

    Args:
      values: [seeds, ...], or a tuple of such arrays with seeds of their own, the strata.
      statistic: see `Statistic`.
      extreme: np.min or np.max where the statistic gives several effects.
      seed: of the generator.
    """
    strata = tuple(np.asarray(v, float) for v in (values if isinstance(values, tuple) else (values,)))
    one_of = extreme or (lambda effects: effects.item())
    few = min(map(len, strata))
    if few < 2:
        effects = np.asarray(statistic(*(v.mean(axis=0)[..., None] for v in strata)))
        return Interval(float(one_of(effects.reshape(-1))), float("nan"), float("nan"))
    effects, scattered = resampled(strata, statistic, seed)
    scale = scattered.std(axis=1, keepdims=True)
    scale = np.where(scale == 0, 1.0, scale)  # an effect that is the same for all seeds has no width
    farthest = (np.abs(scattered - effects[:, None]) / scale).max(axis=0)
    half = np.quantile(farthest, CONFIDENCE) * _widening(few) * scale[:, 0]
    return Interval(*(float(one_of(limit)) for limit in (effects, effects - half, effects + half)))


def bins_of(episodes: int, points: int = 100) -> int:
    """Episodes per plotted point of a learning curve: the smallest divisor of `episodes` giving at most `points`."""
    return next(width for width in range(1, episodes + 1) if episodes % width == 0 and episodes // width <= points)
