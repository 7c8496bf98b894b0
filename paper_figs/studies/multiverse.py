"""The claims in many readings of the paper: in which share of the space each holds, and which readings decide it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from jrcjax.checks import refuse
from jrcjax.training.transfer import TARGET_LEARNERS
from jrcjax.types import choice
from paper_figs.analysis.intervals import Interval, clustered_share
from paper_figs.analysis.sensitivity import LEAST_POINTS, Sensitivity, sensitivity
from paper_figs.claims.effects import LateGap, TypicalEpisode, learners_of, metric_of
from paper_figs.claims.judge import UNDECIDED, VERDICTS, Claim, Judgement, is_on_its_side
from paper_figs.claims.results import Rules
from paper_figs.claims.table import CLAIMS, claims_of, number_of
from paper_figs.cores import on_cores
from paper_figs.plots import readings as plot
from sweeps.studies.fig5a import FIG5A
from sweeps.studies.multiverse import points_of, verdicts_file
from sweeps.studies.readings import PER_BLOCK, READINGS, SOURCE, Reading, range_of, unit_of, values_at

FIGURES = ("fig5b", "fig6", "fig7", "fig8", "fig9")
_RARE = 0.1  # share of readings with an effect, or without, below which it is not asked why
_ROW = ["reading", "claim", "n_seeds"]  # what tells the rows of a table of verdicts apart


def claims_in(source: xr.Dataset, target: xr.Dataset) -> list[Judgement]:
    """All claims in one reading.

    Args:
      source: results in its source environment, one point.
      target: results at its POINTS, or at those of some figures; of other figures nothing is known.
    """
    there = target["point_of_reading"].values.astype(int).tolist()
    places = {name: [there.index(i) for i in points_of({name}) if i in there] for name in FIGURES}
    whole = [name for name in FIGURES if len(places[name]) == len(points_of({name}))]
    return claims_of({"fig5a": source} | {name: target.isel(point=places[name]) for name in whole})


def of_readings(source: xr.Dataset, target: xr.Dataset) -> Iterator[tuple[int, list[Judgement]]]:
    """The claims in each reading of a block, from the results of its sweep and of its source agents."""
    for place, number in enumerate(source["reading"].values.astype(int)):
        points = np.flatnonzero(target["reading"].values == number)
        yield int(number), claims_in(source.isel(point=[place]), target.isel(point=points))


def verdicts(judged: list[tuple[int, list[Judgement]]]) -> pd.DataFrame:
    """One row per reading and claim: the effect with its interval, and the verdict; without seeds if it was not run.

    A claim `holds` if its estimate, whatever its interval, is on the claim's side.
    """
    rows = [
        {
            "reading": number,
            "claim": c.claim,
            "value": c.value,
            "ci_low": c.ci_low,
            "ci_high": c.ci_high,
            "verdict": c.verdict,
            "holds": is_on_its_side(c.value, c.relation, c.limit),
            "negligible": c.negligible,
            "n_seeds": c.n_seeds,
        }
        for number, of_reading in judged
        for c in of_reading
    ]
    return pd.DataFrame(rows)


def together(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Tables of verdicts as one, in order; of a reading, claim and number of seeds what the last table says."""
    place = {claim.claim: place for place, claim in enumerate(CLAIMS)}
    rows = pd.concat(tables).drop_duplicates(_ROW, keep="last")
    return rows.iloc[np.lexsort((rows.n_seeds, rows.claim.map(place), rows.reading))]


def estimates(found: pd.DataFrame) -> pd.DataFrame:
    """One row per reading and claim, that of the fewest seeds, which all readings have.

    Estimates of few seeds and of many don't mix: the least of several differences, for one, is the lower the fewer.
    """
    return found.drop_duplicates(_ROW[:2])


def judged(found: pd.DataFrame) -> pd.DataFrame:
    """One row per reading and claim with seeds enough for a verdict, that of the most seeds."""
    return found.loc[found.n_seeds >= Rules().least_seeds].drop_duplicates(_ROW[:2], keep="last")


