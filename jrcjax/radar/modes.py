"""The multi-mode radar: its parameters and the miss-detection ratio of one slot, equation (5).

The bank holds the miss ratios of many independent placements per mode, so that a slot costs one look-up. It is part
of `Radar` and is built anew whenever `Radar.replace` changes anything that it depends on; under `jit` and `vmap` it is
built inside the same program.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from jrcjax import rng
from jrcjax.checks import (
    as_array,
    is_distribution,
    is_not_negative,
    is_positive,
    is_probability,
    is_traced,
    refuse,
    replaced,
    require,
    require_integer,
    require_reading,
    require_type,
)
from jrcjax.radar.bank import (
    BANK_FIELDS,
    bank_inputs,
    bank_key,
    build_bank,
    fresh_miss_ratio_of,
    fresh_placement,
    mean_count,
)
from jrcjax.radar.placement import Footprints, ObjectClasses
from jrcjax.types import COUNT_MODELS, COUNTING_RULES, DISTANCES, PLACEMENTS, Float, Int, Words, choice

_UNLIMITED = 2**31 - 1  # stands for slots that are still to be counted


@struct.dataclass
class Radar:
    """Parameters of K radar modes and of the objects around the vehicle."""

    bandwidth: Float
    """[K] sweep bandwidth b in Hz."""
    slope: Float
    """[K] chirp slope f_c in Hz/s."""
    max_intermediate_frequency: Float
    """[K] F_max in Hz."""
    density: Float
    """[] omega, mean number of objects per 45 m x 45 m."""
    class_share: Float
    """[C] shares of the classes of objects, sum 1."""
    size_mean: Float
    """[C, 2] mean length and width in m."""
    size_std: Float
    """[C, 2] standard deviation of length and width in m."""
    distance: Int
    """[] index into DISTANCES."""
    counting_rule: Int
    """[] index into COUNTING_RULES."""
    count_model: Int
    """[] index into COUNT_MODELS."""
    bank_seed: Int
    """[] seed of the bank's placements."""
    miss_bank: Float
    """[K, B] miss ratios of B independent placements per mode; derived, see `replace`."""
    bank_inputs: Float
    """[n] the numbers that the bank was built from, by which `check_params` knows one that no longer fits."""
    max_objects: tuple[int, ...] = struct.field(pytree_node=False)
    """K slots for objects; a count above it gives NaN, never a silently smaller number."""
    placements: str = struct.field(pytree_node=False, default="bank")
    """One of PLACEMENTS: a slot draws from the bank, or places its objects afresh."""

    @property
    def num_modes(self) -> int:
        """K."""
        return self.bandwidth.shape[-1]

    @property
    def classes(self) -> ObjectClasses:
        """Shares and sizes of the classes of objects."""
        return ObjectClasses(self.class_share, self.size_mean, self.size_std)


