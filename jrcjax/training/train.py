"""Training agents from scratch in one environment: one as a pure function, or many on all cores."""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax

from jrcjax.checks import refuse, require_keys
from jrcjax.keys import Purpose
from jrcjax.learners import Learner, LearnerFactory, Source, Spec, make_learner
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.params import EnvParams
from jrcjax.model.presets import paper_params
from jrcjax.training.footprint import check_memory
from jrcjax.training.parallel import first_agents, over_agents, pad_agents, padded
from jrcjax.training.rollout import AgentState, Log, check_training, init_agent, learner_for, run_episodes, spec_of
from jrcjax.training.source import check_source, first_source, train_source
from jrcjax.types import Key


def train(
    key: Key,
    env_params: EnvParams,
    hparams: HParams | None = None,
    *,
    learner: str | LearnerFactory,
    config: Config | None = None,
    source: Source | None = None,
) -> tuple[AgentState, Log]:
    """Trains one agent: Algorithm 1 for "ddqn", Algorithm 2 for "tlwd".

    Pure, and vmappable over all positional arguments.

    Args:
      key: the agent's PRNG key; with `source` it alone decides the agent's random numbers.
      env_params: the environment.
      hparams: hyperparameters; Table I's if None.
      learner: "round_robin", "q_learning", "ddqn", "dpr", "tlwd", or a factory of your own.
      config: static settings; Table I's if None.
      source: what "dpr" and "tlwd" take over, from `train_source`. If None, they train an agent in the paper's source
        environment first, which `jrcjax.transfer` does once for all learners.

    Returns:
      The agent after the last episode, and its log with one entry per episode.

    Raises:
      ValueError: naming the field, the value and what is allowed, before anything compiles.
    """
    hparams, config = filled_in(hparams, config)
    check_training(env_params, hparams, config)
    require_keys(key, 0, "one key, as jax.random.key returns it; use vmap or train_agents for several")
    rule = learner_for(learner, env_params, config)
    check_memory(rule, spec_of(env_params), config, agents=1)
    paper_source = _check_or_choose_source(source, rule, spec_of(env_params), config)
    return _from_scratch(key, source, (env_params, hparams, paper_source), rule, config)


def _from_scratch(
    key: Key,
    source: Source | None,
    shared: tuple[EnvParams, HParams, EnvParams | None],
    learner: Learner,
    config: Config,
) -> tuple[AgentState, Log]:
    env_params, hparams, paper_source = shared
    if paper_source is not None:
        source, _ = train_source(jax.random.fold_in(key, Purpose.SOURCE), paper_source, hparams, config)
    agent = init_agent(key, hparams, learner, source)
    return run_episodes(agent, 0, config.episodes, env_params, hparams, learner)


def train_agents(
    keys: Key,
    env_params: EnvParams,
    hparams: HParams | None = None,
    *,
    learner: str | LearnerFactory,
    config: Config | None = None,
    source: Source | None = None,
) -> tuple[AgentState, Log]:
    """`train` for many keys in one environment, in blocks on all cores (see `jrcjax.training.parallel`).

    Args:
      keys: [N] PRNG keys.
      env_params: the environment, shared by all agents.
      hparams: hyperparameters, shared by all agents; Table I's if None.
      learner: as for `train`.
      config: static settings; Table I's if None.
      source: as for `train`, one for each agent: every leaf has a leading axis of N.

    Returns:
      The agents and their logs, each leaf with a leading axis of N.

    Raises:
      ValueError: naming the field, the value and what is allowed, before anything compiles.
    """
    hparams, config = filled_in(hparams, config)
    check_training(env_params, hparams, config)
    require_keys(keys, 1, "an array of at least one key, as jax.random.split returns it")
    spec, agents = spec_of(env_params), keys.shape[0]
    one_source = None if source is None else first_source(source, agents)
    rule = make_learner(learner, spec, config)
    check_memory(rule, spec, config, padded(agents))
    paper_source = _check_or_choose_source(one_source, rule, spec, config)
    run = _many_agents(learner, spec, config)
    done = run((env_params, hparams, paper_source), pad_agents((keys, source), padded(agents)))
    return first_agents(done, agents)


@functools.cache
def _many_agents(learner: str | LearnerFactory, spec: Spec, config: Config) -> Callable:
    """The same compiled function for the same learner, shapes and settings."""
    rule = make_learner(learner, spec, config)

    def one(shared, agent):
        key, source = agent
        return _from_scratch(key, source, shared, rule, config)

    return over_agents(one)


def _check_or_choose_source(source: Source | None, learner: Learner, spec: Spec, config: Config) -> EnvParams | None:
    """Checks `source`; where the learner needs one and there is none, the environment to train it in."""
    if source is not None:
        check_source(source, spec, config)
    if source is not None or not learner.needs_source:
        return None
    paper_source = paper_params("source")
    if (paper_source.shape, paper_source.num_actions) != spec[:2]:
        refuse("source", "None", "for an environment unlike the paper's a Source, as train_source returns it")
    return paper_source


def filled_in(hparams: HParams | None, config: Config | None) -> tuple[HParams, Config]:
    """Table I's hyperparameters and settings where there are none."""
    return HParams() if hparams is None else hparams, Config() if config is None else config
