"""Schedules: functions of the number of the step or update, from 0."""

from __future__ import annotations

import jax.numpy as jnp

from jrcjax.learners.hparams import HParams
from jrcjax.readings import Exploration, ImportanceOver
from jrcjax.types import Float, Int

_TINY = 1e-30  # keeps logarithms finite where another reading is chosen


def _share(step: Int, steps: Float | Int | int) -> Float:
    """How much of `steps` has passed, at most 1."""
    return jnp.minimum(jnp.asarray(step, jnp.float32) / jnp.asarray(steps, jnp.float32), 1.0)


def linear(start: Float, end: Float, step: Int, steps: Float | Int | int) -> Float:
    """From `start` at step 0 to `end` at step `steps`, then constant."""
    return start + _share(step, steps) * (end - start)


def exponential(start: Float, end: Float, step: Int, steps: Float | Int | int) -> Float:
    """From `start` > 0 at step 0 to `end` > 0 at step `steps` by the same factor in each step, then constant."""
    return start * jnp.exp(_share(step, steps) * jnp.log(jnp.maximum(end, _TINY) / jnp.maximum(start, _TINY)))


def epsilon(step: Int, hparams: HParams, episode_steps: int) -> Float:
    """Probability of a random action in step `step`; it falls linearly, or by the same factor from episode to episode.

    Args:
      step: steps before this one.
      hparams: its fields `epsilon_start`, `epsilon_end`, `epsilon_slots` and `exploration`.
      episode_steps: steps of every episode.
    """
    start, end, steps = hparams.epsilon_start, hparams.epsilon_end, hparams.epsilon_slots
    by_episode = exponential(start, end, step - step % episode_steps, steps)
    by_step = linear(start, end, step, steps)
    return jnp.where(hparams.exploration == Exploration.EXPONENTIAL, by_episode, by_step)


def importance_exponent(update: Int, pretraining: int, training: int, hparams: HParams) -> Float:
    """The beta of equation (24) in update number `update` of pre-training and training together.

    It rises over both, or over training alone.

    Args:
      update: updates before this one.
      pretraining: updates of pre-training, T_pre.
      training: updates of training.
      hparams: its fields `importance_start`, `importance_end` and `importance_over`.
    """
    start, end = hparams.importance_start, hparams.importance_end
    over_training = linear(start, end, jnp.maximum(update - pretraining, 0), training)
    over_all = linear(start, end, update, pretraining + training)
    return jnp.where(hparams.importance_over == ImportanceOver.TRAINING, over_training, over_all)
