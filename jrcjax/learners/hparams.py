"""Hyperparameters: `HParams` holds numbers that may be vmapped over, `Config` what decides shapes and code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from flax import struct

from jrcjax.checks import is_not_negative, refuse, replaced, require, require_integer, require_reading, require_type
from jrcjax.types import INITIAL_WEIGHTS, Float, Int

OPTIMISERS = ("adam", "sgd", "rmsprop")
FORMS = ("auto", "table", "rows")
_MAX_TABLE_STATES = 256  # beyond it three rows per sample of a mini-batch cost less than all states


def _f32(value: float):
    return struct.field(default_factory=lambda: jnp.float32(value))


@struct.dataclass
class HParams:
    """Numbers of the learners, all scalars; defaults are Table I, or the first reading where it is silent."""

    discount: Float = _f32(0.99)
    """gamma, in [0, 1)."""
    epsilon_start: Float = _f32(1.0)
    """Probability of a random action at first."""
    epsilon_end: Float = _f32(0.01)
    """Probability of a random action after `epsilon_slots`."""
    epsilon_slots: Float = _f32(30_000.0)
    """Slots over which epsilon falls linearly: 100 episodes of 300 slots."""
    learning_rate: Float = _f32(1e-3)
    """nu of equation (21), for the named optimisers."""
    target_period: Int = struct.field(default_factory=lambda: jnp.int32(300))
    """upsilon, updates between two copies into the target network."""
    step_exponent: Float = _f32(0.7)
    """Q-learning's step size is n(s, a)^-exponent; in (0.5, 1] it satisfies equation (14)."""
    step_constant: Float = _f32(0.0)
    """If positive, Q-learning's step size instead of the count-based one."""
    priority_exponent: Float = _f32(0.4)
    """alpha of equation (23); 0 samples uniformly."""
    priority_constant: Float = _f32(0.001)
    """epsilon, added to |TD error|."""
    demonstration_constant: Float = _f32(1.0)
    """The same for demonstrations."""
    importance_start: Float = _f32(0.6)
    """beta of equation (24) at first."""
    importance_end: Float = _f32(1.0)
    """beta in the last update; linear in between, over pre-training and training together."""
    n_step_weight: Float = _f32(1.0)
    """lambda_1 of equation (25)."""
    margin_weight: Float = _f32(1.0)
    """lambda_2."""
    l2_weight: Float = _f32(1e-5)
    """lambda_3."""
    margin: Float = _f32(1.0)
    """Gamma of equation (29) for actions other than the demonstrator's."""
    demonstration_epsilon: Float = _f32(0.01)
    """Probability of a random action while the source agent demonstrates."""
    initial_weights: Int = struct.field(default_factory=lambda: jnp.int32(0))
    """TLwD's at the start of pre-training, index into INITIAL_WEIGHTS: random, as in Algorithm 2, or the source
    agent's."""


# After the class, because flax's decorator sets a `replace` of its own.
HParams.replace = replaced  # pyright: ignore[reportAttributeAccessIssue]


@dataclass(frozen=True)
class Config:
    """Static settings of a training run; defaults are Table I."""

    episodes: int = 1000
    """Episodes of `max_steps_in_episode` slots."""
    batch_size: int = 64
    """N_b, samples per update."""
    replay_capacity: int = 50_000
    """|D_re|, transitions that the replay memory holds, TLwD's demonstrations among them."""
    demonstrations: int = 20_000
    """|D_S|, transitions of the source agent that TLwD is given."""
    pretraining: int = 10_000
    """T_pre, TLwD's updates on the demonstrations alone."""
    n_step: int = 10
    """n, rewards in an n-step return."""
    hidden: tuple[int, ...] = (24, 24)
    """Widths of the hidden layers."""
    optimiser: str | optax.GradientTransformation = "adam"
    """One of OPTIMISERS, scaled by `HParams.learning_rate`, or any optax optimiser, which brings its own rate."""
    form: str = "auto"
    """How the loss is computed: "table" evaluates the network on all states and indexes the result, "rows" on the
    samples of the mini-batch; "auto" takes the table up to 256 states. Both give the same gradient."""

    def uses_table(self, num_states: int) -> bool:
        """Whether the loss is computed on the table of all states, not on the rows of a mini-batch; see `form`."""
        return self.form == "table" or (self.form == "auto" and num_states <= _MAX_TABLE_STATES)


