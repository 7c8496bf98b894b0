"""One number over seeds with its 95 % interval: means, ratios of means, shares.

Seeds lie along axis 0 of every argument, and each seed is one independent study of all learners and points. Further
axes are kept, so that many simulated studies are judged at once. Each limit is one-sided: the chance that it lies on
the wrong side of the truth is `error`, 2.5 % unless a caller asks for another.

How often intervals are right is simulated by `python -m paper_figs.calibration`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import special, stats

ERROR = 0.025
"""Chance of one limit to be on the wrong side of the truth; both together leave 95 %."""
_BISECTIONS = 50


class Interval(NamedTuple):
    """A number with its two limits, or an array of each. Limits are NaN where one seed says nothing about others."""

    value: Any
    low: Any
    high: Any


def mean_effect(values: np.ndarray, error: float | np.ndarray = ERROR) -> Interval:
    """Mean over seeds, with limits of Student's t that a skewness moves; see `_distances`.

    Args:
      values: [n, ...], paired differences for example.
      error: chance of each limit to be on the wrong side; it may differ along the last axes.
    """
    values = np.asarray(values, float)
    mean = values.mean(axis=0)
    apart = values - mean
    below, above = _distances(
        (apart**2).mean(axis=0), (apart**3).mean(axis=0), len(values), _student(error, len(values))
    )
    return Interval(mean, mean - below, mean + above)


def _student(error: float | np.ndarray, n: int) -> Any:
    """Quantile of Student's t for n values; NaN for one."""
    return stats.t.isf(error, n - 1) if n > 1 else np.nan


def _distances(second: Any, third: Any, n: int, t: Any) -> tuple[Any, Any]:
    """How far below and above the mean of n values its limits are.

    With a long tail to the right, the mean is too small most times, and by more when the tail stays unseen. To first
    order its limits move to the right by (1 + 2 t^2) / (6 sqrt(n)) skewnesses and standard errors (Johnson 1978,
    Journal of the American Statistical Association 73; Hall 1992, Journal of the Royal Statistical Society B 54). Small
    samples show less skewness than there is (Bobée and Robitaille 1975, Water Resources Research 11), and symmetric
    laws with heavy tails show some where there is none. So a limit moves outwards by more than the formula says and
    inwards by less. How much is set so that both errors are near 2.5 % from 5 to 1000 seeds for normal, exponential and
    heavy-tailed values; `paper_figs.calibration` looks at other laws, too.

    Args:
      second: central moment of the values.
      third: central moment of the values.
      n: number of values.
      t: quantile of Student's t.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        skewness = np.where(second > 0, third / second**1.5, 0.0)
    lean = skewness / np.sqrt(n)
    outwards, inwards = (1 + 40 / n) * (1 / t + 2 * t) / 6, 0.28 + 2.4 / n
    longer, shorter = 1 + outwards * np.abs(lean), 1 / (1 + inwards * np.abs(lean))
    half = t * np.sqrt(second / max(n - 1, 1))
    return half * np.where(lean < 0, longer, shorter), half * np.where(lean > 0, longer, shorter)


def ratio_effect(a: np.ndarray, b: np.ndarray, error: float | np.ndarray = ERROR) -> Interval:
    """mean(a) / mean(b) over paired seeds: all ratios r for which the mean of a - r b may be 0.

    It is Fieller's set (1954, Journal of the Royal Statistical Society B 16) with the limits of `mean_effect`. Where
    the mean of b may be 0 the set has no bounds, and limits are infinite.

    Args:
      a: [n, ...].
      b: [n, ...], with the same seeds.
      error: chance of each limit to be on the wrong side; it may differ along the last axes.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    n, sign = len(a), np.where(b.mean(axis=0) < 0, -1.0, 1.0)
    contrast = _contrasts(sign * a, sign * b)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = a.mean(axis=0) / b.mean(axis=0)
    t = _student(error, n)
    if n < 2:
        return Interval(value, value * t, value * t)

    def may_be_zero(angle: np.ndarray) -> np.ndarray:
        mean, second, third = contrast(angle)
        below, above = _distances(second, third, n, t)
        return (mean - below <= 0) & (mean + above >= 0)

    centre = np.arctan2((sign * a).mean(axis=0), (sign * b).mean(axis=0))
    right = np.full_like(centre, np.pi / 2)
    unbounded = may_be_zero(right)
    low, high = (np.tan(_edge(may_be_zero, centre, end)) for end in (-right, right))
    low, high = np.where(unbounded, -np.inf, np.fmin(low, value)), np.where(unbounded, np.inf, np.fmax(high, value))
    return Interval(value, low[()], high[()])


