"""The training loop of one agent: nested scans over episodes and slots, written for one agent and vmapped over many.

`init_agent` and `run_episodes` are what `train` and `transfer` are made of, for callers that advance agents in chunks
and want to show progress or save in between. The agents are the same for every choice of chunks; the exact figures in
the log may differ in the last bit, because XLA compiles a chunk of one episode differently.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jrcjax import rng
from jrcjax.checks import refuse
from jrcjax.exact import LongRun, evaluate_policy
from jrcjax.keys import Purpose
from jrcjax.learners import Learner, LearnerFactory, Source, Spec, exploration, make_learner
from jrcjax.learners.hparams import Config, HParams, check_config, check_hparams
from jrcjax.model import metrics, slot
from jrcjax.model.params import EnvParams, check_params
from jrcjax.training.acting import NUM_WORDS, act_in_slot
from jrcjax.training.divergence import has_diverged
from jrcjax.types import Bool, Float, Int, Key, Words

ENUMERABLE = 2**20
"""States up to which a policy is evaluated exactly after each episode, which takes some 200 MB per agent there."""


class AgentState(NamedTuple):
    """One agent between two episodes."""

    key: Key
    learner: Any
    """The learner's state."""


class Log(NamedTuple):
    """Per episode, [episodes]; policy figures are exact and belong to the policy without exploration.

    With more than ENUMERABLE states policy figures are NaN, and divergence is not looked for.
    """

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
    diverged: Bool
    """Whether the learner's values have diverged at the episode's end, see `jrcjax.training.divergence`."""


def check_training(env_params: EnvParams, hparams: HParams, config: Config) -> None:
    """Checks all that an agent is trained with.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    check_params(env_params)
    check_hparams(hparams)
    check_config(config)
    most = (2**31 - 1) // env_params.max_steps_in_episode
    if config.episodes > most:
        allowed = (
            f"at most {most}, since slots of {env_params.max_steps_in_episode} per episode are numbered in 32 bits"
        )
        refuse("config.episodes", config.episodes, allowed)


def spec_of(env_params: EnvParams) -> Spec:
    """What learners need to know of an environment."""
    return Spec(env_params.shape, env_params.num_actions, env_params.max_steps_in_episode)


def learner_for(learner: str | LearnerFactory, env_params: EnvParams, config: Config) -> Learner:
    """The learner for an environment of these shapes."""
    return make_learner(learner, spec_of(env_params), config)


def init_agent(key: Key, hparams: HParams, learner: Learner, source: Source | None = None) -> AgentState:
    """An agent before its first episode; learners that transfer need a `source`."""
    return AgentState(key, learner.init(jax.random.fold_in(key, Purpose.INIT), hparams, source))


def train_in_slot(
    carry: tuple[Int, Any, metrics.Metrics],
    words: Words,
    drawn: Any,
    number: Int,
    first: Int,
    last: jax.Array,
    env_params: EnvParams,
    hparams: HParams,
    learner: Learner,
) -> tuple[Int, Any, metrics.Metrics]:
    """One slot of one agent: act, observe, learn, measure.

    Args:
      carry: state id, learner state, sums of the metrics.
      words: [NUM_WORDS] random words of the slot.
      drawn: what the learner drew for its update.
      number: slots before this one, the same for all agents.
      first: id of the episode's first state.
      last: whether the slot is the episode's last.
      env_params: the environment.
      hparams: hyperparameters.
      learner: the learning rule.
    """
    state, learner_state, sums = carry

    def act(words: Words) -> Int:
        return learner.act(learner_state, state, number, words, hparams)

    transition, outcome = act_in_slot(words, state, first, act, last, env_params, hparams.discount)
    learner_state = learner.update(learner_state, transition, number, drawn, hparams)
    return outcome.next_state, learner_state, slot.measure(sums, outcome, env_params)


def run_episode(
    agent: AgentState, episode: Int, env_params: EnvParams, hparams: HParams, learner: Learner
) -> tuple[AgentState, Log]:
    """Episode number `episode` (from 0, the same for all agents): the agent after it, and its log (scalars)."""
    slots = env_params.max_steps_in_episode
    num_words = slot.NUM_WORDS + max(learner.num_words, exploration.NUM_WORDS)
    key = jax.random.fold_in(jax.random.fold_in(agent.key, Purpose.EPISODES), episode)
    words = rng.bits(key, (slots + 1, num_words))
    of_slots, of_updates = jnp.split(words[:slots], [NUM_WORDS], axis=1)
    numbers = episode * slots + jnp.arange(slots)

    first = slot.initial_state(words[slots, : slot.NUM_WORDS], env_params)

    def one_slot(carry, xs):
        words, drawn, number, i = xs
        return train_in_slot(carry, words, drawn, number, first, i == slots - 1, env_params, hparams, learner), None

    start = (first, agent.learner, metrics.zero())
    (_, learner_state, sums), _ = jax.lax.scan(
        one_slot, start, (of_slots, learner.draw(of_updates, numbers), numbers, jnp.arange(slots))
    )
    simulated = (metrics.average_reward(sums), metrics.throughput(sums), metrics.miss_detection(sums))
    exact, diverged = LongRun(*(jnp.float32(jnp.nan),) * 3), jnp.bool_(False)
    if env_params.num_states <= ENUMERABLE:
        exact = evaluate_policy(env_params, learner.policy(learner_state))
        if learner.values is not None:
            diverged = has_diverged(learner.values(learner_state), env_params, hparams.discount)
    log = Log(*simulated, *exact, diverged)
    return AgentState(agent.key, learner_state), log


def run_episodes(
    agent: AgentState, first: Int | int, episodes: int, env_params: EnvParams, hparams: HParams, learner: Learner
) -> tuple[AgentState, Log]:
    """Episodes `first` to `first + episodes - 1`: the agent after them, and their log ([episodes] each)."""

    def one_episode(agent, episode):
        return run_episode(agent, episode, env_params, hparams, learner)

    return jax.lax.scan(one_episode, agent, first + jnp.arange(episodes))
