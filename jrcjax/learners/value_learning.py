"""Temporal-difference targets and losses, one function an equation (the paper's section V).

Functions work on tables over all states, [S, A], or on rows of a batch, [B, A]; gathering by ids is the caller's.
"""

from __future__ import annotations

from typing import Any

import chex
import jax
import jax.numpy as jnp

from jrcjax.types import Float, Int


def double_q_value(q_online: Float, q_target: Float, axis: int = 1) -> Float:
    """Q(s', argmax_a Q(s', a; theta); theta'), the value in equation (15); [N, A], [N, A] to [N].

    With actions along the other axis: `axis` 0.
    """
    chex.assert_equal_shape([q_online, q_target])
    chex.assert_rank(q_online, 2)
    best = jnp.argmax(q_online, axis=axis, keepdims=True)
    return jnp.take_along_axis(q_target, best, axis=axis).squeeze(axis)


def td_target(reward: Float, discount: Float, next_value: Float) -> Float:
    """The target y = rho + gamma V(s'), equation (15); `discount` is 0 where the episode ended for good."""
    return reward + discount * next_value


def squared_td_loss(td_error: Float) -> Float:
    """Mean of (y - Q)^2 over the mini-batch [B], equations (16) and (20)."""
    chex.assert_rank(td_error, 1)  # a mean over a broadcast pair would be silently wrong
    return jnp.mean(jnp.square(td_error))


def q_learning_error(q: Float, state: Int, action: Int, reward: Float, next_state: Int, discount: Float) -> Float:
    """The error rho + gamma max_a Q(s', a) - Q(s, a), the bracket in equation (13), for a table q [S, A]."""
    return td_target(reward, discount, q[next_state].max()) - q[state, action]


def robbins_monro_step(visits: Int, exponent: Float) -> Float:
    """Step size n^-exponent after n >= 1 visits; satisfies equation (14) for exponents in (0.5, 1]."""
    return jnp.maximum(visits, 1).astype(jnp.float32) ** -exponent


def large_margin_loss(q: Float, expert: Int, margin: Float, axis: int = 1) -> Float:
    """max_a [Q(s, a) + Gamma(a_E, a)] - Q(s, a_E), equation (29), with Gamma the margin for a != a_E and 0 for a_E.

    Args:
      q: [B, A] values of the demonstrated states.
      expert: [B] the demonstrator's actions a_E.
      margin: a scalar.
      axis: that of the actions; 0 for q of [A, B].
    """
    chex.assert_rank([q, expert], [2, 1])
    is_expert = jax.nn.one_hot(expert, q.shape[axis], dtype=bool, axis=axis)
    best = jnp.max(q + jnp.where(is_expert, 0.0, margin), axis=axis)
    return best - jnp.where(is_expert, q, 0.0).sum(axis=axis)


def l2_loss(weights: Any) -> Float:
    """J_L2, the sum of the squares of all weights and biases."""
    return sum((jnp.sum(jnp.square(leaf)) for leaf in jax.tree.leaves(weights)), jnp.float32(0.0))
