"""Transfer learning with demonstrations: Algorithm 2 with the paper's equations (23) to (29).

Double DQN with a replay memory that also holds what the source agent did in its environment, sampled by priority, and a
loss of four parts. It learns from the demonstrations alone first, then goes on in the target environment.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp

from jrcjax import rng
from jrcjax.checks import refuse
from jrcjax.keys import PRETRAINING
from jrcjax.learners import exploration
from jrcjax.learners.base import Learner, Source, Spec
from jrcjax.learners.hparams import Config, HParams, check_words
from jrcjax.learners.optimiser import Optimiser, check_optimiser, optimiser_of
from jrcjax.learners.q_function import QFunction, chosen_tree, q_function
from jrcjax.learners.schedules import epsilon, importance_exponent
from jrcjax.learners.value_learning import l2_loss, large_margin_loss, td_loss, td_target, value_of
from jrcjax.model import states
from jrcjax.policies import greedy_policy
from jrcjax.readings import DemonstrationRewards, InitialWeights
from jrcjax.replay import n_step, prioritised
from jrcjax.replay.n_step import NStepTransition
from jrcjax.replay.prioritised import Replay, Sample
from jrcjax.replay.uniform import Transition
from jrcjax.types import Bool, Float, Int, Key, Words


class TLwDState(NamedTuple):
    """One agent's networks, optimiser and replay memory."""

    weights: Any
    """theta."""
    target: Any
    """theta', as `QFunction.target_of` keeps it."""
    optimiser: Any
    replay: Replay
    window: NStepTransition
    """The last n transitions, whose returns are still growing."""


class Losses(NamedTuple):
    """What equation (25) is made of; scalars of one transition, or [B]."""

    td_error: Float
    """zeta_i; its square is J_DDQN, equation (26)."""
    n_step_error: Float
    """Its square is J_n, equation (27)."""
    margin: Float
    """J_E, equation (29); 0 for what is no demonstration."""


def transition_losses(
    q: Float,
    is_action: Bool,
    next_value: Float,
    n_value: Float,
    t: NStepTransition,
    is_demonstration: Bool,
    hparams: HParams,
) -> Losses:
    """The errors and the large-margin loss of one transition.

    Args:
      q: [A], Q(s, .; theta).
      is_action: [A], true for the action that was taken alone.
      next_value: the value of the next state, as in equation (15).
      n_value: the value of the state n steps later, as in equation (27).
      t: the transition.
      is_demonstration: whether the source agent made it.
      hparams: its fields `margin` and `demonstration_rewards`.
    """
    chosen = value_of(q, is_action)
    is_right = is_demonstration & (hparams.demonstration_rewards == DemonstrationRewards.UNUSED)  # has no error

    def error(target: Float) -> Float:
        return jnp.where(is_right, jax.lax.stop_gradient(chosen), target) - chosen

    td_error = error(td_target(t.reward, t.discount, next_value))
    n_step_error = error(td_target(t.n_return, t.n_discount, n_value))
    margin = jnp.where(is_demonstration, large_margin_loss(q, is_action, hparams.margin), 0.0)
    return Losses(td_error, n_step_error, margin)


def losses(function: QFunction, weights: Any, target: Any, batch: Sample, hparams: HParams) -> Losses:
    """The same for a mini-batch, [B]."""
    t = batch.transitions
    q = function.of_states(weights, t.state)
    next_value = function.double_q(weights, target, t.next_state)
    n_value = function.greatest(target, t.n_state)
    is_action = jax.nn.one_hot(t.action, q.shape[0], dtype=bool, axis=0)
    of_batch = jax.vmap(transition_losses, in_axes=(1, 1, 0, 0, 0, 0, None))
    return of_batch(q, is_action, next_value, n_value, t, batch.is_demonstration, hparams)


def combined_loss(parts: Losses, importance: Float, weights: Any, hparams: HParams) -> Float:
    """J(Q), equation (25): means over the batch, each transition weighted by `importance` [B], equation (24)."""
    chex.assert_equal_shape([*parts, importance])  # a mean over a broadcast pair would be silently wrong
    one_step, n_step = (td_loss(e, hparams.loss, hparams.huber_delta) for e in (parts.td_error, parts.n_step_error))
    of_transition = one_step + hparams.n_step_weight * n_step + hparams.margin_weight * parts.margin
    return jnp.mean(importance * of_transition) + hparams.l2_weight * l2_loss(weights)


