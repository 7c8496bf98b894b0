"""From source to target: what the paper's section V proposes and section VI compares, as one pure function."""

from __future__ import annotations

from typing import NamedTuple

import jax

from jrcjax.checks import refuse, require_keys
from jrcjax.keys import Purpose
from jrcjax.learners import LEARNERS, Source
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.params import EnvParams
from jrcjax.training.footprint import check_memory
from jrcjax.training.rollout import AgentState, Log, check_training, init_agent, learner_for, run_episodes, spec_of
from jrcjax.training.source import train_source
from jrcjax.training.train import filled_in
from jrcjax.types import Key

TARGET_LEARNERS = ("tlwd", "dpr", "ddqn", "q_learning", "round_robin")


class Transfer(NamedTuple):
    """One seed's whole study."""

    source: Source
    """Weights and demonstrations of the source agent."""
    source_log: Log
    """Its training in the source environment."""
    agents: dict[str, AgentState]
    """By learner, after training in the target environment."""
    logs: dict[str, Log]
    """By learner, the training in the target environment."""


def target_key(key: Key) -> Key:
    """The key of all learners in the target environment; `key` itself is the source agent's."""
    return jax.random.fold_in(key, Purpose.TARGET)


def transfer(
    key: Key,
    source_params: EnvParams,
    target_params: EnvParams,
    hparams: HParams | None = None,
    *,
    config: Config | None = None,
    source_hparams: HParams | None = None,
    source_config: Config | None = None,
    learners: tuple[str, ...] = TARGET_LEARNERS,
) -> Transfer:
    """Trains a source agent, lets it demonstrate, and trains all learners in the target environment.

    Pure, and vmappable over all positional arguments. Under a vmap over `target_params` alone the source agent is
    trained once, since nothing of it depends on the target. All learners start from the same key; those that draw as
    many words in a slot, as "ddqn" and "dpr" do, meet the same states and events, the others have numbers of their own.

    Args:
      key: the seed's PRNG key.
      source_params: the source environment.
      target_params: the target environment, with the same factors and actions.
      hparams: hyperparameters; Table I's if None.
      config: static settings; Table I's if None.
      source_hparams: hyperparameters of the source agent; `hparams` if None. `HParams()` is Table I's.
      source_config: static settings of the source agent; `config` if None. It must have the same layers, demonstrations
        and n.
      learners: names of the learners in the target environment.

    Returns:
      The source, and agents and logs of all learners.

    Raises:
      ValueError: naming the field, the value and what is allowed, before anything compiles.
    """
    hparams, config = filled_in(hparams, config)
    source_hparams, source_config = source_hparams or hparams, source_config or config
    check_training(source_params, source_hparams, source_config)
    check_training(target_params, hparams, config)
    require_keys(key, 0, "one key, as jax.random.key returns it; use vmap for several")
    if spec_of(source_params)[:2] != spec_of(target_params)[:2]:
        shape, actions, _ = spec_of(target_params)
        allowed = f"levels {source_params.shape} and {source_params.num_actions} actions, as the source has"
        refuse("target_params", f"levels {shape} and {actions} actions", allowed)
    _check_source_config(source_config, config)
    if not isinstance(learners, tuple | list):
        refuse("learners", repr(learners), f"a tuple of {', '.join(map(repr, LEARNERS))}")
    rules = {name: learner_for(name, target_params, config) for name in learners}
    for rule in rules.values():
        check_memory(rule, spec_of(target_params), config, agents=1)
    source, source_log = train_source(key, source_params, source_hparams, source_config)
    agents, logs = {}, {}
    for name, rule in rules.items():
        agent = init_agent(target_key(key), hparams, rule, source)
        agents[name], logs[name] = run_episodes(agent, 0, config.episodes, target_params, hparams, rule)
    return Transfer(source, source_log, agents, logs)


def _check_source_config(source_config: Config, config: Config) -> None:
    """Refuses a source agent from whose settings the target's learners can't go on."""
    for name in ("hidden", "demonstrations", "n_step"):
        given, wanted = getattr(source_config, name), getattr(config, name)
        if given != wanted:
            refuse(f"source_config.{name}", str(given), f"{wanted}, as config.{name} has it")
