"""The two spaces that the environment needs, in gymnax' shape."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from jrcjax.types import Bool, Int, Key


@dataclass(frozen=True)
class Discrete:
    """Integers 0 to n - 1."""

    n: int
    shape: tuple[int, ...] = ()
    dtype: type = jnp.int32

    def sample(self, key: Key) -> Int:
        """A uniform element."""
        return jax.random.randint(key, self.shape, 0, self.n, self.dtype)

    def contains(self, x: jax.Array) -> Bool:
        """Whether x is an element."""
        x = jnp.asarray(x)
        return (x >= 0) & (x < self.n) & (x == jnp.floor(x))


@dataclass(frozen=True)
class Box:
    """Arrays with every entry between `low` and `high`."""

    low: float
    high: float
    shape: tuple[int, ...]
    dtype: type = jnp.float32

    def sample(self, key: Key) -> jax.Array:
        """A uniform element."""
        return jax.random.uniform(key, self.shape, self.dtype, self.low, self.high)

    def contains(self, x: jax.Array) -> Bool:
        """Whether x is an element."""
        x = jnp.asarray(x)
        return jnp.asarray(x.shape == self.shape) & (x >= self.low).all() & (x <= self.high).all()
