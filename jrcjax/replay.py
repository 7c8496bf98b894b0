"""Uniform replay: a ring of transitions, each one row of 32-bit words.

A row holds the ids of state, action and next state and the terminal flag, packed into as few words as they fit
(one in the paper), and the reward's bits. One look-up per sample then touches one cache line.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax import rng
from jrcjax.types import Float, Int, Words


class Transition(NamedTuple):
    """A transition; scalars, or [B] in a batch."""

    state: Int
    action: Int
    reward: Float
    next_state: Int
    terminal: Int
    """1 if the episode ended for good, so that nothing is bootstrapped; 0 also at a time limit that truncates."""


class Layout(NamedTuple):
    """Where each field lies: (word, shift, bits) for state, action, next state and terminal."""

    fields: tuple[tuple[int, int, int], ...]
    words: int
    """Words that the ids take; the reward's comes after them."""


def layout(num_states: int, num_actions: int) -> Layout:
    """Packs the ids into as few words as they fit, in order."""
    bits = [max((n - 1).bit_length(), 1) for n in (num_states, num_actions, num_states)] + [1]
    fields, word, shift = [], 0, 0
    for width in bits:
        if shift + width > 32:
            word, shift = word + 1, 0
        fields.append((word, shift, width))
        shift += width
    return Layout(tuple(fields), word + 1)


def pack(transition: Transition, where: Layout) -> Words:
    """A transition of scalars as one row, [words + 1]."""
    ids = (transition.state, transition.action, transition.next_state, transition.terminal)
    row = [jnp.uint32(0)] * where.words
    for value, (word, shift, _) in zip(ids, where.fields, strict=True):
        row[word] = row[word] | (jnp.asarray(value).astype(jnp.uint32) << shift)
    reward = jax.lax.bitcast_convert_type(jnp.asarray(transition.reward, jnp.float32), jnp.uint32)
    return jnp.stack([*row, reward])


def unpack(rows: Words, where: Layout) -> Transition:
    """Rows [..., words + 1] as a transition of arrays [...]."""
    state, action, next_state, terminal = (
        ((rows[..., word] >> shift) & jnp.uint32(2**bits - 1)).astype(jnp.int32) for word, shift, bits in where.fields
    )
    reward = jax.lax.bitcast_convert_type(rows[..., where.words], jnp.float32)
    return Transition(state, action, reward, next_state, terminal)


def init(capacity: int, where: Layout) -> Words:
    """An empty ring, [capacity, words + 1]."""
    return jnp.zeros((capacity, where.words + 1), jnp.uint32)


def add(ring: Words, transition: Transition, count: Int, where: Layout) -> Words:
    """Writes the transition that is number `count` (from 0) over the oldest one.

    With a `count` that is the same for all agents under vmap the ring is written in place.
    """
    return jax.lax.dynamic_update_slice(ring, pack(transition, where)[None], (count % ring.shape[0], 0))


def sample(ring: Words, words: Words, count: Int, where: Layout) -> Transition:
    """Uniform sample with replacement of the `count` >= 1 transitions added so far; one word [B] each."""
    filled = jnp.minimum(count, ring.shape[0])
    rows = ring.at[rng.index(words, filled)].get(mode="promise_in_bounds")
    return unpack(rows, where)
