"""Tabular Q-learning: the paper's equations (13) and (14)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jrcjax.learners import exploration
from jrcjax.learners.base import Learner, Spec
from jrcjax.learners.hparams import Config, HParams
from jrcjax.learners.schedules import epsilon
from jrcjax.learners.value_learning import q_learning_error, robbins_monro_step
from jrcjax.model.states import num_states
from jrcjax.policies import greedy_policy
from jrcjax.replay.uniform import Transition
from jrcjax.types import Float, Int


class QState(NamedTuple):
    """A table of values and how often each entry was updated."""

    q: Float
    """[S, A]."""
    visits: Int
    """[S, A]."""


def q_learning(spec: Spec, config: Config) -> Learner:
    """Q-learning on a table that starts at zero."""
    del config
    shape = (num_states(spec.shape), spec.num_actions)

    def init(key, hparams: HParams, source=None) -> QState:
        return QState(jnp.zeros(shape, jnp.float32), jnp.zeros(shape, jnp.int32))

    def act(state: QState, state_id, step, words, hparams: HParams):
        return exploration.epsilon_greedy(words, state.q[state_id], epsilon(step, hparams, spec.episode_slots))

    def update(state: QState, transition: Transition, step, words, hparams: HParams) -> QState:
        s, a, reward, next_state, discount = transition
        visits = state.visits.at[s, a].add(1)
        counted = robbins_monro_step(visits[s, a], hparams.step_exponent)
        size = jnp.where(hparams.step_constant > 0, hparams.step_constant, counted)
        error = q_learning_error(state.q, s, a, reward, next_state, discount)
        return QState(state.q.at[s, a].add(size * error), visits)

    return Learner(
        exploration.NUM_WORDS, init, act, update, lambda state: greedy_policy(state.q), values=lambda state: state.q
    )
