"""The parts of texts made from the published search for the reading in which most of the paper's text holds."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from paper_figs.analysis.intervals import proportion_effect
from paper_figs.claims import words
from paper_figs.claims.learning_table import LABELS
from paper_figs.claims.table import number_of
from paper_figs.markdown import listed, percent, table
from paper_figs.published import (
    FIGURES,
    best_for,
    confirmed_in,
    counted,
    csv_of,
    named,
    names,
    of_multiverse,
    pair,
    promising,
    short,
    tried_in,
    values_of,
    with_trade_off,
    worth,
)
from paper_figs.studies import multiverse
from paper_figs.studies.reconstruction import ALL, BEST, DEFAULT, LEAST_LOSS, TRADE_OFF
from paper_figs.trade_off_text import trade_off_in_short
from paper_figs.verdicts_text import never_judged_so
from sweeps.studies.readings import READINGS
from sweeps.studies.reconstruction import NAME

_RARE = 0.05
_CONVERGING = ("tlwd", "dpr", "ddqn")
_PAGE = "docs/explanation/readings.md#the-best-reading"


def _tables(published: Path) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    return tried_in(published), confirmed_in(published), csv_of(published, NAME, "closest")


def _searched(tried: pd.DataFrame) -> int:
    """How many of the readings the search proposed."""
    return int(tried.reading.str.startswith("search").sum())


def _nowhere(tried: pd.DataFrame, closest: pd.DataFrame) -> str:
    """What holds in no reading, with the largest share of the space that readings drawn from it leave to that."""
    claims = closest.claim[closest.holds == 0]
    if claims.empty:
        return ""
    most = float(proportion_effect(0, sum(map(len, of_multiverse(tried)))).high)
    share = (
        f"in none of the {len(tried)} readings, so in at most {percent(most)} of the space (each by itself, and as if "
        "readings of a block were independent)"
    )
    return f"On their side {share}: {names(claims)}."


def _own_best(tried: pd.DataFrame) -> str:
    """How far the search's own proposals got beside the design that it started from."""
    proposed = tried.reading.str.startswith("search")
    own, design = (tried.loc[of].nlargest(1, "agreement").iloc[0] for of in (proposed, ~proposed))
    better = "more" if own.agreement > design.agreement else "no more"
    return (
        f"The best of those that the search proposed agrees {percent(own.agreement)}, {better} than the best of the "
        f"design, {percent(design.agreement)}."
    )


def _converged(best: pd.DataFrame) -> str:
    """When the learners converge in the best reading."""
    rows = {row["claim"]: row for row in best.to_dict("records")}
    when = ", ".join(f"{LABELS[name]} {words.number(rows[f'C7 ({LABELS[name]})']['value'])}" for name in _CONVERGING)
    return f"In it policies converge at p_1^v = 0.8 in episode (median): {when}."


def _world(published: Path) -> str:
    """What there is to learn in the best reading: the exact optimum of its Figs. 6 to 8, beside the default's."""
    (sent, gap), (of_default, gap_of_default) = (_optimum(published / name) for name in (BEST, FIGURES))
    return (
        f"At the points of Figs. 6 to 8 its optimal policy sends at most {sent:.3g} packets per episode (default: "
        f"{of_default:.3g}), and one action in every state earns at most {percent(gap)} less (default: "
        f"{percent(gap_of_default)})" + (": no trade-off is left to learn." if sent < 1 else ".")
    )


def _optimum(folder: Path) -> tuple[float, float]:
    """The most packets that the optimum of Figs. 6 to 8 sends, and the largest share that the best constant loses."""
    numbers = pd.concat([pd.read_csv(folder / f"fig{number}.csv") for number in (6, 7, 8)])
    reward, packets = (
        numbers[numbers.panel == panel].pivot(index=["figure", "x"], columns="algorithm", values="mean")
        for panel in "ab"
    )
    lost = 1.0 - reward["constant"].to_numpy() / reward["optimum"].to_numpy()
    return float(packets["optimum"].to_numpy().max()), float(lost.max())


def search_list(published: Path) -> str:
    """How far the best reading goes, what there is to learn in it, and what holds in none, for the first page."""
    tried, confirmed, closest = _tables(published)
    best, rarest = best_for(confirmed, ALL), closest.nsmallest(1, "holds").to_dict("records")[0]
    headlines = best[best.claim.isin(multiverse.HEADLINES)].groupby("verdict", sort=False).claim.agg(", ".join)
    in_words = "; ".join(f"{claims} {verdict}" for verdict, claims in headlines.items())
    sentences = [
        f"Of {len(tried)} readings, {_searched(tried)} of them from a search, {named(best.reading.iloc[0])} agreed "
        f"most with the text{_so_far(tried, best.reading.iloc[0])}: of {len(best)} statements "
        f"{counted(best)} by {int(best.n_seeds.max())} fresh seeds "
        f"([all]({_PAGE})), with {in_words}.",
        f"{_world_in_short(published)} {trade_off_in_short(published)} "
        + (
            _nowhere(tried, closest)
            or f"Each statement's estimate holds in some reading, {rarest['claim']}'s in {rarest['holds']}."
        )
        + f" Fresh seeds support {len(_supported(confirmed))} of {len(closest)} in some.",
    ]
    return listed(sentences)


