"""The Q-network: fully connected, ReLU, one column per state.

Products of many small matrices are most of the work of training, and XLA on a CPU is far from equally fast at all of
them. Columns instead of rows, and the derivative below instead of the automatic one, take the fast forms; the values
are the same up to rounding. `benchmarks/README.md` has the gains.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn

from jrcjax import rng
from jrcjax.readings import Initialiser
from jrcjax.types import Float, Int, Key

_SHORT = 8  # sums of at most so many products are added up in one loop, which XLA joins with what surrounds it


def product(a: Float, b: Float) -> Float:
    """The matrix product of [n, k] and [k, m], written out for short sums."""
    return _added_up(a, b) if a.shape[1] <= _SHORT else a @ b


def _added_up(a: Float, b: Float) -> Float:
    return sum((a[:, k, None] * b[None, k] for k in range(1, a.shape[1])), a[:, 0, None] * b[None, 0])


@functools.partial(jax.custom_vjp, nondiff_argnums=(3,))
def dense(kernel: Float, bias: Float, x: Float, relu: bool) -> Float:
    """W x + b for columns x, [in, S] to [out, S], rectified if `relu`."""
    y = product(kernel, x) + bias[:, None]
    return jnp.maximum(y, 0.0) if relu else y


def _dense_forward(kernel: Float, bias: Float, x: Float, relu: bool) -> tuple[Float, tuple[Float, Float, Float]]:
    y: Any = dense(kernel, bias, x, relu)
    return y, (kernel, x, y)


def _dense_backward(relu: bool, saved: tuple[Float, Float, Float], gradient: Float) -> tuple[Float, Float, Float]:
    kernel, x, y = saved
    if relu:
        gradient = jnp.where(y > 0, gradient, 0.0)
    # Barriers keep XLA from taking a transposed left operand into its products, which makes them several times slower.
    barrier = jax.lax.optimization_barrier
    if x.shape[0] <= _SHORT:  # the bias is the weight of an input that is always 1; eight columns are faster than six
        size = x.shape[0]
        padding = jnp.zeros((-(size + 1) % 8, x.shape[1]), x.dtype)
        inputs = jnp.concatenate([x, jnp.ones((1, x.shape[1]), x.dtype), padding])
        of_all = gradient @ barrier(inputs.T)
        of_kernel, of_bias = of_all[:, :size], of_all[:, size]
    else:
        of_kernel, of_bias = gradient @ x.T, gradient.sum(axis=1)
    of_x = product(kernel.T, gradient) if kernel.shape[0] <= _SHORT else barrier(kernel.T) @ gradient
    return of_kernel, of_bias, of_x


dense.defvjp(_dense_forward, _dense_backward)


_TRUNCATED_AT = 2.0  # standard deviations
_STD_OF_TRUNCATED = 0.87962566103423978  # of a standard normal variable between -2 and 2


def initial_kernels(keys: Sequence[Key], shapes: Sequence[tuple[int, int]], choice: Int | int = 0) -> list[Float]:
    """Random kernels [out, in], each from its key, by the initialiser of that number in `Initialiser`, maybe traced.

    The values are those of `jax.nn.initializers`. All kernels and all initialisers start from the same uniform numbers,
    so that one loop draws them; a draw for each would take most of the time to compile.
    """
    sizes = [math.prod(shape) for shape in shapes]
    factors = [jnp.asarray(_factors(shape))[:, choice] for shape in shapes]
    of_normal, of_uniform = (rng.repeated([of_layer[i] for of_layer in factors], sizes) for i in range(2))
    share = (rng.bits_of_several(keys, sizes) >> 9).astype(jnp.float32) * jnp.float32(2.0**-23)  # as jax.random.uniform
    edge = jax.lax.erf(jnp.float32(_TRUNCATED_AT / math.sqrt(2)))
    normal = jnp.float32(math.sqrt(2)) * jax.lax.erf_inv(jnp.maximum(-edge, share * (2 * edge) - edge))
    inside = jnp.nextafter(jnp.float32(_TRUNCATED_AT), jnp.float32(0.0))
    normal = jnp.clip(normal, -inside, inside) * of_normal
    uniform = jnp.maximum(-1.0, share * 2.0 - 1.0) * of_uniform
    numbers = jnp.where(choice == Initialiser.GLOROT_UNIFORM, uniform, normal)
    return [part.reshape(shape) for part, shape in zip(jnp.split(numbers, np.cumsum(sizes)[:-1]), shapes, strict=True)]


def _factors(shape: tuple[int, int]) -> np.ndarray:
    """What a standard normal and a uniform variable is multiplied with for each `Initialiser`, [2, 3]."""
    fan_out, fan_in = shape
    variance = np.array([1 / fan_in, 2 / (fan_in + fan_out), 2 / fan_in], np.float32)
    return np.stack([np.sqrt(variance) / np.float32(_STD_OF_TRUNCATED), np.sqrt(3 * variance)])


class ColumnDense(nn.Module):
    """A layer of `dense`."""

    features: int
    relu: bool
    kernel_init: Callable

    @nn.compact
    def __call__(self, x: Float) -> Float:
        """[in, S] to [features, S]."""
        kernel = self.param("kernel", self.kernel_init, (self.features, x.shape[0]))
        bias = self.param("bias", nn.initializers.zeros, (self.features,), jnp.float32)
        return dense(kernel, bias, x, self.relu)


class QNetwork(nn.Module):
    """Action values of states given as columns of features."""

    num_actions: int
    hidden: tuple[int, ...]
    kernel_init: Callable = nn.initializers.zeros  # what draws would be traced at each use; see `QFunction.init`

    @nn.compact
    def __call__(self, features: Float) -> Float:
        """[F, S] to [A, S]."""
        x = features
        for width in self.hidden:
            x = ColumnDense(width, True, self.kernel_init)(x)
        return ColumnDense(self.num_actions, False, self.kernel_init)(x)
