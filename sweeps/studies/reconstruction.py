"""The search for the reading in which the paper is right: where it starts, and how many readings it tries.

What judges readings lies in a layer above, see `paper_figs.studies.reconstruction`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jrcjax.checks import require_integer
from sweeps.studies.multiverse import SIZE, block_sweep, digest_of, points_of
from sweeps.studies.readings import values_at
from sweeps.sweep import Size, Study, Sweep

NAME = "reconstruction"
STARTS = 3
"""Readings with different code that the search starts from."""
_MOST = 2**20
_CONFIRMED_PER_PART = 32  # a reading alone has few points, and a source agent per seed; both fill two cores


@dataclass(frozen=True)
class Effort:
    """How much to search and to confirm."""

    readings: int = 304
    """Readings that are tried."""
    confirm: int = 100
    """Fresh seeds of each reading that is confirmed; those of the search count nowhere else."""
    starts: int = STARTS
    per_generation: int = 16
    """Readings that are tried as one block before the next ones are chosen."""


USUAL = Effort()
TINY = Effort(readings=4, confirm=1, starts=1, per_generation=4)


def effort_of(readings: int | None, confirm: int | None, smoke: bool) -> Effort:
    """The effort that command-line options ask for.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    usual = TINY if smoke else USUAL
    readings = usual.readings if readings is None else readings
    confirm = usual.confirm if confirm is None else confirm
    require_integer("readings", readings, usual.per_generation, _MOST)
    require_integer("confirm", confirm, 1, _MOST)
    return Effort(readings, confirm, usual.starts, usual.per_generation)


def of_seeds(size: Size, seeds: int) -> Size:
    """The same size with so many seeds."""
    return replace(size, seeds=seeds)


def generation_sweep(first: int, units: Sequence[np.ndarray]) -> Sweep:
    """Readings at some places of the unit cube, numbered from `first` on, as one block."""
    numbers = range(first, first + len(units))
    return block_sweep(f"{NAME}/tried", numbers, [values_at(unit) for unit in units], seeds_per_part=SIZE.seeds)


def confirmation_sweep(unit: np.ndarray, figures: Collection[str]) -> Sweep:
    """A reading that is confirmed at the points of some figures, named by what it is."""
    values, points = values_at(unit), points_of(figures)
    return block_sweep(f"{NAME}/confirmed/{digest_of((values, points))}", [0], [values], points, _CONFIRMED_PER_PART)


RECONSTRUCTION = Study(
    name=NAME,
    description="the reading in which most of the paper's text holds: search, and confirmation with fresh seeds",
    sweeps=(),
    size=SIZE,
    presets=("paper",),
    search="paper_figs.studies.reconstruction:search",
)
