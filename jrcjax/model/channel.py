"""The data channel: SINR at the base station and what can be decoded, the paper's equation (1)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jrcjax.containers import ASCENDING, BELOW_ONE, DISTRIBUTION, NOT_NEGATIVE, POSITIVE, Container, number


class Channel(Container):
    """A channel with J levels (level 0 the best in the paper) and L data rates."""

    prior: Float[Array, " J"] = number(DISTRIBUTION)
    """Probability of each level."""
    persistence: Float[Array, ""] = number(BELOW_ONE, default=0.0)
    """Deviation A10: kappa, the probability that the level stays as it is instead of being drawn anew."""
    received_power: Float[Array, ""] = number(POSITIVE, "W")
    """P_R of equation (1)."""
    interference: Float[Array, " J"] = number(NOT_NEGATIVE, "W")
    """Interference power sigma_I at each level."""
    noise: Float[Array, ""] = number(POSITIVE, "W")
    """Noise power sigma_N."""
    packets: Float[Array, " L"] = number(NOT_NEGATIVE, "packets per slot")
    """What each rate carries when it decodes."""
    sinr_threshold: Float[Array, " L"] = number(ASCENDING)
    """Smallest SINR (a ratio, not dB) at which each rate decodes."""


def sinr(channel: Channel) -> Float[Array, " J"]:
    """P_R / (sigma_I + sigma_N) at each level; equation (1)."""
    return channel.received_power / (channel.interference + channel.noise)


def delivered_packets(level: Int[Array, ""], rate: Int[Array, ""], channel: Channel) -> Float[Array, ""]:
    """Packets that reach the base station in one slot: all of the rate's or none."""
    decodes = sinr(channel)[level] >= channel.sinr_threshold[rate]
    return jnp.where(decodes, channel.packets[rate], 0.0)
