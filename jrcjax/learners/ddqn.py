"""Double DQN: Algorithm 1 with the paper's equations (15) to (21); and direct policy reuse, its transfer variant."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from jrcjax.learners import exploration
from jrcjax.learners.base import Learner, Source, Spec
from jrcjax.learners.hparams import Config, HParams, optimiser_of
from jrcjax.learners.q_function import QFunction, copied_if, q_function
from jrcjax.learners.schedules import epsilon
from jrcjax.learners.value_learning import squared_td_loss, td_target
from jrcjax.model import states
from jrcjax.policies import greedy_policy
from jrcjax.replay import uniform
from jrcjax.replay.uniform import Transition
from jrcjax.types import Float, Int, Words


class DDQNState(NamedTuple):
    """One agent's networks, optimiser and memory."""

    weights: Any
    """theta."""
    target: Any
    """theta' as its table [A, S], or as weights in the mini-batch form."""
    optimiser: Any
    ring: Words
    """[capacity, words] replay memory."""


def ddqn_loss(function: QFunction, weights: Any, target: Any, batch: Transition, discount: Float) -> Float:
    """Equation (16) for a batch [B]."""
    next_value = function.double_q(weights, target, batch.next_state)
    y = td_target(batch.reward, jnp.where(batch.terminal == 1, 0.0, discount), next_value)
    return squared_td_loss(y - function.chosen(weights, batch.state, batch.action))


def ddqn(spec: Spec, config: Config) -> Learner:
    """Double DQN with uniform replay."""
    function = q_function(spec, config)
    optimiser = optimiser_of(config)
    where = uniform.layout(states.num_states(spec.shape), spec.num_actions)

    def init(key, hparams: HParams, source: Source | None = None) -> DDQNState:
        weights = function.init(key)
        ring = uniform.init(config.replay_capacity, where)
        # Algorithm 1 starts both networks at random; equal weights spare the first period an arbitrary target.
        return DDQNState(weights, function.target_of(weights), optimiser.init(weights), ring)

    def act(state: DDQNState, state_id, slot, words, hparams: HParams) -> Int:
        return exploration.epsilon_greedy(words, function.of_state(state.weights, state_id), epsilon(slot, hparams))

    def draw(words: Words, slots: Int) -> Int:
        return uniform.draw(words, slots[:, None] + 1, config.replay_capacity)

    def update(state: DDQNState, transition: Transition, slot, positions: Int, hparams: HParams) -> DDQNState:
        ring = uniform.add(state.ring, transition, slot, where)
        batch = uniform.at(ring, positions, where)
        # After every target_period updates theta' <- theta. Done at the start of the slot that follows, whose table
        # is needed anyway.
        due = slot % hparams.target_period == 0
        target = copied_if(due, function.target_of(state.weights), state.target)
        gradient = jax.grad(ddqn_loss, argnums=1)(function, state.weights, target, batch, hparams.discount)
        step, optimiser_state = optimiser.step(gradient, state.optimiser, state.weights, hparams)
        return DDQNState(optax.apply_updates(state.weights, step), target, optimiser_state, ring)

    return Learner(
        num_words=exploration.NUM_WORDS + config.batch_size,
        init=init,
        act=act,
        update=update,
        policy=lambda state: greedy_policy(function.table(state.weights)),
        values=lambda state: function.table(state.weights),
        draw=draw,
    )


def dpr(spec: Spec, config: Config) -> Learner:
    """Direct policy reuse (section VI-A.4): Double DQN that goes on from the source agent's weights."""
    from_scratch = ddqn(spec, config)
    function = q_function(spec, config)

    def init(key, hparams: HParams, source: Source | None = None) -> DDQNState:
        assert source is not None
        state = from_scratch.init(key, hparams, None)
        return state._replace(
            weights=source.weights,
            target=function.target_of(source.weights),
            optimiser=optimiser_of(config).init(source.weights),
        )

    return from_scratch._replace(init=init, needs_source=True)
