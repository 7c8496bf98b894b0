"""Training many agents chunk by chunk, with a callback between chunks for whoever watches or logs."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp

from jrcjax.checks import refuse, require_integer, require_keys
from jrcjax.learners import LearnerFactory, Source
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.params import EnvParams
from jrcjax.training.footprint import check_memory
from jrcjax.training.parallel import first_agents, over_agents, pad_agents, padded
from jrcjax.training.rollout import AgentState, Log, check_training, init_agent, learner_for, run_episodes, spec_of
from jrcjax.training.source import check_source, first_source
from jrcjax.training.train import filled_in
from jrcjax.types import Key


def train_in_chunks(
    keys: Key,
    env_params: EnvParams,
    hparams: HParams | None = None,
    *,
    learner: str | LearnerFactory,
    config: Config | None = None,
    source: Source | None = None,
    on_progress: Callable[[int, Log], None],
    chunk: int = 10,
) -> tuple[AgentState, Log]:
    """`train_agents` that calls back after every chunk of episodes.

    The numbers are those of `train_agents` up to rounding, since another number of episodes is compiled.

    Args:
      keys: [N] PRNG keys.
      env_params: the environment, shared by all agents.
      hparams: hyperparameters, shared by all agents; Table I's if None.
      learner: as for `train`.
      config: static settings; Table I's if None.
      source: for learners that transfer, one for each agent: every leaf has a leading axis of N.
      on_progress: called with the number of episodes done so far and the log of the last chunk, [N, chunk] each.
      chunk: episodes per call, the last of which may be shorter.

    Returns:
      The agents and their whole logs, each leaf with a leading axis of N.

    Raises:
      ValueError: naming the field, the value and what is allowed, before anything compiles.
    """
    hparams, config = filled_in(hparams, config)
    check_training(env_params, hparams, config)
    require_keys(keys, 1, "an array of at least one key, as jax.random.split returns it")
    require_integer("chunk", chunk, 1)
    rule, count = learner_for(learner, env_params, config), keys.shape[0]
    check_memory(rule, spec_of(env_params), config, padded(count))
    if source is None and rule.needs_source:
        refuse("source", "None", "for a learner that transfers a Source per key, as a vmapped train_source returns it")
    if source is not None:
        check_source(first_source(source, count), spec_of(env_params), config)

    def started(hparams, agent):
        return init_agent(agent[0], hparams, rule, agent[1])

    def advanced_by(episodes: int):
        def advance(shared, agent):
            first, hparams, env_params = shared
            return run_episodes(agent, first, episodes, env_params, hparams, rule)

        return over_agents(advance, in_place=True)

    agents = over_agents(started)(hparams, pad_agents((keys, source), padded(count)))
    advance, logs = advanced_by(chunk), []
    for first in range(0, config.episodes, chunk):
        length = min(chunk, config.episodes - first)
        advance = advance if length == chunk else advanced_by(length)
        agents, log = advance((jnp.int32(first), hparams, env_params), agents)
        logs.append(first_agents(log, count))
        on_progress(first + length, logs[-1])
    whole = jax.tree.map(lambda *leaves: jnp.concatenate(leaves, axis=1), *logs)
    return first_agents(agents, count), whole
