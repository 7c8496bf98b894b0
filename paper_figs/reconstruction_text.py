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
from paper_figs.readings_text import FIGURES, NAMED, csv_of, share_of, short
from paper_figs.studies import multiverse
from paper_figs.studies.reconstruction import ALL, BEST, DEFAULT, LEAST_LOSS, TRADE_OFF
from sweeps.studies.multiverse import MULTIVERSE
from sweeps.studies.readings import READINGS, SOURCE
from sweeps.studies.reconstruction import NAME

_RARE = 0.05
_MOSTLY = 10.0  # weight of the margin beyond which the other losses hardly count
_FEW = 8  # answers to a question that are told one by one
_CONVERGING = ("tlwd", "dpr", "ddqn")
_PAGE = "docs/explanation/readings.md#the-best-reading"


def _tables(published: Path) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    tried, confirmed, closest = (csv_of(published, NAME, name) for name in ("tried", "confirmed", "closest"))
    if DEFAULT not in set(tried.reading):
        raise ValueError(f"{NAME}: no reading {DEFAULT!r} among those tried; search from a multiverse's summary")
    return tried, confirmed.assign(number=confirmed.claim.map(number_of)), closest


def _for(confirmed: pd.DataFrame, what: str) -> pd.DataFrame:
    """The rows of the reading that is the best for "all" or for a claim."""
    return confirmed.loc[[what in best_for.split() for best_for in confirmed.best_for]]


def _searched(tried: pd.DataFrame) -> int:
    """How many of the readings the search proposed."""
    return int(tried.reading.str.startswith("search").sum())


def _nowhere(tried: pd.DataFrame, closest: pd.DataFrame) -> str:
    """What holds in no reading, with the largest share of the space that readings drawn from it leave to that."""
    claims = closest.claim[closest.holds == 0]
    if claims.empty:
        return ""
    most = float(proportion_effect(0, len(tried) - _searched(tried)).high)
    share = f"in none of the {len(tried)} readings, so in at most {percent(most)} of the space"
    return f"On their side {share}: {_names(claims)}."


def _named(reading: str) -> str:
    """A reading as sentences name it: "reading 17 of the multiverse", or "the default"."""
    study, _, number = reading.rpartition(" ")
    return f"reading {number} of the {study}" if study else f"the {reading}"


def _pair(values: Mapping[Hashable, Any]) -> str:
    """Whether a reading has the two answers that decide most."""
    has = [values["hparams.loss"] == "huber", values[SOURCE] == "table1"].count(True)
    return f"It has {('neither', 'one', 'both')[has]} of the Huber loss in the target and Table I's source."


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


def trade_off_list(published: Path) -> str:
    """In how much of the space one action is not enough in the target, by which answers, and what fits best there."""
    tried, confirmed, _ = _tables(published)
    worth, idle = _of_multiverse(tried)
    number = len(worth) + len(idle)
    if worth.empty:
        return listed([f"One action in every state is optimal in the target of all {number} readings."])
    share, low, high = (percent(float(limit)) for limit in proportion_effect(len(worth), number))
    answers = _answers_without(worth, idle)
    fields = "; ".join(f"`{path}` {answer}" for path, answer in answers) or "none"
    left = [len(of) - np.count_nonzero(_has_one_of(answers, of)) for of in (worth, idle)]
    sentences = [
        f"In {share} ({low} to {high}) of the multiverse's readings no single action is optimal in the target: the "
        f"best one loses at least {percent(worth.lost_by_one_action.min())}; in all others at most "
        f"{percent(idle.lost_by_one_action.max())}.",
        f"Answers with which no reading has a trade-off: {fields}. Of the {sum(left)} readings without them {left[0]} "
        "have one.",
        "On their side in readings with a trade-off, and in those without one: "
        + "; ".join(f"{c} in {_held(published, worth, c)} and {_held(published, idle, c)}" for c in NAMED)
        + ".",
        _best_with_trade_off(tried, _for(confirmed, TRADE_OFF)),
    ]
    return listed(sentences)


