"""Whether agents fit into memory, told before anything is compiled."""

from __future__ import annotations

import itertools
import math

import jax
import jax.numpy as jnp

from jrcjax.checks import refuse
from jrcjax.keys import key_of
from jrcjax.learners import Learner, Source, Spec
from jrcjax.learners.hparams import Config, HParams
from jrcjax.learners.q_function import q_function
from jrcjax.machine import physical_memory
from jrcjax.replay.n_step import NStepTransition

_COPIES = 2  # of an agent while it advances: the old one and the new


def agent_bytes(learner: Learner, spec: Spec, config: Config) -> int:
    """Bytes of one agent with its source, if it needs one, and the random words of an episode."""

    def agent():
        key, source = key_of(0), None
        if learner.needs_source:
            numbers = jnp.zeros(config.demonstrations, jnp.int32)  # as large as the floats among them
            demonstrations = NStepTransition(*[numbers] * len(NStepTransition._fields))
            source = Source(q_function(spec, config).init(key), demonstrations)
        return learner.init(key, HParams(), source), source

    words = 4 * spec.episode_slots * learner.num_words
    return words + sum(math.prod(leaf.shape) * leaf.dtype.itemsize for leaf in jax.tree.leaves(jax.eval_shape(agent)))


def most_bytes(learner: Learner, spec: Spec, config: Config) -> dict[str, int]:
    """By setting, what it adds to `agent_bytes` at most: a bound that needs no tracing."""
    widths = (len(spec.shape), *config.hidden, spec.num_actions)
    # 64 bytes per transition, weights with their target and two moments, random words of an episode.
    return {
        "config.replay_capacity": 64 * config.replay_capacity,
        "config.demonstrations": 64 * config.demonstrations,
        "config.hidden": 16 * sum(a * b for a, b in itertools.pairwise(widths)),
        "config.batch_size": 4 * spec.episode_slots * learner.num_words,
    }


def check_memory(learner: Learner, spec: Spec, config: Config, agents: int) -> None:
    """Refuses agents that this machine can't hold.

    Raises:
      ValueError: naming the setting that takes the most, with the estimate.
    """
    available, at_most = physical_memory(), most_bytes(learner, spec, config)
    if _COPIES * agents * sum(at_most.values()) <= available:  # without tracing, in nearly all cases
        return
    needed = _COPIES * agents * agent_bytes(learner, spec, config)
    if needed > available:
        field = max(at_most, key=lambda name: at_most[name])
        estimate = f"about {needed / 2**30:.3g} GiB for {agents} agents"
        allowed = f"sizes that fit {available / 2**30:.3g} GiB of memory, not {estimate}"
        refuse(field, str(getattr(config, field.removeprefix("config."))), allowed)