def _replace(self: Radar, **changes) -> Radar:
    """A copy with the given fields changed and a bank that fits them.

    Inside `jit` or `vmap`, where a density has no value, `max_objects` stays as it is.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    if changes.keys() <= {"miss_bank", "max_objects", "placements"}:
        return dataclasses.replace(self, **changes)
    bank_size = self.miss_bank.shape[-1]
    modes = np.shape(changes.get("bandwidth", self.bandwidth))
    unknown = {"miss_bank": np.zeros((*modes, bank_size)), "max_objects": (_UNLIMITED,) * math.prod(modes)}
    new = replaced(self, **{**unknown, **changes})
    check_radar(new)
    given = {
        name: jnp.asarray(value, getattr(self, name).dtype) for name, value in changes.items() if name != "placements"
    }
    new = dataclasses.replace(new, **given, max_objects=capacities(new, self.max_objects))
    return _with_bank(new, bank_size)


# After the class, because flax's decorator sets a `replace` of its own.
Radar.replace = _replace  # pyright: ignore[reportAttributeAccessIssue]


def make_radar(
    *,
    bandwidth,
    slope,
    max_intermediate_frequency,
    density: float,
    class_share,
    size_mean,
    size_std,
    distance: str = "footprint_gap",
    counting_rule: str = "resolved",
    count_model: str = "fixed",
    placements: str = "bank",
    bank_size: int = 4096,
    bank_seed: int = 0,
    max_density: float | None = None,
) -> Radar:
    """Builds a `Radar` and its bank; arguments as the fields, readings by name.

    `bank_size` is B, the number of placements per mode, and `max_density` the largest density that `replace` may set
    under `vmap` (the density itself if None).

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    choice("radar.placements", placements, PLACEMENTS)
    readings = {
        "distance": choice("radar.distance", distance, DISTANCES),
        "counting_rule": choice("radar.counting_rule", counting_rule, COUNTING_RULES),
        "count_model": choice("radar.count_model", count_model, COUNT_MODELS),
    }
    for name, value in (("bank_size", bank_size), ("bank_seed", bank_seed)):
        require_integer(f"radar.{name}", value, 1 if name == "bank_size" else 0)
    numbers = {
        "bandwidth": bandwidth,
        "slope": slope,
        "max_intermediate_frequency": max_intermediate_frequency,
        "density": density,
        "class_share": class_share,
        "size_mean": size_mean,
        "size_std": size_std,
    }
    arrays = {name: as_array(f"radar.{name}", value, "numbers") for name, value in numbers.items()}
    modes = arrays["bandwidth"].shape
    fields: dict[str, Any] = {  # NumPy's arrays, so that checking them compiles nothing
        **arrays,
        **{name: np.int32(index) for name, index in readings.items()},
        "bank_seed": np.int32(bank_seed),
        "miss_bank": np.zeros((*modes, 1)),
        "bank_inputs": np.zeros(0),
    }
    radar = Radar(**fields, max_objects=(_UNLIMITED,) * math.prod(modes), placements=placements)
    check_radar(radar)
    largest = as_array("radar.max_density", density if max_density is None else max_density, "a number > 0")
    require("radar.max_density", largest, (), is_positive, "a number > 0")
    scale = max(float(largest / arrays["density"]), 1.0)
    radar = dataclasses.replace(radar, max_objects=capacities(radar, scale=scale))
    return _with_bank(jax.tree.map(jnp.asarray, radar), bank_size)


def _concrete_counts(radar: Radar) -> np.ndarray:
    known = {name: np.asarray(getattr(radar, name)) for name in ("density", "slope", "max_intermediate_frequency")}
    return np.asarray(mean_count(dataclasses.replace(radar, **known)), np.float64)


def capacities(radar: Radar, at_least: tuple[int, ...] = (), scale: float = 1.0) -> tuple[int, ...]:
    """Slots for any fixed count, and for a Poisson count but for a chance below 1e-12, at `scale` times the density."""
    if is_traced(radar.density, radar.slope, radar.max_intermediate_frequency):
        return at_least
    mean = _concrete_counts(radar) * scale
    needed = [math.ceil(m + 8.0 * math.sqrt(m) + 8.0) for m in mean]
    if len(at_least) != len(needed):
        return tuple(needed)
    return tuple(max(pair) for pair in zip(needed, at_least, strict=True))


def _with_bank(radar: Radar, size: int) -> Radar:
    return dataclasses.replace(radar, miss_bank=build_bank(radar, size), bank_inputs=bank_inputs(radar))


def slot_miss_ratio(word: Words, mode: Int, radar: Radar) -> Float:
    """p_k(t) of one slot in mode `mode`, a scalar, from one random word.

    Drawn from the bank, or from a placement made afresh; both have the same distribution over slots.
    """
    if radar.placements == "fresh":
        return fresh_miss_ratio_of(jax.random.key(word), mode, radar)
    bank = radar.miss_bank
    return bank[mode, rng.index(word, bank.shape[-1])]


