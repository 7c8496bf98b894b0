"""A sweep as one XLA program: points x seeds x learners advance together by a chunk of episodes."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax import exact, parallel
from jrcjax.hparams import Config, HParams
from jrcjax.learners import Spec, make_learner
from jrcjax.params import EnvParams, check_params
from jrcjax.training import Log, init_agent, run_episodes
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


class Reference(NamedTuple):
    """Exact long-run figures at each point, [points] each."""

    optimum: exact.LongRun
    constant: exact.LongRun
    """Of the best policy that ignores the state."""


def reference_of(points: EnvParams) -> Reference:
    """What learners are held against at each point."""

    def at(params: EnvParams) -> Reference:
        policies = (exact.optimal_policy(params), exact.best_constant_action(params))
        return Reference(*(exact.evaluate_policy(params, policy) for policy in policies))

    return jax.jit(jax.vmap(at))(points)


class Program(NamedTuple):
    """A sweep's compiled functions over lanes; a lane is one seed at one point."""

    start: Callable
    """((), keys) to the agents of all learners before their first episode."""
    advance: Callable
    """((points, number of the first episode), (agents, points' numbers)) to the agents a chunk later, and their log."""


@functools.cache
def program_of(sweep: Sweep, spec: Spec, episodes: int, chunk: int) -> Program:
    """The program of a sweep for environments of one shape; the same object for all blocks, so it compiles once."""
    hparams, config = HParams(), Config(episodes=episodes)
    rules = {name: make_learner(name, spec, config) for name in sweep.learners}

    def start(_, key):
        return {name: init_agent(key, hparams, rule) for name, rule in rules.items()}

    def advance(shared, lane):
        points, first = shared
        agents, point = lane
        # A single point is shared by all lanes, and its bank of placements with it.
        params = jax.tree.map(lambda a: a[0] if a.shape[0] == 1 else a[point], points)
        done = {n: run_episodes(agents[n], first, chunk, params, hparams, rule) for n, rule in rules.items()}
        return {n: agent for n, (agent, _) in done.items()}, {n: log for n, (_, log) in done.items()}

    return Program(parallel.over_agents(start), parallel.over_agents(advance))


def run_block(sweep: Sweep, size: Size, points: EnvParams, seeds: range) -> Iterator[Progress]:
    """Runs some seeds of a sweep at all of its points, one chunk of episodes after the other.

    Seed i has the key `fold_in(key(0), i)` at every point and for every learner, in whatever block it runs.
    """
    chunk = chunk_of(size.episodes)
    first_point = jax.tree.map(lambda a: a[0], points)
    program = program_of(sweep, Spec(first_point.shape, first_point.num_actions), size.episodes, chunk)
    shape = (len(sweep.x_values), len(seeds))
    point, seed = (a.reshape(-1) for a in np.meshgrid(np.arange(shape[0]), np.array(seeds), indexing="ij"))
    lanes = parallel.padded(point.size)
    keys = jax.vmap(lambda i: jax.random.fold_in(jax.random.key(0), i))(jnp.asarray(seed))
    agents = program.start((), parallel.pad_agents(keys, lanes))
    where = parallel.pad_agents(jnp.asarray(point), lanes)
    for first in range(0, size.episodes, chunk):
        agents, log = program.advance((points, jnp.int32(first)), (agents, where))
        unpadded = jax.tree.map(lambda a: np.asarray(a[: math.prod(shape)]).reshape(*shape, chunk), log)
        yield Progress(chunk, unpadded)
