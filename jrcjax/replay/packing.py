"""Transitions as rows of 32-bit words: ids packed into as few words as they fit, then one word for each number.

One look-up per sample then touches one cache line, and replay takes a few bytes per transition.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.types import Float, Words

NUMBER = "number"
"""A field of float32 numbers, a word each."""
SWITCH = "switch"
"""A field of numbers that are 0 or a constant, a bit each. The constant is known to whoever unpacks."""


class Place(NamedTuple):
    """Where one field lies in a row."""

    kind: int | str
    """How many different ids the field has, or NUMBER, or SWITCH."""
    word: int
    shift: int
    """Bits to its right in the word."""

    @property
    def bits(self) -> int:
        """Bits that the field takes; a number takes a whole word."""
        ids = 2 if self.kind == SWITCH else self.kind
        return max((ids - 1).bit_length(), 1) if isinstance(ids, int) else 32


class Layout(NamedTuple):
    """Where the fields of a NamedTuple lie in a row."""

    kind: Any
    """The NamedTuple."""
    places: tuple[Place, ...]
    """The place of each field in order."""
    words: int
    """Length of a row."""


def layout_of(kind: Any, fields: tuple[int | str, ...]) -> Layout:
    """The layout of the NamedTuple `kind`, given how many ids each of its fields has, or NUMBER, or SWITCH."""
    places: list[Place] = []
    word = shift = 0
    for field in fields:
        place = Place(field, word, shift)
        if field != NUMBER and shift + place.bits > 32:
            word, shift = word + 1, 0
            place = Place(field, word, shift)
        places.append(place)
        shift += 0 if field == NUMBER else place.bits
    behind = iter(range(word + 1, word + 1 + len(fields)))
    places = [Place(NUMBER, next(behind), 0) if place.kind == NUMBER else place for place in places]
    return Layout(kind, tuple(places), word + 1 + fields.count(NUMBER))


def pack(value: Any, layout: Layout) -> Words:
    """A NamedTuple of arrays [...] as rows [..., words]."""
    row = [jnp.uint32(0)] * layout.words
    for field, place in zip(value, layout.places, strict=True):
        if place.kind == NUMBER:
            row[place.word] = jax.lax.bitcast_convert_type(jnp.asarray(field, jnp.float32), jnp.uint32)
        else:
            ids = jnp.asarray(field) != 0 if place.kind == SWITCH else jnp.asarray(field)
            row[place.word] = row[place.word] | (ids.astype(jnp.uint32) << place.shift)
    return jnp.stack(row, axis=-1)


def unpack(rows: Words, layout: Layout, constant: Float | float = 1.0) -> Any:
    """Rows [..., words] as a NamedTuple of arrays [...]; switches that are on hold `constant`, a scalar."""

    def field(place: Place):
        word = rows[..., place.word]
        if place.kind == NUMBER:
            return jax.lax.bitcast_convert_type(word, jnp.float32)
        ids = ((word >> place.shift) & jnp.uint32(2**place.bits - 1)).astype(jnp.int32)
        return jnp.where(ids == 1, jnp.asarray(constant, jnp.float32), 0.0) if place.kind == SWITCH else ids

    return layout.kind(*(field(place) for place in layout.places))
