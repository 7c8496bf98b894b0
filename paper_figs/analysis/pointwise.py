"""What is said of several points at once: "at every point", "up to", "rises with x".

Seeds lie along axis 0, points along axis 1; further axes are kept. The worst point is as good as the limit of each, so
its low limit needs no correction (intersection-union, Berger 1982); its high limit holds for all points at once.
"""

from __future__ import annotations

import numpy as np

from paper_figs.analysis.intervals import ERROR, Interval, mean_effect, relative_effect


def every_point(values: np.ndarray, error: float = ERROR) -> Interval:
    """The smallest of the means of several points, [n, k, ...]: positive if the effect is positive at every point."""
    each, together = mean_effect(values, error), mean_effect(values, error / values.shape[1])
    return Interval(each.value.min(axis=0), each.low.min(axis=0), together.high.min(axis=0))


def up_to(a: np.ndarray, b: np.ndarray, error: float = ERROR) -> Interval:
    """The largest of the relative reductions 1 - mean(a) / mean(b) of several points; a, b: [n, k, ...], paired."""
    each, together = relative_effect(a, b, error), relative_effect(a, b, error / a.shape[1])
    return Interval(each.value.max(axis=0), together.low.max(axis=0), each.high.max(axis=0))


def trend(values: np.ndarray, error: float = ERROR) -> Interval:
    """The smallest step between neighbouring points, [n, k, ...]: positive if the mean rises with each of them."""
    return every_point(np.diff(np.asarray(values, float), axis=1), error)
