"""epsilon-greedy actions: line 9 of Algorithm 1."""

from __future__ import annotations

import jax.numpy as jnp

from jrcjax import rng
from jrcjax.types import Float, Int, Words

NUM_WORDS = 2
"""Random words of one action."""


def epsilon_greedy(words: Words, values: Float, epsilon: Float) -> Int:
    """A uniform action with probability epsilon, else the largest value's (the first of equals).

    Args:
      words: [NUM_WORDS] random words.
      values: [A] action values of the current state.
      epsilon: a scalar.
    """
    explores = rng.uniform(words[0]) < epsilon
    return jnp.where(explores, rng.index(words[1], values.shape[-1]), jnp.argmax(values)).astype(jnp.int32)
