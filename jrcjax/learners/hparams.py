"""Hyperparameters: `HParams` holds numbers that may be vmapped over, `Config` what decides shapes and code."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import optax
from jaxtyping import Array, Float, Int

from jrcjax.checks import is_traced, refuse, require_integer, require_type
from jrcjax.containers import (
    BELOW_ONE,
    NOT_NEGATIVE,
    POSITIVE,
    PROBABILITY,
    Allowed,
    Container,
    integer,
    number,
    reading,
)
from jrcjax.readings import DemonstrationRewards, Exploration, ImportanceOver, Initialiser, InitialWeights, Loss

OPTIMISERS = ("adam", "sgd", "rmsprop")
FORMS = ("auto", "table", "rows")
CLIPPINGS = ("none", "global_norm")
TARGET_UPDATES = ("copied", "soft")
_MAX_TABLE_STATES = 256  # beyond it three rows per sample of a mini-batch cost less than all states
_SHARE = Allowed(lambda x: (x > 0) & (x <= 1), "in (0, 1]")
_EXPONENT = Allowed(lambda x: (x > 0.5) & (x <= 1), "in (0.5, 1], equation (14)")
_PRIORITY = Allowed(lambda x: x >= 1e-30, ">= 1e-30")  # powers of less, and their sums, vanish
_AT_LEAST_ONE = Allowed(lambda x: (x >= 1) & (x < 2**31), ">= 1")


class HParams(Container):
    """Numbers of the learners, all scalars; defaults are Table I, or the first reading where it is silent."""

    discount: Float[Array, ""] = number(BELOW_ONE, default=0.99)
    """gamma, in [0, 1)."""
    epsilon_start: Float[Array, ""] = number(PROBABILITY, default=1.0)
    """Probability of a random action at first."""
    epsilon_end: Float[Array, ""] = number(PROBABILITY, default=0.01)
    """Probability of a random action after `epsilon_slots`."""
    epsilon_slots: Float[Array, ""] = number(POSITIVE, "slots", default=30_000.0)
    """Slots over which epsilon falls: 100 episodes of 300 slots."""
    exploration: Int[Array, ""] = reading(Exploration)
    """How epsilon falls: linearly from slot to slot, or by the same factor from episode to episode."""
    learning_rate: Float[Array, ""] = number(POSITIVE, default=1e-3)
    """nu of equation (21), for the named optimisers."""
    initialiser: Int[Array, ""] = reading(Initialiser)
    """Where random weights of a network come from: LeCun's normal, Glorot's uniform or He's normal distribution."""
    loss: Int[Array, ""] = reading(Loss)
    """How temporal-difference errors count: squared, or squared up to `huber_delta` and linear beyond it."""
    huber_delta: Float[Array, ""] = number(POSITIVE, default=1.0)
    """The error from which the Huber loss is linear, if `loss` says so."""
    max_gradient_norm: Float[Array, ""] = number(POSITIVE, default=10.0)
    """The norm that gradients are cut to, if `Config.gradient_clipping` says so."""
    target_period: Int[Array, ""] = integer(_AT_LEAST_ONE, default=300)
    """upsilon, updates between two copies into the target network."""
    target_rate: Float[Array, ""] = number(_SHARE, default=1e-3)
    """tau, the share of the network that enters the target network in every update, if `Config.target_update` is
    "soft"."""
    step_exponent: Float[Array, ""] = number(_EXPONENT, default=0.7)
    """Q-learning's step size is n(s, a)^-exponent; in (0.5, 1] it satisfies equation (14)."""
    step_constant: Float[Array, ""] = number(PROBABILITY, default=0.0)
    """If positive, Q-learning's step size instead of the count-based one."""
    priority_exponent: Float[Array, ""] = number(PROBABILITY, default=0.4)
    """alpha of equation (23); 0 samples uniformly."""
    priority_constant: Float[Array, ""] = number(_PRIORITY, default=0.001)
    """epsilon, added to the size of the temporal-difference error in a priority."""
    demonstration_constant: Float[Array, ""] = number(NOT_NEGATIVE, default=1.0)
    """What a demonstration's priority gets instead of `priority_constant`, if it is larger."""
    demonstration_rewards: Int[Array, ""] = reading(DemonstrationRewards)
    """Whether TLwD learns from the rewards of demonstrations, or uses these for the margin alone."""
    importance_start: Float[Array, ""] = number(PROBABILITY, default=0.6)
    """beta of equation (24) at first."""
    importance_end: Float[Array, ""] = number(PROBABILITY, default=1.0)
    """beta after the last update; linear in between."""
    importance_over: Int[Array, ""] = reading(ImportanceOver)
    """Whether beta rises over pre-training and training together, or over training alone."""
    n_step_weight: Float[Array, ""] = number(NOT_NEGATIVE, default=1.0)
    """lambda_1 of equation (25), the weight of the n-step loss."""
    margin_weight: Float[Array, ""] = number(NOT_NEGATIVE, default=1.0)
    """lambda_2 of equation (25), the weight of the large-margin loss."""
    l2_weight: Float[Array, ""] = number(NOT_NEGATIVE, default=1e-5)
    """lambda_3 of equation (25), the weight of the squares of all network weights."""
    margin: Float[Array, ""] = number(NOT_NEGATIVE, default=1.0)
    """Gamma of equation (29) for actions other than the demonstrator's."""
    demonstration_epsilon: Float[Array, ""] = number(PROBABILITY, default=0.01)
    """Probability of a random action while the source agent demonstrates."""
    initial_weights: Int[Array, ""] = reading(InitialWeights)
    """TLwD's network at the start of pre-training: random, as in Algorithm 2, or the source agent's."""


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
    gradient_clipping: str = "none"
    """Whether gradients are cut: "none", or "global_norm" to `HParams.max_gradient_norm` over all weights together."""
    target_update: str = "copied"
    """How the target network follows: "copied" every `HParams.target_period` updates, or "soft" in every update, by the
    share `HParams.target_rate`. A soft target keeps its weights instead of its table, and an update costs more."""
    form: str = "auto"
    """How the loss is computed: "table" evaluates the network on all states and indexes the result, "rows" on the
    samples of the mini-batch; "auto" takes the table up to 256 states. Both give the same gradient."""

    def uses_table(self, num_states: int) -> bool:
        """Whether the loss is computed on the table of all states, not on the rows of a mini-batch; see `form`."""
        return self.form == "table" or (self.form == "auto" and num_states <= _MAX_TABLE_STATES)


