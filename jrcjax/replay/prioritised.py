"""Prioritised replay with protected demonstrations: the paper's equations (23) and (24).

Demonstrations lie first and are never overwritten; behind them a ring takes what the agent sees itself.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.replay import packing, sum_tree
from jrcjax.replay.n_step import NStepTransition
from jrcjax.replay.packing import NUMBER, SWITCH
from jrcjax.types import Bool, Float, Int, Words

NUM_WORDS = sum_tree.NUM_WORDS
"""Random words of one sample."""


class Layout(NamedTuple):
    """How transitions and priorities lie in memory."""

    rows: packing.Layout
    tree: sum_tree.Layout
    demonstrations: int


class Replay(NamedTuple):
    """Transitions and their priorities."""

    rows: Words
    """[capacity, words]."""
    tree: Float
    """Sum tree over p^alpha; zero where nothing is stored yet."""
    largest: Float
    """Largest p^alpha so far, which a new transition gets, so that it is soon sampled once."""


class Sample(NamedTuple):
    """A mini-batch."""

    transitions: NStepTransition
    """[B]."""
    indices: Int
    """[B], where they lie."""
    probability: Float
    """[B], P(i) of equation (23)."""
    is_demonstration: Bool
    """[B]."""


def layout_of(num_states: int, num_actions: int, capacity: int, demonstrations: int) -> Layout:
    """The layout for `capacity` transitions, the first of them demonstrations."""
    fields = (num_states, num_actions, NUMBER, num_states, SWITCH, NUMBER, NUMBER, num_states)
    return Layout(packing.layout_of(NStepTransition, fields), sum_tree.layout_of(capacity), demonstrations)


def init(demonstrations: NStepTransition, layout: Layout) -> Replay:
    """Demonstrations alone, all with priority 1."""
    free = layout.tree.leaves - layout.demonstrations
    rows = jnp.pad(packing.pack(demonstrations, layout.rows), ((0, free), (0, 0)))
    priorities = (jnp.arange(layout.tree.leaves) < layout.demonstrations).astype(jnp.float32)
    return Replay(rows, sum_tree.init(priorities, layout.tree), jnp.float32(1.0))


def size(count: Int, layout: Layout) -> Int:
    """|D_re|, transitions held after `count` new ones were added."""
    return layout.demonstrations + jnp.minimum(count, layout.tree.leaves - layout.demonstrations)


def add(replay: Replay, transition: NStepTransition, count: Int, layout: Layout) -> Replay:
    """Writes new transition number `count` (from 0) over the oldest new one.

    If `count` < 0 there is no new transition yet, and nothing is stored.

    With a `count` that is the same for all agents under vmap the rows are written in place.
    """
    ring = layout.tree.leaves - layout.demonstrations
    position = layout.demonstrations + jnp.maximum(count, 0) % ring
    row = packing.pack(transition, layout.rows)[None]
    priority = jnp.where(count < 0, 0.0, replay.largest)
    return replay._replace(
        rows=jax.lax.dynamic_update_slice(replay.rows, row, (position, 0)),
        tree=sum_tree.update_one(replay.tree, position, priority, layout.tree),
    )


def sample(replay: Replay, words: Words, layout: Layout, discount: Float) -> Sample:
    """Draws a mini-batch with replacement, transition i with the probability P(i) of equation (23).

    Args:
      replay: the transitions.
      words: [NUM_WORDS, B] random words.
      layout: how they lie there.
      discount: gamma of the transitions after which the episode went on.
    """
    # The values come with the indices: reading them from the tree again would not be ordered before its update, and XLA
    # would copy the whole tree in every step.
    indices, values = sum_tree.sample(replay.tree, words, layout.tree)
    rows = replay.rows.at[indices].get(mode="promise_in_bounds")
    probability = values / sum_tree.total(replay.tree, layout.tree)
    return Sample(packing.unpack(rows, layout.rows, discount), indices, probability, indices < layout.demonstrations)


def priority(td_error: Float, is_demonstration: Bool, constant: Float, of_demonstrations: Float) -> Float:
    """p_i = |zeta_i| + epsilon, below equation (23); demonstrations have a constant of their own, if it is larger."""
    return jnp.abs(td_error) + jnp.where(is_demonstration, jnp.maximum(of_demonstrations, constant), constant)


def set_priorities(replay: Replay, indices: Int, priorities: Float, exponent: Float, layout: Layout) -> Replay:
    """Stores p_i^alpha for priorities p_i > 0, [B] each; what is sampled twice has equal ones."""
    scaled = jnp.exp(exponent * jnp.log(priorities))  # the power function of XLA on a CPU is not vectorised
    largest = jnp.maximum(replay.largest, scaled.max())
    return replay._replace(tree=sum_tree.update(replay.tree, indices, scaled, layout.tree), largest=largest)


def importance_weights(probability: Float, size: Int, exponent: Float) -> Float:
    """w_i = (1 / (|D_re| P(i)))^beta, equation (24), divided by the largest of the batch [B]."""
    log_weights = -exponent * jnp.log(jnp.asarray(size, jnp.float32) * probability)
    return jnp.exp(log_weights - log_weights.max())
