"""Fig. 7: the probability of favourable conditions, of all five factors together."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp

from jrcjax.model.params import FACTORS, EnvParams
from sweeps.engine.sources import SOURCE
from sweeps.preset import environment_of
from sweeps.sweep import Sweep


def params_at(tau: float, preset: str) -> EnvParams:
    """The target environment with tau_0 = tau for every factor, the channel included."""
    params = environment_of("target", preset)
    prior = jnp.asarray([tau, 1.0 - tau], jnp.float32)
    factors = {name: dataclasses.replace(getattr(params, name), prior=prior) for name in FACTORS}
    return dataclasses.replace(params, **factors)


FIG7 = Sweep(
    name="fig7",
    description="reward, throughput and miss detection against tau_0 of all factors: TLwD, DPR, DDQN",
    learners=("tlwd", "dpr", "ddqn"),
    x_name="favourable_probability",
    x_values=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    params_at=params_at,
    source=SOURCE,
)
