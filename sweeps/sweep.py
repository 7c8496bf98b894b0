"""What a sweep is: points of an environment, learners at each of them, and the sizes of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from jrcjax.checks import refuse
from jrcjax.params import EnvParams
from jrcjax.presets import PRESETS
from jrcjax.types import choice


@dataclass(frozen=True)
class Sweep:
    """The constants of one sweep; its points differ in parameters alone, never in shapes."""

    name: str
    description: str
    learners: tuple[str, ...]
    x_name: str
    """What varies between points."""
    x_values: tuple[float, ...]
    """Its value at each point."""
    params_at: Callable[[float, str], EnvParams]
    """(x, preset) to the environment at a point."""


@dataclass(frozen=True)
class Size:
    """How much of a sweep to run."""

    seeds: int = 10
    """Independent seeds, numbered from 0."""
    episodes: int = 1000
    """Episodes per seed."""
    preset: str = "paper"
    """Table of parameters: "paper" or "paper_table"."""

    def check(self) -> None:
        """Raises ValueError naming the field, the value and what is allowed."""
        for field in ("seeds", "episodes"):
            value = getattr(self, field)
            if not isinstance(value, int) or isinstance(value, bool) or value < 1:
                refuse(field, value if isinstance(value, int | float | str) else str(value), "an integer >= 1")
        choice("preset", self.preset, PRESETS)


SMOKE = Size(seeds=2, episodes=20)
"""The tiny version of every sweep."""


def size_of(seeds: int | None, episodes: int | None, preset: str, smoke: bool) -> Size:
    """The size that command-line options ask for."""
    size = replace(SMOKE if smoke else Size(), preset=preset)
    given = {"seeds": seeds, "episodes": episodes}
    return replace(size, **{name: value for name, value in given.items() if value is not None})
