"""A radar with its bank: the miss ratios of many independent placements per mode, so that a slot costs one look-up.

The bank follows from the radar's other fields, and a `Radar` builds it whenever one is made, so it always fits. Under
`jit` and `vmap` it is built inside the same program.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jrcjax import rng
from jrcjax.checks import is_positive, is_traced, refuse, require
from jrcjax.containers import NOT_NEGATIVE, PROBABILITY, count, derived, integer, option
from jrcjax.kept import kept
from jrcjax.keys import key_of
from jrcjax.radar.modes import Modes, fresh_miss_ratio, fresh_miss_ratio_of, fresh_placement, room_for
from jrcjax.radar.placement import Footprints
from jrcjax.radar.stored import stored
from jrcjax.types import Key, Words

PLACEMENTS = ("bank", "fresh")
_CHUNK = 16  # placements handled at once while a bank is built: their boxes stay in a core's cache
_ACCELERATOR_CHUNK = 256
_MOST_PLACED = 2**28  # objects in all placements of a bank: about a minute of work
_KNOWN_BANKS = 256  # a bank of two modes takes 32 kB


class Radar(Modes):
    """K radar modes, the objects around the vehicle, and the bank of placements that slots draw from."""

    placements: str = option(PLACEMENTS)
    """Deviation A7: a slot draws from the bank, or places its objects afresh."""
    bank_size: int = count(default=4096)
    """B, the number of placements per mode in the bank."""
    bank_seed: Int[Array, ""] = integer(NOT_NEGATIVE, default=0)
    """Seed of the bank's placements."""
    miss_bank: Float[Array, "K B"] = derived(PROBABILITY)
    """Miss ratios of the bank's placements, which the other fields decide."""

    def __post_init__(self) -> None:
        """Builds the bank."""
        super().__post_init__()
        object.__setattr__(self, "miss_bank", bank_of(self.modes, self.bank_seed, self.bank_size))

    @property
    def modes(self) -> Modes:
        """The radar without its bank."""
        return Modes(**{field.name: getattr(self, field.name) for field in dataclasses.fields(Modes)})


def make_radar(*, max_density: float | None = None, **fields: Any) -> Radar:
    """A `Radar` from its fields, with room for a larger density.

    Args:
      max_density: the largest density that `replace` may set under `vmap`; the density itself if None.
      fields: of `Radar`; those that have a default may be left out.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    if max_density is not None:
        require("radar.max_density", max_density, (), is_positive, "a number > 0")
        if fields.get("max_objects") is not None:
            refuse("radar.max_density", max_density, "either max_density or max_objects, not both")
        names = {field.name for field in dataclasses.fields(Modes)}
        modes = Modes(**{name: value for name, value in fields.items() if name in names})
        scale = max(float(np.float32(max_density) / np.asarray(modes.density)), 1.0)
        fields["max_objects"] = room_for(modes, scale)
    return Radar(**fields)


def bank_key(seed: Int[Array, ""], mode: int | Int[Array, ""], i: Int[Array, ""]) -> Key:
    """The key of placement number `i` of a mode in the bank with this seed."""
    return jax.random.fold_in(jax.random.fold_in(key_of(seed), mode), i)


def bank_of(modes: Modes, seed: Int[Array, ""], size: int) -> Float[Array, "K B"]:
    """Miss ratios of `size` independent placements per mode; if all numbers are known, stored, kept or drawn once."""
    if size * sum(modes.max_objects) > _MOST_PLACED:
        allowed = f"at most {_MOST_PLACED // sum(modes.max_objects)} placements of {modes.max_objects} objects"
        refuse("radar.bank_size", size, allowed)
    if is_traced(*jax.tree.leaves((modes, seed))):
        return _build(modes, seed, size)
    return _known_bank(_Described(content_of(modes, seed, size), modes, seed, size))


def content_of(modes: Modes, seed: Int[Array, ""], size: int) -> tuple[Any, ...]:
    """All that a bank is made from, as bytes, shapes and integers; the numbers must be known."""
    leaves = jax.tree.leaves((modes, seed))
    return tuple((np.asarray(leaf).tobytes(), leaf.shape) for leaf in leaves), modes.max_objects, size


@dataclasses.dataclass(frozen=True)
class _Described:
    """What a bank is made from; equal if the bank is."""

    content: tuple[Any, ...]
    modes: Modes = dataclasses.field(compare=False)
    seed: Array = dataclasses.field(compare=False)
    size: int = dataclasses.field(compare=False)


@functools.lru_cache(_KNOWN_BANKS)
def _known_bank(described: _Described) -> Array:
    with jax.ensure_compile_time_eval():  # kept banks are numbers, also if a trace asks first
        found = stored(described.content)
        if found is None:
            made_from = described.modes, described.seed, described.size
            found = kept("banks", described.content, lambda: draw(*made_from))
        return jnp.asarray(found)


def draw(modes: Modes, seed: Int[Array, ""], size: int) -> Float[Array, "K B"]:
    """`bank_of` known numbers, drawn now, wherever it may already lie; also while something is traced."""
    leaves, structure = jax.tree.flatten((modes, seed))
    shapes = tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves)
    return _compiled(structure, shapes, size)(modes, seed)


@functools.cache
def _compiled(structure: Any, shapes: tuple[jax.ShapeDtypeStruct, ...], size: int) -> Callable[[Modes, Array], Array]:
    """`_build` ready to run, also while something is traced."""
    return _build.lower(*jax.tree.unflatten(structure, shapes), size).compile()


@jax.jit(static_argnums=2)
def _build(modes: Modes, seed: Array, size: int) -> Array:
    chunk = min(size, _CHUNK if jax.default_backend() == "cpu" else _ACCELERATOR_CHUNK)

    def of_mode(mode: int) -> Array:
        keys = jax.vmap(lambda i: bank_key(seed, mode, i))(jnp.arange(size))
        return jax.lax.map(lambda key: fresh_miss_ratio(key, mode, modes), keys, batch_size=chunk)

    return jnp.stack([of_mode(mode) for mode in range(modes.num_modes)])


def slot_miss_ratio(word: Words, mode: Int[Array, ""], radar: Radar) -> Float[Array, ""]:
    """p_k(t) of one slot in mode `mode`, from one random word.

    Drawn from the bank, or from a placement made afresh; both have the same distribution over slots.
    """
    if radar.placements == "fresh":
        return fresh_miss_ratio_of(key_of(word), mode, radar)
    bank = radar.miss_bank
    return bank[mode, rng.index(word, bank.shape[-1])]


def slot_placement(word: Words, mode: int, radar: Radar) -> tuple[Int[Array, ""], Footprints]:
    """The placement whose miss ratio `slot_miss_ratio` gives for the same word; `mode` is static."""
    if radar.placements == "fresh":
        return fresh_placement(key_of(word), mode, radar)
    number = rng.index(word, radar.miss_bank.shape[-1])
    return fresh_placement(bank_key(radar.bank_seed, mode, number), mode, radar)


def mean_miss_ratio(radar: Radar) -> Float[Array, " K"]:
    """E[p_k] per mode: the mean of the bank that the slots draw from."""
    return radar.miss_bank.mean(axis=-1)
