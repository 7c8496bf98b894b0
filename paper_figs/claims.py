"""How a claim of the paper is judged: an effect with a 95 % interval over seeds, and a verdict.

A claim is a statement "effect <= limit" or "effect >= limit". With the whole interval on the claim's side of the limit
it is supported, with the whole interval on the other side contradicted, and otherwise undecided at this number of
seeds. The interval is a percentile bootstrap over seeds with a fixed generator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr

from paper_figs.statistics import bootstrap

TOLERANCE = 0.05
"""A policy within this gap of the optimum counts as having reached it."""
WINDOW = 20
"""Episodes over which the gap must stay within the tolerance on average."""


@dataclass(frozen=True)
class Judgement:
    """The verdict on one statement of the paper."""

    claim: str
    """Number in the list of claims, with the part that is judged."""
    statement: str
    effect: str
    """What is measured."""
    relation: str
    """<= or >=: how the claim holds the effect against the limit."""
    limit: float
    value: float
    ci_low: float
    ci_high: float
    verdict: str
    """supported, contradicted, or undecided."""
    n_seeds: int
    figure: str
    """The figure that the verdict rests on."""
    n_diverged: int = 0
    """Agents in that figure's results whose values diverged; they count like all others."""


def verdict_of(low: float, high: float, relation: str, limit: float) -> str:
    """Verdict on "effect <= limit" or "effect >= limit" from the effect's interval."""
    if relation == ">=":
        low, high, limit = -high, -low, -limit
    if high <= limit:
        return "supported"
    if low > limit:
        return "contradicted"
    return "undecided"


def judge(
    claim: str,
    statement: str,
    effect: str,
    values: np.ndarray,
    relation: str,
    limit: float,
    figure: str,
    statistic: Callable[[np.ndarray], np.ndarray] = lambda means: means,
) -> Judgement:
    """Judges "effect <= limit", or >=, where the effect is a statistic of means over seeds of `values` [seeds, ...]."""
    value, low, high = bootstrap(values, statistic)
    verdict = verdict_of(low, high, relation, limit)
    return Judgement(claim, statement, effect, relation, limit, value, low, high, verdict, len(values), figure)


def gaps(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """Relative gap to the optimum of the policy after each episode, [seeds, episodes].

    It is (optimum - reward) / |optimum| with the exact long-run reward of the policy without exploration.
    """
    optimum = float(data["optimum_reward"].isel(point=point))
    reward = data["policy_reward"].sel(algorithm=algorithm).isel(point=point).transpose("seed", "episode").values
    return (optimum - reward) / abs(optimum)


def convergence_episode(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """First episode from which the gap averages at most TOLERANCE over WINDOW episodes, [seeds].

    Where that never happens it is the number of episodes, which flatters learners that do not converge.
    """
    gap = gaps(data, algorithm, point)
    episodes = gap.shape[1]
    if episodes < WINDOW:
        return np.full(len(gap), np.nan)
    means = np.lib.stride_tricks.sliding_window_view(gap, WINDOW, axis=1).mean(axis=2)
    reached = means <= TOLERANCE
    return np.where(reached.any(axis=1), reached.argmax(axis=1) + 1, episodes).astype(float)


def first(data: xr.Dataset, metric: str, algorithm: str, episodes: int | None = None) -> np.ndarray:
    """Mean of a simulated metric over the first `episodes` (all if None) at each point, [seeds, points]."""
    values = data[metric].sel(algorithm=algorithm).isel(episode=slice(episodes))
    return values.mean("episode").transpose("seed", "point").values


def as_json(judgements: list[Judgement]) -> list[dict]:
    """Plain dictionaries; an interval that does not exist is null."""
    plain = [asdict(judgement) for judgement in judgements]
    return [{key: None if value != value else value for key, value in row.items()} for row in plain]
