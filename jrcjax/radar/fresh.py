"""The miss-detection ratio of one new placement, equation (5)."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp

from jrcjax.checks import is_positive, is_traced, require, require_keys
from jrcjax.radar.bank import fresh_miss_ratio, fresh_miss_ratio_of
from jrcjax.radar.modes import Radar, capacities
from jrcjax.radar.paper import paper_radar
from jrcjax.types import COUNT_MODELS, COUNTING_RULES, DISTANCES, Float, Int, Key, choice


def miss_ratio(
    key: Key,
    density: Float | float,
    mode: Int | int,
    *,
    distance: str = "footprint_gap",
    rule: str = "resolved",
    count: str = "fixed",
    radar: Radar | None = None,
) -> Float:
    """p_k of one new placement, equation (5); vmappable over key, density and mode.

    Args:
      key: a PRNG key.
      density: omega, mean number of objects per 45 m x 45 m.
      mode: radar mode, 0 <= mode < K (0 is the long range, 1 the short range of the paper).
      distance: one of DISTANCES.
      rule: one of COUNTING_RULES.
      count: one of COUNT_MODELS.
      radar: modes and classes of objects; Table I's if None. Readings are taken from the arguments above.

    Returns:
      The miss ratio in [0, 1], a scalar; NaN if a traced density exceeds what `radar.max_objects` holds.

    Raises:
      ValueError: for an unknown reading, mode or a density that is not positive.
    """
    readings = {
        "distance": choice("distance", distance, DISTANCES),
        "counting_rule": choice("rule", rule, COUNTING_RULES),
        "count_model": choice("count", count, COUNT_MODELS),
    }
    require_keys(key, 0, "one key, as jax.random.key returns it; use vmap for several")
    require("density", density, (), is_positive, "a finite number > 0")
    radar = paper_radar() if radar is None else radar
    modes = radar.num_modes
    require("mode", mode, (), lambda x: (x >= 0) & (x < modes), f"an integer from 0 to {modes - 1}", kinds="iu")
    indices = {name: jnp.int32(index) for name, index in readings.items()}
    radar = dataclasses.replace(radar, density=jnp.asarray(density, jnp.float32), **indices)
    radar = dataclasses.replace(radar, max_objects=capacities(radar, radar.max_objects))
    if is_traced(mode):
        return fresh_miss_ratio_of(key, jnp.asarray(mode), radar)
    return _jitted_fresh(key, int(mode), radar)


_jitted_fresh = jax.jit(fresh_miss_ratio, static_argnums=1)
