"""What learners are held against at each point: exact figures of the optimum, and of what ignores the state."""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax import exact
from jrcjax.config.paths import Points
from jrcjax.learners.schedules import epsilon

_AT_ONCE = 9  # points of Figs. 6 to 8


class Reference(NamedTuple):
    """Exact long-run figures at each point."""

    optimum: exact.LongRun
    """[points]."""
    constant: exact.LongRun
    """Of the best policy that ignores the state, [points]."""
    explored: exact.LongRun
    """Of the optimal policy with the learners' random actions, [points, episodes]: the most that a learner can earn."""


def reference_of(points: Points, episodes: int) -> Reference:
    """What learners are held against at each point."""
    # Some points at a time, in one program for all jobs: the policies of many points would fill the memory.
    number, parts = points.hparams.discount.shape[0], []
    for first in range(0, number, _AT_ONCE):
        rows = np.minimum(np.arange(first, first + _AT_ONCE), number - 1)
        some = jax.tree.map(lambda leaf, rows=rows: np.asarray(leaf)[rows], points)
        parts.append(jax.tree.map(np.asarray, _of_points(some, episodes)))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:number], *parts)


@functools.partial(jax.jit, static_argnums=1)
def _of_points(points: Points, episodes: int) -> Reference:
    return jax.vmap(lambda point: _of_point(point, episodes))(points)


def _of_point(point: Points, episodes: int) -> Reference:
    params, hparams = point
    best, slots = exact.optimal_policy(params), params.max_steps_in_episode

    def explored(episode):
        random = epsilon(episode * slots + jnp.arange(slots), hparams, slots).mean()
        return exact.evaluate_policy(params, (1 - random) * best + random / params.num_actions)

    optimum, constant = (exact.evaluate_policy(params, p) for p in (best, exact.best_constant_action(params)))
    return Reference(optimum, constant, jax.vmap(explored)(jnp.arange(episodes)))
