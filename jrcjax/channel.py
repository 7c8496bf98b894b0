"""The data channel: SINR at the base station and what can be decoded, the paper's equation (1)."""

from __future__ import annotations

import jax.numpy as jnp
from flax import struct

from jrcjax.types import Float, Int


@struct.dataclass
class Channel:
    """A channel with J levels (level 0 the best in the paper) and L data rates."""

    prior: Float
    """[J] probability of each level, sums to 1."""
    persistence: Float
    """[] probability that the level stays as it is instead of being drawn anew, in [0, 1)."""
    received_power: Float
    """[] P_R in W."""
    interference: Float
    """[J] interference power sigma_I at each level in W."""
    noise: Float
    """[] noise power sigma_N in W."""
    sinr_threshold: Float
    """[L] smallest SINR (a ratio, not dB) at which each rate decodes, ascending."""
    packets: Float
    """[L] packets per slot that each rate carries when it decodes."""


def sinr(channel: Channel) -> Float:
    """P_R / (sigma_I + sigma_N) at each level, [J]; equation (1)."""
    return channel.received_power / (channel.interference + channel.noise)


def delivered_packets(level: Int, rate: Int, channel: Channel) -> Float:
    """Packets that reach the base station in one slot, a scalar: all of the rate's or none."""
    decodes = sinr(channel)[level] >= channel.sinr_threshold[rate]
    return jnp.where(decodes, channel.packets[rate], 0.0)
