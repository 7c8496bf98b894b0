"""The parts of texts that are made from published results under many readings of the paper."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jrcjax.readings import Loss
from paper_figs.markdown import from_to, listed, paragraph, percent, table
from paper_figs.mechanisms_text import step_sizes_in_short
from paper_figs.published import csv_of, held, holds_in, of_multiverse, seeds_of, share, share_of, tried_in
from paper_figs.studies import multiverse
from sweeps.design import in_range
from sweeps.preset import SOURCES
from sweeps.studies.multiverse import MULTIVERSE
from sweeps.studies.readings import READINGS, SOURCE, Reading, as_text, choices, default_unit, range_of, values_at

TOGETHER = ("C5 (highest)", "C13 (highest)")
"""Statements that loss and source decide together."""
_LABELS = {reading.path: reading.label for reading in READINGS}
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
    claims, sensitivity, known = (
        csv_of(published, MULTIVERSE.name, name) for name in ("claims", "sensitivity", "known")
    )
    worthwhile, idle = of_multiverse(tried_in(published))
    by_name = {row["claim"]: row for row in claims.to_dict("records") if row["claim"] in multiverse.HEADLINES}
    judged = {int(row["judged"]) for row in by_name.values() if row["judged"]}
    then = ("holds_then", "supported", "contradicted") if judged else ()
    rows = [
        (
            name,
            _holds(by_name[name]),
            held(published, worthwhile, name),
            *(percent(by_name[name][share]) if by_name[name]["judged"] else "–" for share in then),
            _deciding_where(published, sensitivity, name) + _known_by(known, name),
        )
        for name in multiverse.HEADLINES
    ]
    verdicts = csv_of(published, MULTIVERSE.name, "verdicts")
    first, seeds = seeds_of(multiverse.estimates(verdicts)), seeds_of(multiverse.judged(verdicts))
    of_verdicts = (f"with {seeds} seeds", "supported", "contradicted") if judged else ()
    head = (
        "statement",
        "on its side",
        "with a trade-off",
        *of_verdicts,
        "variance predicted: total-order indices (most often with)",
    )
    of_judged = f"; of {from_to(judged)} with {seeds} seeds ([verdicts](docs/explanation/readings.md#verdicts))"
    about = paragraph(
        f"Shares of {int(claims.readings.max())} readings ([tables](published/{MULTIVERSE.name})) whose estimate "
        f"(seeds: {first}) is on the statement's side, with 95 % intervals "
        "(unknown: no run of those compared converges); "
        f"of the {len(worthwhile)} of {len(worthwhile) + len(idle)} in which no single action is optimal"
        + (of_judged if judged else "")
        + ":"
    )
    return f"{about}\n\n{table(head, rows)}\n\n{listed([_together(published), step_sizes_in_short(published)])}"


def _deciding_where(published: Path, sensitivity: pd.DataFrame, claim: str) -> str:
    """How much is predicted, and the two questions that decide a statement most, each with its most favourable answer.

    An answer is only named where its interval is above those of all others.
    """
    found, predicted = [], ""
    for row in _strongest(sensitivity, claim, 2).to_dict("records"):
        names, which, holds = _by_answer(published, claim, str(row["input"]))
        parts = [holds.loc[which == i] for i in range(len(names))]
        shares = [multiverse.share_of(part, part.index) for part in parts]
        most = max(range(len(names)), key=lambda i: shares[i].low)
        clear = all(shares[most].low > of.high for i, of in enumerate(shares) if i != most)
        found.append(f"{row['input']} {row['total']:.2f}" + (f" ({names[most]})" if clear else ""))
        predicted = f"{percent(1 - row['surrogate_error'])}: "
    return predicted + ", ".join(found) if found else "no single question"


def _known_by(known: pd.DataFrame, claim: str) -> str:
    """What decides whether a statement has an effect at all, where that is asked."""
    return "".join(
        f"; known or not: {row['input']} {row['total']:.2f}" for _, row in _strongest(known, claim, 1).iterrows()
    )


def _by_answer(published: Path, claim: str, label: str) -> tuple[list[str], np.ndarray, pd.Series]:
    """Names of a question's answers; which of them each reading has; and whether a statement holds in it."""
    holds = _holds_in_sample(published, claim)
    (reading,) = (reading for reading in READINGS if reading.label == label)
    return *_answers(reading, _places_of(holds)[label].to_numpy()), holds


def _holds_in_sample(published: Path, claim: str) -> pd.Series:
    """`holds_in` without the default, which is no point of the sample."""
    return holds_in(published, claim).drop(0, errors="ignore")


