"""What learners are held against at each point: exact figures of the optimum, and of what ignores the state."""

from __future__ import annotations

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
    slots = points.params.max_steps_in_episode

    def at(point: Points) -> Reference:
        params, hparams = point
        best = exact.optimal_policy(params)

        def explored(episode):
            random = epsilon(episode * slots + jnp.arange(slots), hparams, slots).mean()
            return exact.evaluate_policy(params, (1 - random) * best + random / params.num_actions)

        optimum, constant = (exact.evaluate_policy(params, p) for p in (best, exact.best_constant_action(params)))
        return Reference(optimum, constant, jax.vmap(explored)(jnp.arange(episodes)))

    # Some points at a time, in programs of one shape: the policies of many points and episodes would fill the memory.
    number, of_points = points.hparams.discount.shape[0], jax.jit(jax.vmap(at))
    size = min(number, _AT_ONCE)
    parts = []
    for first in range(0, number, size):
        rows = np.minimum(np.arange(first, first + size), number - 1)
        parts.append(jax.tree.map(np.asarray, of_points(jax.tree.map(lambda leaf, rows=rows: leaf[rows], points))))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:number], *parts)
