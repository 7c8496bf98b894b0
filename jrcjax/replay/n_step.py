"""n-step returns: the paper's equation (28), built up step by step and cut at the time limit."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax.replay.uniform import Transition
from jrcjax.types import Float, Int


class NStepTransition(NamedTuple):
    """A transition and what followed it; scalars, or arrays with common leading axes."""

    state: Int
    action: Int
    reward: Float
    next_state: Int
    discount: Float
    """gamma, or 0 if the episode ended for good after this step."""
    n_return: Float
    """R_t^(n) = sum over k < n of gamma^k rho_{t+k}; fewer terms where the episode's time limit comes first."""
    n_discount: Float
    """gamma^n for as many steps as the return has; 0 if the episode ended for good."""
    n_state: Int
    """s_{t+n}, or the episode's last state."""


def init(n: int) -> NStepTransition:
    """A window of the last n transitions, oldest first; its content means nothing before n steps have passed."""
    ids, numbers = jnp.zeros(n, jnp.int32), jnp.zeros(n, jnp.float32)
    return NStepTransition(ids, ids, numbers, ids, numbers, numbers, numbers, ids)


def push(window: NStepTransition, transition: Transition, position: Int) -> NStepTransition:
    """The window one step later; from the n-th step on its first transition is complete.

    Args:
      window: [n] transitions, oldest first.
      transition: what happened in this step, scalars.
      position: the step's number in its episode, from 0.
    """
    new = NStepTransition(*transition, n_return=0.0, n_discount=1.0, n_state=transition.next_state)  # pyright: ignore
    window = jax.tree.map(lambda old, x: jnp.append(old[1:], jnp.asarray(x, old.dtype)), window, new)
    age = jnp.arange(window.state.shape[0])[::-1]
    goes_on = age <= position  # younger than the episode
    return window._replace(
        n_return=jnp.where(goes_on, window.n_return + window.n_discount * transition.reward, window.n_return),
        n_discount=jnp.where(goes_on, window.n_discount * transition.discount, window.n_discount),
        n_state=jnp.where(goes_on, transition.next_state, window.n_state),
    )
