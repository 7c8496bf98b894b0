"""Uniform replay: a ring of transitions, each a row of packed words."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax import packing, rng
from jrcjax.types import Float, Int, Words


class Transition(NamedTuple):
    """A transition; scalars, or [B] in a batch."""

    state: Int
    action: Int
    reward: Float
    next_state: Int
    terminal: Int
    """1 if the episode ended for good, so that nothing is bootstrapped; 0 also at a time limit that truncates."""


def layout(num_states: int, num_actions: int) -> packing.Layout:
    """How transitions are packed: two words in the paper's problem."""
    return packing.layout(Transition, (num_states, num_actions, None, num_states, 2))


def init(capacity: int, where: packing.Layout) -> Words:
    """An empty ring, [capacity, words]."""
    return jnp.zeros((capacity, where.words), jnp.uint32)


def add(ring: Words, transition: Transition, count: Int, where: packing.Layout) -> Words:
    """Writes the transition that is number `count` (from 0) over the oldest one.

    With a `count` that is the same for all agents under vmap the ring is written in place.
    """
    return jax.lax.dynamic_update_slice(ring, packing.pack(transition, where)[None], (count % ring.shape[0], 0))


def sample(ring: Words, words: Words, count: Int, where: packing.Layout) -> Transition:
    """Uniform sample with replacement of the `count` >= 1 transitions added so far; one word [B] each."""
    filled = jnp.minimum(count, ring.shape[0])
    rows = ring.at[rng.index(words, filled)].get(mode="promise_in_bounds")
    return packing.unpack(rows, where)