class TLwD(NamedTuple):
    """Algorithm 2 for one problem; its methods work on the state of one agent."""

    spec: Spec
    config: Config
    function: QFunction
    optimiser: Optimiser
    layout: prioritised.Layout

    def init(self, key: Key, hparams: HParams, source: Source | None = None) -> TLwDState:
        """Lines 1 to 14: demonstrations enter the replay memory, and the network learns from them alone."""
        assert source is not None
        from_source = hparams.initial_weights == InitialWeights.SOURCE
        weights = chosen_tree(from_source, source.weights, self.function.init(key, hparams.initialiser))
        replay, window = prioritised.init(source.demonstrations, self.layout), n_step.init(self.config.n_step)
        target, optimiser = self.function.target_of(weights), self.optimiser.init(weights)
        state = TLwDState(weights, target, optimiser, replay, window)
        return self.pretrain(state, jax.random.fold_in(key, PRETRAINING), hparams)

    def pretrain(self, state: TLwDState, key: Key, hparams: HParams) -> TLwDState:
        """Lines 7 to 14: T_pre updates on demonstrations."""

        def one(state: TLwDState, i: Int) -> tuple[TLwDState, None]:
            words = rng.bits(jax.random.fold_in(key, i), (prioritised.NUM_WORDS, self.config.batch_size))
            state = state._replace(target=self.function.next_target(state.target, state.weights, i, hparams))
            return self.learn(state, words, jnp.int32(0), i, hparams), None

        updates = self.config.pretraining
        state, _ = jax.lax.scan(one, state, jnp.arange(updates))
        target = self.function.next_target(state.target, state.weights, jnp.int32(updates), hparams)
        return state._replace(target=target)

    def act(self, state: TLwDState, state_id: Int, step: Int, words: Words, hparams: HParams) -> Int:
        """Line 17."""
        random = epsilon(step, hparams, self.spec.episode_slots)
        return exploration.epsilon_greedy(words, self.function.of_state(state.weights, state_id), random)

    def update(self, state: TLwDState, transition: Transition, step: Int, words: Words, hparams: HParams) -> TLwDState:
        """Lines 19 to 24. A transition enters the replay memory n - 1 steps late, with its return complete."""
        window = n_step.push(state.window, transition, step % self.spec.episode_slots)
        complete = step + 1 - self.config.n_step
        oldest = jax.tree.map(lambda field: field[0], window)
        replay = prioritised.add(state.replay, oldest, complete, self.layout, hparams.discount)
        target = self.function.next_target(state.target, state.weights, step, hparams)
        state = state._replace(replay=replay, window=window, target=target)
        words = words.reshape(prioritised.NUM_WORDS, self.config.batch_size)
        return self.learn(state, words, jnp.maximum(complete + 1, 0), self.config.pretraining + step, hparams)

    def learn(self, state: TLwDState, words: Words, count: Int, number: Int, hparams: HParams) -> TLwDState:
        """One step on a mini-batch, lines 8 to 12 and 20 to 23.

        Args:
          state: the agent.
          words: [NUM_WORDS, B] random words, by which the mini-batch is drawn.
          count: new transitions in the replay memory.
          number: updates before this one, pre-training included.
          hparams: hyperparameters.
        """
        batch = prioritised.sample(state.replay, words, self.layout, hparams.discount)
        importance = self.importance(batch, count, number, hparams)
        gradient, td_error = jax.grad(self.loss, has_aux=True)(state.weights, state.target, batch, importance, hparams)
        weights, optimiser = self.optimiser.step(gradient, state.optimiser, state.weights, hparams)
        priority = prioritised.priority(
            td_error, batch.is_demonstration, hparams.priority_constant, hparams.demonstration_constant
        )
        replay = prioritised.set_priorities(
            state.replay, batch.indices, priority, hparams.priority_exponent, self.layout
        )
        return state._replace(weights=weights, optimiser=optimiser, replay=replay)

    def importance(self, batch: Sample, count: Int, number: Int, hparams: HParams) -> Float:
        """w_i of equation (24), [B], in update `number` with `count` new transitions."""
        training = self.config.episodes * self.spec.episode_slots
        beta = importance_exponent(number, self.config.pretraining, training, hparams)
        return prioritised.importance_weights(batch.probability, prioritised.size(count, self.layout), beta)

    def loss(
        self, weights: Any, target: Any, batch: Sample, importance: Float, hparams: HParams
    ) -> tuple[Float, Float]:
        """J(Q), equation (25), and the errors zeta [B] that priorities are made of."""
        parts = losses(self.function, weights, target, batch, hparams)
        return combined_loss(parts, importance, weights, hparams), parts.td_error

    def values(self, state: TLwDState) -> Float:
        """Q(s, a), [S, A]."""
        return self.function.table(state.weights)


def tlwd(spec: Spec, config: Config) -> Learner:
    """Transfer learning with demonstrations; pre-training takes place in `init`."""
    if config.demonstrations >= config.replay_capacity:
        allowed = f"fewer than config.replay_capacity = {config.replay_capacity}, which holds new transitions too"
        refuse("config.demonstrations", config.demonstrations, allowed)
    function = q_function(spec, config)
    check_optimiser(config, function)
    states_and_actions = states.num_states(spec.shape), spec.num_actions
    layout = prioritised.layout_of(*states_and_actions, config.replay_capacity, config.demonstrations, config.n_step)
    check_words(config, layout.words)
    rule = TLwD(spec, config, function, optimiser_of(config), layout)
    return Learner(
        num_words=exploration.NUM_WORDS + prioritised.NUM_WORDS * config.batch_size,
        init=rule.init,
        act=rule.act,
        update=rule.update,
        policy=lambda state: greedy_policy(rule.values(state)),
        values=rule.values,
        needs_source=True,
    )
