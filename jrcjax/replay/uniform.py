"""Uniform replay: a ring of transitions, each a row of packed words."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax import rng
from jrcjax.replay import packing
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


def draw(words: Words, count: Int, capacity: int) -> Int:
    """Positions of a uniform sample with replacement of the `count` >= 1 transitions added so far; a word each."""
    return rng.index(words, jnp.minimum(count, capacity))


def at(ring: Words, positions: Int, where: packing.Layout) -> Transition:
    """The transitions at these positions; any shape."""
    return packing.unpack(ring.at[positions].get(mode="promise_in_bounds"), where)