def _places_of(holds: pd.Series) -> pd.DataFrame:
    """Places of the readings that a series is about."""
    numbers = holds.index.to_numpy(int)
    return multiverse.places(int(numbers.max(initial=0)) + 1).loc[numbers]


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
    worthwhile, _ = of_multiverse(tried_in(published))

    def apart(holds: pd.Series) -> str:
        places = _places_of(holds)
        here = np.all([places[_LABELS[path]] == answer for path, answer in chosen.items()], axis=0)
        return " and ".join(percent(holds.loc[of].mean()) for of in (here, ~here))

    parts = []
    for claim in TOGETHER:
        holds = _holds_in_sample(published, claim)
        worth_it = holds.loc[holds.index.isin(worthwhile.index)]
        parts.append(f"{claim} holds in {apart(holds)} (with a trade-off: {apart(worth_it)})")
    return (
        "With the Huber loss in the target and Table I's source together, and in all others, "
        + "; ".join(parts)
        + " ([why](docs/explanation/readings.md#why-a-loss-that-does-not-see-rare-costs))."
    )


def pair_table(published: Path) -> str:
    """Where the statements of the first page hold, by the loss in the target and what the source was trained with."""
    rows = []
    losses, sources = ([str(as_text(path, i)) for i in range(2)] for path in ("hparams.loss", SOURCE))
    for claim in multiverse.HEADLINES:
        holds = _holds_in_sample(published, claim)
        loss, source = (_places_of(holds)[_LABELS[path]].to_numpy() for path in ("hparams.loss", SOURCE))
        rows.append((claim, *(share_of(holds.loc[(loss == i) & (source == j)]) for i in range(2) for j in range(2))))
    return table(("statement", *(f"{loss}, {source}" for loss in losses for source in sources)), rows)


def decided_table(published: Path) -> str:
    """One row per statement: where it holds, what decides it, and what decides whether it has an effect at all."""
    claims, sensitivity, known = (
        csv_of(published, MULTIVERSE.name, name) for name in ("claims", "sensitivity", "known")
    )
    error = sensitivity.drop_duplicates("claim").set_index("claim").surrogate_error
    rows = [
        (
            row["claim"],
            _holds(row),
            _deciding(sensitivity, row["claim"]),
            f"{error[row['claim']]:.2f}" if row["claim"] in error.index else "",
            _deciding(known, row["claim"], 2) if row["claim"] in set(known.claim) else "",
        )
        for row in claims.to_dict("records")
    ]
    head = ("statement", "holds in (95 % interval)", "decided by (total-order index)", "error", "known or not by")
    return table(head, rows)


def answers_table(published: Path) -> str:
    """Where the statements of the first page hold, by the answers to the two questions that decide each most."""
    sensitivity, rows = csv_of(published, MULTIVERSE.name, "sensitivity"), []
    for claim in multiverse.HEADLINES:
        for label in _strongest(sensitivity, claim, 2)["input"]:
            names, which, holds = _by_answer(published, claim, label)
            cells = [f"{name}: {share_of(holds.loc[which == i])}" for i, name in enumerate(names)]
            rows.append((claim, label, "; ".join(cells)))
    return table(("statement", "question", "holds in (95 % interval), by answer"), rows)


def outcomes_table(published: Path) -> str:
    """One row per question: in which share of readings the statements of the first page hold, by answer."""
    rows = []
    for reading in READINGS:
        cells = []
        for claim in multiverse.HEADLINES:
            names, which, holds = _by_answer(published, claim, reading.label)
            shares = (
                f"{name} {percent(holds[which == i].mean())}" for i, name in enumerate(names) if (which == i).any()
            )
            cells.append("; ".join(shares))
        rows.append((f"`{reading.path}`", *cells))
    return table(("field", *multiverse.HEADLINES), rows)


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
        asked = "input == @reading.label and surrogate_error < @_BLIND and total_low > @_DECIDING"
        of_question = sensitivity.query(asked)
        predicted = (of_question.total * (1.0 - of_question.surrogate_error)).nlargest(1).index
        decides = "".join(
            f"{most['claim']}: {most['total']:.2f} ({most['total_low']:.2f} to {most['total_high']:.2f}) "
            f"of {percent(1.0 - most['surrogate_error'])}"
            for _, most in of_question.loc[predicted].iterrows()
        )
        value = as_text(reading.path, default[reading.path])
        of_default = value if isinstance(value, str) else f"{value:g}"
        rows.append((f"`{reading.path}`", reading.label, of_default, _searched(reading), decides))
    head = ("field", "question", "default", "searched", "decides most (total-order index, of what is predicted)")
    return table(head, rows)


BLOCKS: dict[str, Callable[[Path], str]] = {
    "readings": readings_list,
    "extremes": extremes_list,
    "decided": decided_table,
    "outcomes": outcomes_table,
    "questions": questions_table,
    "answers": answers_table,
    "pair": pair_table,
}
"""Name of a marked part to what makes it from the folder of published results."""
