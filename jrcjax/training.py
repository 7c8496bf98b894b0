"""Training one agent: nested scans over episodes and slots, written for one agent and vmapped over many.

`train` is a pure function. `init_agent` and `run_episodes` are its two halves, for callers that advance agents in
chunks and want to show progress or save in between. The agents are the same for every choice of chunks; the exact
figures in the log may differ in the last bit, because XLA compiles a chunk of one episode differently.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jrcjax import exploration, metrics, slot
from jrcjax.checks import refuse
from jrcjax.exact import evaluate_policy
from jrcjax.hparams import Config, HParams, check_config, check_hparams
from jrcjax.learners import Learner, LearnerFactory, Spec, make_learner
from jrcjax.parallel import over_agents, pad_agents, padded
from jrcjax.params import EnvParams, check_params
from jrcjax.replay import Transition
from jrcjax.types import Float, Int, Key, Words

_INIT, _EPISODES = 0, 1  # purposes of an agent's key


class AgentState(NamedTuple):
    """One agent between two episodes."""

    key: Key
    learner: Any
    """The learner's state."""


class Log(NamedTuple):
    """Per episode, [episodes]; the last three are exact and belong to the policy without exploration."""

    reward: Float
    """Mean reward per slot."""
    throughput: Float
    """Packets in the episode, equation (6)."""
    miss_detection: Float
    """P_k, equation (7); NaN in an episode in which the convention counts no slot."""
    policy_reward: Float
    """Long-run reward per slot of the policy at the episode's end."""
    policy_throughput: Float
    """Its packets per slot."""
    policy_miss_detection: Float
    """Its miss detection."""


def learner_for(learner: str | LearnerFactory, env_params: EnvParams, config: Config) -> Learner:
    """The learner for an environment of these shapes."""
    return make_learner(learner, Spec(env_params.shape, env_params.num_actions), config)


def init_agent(key: Key, hparams: HParams, learner: Learner) -> AgentState:
    """An agent before its first episode."""
    return AgentState(key, learner.init(jax.random.fold_in(key, _INIT), hparams))


def run_slot(
    carry: tuple[Int, Any, metrics.Metrics],
    words: Words,
    number: Int,
    last: jax.Array,
    env_params: EnvParams,
    hparams: HParams,
    learner: Learner,
) -> tuple[Int, Any, metrics.Metrics]:
    """One slot of one agent: act, observe, learn, measure.

    Args:
      carry: state id, learner state, sums of the metrics.
      words: random words of the slot: the environment's, the action's, the update's.
      number: slots before this one, the same for all agents.
      last: whether the slot is the episode's last.
      env_params: the environment.
      hparams: hyperparameters.
      learner: the learning rule.
    """
    state, learner_state, sums = carry
    of_slot, of_action, of_update = jnp.split(words, [slot.NUM_WORDS, slot.NUM_WORDS + exploration.NUM_WORDS])
    action = learner.act(learner_state, state, number, of_action, hparams)
    outcome = slot.run_slot(of_slot, state, action, env_params)
    terminal = last & (env_params.terminal_time_limit == 1)
    transition = Transition(state, action, outcome.reward, outcome.next_state, terminal.astype(jnp.int32))
    learner_state = learner.update(learner_state, transition, number, of_update, hparams)
    return outcome.next_state, learner_state, slot.measure(sums, outcome, env_params)


def run_episode(
    agent: AgentState, episode: Int, env_params: EnvParams, hparams: HParams, learner: Learner
) -> tuple[AgentState, Log]:
    """Episode number `episode` (from 0, the same for all agents): the agent after it, and its log (scalars)."""
    slots = env_params.max_steps_in_episode
    num_words = slot.NUM_WORDS + max(learner.num_words, exploration.NUM_WORDS)
    key = jax.random.fold_in(jax.random.fold_in(agent.key, _EPISODES), episode)
    words = jax.random.bits(key, (slots + 1, num_words), jnp.uint32)

    def one_slot(carry, xs):
        words, i = xs
        return run_slot(carry, words, episode * slots + i, i == slots - 1, env_params, hparams, learner), None

    start = (slot.initial_state(words[slots, : slot.NUM_WORDS], env_params), agent.learner, metrics.zero())
    (_, learner_state, sums), _ = jax.lax.scan(one_slot, start, (words[:slots], jnp.arange(slots)))
    exact = evaluate_policy(env_params, learner.policy(learner_state))
    log = Log(metrics.average_reward(sums), metrics.throughput(sums), metrics.miss_detection(sums), *exact)
    return AgentState(agent.key, learner_state), log


