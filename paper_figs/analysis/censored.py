"""Episodes in which runs converge, where some never do: they are infinite there, and never a number.

All runs of a study end after as many episodes, so the share of runs that have converged by then is Kaplan and Meier's
estimate itself.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from paper_figs.analysis.intervals import ERROR, Interval, proportion_effect

ROUNDED_ERROR = 0.035
"""Chance up to which the first or last of a few runs is a limit of their median: of five runs it is 3.1 %."""


def earlier(a: np.ndarray, b: np.ndarray, error: float = ERROR) -> Interval:
    """Probability that a converges before b with the same seed; ties count half.

    It is the sign test's interval. Seeds with which neither converges say nothing and are left out; where there are
    only such seeds, the interval is 0 to 1 and the value NaN.

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
    """Median episode of [n, ...], infinite where fewer than half of the runs converge.

    Limits are order statistics, which may be infinite, too, and numbers between two of them (Thompson 1936, Annals of
    Mathematical Statistics 7; Hettmansperger and Sheather 1986, Statistics and Probability Letters 4). The former hold
    whatever the law of the episodes is, the latter where few runs arrive in the same episode: if all arrive within one
    or two, a limit of 6 runs is wrong in up to 11 %, one of 10 in up to 5.5 %. Fewer than five runs have no limits: 0
    and infinity. "About 150" is the question whether this interval lies within a band.
    """
    episodes = np.sort(np.asarray(episodes, float), axis=0)
    n = len(episodes)
    value = episodes[(n - 1) // 2]  # of two middle runs the earlier: half of the runs have converged by then
    rank, part = _rank(n, error)
    if rank < 0:
        nothing, endless = np.zeros_like(value), np.full_like(value, np.inf)
        return Interval(value, nothing[()], endless[()])
    low = _between(episodes[rank], episodes[rank + 1], part)
    return Interval(value, low, _between(episodes[n - 1 - rank], episodes[n - 2 - rank], part))


def _between(outer: np.ndarray, inner: np.ndarray, part: float) -> np.ndarray:
    """The number that lies part of the way from the outer run to the inner one; the outer if one never converges."""
    finite = np.isfinite(outer) & np.isfinite(inner)
    return np.where(finite, outer + part * (np.where(finite, inner, 0.0) - np.where(finite, outer, 0.0)), outer)[()]


def _rank(n: int, error: float) -> tuple[int, float]:
    """The run, counted from 0, that is the median's low limit, and the part of the way to the next one; -1 if none."""
    rank = int((stats.binom.cdf(np.arange(n), n, 0.5) <= error).sum()) - 1
    if rank < 0:
        return (0, 0.0) if 0.5**n <= ROUNDED_ERROR else (-1, 0.0)
    here, after = stats.binom.cdf([rank, rank + 1], n, 0.5)
    missing = (error - here) / (after - here)
    d = rank + 1
    return rank, float((n - d) * missing / (d + (n - 2 * d) * missing))
