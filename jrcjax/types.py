"""Array aliases used in signatures.

Shapes are given in docstrings with these letters: S states, A actions, L data
rates, K radar modes, F factors, J levels of one factor, B a batch or a bank, N objects.
"""

from __future__ import annotations

from typing import TypeAlias

import jax

Key: TypeAlias = jax.Array
"""A typed PRNG key, as `jax.random.key` makes it."""
Float: TypeAlias = jax.Array
"""A float32 array."""
Int: TypeAlias = jax.Array
"""An int32 array."""
Bool: TypeAlias = jax.Array
"""A boolean array."""
Words: TypeAlias = jax.Array
"""A uint32 array of random bits."""


def choice(field: str, name: str, allowed: tuple[str, ...]) -> int:
    """Number of `name` among the names that are allowed.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    if not isinstance(name, str) or name not in allowed:
        raise ValueError(f"{field}: {name!r:.200} is unknown; allowed: {', '.join(map(repr, allowed))}")
    return allowed.index(name)
