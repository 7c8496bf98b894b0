"""Double DQN: Algorithm 1 with the paper's equations (15) to (21).

With few states the network is evaluated once per slot on all of them. The table serves the action, the target and
the loss; the target network is then a copy of its table, since its weights are used for nothing else.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from jrcjax import exploration, replay, states
from jrcjax.hparams import Config, HParams, optimiser_of
from jrcjax.learners.base import Learner, Spec
from jrcjax.networks import QNetwork
from jrcjax.replay import Transition
from jrcjax.schedules import epsilon
from jrcjax.types import Float, Int, Words
from jrcjax.value_learning import double_q_value, greedy_policy, squared_td_loss, td_target


class DDQNState(NamedTuple):
    """One agent's networks, optimiser and memory."""

    weights: Any
    """theta."""
    target: Any
    """theta' as its table [S, A], or as weights in the mini-batch form."""
    optimiser: Any
    ring: Words
    """[capacity, words] replay memory."""


class QFunction(NamedTuple):
    """The network of one problem as a function of weights and state ids."""

    network: QNetwork
    shape: tuple[int, ...]

    def values(self, weights: Any, ids: Int) -> Float:
        """Q(s, .; theta) of states [N], [N, A]."""
        return self.network.apply(weights, states.features_of(ids, self.shape).T).T  # pyright: ignore

    def table(self, weights: Any) -> Float:
        """Q(s, .; theta) of all states, [S, A]."""
        return self.values(weights, jnp.arange(states.num_states(self.shape)))


def table_loss(q: Float, q_target: Float, batch: Transition, discount: Float) -> Float:
    """Equation (16) on tables [S, A] of the online and the target network, for a batch of ids [B]."""
    frozen = jax.lax.stop_gradient(q)
    next_value = double_q_value(frozen, q_target).at[batch.next_state].get(mode="promise_in_bounds")
    y = td_target(batch.reward, jnp.where(batch.terminal == 1, 0.0, discount), next_value)
    chosen = q.at[batch.state, batch.action].get(mode="promise_in_bounds")
    return squared_td_loss(y - chosen)


def rows_loss(function: QFunction, weights: Any, target: Any, batch: Transition, discount: Float) -> Float:
    """Equation (16) with the network evaluated on the batch's rows, for models with too many states for a table."""
    frozen = jax.lax.stop_gradient(weights)
    next_value = double_q_value(function.values(frozen, batch.next_state), function.values(target, batch.next_state))
    y = td_target(batch.reward, jnp.where(batch.terminal == 1, 0.0, discount), next_value)
    chosen = jnp.take_along_axis(function.values(weights, batch.state), batch.action[:, None], axis=1)[:, 0]
    return squared_td_loss(y - chosen)


def ddqn(spec: Spec, config: Config) -> Learner:
    """Double DQN with uniform replay."""
    function = QFunction(QNetwork(spec.num_actions, config.hidden), spec.shape)
    optimiser = optimiser_of(config)
    num_states = states.num_states(spec.shape)
    where = replay.layout(num_states, spec.num_actions)
    as_table = config.uses_table(num_states)
    as_target = function.table if as_table else lambda weights: weights

    def init(key, hparams: HParams) -> DDQNState:
        weights = function.network.init(key, jnp.zeros((len(spec.shape), 1)))
        ring = replay.init(config.replay_capacity, where)
        # Algorithm 1 starts both networks at random; equal weights spare the first period an arbitrary target.
        return DDQNState(weights, as_target(weights), optimiser.init(weights), ring)

    def act(state: DDQNState, state_id, slot, words, hparams: HParams) -> Int:
        if as_table:
            values = function.table(state.weights)[state_id]
        else:
            values = function.values(state.weights, state_id[None])[0]
        return exploration.epsilon_greedy(words, values, epsilon(slot, hparams))

    def loss(weights, target, batch: Transition, discount: Float) -> Float:
        if as_table:
            return table_loss(function.table(weights), target, batch, discount)
        return rows_loss(function, weights, target, batch, discount)

    def update(state: DDQNState, transition: Transition, slot, words, hparams: HParams) -> DDQNState:
        ring = replay.add(state.ring, transition, slot, where)
        batch = replay.sample(ring, words, slot + 1, where)
        # After every target_period updates theta' <- theta. Done at the start of the slot that follows, whose table
        # is needed anyway.
        due = slot % hparams.target_period == 0
        target = jax.tree.map(lambda new, old: jnp.where(due, new, old), as_target(state.weights), state.target)
        gradient = jax.grad(loss)(state.weights, target, batch, hparams.discount)
        step, optimiser_state = optimiser.step(gradient, state.optimiser, state.weights, hparams)
        return DDQNState(optax.apply_updates(state.weights, step), target, optimiser_state, ring)

    return Learner(
        num_words=exploration.NUM_WORDS + config.batch_size,
        init=init,
        act=act,
        update=update,
        policy=lambda state: greedy_policy(function.table(state.weights)),
    )
