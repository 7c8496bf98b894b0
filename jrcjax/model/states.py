"""State ids and factor levels: the paper's equation (8).

An id counts in mixed radix with the channel as the most significant digit: with two levels each,
(c, r, w, v, m) = (0, 0, 0, 0, 1) is state 1.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


def num_states(shape: tuple[int, ...]) -> int:
    """Number of states for `shape` levels per factor."""
    return math.prod(shape)


def levels_of(state: Int[Array, "*batch"], shape: tuple[int, ...]) -> Int[Array, "*batch F"]:
    """Levels (c, r, w, v, m) of state ids [...]; [..., F]."""
    rest = jnp.asarray(state).astype(jnp.uint32)  # divides in one loop, where signed numbers take several
    levels = []
    for size in reversed(shape):
        levels.append(rest % size)
        rest = rest // size
    return jnp.stack(levels[::-1], axis=-1).astype(jnp.int32)


def id_of(levels: Int[Array, "*batch F"], shape: tuple[int, ...]) -> Int[Array, "*batch"]:
    """State ids [...] of levels [..., F]."""
    state = jnp.zeros_like(levels[..., 0])
    for factor, size in enumerate(shape):
        state = state * size + levels[..., factor]
    return state


def features_of(state: Int[Array, "*batch"], shape: tuple[int, ...]) -> Float[Array, "*batch F"]:
    """What an agent observes in states [...]: each level scaled to [0, 1]; [..., F] float32."""
    return _scaled(levels_of(state, shape), shape)


def _scaled(levels: Any, shape: tuple[int, ...]) -> Any:
    largest = np.maximum(np.asarray(shape, np.float32) - np.float32(1.0), np.float32(1.0))
    return levels.astype(np.float32) / np.broadcast_to(largest, levels.shape)


@functools.lru_cache
def all_features(shape: tuple[int, ...]) -> np.ndarray:
    """`features_of` all states in order, [S, F]: a constant of programs, read-only, and made without a program."""
    features = _scaled(np.stack(np.unravel_index(np.arange(num_states(shape)), shape), axis=-1), shape)
    features.flags.writeable = False
    return features
