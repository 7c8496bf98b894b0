"""Random placement of cars and pedestrians in the square that a radar mode covers."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jrcjax.numerics import threefry
from jrcjax.readings import CountModel
from jrcjax.types import Key


class Footprints(NamedTuple):
    """Axis-aligned rectangular footprints of N objects, of which `present` marks the real ones."""

    centre: Float[Array, "N 2"]
    """Position in m, the vehicle at the origin, looking along the first axis."""
    size: Float[Array, "N 2"]
    """Length (first axis) and width in m."""
    present: Bool[Array, " N"]
    """Which are real."""


class ObjectClasses(NamedTuple):
    """Shares and normal size distributions of the C classes of objects (Table I: cars, pedestrians)."""

    share: Float[Array, " C"]
    """Sums to 1."""
    size_mean: Float[Array, "C 2"]
    """Mean length and width in m."""
    size_std: Float[Array, "C 2"]
    """Standard deviations in m."""


def object_count(key: Key, mean: Float[Array, ""], model: Int[Array, ""]) -> Int[Array, ""]:
    """Number of objects in one placement, a scalar.

    Args:
      key: used by the Poisson count alone.
      mean: expected number of objects, a scalar.
      model: number of a `jrcjax.readings.CountModel`, a scalar.
    """
    fixed = jnp.round(mean).astype(jnp.int32)
    # A zero mean draws zero at once, so that fixed counts do not pay for the Poisson sampler's loop.
    is_poisson = model == CountModel.POISSON
    drawn = jax.random.poisson(threefry(key), jnp.where(is_poisson, mean, 0.0), dtype=jnp.int32)
    return jnp.where(is_poisson, drawn, fixed)


def place_objects(
    key: Key, count: Int[Array, ""], side: Float[Array, ""], classes: ObjectClasses, capacity: int
) -> Footprints:
    """Places `count` objects uniformly and independently in a square (the paper, section VI-A.2).

    The vehicle stands in the middle of the near edge. The first round(share * count) objects are of
    the first class and so on, so 27 objects are 20 cars and 7 pedestrians. An object is the same for
    every capacity that holds it.

    Args:
      key: a PRNG key.
      count: number of objects, a scalar, at most `capacity`.
      side: side of the square in m, a scalar.
      classes: shares and sizes of the C classes of objects.
      capacity: static number N of slots; those from `count` on are absent.

    Returns:
      Footprints of N objects.
    """
    import distrax  # costs 0.7 s of import, so only those who place objects pay it

    position_key, size_key = jax.random.split(key)
    corner = jnp.stack([jnp.zeros_like(side), -side / 2.0])
    centre = corner + side * jax.random.uniform(position_key, (capacity, 2))

    number = jnp.arange(capacity)
    last = jnp.round(jnp.cumsum(classes.share) * count)
    kind = jnp.minimum((number[:, None] >= last).sum(axis=1), classes.share.shape[0] - 1)
    standard = distrax.Normal(jnp.zeros(2), jnp.ones(2)).sample(seed=size_key, sample_shape=(capacity,))
    size = classes.size_mean[kind] + classes.size_std[kind] * standard
    return Footprints(centre, jnp.maximum(size, 0.0), number < count)
