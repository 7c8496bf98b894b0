"""How many seeds a study needs: whether fewer of them would have ranked the learners differently."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pandas as pd
import xarray as xr
from scipy import stats

from paper_figs.analysis.scores import mean_over_episodes
from paper_figs.analysis.statistics import CONFIDENCE

_STUDIES = 10_000  # drawn per size


def misranking(scores: np.ndarray, n: int, seed: int = 0) -> float:
    """Probability that the means of n seeds order the learners differently than those of all seeds.

    Studies are drawn from the seeds without replacement, and all learners of a study have the same seeds. Learners that
    tie in a study have any order there, each as likely: two that differ in the whole are wrong in one half of it.
    Learners that tie in the whole, such as those that never converge, have no order that could be wrong.

    Args:
      scores: [learners, seeds], n at most the number of seeds.
      n: seeds of a study.
      seed: of the generator.
    """
    generator = np.random.default_rng(seed)
    drawn = generator.random((_STUDIES, scores.shape[1])).argpartition(n - 1, axis=1)[:, :n]
    whole, studies = scores.mean(axis=1), scores[:, drawn].mean(axis=2)
    listings = map(list, itertools.permutations(range(len(scores))))
    return float(np.mean([_wrong_share(studies[listing], whole[listing]) for listing in listings]))


def _wrong_share(studies: np.ndarray, whole: np.ndarray) -> float:
    """Share of studies, [learners, studies], that order learners differently than the whole; ties go by the listing."""
    in_order = whole[np.argsort(studies, axis=0, kind="stable")]
    return float((np.diff(in_order, axis=0) < 0).any(axis=0).mean())


def seeds_needed(differences: np.ndarray) -> float:
    """Seeds with which the mean of paired differences [seeds] has its sign with a probability of 95 %.

    By the normal law of means, n = (z sd / mean)^2 at the one-sided quantile z; infinite for a mean of zero, and 1 for
    differences that are the same for all seeds.
    """
    mean, deviation = differences.mean(), differences.std(ddof=1) if len(differences) > 1 else math.nan
    if mean == 0:
        return math.inf
    return float(np.maximum(np.ceil((stats.norm.ppf(CONFIDENCE) * deviation / mean) ** 2), 1.0))


def needed_table(data: xr.Dataset, figure: str) -> pd.DataFrame:
    """Seeds needed to rank each two learners at each point of a figure, by means over all episodes."""
    rows = []
    for metric in ("reward", "throughput", "miss_detection"):
        of = {name: mean_over_episodes(data, metric, name) for name in data["algorithm"].values}
        for a, b in itertools.combinations(of, 2):
            for point in range(data.sizes["point"]):
                differences = of[a][:, point] - of[b][:, point]
                needed = seeds_needed(differences)
                rows.append((figure, metric, point, a, b, differences.mean(), len(differences), needed))
    columns = ["figure", "metric", "point", "algorithm", "other", "mean_difference", "n_seeds", "seeds_needed"]
    return pd.DataFrame(rows, columns=columns)