class Optimiser(NamedTuple):
    """An optax optimiser whose learning rate may be traced."""

    init: Callable[[Any], Any]
    step: Callable[[Any, Any, Any, HParams], tuple[Any, Any]]
    """(gradient, state, weights, hparams) to what is added to the weights, and the next state."""


def optimiser_of(config: Config) -> Optimiser:
    """The optimiser of `config`; a named one takes its rate from `HParams`, equation (21)."""
    named = {"adam": optax.scale_by_adam, "sgd": optax.identity, "rmsprop": optax.scale_by_rms}
    optimiser = named[config.optimiser]() if isinstance(config.optimiser, str) else config.optimiser

    def step(gradient: Any, state: Any, weights: Any, hparams: HParams) -> tuple[Any, Any]:
        direction, state = optimiser.update(gradient, state, weights)
        if not isinstance(config.optimiser, str):
            return direction, state
        return jax.tree.map(lambda d: -hparams.learning_rate * d, direction), state

    return Optimiser(optimiser.init, step)


def check_hparams(hparams: HParams) -> None:
    """Checks hyperparameters.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    require_type("hparams", hparams, HParams)
    unit = lambda x: (x >= 0) & (x <= 1)  # noqa: E731
    require("hparams.discount", hparams.discount, (), lambda x: (x >= 0) & (x < 1), "a number in [0, 1)")
    require("hparams.epsilon_start", hparams.epsilon_start, (), unit, "a probability in [0, 1]")
    require("hparams.epsilon_end", hparams.epsilon_end, (), unit, "a probability in [0, 1]")
    require("hparams.epsilon_slots", hparams.epsilon_slots, (), lambda x: x > 0, "a number of slots > 0")
    require("hparams.learning_rate", hparams.learning_rate, (), lambda x: x > 0, "a number > 0")
    period = lambda x: (x >= 1) & (x == np.floor(x))  # noqa: E731
    require("hparams.target_period", hparams.target_period, (), period, "an integer >= 1")
    exponent = lambda x: (x > 0.5) & (x <= 1)  # noqa: E731
    require("hparams.step_exponent", hparams.step_exponent, (), exponent, "a number in (0.5, 1], equation (14)")
    require("hparams.step_constant", hparams.step_constant, (), unit, "a number in [0, 1], 0 for count-based steps")
    for name in ("priority_exponent", "importance_start", "importance_end", "demonstration_epsilon"):
        require(f"hparams.{name}", getattr(hparams, name), (), unit, "a number in [0, 1]")
    for name in ("priority_constant", "demonstration_constant"):
        require(f"hparams.{name}", getattr(hparams, name), (), lambda x: x >= 1e-30, "a number >= 1e-30")
    for name in ("n_step_weight", "margin_weight", "l2_weight", "margin"):
        require(f"hparams.{name}", getattr(hparams, name), (), is_not_negative, "a number >= 0")
    require_reading("hparams.initial_weights", hparams.initial_weights, INITIAL_WEIGHTS)


def check_config(config: Config) -> None:
    """Checks static settings.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    require_type("config", config, Config)
    for name in ("episodes", "batch_size", "replay_capacity", "demonstrations", "pretraining", "n_step"):
        require_integer(f"config.{name}", getattr(config, name), 0 if name == "pretraining" else 1)
    if not isinstance(config.hidden, tuple):
        refuse("config.hidden", repr(config.hidden), "a tuple of Python ints >= 1")
    for width in config.hidden:
        require_integer("config.hidden", width, 1)
    named = isinstance(config.optimiser, str) and config.optimiser in OPTIMISERS
    if not named and not isinstance(config.optimiser, optax.GradientTransformation):
        refuse(
            "config.optimiser", str(config.optimiser), f"{', '.join(map(repr, OPTIMISERS))}, or an optax transformation"
        )
    if not isinstance(config.form, str) or config.form not in FORMS:
        refuse("config.form", str(config.form), ", ".join(map(repr, FORMS)))
