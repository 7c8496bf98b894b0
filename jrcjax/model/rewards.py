"""Immediate reward: the paper's equation (11)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


def reward(
    is_data: Bool[Array, ...],
    event: Bool[Array, ...],
    packets: Float[Array, ...],
    miss_ratio: Float[Array, ...],
    weights: Float[Array, " 4"],
) -> Float[Array, ...]:
    """rho_t, equation (11); all arguments but `weights` scalars or of one shape.

    Args:
      is_data: the slot was spent on data, not on radar.
      event: an unexpected event happened in the slot.
      packets: packets delivered in the slot.
      miss_ratio: p_k(t) of the slot.
      weights: [4] (rho_1, rho_2, rho_3, rho_4).
    """
    on_data = jnp.where(event, -weights[1], weights[0] * packets)
    on_radar = jnp.where(event, weights[3] * (1.0 - miss_ratio), -weights[2])
    return jnp.where(is_data, on_data, on_radar)
