"""The paper's claims, judged: each a pure function of results that gives an effect with a 95 % interval and a verdict.

A claim is a statement "effect <= limit" or "effect >= limit". With the whole interval on the claim's side of the limit
it is supported, with the whole interval on the other side contradicted, and otherwise undecided at this number of
seeds. The interval is a percentile bootstrap over seeds with a fixed generator. A gap is measured on the exact long-run
reward of the policy without exploration: (optimum - reward) / |optimum|.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr

TOLERANCE = 0.05
"""A policy within this gap of the optimum counts as having reached it."""
_RESAMPLES = 10_000


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


def bootstrap_mean(values: np.ndarray, seed: int = 0) -> tuple[float, float, float]:
    """Mean over seeds [seeds] and its 95 % percentile bootstrap interval; NaN for one seed."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return float(values.mean()), float("nan"), float("nan")
    draws = np.random.default_rng(seed).integers(len(values), size=(_RESAMPLES, len(values)))
    low, high = np.quantile(values[draws].mean(axis=1), [0.025, 0.975])
    return float(values.mean()), float(low), float(high)


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
    claim: str, statement: str, effect: str, values: np.ndarray, relation: str, limit: float, figure: str
) -> Judgement:
    """Judges "mean over seeds of `values` [seeds] <= limit", or >=."""
    mean, low, high = bootstrap_mean(values)
    verdict = verdict_of(low, high, relation, limit)
    return Judgement(claim, statement, effect, relation, limit, mean, low, high, verdict, len(values), figure)


def gaps(data: xr.Dataset, algorithm: str) -> np.ndarray:
    """Relative gap to the optimum of the policy after each episode at the first point, [seeds, episodes]."""
    optimum = float(data["optimum_reward"].isel(point=0))
    reward = data["policy_reward"].sel(algorithm=algorithm).isel(point=0).transpose("seed", "episode").values
    return (optimum - reward) / abs(optimum)


def _mean(episodes: np.ndarray) -> np.ndarray:
    """Mean over the episodes of [seeds, episodes]; NaN where there are none."""
    return episodes.mean(axis=1) if episodes.shape[1] else np.full(len(episodes), np.nan)


def mean_reward(data: xr.Dataset, algorithm: str) -> np.ndarray:
    """Mean simulated reward per slot over all episodes at the first point, [seeds]."""
    return data["reward"].sel(algorithm=algorithm).isel(point=0).mean("episode").values


def source_claims(data: xr.Dataset, tolerance: float = TOLERANCE) -> list[Judgement]:
    """C1 and the source's part of C2, from the results of Fig. 5(a).

    The statements are about what happens after episodes 200 and 400; a shorter run leaves them undecided, without a
    value. Another `tolerance` shows how far verdicts depend on it.
    """
    ddqn, q_learning = gaps(data, "ddqn"), gaps(data, "q_learning")
    below = mean_reward(data, "round_robin") - np.minimum(mean_reward(data, "ddqn"), mean_reward(data, "q_learning"))
    return [
        judge(
            "C1 (reached)",
            "DDQN has reached the optimal policy after about 200 episodes",
            "mean gap in episodes 201 to 400",
            _mean(ddqn[:, 200:400]),
            "<=",
            tolerance,
            "5a",
        ),
        judge(
            "C1 (stable)",
            "DDQN is stable at the optimal policy after 400 episodes",
            "mean gap after episode 400",
            _mean(ddqn[:, 400:]),
            "<=",
            tolerance,
            "5a",
        ),
        judge(
            "C2 (Q-learning)",
            "Q-learning does not reach the optimal policy in the source",
            "mean gap after episode 400",
            _mean(q_learning[:, 400:]),
            ">=",
            tolerance,
            "5a",
        ),
        judge(
            "C2 (Round Robin)",
            "Round Robin is the lower bound in the source",
            "reward per slot minus that of the worse learner",
            below,
            "<=",
            0.0,
            "5a",
        ),
    ]


def as_json(judgements: list[Judgement]) -> list[dict]:
    """Plain dictionaries; an interval that does not exist is null."""
    plain = [asdict(judgement) for judgement in judgements]
    return [{key: None if value != value else value for key, value in row.items()} for row in plain]
