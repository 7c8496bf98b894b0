"""What a sweep is: points of an environment, learners at each of them, and the sizes of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from jrcjax.checks import require_integer
from jrcjax.hparams import Config, HParams
from jrcjax.params import EnvParams
from jrcjax.presets import PRESETS
from jrcjax.types import choice

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
    transfers: bool = False
    """Whether each seed brings weights and demonstrations of a source agent of its own."""


@dataclass(frozen=True)
class Size:
    """How much of a sweep to run."""

    seeds: int = 10
    """Independent seeds, numbered from 0."""
    episodes: int = 1000
    """Episodes per seed, in the source as in the target."""
    preset: str = "paper"
    """Table of parameters: "paper" or "paper_table"."""
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
        choice("preset", self.preset, PRESETS)

    @property
    def config(self) -> Config:
        """Static settings of all learners."""
        return Config(episodes=self.episodes, pretraining=self.pretraining, demonstrations=self.demonstrations)


SMOKE = Size(seeds=2, episodes=20, pretraining=200, demonstrations=1000)
"""The tiny version of every sweep."""


def size_of(seeds: int | None, episodes: int | None, preset: str, smoke: bool) -> Size:
    """The size that command-line options ask for."""
    size = replace(SMOKE if smoke else Size(), preset=preset)
    given = {"seeds": seeds, "episodes": episodes}
    return replace(size, **{name: value for name, value in given.items() if value is not None})
