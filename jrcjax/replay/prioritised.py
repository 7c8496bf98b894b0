"""Prioritised replay with protected demonstrations: the paper's equations (23) and (24).

Demonstrations lie first and are never overwritten; behind them a ring takes what the agent sees itself. Priorities lie
beside their transitions, four of each in a line, and a sum tree over the sums of lines leads to the line:

    line    p^alpha of four | the four transitions, as packed words

In the paper's problem a line is one cache line of 64 bytes, so that looking for a transition fetches it, too.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.replay import lookup, packing, sum_tree
from jrcjax.replay.n_step import NStepTransition
from jrcjax.replay.packing import NUMBER, SWITCH, Power
from jrcjax.types import Bool, Float, Int, Words

NUM_WORDS = sum_tree.NUM_WORDS
"""Random words of one sample."""


class Layout(NamedTuple):
    """How transitions and priorities lie in memory."""

    rows: packing.Layout
    """Of one transition."""
    tree: sum_tree.Layout
    """Over the sums of lines, with as many children as a line has transitions."""
    capacity: int
    demonstrations: int

    @property
    def per_line(self) -> int:
        """Transitions of a line, and words of their priorities, which come first."""
        return self.tree.children

    @property
    def line_words(self) -> int:
        """Length of a line."""
        return self.per_line * (1 + self.rows.words)

    @property
    def words(self) -> int:
        """Of all lines."""
        return self.tree.leaves * self.line_words

    def word(self, index: Int) -> Int:
        """Where in its line transition number `index` begins."""
        return self.per_line + self.tree.column(index) * self.rows.words


class Replay(NamedTuple):
    """Transitions and their priorities."""

    lines: Words
    """[lines, words]; a priority is zero where nothing is stored yet."""
    tree: Float
    """Sum tree over the sums of lines."""
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


def layout_of(num_states: int, num_actions: int, capacity: int, demonstrations: int, n: int) -> Layout:
    """The layout for `capacity` transitions with returns of up to n steps, the first of them demonstrations."""
    fields = (num_states, num_actions, NUMBER, num_states, SWITCH, NUMBER, Power(n), num_states)
    per_line = 4
    lines = -(-capacity // per_line)
    return Layout(
        packing.layout_of(NStepTransition, fields), sum_tree.layout_of(lines, per_line), capacity, demonstrations
    )


def init(demonstrations: NStepTransition, layout: Layout) -> Replay:
    """Demonstrations alone, all with priority 1. Their gamma may be another: the steps of their returns are kept."""
    room = layout.tree.leaves * layout.per_line
    rows = packing.pack(demonstrations, layout.rows, demonstrations.discount.max())
    rows = jnp.pad(rows, ((0, room - layout.demonstrations), (0, 0)))
    priorities = (jnp.arange(room) < layout.demonstrations).astype(jnp.float32).reshape(-1, layout.per_line)
    lines = jnp.concatenate([_as_words(priorities), rows.reshape(layout.tree.leaves, -1)], axis=1)
    return Replay(lines, sum_tree.init(sum_tree.sum_of(priorities), layout.tree), jnp.float32(1.0))


def contents(replay: Replay, layout: Layout, discount: Float | float) -> tuple[Float, NStepTransition]:
    """All priorities p^alpha and all transitions, [capacity] each, as `sample` finds them."""
    priorities = _as_numbers(replay.lines[:, : layout.per_line]).reshape(-1)
    rows = replay.lines[:, layout.per_line :].reshape(-1, layout.rows.words)
    transitions = packing.unpack(rows[: layout.capacity], layout.rows, discount)
    return priorities[: layout.capacity], transitions


def size(count: Int, layout: Layout) -> Int:
    """|D_re|, transitions held after `count` new ones were added."""
    return layout.demonstrations + jnp.minimum(count, layout.capacity - layout.demonstrations)


def add(replay: Replay, transition: NStepTransition, count: Int, layout: Layout, discount: Float) -> Replay:
    """Writes new transition number `count` (from 0) over the oldest new one.

    If `count` < 0 there is no new transition yet, and nothing is stored.

    With a `count` that is the same for all agents under vmap the lines are written in place.
    """
    position = layout.demonstrations + jnp.maximum(count, 0) % (layout.capacity - layout.demonstrations)
    line, priority = layout.tree.parent(position), jnp.where(count < 0, 0.0, replay.largest)
    row = packing.pack(transition, layout.rows, discount)
    lines = jax.lax.dynamic_update_slice(replay.lines, row[None], (line, layout.word(position)))
    lines = jax.lax.dynamic_update_slice(lines, _as_words(priority)[None, None], (line, layout.tree.column(position)))
    (priorities,) = _as_numbers(jax.lax.dynamic_slice(lines, (line, 0), (1, layout.per_line)))
    tree = sum_tree.update_one(replay.tree, line, sum_tree.sum_of(priorities), layout.tree)
    return replay._replace(lines=lines, tree=tree)


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
    line, _, rest = sum_tree.sample(replay.tree, words, layout.tree)
    begin = line * layout.line_words
    column, value, _ = sum_tree.child_at(_as_numbers(lookup.read(replay.lines, begin, layout.per_line)), rest)
    indices = line * layout.per_line + column
    rows = lookup.read(replay.lines, begin + layout.word(column), layout.rows.words)
    probability = value / sum_tree.total(replay.tree, layout.tree)
    transitions = packing.unpack(rows, layout.rows, discount)
    return Sample(transitions, indices, probability, indices < layout.demonstrations)


def _as_words(priorities: Float) -> Words:
    return jax.lax.bitcast_convert_type(priorities, jnp.uint32)


def _as_numbers(words: Words) -> Float:
    return jax.lax.bitcast_convert_type(words, jnp.float32)


def priority(td_error: Float, is_demonstration: Bool, constant: Float, of_demonstrations: Float) -> Float:
    """p_i = |zeta_i| + epsilon, below equation (23); demonstrations have a constant of their own, if it is larger."""
    return jnp.abs(td_error) + jnp.where(is_demonstration, jnp.maximum(of_demonstrations, constant), constant)


def set_priorities(replay: Replay, indices: Int, priorities: Float, exponent: Float, layout: Layout) -> Replay:
    """Stores p_i^alpha for priorities p_i > 0, [B] each; what is sampled twice has equal ones."""
    scaled = jnp.exp(exponent * jnp.log(priorities))  # the power function of XLA on a CPU is not vectorised
    largest = jnp.maximum(replay.largest, scaled.max())
    line = layout.tree.parent(indices)
    begin = line * layout.line_words
    lines = lookup.write(replay.lines, begin + layout.tree.column(indices), _as_words(scaled))
    sums = sum_tree.sum_of(_as_numbers(lookup.read(lines, begin, layout.per_line)))
    return Replay(lines, sum_tree.update(replay.tree, line, sums, layout.tree), largest)


def importance_weights(probability: Float, size: Int, exponent: Float) -> Float:
    """w_i = (1 / (|D_re| P(i)))^beta, equation (24), divided by the largest of the batch [B]."""
    log_weights = -exponent * jnp.log(jnp.asarray(size, jnp.float32) * probability)
    return jnp.exp(log_weights - log_weights.max())
