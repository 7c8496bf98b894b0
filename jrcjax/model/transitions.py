"""How the factors evolve: the paper's equation (10).

A factor keeps its level with probability kappa (`persistence`) and is drawn from its prior otherwise, so the
prior is its stationary law for every kappa; with kappa = 0 slots are independent. Actions have no influence.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jrcjax.model.channel import Channel
from jrcjax.model.params import EnvParams, Factor


def draw_level(u: Float[Array, ""], prior: Float[Array, " J"]) -> Int[Array, ""]:
    """Level drawn from `prior` [J] by inverting its distribution at u in [0, 1); a scalar."""
    # The last level takes the remainder, so that rounding in the sum can't lead past it.
    return (u >= jnp.cumsum(prior)[:-1]).sum().astype(jnp.int32)


def next_level(u: Float[Array, ""], level: Int[Array, ""], factor: Channel | Factor) -> Int[Array, ""]:
    """Level in the next slot, a scalar, from one uniform u in [0, 1).

    What is left of the 24 bits of u beyond kappa draws the new level: probabilities are off by up to
    2^-24 / (1 - kappa), 0.0006 for kappa = 0.9999, and with the largest kappa below 1 every new level is the first.
    """
    kappa = factor.persistence
    drawn = draw_level((u - kappa) / (1.0 - kappa), factor.prior)
    return jnp.where(u < kappa, level, drawn)


def initial_levels(u: Float[Array, " F"], params: EnvParams) -> Int[Array, " F"]:
    """Levels [F] at the start of an episode, from uniforms [F]."""
    return jnp.stack([draw_level(u[i], f.prior) for i, f in enumerate(params.factors)])


def next_levels(u: Float[Array, " F"], levels: Int[Array, " F"], params: EnvParams) -> Int[Array, " F"]:
    """Levels [F] of the next slot, from uniforms [F] and the current levels [F]."""
    return jnp.stack([next_level(u[i], levels[i], f) for i, f in enumerate(params.factors)])
