"""The multi-mode radar and the traffic around it, and the miss-detection ratio of one new placement, equation (5)."""

from __future__ import annotations

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jrcjax.checks import is_traced, refuse
from jrcjax.containers import (
    DISTRIBUTION,
    NOT_NEGATIVE,
    POSITIVE,
    Allowed,
    Container,
    number,
    reading,
    setting,
)
from jrcjax.radar import chirp, detection
from jrcjax.radar.placement import Footprints, ObjectClasses, object_count, place_objects
from jrcjax.readings import CountingRule, CountModel, Distance
from jrcjax.types import Key

REFERENCE_SIDE = 45.0
"""Side in m of the square in which the density omega counts objects."""


MOST_OBJECTS = 100_000
"""Mean number of objects in a mode's square, at most: some GB while a bank is built."""
_MOST_SLOTS = 2 * MOST_OBJECTS
_BANDWIDTHS = Allowed(lambda x: (x >= 1e3) & (x <= 1e15), "from 1e3 to 1e15")  # range cells of 150 km to 0.15 um


def _check_max_objects(field: str, value: object) -> None:
    if value is None:
        return
    if not isinstance(value, tuple) or not all(type(slots) is int and 1 <= slots <= _MOST_SLOTS for slots in value):
        refuse(field, str(value), f"a tuple of integers from 1 to {_MOST_SLOTS}, one per radar mode")


class Modes(Container):
    """K radar modes and the objects around the vehicle: all that the miss ratio of a placement depends on."""

    bandwidth: Float[Array, " K"] = number(_BANDWIDTHS, "Hz")
    """Sweep bandwidth b of each mode."""
    slope: Float[Array, " K"] = number(POSITIVE, "Hz/s")
    """Chirp slope f_c of each mode."""
    max_intermediate_frequency: Float[Array, " K"] = number(POSITIVE, "Hz")
    """F_max of each mode."""
    density: Float[Array, ""] = number(POSITIVE, "objects per 45 m x 45 m")
    """omega, the mean number of objects."""
    class_share: Float[Array, " C"] = number(DISTRIBUTION)
    """Share of each class of objects."""
    size_mean: Float[Array, "C 2"] = number(POSITIVE, "m")
    """Mean length and width of each class of objects."""
    size_std: Float[Array, "C 2"] = number(NOT_NEGATIVE, "m")
    """Standard deviation of length and width of each class of objects."""
    distance: Int[Array, ""] = reading(Distance)
    """Deviation A5: which distance between two objects counts."""
    counting_rule: Int[Array, ""] = reading(CountingRule)
    """Deviation A5: which objects count as detected."""
    count_model: Int[Array, ""] = reading(CountModel)
    """Deviation A6: how many objects a placement has."""
    max_objects: tuple[int, ...] = setting(_check_max_objects, default=None)
    """Slots for objects in each mode, at least: there are more where a density that is known needs them. If a density
    is traced and needs more, miss ratios are NaN, never silently smaller."""

    def __post_init__(self) -> None:
        """Checks the fields, since a bank is made from them at once, and makes room for the objects."""
        super().__post_init__()
        self.check("radar")
        object.__setattr__(self, "max_objects", room_for(self))

    @property
    def num_modes(self) -> int:
        """K."""
        return self.bandwidth.shape[-1]

    @property
    def classes(self) -> ObjectClasses:
        """Shares and sizes of the classes of objects."""
        return ObjectClasses(self.class_share, self.size_mean, self.size_std)

    @property
    def reach(self) -> Float[Array, " K"]:
        """Maximum range of each mode in m, equation (2)."""
        return chirp.maximum_range(self.slope, self.max_intermediate_frequency)

    @property
    def resolution(self) -> Float[Array, " K"]:
        """Range resolution of each mode in m, equation (2)."""
        return chirp.range_resolution(self.bandwidth)

    def check(self, name: str = "radar") -> None:
        """Refuses what is not allowed; see `Container.check`."""
        super().check(name)
        if self.max_objects is not None and len(self.max_objects) != self.num_modes:
            refuse(f"{name}.max_objects", str(self.max_objects), f"{self.num_modes} integers, one per radar mode")
        if not is_traced(self.density, self.slope, self.max_intermediate_frequency):
            counts = known_mean_count(self)
            if not (np.round(counts) >= 1).all():
                allowed = f"at least one object in every mode, not {counts.tolist()}"
                refuse(f"{name}.density", float(self.density), allowed)


def mean_count(modes: Modes) -> Float[Array, " K"]:
    """Mean number of objects in the square of each mode: omega (R_max / 45 m)^2."""
    return modes.density * (modes.reach / REFERENCE_SIDE) ** 2


def known_mean_count(modes: Modes) -> np.ndarray:
    """`mean_count` of modes whose numbers are known, [K], without compiling anything."""
    reach = chirp.maximum_range(np.asarray(modes.slope), np.asarray(modes.max_intermediate_frequency))
    return np.asarray(np.asarray(modes.density) * (reach / REFERENCE_SIDE) ** 2, np.float64)


def room_for(modes: Modes, scale: float = 1.0) -> tuple[int, ...]:
    """Slots for any fixed count, and for a Poisson count but for a chance below 1e-12, at `scale` times the density.

    At least `modes.max_objects`, and these alone where the density is traced.

    Raises:
      ValueError: where it is traced and there are none.
    """
    at_least = modes.max_objects
    if is_traced(modes.density, modes.slope, modes.max_intermediate_frequency):
        if at_least is None:
            refuse("radar.max_objects", "None", "a tuple of integers where the density has no value yet")
        return at_least
    mean = known_mean_count(modes) * scale
    if not (mean <= MOST_OBJECTS).all():
        field, density = ("radar.max_density", scale) if scale > 1.0 else ("radar.density", 1.0)
        allowed = f"at most {MOST_OBJECTS} objects in a mode's square, not {mean.tolist()}"
        refuse(field, density * float(modes.density), allowed)
    needed = [math.ceil(m + 8.0 * math.sqrt(m) + 8.0) for m in mean]
    return tuple(max(pair) for pair in zip(needed, at_least or needed, strict=True))


def fresh_placement(key: Key, mode: int, modes: Modes) -> tuple[Int[Array, ""], Footprints]:
    """A new placement in mode `mode` (static): number of objects, and footprints of as many as there are slots for."""
    count_key, place_key = jax.random.split(key)
    count = object_count(count_key, mean_count(modes)[mode], modes.count_model)
    return count, place_objects(place_key, count, modes.reach[mode], modes.classes, modes.max_objects[mode])


def fresh_miss_ratio(key: Key, mode: int, modes: Modes) -> Float[Array, ""]:
    """p_k of one new placement in mode `mode` (static), equation (5)."""
    count, footprints = fresh_placement(key, mode, modes)
    detected = detection.detected_objects(footprints, modes.resolution[mode], modes.distance, modes.counting_rule)
    return jnp.where(count <= modes.max_objects[mode], detection.miss_ratio(count, detected), jnp.nan)


def fresh_miss_ratio_of(key: Key, mode: Int[Array, ""], modes: Modes) -> Float[Array, ""]:
    """`fresh_miss_ratio` for a mode that is an array; a mode's number of slots is static, so each has its branch."""
    branches = [functools.partial(fresh_miss_ratio, mode=m, modes=modes) for m in range(modes.num_modes)]
    return jnp.where((mode >= 0) & (mode < modes.num_modes), jax.lax.switch(mode, branches, key), jnp.nan)
