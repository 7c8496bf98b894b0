"""What a sweep is: points of an environment, learners at each of them, and the sizes of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from jrcjax.checks import require_integer
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.params import EnvParams
from jrcjax.model.presets import PRESETS
from jrcjax.types import choice
from sweeps.preset import check_preset, label_of

MOST_SEEDS = 1_000_000
"""Whose numbers fit the names of parts."""
_MOST_EPISODES = 100_000  # whose log of a part still fits the memory, and whose slots 32 bits


@dataclass(frozen=True)
class Sweep:
    """The constants of one sweep; its points differ in numbers alone, never in shapes."""

    name: str
    description: str
    learners: tuple[str, ...]
    x_name: str
    """What varies between points."""
    x_values: tuple[float, ...]
    """Its value at each point."""
    params_at: Callable[[float, str], EnvParams]
    """(x, preset) to the environment at a point."""
    hparams_at: Callable[[float], HParams] = lambda x: HParams()
    """x to the hyperparameters at a point."""
    source: Sweep | None = None
    """What trains the source agents whose weights and demonstrations the learners take over: at each of its points,
    one per seed."""
    source_points: tuple[int, ...] = ()
    """Number of the source's point at each point; the first everywhere if empty."""
    optimiser: str = Config.optimiser  # pyright: ignore[reportAssignmentType]
    """One of jrcjax.learners.hparams.OPTIMISERS, of the learners and of the source agents' sweep alike."""
    recipe: Any = None
    """What a sweep of one's own is made from (`sweeps.studies.custom.Options`), so that its results can be verified."""
    seeds_per_part: int = 16
    """Seeds that share a part file. With few points more of them fill the blocks that devices work on."""

    def config(self, size: Size) -> Config:
        """Static settings of all learners."""
        return Config(
            episodes=size.episodes,
            pretraining=size.pretraining,
            demonstrations=size.demonstrations,
            optimiser=self.optimiser,
        )


@dataclass(frozen=True)
class Size:
    """How much of a sweep to run."""

    seeds: int = 10
    """Independent seeds, numbered from 0."""
    episodes: int = 1000
    """Episodes per seed, in the source as in the target."""
    preset: str = "paper"
    """What the environments are made from, see `sweeps.preset`."""
    pretraining: int = Config.pretraining
    """TLwD's updates before its first episode."""
    demonstrations: int = Config.demonstrations
    """Transitions that it is given."""

    def check(self) -> None:
        """Raises ValueError naming the field, the value and what is allowed."""
        require_integer("seeds", self.seeds, 1, MOST_SEEDS)
        require_integer("episodes", self.episodes, 1, _MOST_EPISODES)
        require_integer("pretraining", self.pretraining, 0)
        require_integer("demonstrations", self.demonstrations, 1, Config.replay_capacity - 1)
        check_preset(self.preset)


SMOKE = Size(seeds=2, episodes=20, pretraining=200, demonstrations=1000)
"""The tiny version of every sweep."""


@dataclass(frozen=True)
class Study:
    """What a name on the command line stands for: sweeps that run one after the other and are evaluated together."""

    name: str
    description: str
    sweeps: tuple[Sweep, ...]
    size: Size = Size()
    """Unless the command line says otherwise."""
    presets: tuple[str, ...] = PRESETS
    """Tables of the paper's parameters that it can be run with."""
    smoke_sweeps: tuple[Sweep, ...] | None = None
    """What the tiny version runs instead of `sweeps`."""
    smoke_size: Size = SMOKE


def size_of(seeds: int | None, episodes: int | None, preset: str, smoke: bool, study: Study | None = None) -> Size:
    """The size that command-line options ask for."""
    usual, tiny, presets = (study.size, study.smoke_size, study.presets) if study else (Size(), SMOKE, PRESETS)
    if preset in PRESETS or presets != PRESETS:
        choice("preset", label_of(preset), presets)
    size = replace(tiny if smoke else usual, preset=preset)
    given = {"seeds": seeds, "episodes": episodes}
    return replace(size, **{name: value for name, value in given.items() if value is not None})
