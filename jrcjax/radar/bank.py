"""The miss ratio of fresh placements, equation (5), and the bank that holds many of them."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp

from jrcjax.radar import chirp, detection
from jrcjax.radar.placement import Footprints, object_count, place_objects
from jrcjax.types import Float, Int, Key

if TYPE_CHECKING:  # a Radar builds its bank, so it imports this module
    from jrcjax.radar.modes import Radar

REFERENCE_SIDE = 45.0
"""Side in m of the square in which the density omega counts objects."""
BANK_FIELDS = (
    "bandwidth",
    "slope",
    "max_intermediate_frequency",
    "density",
    "class_share",
    "size_mean",
    "size_std",
    "distance",
    "counting_rule",
    "count_model",
    "bank_seed",
)
"""Fields of a Radar that its bank depends on."""
_CHUNK = 256  # placements handled at once while a bank is built: about 10 MB of boxes


def mean_count(radar: Radar) -> Float:
    """Mean number of objects in the square of each mode, [K]: omega (R_max / 45 m)^2."""
    reach = chirp.maximum_range(radar.slope, radar.max_intermediate_frequency)
    return radar.density * (reach / REFERENCE_SIDE) ** 2


def fresh_placement(key: Key, mode: int, radar: Radar) -> tuple[Int, Footprints]:
    """A new placement in mode `mode` (static): number of objects, and footprints of as many as there are slots for."""
    count_key, place_key = jax.random.split(key)
    count = object_count(count_key, mean_count(radar)[mode], radar.count_model)
    side = chirp.maximum_range(radar.slope, radar.max_intermediate_frequency)[mode]
    return count, place_objects(place_key, count, side, radar.classes, radar.max_objects[mode])


def fresh_miss_ratio(key: Key, mode: int, radar: Radar) -> Float:
    """p_k of one new placement in mode `mode` (static), a scalar; equation (5)."""
    count, footprints = fresh_placement(key, mode, radar)
    resolution = chirp.range_resolution(radar.bandwidth)[mode]
    detected = detection.detected_objects(footprints, resolution, radar.distance, radar.counting_rule)
    return jnp.where(count <= radar.max_objects[mode], detection.miss_ratio(count, detected), jnp.nan)


def fresh_miss_ratio_of(key: Key, mode: Int, radar: Radar) -> Float:
    """`fresh_miss_ratio` for a mode that is an array; a mode's number of slots is static, so each has its branch."""
    modes = [functools.partial(fresh_miss_ratio, mode=m, radar=radar) for m in range(radar.num_modes)]
    return jnp.where((mode >= 0) & (mode < radar.num_modes), jax.lax.switch(mode, modes, key), jnp.nan)


def bank_key(radar: Radar, mode: Int | int, i: Int) -> Key:
    """The key of placement number `i` of a mode in the bank."""
    return jax.random.fold_in(jax.random.fold_in(jax.random.key(radar.bank_seed), mode), i)


def build_bank(radar: Radar, size: int) -> Float:
    """Miss ratios of `size` independent placements per mode, [K, size]."""
    bare = dataclasses.replace(radar, miss_bank=jnp.zeros((radar.num_modes, 0)), bank_inputs=jnp.zeros(0))
    return _build_bank(bare, size)


def bank_inputs(radar: Radar) -> Float:
    """All numbers that a bank depends on, [n]."""
    fields = [getattr(radar, name) for name in BANK_FIELDS]
    return jnp.concatenate([jnp.ravel(jnp.asarray(field)).astype(jnp.float32) for field in fields])


@jax.jit(static_argnums=1)
def _build_bank(radar: Radar, size: int) -> Float:
    def of_mode(mode: int) -> Float:
        keys = jax.vmap(lambda i: bank_key(radar, mode, i))(jnp.arange(size))
        return jax.lax.map(lambda key: fresh_miss_ratio(key, mode, radar), keys, batch_size=min(size, _CHUNK))

    return jnp.stack([of_mode(mode) for mode in range(radar.num_modes)])
