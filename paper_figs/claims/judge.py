"""How a claim is judged: an effect with its 95 % interval over seeds, a verdict, and whether a difference matters.

A claim says that an effect is above a limit, below it, or between two. With its whole interval strictly on the claim's
side it is supported, strictly on the other side contradicted, and else undecided at this number of seeds. A tie is on
neither side. Each limit of an interval has an error of 2.5 %, and so have both verdicts at the edge of the claim.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paper_figs.analysis import divergence
from paper_figs.analysis.intervals import Interval
from paper_figs.claims.effects import Effect, LateGap, Measured
from paper_figs.claims.results import Results, Rules, Unknown

SUPPORTED, CONTRADICTED, UNDECIDED = VERDICTS = ("supported", "contradicted", "undecided")
Limit = float | tuple[float, float]
"""What an effect is held against: a number for ">" and "<", two for "within"."""


@dataclass(frozen=True)
class Claim:
    """One statement of the paper, and the question that it asks of results."""

    claim: str
    """Number in the list of claims, with the part that is judged."""
    statement: str
    figure: str
    """Number of the figure, with its panel: "5a"."""
    where: str
    """Section of the paper."""
    effect: str
    """What is measured, in words."""
    measure: Effect
    relation: str
    """">", "<" or "within"."""
    limit: Limit
    unit: str

    @property
    def sweep(self) -> str:
        """Name of the figure's results: panels of Fig. 5 have their own."""
        number, panel = self.figure[0], self.figure[1:]
        return f"fig{number}{panel}" if number == "5" else f"fig{number}"


@dataclass(frozen=True)
class Judgement:
    """The verdict on one claim."""

    claim: str
    statement: str
    figure: str
    where: str
    effect: str
    unit: str
    relation: str
    limit: Limit
    value: float
    """NaN where the results can't say; infinite for the episode of runs that never converge."""
    ci_low: float
    ci_high: float
    """Limits of the interval, each wrong with a chance of 2.5 %; NaN where there are too few seeds."""
    verdict: str
    """supported, contradicted, or undecided."""
    reason: str
    """Why it is undecided; else empty."""
    negligible: bool | None
    """Whether the learners differ by less than `delta`, interval included; None where nothing is compared or known."""
    delta: float | None
    """Differences up to this are negligible: a share of the reward's optimum or of the other's throughput, a
    probability of miss detection, or episodes."""
    held: str
    """At how many points the claim is supported, where it is about all of them."""
    n_seeds: int
    n_diverged: int = 0
    """Agents in the figure's results whose values diverged; they count like all others."""


def verdicts(low: Any, high: Any, relation: str, limit: Limit) -> np.ndarray:
    """Verdicts from the limits of intervals, which may be arrays."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    if relation == "within":
        least, most = _two(limit)
        supported, contradicted = (low > least) & (high < most), (high < least) | (low > most)
    elif relation == ">":
        supported, contradicted = low > limit, high < limit
    elif relation == "<":
        supported, contradicted = high < limit, low > limit
    else:
        raise ValueError(f"relation: {relation!r}; allowed: '>', '<' or 'within'")
    return np.select([supported, contradicted], [SUPPORTED, CONTRADICTED], UNDECIDED)


def is_on_its_side(value: float, relation: str, limit: Limit) -> bool:
    """Whether an estimate, whatever its interval, is on the claim's side."""
    return str(verdicts(value, value, relation, limit)) == SUPPORTED


def shortfall(values: np.ndarray, relation: str, limit: Limit) -> np.ndarray:
    """How far estimates are from the claim's side; at most 0 where they are on it or at its edge."""
    if relation == "within":
        least, most = _two(limit)
        return np.maximum(least - values, values - most)
    (edge,) = np.ravel(limit)
    return edge - values if relation == ">" else values - edge


def _two(limit: Limit) -> tuple[float, float]:
    if not isinstance(limit, Sequence) or len(limit) != 2:
        raise ValueError(f"limit: {limit!r}; allowed: two numbers for 'within'")
    return limit[0], limit[1]


