"""Environment parameters: one frozen pytree whose numbers may all be traced and vmapped over."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import jax.numpy as jnp
import numpy as np
from flax import struct

from jrcjax.checks import (
    as_array,
    is_not_negative,
    is_probability,
    refuse,
    replaced,
    require,
    require_integer,
    require_reading,
    require_type,
)
from jrcjax.model import states
from jrcjax.model.channel import Channel, check_channel, check_dynamics
from jrcjax.radar.modes import Radar, check_bank, check_radar
from jrcjax.types import EVENT_MODELS, MISS_CONVENTIONS, Float, Int

P = ParamSpec("P")
R = TypeVar("R")
FACTORS = ("channel", "road", "weather", "speed", "nearby")
"""The factors (c, r, w, v, m) of a state, most significant first."""


@struct.dataclass
class Factor:
    """A factor of the surroundings with J levels (level 0 the favourable one in the paper)."""

    prior: Float
    """[J] tau_j, probability of each level, sums to 1; equation (3)."""
    event_probability: Float
    """[J] p_j, probability of an unexpected event at each level; equation (4)."""
    persistence: Float
    """[] kappa, probability that the level stays as it is instead of being drawn anew, in [0, 1)."""


@struct.dataclass
class EnvParams:
    """Everything that defines one environment. `replace` on `radar` rebuilds its bank of placements."""

    channel: Channel
    road: Factor
    weather: Factor
    speed: Factor
    nearby: Factor
    radar: Radar
    reward_weights: Float
    """[4] (rho_1, rho_2, rho_3, rho_4) of equation (11)."""
    event_model: Int
    """[] index into EVENT_MODELS."""
    miss_convention: Int
    """[] index into MISS_CONVENTIONS."""
    count_event_packets: Int
    """[] 1 if packets sent in a slot with an event count as throughput, else 0."""
    terminal_time_limit: Int
    """[] 1 if the time limit is a terminal state, 0 if it truncates."""
    max_steps_in_episode: int = struct.field(pytree_node=False, default=300)
    """Slots per episode, static."""

    @property
    def factors(self) -> tuple[Channel | Factor, ...]:
        """The five factors in the order of FACTORS."""
        return (self.channel, *self.surroundings)

    @property
    def surroundings(self) -> tuple[Factor, ...]:
        """The factors that cause events, that is all but the channel."""
        return (self.road, self.weather, self.speed, self.nearby)

    @property
    def shape(self) -> tuple[int, ...]:
        """Levels per factor."""
        return tuple(factor.prior.shape[-1] for factor in self.factors)

    @property
    def num_states(self) -> int:
        """S."""
        return states.num_states(self.shape)

    @property
    def num_rates(self) -> int:
        """L."""
        return self.channel.packets.shape[-1]

    @property
    def num_actions(self) -> int:
        """A = L + K: the data rates in ascending order, then the radar modes."""
        return self.num_rates + self.radar.num_modes


# After the classes, because flax's decorator sets a `replace` of its own.
Factor.replace = EnvParams.replace = replaced  # pyright: ignore[reportAttributeAccessIssue]


def of_params(function: Callable[P, R]) -> Callable[P, R]:
    """Refuses a first argument that is not EnvParams."""

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        require_type("params", args[0] if args else kwargs.get("params"), EnvParams)
        return function(*args, **kwargs)

    return checked


def make_factor(prior, event_probability, persistence: float = 0.0) -> Factor:
    """A `Factor` from plain numbers; `check_params` checks them together with the rest."""
    fields = {"prior": prior, "event_probability": event_probability, "persistence": persistence}
    return Factor(**{name: jnp.asarray(as_array(name, value, "numbers")) for name, value in fields.items()})


def check_factor(name: str, factor: Factor) -> None:
    """Raises ValueError naming the field, the value and what is allowed."""
    require_type(name, factor, Factor)
    check_dynamics(name, factor.prior, factor.persistence)
    shape = (np.shape(factor.prior)[-1],)
    require(f"{name}.event_probability", factor.event_probability, shape, is_probability, "one of [0, 1] per level")


def check_params(params: EnvParams) -> None:
    """Checks environment parameters.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    check_all_but_radar(params)
    check_radar(params.radar)
    check_bank(params.radar)


def check_all_but_radar(params: EnvParams) -> None:
    """`check_params` for parameters whose radar, with its bank, is still to be built."""
    require_type("params", params, EnvParams)
    check_channel(params.channel)
    for name in FACTORS[1:]:
        check_factor(name, getattr(params, name))
    if params.num_states >= 2**31:
        refuse("shape", f"{params.shape}, {params.num_states} states", "fewer than 2^31 states, whose ids are int32")
    weights = "four weights >= 0 (rho_1 to rho_4), of a signed type"
    require("reward_weights", params.reward_weights, (4,), is_not_negative, weights, kinds="if")
    require_reading("event_model", params.event_model, EVENT_MODELS)
    require_reading("miss_convention", params.miss_convention, MISS_CONVENTIONS)
    require("count_event_packets", params.count_event_packets, (), lambda x: np.isin(x, (0, 1)), "0 or 1", kinds="iu")
    require("terminal_time_limit", params.terminal_time_limit, (), lambda x: np.isin(x, (0, 1)), "0 or 1", kinds="iu")
    require_integer("max_steps_in_episode", params.max_steps_in_episode, 1)