def check_words(config: Config, words: int) -> None:
    """Refuses a replay memory of so many words that their places are no int32.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    if words >= 2**31:
        allowed = f"a capacity of which the memory has fewer than 2^31 words of 32 bits, not {words}"
        refuse("config.replay_capacity", config.replay_capacity, allowed)


def check_hparams(hparams: HParams) -> None:
    """Checks hyperparameters.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    require_type("hparams", hparams, HParams)
    hparams.check("hparams")
    _check_exponential(hparams)


def _check_exponential(hparams: HParams) -> None:
    """A factor leads from one probability to another only if neither is 0."""
    if is_traced(hparams.exploration) or int(np.asarray(hparams.exploration)) != Exploration.EXPONENTIAL:
        return
    for name in ("epsilon_start", "epsilon_end"):
        value = getattr(hparams, name)
        if not is_traced(value) and float(np.asarray(value)) == 0:
            refuse(f"hparams.{name}", 0.0, "a probability > 0, where epsilon falls exponentially")


def check_config(config: Config) -> None:
    """Checks static settings.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    require_type("config", config, Config)
    for name in ("episodes", "batch_size", "demonstrations", "pretraining", "n_step"):
        require_integer(f"config.{name}", getattr(config, name), 0 if name == "pretraining" else 1)
    # A sum tree over the transitions has a third more values, which are numbered in 32 bits.
    require_integer("config.replay_capacity", config.replay_capacity, 1, 10**9)
    if not isinstance(config.hidden, tuple):
        refuse("config.hidden", repr(config.hidden), "a tuple of Python ints >= 1")
    for width in config.hidden:
        require_integer("config.hidden", width, 1)
    for name, choices in {"gradient_clipping": CLIPPINGS, "target_update": TARGET_UPDATES, "form": FORMS}.items():
        value = getattr(config, name)
        if not isinstance(value, str) or value not in choices:
            refuse(f"config.{name}", str(value), ", ".join(map(repr, choices)))
    named = isinstance(config.optimiser, str) and config.optimiser in OPTIMISERS
    if not named and not isinstance(config.optimiser, optax.GradientTransformation):
        allowed = f"{', '.join(map(repr, OPTIMISERS))}, or an optax transformation"
        refuse("config.optimiser", str(config.optimiser), allowed)