def relative_effect(a: np.ndarray, b: np.ndarray, error: float | np.ndarray = ERROR) -> Interval:
    """1 - mean(a) / mean(b) over paired seeds: by which part a is below b; see `ratio_effect`."""
    ratio = ratio_effect(a, b, error)
    return Interval(1 - ratio.value, 1 - ratio.high, 1 - ratio.low)


def _contrasts(a: np.ndarray, b: np.ndarray) -> Callable[[np.ndarray], tuple[Any, Any, Any]]:
    """Mean and central moments of a cos(angle) - b sin(angle), the contrast of the ratio tan(angle)."""
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    a, b = a - mean_a, b - mean_b
    aa, ab, bb = ((x * y).mean(axis=0) for x, y in ((a, a), (a, b), (b, b)))
    aaa, aab, abb, bbb = ((x * y * z).mean(axis=0) for x, y, z in ((a, a, a), (a, a, b), (a, b, b), (b, b, b)))

    def moments(angle: np.ndarray) -> tuple[Any, Any, Any]:
        c, s = np.cos(angle), -np.sin(angle)
        second = c**2 * aa + 2 * c * s * ab + s**2 * bb
        third = c**3 * aaa + 3 * c**2 * s * aab + 3 * c * s**2 * abb + s**3 * bbb
        rounding = 1e-13 * (c**2 * aa + s**2 * bb)
        return c * mean_a + s * mean_b, np.where(second > rounding, second, 0.0), third

    return moments


