"""Double DQN: Algorithm 1 with the paper's equations (15) to (21); and direct policy reuse, its transfer variant."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.learners import exploration
from jrcjax.learners.base import Learner, Source, Spec
from jrcjax.learners.hparams import Config, HParams, check_words
from jrcjax.learners.optimiser import Optimiser, check_optimiser, optimiser_of
from jrcjax.learners.q_function import QFunction, q_function
from jrcjax.learners.schedules import epsilon
from jrcjax.learners.value_learning import td_loss, td_target
from jrcjax.model import states
from jrcjax.policies import greedy_policy
from jrcjax.replay import packing, uniform
from jrcjax.replay.uniform import Transition
from jrcjax.types import Float, Int, Key, Words


class DDQNState(NamedTuple):
    """One agent's networks, optimiser and replay memory."""

    weights: Any
    """theta."""
    target: Any
    """theta', as `QFunction.target_of` keeps it."""
    optimiser: Any
    ring: Words
    """[capacity, words] replay memory."""


class DDQN(NamedTuple):
    """Algorithm 1 for one problem; its methods work on the state of one agent."""

    spec: Spec
    config: Config
    function: QFunction
    optimiser: Optimiser
    layout: packing.Layout

    def init(self, key: Key, hparams: HParams, source: Source | None = None) -> DDQNState:
        """A random network, and nothing in the replay memory."""
        return self.start(self.function.init(key, hparams.initialiser))

    def start(self, weights: Any) -> DDQNState:
        """An agent with this network."""
        # Algorithm 1 starts both networks at random; equal weights spare the first period an arbitrary target.
        target, ring = self.function.target_of(weights), uniform.init(self.config.replay_capacity, self.layout)
        return DDQNState(weights, target, self.optimiser.init(weights), ring)

    def act(self, state: DDQNState, state_id: Int, step: Int, words: Words, hparams: HParams) -> Int:
        """Line 9."""
        random = epsilon(step, hparams, self.spec.episode_slots)
        return exploration.epsilon_greedy(words, self.function.of_state(state.weights, state_id), random)

    def draw(self, words: Words, steps: Int) -> Int:
        """Where the mini-batches of these steps lie, [steps, B]."""
        return uniform.draw(words, steps[:, None] + 1, self.config.replay_capacity)

    def update(
        self, state: DDQNState, transition: Transition, step: Int, positions: Int, hparams: HParams
    ) -> DDQNState:
        """Lines 12 to 18: stores a transition and learns from a mini-batch, whose positions [B] are drawn."""
        ring = uniform.add(state.ring, transition, step, self.layout)
        batch = uniform.at(ring, positions, self.layout, hparams.discount)
        target = self.function.next_target(state.target, state.weights, step, hparams)
        gradient = jax.grad(ddqn_loss, argnums=1)(self.function, state.weights, target, batch, hparams)
        weights, optimiser = self.optimiser.step(gradient, state.optimiser, state.weights, hparams)
        return DDQNState(weights, target, optimiser, ring)

    def values(self, state: DDQNState) -> Float:
        """Q(s, a), [S, A]."""
        return self.function.table(state.weights)


def ddqn_loss(function: QFunction, weights: Any, target: Any, batch: Transition, hparams: HParams) -> Float:
    """Equations (16) and (20): the mean over a mini-batch [B]."""
    next_value = function.double_q(weights, target, batch.next_state)
    y = td_target(batch.reward, batch.discount, next_value)
    error = y - function.chosen(weights, batch.state, batch.action)
    return jnp.mean(td_loss(error, hparams.loss, hparams.huber_delta))


def _of(spec: Spec, config: Config) -> DDQN:
    function = q_function(spec, config)
    check_optimiser(config, function)
    layout = uniform.layout_of(states.num_states(spec.shape), spec.num_actions)
    check_words(config, config.replay_capacity * layout.words)
    return DDQN(spec, config, function, optimiser_of(config), layout)


def ddqn(spec: Spec, config: Config) -> Learner:
    """Double DQN with uniform replay."""
    rule = _of(spec, config)
    return Learner(
        num_words=exploration.NUM_WORDS + config.batch_size,
        init=rule.init,
        act=rule.act,
        update=rule.update,
        policy=lambda state: greedy_policy(rule.values(state)),
        values=rule.values,
        draw=rule.draw,
    )


def dpr(spec: Spec, config: Config) -> Learner:
    """Direct policy reuse (section VI-A.4): Double DQN that goes on from the source agent's weights."""

    def init(key: Key, hparams: HParams, source: Source | None = None) -> DDQNState:
        assert source is not None
        return _of(spec, config).start(source.weights)

    return ddqn(spec, config)._replace(init=init, needs_source=True)
