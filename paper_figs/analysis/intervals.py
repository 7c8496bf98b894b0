"""One number over seeds with its 95 % interval: means, ratios of means, shares.

Seeds lie along axis 0 of every argument, and each seed is one independent study of all learners and points. Further
axes are kept, so that many simulated studies are judged at once. Each limit is one-sided: the chance that it lies on
the wrong side of the truth is `error`, 2.5 % unless a caller asks for another.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import stats

ERROR = 0.025
"""Chance of one limit to be on the wrong side of the truth; both together leave 95 %."""


class Interval(NamedTuple):
    """A number with its two limits, or an array of each. Limits are NaN where one seed says nothing about others."""

    value: Any
    low: Any
    high: Any


def mean_effect(values: np.ndarray, error: float | np.ndarray = ERROR) -> Interval:
    """Mean over seeds.

    Args:
      values: [n, ...], paired differences for example.
      error: chance of each limit to be on the wrong side.
    """
    values = np.asarray(values, float)
    n = len(values)
    mean = values.mean(axis=0)
    if n < 2:
        return Interval(mean, mean * np.nan, mean * np.nan)
    half = stats.t.isf(error, n - 1) * values.std(axis=0, ddof=1) / np.sqrt(n)
    return Interval(mean, mean - half, mean + half)


def ratio_effect(a: np.ndarray, b: np.ndarray, error: float = ERROR) -> Interval:
    """mean(a) / mean(b) over paired seeds: all ratios r for which the mean of a - r b may be 0 (Fieller 1954).

    Where the mean of b may be 0 the set has no bounds, and limits are infinite.

    Args:
      a: [n, ...].
      b: [n, ...], with the same seeds.
      error: chance of each limit to be on the wrong side.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    n = len(a)
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = mean_a / mean_b
        if n < 2:
            return Interval(value, value * np.nan, value * np.nan)
        factor = stats.t.isf(error, n - 1) ** 2 / (n * (n - 1))
        spread = [
            factor * ((x - x.mean(axis=0)) * (y - y.mean(axis=0))).sum(axis=0) for x, y in ((a, a), (a, b), (b, b))
        ]
        square, middle, last = mean_b**2 - spread[2], mean_a * mean_b - spread[1], mean_a**2 - spread[0]
        root = np.sqrt(np.maximum(middle**2 - square * last, 0.0))
        low, high = (middle - root) / square, (middle + root) / square
    bounded = square > 0
    return Interval(value, np.where(bounded, low, -np.inf)[()], np.where(bounded, high, np.inf)[()])


def relative_effect(a: np.ndarray, b: np.ndarray, error: float = ERROR) -> Interval:
    """1 - mean(a) / mean(b) over paired seeds: by which part a is below b; see `ratio_effect`."""
    ratio = ratio_effect(a, b, error)
    return Interval(1 - ratio.value, 1 - ratio.high, 1 - ratio.low)


def proportion_effect(count: np.ndarray | float, n: np.ndarray | int, error: float = ERROR) -> Interval:
    """Share count / n with limits from the binomial law, each with half the chance of the count itself.

    A limit is the share at which as many or more (fewer) would be counted with a chance of `error`, if the chance of
    exactly this count counts half (mid-p; Lancaster 1961, Berry and Armitage 1995). Counts may be halves, of ties.
    Without anything counted (n = 0) the interval is 0 to 1.
    """
    count, n = np.broadcast_arrays(np.asarray(count, float), np.asarray(n, float))
    low = _mid_p_low(count, n, error)
    high = 1 - _mid_p_low(n - count, n, error)
    with np.errstate(invalid="ignore"):
        return Interval((count / n)[()], low[()], high[()])


def _mid_p_low(count: np.ndarray, n: np.ndarray, error: float) -> np.ndarray:
    """The share at which the chance of more than `count`, and half of that of `count`, is `error`, by bisection."""
    low, high = np.zeros(count.shape), np.ones(count.shape)
    for _ in range(50):
        middle = (low + high) / 2
        at_least = stats.beta.cdf(middle, np.maximum(count, 1e-9), n - count + 1)
        more = np.where(count < n, stats.beta.cdf(middle, count + 1, np.maximum(n - count, 1e-9)), 0.0)
        below = (at_least + more) / 2 < error
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.where((count > 0) & (n > 0), low, 0.0)
