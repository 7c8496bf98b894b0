"""How a claim of the paper is judged: an effect with a 95 % interval over seeds, and a verdict.

A claim is a statement "effect <= limit" or "effect >= limit". With the whole interval on the claim's side of the limit
it is supported, with the whole interval on the other side contradicted, and otherwise undecided at this number of
seeds. The interval is a symmetric bootstrap over seeds with a fixed generator
(`paper_figs.analysis.statistics.bootstrap`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr

from paper_figs.analysis.statistics import Statistic, bootstrap


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
    statistic: Statistic = lambda means: means,
    extreme: Callable[[np.ndarray], np.floating] | None = None,
    least: float = -np.inf,
) -> Judgement:
    """Judges "effect <= limit", or >=, where the effect is a statistic of means over seeds of `values` [seeds, ...].

    `extreme`, np.min or np.max, says which of several effects the claim is about. No effect is below `least`, and
    neither are intervals.
    """
    value, low, high = bootstrap(values, statistic, extreme)
    low = float(np.maximum(low, least))  # of NaN and a number, NaN
    verdict = verdict_of(low, high, relation, limit)
    return Judgement(claim, statement, effect, relation, limit, value, low, high, verdict, len(values), figure)


def first(data: xr.Dataset, metric: str, algorithm: str, episodes: int | None = None) -> np.ndarray:
    """Mean of a simulated metric over the first `episodes` (all if None) at each point, [seeds, points]."""
    values = data[metric].sel(algorithm=algorithm).isel(episode=slice(episodes))
    return values.mean("episode").transpose("seed", "point").values


def as_json(judgements: list[Judgement]) -> list[dict]:
    """Plain dictionaries; an interval that does not exist is null."""
    plain = [asdict(judgement) for judgement in judgements]
    return [{key: None if value != value else value for key, value in row.items()} for row in plain]
