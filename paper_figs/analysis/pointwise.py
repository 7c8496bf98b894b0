"""What is said of several points at once: "at every point", "up to", "rises with x".

Seeds lie along axis 0, points along axis 1; further axes are kept.

The low limit of the smallest mean is the smallest of all low limits, without a correction: it is wrong only where the
smallest mean's own limit is (intersection-union; Berger 1982, Technometrics 24). The high limit holds at once for all
points that may be the smallest (Bonferroni); those that are surely not are left out first (Romano, Shaikh and Wolf
2014, Econometrica 82).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from paper_figs.analysis.intervals import ERROR, Interval, mean_effect, relative_effect

_SCREENING = 0.1  # part of the error that is spent on leaving points out


def every_point(values: np.ndarray, error: float = ERROR) -> Interval:
    """The smallest of the means of several points, [n, k, ...]: positive if the effect is positive at every point."""
    return _smallest(lambda e: mean_effect(values, e), error)


def up_to(a: np.ndarray, b: np.ndarray, error: float = ERROR) -> Interval:
    """The largest of the relative reductions 1 - mean(a) / mean(b) of several points; a, b: [n, k, ...], paired."""
    smallest = _smallest(lambda e: _negative(relative_effect(a, b, e)), error)
    return _negative(smallest)


def trend(values: np.ndarray, error: float = ERROR) -> Interval:
    """The smallest step between neighbouring points, [n, k, ...]: positive if the mean rises with each of them."""
    return every_point(np.diff(np.asarray(values, float), axis=1), error)


def _negative(interval: Interval) -> Interval:
    return Interval(-interval.value, -interval.high, -interval.low)


def _smallest(of_points: Callable[[Any], Interval], error: float) -> Interval:
    """The smallest of the numbers of points, whose intervals [k, ...] a function of the error gives."""
    each = of_points(error)
    screened = of_points(_SCREENING * error / len(each.value))
    candidates = ~(screened.low > screened.high.min(axis=0))
    shared = (1 - _SCREENING) * error / candidates.sum(axis=0)
    together = np.where(candidates, of_points(shared).high, np.inf)
    return Interval(each.value.min(axis=0), each.low.min(axis=0), together.min(axis=0))
