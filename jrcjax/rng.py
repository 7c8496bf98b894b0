"""Random words to numbers: one uint32 word per uniform or index.

A training run draws all words of an episode at once, because a generator call
inside the innermost loop costs more on a CPU than the environment does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp

from jrcjax.types import Float, Int, Key, Words

_ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))


def bits(key: Key, shape: tuple[int, ...]) -> Words:
    """What `jax.random.bits(key, shape, uint32)` returns: Threefry-2x32 with 20 rounds, counters in row-major order.

    On a CPU JAX runs through all words once in every round, through memory; here each word is computed in one go, three
    to four times faster for an episode's words.
    """
    data = jax.random.key_data(key)
    if data.shape != (2,):  # another generator
        return jax.random.bits(key, shape, jnp.uint32)
    return _threefry(data[0], data[1], jnp.arange(math.prod(shape), dtype=jnp.uint32).reshape(shape))


def bits_of_several(keys: Sequence[Key], sizes: Sequence[int]) -> Words:
    """`bits(keys[i], (sizes[i],))` one after the other, in one loop."""
    data = [jax.random.key_data(key) for key in keys]
    if data[0].shape != (2,):
        return jnp.concatenate([bits(key, (size,)) for key, size in zip(keys, sizes, strict=True)])
    counters = jnp.concatenate([jnp.arange(size, dtype=jnp.uint32) for size in sizes])
    return _threefry(
        repeated([first for first, _ in data], sizes), repeated([last for _, last in data], sizes), counters
    )


def repeated(values: Sequence[jax.Array], sizes: Sequence[int]) -> jax.Array:
    """Each scalar as often as its size says, one after the other; part of the loop that reads it, never a constant."""
    return jnp.concatenate([jnp.broadcast_to(value, (size,)) for value, size in zip(values, sizes, strict=True)])


def _threefry(first: Words, second: Words, counters: Words) -> Words:
    keys = (first, second, first ^ second ^ jnp.uint32(0x1BD11BDA))
    x = jnp.broadcast_to(first, counters.shape)
    y = counters + second
    for i in range(5):
        for rotation in _ROTATIONS[i % 2]:
            x = x + y
            y = ((y << rotation) | (y >> (32 - rotation))) ^ x
        x = x + keys[(i + 1) % 3]
        y = y + keys[(i + 2) % 3] + jnp.uint32(i + 1)
    return x ^ y


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
