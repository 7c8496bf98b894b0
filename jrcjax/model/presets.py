"""The paper's Table I as parameters."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from jrcjax.model.channel import Channel
from jrcjax.model.params import EnvParams, Factor, check_params
from jrcjax.radar.paper import paper_modes, paper_radar
from jrcjax.types import choice

ENVIRONMENTS = ("source", "target")
PRESETS = ("paper", "paper_table")
_DENSITIES = {"source": 54.0, "target": 27.0}  # objects per 45 m x 45 m


def _db(value: float) -> float:
    return 10.0 ** (value / 10.0)


def paper_channel(good: float) -> Channel:
    """A channel that is good with probability `good`: then both rates decode, otherwise the low rate alone.

    The paper gives the packets (2 and 4) and no powers; any SINRs on these sides of the thresholds are the same model.
    """
    return Channel(
        prior=(good, 1.0 - good),
        received_power=1.0,
        interference=(0.0, _db(-10.0)),
        noise=_db(-20.0),
        packets=(2.0, 4.0),
        sinr_threshold=(_db(5.0), _db(15.0)),
    )


def paper_params(environment: str = "target", preset: str = "paper") -> EnvParams:
    """Parameters of the paper's source or target environment.

    Args:
      environment: "source" or "target", the columns of Table I.
      preset: "paper" takes p_0^v = 0.005 from the text, "paper_table" 0.05 from Table I. With 0.05 radar is optimal in
        every state of the target.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    _check(environment, preset)
    return _paper_params(environment, preset)


def without_bank(environment: str = "target", preset: str = "paper") -> EnvParams:
    """`paper_params` with a radar that has no bank of placements, for who wants to read its numbers alone."""
    _check(environment, preset)
    return EnvParams(**_fields(environment, preset), radar=paper_modes(_DENSITIES[environment]))


def _check(environment: str, preset: str) -> None:
    choice("environment", environment, ENVIRONMENTS)
    choice("preset", preset, PRESETS)


@lru_cache
def _paper_params(environment: str, preset: str) -> EnvParams:
    params = EnvParams(**_fields(environment, preset), radar=paper_radar(_DENSITIES[environment]))
    check_params(params)
    return params


def _fields(environment: str, preset: str) -> dict[str, Any]:
    """All fields but the radar."""
    source = environment == "source"
    tau = 0.3 if source else 0.7
    prior = (tau, 1.0 - tau)
    pre_defined = (0.007, 0.07) if source else (0.004, 0.04)
    low_speed = 0.005 if preset == "paper" else 0.05
    return {
        "channel": paper_channel(tau),
        "road": Factor(prior=prior, event_probability=pre_defined),
        "weather": Factor(prior=prior, event_probability=(0.005, 0.046)),
        "speed": Factor(prior=prior, event_probability=(low_speed, 0.1 if source else 0.4)),
        "nearby": Factor(prior=prior, event_probability=pre_defined),
        "reward_weights": (1.0, 100.0, 1.0, 50.0),
    }
