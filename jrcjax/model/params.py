"""Environment parameters: one frozen pytree whose numbers may all be traced and vmapped over."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from jaxtyping import Array, Float, Int

from jrcjax.checks import refuse, require_type
from jrcjax.containers import (
    BELOW_ONE,
    DISTRIBUTION,
    NOT_NEGATIVE,
    PROBABILITY,
    Container,
    count,
    flag,
    number,
    part,
    reading,
)
from jrcjax.model import states
from jrcjax.model.channel import Channel
from jrcjax.radar.bank import Radar
from jrcjax.readings import EventModel, MissConvention, RewardState

P = ParamSpec("P")
R = TypeVar("R")
FACTORS = ("channel", "road", "weather", "speed", "nearby")
"""The factors (c, r, w, v, m) of a state, most significant first."""


class Factor(Container):
    """A factor of the surroundings with J levels (level 0 the favourable one in the paper)."""

    prior: Float[Array, " J"] = number(DISTRIBUTION)
    """tau_j, the probability of each level; equation (3)."""
    event_probability: Float[Array, " J"] = number(PROBABILITY)
    """p_j, the probability of an unexpected event at each level; equation (4), and deviation A2 for the speed."""
    persistence: Float[Array, ""] = number(BELOW_ONE, default=0.0)
    """Deviation A10: kappa, the probability that the level stays as it is instead of being drawn anew."""


class EnvParams(Container):
    """Everything that defines one environment."""

    channel: Channel = part(Channel)
    road: Factor = part(Factor)
    weather: Factor = part(Factor)
    speed: Factor = part(Factor)
    nearby: Factor = part(Factor)
    radar: Radar = part(Radar)
    reward_weights: Float[Array, " 4"] = number(NOT_NEGATIVE)
    """(rho_1, rho_2, rho_3, rho_4) of equation (11)."""
    event_model: Int[Array, ""] = reading(EventModel)
    """Deviation A1: how the factors add up to the probability of an event."""
    miss_convention: Int[Array, ""] = reading(MissConvention)
    """Deviation A4: which slots count for the probability of miss detection."""
    count_event_packets: Int[Array, ""] = flag(default=True)
    """Deviation A3: whether packets sent in a slot with an event count as throughput."""
    terminal_time_limit: Int[Array, ""] = flag(default=False)
    """Deviation A11: whether the time limit is a terminal state, and not a truncation."""
    reward_state: Int[Array, ""] = reading(RewardState)
    """Deviation A26: which state a slot's event, packets and reward belong to."""
    max_steps_in_episode: int = count(default=300)
    """Slots per episode."""

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

    def check(self, name: str = "") -> None:
        """Refuses what is not allowed; see `Container.check`."""
        super().check(name)
        if self.num_states >= 2**31:
            allowed = "fewer than 2^31 states, whose ids are int32"
            refuse("shape", f"{self.shape}, {self.num_states} states", allowed)


def of_params(function: Callable[P, R]) -> Callable[P, R]:
    """Refuses a first argument that is not EnvParams."""

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        require_type("params", args[0] if args else kwargs.get("params"), EnvParams)
        return function(*args, **kwargs)

    return checked


def check_params(params: EnvParams) -> None:
    """Checks environment parameters.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    require_type("params", params, EnvParams)
    params.check()
