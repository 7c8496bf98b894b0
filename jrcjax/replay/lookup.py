"""Reads and writes of a table at many places at once, for all samples of a mini-batch.

A place is the number of a word, counted through all rows one after the other: pairs of row and column XLA on a CPU
would write to memory first, which takes longer.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jrcjax.types import Int


def read(table: jax.Array, places: Int, number: int) -> jax.Array:
    """So many words of a table [N, M] from each of these places [B] on, which have to be there; [B, number]."""
    dimensions = jax.lax.GatherDimensionNumbers(offset_dims=(1,), collapsed_slice_dims=(), start_index_map=(0,))
    return jax.lax.gather(table.reshape(-1), places[:, None], dimensions, (number,), mode="promise_in_bounds")


def write(table: jax.Array, places: Int, words: jax.Array) -> jax.Array:
    """The table [N, M] with these words [B] at these places [B], which have to be there."""
    return _write(table.reshape(-1), places, words).reshape(table.shape)


def _write_in(flat: jax.Array, places: Int, words: jax.Array) -> jax.Array:
    return flat.at[places].set(words, mode="promise_in_bounds")


_write = jax.custom_batching.custom_vmap(_write_in)


@_write.def_vmap
def _write_of_all(agents: int, is_batched: list[bool], *args: jax.Array) -> tuple[jax.Array, bool]:
    """The same for many agents: in one table, whose places are single numbers again, unless they are too large."""
    flat, places, words = (
        x if own else jnp.broadcast_to(x, (agents, *x.shape)) for x, own in zip(args, is_batched, strict=True)
    )
    if flat.size > jnp.iinfo(places.dtype).max:
        return jax.vmap(_write_in)(flat, places, words), True
    begin = jnp.arange(agents, dtype=places.dtype)[:, None] * flat.shape[1]
    written = _write(flat.reshape(-1), (begin + places).reshape(-1), words.reshape(-1))
    return written.reshape(flat.shape), True
