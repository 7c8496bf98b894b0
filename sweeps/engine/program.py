"""A sweep as one XLA program: points x seeds x learners advance together by a chunk of episodes."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax import exact
from jrcjax.config.paths import Points
from jrcjax.learners import Source, Spec, make_learner
from jrcjax.learners.hparams import Config, check_hparams
from jrcjax.learners.schedules import epsilon
from jrcjax.model.params import check_params
from jrcjax.training import parallel
from jrcjax.training.rollout import AgentState, Log, init_agent, run_episodes, spec_of
from jrcjax.training.transfer import target_key
from jrcjax.types import Key
from sweeps.sweep import Size, Sweep

_CHUNK = 20  # most episodes between two reports of progress: a few seconds


class Progress(NamedTuple):
    """A chunk of a running sweep."""

    episodes: int
    """Episodes in the chunk."""
    log: dict[str, Log]
    """By learner: [points, seeds, episodes] each."""
    groups: list[dict[str, AgentState]]
    """Agents by learner after the chunk, gone with the next, in groups of lanes; see `joined`."""


def chunk_of(episodes: int) -> int:
    """The largest divisor of `episodes` up to _CHUNK, so that one compiled program serves all chunks."""
    return max(d for d in range(1, min(episodes, _CHUNK) + 1) if episodes % d == 0)


def points_of(sweep: Sweep, preset: str) -> Points:
    """The environments and hyperparameters of all points, checked and stacked along a leading axis."""
    points = [Points(sweep.params_at(x, preset), sweep.hparams_at(x)) for x in sweep.x_values]
    for point in points:
        check_params(point.params)
        check_hparams(point.hparams)
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *points)


def spec_of_points(points: Points) -> Spec:
    """What learners need to know of all points alike."""
    return spec_of(jax.tree.map(lambda leaf: leaf[0], points.params))


class Reference(NamedTuple):
    """Exact long-run figures at each point."""

    optimum: exact.LongRun
    """[points]."""
    constant: exact.LongRun
    """Of the best policy that ignores the state, [points]."""
    explored: exact.LongRun
    """Of the optimal policy with the learners' random actions, [points, episodes]: the most that a learner can earn."""


def reference_of(points: Points, episodes: int) -> Reference:
    """What learners are held against at each point."""
    slots = points.params.max_steps_in_episode

    def at(point: Points) -> Reference:
        params, hparams = point
        best = exact.optimal_policy(params)

        def explored(episode):
            random = epsilon(episode * slots + jnp.arange(slots), hparams).mean()
            return exact.evaluate_policy(params, (1 - random) * best + random / params.num_actions)

        optimum, constant = (exact.evaluate_policy(params, p) for p in (best, exact.best_constant_action(params)))
        return Reference(optimum, constant, jax.vmap(explored)(jnp.arange(episodes)))

    return jax.jit(jax.vmap(at))(points)


class Program(NamedTuple):
    """A sweep's compiled functions over lanes; a lane is one seed at one point."""

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
        # A single point is shared by all lanes, and its bank of placements with it.
        return jax.tree.map(lambda a: a[0] if a.shape[0] == 1 else a[point], points)

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


def keys_of(seeds: np.ndarray) -> Key:
    """Keys of seeds [N]: seed i has `fold_in(key(0), i)`, whatever other seeds there are."""
    return jax.vmap(lambda i: jax.random.fold_in(jax.random.key(0), i))(jnp.asarray(seeds))


def run_block(sweep: Sweep, size: Size, points: Points, seeds: range, source: Source | None) -> Iterator[Progress]:
    """Runs some seeds of a sweep at all of its points, one chunk of episodes after the other.

    A seed has the same key at every point and for every learner, in whatever block it runs: that of `keys_of`, or its
    `target_key` in a sweep that transfers, since the seed's source agent has the other. Lanes advance in groups that
    give each device one block, so the compiled code, and with it every bit of a seed's results, is the same whatever
    seeds run beside it.

    Args:
      sweep: what to run.
      size: how much of it.
      points: its points.
      seeds: the seeds.
      source: of the seeds, if the sweep transfers; every leaf has leading axes of the source's points and of seeds.
    """
    chunk = chunk_of(size.episodes)
    spec = spec_of_points(points)
    program = program_of(sweep.learners, spec, sweep.config(size), chunk)
    shape = (len(sweep.x_values), len(seeds))
    point, seed = (a.reshape(-1) for a in np.indices(shape))
    keys = keys_of(np.array(seeds)[seed])
    if sweep.source:
        keys = jax.vmap(target_key)(keys)
    source_point = np.array(sweep.source_points or [0] * shape[0])[point]
    of_lane: Any = jax.tree.map(lambda leaf: leaf[source_point, seed], source)
    groups = [
        (program.start(points, lanes), lanes[2]) for lanes in parallel.groups((keys, of_lane, jnp.asarray(point)))
    ]
    for first in range(0, size.episodes, chunk):
        advanced = [program.advance((points, jnp.int32(first)), group) for group in groups]
        groups = [lanes for lanes, _ in advanced]
        log = joined([log for _, log in advanced])
        unpadded = jax.tree.map(lambda a: a[: math.prod(shape)].reshape(*shape, chunk), log)
        yield Progress(chunk, unpadded, [agents for agents, _ in groups])


def joined(groups: list[Any]) -> Any:
    """Groups of lanes as one, on the host.

    Joined on the devices they would be exchanged between them, and a device that waits for another which has the work
    of other groups before it waits until XLA gives up.
    """

    def join(*parts: Any) -> Any:
        if jnp.issubdtype(parts[0].dtype, jax.dtypes.prng_key):
            return jax.random.wrap_key_data(join(*map(jax.random.key_data, parts)))
        return np.concatenate([np.asarray(part) for part in parts])

    return jax.tree.map(join, *groups)
