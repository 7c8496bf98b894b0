"""Refusals: every error names the field, the value and what is allowed, before anything compiles.

Shapes are always checked; numbers only where they are known, that is outside `jit` and `vmap`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from jrcjax.types import COUNT_MODELS, COUNTING_RULES, DISTANCES, EVENT_MODELS, MISS_CONVENTIONS, PLACEMENTS

if TYPE_CHECKING:  # containers call these checks, so importing them here would run in a circle
    from jrcjax.channel import Channel
    from jrcjax.params import EnvParams, Factor
    from jrcjax.radar import Radar

_SUM_TOLERANCE = 1e-5  # a few float32 roundings of a sum of probabilities


def refuse(field: str, value: Any, allowed: str) -> None:
    """Raises the ValueError that all checks raise."""
    shown = value if isinstance(value, str | int | float) else np.asarray(value).tolist()
    raise ValueError(f"{field}: {shown!r}; allowed: {allowed}")


def require(field: str, value: Any, shape: tuple[int | None, ...], test: Callable[[np.ndarray], Any], allowed: str):
    """Refuses a wrong shape, a non-number, NaN, and entries for which `test` fails.

    Args:
      field: dotted name.
      value: array or number, possibly traced.
      shape: wanted shape; None allows any size of at least 1.
      test: array to booleans.
      allowed: what the error says is allowed.
    """
    got = np.shape(value)
    if len(got) != len(shape) or any(w is not None and g != w or g == 0 for g, w in zip(got, shape, strict=True)):
        wanted = tuple("any" if w is None else w for w in shape)
        refuse(field, f"shape {got}", f"shape {wanted}, {allowed}")
    if isinstance(value, jax.core.Tracer):
        return
    array = np.asarray(value)
    if array.dtype.kind not in "iufb":
        refuse(field, value, f"numbers, {allowed}")
    if not np.all(np.isfinite(array)) or not np.all(test(array)):
        refuse(field, value, allowed)


def _probability(x: np.ndarray) -> np.ndarray:
    return (x >= 0) & (x <= 1)


def _positive(x: np.ndarray) -> np.ndarray:
    return x > 0


def _not_negative(x: np.ndarray) -> np.ndarray:
    return x >= 0


def _ascending(x: np.ndarray) -> bool:
    return bool((x > 0).all() and (np.diff(x) > 0).all())


def _sums_to_one(x: np.ndarray) -> bool:
    return bool(_probability(x).all() and abs(x.astype(np.float64).sum() - 1) <= _SUM_TOLERANCE)


def _reading(field: str, value: Any, names: tuple[str, ...]):
    allowed = ", ".join(f"{i} ({name})" for i, name in enumerate(names))
    require(field, value, (), lambda x: np.isin(x, np.arange(len(names))), allowed)


def check_dynamics(name: str, factor: Channel | Factor):
    """Checks what channel and factors share."""
    require(f"{name}.prior", factor.prior, (None,), _sums_to_one, "probabilities in [0, 1] that sum to 1")
    require(f"{name}.persistence", factor.persistence, (), lambda x: (x >= 0) & (x < 1), "a number in [0, 1)")


def check_channel(channel: Channel):
    """Checks a `Channel`."""
    check_dynamics("channel", channel)
    levels, rates = np.shape(channel.prior)[-1], np.shape(channel.packets)[-1] if np.ndim(channel.packets) else None
    require("channel.received_power", channel.received_power, (), _positive, "a power > 0 W")
    require("channel.interference", channel.interference, (levels,), _not_negative, "one power >= 0 W per level")
    require("channel.noise", channel.noise, (), _positive, "a power > 0 W")
    require("channel.packets", channel.packets, (None,), _not_negative, "one number >= 0 per data rate")
    require("channel.sinr_threshold", channel.sinr_threshold, (rates,), _ascending, "one ratio > 0 per rate, ascending")


def check_factor(name: str, factor: Factor):
    """Checks a `Factor`."""
    check_dynamics(name, factor)
    shape = (np.shape(factor.prior)[-1],)
    require(f"{name}.event_probability", factor.event_probability, shape, _probability, "one of [0, 1] per level")


def check_radar(radar: Radar):
    """Checks a `Radar`."""
    require("radar.bandwidth", radar.bandwidth, (None,), _positive, "one frequency > 0 Hz per radar mode")
    modes = np.shape(radar.bandwidth)
    require("radar.slope", radar.slope, modes, _positive, "one slope > 0 Hz/s per radar mode")
    field = "radar.max_intermediate_frequency"
    require(field, radar.max_intermediate_frequency, modes, _positive, "one frequency > 0 Hz per radar mode")
    require("radar.density", radar.density, (), _positive, "a number of objects > 0 per 45 m x 45 m")
    share = "probabilities in [0, 1] that sum to 1, one per class of objects"
    require("radar.class_share", radar.class_share, (None,), _sums_to_one, share)
    classes = np.shape(radar.class_share)[0]
    require("radar.size_mean", radar.size_mean, (classes, 2), _positive, "length and width > 0 m per class")
    require("radar.size_std", radar.size_std, (classes, 2), _not_negative, "deviations >= 0 m per class")
    _reading("radar.distance", radar.distance, DISTANCES)
    _reading("radar.counting_rule", radar.counting_rule, COUNTING_RULES)
    _reading("radar.count_model", radar.count_model, COUNT_MODELS)
    require("radar.bank_seed", radar.bank_seed, (), _not_negative, "an integer >= 0")
    if radar.placements not in PLACEMENTS:
        refuse("radar.placements", radar.placements, ", ".join(map(repr, PLACEMENTS)))
    require("radar.miss_bank", radar.miss_bank, (*modes, None), lambda x: True, "the bank that `replace` builds")
    _check_count(radar)


def _check_count(radar: Radar):
    from jrcjax.radar import mean_count

    if any(isinstance(x, jax.core.Tracer) for x in (radar.density, radar.slope, radar.max_intermediate_frequency)):
        return
    with jax.ensure_compile_time_eval():
        counts = np.asarray(mean_count(radar))
    if not (np.round(counts) >= 1).all():
        refuse("radar.density", float(radar.density), f"at least one object in every mode, not {counts.tolist()}")
    if radar.max_objects and (len(radar.max_objects) != len(counts) or (counts > radar.max_objects).any()):
        refuse("radar.max_objects", list(radar.max_objects), f"one per mode, at least {np.ceil(counts).tolist()}")


def check_params(params: EnvParams) -> None:
    """Checks environment parameters.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    from jrcjax.params import FACTORS, EnvParams

    if not isinstance(params, EnvParams):
        raise ValueError(f"params: {type(params).__name__}; allowed: EnvParams, as paper_params returns it")
    check_channel(params.channel)
    for name in FACTORS[1:]:
        check_factor(name, getattr(params, name))
    check_radar(params.radar)
    require("reward_weights", params.reward_weights, (4,), _not_negative, "four weights >= 0 (rho_1 to rho_4)")
    _reading("event_model", params.event_model, EVENT_MODELS)
    _reading("miss_convention", params.miss_convention, MISS_CONVENTIONS)
    require("count_event_packets", params.count_event_packets, (), lambda x: np.isin(x, (0, 1)), "0 or 1")
    require("terminal_time_limit", params.terminal_time_limit, (), lambda x: np.isin(x, (0, 1)), "0 or 1")
    limit = params.max_steps_in_episode
    if not isinstance(limit, int) or isinstance(limit, bool) or limit < 1:
        refuse("max_steps_in_episode", str(limit), "an integer >= 1")
