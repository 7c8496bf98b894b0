"""Fig. 9: prioritised against uniform replay."""

from __future__ import annotations

import jax.numpy as jnp

from jrcjax.learners.hparams import HParams
from sweeps.engine.sources import SOURCE
from sweeps.preset import environment_of
from sweeps.sweep import Sweep


def hparams_at(prioritised: float) -> HParams:
    """(alpha, beta) = (0.4, 0.6 to 1) for 1, and (0, 0), which samples uniformly, for 0."""
    if prioritised:
        return HParams()
    zero = jnp.float32(0.0)
    return HParams(priority_exponent=zero, importance_start=zero, importance_end=zero)


FIG9 = Sweep(
    name="fig9",
    description="learning curves of TLwD in the target environment, prioritised replay against uniform",
    learners=("tlwd",),
    x_name="prioritised",
    x_values=(1.0, 0.0),
    params_at=lambda x, preset: environment_of("target", preset),
    hparams_at=hparams_at,
    source=SOURCE,
)
