"""Schedules: functions of the slot or update number."""

from __future__ import annotations

import jax.numpy as jnp

from jrcjax.learners.hparams import HParams
from jrcjax.types import Float, Int


def linear(start: Float, end: Float, step: Int, steps: Float | int) -> Float:
    """From `start` at step 0 to `end` at step `steps`, then constant."""
    return start + jnp.minimum(jnp.asarray(step, jnp.float32) / steps, 1.0) * (end - start)


def epsilon(slot: Int, hparams: HParams) -> Float:
    """Probability of a random action in slot `slot` (from 0)."""
    return linear(hparams.epsilon_start, hparams.epsilon_end, slot, hparams.epsilon_slots)


def importance_exponent(update: Int, updates: int, hparams: HParams) -> Float:
    """The beta of equation (24) in update number `update` (from 0) of `updates`, pre-training and training together."""
    return linear(hparams.importance_start, hparams.importance_end, update, updates)
