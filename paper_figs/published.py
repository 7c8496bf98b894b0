"""Published tables of readings, and how texts name and count what stands in them."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from paper_figs.claims.judge import VERDICTS
from paper_figs.claims.table import number_of
from paper_figs.markdown import from_to, percent
from paper_figs.studies import multiverse
from paper_figs.studies.reconstruction import DEFAULT, LEAST_LOSS
from sweeps.studies.multiverse import MULTIVERSE
from sweeps.studies.readings import SOURCE
from sweeps.studies.reconstruction import NAME

FIGURES = "figures"
"""The published figures under the default reading."""


def csv_of(published: Path, study: str, name: str) -> pd.DataFrame:
    """A published table."""
    return pd.read_csv(published / study / f"{name}.csv", keep_default_na=True)


def share(row: Mapping[Hashable, Any], name: str) -> str:
    """A share with its limits, which stand beside it in a row."""
    return f"{percent(row[name])} ({100 * row[f'{name}_low']:.3g} to {100 * row[f'{name}_high']:.3g})"


def seeds_of(verdicts: pd.DataFrame) -> str:
    """How many seeds rows have: "5", "1 to 5"."""
    return from_to({int(n) for n in verdicts.n_seeds.dropna()})


def share_of(holds: pd.Series) -> str:
    """The share of readings in which a statement holds; the series' index is the readings' numbers."""
    if holds.empty:
        return "not among these readings"
    of = multiverse.share_of(holds, holds.index)
    return share({"holds": float(of.value), "holds_low": float(of.low), "holds_high": float(of.high)}, "holds")


def holds_in(published: Path, claim: str) -> pd.Series:
    """Whether a statement's estimate of few seeds is on its side, by number of the reading."""
    found = multiverse.estimates(csv_of(published, MULTIVERSE.name, "verdicts"))
    return found[found.claim == claim].set_index("reading").holds.astype(bool)


def tried_in(published: Path) -> pd.DataFrame:
    """The readings that the search knew or proposed, a row each.

    Raises:
      ValueError: if the default is not among them.
    """
    tried = csv_of(published, NAME, "tried")
    if DEFAULT not in set(tried.reading):
        raise ValueError(f"{NAME}: no reading {DEFAULT!r} among those tried; search from a multiverse's summary")
    return tried


def worth(tried: pd.DataFrame) -> pd.DataFrame:
    """The readings with a trade-off."""
    return tried.loc[tried.lost_by_one_action >= LEAST_LOSS]


def of_multiverse(tried: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The readings of the sample, by their numbers: those with a trade-off, and those without."""
    sample = tried.loc[~tried.reading.str.startswith("search") & (tried.reading != DEFAULT)]
    sample = sample.set_index(sample.reading.map(_number))
    with_one = worth(sample)
    return with_one, sample.drop(with_one.index)


def _number(reading: str) -> int:
    """The number in the multiverse of a reading of it."""
    return int(reading.rpartition(" ")[2])


def held(published: Path, sample: pd.DataFrame, claim: str) -> str:
    """In which share of these readings of the multiverse a statement's estimate is on its side."""
    holds = holds_in(published, claim)
    return share_of(holds.loc[holds.index.isin(sample.index)])


def confirmed_in(published: Path) -> pd.DataFrame:
    """What fresh seeds say of the best readings: a row per reading and statement, with the number of its claim."""
    confirmed = csv_of(published, NAME, "confirmed")
    return confirmed.assign(number=confirmed.claim.map(number_of))


def best_for(confirmed: pd.DataFrame, what: str) -> pd.DataFrame:
    """The rows of the reading that is the best for "all", for "trade-off", or for a claim."""
    return confirmed.loc[[what in best_for.split() for best_for in confirmed.best_for]]


def values_of(tried: pd.DataFrame, name: str) -> dict[Hashable, Any]:
    """What stands in the row of a reading."""
    return tried.set_index("reading").loc[name].to_dict()


def named(reading: str) -> str:
    """A reading as sentences name it: "reading 17 of the multiverse", or "the default"."""
    study, _, number = reading.rpartition(" ")
    return f"reading {number} of the {study}" if study else f"the {reading}"


def promising(confirmed: pd.DataFrame) -> str:
    """The seeds that the search went by, as sentences name them: "single seed", "2 seeds"."""
    most = int(confirmed.promised_seeds.max())
    return "single seed" if most == 1 else f"{most} seeds"


def counted(best: pd.DataFrame) -> str:
    """Verdicts, counted."""
    return ", ".join(f"{(best.verdict == v).sum()} {v}" for v in VERDICTS)


def pair(values: Mapping[Hashable, Any]) -> str:
    """Whether a reading has the two answers that decide most."""
    has = [values["hparams.loss"] == "huber", values[SOURCE] == "table1"].count(True)
    return f"It has {('neither', 'one', 'both')[has]} of the Huber loss in the target and Table I's source."


def names(claims: pd.Series | list[str]) -> str:
    """Statements, one after the other."""
    return "; ".join(claims) or "none"


def with_trade_off(tried: pd.DataFrame) -> str:
    """The reading that agrees most with the text of those with a trade-off."""
    return str(tried.reading[worth(tried).agreement.idxmax()])


def short(value: object) -> str:
    """A name, or a number with three digits, or with all of those before the point."""
    if not isinstance(value, int | float):
        return str(value)
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
