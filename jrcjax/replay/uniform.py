"""Uniform replay: a ring of transitions, each a row of packed words."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax import rng
from jrcjax.replay import lookup, packing
from jrcjax.types import Float, Int, Words


class Transition(NamedTuple):
    """A transition; scalars, or [B] in a batch."""

    state: Int
    action: Int
    reward: Float
    next_state: Int
    discount: Float
    """gamma, or 0 if the episode ended for good, so that nothing is bootstrapped. A time limit that truncates leaves it
    at gamma."""


def layout_of(num_states: int, num_actions: int) -> packing.Layout:
    """How transitions are packed: two words in the paper's problem."""
    return packing.layout_of(Transition, (num_states, num_actions, packing.NUMBER, num_states, packing.SWITCH))


def init(capacity: int, layout: packing.Layout) -> Words:
    """An empty ring, [capacity, words]."""
    return jnp.zeros((capacity, layout.words), jnp.uint32)


def add(ring: Words, transition: Transition, count: Int, layout: packing.Layout) -> Words:
    """Writes the transition that is number `count` (from 0) over the oldest one.

    With a `count` that is the same for all agents under vmap the ring is written in place.
    """
    row = packing.pack(transition, layout)[None]
    return jax.lax.dynamic_update_slice(ring, row, (count % ring.shape[0], 0))


def draw(words: Words, count: Int, capacity: int) -> Int:
    """Positions of a uniform sample with replacement of the `count` >= 1 transitions added so far; a word each."""
    return rng.index(words, jnp.minimum(count, capacity))


def at(ring: Words, positions: Int, layout: packing.Layout, discount: Float) -> Transition:
    """The transitions at these positions [B]; `discount` is gamma, of which a ring keeps whether it is 0."""
    return packing.unpack(lookup.read(ring, positions * layout.words, layout.words), layout, discount)
