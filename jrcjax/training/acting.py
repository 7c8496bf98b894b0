"""One slot of an agent in its environment, whether it learns there or demonstrates."""

from __future__ import annotations

from collections.abc import Callable

import jax.numpy as jnp

from jrcjax.learners import exploration
from jrcjax.model import slot
from jrcjax.model.params import EnvParams
from jrcjax.replay.uniform import Transition
from jrcjax.types import Bool, Float, Int, Words

NUM_WORDS = slot.NUM_WORDS + exploration.NUM_WORDS
"""Random words of one slot: the environment's, then the action's."""


def act_in_slot(
    words: Words,
    state: Int,
    first: Int,
    act: Callable[[Words], Int],
    last: Bool,
    env_params: EnvParams,
    discount: Float,
) -> tuple[Transition, slot.Outcome]:
    """The agent acts and the environment answers.

    Args:
      words: [NUM_WORDS] random words.
      state: state id, a scalar.
      first: that of the episode's first state.
      act: random words of the action to the action.
      last: whether the slot is the episode's last.
      env_params: the environment; it says whether the episode then ends for good.
      discount: gamma.

    Returns:
      What a learner is told, and all that happened.
    """
    of_slot, of_action = jnp.split(words, [slot.NUM_WORDS])
    action = act(of_action)
    outcome = slot.run_slot(of_slot, state, action, env_params, first)
    is_terminal = last & (env_params.terminal_time_limit == 1)
    discount = jnp.where(is_terminal, 0.0, discount)
    return Transition(state, action, outcome.reward, outcome.next_state, discount), outcome
