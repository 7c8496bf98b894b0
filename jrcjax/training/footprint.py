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
from jrcjax.model.states import num_states
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
    """By field, what it adds to `agent_bytes` at most; those of a learner or an optimiser of one's own are unknown."""
    widths = (len(spec.shape), *config.hidden, spec.num_actions)
    weights = sum((a + 1) * b for a, b in itertools.pairwise(widths))
    # 64 bytes per transition, and some for a line that is not full and for single numbers; weights with their target,
    # two moments and the source's; two tables of all states, of Q-learning or for the target; words of an episode.
    return {
        "config.replay_capacity": 64 * (config.replay_capacity + 16),
        "config.demonstrations": 64 * config.demonstrations,
        "config.n_step": 4 * len(NStepTransition._fields) * config.n_step,
        "config.hidden": 20 * weights,
        "config.batch_size": 4 * spec.episode_slots * learner.num_words,
        "shape": 8 * num_states(spec.shape) * spec.num_actions,
    }


def bytes_at_most(learner: Learner, spec: Spec, config: Config) -> int:
    """At least `agent_bytes`; without tracing where only this package says what an agent keeps."""
    is_own = str(getattr(learner.init, "__module__", "")).startswith("jrcjax.learners.")
    if is_own and isinstance(config.optimiser, str):
        return sum(most_bytes(learner, spec, config).values())
    return agent_bytes(learner, spec, config)


def check_memory(learner: Learner, spec: Spec, config: Config, agents: int) -> None:
    """Refuses agents that this machine can't hold.

    Raises:
      ValueError: naming the field that takes the most, with the estimate.
    """
    available = physical_memory()
    if _COPIES * agents * bytes_at_most(learner, spec, config) <= available:  # without tracing, in nearly all cases
        return
    needed = _COPIES * agents * agent_bytes(learner, spec, config)
    if needed > available:
        at_most = most_bytes(learner, spec, config)
        field = max(at_most, key=lambda name: at_most[name])
        value = spec.shape if field == "shape" else getattr(config, field.removeprefix("config."))
        estimate = f"about {needed / 2**30:.3g} GiB for {agents} agents"
        refuse(field, str(value), f"sizes that fit {available / 2**30:.3g} GiB of memory, not {estimate}")
