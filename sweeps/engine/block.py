"""A block: what some seeds of a job give at all of its points, computed the same way wherever it is wanted."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr

from jrcjax.agents.file import LEARNING, acting_part
from jrcjax.learners import Source, Spec, make_learner
from jrcjax.learners.hparams import Config
from jrcjax.learners.q_function import q_function
from jrcjax.replay.n_step import NStepTransition
from jrcjax.training import parallel
from jrcjax.training.rollout import AgentState, Log
from jrcjax.training.source import source_of
from sweeps.engine.job import Job
from sweeps.engine.program import Chunk, advance, joined
from sweeps.results import store

_WEIGHTS, _DEMONSTRATION = "weights_", "demonstration_"  # what names of variables begin with


class Block(NamedTuple):
    """The outcome of some seeds of a job."""

    seeds: range
    results: xr.Dataset
    """What is kept in a part; with weights and demonstrations if the sweep hands on its agents."""
    agents: dict[str, AgentState]
    """By learner that learns, what the agents act by: [points, seeds, ...]."""


def compute(job: Job, seeds: range, source: Source | None = None) -> Block:
    """Runs some seeds of a job.

    Args:
      job: what to run.
      seeds: the seeds.
      source: of the seeds, if the sweep transfers; see `source_in`.
    """
    return block_of(job, seeds, advance(job, seeds, source))


def block_of(job: Job, seeds: range, chunks: Iterable[Chunk]) -> Block:
    """The block that chunks are of; they are taken one after the other, since agents are gone with the next."""
    logs: dict[Any, list[dict[str, Log]]] = {group: [] for group in job.groups}
    done = dict.fromkeys(job.groups, 0)
    agents, sources = {}, {}
    for chunk in chunks:
        logs[chunk.group].append(chunk.log)
        done[chunk.group] += chunk.episodes
        if done[chunk.group] == chunk.group.config.episodes:
            agents[chunk.group] = _acting(chunk)
            if job.sweep.hands_on:
                sources[chunk.group] = _handed_on(job, chunk)
    whole = {g: jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *log) for g, log in logs.items()}
    results = store.dataset(job, seeds, _in_order(job, whole))
    if job.sweep.hands_on:
        results = results.assign(_variables(_in_order(job, sources)))
    return Block(seeds, results, _in_order(job, agents))


def _in_order(job: Job, of_group: dict[Any, Any]) -> Any:
    """What groups have along a leading axis of their points, in the order of all points."""
    if len(job.groups) == 1:
        return of_group[job.groups[0]]
    order = np.argsort([row for group in job.groups for row in group.rows])
    return jax.tree.map(lambda leaf: leaf[order], joined([of_group[group] for group in job.groups]))


def _acting(chunk: Chunk) -> dict[str, AgentState]:
    """What agents act by; Round Robin has nothing of the kind."""

    def kept(name: str) -> AgentState:
        agents = [batch[name]._replace(learner=acting_part(batch[name].learner)) for batch in chunk.agents]
        return chunk.lanes.unpadded(joined(agents))

    return {name: kept(name) for name in chunk.log if name in LEARNING}


def _handed_on(job: Job, chunk: Chunk) -> Source:
    """Weights and demonstrations of a group's agents, [points, seeds, ...]."""
    handed_on = hand_on(job.spec, chunk.group.config)
    keys_and_points = parallel.groups((chunk.lanes.keys, chunk.lanes.points.astype(np.int32)))
    lanes = [(*which, batch["ddqn"].learner) for which, batch in zip(keys_and_points, chunk.agents, strict=True)]
    return chunk.lanes.unpadded(joined([handed_on(job.table, batch) for batch in lanes]))


@functools.cache
def hand_on(spec: Spec, config: Config) -> Callable:
    """(points, lanes = (keys, points' numbers, states of DDQN)) to what these agents hand on, compiled."""
    learner = make_learner("ddqn", spec, config)

    def one(points, agent):
        key, point, state = agent
        params, hparams = jax.tree.map(lambda a: a[point], points)
        return source_of(key, learner.policy(state), state.weights, params, hparams, config)

    return parallel.over_agents(one)


def _variables(source: Source) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """A source as named arrays: weights by their path, demonstrations by their field."""
    arrays: dict[str, tuple[tuple[str, ...], np.ndarray]] = {
        f"{_DEMONSTRATION}{name}": (("point", "seed", "transition"), np.asarray(field))
        for name, field in source.demonstrations._asdict().items()
    }
    for path, leaf in jax.tree_util.tree_leaves_with_path(source.weights):
        name = _weights_name(path)
        arrays[name] = (("point", "seed", *(f"{name}_{axis}" for axis in range(leaf.ndim - 2))), np.asarray(leaf))
    return arrays


def _weights_name(path: Any) -> str:
    return _WEIGHTS + "_".join(str(part.key) for part in path)


def handed_on(name: str) -> bool:
    """Whether a variable of results is part of what source agents hand on."""
    return name.startswith((_WEIGHTS, _DEMONSTRATION))


def source_in(job: Job, results: xr.Dataset) -> Source:
    """The source that results of a job which hands on its agents hold: leaves with axes of points and of seeds."""
    function = q_function(job.spec, job.groups[0].config)
    like = jax.eval_shape(function.init, jax.random.key(0))
    weights = [
        jax.device_put(results[_weights_name(path)].values) for path, _ in jax.tree_util.tree_leaves_with_path(like)
    ]
    fields = (jax.device_put(results[f"{_DEMONSTRATION}{name}"].values) for name in NStepTransition._fields)
    return Source(jax.tree.unflatten(jax.tree.structure(like), weights), NStepTransition(*fields))
