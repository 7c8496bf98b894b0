"""The miss-detection ratio of one new placement, equation (5)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jrcjax.checks import is_positive, is_traced, require, require_keys
from jrcjax.radar.bank import Radar
from jrcjax.radar.modes import Modes, fresh_miss_ratio, fresh_miss_ratio_of
from jrcjax.radar.paper import paper_radar
from jrcjax.readings import CountingRule, CountModel, Distance
from jrcjax.types import Key, choice


def miss_ratio(
    key: Key,
    density: Float[Array, ""] | float,
    mode: Int[Array, ""] | int,
    *,
    distance: str = "footprint_gap",
    rule: str = "resolved",
    count: str = "fixed",
    radar: Modes | None = None,
) -> Float[Array, ""]:
    """p_k of one new placement, equation (5); vmappable over key, density and mode.

    Args:
      key: a PRNG key.
      density: omega, mean number of objects per 45 m x 45 m.
      mode: radar mode, 0 <= mode < K (0 is the long range, 1 the short range of the paper).
      distance: name of a `jrcjax.readings.Distance`.
      rule: name of a `jrcjax.readings.CountingRule`.
      count: name of a `jrcjax.readings.CountModel`.
      radar: modes and classes of objects; Table I's if None. Readings are taken from the arguments above.

    Returns:
      The miss ratio in [0, 1]; NaN if a traced density exceeds what `radar.max_objects` holds.

    Raises:
      ValueError: for an unknown reading, mode or a density that is not positive.
    """
    readings = {
        "distance": choice("distance", distance, Distance.names()),
        "counting_rule": choice("rule", rule, CountingRule.names()),
        "count_model": choice("count", count, CountModel.names()),
    }
    require_keys(key, 0, "one key, as jax.random.key returns it; use vmap for several")
    require("density", density, (), is_positive, "a finite number > 0")
    given = paper_radar() if radar is None else radar
    in_modes = f"an integer from 0 to {given.num_modes - 1}"
    require("mode", mode, (), lambda x: (x >= 0) & (x < given.num_modes), in_modes, kinds="iu")
    modes = (given.modes if isinstance(given, Radar) else given).replace(density=density, **readings)
    if is_traced(mode):
        return fresh_miss_ratio_of(key, jnp.asarray(mode), modes)
    return _jitted_fresh(key, int(mode), modes)


_jitted_fresh = jax.jit(fresh_miss_ratio, static_argnums=1)
