"""The network of one problem as a function of weights and state ids, on all states at once or on rows of a batch.

With few states the network is evaluated once per slot on all of them. The table serves the action, the target and
the loss; the target network is then a copy of its table, since its weights are used for nothing else. Inside, tables
have one column per state, [A, S], as the network computes them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.learners.base import Spec
from jrcjax.learners.hparams import Config
from jrcjax.learners.networks import QNetwork
from jrcjax.learners.value_learning import double_q_value
from jrcjax.model import states
from jrcjax.types import Float, Int, Key


class QFunction(NamedTuple):
    """Q(s, a; theta)."""

    network: QNetwork
    shape: tuple[int, ...]
    as_table: bool
    """Whether values are looked up in the table of all states."""

    def init(self, key: Key) -> Any:
        """Random weights."""
        return self.network.init(key, jnp.zeros((len(self.shape), 1)))

    def columns(self, weights: Any, ids: Int | None = None) -> Float:
        """Q(s, .; theta) of states [N], [A, N]; of all states if there are no ids."""
        if ids is not None:
            features = states.features_of(ids, self.shape)
        else:
            with jax.ensure_compile_time_eval():  # a constant, by which XLA sees that all calls compute the same
                features = np.asarray(states.features_of(jnp.arange(states.num_states(self.shape)), self.shape))
        return self.network.apply(weights, features.T)  # pyright: ignore

    def table(self, weights: Any) -> Float:
        """Q(s, .; theta) of all states, [S, A]."""
        return self.columns(weights).T

    def of_state(self, weights: Any, state: Int) -> Float:
        """Q(s, .; theta) of one state, [A]."""
        return self.columns(weights)[:, state] if self.as_table else self.columns(weights, state[None])[:, 0]

    def target_of(self, weights: Any) -> Any:
        """The target network that is kept: its table [A, S], or its weights."""
        return self.columns(weights) if self.as_table else weights

    def chosen(self, weights: Any, ids: Int, actions: Int) -> Float:
        """Q(s, a; theta) of a batch of states and actions, [B]."""
        if self.as_table:
            return self.columns(weights).at[actions, ids].get(mode="promise_in_bounds")
        return jnp.take_along_axis(self.columns(weights, ids), actions[None], axis=0)[0]

    def of_states(self, weights: Any, ids: Int) -> Float:
        """Q(s, .; theta) of a batch of states, [A, B]."""
        if self.as_table:
            return self.columns(weights).at[:, ids].get(mode="promise_in_bounds")
        return self.columns(weights, ids)

    def double_q(self, weights: Any, target: Any, ids: Int) -> Float:
        """Q(s', argmax_a Q(s', a; theta); theta') of a batch of next states, [B]; no gradient flows through it."""
        frozen = jax.lax.stop_gradient(weights)
        if self.as_table:
            return double_q_value(self.columns(frozen), target, axis=0).at[ids].get(mode="promise_in_bounds")
        return double_q_value(self.columns(frozen, ids), self.columns(target, ids), axis=0)

    def greatest(self, target: Any, ids: Int) -> Float:
        """max_a Q(s, a; theta') of a batch of states, [B]."""
        if self.as_table:
            return target.max(axis=0).at[ids].get(mode="promise_in_bounds")
        return self.columns(target, ids).max(axis=0)


def q_function(spec: Spec, config: Config) -> QFunction:
    """The network of `config` for a problem."""
    as_table = config.uses_table(states.num_states(spec.shape))
    return QFunction(QNetwork(spec.num_actions, config.hidden), spec.shape, as_table)


def copied_if(due: Any, new: Any, old: Any) -> Any:
    """The copying of theta into theta', if it is `due`."""
    return jax.tree.map(lambda new, old: jnp.where(due, new, old), new, old)