def _edge(holds: Callable[[np.ndarray], np.ndarray], inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Where a condition that holds inside and not outside ends, by bisection."""
    for _ in range(_BISECTIONS):
        middle = (inside + outside) / 2
        held = holds(middle)
        inside, outside = np.where(held, middle, inside), np.where(held, outside, middle)
    return (inside + outside) / 2


def proportion_effect(count: np.ndarray | float, n: np.ndarray | float, error: float = ERROR) -> Interval:
    """Share count / n with limits from the binomial law, in which the count itself has half its chance.

    A limit is the share at which as many or more (fewer) would be counted with a chance of `error`, if the chance of
    exactly this count counts half (mid-p; Lancaster 1961, Journal of the American Statistical Association 56; Berry and
    Armitage 1995, The Statistician 44). Counts may be halves, of ties. Of nothing (n = 0) the interval is 0 to 1.
    """
    count, n = np.broadcast_arrays(np.asarray(count, float), np.asarray(n, float))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = count / n
    return Interval(share[()], _least_share(count, n, error)[()], (1 - _least_share(n - count, n, error))[()])


def _least_share(count: np.ndarray, n: np.ndarray, error: float) -> np.ndarray:
    """The share at which the chance of more than `count` of n, and half of that of `count`, is `error`."""
    some = (count > 0) & (n > 0)
    count, n = np.where(some, count, 1.0), np.where(some, n, 1.0)

    def too_rare(share: np.ndarray) -> np.ndarray:
        as_many = special.betainc(count, n - count + 1, share)
        more = np.where(count < n, special.betainc(count + 1, np.maximum(n - count, 1e-9), share), 0.0)
        return (as_many + more) / 2 < error

    return np.where(some, _edge(too_rare, np.zeros(count.shape), np.ones(count.shape)), 0.0)


def clustered_share(holds: np.ndarray, clusters: np.ndarray) -> Interval:
    """Share of points that hold, with limits for points that come in clusters.

    The binomial law is that of as many independent points as would give the variance between clusters, fewer for the
    few degrees of freedom that this variance has, and never more than there are (Korn and Graubard 1998, Survey
    Methodology 24). One cluster, or points that all agree, say nothing of a variance between clusters.

    Args:
      holds: [points], true where a point counts.
      clusters: [points], what points have in common.
    """
    holds = np.asarray(holds, float)
    n, share = len(holds), float(holds.mean()) if len(holds) else math.nan
    _, places = np.unique(clusters, return_inverse=True)
    number = int(places.max(initial=-1)) + 1
    effective = float(n)
    if number > 1 and 0 < share < 1:
        of_clusters = np.bincount(places, holds - share) / n
        variance = number / (number - 1) * float(np.square(of_clusters).sum())
        fewer = float(stats.t.isf(ERROR, n - 1) / stats.t.isf(ERROR, number - 1)) ** 2
        effective = n if variance == 0 else min(n, share * (1 - share) / variance * fewer)
    return proportion_effect(share * effective if n else 0.0, effective)


def interquartile_mean(values: np.ndarray, error: float = ERROR) -> Interval:
    """Mean of the middle half over seeds, [n, ...]; below four seeds nothing is left out.

    Limits come from the winsorised values, and from as many degrees of freedom as values are kept less one (Tukey and
    McLaughlin 1963, Sankhya A 25).
    """
    values = np.sort(np.asarray(values, float), axis=0)
    n = len(values)
    left_out = n // 4
    kept = n - 2 * left_out
    value = values[left_out : n - left_out].mean(axis=0)
    apart = np.clip(values, values[left_out], values[n - 1 - left_out])
    apart = (apart - apart.mean(axis=0)) * n / kept * np.sqrt((kept - 1) / max(n - 1, 1))
    below, above = _distances((apart**2).mean(axis=0), (apart**3).mean(axis=0), kept, _student(error, kept))
    return Interval(value, value - below, value + above)


def probability_of_improvement(a: np.ndarray, b: np.ndarray, error: float = ERROR) -> Interval:
    """P(a > b) + P(a = b) / 2 of runs with different seeds; a, b: [n, ...], with the same seeds.

    It is Mann and Whitney's statistic without the pairs that share a seed, which are no independent runs. The variance
    is the jackknife's over seeds (Arvesen 1969, Annals of Mathematical Statistics 40); limits are those of a share of
    as many independent comparisons as have this variance (Mee 1990, Journal of the American Statistical Association
    85). Below three seeds they are 0 and 1.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    n = len(a)
    own = (a > b) + 0.5 * (a == b)
    wins_of_a, losses_of_b = _wins(a, b) - own, n - _wins(b, a) - own
    total = wins_of_a.sum(axis=0)
    if n < 3:
        return Interval(np.where(n > 1, total / 2, np.nan)[()], total * 0.0, total * 0.0 + 1.0)
    value = total / (n * (n - 1))
    without = (total - wins_of_a - losses_of_b) / ((n - 1) * (n - 2))  # each seed
    variance = (n - 1) * without.var(axis=0)
    same = np.where(value % 1 == 0, n, n * (n - 1))  # comparisons where all seeds agree
    with np.errstate(divide="ignore", invalid="ignore"):
        comparisons = np.where(variance > 0, value * (1 - value) / variance, same)
    limits = proportion_effect(value * comparisons, comparisons, error)
    return Interval(value, limits.low, limits.high)


def _wins(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How many of b each of a exceeds, [n, ...], ties counting half: its rank among all less that among a."""
    return stats.rankdata(np.concatenate([a, b]), axis=0)[: len(a)] - stats.rankdata(a, axis=0)