def _world_in_short(published: Path) -> str:
    (_, gap), (_, of_default) = (_optimum(published / name) for name in (BEST, FIGURES))
    where = f"at the points of Figs. 6 to 8 (default: it loses up to {percent(of_default)})"
    if gap < LEAST_LOSS:
        return f"One action in every state is optimal in it {where}."
    return f"One action in every state loses up to {percent(gap)} in it {where}."


def best_list(published: Path) -> str:
    """What the best reading promised and fresh seeds gave, and what was found nowhere."""
    tried, confirmed, closest = _tables(published)
    best, name = best_for(confirmed, ALL), best_for(confirmed, ALL).reading.iloc[0]
    rare = closest.loc[(closest.holds > 0) & (closest.holds < _RARE * len(tried))]
    agreement = tried.set_index("reading").agreement
    sentences = [
        f"Of {len(tried)} readings, {_searched(tried)} of them proposed by the search, {named(name)} agrees best with "
        f"the text{_so_far(tried, name)}: its {promising(best)} promised {int(best.promised.sum())} of {len(best)} "
        "statements (agreement "
        f"{percent(agreement[name])}, default {percent(agreement[DEFAULT])}), and {int(best.n_seeds.max())} fresh "
        f"seeds gave {int(best.holds.sum())} (agreement {percent(multiverse.agreement(best).mean())}): "
        f"{counted(best)}.",
        _own_best(tried),
        pair(values_of(tried, name)),
        _world(published),
        _converged(best),
        _nowhere(tried, closest) or f"Each statement's estimate is on its side in some of the {len(tried)} readings.",
        f"In less than {percent(_RARE)} of them: {names(rare.claim)}.",
    ]
    wanted = [*confirmed.number.unique(), *([] if worth(tried).empty else [TRADE_OFF])]
    if to_come := [what for what in wanted if best_for(confirmed, what).empty]:
        return listed([*sentences, f"Fresh seeds in the best readings for {', '.join(to_come)} are still to come."])
    sentences += [
        f"Beyond that reading, which is the best for all claims together, fresh seeds in the other readings support: "
        f"{names(_supported_beyond(confirmed, best))}.",
        f"On their side in some readings, and supported by fresh seeds in none of those that were run with them: "
        f"{names(_unconfirmed(confirmed, closest))}.",
        never_judged_so(published, _unconfirmed(confirmed, closest)),
    ]
    return listed(sentences)


def _so_far(tried: pd.DataFrame, confirmed: str) -> str:
    """Which reading promises more than the best of those that fresh seeds confirmed; nothing where none does."""
    best = tried.loc[tried.agreement.idxmax()]
    if best.agreement <= tried.set_index("reading").agreement[confirmed]:
        return ""
    return (
        f", of those with fresh seeds ({named(best.reading)}, which promises an agreement of "
        f"{percent(best.agreement)}, has none yet)"
    )


def _supported(confirmed: pd.DataFrame) -> set[str]:
    return set(confirmed.claim[confirmed.verdict == "supported"])


def _supported_beyond(confirmed: pd.DataFrame, best: pd.DataFrame) -> list[str]:
    found = _supported(confirmed) - _supported(best)
    return [claim for claim in confirmed.claim.unique() if claim in found]


def _unconfirmed(confirmed: pd.DataFrame, closest: pd.DataFrame) -> list[str]:
    known = _supported(confirmed) | set(closest.claim[closest.holds == 0])
    return [claim for claim in confirmed.claim.unique() if claim not in known]


def best_values_table(published: Path) -> str:
    """The best readings, answer by answer, beside the default."""
    tried, confirmed, _ = _tables(published)
    by_name = tried.set_index("reading")
    best = {"default": DEFAULT, "best for all": best_for(confirmed, ALL).reading.iloc[0]}
    if not worth(tried).empty:
        best["best with a trade-off"] = with_trade_off(tried)
    rows = [(f"`{r.path}`", r.label, *(short(by_name.loc[name, r.path]) for name in best.values())) for r in READINGS]
    return table(("field", "question", *best), rows)


def confirmed_table(published: Path) -> str:
    """One row per statement: promise and confirmation in the best readings for all, with a trade-off, for its claim."""
    _, confirmed, closest = _tables(published)
    rows = []
    for row in closest.to_dict("records"):
        of_claim = confirmed.loc[confirmed.claim == row["claim"]]
        cells = []
        for what in (ALL, TRADE_OFF, number_of(str(row["claim"]))):
            of_reading = best_for(of_claim, what).to_dict("records")
            cells.append(_side_by_side(of_reading[0]) if of_reading else "")
        reading = next(iter(best_for(of_claim, number_of(str(row["claim"]))).reading), "to come")
        rows.append((str(row["claim"]), f"{row['holds']} of {row['tried']}", *cells[:2], reading, cells[2]))
    head = (
        "statement",
        "on its side in",
        "best for all: promised, confirmed",
        "best with a trade-off: promised, confirmed",
        "best for its claim",
        "promised, confirmed",
    )
    return table(head, rows)


def _side_by_side(row: Mapping[Hashable, Any]) -> str:
    promised, value, low, high = (words.number(float(row[n])) for n in ("promised_value", "value", "ci_low", "ci_high"))
    interval = "" if np.isnan(row["ci_low"]) else f" ({low} to {high})"
    return f"{promised}, {value}{interval}: {row['verdict']}"


BLOCKS: dict[str, Callable[[Path], str]] = {
    "search": search_list,
    "best": best_list,
    "best_values": best_values_table,
    "confirmed": confirmed_table,
}
"""Name of a marked part to what makes it from the folder of published results."""
