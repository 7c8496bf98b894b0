"""Prioritised replay with protected demonstrations: the paper's equations (23) and (24).

Demonstrations lie first and are never overwritten; behind them a ring takes what the agent sees itself.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.replay import packing, sum_tree
from jrcjax.replay.n_step import NStepTransition
from jrcjax.types import Bool, Float, Int, Words

NUM_WORDS = sum_tree.NUM_WORDS
"""Random words of one sample."""


class Layout(NamedTuple):
    """The static side of a memory."""

    rows: packing.Layout
    tree: sum_tree.Layout
    demonstrations: int


class Memory(NamedTuple):
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


def layout(num_states: int, num_actions: int, capacity: int, demonstrations: int) -> Layout:
    """The layout of a memory for `capacity` transitions, the first of them demonstrations."""
    sizes = (num_states, num_actions, None, num_states, 2, None, None, num_states)
    return Layout(packing.layout(NStepTransition, sizes), sum_tree.layout(capacity), demonstrations)


def init(demonstrations: NStepTransition, where: Layout) -> Memory:
    """A memory of demonstrations alone, all with priority 1."""
    free = where.tree.leaves - where.demonstrations
    rows = jnp.pad(packing.pack(demonstrations, where.rows), ((0, free), (0, 0)))
    priorities = (jnp.arange(where.tree.leaves) < where.demonstrations).astype(jnp.float32)
    return Memory(rows, sum_tree.init(priorities, where.tree), jnp.float32(1.0))


def size(count: Int, where: Layout) -> Int:
    """|D_re|, transitions held after `count` new ones were added."""
    return where.demonstrations + jnp.minimum(count, where.tree.leaves - where.demonstrations)


def add(memory: Memory, transition: NStepTransition, count: Int, where: Layout) -> Memory:
    """Writes new transition number `count` (from 0) over the oldest new one; before the first (`count` < 0) nothing.

    With a `count` that is the same for all agents under vmap the memory is written in place.
    """
    ring = where.tree.leaves - where.demonstrations
    position = where.demonstrations + jnp.maximum(count, 0) % ring
    row = packing.pack(transition, where.rows)[None]
    priority = jnp.where(count < 0, 0.0, memory.largest)
    return memory._replace(
        rows=jax.lax.dynamic_update_slice(memory.rows, row, (position, 0)),
        tree=sum_tree.update_one(memory.tree, position, priority, where.tree),
    )


def sample(memory: Memory, words: Words, where: Layout) -> Sample:
    """Draws a mini-batch with replacement, transition i with the probability P(i) of equation (23).

    Args:
      memory: the memory.
      words: [NUM_WORDS, B] random words.
      where: the memory's layout.
    """
    # The values come with the indices: reading them from the tree again would not be ordered before its update, and XLA
    # would copy the whole tree in every step.
    indices, values = sum_tree.sample(memory.tree, words, where.tree)
    rows = memory.rows.at[indices].get(mode="promise_in_bounds")
    probability = values / sum_tree.total(memory.tree, where.tree)
    return Sample(packing.unpack(rows, where.rows), indices, probability, indices < where.demonstrations)


def priority(td_error: Float, is_demonstration: Bool, constant: Float, bonus: Float) -> Float:
    """p_i = |zeta_i| + epsilon, below equation (23); demonstrations have an epsilon of their own, `bonus`."""
    return jnp.abs(td_error) + jnp.where(is_demonstration, bonus, constant)


def set_priorities(memory: Memory, indices: Int, priorities: Float, exponent: Float, where: Layout) -> Memory:
    """Stores p_i^alpha for priorities p_i > 0, [B] each; what is sampled twice has equal ones."""
    scaled = jnp.exp(exponent * jnp.log(priorities))  # the power function of XLA on a CPU is not vectorised
    largest = jnp.maximum(memory.largest, scaled.max())
    return memory._replace(tree=sum_tree.update(memory.tree, indices, scaled, where.tree), largest=largest)


def importance_weights(probability: Float, size: Int, exponent: Float) -> Float:
    """w_i = (1 / (|D_re| P(i)))^beta, equation (24), divided by the largest of the batch [B]."""
    log_weights = -exponent * jnp.log(jnp.asarray(size, jnp.float32) * probability)
    return jnp.exp(log_weights - log_weights.max())
