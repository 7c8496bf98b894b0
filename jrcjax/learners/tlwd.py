"""Transfer learning with demonstrations: Algorithm 2 with the paper's equations (23) to (29).

Double DQN with a memory that also holds what the source agent did in its environment, sampled by priority, and a loss
of four parts. It learns from the demonstrations alone first, then goes on in the target environment.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import optax

from jrcjax import rng
from jrcjax.checks import refuse
from jrcjax.learners import exploration
from jrcjax.learners.base import Learner, Source, Spec
from jrcjax.learners.hparams import Config, HParams, optimiser_of
from jrcjax.learners.q_function import QFunction, copied_if, q_function
from jrcjax.learners.schedules import epsilon, importance_exponent
from jrcjax.learners.value_learning import l2_loss, large_margin_loss, td_target
from jrcjax.model import states
from jrcjax.policies import greedy_policy
from jrcjax.replay import n_step, prioritised
from jrcjax.replay.n_step import NStepTransition
from jrcjax.replay.prioritised import Memory, Sample
from jrcjax.replay.uniform import Transition
from jrcjax.types import Float, Int, Words


class TLwDState(NamedTuple):
    """One agent's networks, optimiser and memory."""

    weights: Any
    """theta."""
    target: Any
    """theta' as its table [A, S], or as weights in the mini-batch form."""
    optimiser: Any
    memory: Memory
    window: NStepTransition
    """The last n transitions, whose returns are still growing."""


class Losses(NamedTuple):
    """The parts of equation (25), of one transition each, [B]."""

    td_error: Float
    """zeta_i, its square is J_DDQN, equation (26)."""
    n_step_error: Float
    """Its square is J_n, equation (27)."""
    margin: Float
    """J_E, equation (29); 0 for what is no demonstration."""


def losses(function: QFunction, weights: Any, target: Any, batch: Sample, hparams: HParams) -> Losses:
    """The errors and the large-margin loss of each transition of a batch."""
    t = batch.transitions
    q = function.of_states(weights, t.state)
    chosen = jnp.where(jax.nn.one_hot(t.action, q.shape[0], dtype=bool, axis=0), q, 0.0).sum(axis=0)
    discount = jnp.where(t.terminal == 1, 0.0, hparams.discount)
    y = td_target(t.reward, discount, function.double_q(weights, target, t.next_state))
    y_n = td_target(t.n_return, t.n_discount, function.greatest(target, t.n_state))
    margin = jnp.where(batch.is_demonstration, large_margin_loss(q, t.action, hparams.margin, axis=0), 0.0)
    return Losses(y - chosen, y_n - chosen, margin)


def combined_loss(parts: Losses, importance: Float, weights: Any, hparams: HParams) -> Float:
    """J(Q), equation (25): means over the batch, each transition weighted by `importance` [B], equation (24)."""
    chex.assert_equal_shape([*parts, importance])  # a mean over a broadcast pair would be silently wrong
    of_transition = (
        jnp.square(parts.td_error)
        + hparams.n_step_weight * jnp.square(parts.n_step_error)
        + hparams.margin_weight * parts.margin
    )
    return jnp.mean(importance * of_transition) + hparams.l2_weight * l2_loss(weights)


def tlwd(spec: Spec, config: Config) -> Learner:
    """Transfer learning with demonstrations; pre-training takes place in `init`."""
    if config.demonstrations >= config.replay_capacity:
        allowed = f"fewer than config.replay_capacity = {config.replay_capacity}, which holds new transitions too"
        refuse("config.demonstrations", config.demonstrations, allowed)
    function = q_function(spec, config)
    optimiser = optimiser_of(config)
    where = prioritised.layout(
        states.num_states(spec.shape), spec.num_actions, config.replay_capacity, config.demonstrations
    )
    updates = config.pretraining + config.episodes * spec.episode_slots

    def loss(weights, target, batch: Sample, importance: Float, hparams: HParams) -> tuple[Float, Float]:
        parts = losses(function, weights, target, batch, hparams)
        return combined_loss(parts, importance, weights, hparams), parts.td_error

    def learn(state: TLwDState, words: Words, count: Int, number: Int, target, hparams: HParams) -> TLwDState:
        """Update `number` of all, with `count` new transitions in the memory."""
        batch = prioritised.sample(state.memory, words, where)
        beta = importance_exponent(number, updates, hparams)
        size = prioritised.size(count, where)
        importance = prioritised.importance_weights(batch.probability, size, beta)
        gradient, td_error = jax.grad(loss, has_aux=True)(state.weights, target, batch, importance, hparams)
        step, optimiser_state = optimiser.step(gradient, state.optimiser, state.weights, hparams)
        priority = prioritised.priority(
            td_error, batch.is_demonstration, hparams.priority_constant, hparams.demonstration_constant
        )
        memory = prioritised.set_priorities(state.memory, batch.indices, priority, hparams.priority_exponent, where)
        return TLwDState(optax.apply_updates(state.weights, step), target, optimiser_state, memory, state.window)

    def copied(state: TLwDState, slot: Int, hparams: HParams):
        """The target network after `slot` updates of a phase: copied after every target_period of them."""
        due = (slot > 0) & (slot % hparams.target_period == 0)
        return copied_if(due, function.target_of(state.weights), state.target)

    def pretrain(state: TLwDState, key, hparams: HParams) -> TLwDState:
        """Lines 7 to 14 of Algorithm 2."""

        def one(state, i):
            shape = (prioritised.NUM_WORDS, config.batch_size)
            words = rng.bits(jax.random.fold_in(key, i), shape)
            return learn(state, words, jnp.int32(0), i, copied(state, i, hparams), hparams), None

        state, _ = jax.lax.scan(one, state, jnp.arange(config.pretraining))
        return state._replace(target=copied(state, jnp.int32(config.pretraining), hparams))

    def init(key, hparams: HParams, source: Source | None = None) -> TLwDState:
        assert source is not None
        weights = copied_if(hparams.initial_weights == 1, source.weights, function.init(key))
        memory = prioritised.init(source.demonstrations, where)
        window = n_step.init(config.n_step)
        state = TLwDState(weights, function.target_of(weights), optimiser.init(weights), memory, window)
        return pretrain(state, jax.random.fold_in(key, 1), hparams)

    def act(state: TLwDState, state_id, slot, words, hparams: HParams) -> Int:
        return exploration.epsilon_greedy(words, function.of_state(state.weights, state_id), epsilon(slot, hparams))

    def update(state: TLwDState, transition: Transition, slot, words, hparams: HParams) -> TLwDState:
        """Lines 19 to 24 of Algorithm 2. A transition enters the memory n - 1 slots late, with its return complete."""
        window = n_step.push(state.window, transition, slot % spec.episode_slots, hparams.discount)
        complete = slot + 1 - config.n_step
        oldest = jax.tree.map(lambda field: field[0], window)
        memory = prioritised.add(state.memory, oldest, complete, where)
        state = state._replace(memory=memory, window=window)
        words = words.reshape(prioritised.NUM_WORDS, config.batch_size)
        count = jnp.maximum(complete + 1, 0)
        return learn(state, words, count, config.pretraining + slot, copied(state, slot, hparams), hparams)

    return Learner(
        num_words=exploration.NUM_WORDS + prioritised.NUM_WORDS * config.batch_size,
        init=init,
        act=act,
        update=update,
        policy=lambda state: greedy_policy(function.table(state.weights)),
        values=lambda state: function.table(state.weights),
        needs_source=True,
    )
