"""Temporal-difference targets and losses, one function an equation (the paper's section V).

Functions of values take those of one state, [A], or a table over all states, [S, A]; batches are the caller's `vmap`.
"""

from __future__ import annotations

import functools
import operator
from typing import Any

import chex
import jax
import jax.numpy as jnp

from jrcjax.readings import Loss
from jrcjax.types import Bool, Float, Int


@jax.custom_jvp
def total(values: Float) -> Float:
    """The sum of a few values [A], written out: XLA hands what it knows as a sum to a library, away from its loops."""
    return functools.reduce(operator.add, values)


total.defjvps(lambda tangent, _, values: tangent.sum())


@jax.custom_jvp
def greatest(values: Float) -> Float:
    """The largest of a few values [A], written out as `total`; of equals each takes its share of the gradient."""
    return functools.reduce(jnp.maximum, values)


def _greatest_tangent(tangent: Float, answer: Float, values: Float) -> Float:
    is_greatest = (values == answer).astype(values.dtype)
    return (tangent * is_greatest).sum() / total(is_greatest)


greatest.defjvps(_greatest_tangent)


def value_of(q: Float, is_action: Bool) -> Float:
    """Q(s, a) of one action, of values [A] and what is true for that action alone, [A].

    The same as q[action]. As a sum it stays part of the loops around it, and columns stay columns under `vmap`.
    """
    return total(jnp.where(is_action, q, 0.0))


def double_q_value(q_online: Float, q_target: Float) -> Float:
    """Q(s', argmax_a Q(s', a; theta); theta'), the value in equation (15), of values [A] of both networks in s'."""
    chex.assert_rank([q_online, q_target], 1)
    return q_target[jnp.argmax(q_online)]


def td_target(reward: Float, discount: Float, next_value: Float) -> Float:
    """The target y = rho + gamma V(s'), equation (15); `discount` is 0 where the episode ended for good."""
    return reward + discount * next_value


def td_loss(td_error: Float, loss: Int, delta: Float) -> Float:
    """(y - Q)^2, or the Huber loss: beyond an error of `delta` the straight line that continues the square; any shape.

    Args:
      td_error: y - Q.
      loss: the reading `Loss`.
      delta: where the line begins.
    """
    limit = jnp.where(loss == Loss.HUBER, delta, jnp.inf)
    slope = 2.0 * jax.lax.stop_gradient(jnp.clip(td_error, -limit, limit))
    return slope * td_error - jnp.square(slope / 2.0)


def q_learning_error(q: Float, state: Int, action: Int, reward: Float, next_state: Int, discount: Float) -> Float:
    """The error rho + gamma max_a Q(s', a) - Q(s, a), the bracket in equation (13), for a table q [S, A]."""
    return td_target(reward, discount, q[next_state].max()) - q[state, action]


def robbins_monro_step(visits: Int, exponent: Float) -> Float:
    """Step size n^-exponent after n >= 1 visits; satisfies equation (14) for exponents in (0.5, 1]."""
    return jnp.maximum(visits, 1).astype(jnp.float32) ** -exponent


def large_margin_loss(q: Float, is_expert: Bool, margin: Float) -> Float:
    """max_a [Q(s, a) + Gamma(a_E, a)] - Q(s, a_E), equation (29), with Gamma the margin for a != a_E and 0 for a_E.

    Args:
      q: [A] values of the demonstrated state.
      is_expert: [A], true for the demonstrator's action a_E alone.
      margin: a scalar.
    """
    chex.assert_rank([q, is_expert], 1)
    return greatest(q + jnp.where(is_expert, 0.0, margin)) - value_of(q, is_expert)


def l2_loss(weights: Any) -> Float:
    """J_L2, the sum of the squares of all weights and biases."""
    return sum((jnp.sum(jnp.square(leaf)) for leaf in jax.tree.leaves(weights)), jnp.float32(0.0))
