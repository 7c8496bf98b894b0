"""Simulated studies of a world, how often the interval and the verdict of each are wrong, and the table of all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from paper_figs.analysis.intervals import Interval
from paper_figs.calibration.reach import SEEDS, beyond, reach
from paper_figs.calibration.worlds import WORLDS, World
from paper_figs.claims.judge import CONTRADICTED, SUPPORTED, UNDECIDED, verdicts
from paper_figs.claims.results import Rules

_NUMBERS_AT_ONCE = 2_000_000
_NUMBERS_IN_ALL = 120_000_000  # of one world with so many seeds
_STUDIES = {1: 20_000, 2: 4_000}  # at most, of worlds with so many numbers per seed
_OF_POINTS = 10_000  # and of those with more


def studies_of(world: World, n_seeds: int) -> int:
    """How many studies the published table has of a world."""
    return min(_STUDIES.get(world.columns, _OF_POINTS), _NUMBERS_IN_ALL // (n_seeds * world.columns))


class Rates(NamedTuple):
    """Shares of studies."""

    coverage: float
    """Whose interval holds the truth."""
    false_supported: float
    """Whose verdict is "supported" at the edge of the claim."""
    false_contradicted: float
    """Whose verdict is "contradicted" there."""


def simulate(world: World, n_seeds: int, studies: int) -> Rates:
    """What a rule says in so many studies of a world, each with its own seeds; the same in every call."""
    rng = np.random.default_rng([n_seeds, *f"{world.rule}: {world.name}".encode()])
    counts, left = np.zeros(3), studies
    while left:
        now = min(left, max(_NUMBERS_AT_ONCE // (n_seeds * world.columns), 1))
        counts += _count(world, world.interval(*world.draw(rng, n_seeds, now)), n_seeds)
        left -= now
    return Rates(*(float(share) for share in counts / studies))


def _count(world: World, interval: Interval, n_seeds: int) -> np.ndarray:
    """Studies whose interval holds the truth, and those whose verdict is supported or contradicted."""
    limit = world.truth if world.limit is None else world.limit
    found = verdicts(interval.low, interval.high, world.relation, limit)
    if n_seeds < Rules().least_seeds:
        found = np.full_like(found, UNDECIDED)
    holds = (interval.low <= world.truth) & (world.truth <= interval.high)
    return np.array([holds.sum(), (found == SUPPORTED).sum(), (found == CONTRADICTED).sum()])


def rows(worlds: Iterable[World] = WORLDS, seeds: Iterable[int] = SEEDS, most: int | None = None) -> Iterator[dict]:
    """The table's rows, as they come; `most` studies each."""
    for world in worlds:
        for n in seeds:
            studies = min(studies_of(world, n), most or _STUDIES[1])
            rates, missing = simulate(world, n, studies), beyond(world.rule, world.name, n)
            yield {
                "rule": world.rule,
                "world": world.name,
                "n_seeds": n,
                "studies": studies,
                **rates._asdict(),
                "simulation_error": float(np.sqrt(0.025 * 0.975 / studies)),
                "out_of_reach": int(missing is not None),
                "what": missing.what if missing else "",
                "reason": missing.why if missing else "",
                "in_reach_from": reach(world.rule, world.name),
            }


def table(found: Iterable[dict]) -> pd.DataFrame:
    """Rows as a table. `simulation_error` is the standard error of a rate of 2.5 %; `in_reach_from` are seeds."""
    return pd.DataFrame(found).astype({"in_reach_from": "Int64"})
