"""Optimisers: steps against the gradient, equations (19) to (21)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from jrcjax.checks import refuse
from jrcjax.keys import key_of
from jrcjax.learners.hparams import Config, HParams
from jrcjax.learners.q_function import QFunction
from jrcjax.types import Float

_NAMED = {"adam": optax.scale_by_adam, "sgd": optax.identity, "rmsprop": optax.scale_by_rms}


class Optimiser(NamedTuple):
    """An optax optimiser whose learning rate may be traced."""

    init: Callable[[Any], Any]
    """Weights to the optimiser's state."""
    step: Callable[[Any, Any, Any, HParams], tuple[Any, Any]]
    """(gradient, state, weights, hparams) to the weights one step later, and the next state."""


def optimiser_of(config: Config) -> Optimiser:
    """The optimiser of `config`; a named one takes its rate from `HParams`, equation (21)."""
    is_named = isinstance(config.optimiser, str)
    optimiser = _NAMED[config.optimiser]() if isinstance(config.optimiser, str) else config.optimiser

    def step(gradient: Any, state: Any, weights: Any, hparams: HParams) -> tuple[Any, Any]:
        if config.gradient_clipping == "global_norm":
            gradient = clipped(gradient, hparams.max_gradient_norm)
        direction, state = optimiser.update(gradient, state, weights)
        if is_named:
            direction = jax.tree.map(lambda d: -hparams.learning_rate * d, direction)
        return optax.apply_updates(weights, direction), state

    return Optimiser(optimiser.init, step)


def clipped(gradient: Any, norm: Float) -> Any:
    """The gradient, shortened to `norm` where it is longer over all weights together."""
    scale = norm / jnp.maximum(optax.tree.norm(gradient), norm)
    return jax.tree.map(lambda g: scale * g, gradient)


def check_optimiser(config: Config, function: QFunction) -> None:
    """Tries one step of an optimiser without a name on the weights of a network, without computing anything.

    Raises:
      ValueError: if it needs more than a gradient and weights, or its state changes its shape.
    """
    if isinstance(config.optimiser, str):
        return
    allowed = "an optax transformation whose update needs nothing but gradient, state and weights"
    weights = jax.eval_shape(function.init, key_of(0))
    try:
        state = jax.eval_shape(config.optimiser.init, weights)
        new_weights, new_state = jax.eval_shape(config.optimiser.update, weights, state, weights)
    except Exception as error:  # whatever an optimiser raises, it can't be used
        reason = str(error).strip().split("\n")[0][:200]
        raise ValueError(
            f"config.optimiser: it raises {type(error).__name__} ({reason}); allowed: {allowed}"
        ) from error
    for name, new, old in (("state", new_state, state), ("step", new_weights, weights)):
        if jax.tree.structure(new) != jax.tree.structure(old) or _kinds(new) != _kinds(old):
            refuse("config.optimiser", f"its {name} changes shape or type", allowed)


def _kinds(tree: Any) -> list:
    return [(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(tree)]