def _of_multiverse(tried: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The readings that no search proposed: those with a trade-off, and those without."""
    sample = tried.loc[~tried.reading.str.startswith("search")]
    worth = _worth(sample)
    return worth, sample.drop(worth.index)


def _held(published: Path, sample: pd.DataFrame, claim: str) -> str:
    """In which share of these readings of the multiverse a statement's estimate is on its side."""
    found = csv_of(published, MULTIVERSE.name, "verdicts")
    of_sample = found.reading.isin(sample.reading.map(_number)) & (found.claim == claim)
    return share_of(found.holds[of_sample].astype(bool))


def _number(reading: str) -> int:
    """The number in the multiverse of a reading of it."""
    return 0 if reading == DEFAULT else int(reading.rpartition(" ")[2])


def _answers_without(worth: pd.DataFrame, idle: pd.DataFrame) -> list[tuple[str, str]]:
    """The answers to questions, of a few answers each, with which no reading has a trade-off; by field."""
    found = []
    for reading in READINGS:
        with_one, without = (set(of[reading.path].astype(str)) for of in (worth, idle))
        if len(with_one | without) <= _FEW:
            found += [(reading.path, answer) for answer in sorted(without - with_one)]
    return found


def _has_one_of(answers: list[tuple[str, str]], sample: pd.DataFrame) -> np.ndarray:
    return np.any([sample[path].astype(str) == answer for path, answer in answers] or [[False] * len(sample)], axis=0)


def _best_with_trade_off(tried: pd.DataFrame, best: pd.DataFrame) -> str:
    """What agrees best with the text of the readings with a trade-off, and what fresh seeds say of it."""
    number, name = len(_worth(tried)), _with_trade_off(tried)
    agrees = f"Of all {number} readings with a trade-off, those of the search included, {_named(name)} agrees best with"
    if best.empty:
        return f"{agrees} the text; its fresh seeds are still to come."
    values, supported = _values(tried, name), best.claim[best.verdict == "supported"]
    return (
        f"{agrees} the text: its single seed promised {int(best.promised.sum())} of {len(best)} statements (agreement "
        f"{percent(values['agreement'])}), and {int(best.n_seeds.max())} fresh seeds gave {int(best.holds.sum())} "
        f"(agreement {percent(multiverse.agreement(best).mean())}): {_count(best)}. {_pair(values)} "
        f"{_imitated(values, _values(tried, DEFAULT))} Supported: {_names(supported)}."
    )


def _imitated(values: Mapping[Hashable, Any], default: Mapping[Hashable, Any]) -> str:
    """How much there is to choose in a reading, and whether TLwD chooses or does what its demonstrations do."""
    weight, rewards = "hparams.margin_weight", "hparams.demonstration_rewards"
    imitates = values[weight] > _MOSTLY and values[rewards] == "unused"
    return (
        f"One action in every state loses {percent(values['lost_by_one_action'])} of its optimum (default: "
        f"{percent(default['lost_by_one_action'])}). Weight of the margin: {short(values[weight])} (default: "
        f"{short(default[weight])}); demonstrations' rewards: {short(values[rewards])} (default: "
        f"{short(default[rewards])})" + (", so TLwD does mostly what its demonstrations do." if imitates else ".")
    )


def _values(tried: pd.DataFrame, name: str) -> dict[Hashable, Any]:
    """What stands in the row of a reading."""
    return tried.set_index("reading").loc[name].to_dict()


def search_list(published: Path) -> str:
    """How far the best reading goes, what there is to learn in it, and what holds in none, for the first page."""
    tried, confirmed, closest = _tables(published)
    best, rarest = _for(confirmed, ALL), closest.nsmallest(1, "holds").to_dict("records")[0]
    headlines = best[best.claim.isin(NAMED)].groupby("verdict", sort=False).claim.agg(", ".join)
    sentences = [
        f"Of {len(tried)} readings, {_searched(tried)} of them from a search, {_named(best.reading.iloc[0])} fits the "
        f"text best: of {len(best)} statements {_count(best)} by {int(best.n_seeds.max())} fresh seeds "
        f"([all]({_PAGE})), with {'; '.join(f'{claims} {verdict}' for verdict, claims in headlines.items())}.",
        f"{_world_in_short(published)} {_trade_off_in_short(published, tried, confirmed)} "
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


def _trade_off_in_short(published: Path, tried: pd.DataFrame, confirmed: pd.DataFrame) -> str:
    """How many readings have a trade-off, whether C3 holds in them, and which fits the text best."""
    (worth, idle), best = _of_multiverse(tried), _for(confirmed, TRADE_OFF)
    if worth.empty:
        return "No reading of the multiverse has a trade-off in the target."
    page, claim = _PAGE.replace("the-best-reading", "where-there-is-a-trade-off"), NAMED[0]
    share, fresh = len(worth) / (len(worth) + len(idle)), "fresh seeds to come"
    if not best.empty:
        fresh = f"{_count(best)}; {claim} {', '.join(best.verdict[best.claim == claim]) or 'unknown'}"
    return (
        f"{percent(share)} of the multiverse have [a trade-off]({page}) in the target: there {claim} holds in "
        f"{_held(published, worth, claim)}, and {_named(_with_trade_off(tried))} fits best ({fresh})."
    )


def _with_trade_off(tried: pd.DataFrame) -> str:
    """The reading that agrees most with the text of those with a trade-off."""
    return str(tried.reading[_worth(tried).agreement.idxmax()])


def _worth(tried: pd.DataFrame) -> pd.DataFrame:
    """The readings with a trade-off."""
    return tried.loc[tried.lost_by_one_action >= LEAST_LOSS]


def best_list(published: Path) -> str:
    """What the best reading promised and fresh seeds gave, and what was found nowhere."""
    tried, confirmed, closest = _tables(published)
    best, name = _for(confirmed, ALL), _for(confirmed, ALL).reading.iloc[0]
    rare = closest.loc[(closest.holds > 0) & (closest.holds < _RARE * len(tried))]
    agreement = tried.set_index("reading").agreement
    sentences = [
        f"Of {len(tried)} readings, {_searched(tried)} of them proposed by the search, {_named(name)} agrees best with "
        f"the text: its single seed promised {int(best.promised.sum())} of {len(best)} statements (agreement "
        f"{percent(agreement[name])}, default {percent(agreement[DEFAULT])}), and {int(best.n_seeds.max())} fresh "
        f"seeds gave {int(best.holds.sum())} (agreement {percent(multiverse.agreement(best).mean())}): {_count(best)}.",
        _pair(_values(tried, name)),
        _world(published),
        _converged(best),
        _nowhere(tried, closest) or f"Each statement's estimate is on its side in some of the {len(tried)} readings.",
        f"In less than {percent(_RARE)} of them: {_names(rare.claim)}.",
    ]
    wanted = [*confirmed.number.unique(), *([] if _worth(tried).empty else [TRADE_OFF])]
    if to_come := [what for what in wanted if _for(confirmed, what).empty]:
        return listed([*sentences, f"Fresh seeds in the best readings for {', '.join(to_come)} are still to come."])
    sentences += [
        f"Beyond that reading, which is the best for all claims together, fresh seeds in the other readings support: "
        f"{_names(_supported_beyond(confirmed, best))}.",
        f"On their side in some readings, and supported by fresh seeds in none of those that were run with them: "
        f"{_names(_unconfirmed(confirmed, closest))}.",
    ]
    return listed(sentences)


def _count(best: pd.DataFrame) -> str:
    """Verdicts, counted."""
    return ", ".join(f"{(best.verdict == v).sum()} {v}" for v in ("supported", "contradicted", "undecided"))


def _names(claims: pd.Series | list[str]) -> str:
    return "; ".join(claims) or "none"


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
    names = (DEFAULT, _for(confirmed, ALL).reading.iloc[0], _with_trade_off(tried))
    rows = [(f"`{r.path}`", r.label, *(short(by_name.loc[name, r.path]) for name in names)) for r in READINGS]
    return table(("field", "question", "default", "best for all", "best with a trade-off"), rows)


def confirmed_table(published: Path) -> str:
    """One row per statement: promise and confirmation in the best readings for all, with a trade-off, for its claim."""
    _, confirmed, closest = _tables(published)
    rows = []
    for row in closest.to_dict("records"):
        of_claim = confirmed.loc[confirmed.claim == row["claim"]]
        cells = []
        for what in (ALL, TRADE_OFF, number_of(str(row["claim"]))):
            of_reading = _for(of_claim, what).to_dict("records")
            cells.append(_side_by_side(of_reading[0]) if of_reading else "")
        reading = next(iter(_for(of_claim, number_of(str(row["claim"]))).reading), "to come")
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
    "trade_off": trade_off_list,
    "confirmed": confirmed_table,
}
"""Name of a marked part to what makes it from the folder of published results."""