def sampled(found: pd.DataFrame) -> pd.DataFrame:
    """The rows of all readings but 0, which is the default and no point of the sample."""
    return found.loc[found.reading > 0]


def undecided(out: Path, claim: str, seeds: int) -> tuple[list[int], str]:
    """Readings that the summary in `out` has no verdict of a claim for, and fewer seeds than these.

    A difference that is known to be negligible needs no more of them.

    Returns:
      The readings, and the figure whose points the claim is about.

    Raises:
      ValueError: naming `undecided`, if there is no such summary, or no such claim in it.
    """
    path = verdicts_file(out)
    if not path.is_file():
        refuse("undecided", claim, f"where an earlier run left its summary, and {path} is missing")
    found = pd.read_csv(path)
    figures = {c.claim: c.sweep for c in CLAIMS if c.claim in set(found.claim)}
    choice("undecided", claim, tuple(figures))
    of_claim = found.loc[found.claim == claim].drop_duplicates("reading", keep="last")
    is_open = (of_claim.verdict == UNDECIDED) & of_claim.negligible.ne(True)
    asked = of_claim.loc[is_open & (of_claim.n_seeds < seeds)]
    return asked.reading.tolist(), figures[claim]


def finished(out: Path, seeds: int) -> set[int]:
    """Readings of which the summary in `out` has all claims with so many seeds."""
    found = pd.read_csv(verdicts_file(out))
    claims = found.loc[found.n_seeds == seeds].groupby("reading").claim.nunique()
    return set(claims.index[claims == found.claim.nunique()])


def agreement(of_reading: pd.DataFrame) -> pd.Series:
    """By claim, C1 to C15, the share of its statements that hold in one reading."""
    return of_reading.holds.astype(bool).groupby(of_reading.claim.map(number_of), sort=False).mean()


