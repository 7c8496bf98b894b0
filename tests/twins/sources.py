"""Something for learners that transfer to take over, made up instead of learnt."""

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.learners import Source, Spec
from jrcjax.learners.hparams import Config
from jrcjax.learners.q_function import q_function
from jrcjax.replay.n_step import NStepTransition


def random_demonstrations(
    spec: Spec, number: int, seed: int, scale: float = 1.0, gamma: float = 0.9, n: int = 4
) -> NStepTransition:
    """Unrelated transitions in double precision; of three returns of up to n steps one ended for good."""
    generator, states = np.random.default_rng(seed), int(np.prod(spec.shape))
    powers = np.cumprod(np.full(n, gamma, np.float32), dtype=np.float32)
    n_terminal = generator.uniform(size=number) < 1 / 3
    return NStepTransition(
        state=generator.integers(0, states, number),
        action=generator.integers(0, spec.num_actions, number),
        reward=generator.normal(0, scale, number).astype(np.float32).astype(float),
        next_state=generator.integers(0, states, number),
        discount=np.where(n_terminal & (generator.uniform(size=number) < 0.5), 0.0, np.float32(gamma)),
        n_return=generator.normal(0, 2 * scale, number).astype(np.float32).astype(float),
        n_discount=np.where(n_terminal, 0.0, powers[np.minimum(generator.integers(1, 5, number), n) - 1]),
        n_state=generator.integers(0, states, number),
    )


def random_weights(spec: Spec, config: Config, seed: int):
    """Weights with biases that are not zero."""
    generator = np.random.default_rng(seed)
    zeros = q_function(spec, config).init(jax.random.key(0))
    return jax.tree.map(lambda a: jnp.asarray(generator.normal(0, 0.5, a.shape), jnp.float32), zeros)


def on_device(batch):
    """A NamedTuple of NumPy arrays in the package's types."""
    return type(batch)(*(jnp.asarray(f, jnp.float32 if f.dtype.kind == "f" else jnp.int32) for f in batch))


def random_source(spec: Spec, config: Config, seed: int = 0) -> Source:
    """Random weights and demonstrations."""
    demonstrations = random_demonstrations(spec, config.demonstrations, seed, n=config.n_step)
    return Source(random_weights(spec, config, seed), on_device(demonstrations))
