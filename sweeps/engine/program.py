"""A job's programs: points x seeds x learners advance together by a chunk of episodes, as one XLA program per group."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jrcjax.config.paths import Points
from jrcjax.learners import Source, Spec, make_learner
from jrcjax.learners.hparams import Config
from jrcjax.training import parallel
from jrcjax.training.rollout import AgentState, Log, init_agent, run_episodes
from jrcjax.training.transfer import target_key
from jrcjax.types import Key
from sweeps.engine.job import Group, Job

_CHUNK = 20  # most episodes between two reports of progress: a few seconds


class Lanes(NamedTuple):
    """The lanes of a group of points; a lane is one seed at one point."""

    keys: Key
    """[lanes] of the seeds."""
    points: np.ndarray
    """[lanes] number of the point among those of the job."""
    seeds: np.ndarray
    """[lanes] number of the seed in its block."""
    shape: tuple[int, int]
    """Points and seeds."""

    def unpadded(self, tree: Any) -> Any:
        """Leaves [padded lanes, ...] as [points, seeds, ...]."""

        def of_points(lanes: np.ndarray) -> np.ndarray:
            return lanes[: math.prod(self.shape)].reshape(*self.shape, *lanes.shape[1:])

        return jax.tree.map(lambda leaf: parallel.on_host(of_points, leaf), tree)


class Chunk(NamedTuple):
    """Some episodes of a group of points."""

    group: Group
    lanes: Lanes
    episodes: int
    log: dict[str, Log]
    """By learner: [points of the group, seeds, episodes] each."""
    agents: list[dict[str, AgentState]]
    """Agents by learner after the chunk, gone with the next, in batches of padded lanes; see `joined`."""


def chunk_of(episodes: int) -> int:
    """The largest divisor of `episodes` up to _CHUNK, so that one compiled program serves all chunks."""
    return max(d for d in range(1, min(episodes, _CHUNK) + 1) if episodes % d == 0)


class Program(NamedTuple):
    """Compiled functions over lanes."""

    start: Callable
    """(points, (keys, sources, points' numbers)) to the agents of all learners before their first episode."""
    advance: Callable
    """((points, number of the first episode), lanes = (agents, points' numbers)) to the lanes a chunk later, which take
    the memory of the old ones, and their log."""


@functools.cache
def program_of(learners: tuple[str, ...], spec: Spec, config: Config, chunk: int) -> Program:
    """The program of these learners in environments of one shape.

    It is the same object for all blocks, and for all sweeps with these learners, so it compiles once for a shape.
    """
    rules = {name: make_learner(name, spec, config) for name in learners}

    def at(points: Points, point) -> Points:
        return jax.tree.map(lambda a: a[point], points)

    def start(points, lane):
        key, source, point = lane
        return {name: init_agent(key, at(points, point).hparams, rule, source) for name, rule in rules.items()}

    def advance(shared, lane):
        points, first = shared
        agents, point = lane
        params, hparams = at(points, point)
        done = {n: run_episodes(agents[n], first, chunk, params, hparams, rule) for n, rule in rules.items()}
        agents, logs = ({n: of_learner[i] for n, of_learner in done.items()} for i in (0, 1))
        return (agents, point), logs

    return Program(parallel.over_agents(start), parallel.over_agents(advance, in_place=True))


@jax.jit
def keys_of(seeds: Array | np.ndarray) -> Key:
    """Keys of seeds [N]: seed i has `fold_in(key(0), i)`, whatever other seeds there are."""
    return jax.vmap(lambda i: jax.random.fold_in(jax.random.key(0), i))(seeds)


_target_keys = jax.jit(jax.vmap(target_key))


def lanes_of(job: Job, group: Group, seeds: range) -> Lanes:
    """The lanes of a block of seeds in a group.

    A seed has the same key at every point and for every learner, in whatever block it runs: that of `keys_of`, or its
    `target_key` in a sweep that transfers, since the seed's source agent has the other.
    """
    shape = (len(group.rows), len(seeds))
    point, seed = (a.reshape(-1) for a in np.indices(shape))
    keys = keys_of(np.array(seeds))
    keys = parallel.on_host(lambda data: data[seed], _target_keys(keys) if job.source else keys)
    return Lanes(keys, np.array(group.rows)[point], seed, shape)


def advance(job: Job, seeds: range, source: Source | None) -> Iterator[Chunk]:
    """Runs some seeds of a job at all of its points: group by group, one chunk of episodes after the other.

    Lanes advance in batches that give each device one block, so the compiled code, and with it every bit of a seed's
    results, is the same whatever seeds run beside it.

    Args:
      job: what to run.
      seeds: the seeds.
      source: of the seeds, if the sweep transfers; every leaf has leading axes of the source's points and of seeds.
    """
    for group in job.groups:
        yield from _advance_group(job, group, lanes_of(job, group, seeds), source)


def _advance_group(job: Job, group: Group, lanes: Lanes, source: Source | None) -> Iterator[Chunk]:
    episodes = group.config.episodes
    chunk, points = chunk_of(episodes), job.table  # of all points, so that groups of any number have the same shapes
    program = program_of(job.sweep.learners, job.spec, group.config, chunk)
    of_lane: Any = jax.tree.map(lambda leaf: np.asarray(leaf)[job.source_points[lanes.points], lanes.seeds], source)
    started = parallel.groups((lanes.keys, of_lane, lanes.points.astype(np.int32)))
    batches = [(program.start(points, batch), jax.device_put(batch[2])) for batch in started]
    del started
    for first in range(0, episodes, chunk):
        advanced = [program.advance((points, jnp.int32(first)), batch) for batch in batches]
        batches = [batch for batch, _ in advanced]
        log = lanes.unpadded(joined([log for _, log in advanced]))
        yield Chunk(group, lanes, chunk, log, [agents for agents, _ in batches])


def joined(batches: list[Any]) -> Any:
    """Batches of lanes as one, on the host.

    Joined on the devices they would be exchanged between them. A device waits for the other one, which may have other
    batches to advance first, and XLA gives up after a while.
    """
    return jax.tree.map(lambda *parts: parallel.on_host(lambda *arrays: np.concatenate(arrays), *parts), *batches)
