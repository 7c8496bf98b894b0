"""Which inputs of a sample decide an output: Sobol' indices of a surrogate, with intervals and its own error.

Outputs are noisy and a sample has a point for each combination of inputs, so the indices are those of a surrogate, of
the two kinds below the one that predicts left-out points better. Ten fits, each without a tenth of the points, give
both the cross-validated error and the jackknife's interval (Efron and Stein 1981), to which the error of the Monte
Carlo integrals is added.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

_FOLDS = 10
_INTEGRAL = 1024  # points of the integrals, a power of two
_RESAMPLES = 100  # of these points, for the error of the integrals
_LEVELS = 12  # most values of an input that is taken as a list of levels
_MOST_FOR_GAUSSIAN = 1500  # points, whose cube a fit takes
_MOST_FOR_LENGTHS = 256  # points that the process's lengths are chosen by, which takes hundreds of fits
LEAST_POINTS = 3 * _FOLDS
"""Points below which there are no indices."""


class Sensitivity(NamedTuple):
    """What decides an output."""

    table: pd.DataFrame
    """A row per input: `first` and `total` order indices with `_low` and `_high` limits of 95 %."""
    pairs: pd.DataFrame
    """A row per pair of the three inputs with the largest total: `interaction`, the part of the variance that only both
    together explain, with limits."""
    error: float
    """Cross-validated squared error of the surrogate, over the output's variance: 0 is perfect, 1 says nothing."""
    surrogate: str
    """Which kind it is."""


class _Estimate(NamedTuple):
    first: np.ndarray
    total: np.ndarray
    pairs: np.ndarray


def sensitivity(
    inputs: pd.DataFrame, output: np.ndarray, seed: int = 0, blocks: np.ndarray | None = None
) -> Sensitivity:
    """Sobol' indices of an output over a sample of independent inputs.

    Args:
      inputs: a row per point and a column per input; each is taken by its rank, so scales do not matter.
      output: [points].
      seed: of the surrogate and of the integrals.
      blocks: number of each point's block [points], if some inputs are the same within blocks (a split-plot design):
        a block's points are then left out together, if there are several blocks.

    Raises:
      ValueError: for fewer than `LEAST_POINTS` points.
    """
    if len(inputs) < LEAST_POINTS:
        raise ValueError(f"points: {len(inputs)}; allowed: at least {LEAST_POINTS} for sensitivity indices")
    ranks = inputs.rank(pct=True, method="average").to_numpy() - 0.5 / len(inputs)
    scale = float(np.std(output))
    if scale == 0:
        return _constant(list(inputs.columns))
    y = (output - output.mean()) / scale
    folds = _folds(np.arange(len(y)) if blocks is None else blocks, seed)
    wholes = _surrogates(ranks, y, seed)
    fitted = {kind: _cross_validated(whole, ranks, y, folds) for kind, whole in wholes.items()}
    kind = min(fitted, key=lambda name: fitted[name][1])
    (models, error), whole = fitted[kind], wholes[kind]
    design = _Design(ranks, seed)
    outputs = design.outputs(whole, [])
    pairs = list(itertools.combinations(_largest(_estimate(outputs, []).total), 2))
    outputs = np.concatenate([outputs, design.mixed(whole, pairs)])
    full, error_of_integral = _estimate(outputs, pairs), _error_of_integral(outputs, pairs, seed)
    without = [_estimate(design.outputs(model, pairs), pairs) for model in models]
    limits = {
        name: _interval(getattr(full, name), [getattr(w, name) for w in without], getattr(error_of_integral, name))
        for name in _Estimate._fields
    }
    table = pd.DataFrame({"input": list(inputs.columns)})
    for name in ("first", "total"):
        table[name], table[f"{name}_low"], table[f"{name}_high"] = limits[name]
    names = [(str(inputs.columns[a]), str(inputs.columns[b])) for a, b in pairs]
    of_pairs = pd.DataFrame(names, columns=["input", "other"])
    of_pairs["interaction"], of_pairs["interaction_low"], of_pairs["interaction_high"] = limits["pairs"]
    return Sensitivity(table, of_pairs, error, kind)


def _folds(blocks: np.ndarray, seed: int) -> np.ndarray:
    """Number of each point's fold; points of one block share theirs, unless there is no other block to leave in."""
    known, places = np.unique(blocks, return_inverse=True)
    if len(known) == 1:
        return _folds(np.arange(len(blocks)), seed)
    return (np.random.default_rng(seed).permutation(len(known)) % _FOLDS)[places]


def _constant(columns: list[str]) -> Sensitivity:
    zero = dict.fromkeys(("first", "first_low", "first_high", "total", "total_low", "total_high"), 0.0)
    table = pd.DataFrame([{"input": name} | zero for name in columns])
    empty = pd.DataFrame(columns=["input", "other", "interaction", "interaction_low", "interaction_high"])
    return Sensitivity(table, empty, 0.0, "constant")


def _largest(total: np.ndarray) -> list[int]:
    return sorted(np.argsort(total)[::-1][:3].tolist())


