"""The parts of texts that are made from published results under many readings of the paper."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jrcjax.readings import Loss
from paper_figs.claims.judge import VERDICTS
from paper_figs.claims.results import Rules
from paper_figs.markdown import listed, paragraph, percent, table
from paper_figs.mechanisms_text import step_sizes_in_short
from paper_figs.published import NAMED, csv_of, held, holds_in, of_multiverse, share, share_of, tried_in
from paper_figs.studies import multiverse
from sweeps.design import in_range
from sweeps.preset import SOURCES
from sweeps.studies.multiverse import MULTIVERSE
from sweeps.studies.readings import READINGS, SOURCE, Reading, as_text, choices, default_unit, range_of, values_at

TOGETHER = ("C5 (highest)", "C13 (highest)")
"""Statements that loss and source decide together."""
_NEARLY_ALL = 0.9
_BLIND = 1.0  # cross-validated error from which a surrogate is no better than the mean
_DECIDING = 0.05  # least total-order index, from its lower limit, of a question that is said to decide


def _holds(row: Mapping[Hashable, Any]) -> str:
    """Where a statement holds, and where that is unknown."""
    return share(row, "holds") + (f", unknown in {percent(row['unknown'])}" if row["unknown"] else "")


def _strongest(sensitivity: pd.DataFrame, claim: str, most: int) -> pd.DataFrame:
    """The questions that decide a statement, the strongest first; none where the surrogate predicts nothing."""
    of_claim = sensitivity.query("claim == @claim and total_low > @_DECIDING and surrogate_error < @_BLIND")
    return of_claim.nlargest(most, "total")


def _deciding(sensitivity: pd.DataFrame, claim: str, most: int = 3) -> str:
    """The questions that decide a statement, with their total-order indices."""
    of_claim = _strongest(sensitivity, claim, most)
    return ", ".join(f"{row['input']} {row['total']:.2f}" for _, row in of_claim.iterrows()) or "no single question"


def readings_list(published: Path) -> str:
    """In which share of the readings the statements hold, and what decides, for the first page."""
    claims, sensitivity = (csv_of(published, MULTIVERSE.name, name) for name in ("claims", "sensitivity"))
    worthwhile, idle = of_multiverse(tried_in(published))
    judged, by_name = int(claims.judged.max()), {row["claim"]: row for row in claims.to_dict("records")}
    rows = [
        (
            name,
            _holds(by_name[name]),
            held(published, worthwhile, name),
            *([f"{percent(by_name[name][v])}" for v in ("supported", "contradicted")] if judged else []),
            _deciding_where(published, sensitivity, name),
        )
        for name in NAMED
    ]
    of_verdicts = ("supported", "contradicted") if judged else ()
    head = ("statement", "on its side", "with a trade-off", *of_verdicts, "decided most by (most often with)")
    of_judged = f"; of verdicts in {judged} with seeds enough ([all](docs/explanation/readings.md#verdicts))"
    about = paragraph(
        f"Shares of {int(claims.readings.max())} readings ([tables](published/{MULTIVERSE.name})) in which the "
        "estimate is on the statement's side, with 95 % intervals (unknown: no run converges); of the "
        f"{len(worthwhile)} of {len(worthwhile) + len(idle)} in which no single action is optimal"
        + (of_judged if judged else "")
        + "; and total-order indices of what decides it:"
    )
    return f"{about}\n\n{table(head, rows)}\n\n{listed([_together(published), step_sizes_in_short(published)])}"


def _deciding_where(published: Path, sensitivity: pd.DataFrame, claim: str) -> str:
    """The two questions that decide a statement most, each with the answer with which it holds most often."""
    found = []
    for row in _strongest(sensitivity, claim, 2).to_dict("records"):
        names, which, holds = _by_answer(published, claim, str(row["input"]))
        most = max(range(len(names)), key=lambda i: holds[which == i].mean())
        found.append(f"{row['input']} {row['total']:.2f} ({names[most]})")
    return ", ".join(found) or "no single question"


def _by_answer(published: Path, claim: str, label: str) -> tuple[list[str], np.ndarray, pd.Series]:
    """Names of a question's answers; which of them each reading has; and whether a statement holds in it."""
    holds = holds_in(published, claim).drop(0)  # the default is no point of the sample
    (reading,) = (reading for reading in READINGS if reading.label == label)
    return *_answers(reading, _places_of(holds)[label].to_numpy()), holds


def _places_of(holds: pd.Series) -> pd.DataFrame:
    """Places of the readings that a series is about."""
    numbers = holds.index.to_numpy(int)
    return multiverse.places(int(numbers.max(initial=0)) + 1).loc[numbers]


