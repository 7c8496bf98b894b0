"""Random words to numbers: one uint32 word per uniform or index.

A training run draws all words of an episode at once, because a generator call
inside the innermost loop costs more on a CPU than the environment does.
"""

from __future__ import annotations

import jax.numpy as jnp

from jrcjax.types import Float, Int, Words


def uniform(words: Words) -> Float:
    """Uniform float32 in [0, 1) from the upper 24 bits of each word; any shape."""
    return (words >> 8).astype(jnp.float32) * jnp.float32(2.0**-24)


def index(words: Words, n: Int | int) -> Int:
    """Uniform index in [0, n), the high half of word times n; any shape, n >= 1.

    An index' probability is off by less than n 2^-32 of itself.
    """
    n = jnp.asarray(n).astype(jnp.uint32)
    half = jnp.uint32(0xFFFF)
    word_high, word_low = words >> 16, words & half
    n_high, n_low = n >> 16, n & half
    # 32 x 32 -> 64 bit product by halves, of which only the upper 32 bits are kept.
    low = (word_low * n_low) >> 16
    middle = word_high * n_low + low
    carry = word_low * n_high + (middle & half)
    return (word_high * n_high + (middle >> 16) + (carry >> 16)).astype(jnp.int32)
