"""The paper's Table I as parameters."""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp

from jrcjax import chirp
from jrcjax.channel import Channel
from jrcjax.params import EnvParams, check_params, make_factor
from jrcjax.radar import Radar, make_radar
from jrcjax.types import EVENT_MODELS, MISS_CONVENTIONS, choice

ENVIRONMENTS = ("source", "target")
PRESETS = ("paper", "paper_table")

_CARS, _PEDESTRIANS = 20, 7  # mean numbers per slot in nuScenes, from which the paper's density of 27 comes
_RANGES = (225.0, 45.0)  # m, long and short range
_BANDWIDTHS = (300e6, 750e6)  # Hz
_SLOPES = (10e12, 15e12)  # Hz/s
MAX_DENSITY = 54.0  # objects per 45 m x 45 m, the largest in the paper


def _db(value: float) -> float:
    return 10.0 ** (value / 10.0)


def paper_radar(density: float = 27.0) -> Radar:
    """The two chirps and the cars and pedestrians of Table I, at `density` objects per 45 m x 45 m.

    One maximum intermediate frequency can't give both ranges that the text states, so each chirp has its own.
    """
    return _paper_radar(density)


@lru_cache
def _paper_radar(density: float) -> Radar:
    max_if = [2.0 * r * f / chirp.SPEED_OF_LIGHT for r, f in zip(_RANGES, _SLOPES, strict=True)]
    total = _CARS + _PEDESTRIANS
    with jax.ensure_compile_time_eval():  # the cache must hold numbers, also when a trace asks first
        return make_radar(
            bandwidth=_BANDWIDTHS,
            slope=_SLOPES,
            max_intermediate_frequency=max_if,
            density=density,
            class_share=(_CARS / total, _PEDESTRIANS / total),
            size_mean=((4.62, 1.92), (0.73, 0.68)),
            size_std=((0.18, 0.08), (0.085, 0.055)),
            max_density=MAX_DENSITY,
        )


def paper_channel(good: float) -> Channel:
    """A channel that is good with probability `good`: then both rates decode, otherwise the low rate alone.

    The paper gives the packets (2 and 4) and no powers; any SINRs on these sides of the thresholds are the same model.
    """
    f32 = lambda x: jnp.asarray(x, jnp.float32)  # noqa: E731
    return Channel(
        prior=f32([good, 1.0 - good]),
        persistence=f32(0.0),
        received_power=f32(1.0),
        interference=f32([0.0, _db(-10.0)]),
        noise=f32(_db(-20.0)),
        sinr_threshold=f32([_db(5.0), _db(15.0)]),
        packets=f32([2.0, 4.0]),
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
    choice("environment", environment, ENVIRONMENTS)
    choice("preset", preset, PRESETS)
    return _paper_params(environment, preset)


@lru_cache
def _paper_params(environment: str, preset: str) -> EnvParams:
    source = environment == "source"
    tau = 0.3 if source else 0.7
    prior = (tau, 1.0 - tau)
    pre_defined = (0.007, 0.07) if source else (0.004, 0.04)
    low_speed = 0.005 if preset == "paper" else 0.05
    with jax.ensure_compile_time_eval():
        params = EnvParams(
            channel=paper_channel(tau),
            road=make_factor(prior, pre_defined),
            weather=make_factor(prior, (0.005, 0.046)),
            speed=make_factor(prior, (low_speed, 0.1 if source else 0.4)),
            nearby=make_factor(prior, pre_defined),
            radar=paper_radar(54.0 if source else 27.0),
            reward_weights=jnp.asarray([1.0, 100.0, 1.0, 50.0], jnp.float32),
            event_model=jnp.int32(choice("event_model", "conditional", EVENT_MODELS)),
            miss_convention=jnp.int32(choice("miss_convention", "all_slots", MISS_CONVENTIONS)),
            count_event_packets=jnp.int32(1),
            terminal_time_limit=jnp.int32(0),
        )
    check_params(params)
    return params
