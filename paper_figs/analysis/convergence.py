"""How soon a learner's policy is good: gaps to the optimum, convergence episodes, and runs that never get there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from paper_figs.analysis.statistics import Interval, Mean, bootstrap, proportion

TOLERANCE = 0.05
"""A policy within this gap of the optimum counts as having reached it."""
WINDOW = 20
"""Episodes over which the gap must stay within the tolerance on average."""


def gaps(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """Relative gap to the optimum of the policy after each episode, [seeds, episodes].

    It is (optimum - reward) / |optimum| with the exact long-run reward of the policy without exploration.
    """
    optimum = float(data["optimum_reward"].isel(point=point))
    reward = data["policy_reward"].sel(algorithm=algorithm).isel(point=point).transpose("seed", "episode").values
    return (optimum - reward) / abs(optimum)


def _within(gap: np.ndarray) -> np.ndarray:
    """Whether the gap averages at most TOLERANCE over the WINDOW episodes from each one, [seeds, windows]."""
    return np.lib.stride_tricks.sliding_window_view(gap, WINDOW, axis=1).mean(axis=2) <= TOLERANCE


def convergence_episode(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """First episode from which the gap averages at most TOLERANCE over WINDOW episodes, [seeds].

    Where that never happens it is the number of episodes, so that the mean is the restricted mean.
    """
    gap = gaps(data, algorithm, point)
    episodes = gap.shape[1]
    if episodes < WINDOW:
        return np.full(len(gap), np.nan)
    within = _within(gap)
    return np.where(within.any(axis=1), within.argmax(axis=1) + 1, episodes).astype(float)


class SampleComplexity(NamedTuple):
    """Episodes until a learner has converged, over seeds. Runs that never do are censored at their end.

    All of them are censored there, so Kaplan and Meier's estimate is the share of runs itself.
    """

    episodes: np.ndarray
    """[n] episodes in which runs converge, ascending."""
    share: Mean
    """[n] share of runs that have converged by then, with pointwise 95 % limits."""
    reached: Interval
    """Share of runs that converge at all."""
    median: float
    """Episodes by which half of the runs have converged; NaN if fewer than half ever do."""
    restricted_mean: Interval
    """Mean of the convergence episode, or of the length of the run where there is none."""


def sample_complexity(data: xr.Dataset, algorithm: str, point: int = 0) -> SampleComplexity:
    """What it takes to get within TOLERANCE of the optimum, in runs of at least WINDOW episodes."""
    converged = convergence_episode(data, algorithm, point)
    ever = np.any(_within(gaps(data, algorithm, point)), axis=1)
    episodes = np.unique(converged[ever])
    share = proportion((converged[ever] <= episodes[:, None]).sum(axis=1), len(converged))
    half = share.mean >= 0.5
    return SampleComplexity(
        episodes=episodes,
        share=share,
        reached=Interval(*(float(limit) for limit in proportion(ever.sum(), len(converged))[:3])),
        median=float(episodes[half.argmax()]) if half.any() else float("nan"),
        restricted_mean=bootstrap(converged),
    )
