"""A policy that does not learn, as a learner: what is simulated and evaluated of an agent after its training."""

from __future__ import annotations

from typing import NamedTuple

from jrcjax.learners import exploration
from jrcjax.learners.base import Learner
from jrcjax.types import Float


class FixedState(NamedTuple):
    """A policy and how much it explores."""

    policy: Float
    """[S, A] probabilities, of which the largest is taken."""
    epsilon: Float
    """Probability of a uniform action instead."""


def _explored(state: FixedState) -> Float:
    return (1.0 - state.epsilon) * state.policy + state.epsilon / state.policy.shape[-1]


FIXED = Learner(
    num_words=exploration.NUM_WORDS,
    init=lambda key, hparams, source=None: None,  # the policy comes from elsewhere
    act=lambda state, state_id, step, words, hparams: exploration.epsilon_greedy(
        words, state.policy[state_id], state.epsilon
    ),
    update=lambda state, transition, step, words, hparams: state,
    policy=_explored,
)
"""The rule whose state is a `FixedState`; its policy counts the exploration."""