def slot_placement(word: Words, mode: int, radar: Radar) -> tuple[Int, Footprints]:
    """The placement whose miss ratio `slot_miss_ratio` gives for the same word; `mode` is static."""
    if radar.placements == "fresh":
        return fresh_placement(jax.random.key(word), mode, radar)
    return fresh_placement(bank_key(radar, mode, rng.index(word, radar.miss_bank.shape[-1])), mode, radar)


def mean_miss_ratio(radar: Radar) -> Float:
    """E[p_k] per mode, [K]: the mean of the bank that the slots draw from."""
    return radar.miss_bank.mean(axis=-1)


def check_radar(radar: Radar) -> None:
    """Raises ValueError naming the field, the value and what is allowed."""
    require_type("radar", radar, Radar)
    require("radar.bandwidth", radar.bandwidth, (None,), is_positive, "one frequency > 0 Hz per radar mode")
    modes = np.shape(radar.bandwidth)
    of_bandwidth = f"radar.bandwidth has {modes[0]}"
    require("radar.slope", radar.slope, modes, is_positive, f"one slope > 0 Hz/s per radar mode ({of_bandwidth})")
    field = "radar.max_intermediate_frequency"
    allowed = f"one frequency > 0 Hz per radar mode ({of_bandwidth})"
    require(field, radar.max_intermediate_frequency, modes, is_positive, allowed)
    require("radar.density", radar.density, (), is_positive, "a number of objects > 0 per 45 m x 45 m")
    share = "probabilities in [0, 1] that sum to 1, one per class of objects"
    require("radar.class_share", radar.class_share, (None,), is_distribution, share)
    classes = np.shape(radar.class_share)[0]
    require("radar.size_mean", radar.size_mean, (classes, 2), is_positive, "length and width > 0 m per class")
    require("radar.size_std", radar.size_std, (classes, 2), is_not_negative, "deviations >= 0 m per class")
    require_reading("radar.distance", radar.distance, DISTANCES)
    require_reading("radar.counting_rule", radar.counting_rule, COUNTING_RULES)
    require_reading("radar.count_model", radar.count_model, COUNT_MODELS)
    require("radar.bank_seed", radar.bank_seed, (), is_not_negative, "an integer >= 0", kinds="iu")
    if radar.placements not in PLACEMENTS:
        refuse("radar.placements", radar.placements, ", ".join(map(repr, PLACEMENTS)))
    require(
        "radar.miss_bank", radar.miss_bank, (*modes, None), is_probability, "ratios in [0, 1], as `replace` draws them"
    )
    _check_count(radar)


def check_bank(radar: Radar) -> None:
    """Refuses a bank built for other parameters, as `dataclasses.replace` or a tree operation leaves it behind."""
    if is_traced(*jax.tree.leaves(radar)):
        return
    wanted = np.concatenate([np.ravel(np.asarray(getattr(radar, name), np.float32)) for name in BANK_FIELDS])
    if not np.array_equal(wanted, np.asarray(radar.bank_inputs)):
        refuse("radar.miss_bank", "built for other parameters", "the bank that `radar.replace(...)` builds")


def _check_count(radar: Radar) -> None:
    capacities = radar.max_objects
    allowed = f"a tuple of {radar.num_modes} integers >= 1"
    if not isinstance(capacities, tuple) or len(capacities) != radar.num_modes:
        refuse("radar.max_objects", str(capacities), allowed)
    if not all(type(capacity) is int and capacity >= 1 for capacity in capacities):
        refuse("radar.max_objects", str(capacities), allowed)
    if is_traced(radar.density, radar.slope, radar.max_intermediate_frequency):
        return
    counts = _concrete_counts(radar)
    if not (np.round(counts) >= 1).all():
        refuse("radar.density", float(radar.density), f"at least one object in every mode, not {counts.tolist()}")
    if (counts > capacities).any():
        refuse("radar.max_objects", list(capacities), f"at least {np.ceil(counts).tolist()} at this density")
