"""When a learner's values have diverged: they are not finite, or far beyond what any sequence of rewards adds up to."""

from __future__ import annotations

import jax.numpy as jnp

from jrcjax.exact import largest_reward
from jrcjax.model.params import EnvParams
from jrcjax.types import Bool, Float

FACTOR = 10.0
"""How far beyond any discounted return a value must be to count as diverged."""


def value_limit(params: EnvParams, discount: Float) -> Float:
    """FACTOR max|rho| / (1 - gamma), at least FACTOR, since values start near 1; a scalar."""
    return FACTOR * jnp.maximum(largest_reward(params) / (1.0 - discount), 1.0)


def has_diverged(q: Float, params: EnvParams, discount: Float) -> Bool:
    """Whether any value of q [S, A] is not finite or beyond `value_limit`, a scalar."""
    return ~(jnp.abs(q) <= value_limit(params, discount)).all()  # NaN compares as false
