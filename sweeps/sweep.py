"""What a sweep is: points of an environment, learners at each of them, and the sizes of a run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from jrcjax.checks import require_integer
from jrcjax.learners.hparams import Config
from jrcjax.model.presets import PRESETS
from jrcjax.types import choice
from sweeps.design import Design
from sweeps.preset import check_preset, label_of

MOST_SEEDS = 1_000_000
"""The most whose numbers fit the names of parts."""
_MOST_EPISODES = 100_000  # whose log of a part still fits the memory, and whose slots 32 bits


@dataclass(frozen=True)
class Sweep:
    """The constants of one sweep."""

    name: str
    description: str
    learners: tuple[str, ...]
    environment: str = "target"
    """What points differ from: "source" or "target" of the preset, or the text of a TOML file."""
    design: Design = field(default_factory=Design)
    """The points. Those that differ in numbers alone share one program."""
    fixed: tuple[tuple[str, float], ...] = ()
    """Numbers by path that differ from the base, the same at all points."""
    source: Sweep | None = None
    """What trains the source agents whose weights and demonstrations the learners take over: at each of its points,
    one per seed."""
    source_points: tuple[int, ...] = ()
    """Number of the source's point at each point; the first everywhere if empty."""
    hands_on: bool = False
    """Whether its Double DQN agents are source agents, whose weights and demonstrations are kept."""
    own: bool = False
    """Whether it is made for one command, so that its results alone tell what it is."""
    seeds_per_part: int = 16
    """Seeds that share a part file. With few points more of them fill the blocks that devices work on."""


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
    summary: str = ""
    """What draws conclusions from the results, as module:function of a layer above; found by name after the run. It
    takes the sweeps, the size and the folder of results, and returns the files that it wrote."""
    search: str = ""
    """For a study whose sweeps follow from one another: what runs them and draws conclusions, named and found like
    `summary`. It takes the effort, the size, the folder of results and what runs a sweep, and returns the files that it
    wrote."""

    def with_sweeps(self, sweeps: tuple[Sweep, ...]) -> Study:
        """The same study of these sweeps, in its tiny version, too."""
        return replace(self, sweeps=sweeps, smoke_sweeps=sweeps)


def size_of(seeds: int | None, episodes: int | None, preset: str, smoke: bool, study: Study | None = None) -> Size:
    """The size that command-line options ask for."""
    usual, tiny, presets = (study.size, study.smoke_size, study.presets) if study else (Size(), SMOKE, PRESETS)
    if preset in PRESETS or presets != PRESETS:
        choice("preset", label_of(preset), presets)
    size = replace(tiny if smoke else usual, preset=preset)
    given = {"seeds": seeds, "episodes": episodes}
    return replace(size, **{name: value for name, value in given.items() if value is not None})
