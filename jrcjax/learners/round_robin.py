"""Round Robin: all actions in turn, without learning (the paper, section VI-A.4)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.learners.base import Learner, Spec
from jrcjax.learners.hparams import Config
from jrcjax.model.states import num_states


def round_robin(spec: Spec, config: Config) -> Learner:
    """Action t mod A in step t, whatever the state; in the long run the uniform policy."""
    del config
    shape = num_states(spec.shape), spec.num_actions
    uniform = jax.device_put(np.full(shape, 1.0 / spec.num_actions, np.float32))  # which compiles nothing
    return Learner(
        num_words=0,
        init=lambda key, hparams, source=None: (),
        act=lambda state, state_id, step, words, hparams: (step % spec.num_actions).astype(jnp.int32),
        update=lambda state, transition, step, words, hparams: state,
        policy=lambda state: uniform,
    )