def run_episodes(
    agent: AgentState, first: Int | int, episodes: int, env_params: EnvParams, hparams: HParams, learner: Learner
) -> tuple[AgentState, Log]:
    """Episodes `first` to `first + episodes - 1`: the agent after them, and their log ([episodes] each)."""

    def one_episode(agent, episode):
        return run_episode(agent, episode, env_params, hparams, learner)

    return jax.lax.scan(one_episode, agent, first + jnp.arange(episodes))


def train(
    key: Key,
    env_params: EnvParams,
    hparams: HParams | None = None,
    *,
    learner: str | LearnerFactory,
    config: Config | None = None,
) -> tuple[AgentState, Log]:
    """Trains one agent from scratch: Algorithm 1 for "ddqn". Pure, and vmappable over all positional arguments.

    Args:
      key: the agent's PRNG key; it alone decides the agent's random numbers.
      env_params: the environment.
      hparams: hyperparameters; Table I's if None.
      learner: "round_robin", "q_learning", "ddqn", or a factory of your own.
      config: static settings; Table I's if None.

    Returns:
      The agent after the last episode, and its log with one entry per episode.

    Raises:
      ValueError: naming the field, the value and what is allowed, before anything compiles.
    """
    hparams, config = _checked(env_params, hparams, config)
    _check_keys(key, 0, "one key, as jax.random.key returns it; use vmap or train_agents for several")
    return _from_scratch(key, env_params, hparams, learner_for(learner, env_params, config), config.episodes)


def _from_scratch(
    key: Key, env_params: EnvParams, hparams: HParams, learner: Learner, episodes: int
) -> tuple[AgentState, Log]:
    return run_episodes(init_agent(key, hparams, learner), 0, episodes, env_params, hparams, learner)


def train_agents(
    keys: Key,
    env_params: EnvParams,
    hparams: HParams | None = None,
    *,
    learner: str | LearnerFactory,
    config: Config | None = None,
) -> tuple[AgentState, Log]:
    """`train` for many keys in one environment, in blocks on all cores (see `jrcjax.parallel`).

    Args:
      keys: [N] PRNG keys.
      env_params: the environment, shared by all agents.
      hparams: hyperparameters, shared by all agents; Table I's if None.
      learner: as for `train`.
      config: static settings; Table I's if None.

    Returns:
      The agents and their logs, each leaf with a leading axis of N.

    Raises:
      ValueError: naming the field, the value and what is allowed, before anything compiles.
    """
    hparams, config = _checked(env_params, hparams, config)
    _check_keys(keys, 1, "an array of at least one key, as jax.random.split returns it")
    run = _many_agents(learner, Spec(env_params.shape, env_params.num_actions), config)
    done = run((env_params, hparams), pad_agents(keys, padded(keys.shape[0])))
    return jax.tree.map(lambda leaf: leaf[: keys.shape[0]], done)


@functools.cache
def _many_agents(learner: str | LearnerFactory, spec: Spec, config: Config) -> Callable:
    """The same compiled function for the same learner, shapes and settings."""
    rule = make_learner(learner, spec, config)

    def one(shared, key):
        env_params, hparams = shared
        return _from_scratch(key, env_params, hparams, rule, config.episodes)

    return over_agents(one)


def _check_keys(keys: Key, dimensions: int, allowed: str) -> None:
    if not isinstance(keys, jax.Array):
        refuse("key", f"object of type {type(keys).__name__}", allowed)
    typed = jnp.issubdtype(keys.dtype, jax.dtypes.prng_key)
    shape = keys.shape if typed else keys.shape[:-1]  # an old-style key is an array of two words
    if len(shape) != dimensions or 0 in shape:
        refuse("key", f"shape {keys.shape}", allowed)


def _checked(env_params: EnvParams, hparams: HParams | None, config: Config | None) -> tuple[HParams, Config]:
    """Fills in the defaults and checks everything."""
    hparams = HParams() if hparams is None else hparams
    config = Config() if config is None else config
    check_params(env_params)
    check_hparams(hparams)
    check_config(config)
    return hparams, config
