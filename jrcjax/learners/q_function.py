"""The network of one problem as a function of weights and state ids, on all states at once or on rows of a batch.

With few states the network is evaluated once per step on all of them. The table serves the action, the target and
the loss; a target network that is copied is then a copy of its table, since its weights are used for nothing else.
Inside, tables have one column per state, [A, S], as the network computes them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.learners.base import Spec
from jrcjax.learners.hparams import Config, HParams
from jrcjax.learners.networks import QNetwork, initial_kernels
from jrcjax.learners.value_learning import double_q_value
from jrcjax.model import states
from jrcjax.types import Float, Int, Key


class QFunction(NamedTuple):
    """Q(s, a; theta), and its target network theta'."""

    network: QNetwork
    shape: tuple[int, ...]
    as_table: bool
    """Whether values are looked up in the table of all states."""
    is_soft: bool = False
    """Whether the target network follows in small steps, for which it keeps its weights."""

    def init(self, key: Key, initialiser: Int | int = 0) -> Any:
        """Random weights, from the `Initialiser` of that number: flax hands out keys, one draw serves all."""
        keys, shapes = [], []

        def noted(key: Key, shape: tuple[int, int]) -> Float:
            keys.append(key)
            shapes.append(shape)
            return jnp.zeros(shape)

        features = jnp.zeros((len(self.shape), 1), jnp.float32)
        layers: Any = self.network.clone(kernel_init=noted).init(key, features)["params"]
        kernels = initial_kernels(keys, shapes, initialiser)
        drawn = zip(layers.items(), kernels, strict=True)
        return {"params": {name: {**layer, "kernel": kernel} for (name, layer), kernel in drawn}}

    def columns(self, weights: Any, ids: Int | None = None) -> Float:
        """Q(s, .; theta) of states [N], [A, N]; of all states if there are no ids."""
        # All features are a constant, by which XLA sees that all calls compute the same.
        features = states.all_features(self.shape) if ids is None else states.features_of(ids, self.shape)
        return self.network.apply(weights, features.T)  # pyright: ignore

    def table(self, weights: Any) -> Float:
        """Q(s, .; theta) of all states, [S, A]."""
        return self.columns(weights).T

    def of_state(self, weights: Any, state: Int) -> Float:
        """Q(s, .; theta) of one state, [A]."""
        return self.columns(weights)[:, state] if self.as_table else self.columns(weights, state[None])[:, 0]

    def of_states(self, weights: Any, ids: Int) -> Float:
        """Q(s, .; theta) of a batch of states, [A, B]."""
        if self.as_table:
            return self.columns(weights).at[:, ids].get(mode="promise_in_bounds")
        return self.columns(weights, ids)

    def chosen(self, weights: Any, ids: Int, actions: Int) -> Float:
        """Q(s, a; theta) of a batch of states and actions, [B]."""
        if self.as_table:
            return self.columns(weights).at[actions, ids].get(mode="promise_in_bounds")
        return jnp.take_along_axis(self.columns(weights, ids), actions[None], axis=0)[0]

    def double_q(self, weights: Any, target: Any, ids: Int) -> Float:
        """Q(s', argmax_a Q(s', a; theta); theta') of a batch of next states, [B]; no gradient flows through it."""
        frozen, of_columns = jax.lax.stop_gradient(weights), jax.vmap(double_q_value, in_axes=1)
        if self.as_table:
            of_all = of_columns(self.columns(frozen), self._target_columns(target))
            return of_all.at[ids].get(mode="promise_in_bounds")
        return of_columns(self.columns(frozen, ids), self._target_columns(target, ids))

    def greatest(self, target: Any, ids: Int) -> Float:
        """max_a Q(s, a; theta') of a batch of states, [B]."""
        if self.as_table:
            return self._target_columns(target).max(axis=0).at[ids].get(mode="promise_in_bounds")
        return self._target_columns(target, ids).max(axis=0)

    @property
    def _keeps_table(self) -> bool:
        """Whether the target network is kept as its table, not as its weights."""
        return self.as_table and not self.is_soft

    def target_of(self, weights: Any) -> Any:
        """The target network theta' = theta, as it is kept: its table [A, S], or its weights."""
        return self.columns(weights) if self._keeps_table else weights

    def _target_columns(self, target: Any, ids: Int | None = None) -> Float:
        return target if self._keeps_table else self.columns(target, ids)

    def next_target(self, target: Any, weights: Any, updates: Int, hparams: HParams) -> Any:
        """The target network after `updates` updates of a phase, the last of which led to `weights`.

        theta' <- theta after every target_period updates, or theta' <- (1 - tau) theta' + tau theta after each. Called
        at the start of the step that follows, whose table is needed anyway.
        """
        new = self.target_of(weights)
        if self.is_soft:
            share = jnp.where(updates > 0, hparams.target_rate, 0.0)
            return jax.tree.map(lambda new, old: (1.0 - share) * old + share * new, new, target)
        due = (updates > 0) & (updates % hparams.target_period == 0)
        return chosen_tree(due, new, target)


def q_function(spec: Spec, config: Config) -> QFunction:
    """The network of `config` for a problem."""
    as_table = config.uses_table(states.num_states(spec.shape))
    network = QNetwork(spec.num_actions, config.hidden)
    return QFunction(network, spec.shape, as_table, config.target_update == "soft")


def chosen_tree(condition: Any, new: Any, old: Any) -> Any:
    """`new` if the condition holds, else `old`; pytrees of one structure."""
    return jax.tree.map(lambda new, old: jnp.where(condition, new, old), new, old)