def _surrogates(x: np.ndarray, y: np.ndarray, seed: int) -> dict[str, Any]:
    """Fitted regressors by kind: trees, which find steps, and, up to some points, a Gaussian process."""
    from sklearn.ensemble import ExtraTreesRegressor
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    found: dict[str, Any] = {"trees": ExtraTreesRegressor(100, min_samples_leaf=2, random_state=seed).fit(x, y)}
    if len(y) <= _MOST_FOR_GAUSSIAN:
        of_inputs = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(np.ones(x.shape[1]), (0.05, 1e3))  # pyright: ignore[reportArgumentType]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its limit: an input that does not matter
            some = np.random.default_rng(seed).permutation(len(y))[:_MOST_FOR_LENGTHS]
            chosen = GaussianProcessRegressor(of_inputs + WhiteKernel(0.1, (1e-6, 10.0))).fit(x[some], y[some])
        found["gaussian process"] = GaussianProcessRegressor(chosen.kernel_, optimizer=None).fit(x, y)  # pyright: ignore[reportArgumentType]
    return found


def _cross_validated(whole: Any, x: np.ndarray, y: np.ndarray, folds: np.ndarray) -> tuple[list[Any], float]:
    """Fits without each fold, and their squared error on it over the variance."""
    from sklearn.base import clone

    models: list[Any] = [clone(whole).fit(x[folds != fold], y[folds != fold]) for fold in np.unique(folds)]  # pyright: ignore
    squares = [
        np.square(model.predict(x[folds == fold]) - y[folds == fold])
        for fold, model in zip(np.unique(folds), models, strict=True)
    ]
    return models, float(np.concatenate(squares).mean() / y.var())


def _interval(value: np.ndarray, without: list[np.ndarray], of_integral: np.ndarray) -> np.ndarray:
    """Value and limits [3, n], from the values without each fold and the standard error of the integrals.

    An index is a share; estimates outside of 0 to 1 become the nearest one.
    """
    held, number = np.stack(without), len(without)
    spread = (number - 1) / number * np.square(held - held.mean(axis=0)).sum(axis=0)
    half = stats.t.ppf(0.975, number - 1) * np.sqrt(spread + np.square(of_integral))
    return np.clip([value, value - half, value + half], 0.0, 1.0)


class _Design:
    """Pick-freeze estimates (Saltelli et al. 2010, Jansen 1999), with the same points for every surrogate."""

    def __init__(self, ranks: np.ndarray, seed: int):
        dimensions = ranks.shape[1]
        unit = stats.qmc.Sobol(2 * dimensions, rng=np.random.default_rng(seed)).random(_INTEGRAL)
        quantiles = np.stack([_on_levels(unit[:, i], ranks[:, i % dimensions]) for i in range(2 * dimensions)], axis=1)
        self._a, self._b = quantiles[:, :dimensions], quantiles[:, dimensions:]

    def outputs(self, model: Any, pairs: list[tuple[int, int]]) -> np.ndarray:
        """Of A, of B, of B with each input from A, and of B with each pair from A, [2 + inputs + pairs, points]."""
        single = [(i,) for i in range(self._a.shape[1])]
        ends = model.predict(np.concatenate([self._a, self._b])).reshape(2, -1)
        return np.concatenate([ends, self.mixed(model, single + pairs)])

    def mixed(self, model: Any, sets: Sequence[tuple[int, ...]]) -> np.ndarray:
        """Of B with each set of inputs from A, [sets, points]."""
        points = []
        for columns in sets:
            other = self._b.copy()
            other[:, columns] = self._a[:, columns]
            points.append(other)
        return model.predict(np.concatenate(points)).reshape(len(sets), -1)


def _error_of_integral(outputs: np.ndarray, pairs: list[tuple[int, int]], seed: int) -> _Estimate:
    """Standard errors of the integrals, by resampling their points."""
    rng = np.random.default_rng(seed)
    found = [_estimate(outputs[:, rng.integers(_INTEGRAL, size=_INTEGRAL)], pairs) for _ in range(_RESAMPLES)]
    return _Estimate(*(np.std([getattr(f, name) for f in found], axis=0) for name in _Estimate._fields))


def _estimate(outputs: np.ndarray, pairs: list[tuple[int, int]]) -> _Estimate:
    a, b, *mixed = outputs
    variance = np.concatenate([a, b]).var()
    if variance < 1e-12:
        return _Estimate(*(np.zeros(n) for n in (len(mixed) - len(pairs), len(mixed) - len(pairs), len(pairs))))
    single, double = mixed[: len(mixed) - len(pairs)], mixed[len(mixed) - len(pairs) :]
    first = np.array([1.0 - np.square(a - m).mean() / (2 * variance) for m in single])
    total = np.array([np.square(b - m).mean() / (2 * variance) for m in single])
    closed = [1.0 - np.square(a - m).mean() / (2 * variance) for m in double]
    both = np.array([c - first[i] - first[j] for c, (i, j) in zip(closed, pairs, strict=True)])
    return _Estimate(first, total, both)


def _on_levels(unit: np.ndarray, ranks: np.ndarray) -> np.ndarray:
    """Numbers in [0, 1) as ranks of an input: of one of its levels if it has few."""
    levels, counts = np.unique(ranks, return_counts=True)
    if len(levels) > _LEVELS or math.isclose(len(levels), len(ranks)):
        return unit
    return levels[np.searchsorted(np.cumsum(counts) / len(ranks), unit, side="right").clip(max=len(levels) - 1)]
