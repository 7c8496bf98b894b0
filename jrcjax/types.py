"""Array aliases used in signatures, and the named choices of the model.

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

# Each tuple names the readings of one decision that the paper leaves open; its index is what the
# parameters hold, so that a reading can be vmapped over. The first is the default.
EVENT_MODELS = ("conditional", "marginal", "noisy_or")
MISS_CONVENTIONS = ("all_slots", "event_slots", "radar_slots")
DISTANCES = ("footprint_gap", "centre_to_centre", "radial_range")
COUNTING_RULES = ("resolved", "clusters")
COUNT_MODELS = ("fixed", "poisson")
PLACEMENTS = ("bank", "fresh")
INITIAL_WEIGHTS = ("random", "source")
READINGS = {
    "event_model": EVENT_MODELS,
    "miss_convention": MISS_CONVENTIONS,
    "distance": DISTANCES,
    "counting_rule": COUNTING_RULES,
    "count_model": COUNT_MODELS,
    "initial_weights": INITIAL_WEIGHTS,
}
"""Field of the parameters to the names of its readings."""


def choice(field: str, name: str, allowed: tuple[str, ...]) -> int:
    """Index of the reading `name`.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    if not isinstance(name, str) or name not in allowed:
        raise ValueError(f"{field}: {name!r} is unknown; allowed: {', '.join(map(repr, allowed))}")
    return allowed.index(name)
