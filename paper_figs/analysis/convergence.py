"""How soon a learner is good and stays so: gaps to the optimum, and the episodes in which runs converge.

A run converges in the first episode whose window of the next episodes is within the tolerance, and after which nearly
all windows are. A run that never does is censored at its end: its episode is infinite, and no number.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

from paper_figs.analysis.censored import typical
from paper_figs.analysis.intervals import Interval, proportion_effect

TOLERANCE = 0.05
"""A gap up to this share of the optimum counts as having reached it."""
WINDOW = 20
"""Episodes over which a gap is averaged."""
STAY = 0.95
"""Share of all later windows that must be within the tolerance."""


def gaps(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """Relative gap to the optimum of the policy after each episode, [seeds, episodes].

    It is (optimum - reward) / |optimum| with the exact long-run reward of the policy without exploration.
    """
    optimum = float(data["optimum_reward"].isel(point=point))
    return (optimum - _episodes(data, "policy_reward", algorithm, point)) / abs(optimum)


def curve_gaps(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """Relative gap of the curve that the paper shows, [seeds, episodes].

    It is (explored - reward) / |optimum| with the simulated reward, exploration included, and the exact reward of the
    optimal policy with the same exploration.
    """
    here = data.isel(point=point)
    explored = np.asarray(here["explored_reward"].values, float)
    return (explored - _episodes(data, "reward", algorithm, point)) / abs(float(here["optimum_reward"]))


def _episodes(data: xr.Dataset, metric: str, algorithm: str, point: int) -> np.ndarray:
    values = data[metric].sel(algorithm=algorithm).isel(point=point).transpose("seed", "episode")
    return values.values.astype(float)


def window_means(values: np.ndarray) -> np.ndarray:
    """Means over WINDOW consecutive episodes, of [seeds, episodes] to [seeds, windows]; no window in shorter runs."""
    if values.shape[1] < WINDOW:
        return np.empty((len(values), 0))
    return np.lib.stride_tricks.sliding_window_view(values, WINDOW, axis=1).mean(axis=2)


def arrivals(gap: np.ndarray, tolerance: float | np.ndarray = TOLERANCE) -> np.ndarray:
    """First episode from which the gap is within the tolerance, and stays there, [seeds]; infinite where none is.

    The window from that episode on is within the tolerance on average, and so are 95 % of all that follow. At least
    WINDOW of them must follow: a run that arrives with its last episodes has not shown that it stays.

    Args:
      gap: [seeds, episodes].
      tolerance: one, or [seeds] of them.
    """
    within = window_means(gap) <= np.reshape(tolerance, (-1, 1))
    ahead = np.arange(within.shape[1], 0, -1)
    staying = np.cumsum(within[:, ::-1], axis=1)[:, ::-1] / ahead
    found = within & (staying >= STAY) & (ahead > WINDOW)
    if not found.size:
        return np.full(len(gap), np.inf)
    return np.where(found.any(axis=1), found.argmax(axis=1) + 1.0, np.inf)


def chance_of_a_window(gap: np.ndarray) -> np.ndarray:
    """What chance alone adds to a window's mean at most in 95 % of windows, [seeds].

    Simulated episodes scatter. The variance is half the mean square of the difference from one episode to the next, in
    the second half of the run, where the policy moves little (von Neumann et al. 1941).
    """
    late = gap[:, gap.shape[1] // 2 :]
    if late.shape[1] < 2:
        return np.zeros(len(gap))
    deviation = np.sqrt((np.diff(late, axis=1) ** 2).mean(axis=1) / 2)
    return stats.norm.ppf(STAY) * deviation / np.sqrt(WINDOW)


def convergence_episode(
    data: xr.Dataset, algorithm: str, point: int = 0, *, curve: bool = False, tolerance: float = TOLERANCE
) -> np.ndarray:
    """Episode in which each run converges, [seeds]; infinite where it never does.

    Args:
      data: results of a sweep.
      algorithm: the learner.
      point: number of the point.
      curve: whether to judge the simulated curve instead of the exact policy. A window of the curve may exceed the
        tolerance by what chance explains: else the optimal policy itself would not stay within it.
      tolerance: share of the optimum.
    """
    if not curve:
        return arrivals(gaps(data, algorithm, point), tolerance)
    gap = curve_gaps(data, algorithm, point)
    return arrivals(gap, tolerance + chance_of_a_window(gap))


def episodes_before(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """Episodes of each run before it converges, [seeds]; all of its episodes where it never does. Runs rank by it."""
    return np.minimum(convergence_episode(data, algorithm, point) - 1, data.sizes["episode"])


class SampleComplexity(NamedTuple):
    """Episodes until a learner has converged, over seeds. Runs that never do are censored at their end.

    All of them are censored there, so Kaplan and Meier's estimate is the share of runs itself.
    """

    episodes: np.ndarray
    """[n] episodes in which runs converge, ascending."""
    share: Interval
    """[n] share of runs that have converged by then, with pointwise 95 % limits."""
    reached: Interval
    """Share of runs that converge at all."""
    median: Interval
    """Episode by which half of the runs have converged; infinite where fewer than half do."""


def sample_complexity(data: xr.Dataset, algorithm: str, point: int = 0) -> SampleComplexity:
    """What it takes to get within TOLERANCE of the optimum, and to stay there."""
    converged = convergence_episode(data, algorithm, point)
    ever = np.isfinite(converged)
    episodes = np.unique(converged[ever])
    return SampleComplexity(
        episodes=episodes,
        share=proportion_effect((converged <= episodes[:, None]).sum(axis=1), len(converged)),
        reached=proportion_effect(int(ever.sum()), len(converged)),
        median=typical(converged),
    )