def negligible(differences: Sequence[Interval], delta: float) -> bool | None:
    """Whether all differences lie between -delta and delta with their whole intervals; None where there are none.

    Each limit needs no correction, since all must hold (two one-sided tests, Schuirmann 1987; intersection-union).
    """
    if not differences or any(np.isnan([d.low, d.high]).any() for d in differences):
        return None
    return all(-delta < d.low and d.high < delta for d in differences)


def judge(claim: Claim, results: Results) -> Judgement:
    """The verdict on a claim from the results of its figure."""
    agents = [str(name) for name in results.data["algorithm"].values]
    diverged = sum(divergence.count(results.data, name) for name in agents)
    return dataclasses.replace(_judged(claim, results), n_diverged=diverged)


def _judged(claim: Claim, results: Results) -> Judgement:
    if isinstance(claim.measure, LateGap):  # reaching the optimum is what these rules count as optimal
        claim = dataclasses.replace(claim, limit=results.rules.tolerance)
    try:
        measured = claim.measure(results)
    except Unknown as unknown:
        return _unknown(claim, str(unknown), results.n_seeds)
    value, low, high = (float(number) for number in measured.interval)
    delta = getattr(results.rules.delta, measured.quantity) if measured.quantity else None
    least = results.rules.least_seeds
    if results.n_seeds < least:
        no_number = f"{results.n_seeds} seeds, {least} needed for a verdict"
        return dataclasses.replace(_unknown(claim, no_number, results.n_seeds), value=value, delta=delta)
    return _decided(claim, measured, Interval(value, low, high), delta, results.n_seeds)


def _decided(claim: Claim, measured: Measured, interval: Interval, delta: float | None, n_seeds: int) -> Judgement:
    verdict = str(verdicts(interval.low, interval.high, claim.relation, claim.limit))
    return Judgement(
        **_of(claim),
        value=interval.value,
        ci_low=interval.low,
        ci_high=interval.high,
        verdict=verdict,
        reason=f"the interval of {n_seeds} seeds holds the limit" if verdict == UNDECIDED else "",
        negligible=None if delta is None else negligible(measured.differences, delta),
        delta=delta,
        held=measured.held,
        n_seeds=n_seeds,
    )


def _unknown(claim: Claim, reason: str, n_seeds: int) -> Judgement:
    nan = math.nan
    return Judgement(**_of(claim), value=nan, ci_low=nan, ci_high=nan, verdict=UNDECIDED, reason=reason,
                     negligible=None, delta=None, held="", n_seeds=n_seeds)  # fmt: skip


def missing(claim: Claim) -> Judgement:
    """What is said of a claim whose figure has no results."""
    return _unknown(claim, f"no results of {claim.sweep}", 0)


def _of(claim: Claim) -> dict[str, Any]:
    names = ("claim", "statement", "figure", "where", "effect", "unit", "relation", "limit")
    return {name: getattr(claim, name) for name in names}


def as_json(judgements: list[Judgement]) -> list[dict]:
    """Plain dictionaries; a number that is not finite is null: no interval, no bound, or runs that never converge."""
    plain = [dataclasses.asdict(judgement) for judgement in judgements]
    return [{key: _number(value) for key, value in row.items()} for row in plain]


def _number(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def from_json(rows: list[dict]) -> list[Judgement]:
    """The judgements that `as_json` wrote.

    A limit that is null beside one that is a number is infinite, and so is a value that is null with its upper limit;
    a value that is null between two numbers is none. Both limits are null where there are too few seeds for an interval
    or no value, and else where it has no bounds.
    """
    return [Judgement(**row | _finite_or_not(row)) for row in rows]


def _finite_or_not(row: dict) -> dict[str, Any]:
    low, high = row["ci_low"], row["ci_high"]
    is_bounded = low is not None or high is not None
    has_interval = is_bounded or (row["value"] is not None and row["n_seeds"] >= Rules().least_seeds)
    limit = row["limit"]
    return {
        "value": _restored(row["value"], math.inf if is_bounded and high is None else math.nan),
        "ci_low": _restored(low, -math.inf if has_interval else math.nan),
        "ci_high": _restored(high, math.inf if has_interval else math.nan),
        "limit": tuple(limit) if isinstance(limit, list) else limit,
    }


def _restored(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
