"""Episodes in which runs converge, where some never do: they are infinite there, and never a number.

All runs of a study end after as many episodes, so the share of runs that have converged by then is Kaplan and Meier's
estimate itself.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from paper_figs.analysis.intervals import ERROR, Interval, proportion_effect


def earlier(a: np.ndarray, b: np.ndarray, error: float = ERROR) -> Interval:
    """Probability that a converges before b with the same seed; ties count half.

    Seeds with which neither converges say nothing and are left out; if there are only such seeds, the interval is 0 to
    1 and the value NaN. It is the sign test's interval.

    Args:
      a: [n, ...] episodes, infinite where a run never converges.
      b: [n, ...], with the same seeds.
      error: chance of each limit to be on the wrong side.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    known = np.isfinite(a) | np.isfinite(b)
    count = ((a < b) + 0.5 * ((a == b) & known)).sum(axis=0)
    return proportion_effect(count, known.sum(axis=0), error)


def reached_by(episodes: np.ndarray, low: float, high: float, error: float = ERROR) -> Interval:
    """Share of runs that converge from episode `low` to `high`, of episodes [n, ...]."""
    episodes = np.asarray(episodes, float)
    return proportion_effect(((episodes >= low) & (episodes <= high)).sum(axis=0), len(episodes), error)


def typical(episodes: np.ndarray, error: float = ERROR) -> Interval:
    """Median episode of [n, ...], infinite where fewer than half of the runs converge, with order statistics as limits.

    Limits may be infinite, too. They hold whatever the law of the episodes (Thompson 1936). "About 150" is the question
    whether this interval lies within a band.
    """
    episodes = np.sort(np.asarray(episodes, float), axis=0)
    n = len(episodes)
    value = episodes[(n - 1) // 2]  # of two middle runs the earlier: half of the runs have converged by then
    if n < 2:
        return Interval(value, value * np.nan, value * np.nan)
    below = np.arange(n)
    chance = stats.binom.cdf(below - 1, n, 0.5) + stats.binom.pmf(below, n, 0.5) / 2
    rank = int((chance <= error).sum()) - 1
    if rank < 0:
        return Interval(value, value * 0.0, value * 0 + np.inf)
    return Interval(value, episodes[rank], episodes[n - 1 - rank])
