"""A job: a sweep of one size, with its points, their programs and what learners are held against, each made once."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import jax
import numpy as np

from jrcjax.checks import refuse
from jrcjax.config.paths import Points, parameter_at
from jrcjax.config.stacking import Values, settings, shapes, stacked
from jrcjax.learners import Learner, Spec, make_learner
from jrcjax.learners.hparams import Config
from jrcjax.machine import physical_memory
from jrcjax.training import parallel
from jrcjax.training.footprint import agent_bytes, bytes_at_most
from jrcjax.training.rollout import spec_of
from sweeps.design import Design
from sweeps.engine.reference import Reference, reference_of
from sweeps.preset import base_of
from sweeps.sweep import Size, Sweep

MOST_AGENTS = 1_000_000
"""Agents of one block of seeds, with all points and learners, beyond which a design is refused."""
_LEAST_ROOM = 64  # for points in a program
_COPIES = 2  # of an agent while it advances: the old one and the new


class Group(NamedTuple):
    """Points that share a program."""

    rows: tuple[int, ...]
    """Their numbers among all points."""
    config: Config
    """Their static settings."""


@dataclass(frozen=True, eq=False)
class Job:
    """All that computing blocks of seeds needs."""

    sweep: Sweep
    size: Size
    """Its number of seeds says how many are wanted, and nothing of what they give."""

    @cached_property
    def columns(self) -> list[Values]:
        """What is set at the points: the design, and what is fixed."""
        base, number = base_of(self.sweep.environment, self.size.preset).points, len(self.sweep.design)
        fixed = [Values(parameter_at(path, base), np.full(number, value)) for path, value in self.sweep.fixed]
        return self.sweep.design.settings(base) + fixed

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Points by what decides shapes or code."""
        own, size = base_of(self.sweep.environment, self.size.preset).config, self.size
        usual = dataclasses.asdict(Config())
        changed = {name: value for name, value in dataclasses.asdict(own).items() if value != usual[name]}
        of_size = {name: getattr(size, name) for name in ("episodes", "pretraining", "demonstrations")}
        base = dataclasses.replace(Config(), **(of_size | changed))
        configs = settings(base, self.columns, len(self.sweep.design))
        rows = {config: tuple(i for i, c in enumerate(configs) if c == config) for config in dict.fromkeys(configs)}
        return tuple(Group(of, config) for config, of in rows.items())

    @property
    def points(self) -> Points:
        """The environments and hyperparameters of all points, checked, every leaf with a leading axis of points."""
        return _stacked(*self._of_points)

    @property
    def table(self) -> Points:
        """The points as programs take them: the last repeated up to a power of two, so that sweeps share programs."""
        return _table(*self._of_points)

    @property
    def shapes(self) -> Points:
        """Shapes of the table, known at once."""
        base = base_of(self.sweep.environment, self.size.preset).points
        return shapes(base, self.columns, len(_rows(len(self.sweep.design))))

    @property
    def _of_points(self) -> tuple[str, Design, tuple[tuple[str, float], ...], str]:
        return self.sweep.environment, self.sweep.design, self.sweep.fixed, self.size.preset

    @cached_property
    def spec(self) -> Spec:
        """What learners need to know of all points alike."""
        return spec_of(base_of(self.sweep.environment, self.size.preset).points.params)

    @cached_property
    def reference(self) -> Reference:
        """What learners are held against."""
        return reference_of(self.points, self.size.episodes)

    @cached_property
    def source(self) -> Job | None:
        """What trains the source agents."""
        return Job(self.sweep.source, self.size) if self.sweep.source else None

    @cached_property
    def source_points(self) -> np.ndarray:
        """Number of the source's point at each point, [points]."""
        return np.array(self.sweep.source_points or [0] * len(self.sweep.design))

    def check(self) -> None:
        """Refuses a job that this machine can't hold, and points that are no environments, before anything compiles.

        Raises:
          ValueError: naming the number of agents, the estimate of their memory and what is allowed; or the field, the
            value and what is allowed.
        """
        sweep = self.sweep
        lanes = [parallel.padded(len(group.rows) * sweep.seeds_per_part) for group in self.groups]
        agents = sum(lanes) * len(sweep.learners)
        points = f"{len(sweep.design)} points x {sweep.seeds_per_part} seeds x {len(sweep.learners)} learners"
        if agents > MOST_AGENTS:
            refuse("points", points, f"at most {MOST_AGENTS} agents at a time, not {agents}")
        available = physical_memory()
        if self._needed(lanes, bytes_at_most) > available and (needed := self._needed(lanes, agent_bytes)) > available:
            estimate = f"about {needed / 2**30:.3g} GiB for {agents} agents at a time"
            refuse("points", points, f"what fits {available / 2**30:.3g} GiB of memory, not {estimate}")
        _ = self.points

    def _needed(self, lanes: list[int], bytes_of: Callable[[Learner, Spec, Config], int]) -> int:
        """Bytes for so many lanes of the groups, which are run one after the other."""
        names, spec = self.sweep.learners, self.spec
        of_lane = [sum(bytes_of(make_learner(n, spec, g.config), spec, g.config) for n in names) for g in self.groups]
        return _COPIES * max(count * size for count, size in zip(lanes, of_lane, strict=True))


# Unlike a cached property of Python 3.11, a cached function lets other threads ask while it works.
@functools.lru_cache(maxsize=32)
def _stacked(environment: str, design: Design, fixed: tuple[tuple[str, float], ...], preset: str) -> Points:
    """The points of equal designs, whose banks of placements take seconds to draw, are made once."""
    base, number = base_of(environment, preset).points, len(design)
    given = [Values(parameter_at(path, base), np.full(number, value)) for path, value in fixed]
    return stacked(base, design.settings(base) + given, number)


@functools.lru_cache(maxsize=32)
def _table(environment: str, design: Design, fixed: tuple[tuple[str, float], ...], preset: str) -> Points:
    points, rows = _stacked(environment, design, fixed, preset), _rows(len(design))
    return jax.device_put(jax.tree.map(lambda leaf: np.asarray(leaf)[rows], points))


def _rows(number: int) -> np.ndarray:
    """Which of so many points each row of a table holds."""
    room = max(_LEAST_ROOM, 2 ** (number - 1).bit_length())
    return np.minimum(np.arange(room), number - 1)
