"""Policies as probabilities of actions, [S, A]."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def greedy_policy(q: Float[Array, "*batch S A"]) -> Float[Array, "*batch S A"]:
    """Probabilities [..., S, A] of the policy that takes the largest value, the first of equals."""
    return jax.nn.one_hot(jnp.argmax(q, axis=-1), q.shape[-1], dtype=q.dtype)
