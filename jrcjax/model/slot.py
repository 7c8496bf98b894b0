"""One time slot, from state, action and random words to what happens: equations (8) to (11) put together."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from jrcjax import rng
from jrcjax.model import metrics, states
from jrcjax.model.channel import delivered_packets
from jrcjax.model.events import event_probability_at
from jrcjax.model.params import FACTORS, EnvParams
from jrcjax.model.rewards import reward
from jrcjax.model.transitions import initial_levels, next_levels
from jrcjax.radar.bank import slot_miss_ratio
from jrcjax.readings import RewardState

NUM_WORDS = len(FACTORS) + 2
"""Random words of one slot: the factors, the event, the placement."""


class Outcome(NamedTuple):
    """What one slot gives; scalars."""

    next_state: Int[Array, ""]
    reward: Float[Array, ""]
    event: Bool[Array, ""]
    is_data: Bool[Array, ""]
    packets: Float[Array, ""]
    """Packets delivered."""
    miss_ratio: Float[Array, ""]
    """p_k(t); 1 in a slot spent on data."""


def initial_state(words: UInt32[Array, " W"], params: EnvParams) -> Int[Array, ""]:
    """State id at the start of an episode, from words [NUM_WORDS]."""
    return states.id_of(initial_levels(rng.uniform(words[: len(FACTORS)]), params), params.shape)


def run_slot(
    words: UInt32[Array, " W"],
    state: Int[Array, ""],
    action: Int[Array, ""],
    params: EnvParams,
    first: Int[Array, ""],
) -> Outcome:
    """Runs one slot.

    Args:
      words: [NUM_WORDS] random words, all the randomness of the slot.
      state: state id, a scalar.
      action: a data rate 0..L-1 or a radar mode L..L+K-1, a scalar.
      params: the environment.
      first: id of the episode's first state, a scalar.
    """
    levels = states.levels_of(state, params.shape)
    is_first = params.reward_state == RewardState.EPISODE_START
    # Levels are chosen, not states: those of the first state are then computed once per episode.
    deciding = jnp.where(is_first, states.levels_of(first, params.shape), levels)
    u = rng.uniform(words[:-1])
    event = u[-1] < event_probability_at(deciding, params)
    is_data = action < params.num_rates
    rate = jnp.minimum(action, params.num_rates - 1)
    mode = jnp.maximum(action - params.num_rates, 0)
    packets = jnp.where(is_data, delivered_packets(deciding[0], rate, params.channel), 0.0)
    miss = metrics.slot_miss(is_data, slot_miss_ratio(words[-1], mode, params.radar))
    return Outcome(
        next_state=states.id_of(next_levels(u[:-1], levels, params), params.shape),
        reward=reward(is_data, event, packets, miss, params.reward_weights),
        event=event,
        is_data=is_data,
        packets=packets,
        miss_ratio=miss,
    )


def measure(sums: metrics.Metrics, outcome: Outcome, params: EnvParams) -> metrics.Metrics:
    """Adds one slot to the sums of the metrics."""
    counts = metrics.counts_for_miss(outcome.is_data, outcome.event, params.miss_convention)
    return metrics.Metrics(
        slots=sums.slots + 1.0,
        reward=sums.reward + outcome.reward,
        packets=sums.packets + metrics.counted_packets(outcome.packets, outcome.event, params.count_event_packets),
        missed=sums.missed + jnp.where(counts, outcome.miss_ratio, 0.0),
        counted=sums.counted + counts.astype(jnp.float32),
    )
