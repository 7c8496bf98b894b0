"""The data channel: SINR at the base station and what can be decoded, the paper's equation (1)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct

from jrcjax.checks import is_ascending, is_distribution, is_not_negative, is_positive, replaced, require, require_type
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


# After the class, because flax's decorator sets a `replace` of its own.
Channel.replace = replaced  # pyright: ignore[reportAttributeAccessIssue]


def sinr(channel: Channel) -> Float:
    """P_R / (sigma_I + sigma_N) at each level, [J]; equation (1)."""
    return channel.received_power / (channel.interference + channel.noise)


def delivered_packets(level: Int, rate: Int, channel: Channel) -> Float:
    """Packets that reach the base station in one slot, a scalar: all of the rate's or none."""
    decodes = sinr(channel)[level] >= channel.sinr_threshold[rate]
    return jnp.where(decodes, channel.packets[rate], 0.0)


def check_dynamics(name: str, prior: Float, persistence: Float) -> None:
    """Checks what channel and factors share: the prior [J], equation (3), and the persistence []."""
    require(f"{name}.prior", prior, (None,), is_distribution, "probabilities in [0, 1] that sum to 1")
    require(f"{name}.persistence", persistence, (), lambda x: (x >= 0) & (x < 1), "a number in [0, 1)")


def check_channel(channel: Channel) -> None:
    """Raises ValueError naming the field, the value and what is allowed."""
    require_type("channel", channel, Channel)
    check_dynamics("channel", channel.prior, channel.persistence)
    levels, rates = np.shape(channel.prior)[-1], np.shape(channel.packets)[-1] if np.ndim(channel.packets) else None
    require("channel.received_power", channel.received_power, (), is_positive, "a power > 0 W")
    require("channel.interference", channel.interference, (levels,), is_not_negative, "one power >= 0 W per level")
    require("channel.noise", channel.noise, (), is_positive, "a power > 0 W")
    require("channel.packets", channel.packets, (None,), is_not_negative, "one number >= 0 per data rate")
    require(
        "channel.sinr_threshold", channel.sinr_threshold, (rates,), is_ascending, "one ratio > 0 per rate, ascending"
    )