def share_of(holds: pd.Series, readings: pd.Series | pd.Index) -> Interval:
    """The share of readings in which something holds; those of a block have in common what decides code."""
    return clustered_share(holds.to_numpy(bool), readings.to_numpy(int) // PER_BLOCK)


def shares(found: pd.DataFrame) -> pd.DataFrame:
    """One row per claim: the share of readings where it holds; of those with seeds enough, that of each verdict.

    A claim is `unknown` where it has no effect, as where no run of the learners that it compares ever converges.
    `holds` and `unknown` are of `estimates`, all else of what is `judged`, with `holds_then` and `unknown_then` as
    there; `negligible` is of those where learners are compared.
    The limits are of 95 %, for readings that come in blocks; `readings` and `judged` count what the shares are of.
    """
    rows = []
    for claim, of_claim in sampled(found).groupby("claim", sort=False):
        first, then = estimates(of_claim), judged(of_claim)
        row: dict[str, object] = {"claim": claim, "readings": len(first), "judged": len(then)}
        found_in = {"holds": (first, first.holds.astype(bool)), "unknown": (first, first.value.isna())}
        found_in |= {verdict: (then, then.verdict == verdict) for verdict in VERDICTS}
        compared = then.loc[then.negligible.notna()]
        found_in["negligible"] = compared, compared.negligible.astype(bool)
        found_in |= {"holds_then": (then, then.holds.astype(bool)), "unknown_then": (then, then.value.isna())}
        for name, (of, holds) in found_in.items():
            share = share_of(holds, of.reading) if len(of) else (np.nan,) * 3
            row |= dict(zip((name, f"{name}_low", f"{name}_high"), map(float, share), strict=True))
        rows.append(row)
    return pd.DataFrame(rows)


def readings(numbers: list[int]) -> pd.DataFrame:
    """What each reading is, by path; empty where it is as by default."""
    return pd.DataFrame([{"reading": n} | values_at(unit_of(1, n)[0]) for n in numbers])


HEADLINES = ("C3 (TLwD)", "C5 (highest)", "C8 (miss detection, DDQN)", "C13 (highest)")
"""Statements that the first page names, and whose specification curves are drawn."""


def specification(found: pd.DataFrame, sensitivity: pd.DataFrame) -> Figure:
    """Specification curves of the paper's headlines, from estimates, with the questions that decide each most."""
    most = sensitivity.sort_values("total", ascending=False)
    decisive = {claim: most.input[most.claim == claim].tolist() for claim in HEADLINES}
    limits = {c.claim: float(c.limit) for c in CLAIMS if decisive.get(c.claim) and isinstance(c.limit, float)}
    inputs = places(int(found.reading.max()) + 1)
    return plot.draw_specification(sampled(estimates(found)), inputs / inputs.max(), decisive, limits)


def places(number: int) -> pd.DataFrame:
    """Places of readings in their ranges, a column per question; levels as whole numbers."""
    unit = unit_of(number)
    for column, reading in enumerate(READINGS):
        if levels := range_of(reading).levels:
            unit[:, column] = np.floor(unit[:, column] * len(levels))
    return pd.DataFrame(unit, columns=[reading.label for reading in READINGS])


def can_act(question: Reading, claim: Claim, *, on_whether_known: bool = False) -> bool:
    """Whether a question's answer can move a claim's effect: through a learner that reads it and what it counts.

    Or whether it is known: where that is so as soon as anybody converges, through all learners of the figure.
    """
    learners = learners_of(claim.measure)
    if on_whether_known and isinstance(claim.measure, LateGap | TypicalEpisode):
        learners = frozenset(FIG5A.learners if claim.sweep == FIG5A.name else TARGET_LEARNERS)
    if question.metrics and metric_of(claim.measure) not in question.metrics:
        return False
    if question.path == SOURCE and claim.sweep == "fig5a":
        return True  # there it says whether learners have the answers to all other questions, or Table I's
    return not question.learners or bool(learners & set(question.learners))


def decisive(found: pd.DataFrame, episodes: int) -> dict[str, pd.DataFrame]:
    """Sensitivity indices of each claim's effect over the readings, and interactions of its three strongest ones.

    Only questions that can act on a claim are asked, see `can_act`. What never converges counts as the last episode.
    Indices are over the readings in which there is an effect; where that is not nearly all or none, `known` has the
    indices of whether there is one, since who is left depends on the answers.

    Args:
      found: see `verdicts`.
      episodes: length of the runs.
    """
    rows = sampled(estimates(found))
    never = np.isposinf(rows.value) & rows.claim.isin([c.claim for c in CLAIMS if c.unit == "episode"])
    rows = rows.assign(value=rows.value.mask(never, episodes))
    inputs = places(int(found.reading.max()) + 1)
    of_claims = ((claim, rows[rows.claim == claim.claim], inputs) for claim in CLAIMS)
    tables = on_cores(_decisive, of_claims)
    names = dict.fromkeys(name for of_claim in tables for name in of_claim)
    return {name: pd.concat(of_claim[name] for of_claim in tables if name in of_claim) for name in names}


def _decisive(claim: Claim, rows: pd.DataFrame, inputs: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """`decisive` of one claim, as far as there are readings enough."""

    def indices_of(readings: pd.Series, output: np.ndarray, on_whether_known: bool = False) -> Sensitivity:
        asked = [each.label for each in READINGS if can_act(each, claim, on_whether_known=on_whether_known)]
        numbers = readings.to_numpy(int)
        return sensitivity(inputs.loc[numbers, asked], output, blocks=numbers // PER_BLOCK)

    def described(indices: Sensitivity, number: int) -> pd.DataFrame:
        about = {"claim": claim.claim, "readings": number, "surrogate": indices.surrogate}
        return indices.table.assign(**about, surrogate_error=indices.error)

    values, tables = rows.value.to_numpy(float), {}
    is_known = np.isfinite(values)
    if is_known.sum() >= LEAST_POINTS:
        of_effect = indices_of(rows.reading[is_known], values[is_known])
        tables["sensitivity"] = described(of_effect, int(is_known.sum()))
        tables["interactions"] = of_effect.pairs.assign(claim=claim.claim)
    if len(rows) >= LEAST_POINTS and _RARE <= is_known.mean() <= 1 - _RARE:
        tables["known"] = described(indices_of(rows.reading, is_known.astype(float), True), len(rows))
    return tables
