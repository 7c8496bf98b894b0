"""The parts of texts that are made from published results under many readings of the paper."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jrcjax.readings import Loss
from paper_figs.analysis.intervals import proportion_effect
from paper_figs.claims.results import Rules
from paper_figs.markdown import listed, percent, table
from paper_figs.plots import style
from paper_figs.studies import multiverse
from sweeps.design import in_range
from sweeps.preset import SOURCES
from sweeps.studies.multiverse import MULTIVERSE
from sweeps.studies.readings import READINGS, SOURCE, Reading, as_text, choices, default_unit, range_of, values_at

NAMED = ("C3 (TLwD)", "C5 (highest)", "C8 (miss detection, DDQN)", "C13 (highest)")
"""Statements that the first page names."""
FIGURES = "figures"
"""The published figures under the default readings."""
HUBER = "huber"
"""The published sweep of the Huber loss."""
TOGETHER = ("C5 (highest)", "C13 (highest)")
"""Statements that loss and source decide together."""
_NEARLY_ALL = 0.9
_DECIDING = 0.05  # least total-order index, from its lower limit, of a question that is said to decide


def csv_of(published: Path, study: str, name: str) -> pd.DataFrame:
    """A published table."""
    return pd.read_csv(published / study / f"{name}.csv", keep_default_na=True)


def _share(row: Mapping[Hashable, Any], name: str) -> str:
    return f"{percent(row[name])} ({100 * row[f'{name}_low']:.3g} to {100 * row[f'{name}_high']:.3g})"


def _holds(row: Mapping[Hashable, Any]) -> str:
    """Where a statement holds, and where that is unknown."""
    return _share(row, "holds") + (f", unknown in {percent(row['unknown'])}" if row["unknown"] else "")


def share_of(holds: pd.Series) -> str:
    """The share of readings in which a statement holds."""
    if holds.empty:
        return "not among these readings"
    of = proportion_effect(int(holds.sum()), len(holds))
    return _share({"holds": float(of.value), "holds_low": float(of.low), "holds_high": float(of.high)}, "holds")


def _strongest(sensitivity: pd.DataFrame, claim: str, most: int) -> pd.DataFrame:
    """The questions that decide a statement, the strongest first."""
    return sensitivity.query("claim == @claim and total_low > @_DECIDING").nlargest(most, "total")


def _deciding(sensitivity: pd.DataFrame, claim: str, most: int = 3) -> str:
    """The questions that decide a statement, with their total-order indices."""
    of_claim = _strongest(sensitivity, claim, most)
    return ", ".join(f"{row['input']} {row['total']:.2f}" for _, row in of_claim.iterrows()) or "no single question"


def readings_list(published: Path) -> str:
    """In which share of the readings the statements hold, and what decides."""
    claims, sensitivity = (csv_of(published, MULTIVERSE.name, name) for name in ("claims", "sensitivity"))
    number, by_name = int(claims.readings.max()), {row["claim"]: row for row in claims.to_dict("records")}
    sentences = [
        f"{name} holds in {_holds(by_name[name])}; decided most by {_deciding(sensitivity, name, 2)}." for name in NAMED
    ]
    sentences.append(_together(csv_of(published, MULTIVERSE.name, "verdicts")))
    if judged := int(claims.judged.max()):
        sentences.append(_verdicts_in_short(judged, by_name))
    about = (
        f"Shares of {number} readings ([tables](published/{MULTIVERSE.name})) in which the estimate is on the "
        "statement's side, with 95 %\nintervals, and total-order indices of what decides it; unknown is where no run "
        "converges:\n\n"
    )
    return about + listed(sentences)


def _verdicts_in_short(judged: int, by_name: Mapping[Hashable, Mapping[Hashable, Any]]) -> str:
    shares = (f"{n} {percent(by_name[n]['supported'])} and {percent(by_name[n]['contradicted'])}" for n in NAMED)
    return (
        f"In {judged} of them, which have seeds enough for a verdict, supported and contradicted are: "
        f"{'; '.join(shares)} ([all](docs/explanation/readings.md#verdicts))."
    )


def judged_table(published: Path) -> str:
    """One row per statement: shares of its verdicts in the readings that have seeds enough for one."""
    claims = csv_of(published, MULTIVERSE.name, "claims")
    names = (*multiverse.VERDICTS, "negligible")
    rows = [
        (row["claim"], *(_share(row, name) for name in names)) for row in claims.query("judged > 0").to_dict("records")
    ]
    return table(("statement", *names), rows)


def judged_list(published: Path) -> str:
    """What has a verdict, and what verdicts say in most readings."""
    claims, verdicts = (csv_of(published, MULTIVERSE.name, name) for name in ("claims", "verdicts"))
    judged = verdicts[verdicts.n_seeds >= Rules().least_seeds]
    if judged.empty:
        return listed([f"No reading has seeds enough for a verdict, which takes {Rules().least_seeds}."])
    seeds = ", ".join(f"{n:.0f}" for n in sorted(judged.n_seeds.unique()))
    mostly = {v: claims.claim[claims[f"{v}_low"] > 0.5] for v in ("supported", "contradicted")}
    never = claims.claim[claims.supported == 0]
    in_words = [
        f"In more than half, interval included, {v}: {'; '.join(names) or 'none'}." for v, names in mostly.items()
    ]
    return listed(
        [
            f"{judged.reading.nunique()} of {verdicts.reading.nunique()} readings have {seeds} seeds each, and "
            f"{len(judged)} verdicts: "
            + ", ".join(f"{(judged.verdict == v).sum()} {v}" for v in multiverse.VERDICTS)
            + ".",
            *in_words,
            f"Supported in none of them: {'; '.join(never) or 'none'}.",
        ]
    )


def extremes_list(published: Path) -> str:
    """Statements that hold nearly everywhere, and nearly nowhere."""
    claims = csv_of(published, MULTIVERSE.name, "claims")
    everywhere, nowhere = claims[claims.holds_low > _NEARLY_ALL], claims[claims.holds_high < 1 - _NEARLY_ALL]
    return listed(
        [
            f"In more than {percent(_NEARLY_ALL)} of the space, interval included, hold {len(everywhere)} of "
            f"{len(claims)} statements: {'; '.join(everywhere.claim) or 'none'}.",
            f"In less than {percent(1 - _NEARLY_ALL)} of it hold {len(nowhere)}: {'; '.join(nowhere.claim) or 'none'}.",
        ]
    )


def _together(verdicts: pd.DataFrame) -> str:
    """What the loss and the source decide together."""
    places = multiverse.places(int(verdicts.reading.max()) + 1)
    chosen = {"hparams.loss": Loss.HUBER.value, SOURCE: SOURCES.index("table1")}
    labels = {reading.path: reading.label for reading in READINGS}
    both = np.all([places[labels[path]] == answer for path, answer in chosen.items()], axis=0)
    parts = []
    for claim in TOGETHER:
        holds = verdicts.query("claim == @claim and reading > 0").set_index("reading").holds.astype(bool)
        here = both[holds.index.to_numpy(int)]
        parts.append(f"{claim} holds in {share_of(holds[here])}, in all others in {share_of(holds[~here])}")
    return (
        "With the Huber loss in the target and Table I's source together, "
        + "; ".join(parts)
        + " ([why](docs/explanation/readings.md#why-a-loss-that-does-not-see-rare-costs))."
    )


def decided_table(published: Path) -> str:
    """One row per statement: where it holds, and what decides it."""
    claims, sensitivity = (csv_of(published, MULTIVERSE.name, name) for name in ("claims", "sensitivity"))
    error = sensitivity.drop_duplicates("claim").set_index("claim").surrogate_error
    rows = [
        (
            row["claim"],
            _holds(row),
            _deciding(sensitivity, row["claim"]),
            f"{error[row['claim']]:.2f}" if row["claim"] in error.index else "",
        )
        for row in claims.to_dict("records")
    ]
    return table(("statement", "holds in (95 % interval)", "decided by (total-order index)", "error"), rows)


def answers_table(published: Path) -> str:
    """Where the statements of the first page hold, by the answers to the two questions that decide each most."""
    verdicts, sensitivity = (csv_of(published, MULTIVERSE.name, name) for name in ("verdicts", "sensitivity"))
    places, by_label = multiverse.places(int(verdicts.reading.max()) + 1), {r.label: r for r in READINGS}
    rows = []
    for claim in NAMED:
        holds = verdicts.query("claim == @claim and reading > 0").set_index("reading").holds.astype(bool)
        for label in _strongest(sensitivity, claim, 2)["input"]:
            names, which = _answers(by_label[label], places[label].loc[holds.index].to_numpy())
            cells = [f"{name}: {share_of(holds[which == i])}" for i, name in enumerate(names)]
            rows.append((claim, label, "; ".join(cells)))
    return table(("statement", "question", "holds in (95 % interval), by answer"), rows)


def _answers(reading: Reading, places: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Names of a question's answers, or of the thirds of its range, and which of them each reading has."""
    where = range_of(reading)
    if where.levels:
        return [str(as_text(reading.path, level)) for level in where.levels], places.astype(int)
    ends = in_range(np.arange(4) / 3, False, where)
    return [f"{low:.2g} to {high:.2g}" for low, high in pairwise(ends)], np.minimum(3 * places, 2).astype(int)


