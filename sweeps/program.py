"""A sweep as one XLA program: points x seeds x learners advance together by a chunk of episodes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax import exact, parallel
from jrcjax.hparams import Config, HParams
from jrcjax.params import EnvParams, check_params
from jrcjax.training import Log, init_agent, learner_for, run_episodes
from sweeps.sweep import Size, Sweep

_CHUNK = 50  # most episodes between two reports of progress: a few seconds


class Progress(NamedTuple):
    """A chunk of a running sweep."""

    episodes: int
    """Episodes in the chunk."""
    log: dict[str, Log]
    """By learner: [points, seeds, episodes] each."""


def chunk_of(episodes: int) -> int:
    """The largest divisor of `episodes` up to _CHUNK, so that one compiled program serves all chunks."""
    return max(d for d in range(1, min(episodes, _CHUNK) + 1) if episodes % d == 0)


def points_of(sweep: Sweep, preset: str) -> EnvParams:
    """The environments of all points, checked and stacked along a leading axis."""
    points = [sweep.params_at(x, preset) for x in sweep.x_values]
    for params in points:
        check_params(params)
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *points)


def optimum_of(points: EnvParams) -> exact.LongRun:
    """Exact long-run figures of the optimal policy at each point, [points] each."""

    def at(params: EnvParams) -> exact.LongRun:
        return exact.evaluate_policy(params, exact.optimal_policy(params))

    return jax.jit(jax.vmap(at))(points)


def run_block(sweep: Sweep, size: Size, points: EnvParams, seeds: range) -> Iterator[Progress]:
    """Runs some seeds of a sweep at all of its points, one chunk of episodes after the other.

    Seed i has the key `fold_in(key(0), i)` at every point and for every learner, in whatever block it runs.
    """
    hparams, config = HParams(), Config(episodes=size.episodes)
    rules = {name: learner_for(name, jax.tree.map(lambda a: a[0], points), config) for name in sweep.learners}
    shape = (len(sweep.x_values), len(seeds))
    point, seed = (a.reshape(-1) for a in np.meshgrid(np.arange(shape[0]), np.array(seeds), indexing="ij"))
    lanes = parallel.padded(point.size)
    keys = jax.vmap(lambda i: jax.random.fold_in(jax.random.key(0), i))(jnp.asarray(seed))
    chunk = chunk_of(size.episodes)

    def at(points: EnvParams, point: jax.Array) -> EnvParams:
        # A single point is shared by all agents, and its bank of placements with it.
        return jax.tree.map(lambda a: a[0] if a.shape[0] == 1 else a[point], points)

    def start(points, agent):
        key, point = agent
        return {name: init_agent(key, at(points, point), hparams, rule) for name, rule in rules.items()}

    def advance(shared, agent):
        points, first = shared
        states, point = agent
        done = {
            name: run_episodes(states[name], first, chunk, at(points, point), hparams, rule)
            for name, rule in rules.items()
        }
        return {name: state for name, (state, _) in done.items()}, {name: log for name, (_, log) in done.items()}

    where = parallel.pad_agents(jnp.asarray(point), lanes)
    states = parallel.over_agents(start)(points, (parallel.pad_agents(keys, lanes), where))
    step = parallel.over_agents(advance)
    for first in range(0, size.episodes, chunk):
        states, log = step((points, jnp.int32(first)), (states, where))
        unpadded = jax.tree.map(lambda a: np.asarray(a[: math.prod(shape)]).reshape(*shape, chunk), log)
        yield Progress(chunk, unpadded)
