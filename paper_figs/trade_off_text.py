"""The parts of texts that say where radar and data are a trade-off, and what holds there."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from paper_figs.markdown import listed, percent
from paper_figs.published import (
    best_for,
    confirmed_in,
    counted,
    held,
    named,
    names,
    of_multiverse,
    pair,
    promising,
    share_of,
    short,
    tried_in,
    values_of,
    with_trade_off,
    worth,
)
from paper_figs.studies import multiverse
from paper_figs.studies.reconstruction import DEFAULT, TRADE_OFF
from sweeps.studies.readings import READINGS

_MOSTLY = 10.0  # weight of the margin beyond which the other losses hardly count
_FEW = 8  # answers to a question that are told one by one
_PAGE = "docs/explanation/readings.md#where-there-is-a-trade-off"


def trade_off_list(published: Path) -> str:
    """In how much of the space one action is not enough in the target, by which answers, and what fits best there."""
    tried, confirmed = tried_in(published), confirmed_in(published)
    worthwhile, idle = of_multiverse(tried)
    number = len(worthwhile) + len(idle)
    if worthwhile.empty:
        return listed([f"One action in every state is optimal in the target of all {number} readings."])
    has_one = pd.Series(True, worthwhile.index).reindex(worthwhile.index.append(idle.index), fill_value=False)
    answers = _answers_without(worthwhile, idle)
    fields = "; ".join(f"`{path}` {answer}" for path, answer in answers) or "none"
    loses = f"the best one loses at least {percent(worthwhile.lost_by_one_action.min())}"
    if not idle.empty:
        loses += f"; in all others at most {percent(idle.lost_by_one_action.max())}"
    left = [len(of) - np.count_nonzero(_has_one_of(answers, of)) for of in (worthwhile, idle)]
    sentences = [
        f"In {share_of(has_one)} of the multiverse's readings no single action is optimal in the target: {loses}.",
        f"Answers with which no reading has a trade-off: {fields}. Of the {sum(left)} readings without them {left[0]} "
        "have one.",
        "On their side in readings with a trade-off, and in those without one: "
        + "; ".join(
            f"{c} in {held(published, worthwhile, c)} and {held(published, idle, c)}" for c in multiverse.HEADLINES
        )
        + ".",
        _best_with_trade_off(tried, best_for(confirmed, TRADE_OFF)),
    ]
    return listed(sentences)


def _answers_without(worthwhile: pd.DataFrame, idle: pd.DataFrame) -> list[tuple[str, str]]:
    """The answers to questions, of a few answers each, with which no reading has a trade-off; by field."""
    found = []
    for reading in READINGS:
        with_one, without = (set(of[reading.path].astype(str)) for of in (worthwhile, idle))
        if len(with_one | without) <= _FEW:
            found += [(reading.path, answer) for answer in sorted(without - with_one)]
    return found


def _has_one_of(answers: list[tuple[str, str]], sample: pd.DataFrame) -> np.ndarray:
    return np.any([sample[path].astype(str) == answer for path, answer in answers] or [[False] * len(sample)], axis=0)


def _best_with_trade_off(tried: pd.DataFrame, best: pd.DataFrame) -> str:
    """What agrees best with the text of the readings with a trade-off, and what fresh seeds say of it."""
    number, name = len(worth(tried)), with_trade_off(tried)
    agrees = f"Of all {number} readings with a trade-off, those of the search included, {named(name)} agrees best with"
    if best.empty:
        return f"{agrees} the text; its fresh seeds are still to come."
    values, supported = values_of(tried, name), best.claim[best.verdict == "supported"]
    return (
        f"{agrees} the text: its {promising(best)} promised {int(best.promised.sum())} of {len(best)} "
        f"statements (agreement {percent(values['agreement'])}), and {int(best.n_seeds.max())} fresh seeds gave "
        f"{int(best.holds.sum())} (agreement {percent(multiverse.agreement(best).mean())}): {counted(best)}. "
        f"{pair(values)} {_imitated(values, values_of(tried, DEFAULT))} Supported: {names(supported)}."
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


def trade_off_in_short(published: Path) -> str:
    """How many readings have a trade-off, and which of these agrees most with the text."""
    tried = tried_in(published)
    (worthwhile, idle), best = of_multiverse(tried), best_for(confirmed_in(published), TRADE_OFF)
    if worthwhile.empty:
        return "No reading of the multiverse has a trade-off in the target."
    share, claim = len(worthwhile) / (len(worthwhile) + len(idle)), multiverse.HEADLINES[0]
    fresh = "fresh seeds to come"
    if not best.empty:
        fresh = f"{counted(best)}; {claim} {', '.join(best.verdict[best.claim == claim]) or 'unknown'}"
    return (
        f"{percent(share)} of the multiverse have [a trade-off]({_PAGE}) in the target, of which "
        f"{named(with_trade_off(tried))} agreed most ({fresh})."
    )


BLOCKS: dict[str, Callable[[Path], str]] = {"trade_off": trade_off_list}
"""Name of a marked part to what makes it from the folder of published results."""
