"""Simulated studies of a world, and how often the interval and the verdict of each are wrong."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paper_figs.analysis.intervals import Interval
from paper_figs.calibration.worlds import World
from paper_figs.claims.judge import CONTRADICTED, SUPPORTED, UNDECIDED, verdicts
from paper_figs.claims.results import Rules

SEEDS = (3, 5, 10, 30, 100, 1000)
"""Seeds of a study."""
_NUMBERS_AT_ONCE = 2_000_000


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
