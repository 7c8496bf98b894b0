"""PRNG keys: one generator for everything that the library draws, and one list of what an agent's key is used for."""

from __future__ import annotations

from enum import IntEnum

import jax

from jrcjax.numerics import PINNED
from jrcjax.types import Int, Key

PRETRAINING = 1
"""What is folded into a learner's key for the mini-batches of its pre-training."""


class Purpose(IntEnum):
    """What is folded into an agent's key, so that each use has random numbers of its own."""

    INIT = 0
    """The learner before its first episode."""
    EPISODES = 1
    """Episodes of training; the episode's number is folded in next."""
    SOURCE = 2
    """A source agent of its own, if an agent that transfers is given none."""
    DEMONSTRATIONS = 3
    """What the agent demonstrates after its training."""
    TARGET = 4
    """All learners in the target environment; the seed's key itself is the source agent's."""


def key_of(seed: Int | int) -> Key:
    """The key of a seed, of the generator that the library uses, whatever JAX_DEFAULT_PRNG_IMPL says."""
    return jax.random.key(seed, impl=PINNED["jax_default_prng_impl"])
