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


class Power(NamedTuple):
    """A field of numbers that are 0 or a power of a constant, of which the exponent is kept.

    The constant is known to whoever packs and unpacks.
    """

    most: int
    """The largest exponent."""

    @property
    def ids(self) -> int:
        """How many numbers it can be: 0 is the last."""
        return self.most + 2


class Place(NamedTuple):
    """Where one field lies in a row."""

    kind: int | str | Power
    """How many different ids the field has, or NUMBER, SWITCH, or Power."""
    word: int
    shift: int
    """Bits to its right in the word."""

    @property
    def bits(self) -> int:
        """Bits that the field takes; a number takes a whole word."""
        ids = 2 if self.kind == SWITCH else self.kind.ids if isinstance(self.kind, Power) else self.kind
        return max((ids - 1).bit_length(), 1) if isinstance(ids, int) else 32


class Layout(NamedTuple):
    """Where the fields of a NamedTuple lie in a row."""

    kind: Any
    """The NamedTuple."""
    places: tuple[Place, ...]
    """The place of each field in order."""
    words: int
    """Length of a row."""


def layout_of(kind: Any, fields: tuple[int | str | Power, ...]) -> Layout:
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


def pack(value: Any, layout: Layout, constant: Float | float = 1.0) -> Words:
    """A NamedTuple of arrays [...] as rows [..., words]."""
    row = [jnp.uint32(0)] * layout.words
    for field, place in zip(value, layout.places, strict=True):
        if place.kind == NUMBER:
            row[place.word] = jax.lax.bitcast_convert_type(jnp.asarray(field, jnp.float32), jnp.uint32)
        else:
            ids = jnp.asarray(field)
            if place.kind == SWITCH:
                ids = ids != 0
            elif isinstance(place.kind, Power):
                ids = _exponent(ids, constant, place.kind)
            row[place.word] = row[place.word] | (ids.astype(jnp.uint32) << place.shift)
    return jnp.stack(row, axis=-1)


def unpack(rows: Words, layout: Layout, constant: Float | float = 1.0) -> Any:
    """Rows [..., words] as a NamedTuple of arrays [...]; switches that are on hold `constant`, a scalar."""

    def field(place: Place):
        word = rows[..., place.word]
        if place.kind == NUMBER:
            return jax.lax.bitcast_convert_type(word, jnp.float32)
        ids = ((word >> place.shift) & jnp.uint32(2**place.bits - 1)).astype(jnp.int32)
        if isinstance(place.kind, Power):
            return _power(ids, constant, place.kind)
        return jnp.where(ids == 1, jnp.asarray(constant, jnp.float32), 0.0) if place.kind == SWITCH else ids

    return layout.kind(*(field(place) for place in layout.places))


def _powers(constant: Float | float, kind: Power) -> list[Float]:
    """The powers of a constant, each the last one times the constant, as returns multiply their discounts."""
    powers = [jnp.float32(1.0)]
    for _ in range(kind.most):
        powers.append(powers[-1] * constant)
    return powers


def _exponent(numbers: Float, constant: Float | float, kind: Power) -> Words:
    smaller = sum((numbers < power).astype(jnp.uint32) for power in _powers(constant, kind))
    return jnp.where(numbers == 0, jnp.uint32(kind.most + 1), smaller)


def _power(exponents: Words, constant: Float | float, kind: Power) -> Float:
    found = jnp.zeros(exponents.shape, jnp.float32)
    for exponent, power in enumerate(_powers(constant, kind)):
        found = jnp.where(exponents == exponent, power, found)
    return found
