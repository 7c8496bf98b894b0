"""Schedules: functions of the slot number."""

from __future__ import annotations

import jax.numpy as jnp

from jrcjax.hparams import HParams
from jrcjax.types import Float, Int


def epsilon(slot: Int, hparams: HParams) -> Float:
    """Probability of a random action in slot `slot` (from 0): linear, then constant."""
    progress = jnp.minimum(jnp.asarray(slot, jnp.float32) / hparams.epsilon_slots, 1.0)
    return hparams.epsilon_start + progress * (hparams.epsilon_end - hparams.epsilon_start)
