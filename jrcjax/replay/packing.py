"""Transitions as rows of 32-bit words: ids packed into as few words as they fit, then one word for each number.

One look-up per sample then touches one cache line, and replay takes a few bytes per transition.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.types import Words


class Layout(NamedTuple):
    """Where the fields of a NamedTuple lie in a row."""

    kind: Any
    """The NamedTuple."""
    fields: tuple[tuple[int, int, int], ...]
    """(word, shift, bits) of each field in order; a number has 0 bits."""
    words: int
    """Length of a row."""


def layout(kind: Any, sizes: tuple[int | None, ...]) -> Layout:
    """Layout of `kind` with so many different ids per field, or None for a field that holds float32 numbers."""
    fields: list[tuple[int, int, int]] = []
    word = shift = 0
    for size in sizes:
        width = 0 if size is None else max((size - 1).bit_length(), 1)
        if shift + width > 32:
            word, shift = word + 1, 0
        fields.append((word, shift, width))
        shift += width
    numbers = iter(range(word + 1, word + 1 + len(sizes)))
    fields = [place if place[2] else (next(numbers), 0, 0) for place in fields]
    return Layout(kind, tuple(fields), word + 1 + sizes.count(None))


def pack(value: Any, where: Layout) -> Words:
    """A NamedTuple of arrays [...] as rows [..., words]."""
    row = [jnp.uint32(0)] * where.words
    for field, (word, shift, bits) in zip(value, where.fields, strict=True):
        if bits:
            row[word] = row[word] | (jnp.asarray(field).astype(jnp.uint32) << shift)
        else:
            row[word] = jax.lax.bitcast_convert_type(jnp.asarray(field, jnp.float32), jnp.uint32)
    return jnp.stack(row, axis=-1)


def unpack(rows: Words, where: Layout) -> Any:
    """Rows [..., words] as a NamedTuple of arrays [...]."""

    def field(word: int, shift: int, bits: int):
        if not bits:
            return jax.lax.bitcast_convert_type(rows[..., word], jnp.float32)
        return ((rows[..., word] >> shift) & jnp.uint32(2**bits - 1)).astype(jnp.int32)

    return where.kind(*(field(*place) for place in where.fields))