def never_judged_so(published: Path, claims: list[str]) -> str:
    """Which of some statements no reading with seeds enough for a verdict supports, and what bound that gives."""
    shares = csv_of(published, MULTIVERSE.name, "claims").query("claim in @claims and judged > 0 and supported == 0")
    if shares.empty:
        return "Each of these is supported in some of the multiverse's readings with verdicts."
    return (
        f"Of these, supported in none of the {int(shares.judged.max())} readings of the multiverse with verdicts "
        f"either, so in at most {percent(shares.supported_high.max())} of the space: {'; '.join(shares.claim)}."
    )


def judged_table(published: Path) -> str:
    """One row per statement: shares of its verdicts in the readings that have seeds enough for one."""
    claims = csv_of(published, MULTIVERSE.name, "claims")
    names = (*VERDICTS, "negligible")
    rows = [
        (row["claim"], *(share(row, name) for name in names)) for row in claims.query("judged > 0").to_dict("records")
    ]
    return table(("statement", *names), rows)


def judged_list(published: Path) -> str:
    """What has a verdict, and what verdicts say in most readings."""
    claims, verdicts = (csv_of(published, MULTIVERSE.name, name) for name in ("claims", "verdicts"))
    judged = verdicts[verdicts.n_seeds >= Rules().least_seeds]
    if judged.empty:
        return listed([f"No reading has seeds enough for a verdict, which takes {Rules().least_seeds}."])
    seeds = ", ".join(f"{count} of {n:.0f} seeds" for n, count in judged.n_seeds.value_counts().sort_index().items())
    mostly = {v: claims.claim[claims[f"{v}_low"] > 0.5] for v in ("supported", "contradicted")}
    never = claims.claim[claims.supported == 0]
    in_words = [
        f"In more than half, interval included, {v}: {'; '.join(names) or 'none'}." for v, names in mostly.items()
    ]
    return listed(
        [
            f"{judged.reading.nunique()} of {verdicts.reading.nunique()} readings have seeds enough for {len(judged)} "
            f"verdicts ({seeds}): " + ", ".join(f"{(judged.verdict == v).sum()} {v}" for v in VERDICTS) + ".",
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


def _together(published: Path) -> str:
    """What the loss and the source decide together, everywhere and where there is a trade-off."""
    chosen = {"hparams.loss": Loss.HUBER.value, SOURCE: SOURCES.index("table1")}
    labels = {reading.path: reading.label for reading in READINGS}
    worthwhile, _ = of_multiverse(tried_in(published))

    def apart(holds: pd.Series) -> str:
        places = _places_of(holds)
        here = np.all([places[labels[path]] == answer for path, answer in chosen.items()], axis=0)
        return " and ".join(percent(holds.loc[of].mean()) for of in (here, ~here))

    parts = []
    for claim in TOGETHER:
        holds = holds_in(published, claim).drop(0)
        worth_it = holds.loc[holds.index.isin(worthwhile.index)]
        parts.append(f"{claim} holds in {apart(holds)} (with a trade-off: {apart(worth_it)})")
    return (
        "With the Huber loss in the target and Table I's source together, and in all others, "
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
    sensitivity, rows = csv_of(published, MULTIVERSE.name, "sensitivity"), []
    for claim in NAMED:
        for label in _strongest(sensitivity, claim, 2)["input"]:
            names, which, holds = _by_answer(published, claim, label)
            cells = [f"{name}: {share_of(holds.loc[which == i])}" for i, name in enumerate(names)]
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
        of_question = sensitivity.query("input == @reading.label and surrogate_error < @_BLIND")
        predicted = (of_question.total * (1.0 - of_question.surrogate_error)).nlargest(1).index
        decides = "".join(
            f"{most['claim']}: {most['total']:.2f} ({most['total_low']:.2f} to {most['total_high']:.2f})"
            for _, most in of_question.loc[predicted].iterrows()
        )
        value = as_text(reading.path, default[reading.path])
        of_default = value if isinstance(value, str) else f"{value:g}"
        rows.append((f"`{reading.path}`", reading.label, of_default, _searched(reading), decides))
    return table(("field", "question", "default", "searched", "decides most (total-order index)"), rows)


BLOCKS: dict[str, Callable[[Path], str]] = {
    "readings": readings_list,
    "extremes": extremes_list,
    "decided": decided_table,
    "judged": judged_list,
    "judged_table": judged_table,
    "questions": questions_table,
    "answers": answers_table,
}
"""Name of a marked part to what makes it from the folder of published results."""
