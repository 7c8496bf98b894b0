"""What a learner is: a few pure functions on one agent's state. Learners know ids and arrays, not the environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from jrcjax.learners.hparams import Config, HParams
from jrcjax.replay.n_step import NStepTransition
from jrcjax.replay.uniform import Transition
from jrcjax.types import Float, Int, Key, Words

State = Any
"""A learner's own pytree."""


class Spec(NamedTuple):
    """The static side of a problem."""

    shape: tuple[int, ...]
    """Levels per factor; S is their product."""
    num_actions: int
    """A."""
    episode_slots: int
    """Slots of every episode."""


class Source(NamedTuple):
    """What transfer learners take over from the source environment."""

    weights: Any
    """The source agent's network, theta*_S."""
    demonstrations: NStepTransition
    """D_S, what the agent did in the source environment, [demonstrations]."""


class Learner(NamedTuple):
    """One agent's learning rule. `step` counts slots from 0 and is the same for all agents of a batch."""

    num_words: int
    """Random words per step, split between `act` (the first two) and `update`."""
    init: Callable[[Key, HParams, Source | None], State]
    """(key, hparams, source) to the learner state before the first step; pre-training is done here."""
    act: Callable[[State, Int, Int, Words, HParams], Int]
    """(learner state, state id, step, words, hparams) to an action."""
    update: Callable[[State, Transition, Int, Any, HParams], State]
    """(learner state, transition, step, what `draw` made of the step's words, hparams) to the next learner state."""
    policy: Callable[[State], Float]
    """Learner state to the policy without exploration, [S, A] probabilities."""
    values: Callable[[State], Float] | None = None
    """Learner state to Q(s, a), [S, A], by which divergence is noticed; None for learners without values."""
    draw: Callable[[Words, Int], Any] = lambda words, steps: words
    """(words of `update` [steps, words], numbers of the steps [steps]) to what `update` is given per step; leaves have
    a leading axis of steps. What needs nothing but words costs less for a whole episode at once."""
    needs_source: bool = False
    """Whether `init` needs a source."""


LearnerFactory = Callable[[Spec, Config], Learner]
