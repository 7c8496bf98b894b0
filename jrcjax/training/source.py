"""What an agent learns in the source environment and hands on: weights and demonstrations (section VI-A.3)."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jrcjax import rng
from jrcjax.checks import refuse, require_keys, require_type
from jrcjax.keys import Purpose, key_of
from jrcjax.learners import Source, Spec
from jrcjax.learners.fixed import FIXED, FixedState
from jrcjax.learners.hparams import Config, HParams
from jrcjax.learners.q_function import q_function
from jrcjax.model import slot
from jrcjax.model.params import EnvParams
from jrcjax.replay import n_step
from jrcjax.replay.n_step import NStepTransition
from jrcjax.training.acting import NUM_WORDS, act_in_slot
from jrcjax.training.footprint import check_memory
from jrcjax.training.rollout import Log, check_training, init_agent, learner_for, run_episodes, spec_of
from jrcjax.types import Float, Int, Key, Words


def demonstrate(key: Key, policy: Float, env_params: EnvParams, hparams: HParams, config: Config) -> NStepTransition:
    """What a greedy policy does in `config.demonstrations` consecutive slots, with some exploration.

    Episodes are as long as in training; the last one, and with it its returns, may be cut short.

    Args:
      key: a PRNG key.
      policy: [S, A] probabilities of the policy.
      env_params: the environment.
      hparams: its `demonstration_epsilon` is the probability of a random action.
      config: its `n_step` is the number of rewards in a return.

    Returns:
      The transitions with their n-step returns, [demonstrations] each.
    """
    words = rng.bits(key, (config.demonstrations, NUM_WORDS + slot.NUM_WORDS))
    slots, demonstrator = env_params.max_steps_in_episode, FixedState(policy, hparams.demonstration_epsilon)

    def one_slot(carry, xs):
        state, first, window = carry
        words, i = xs
        of_slot, of_start = jnp.split(words, [NUM_WORDS])
        position = i % slots
        state = jnp.where(position == 0, slot.initial_state(of_start, env_params), state)
        first = jnp.where(position == 0, state, first)

        def act(words: Words) -> Int:
            return FIXED.act(demonstrator, state, i, words, hparams)

        transition, _ = act_in_slot(of_slot, state, first, act, position == slots - 1, env_params, hparams.discount)
        window = n_step.push(window, transition, position)
        return (transition.next_state, first, window), jax.tree.map(lambda field: field[0], window)

    start = (jnp.int32(0), jnp.int32(0), n_step.init(config.n_step))
    (_, _, window), complete = jax.lax.scan(one_slot, start, (words, jnp.arange(config.demonstrations)))
    # A transition is complete n - 1 slots after it happened; those of the last n - 1 slots end with the data.
    last = min(config.n_step - 1, config.demonstrations)
    return jax.tree.map(
        lambda a, b: jnp.concatenate([a[config.n_step - 1 :], b[b.shape[0] - last :]]), complete, window
    )


def source_of(key: Key, policy: Float, weights, env_params: EnvParams, hparams: HParams, config: Config) -> Source:
    """The source that an agent trained with `key` hands on."""
    key = jax.random.fold_in(key, Purpose.DEMONSTRATIONS)
    return Source(weights, demonstrate(key, policy, env_params, hparams, config))


def train_source(key: Key, env_params: EnvParams, hparams: HParams, config: Config) -> tuple[Source, Log]:
    """Trains a Double DQN agent in the source environment and lets it demonstrate.

    Args:
      key: the agent's PRNG key; the agent is the one that `train` gives for it.
      env_params: the source environment.
      hparams: hyperparameters.
      config: static settings.

    Returns:
      What is handed on, and the log of the training, [episodes].

    Raises:
      ValueError: naming the field, the value and what is allowed, before anything compiles.
    """
    check_training(env_params, hparams, config)
    require_keys(key, 0, "one key, as jax.random.key returns it; use vmap for several")
    learner = learner_for("ddqn", env_params, config)
    check_memory(learner, spec_of(env_params), config, agents=1)
    agent, log = run_episodes(init_agent(key, hparams, learner), 0, config.episodes, env_params, hparams, learner)
    policy = learner.policy(agent.learner)
    return source_of(key, policy, agent.learner.weights, env_params, hparams, config), log


def first_source(source: Source, agents: int) -> Source:
    """The first of the sources of many agents, every leaf of which has a leading axis of agents.

    Raises:
      ValueError: for what is no source, and for another number of them.
    """
    require_type("source", source, Source)
    if any(jnp.shape(leaf)[:1] != (agents,) for leaf in jax.tree.leaves(source)):
        refuse("source", "other leading axes", f"one source for each of the {agents} keys along the first axis")
    return jax.tree.map(lambda leaf: leaf[0], source)


def check_source(source: Source, spec: Spec, config: Config) -> None:
    """Checks that what one agent handed on fits a problem.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    require_type("source", source, Source)
    require_type("source.demonstrations", source.demonstrations, NStepTransition)
    for name, field in source.demonstrations._asdict().items():
        if jnp.shape(field) != (config.demonstrations,):
            allowed = f"shape ({config.demonstrations},), as config.demonstrations has it"
            refuse(f"source.demonstrations.{name}", f"shape {jnp.shape(field)}", allowed)
    wanted = jax.eval_shape(q_function(spec, config).init, key_of(0))
    same_tree = jax.tree.structure(source.weights) == jax.tree.structure(wanted)
    if not same_tree or jax.tree.map(jnp.shape, source.weights) != jax.tree.map(jnp.shape, wanted):
        shapes = jax.tree.map(jnp.shape, source.weights)
        refuse("source.weights", f"shapes {shapes}", f"{jax.tree.map(jnp.shape, wanted)}, as config.hidden has them")
