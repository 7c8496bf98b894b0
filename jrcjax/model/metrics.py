"""Performance metrics: the paper's equations (6) and (7) in all conventions.

Each slot adds to sums; an episode's metric is a function of its sums, so a mean over slots of any number of
episodes comes from added sums.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jrcjax.readings import MissConvention


class Metrics(NamedTuple):
    """Sums over slots, scalars."""

    slots: Float[Array, ""]
    reward: Float[Array, ""]
    packets: Float[Array, ""]
    missed: Float[Array, ""]
    """Sum of p_k(t) over the slots that the convention counts."""
    counted: Float[Array, ""]
    """Number of slots that the convention counts."""


def zero() -> Metrics:
    """No slots."""
    return Metrics(*[jnp.float32(0.0)] * len(Metrics._fields))


def counted_packets(
    packets: Float[Array, ...], event: Bool[Array, ...], count_event_packets: Int[Array, ""]
) -> Float[Array, ...]:
    """Packets of one slot that count as throughput; equation (6) counts all."""
    return jnp.where(event & (count_event_packets == 0), 0.0, packets)


def counts_for_miss(is_data: Bool[Array, ...], event: Bool[Array, ...], convention: Int[Array, ""]) -> Bool[Array, ...]:
    """Whether a slot enters the mean in equation (7), by number of a `jrcjax.readings.MissConvention`."""
    of_event = (convention == MissConvention.EVENT_SLOTS) & event
    of_radar = (convention == MissConvention.RADAR_SLOTS) & ~is_data
    return (convention == MissConvention.ALL_SLOTS) | of_event | of_radar


def slot_miss(is_data: Bool[Array, ...], radar_miss_ratio: Float[Array, ...]) -> Float[Array, ...]:
    """p_k(t): a slot spent on data detects nothing, so it misses all (N_k = 0)."""
    return jnp.where(is_data, 1.0, radar_miss_ratio)


def average_reward(sums: Metrics) -> Float[Array, ""]:
    """Reward per slot."""
    return sums.reward / sums.slots


def throughput(sums: Metrics) -> Float[Array, ""]:
    """Packets in all slots of the sums; equation (6) for one episode."""
    return sums.packets


def miss_detection(sums: Metrics) -> Float[Array, ""]:
    """P_k, equation (7); NaN if no slot counts (an episode without events or without radar)."""
    some = sums.counted > 0  # a number of slots, or in the exact solver a probability below 1
    return jnp.where(some, sums.missed / jnp.where(some, sums.counted, 1.0), jnp.nan)
