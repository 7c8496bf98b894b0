"""Unexpected events: the paper's equations (3) and (4) in three readings."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jrcjax.compiled import compiled
from jrcjax.model import states
from jrcjax.model.params import EnvParams, of_params


def conditional(at_level: Float[Array, " F"]) -> Float[Array, ""]:
    """Sum over factors of p at the current level [F], clipped to 1; a scalar."""
    return jnp.minimum(at_level.sum(), 1.0)


def marginal(prior_mean: Float[Array, " F"]) -> Float[Array, ""]:
    """Equation (4) as printed: sum over factors of sum_j tau_j p_j [F], clipped to 1; a scalar."""
    return jnp.minimum(prior_mean.sum(), 1.0)


def noisy_or(at_level: Float[Array, " F"]) -> Float[Array, ""]:
    """1 - product over factors of (1 - p) at the current level [F]; a scalar."""
    return 1.0 - jnp.prod(1.0 - at_level)


def event_probability_at(levels: Int[Array, " F"], params: EnvParams) -> Float[Array, ""]:
    """p_u in the state with levels [F], a scalar. The channel causes no events."""
    surroundings = params.surroundings
    at_level = jnp.stack([f.event_probability[level] for f, level in zip(surroundings, levels[1:], strict=True)])
    prior_mean = jnp.stack([jnp.sum(f.prior * f.event_probability) for f in surroundings])
    readings = jnp.stack([conditional(at_level), marginal(prior_mean), noisy_or(at_level)])
    return readings[params.event_model]


@of_params
@compiled
def event_probability(params: EnvParams) -> Float[Array, " S"]:
    """p_u in every state, [S]."""
    levels = states.levels_of(jnp.arange(params.num_states), params.shape)
    return jax.vmap(event_probability_at, in_axes=(0, None))(levels, params)
