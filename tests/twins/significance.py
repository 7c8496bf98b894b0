"""Tests of observed frequencies and means against exact ones.

Seeds are fixed, so a result does not change from run to run. Every p-value must exceed ALPHA. Fewer than 200 of them
are looked at in all tests together, so a correct program fails with a chance below 1e-4.
"""

from typing import Any

import numpy as np
from scipy import stats

ALPHA = 1e-4 / 200
_FEWEST = 5.0  # expected count below which the chi-square law is a poor approximation


def p_of(result: Any) -> float:
    """The p-value of a result of SciPy's, whose types do not name it."""
    return float(result.pvalue)


def _pool_rare(observed, expected):
    """Takes cells that are expected rarely together, and with the largest one if they stay rare."""
    rare = expected < _FEWEST
    if not rare.any() or rare.all():
        return (observed, expected) if not rare.any() else (observed.sum(keepdims=True), expected.sum(keepdims=True))
    o, e = observed[~rare], expected[~rare]
    if expected[rare].sum() >= _FEWEST:
        return np.append(o, observed[rare].sum()), np.append(e, expected[rare].sum())
    largest = e.argmax()
    o[largest] += observed[rare].sum()
    e[largest] += expected[rare].sum()
    return o, e


def chi_square(observed, probabilities):
    """p-value of counts [R, C] against known probabilities [R, C] within each row."""
    observed, probabilities = np.atleast_2d(observed).astype(float), np.atleast_2d(probabilities)
    expected = observed.sum(axis=1, keepdims=True) * probabilities
    assert (observed[expected == 0] == 0).all(), "something impossible was observed"
    statistic, freedom = 0.0, 0
    for row in zip(observed, expected, strict=True):
        o, e = _pool_rare(*row)
        if len(e) > 1:
            statistic += ((o - e) ** 2 / e).sum()
            freedom += len(e) - 1
    assert freedom > 0, "too few observations to test anything"
    return stats.chi2.sf(statistic, freedom)


def same_law(first, second):
    """p-value of two counts [C] having one distribution."""
    table = np.stack([first, second])
    common = table.sum(axis=0) >= 2 * _FEWEST
    pooled = np.column_stack([table[:, common], table[:, ~common].sum(axis=1)])
    return p_of(stats.chi2_contingency(pooled[:, pooled.sum(axis=0) > 0]))


def mean_differs(samples, expected):
    """p-value of independent samples having the mean `expected`."""
    samples = np.asarray(samples, float)
    return p_of(stats.ttest_1samp(samples, expected))


def means_differ(first, second):
    """p-value of two sets of independent samples having one mean."""
    return p_of(stats.ttest_ind(first, second, equal_var=False))


def z(score):
    """p-value of a score that is standard normal if all is right."""
    return 2 * stats.norm.sf(abs(score))
