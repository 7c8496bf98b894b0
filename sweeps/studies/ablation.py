"""TLwD in the target with one part of its loss, or of its start, changed at a time; no figure of the paper."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp

from jrcjax.learners.hparams import HParams
from sweeps.engine.sources import SOURCE
from sweeps.preset import environment_of
from sweeps.sweep import Sweep

VARIANTS: dict[str, dict[str, float]] = {
    "as in the paper": {},
    "no large margin (lambda_2 = 0)": {"margin_weight": 0.0},
    "margin 0.8": {"margin": 0.8},
    "no n-step loss (lambda_1 = 0)": {"n_step_weight": 0.0},
    "neither": {"margin_weight": 0.0, "n_step_weight": 0.0},
    "source agent's initial weights": {"initial_weights": 1},
}
"""What is changed at each point, in order."""


def hparams_at(number: float) -> HParams:
    """The hyperparameters of variant `number`."""
    changes = list(VARIANTS.values())[int(number)]
    default = HParams()
    return dataclasses.replace(
        default, **{name: jnp.asarray(value, getattr(default, name).dtype) for name, value in changes.items()}
    )


ABLATION = Sweep(
    name="ablation",
    description="TLwD in the target with parts of its loss left out",
    learners=("tlwd",),
    x_name="variant",
    x_values=tuple(float(number) for number in range(len(VARIANTS))),
    params_at=lambda x, preset: environment_of("target", preset),
    hparams_at=hparams_at,
    source=SOURCE,
)