def _searched(reading: Reading) -> str:
    """Where a question's answers are searched, in words."""
    where = range_of(reading)
    if reading.where is None:
        return ", ".join(choices(reading))
    if where.levels:
        return ", ".join(f"{as_text(reading.path, level)}" for level in where.levels)
    return f"{where.low:g} to {where.high:g}{', logarithmic' if where.is_log else ''}"


def questions_table(published: Path) -> str:
    """One row per question: its field, its default, where it was searched, and which statement it decides most."""
    sensitivity, default = csv_of(published, MULTIVERSE.name, "sensitivity"), values_at(default_unit())
    rows = []
    for reading in READINGS:
        of_question = sensitivity.query("input == @reading.label").nlargest(1, "total")
        decides = "".join(
            f"{most['claim']}: {most['total']:.2f} ({most['total_low']:.2f} to {most['total_high']:.2f})"
            for _, most in of_question.iterrows()
        )
        value = as_text(reading.path, default[reading.path])
        of_default = value if isinstance(value, str) else f"{value:g}"
        rows.append((f"`{reading.path}`", reading.label, of_default, _searched(reading), decides))
    return table(("field", "question", "default", "searched", "decides most (total-order index)"), rows)


def huber_list(published: Path) -> str:
    """What the Huber loss does to the learners of the target, by where it turns linear."""
    means = csv_of(published, HUBER, HUBER).pivot_table(index=["x", "algorithm"], columns="panel", values="mean")

    def what_of(name: str, x: float) -> str:
        reward, packets, missed = means.loc[(x, name)]
        return f"{short(reward)} per slot, {short(packets)} packets per episode, miss detection {percent(missed)}"

    deltas = means.index.get_level_values("x").to_numpy(float)
    first, last = float(deltas.min()), float(deltas.max())
    sentences = []
    for x in (first, last):
        learners = (f"{style.LOOKS[name].label} {what_of(name, x)}" for name in ("ddqn", "dpr", "tlwd"))
        sentences.append(f"delta = {x:g}: {'; '.join(learners)}.")
    explored = short(means.loc[(first, "explored")].iloc[0])
    optimum = f"The optimal policy: {what_of('optimum', first)}; with the learners' exploration {explored}."
    return listed([*sentences, optimum])


def short(value: object) -> str:
    """A name, or a number with three digits, or with all of those before the point."""
    if not isinstance(value, int | float):
        return str(value)
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"


BLOCKS: dict[str, Callable[[Path], str]] = {
    "readings": readings_list,
    "extremes": extremes_list,
    "decided": decided_table,
    "judged": judged_list,
    "judged_table": judged_table,
    "questions": questions_table,
    "answers": answers_table,
    "huber": huber_list,
}
"""Name of a marked part to what makes it from the folder of published results."""
