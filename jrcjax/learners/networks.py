"""The Q-network: fully connected, ReLU, one column per state.

Products of many small matrices are most of the work of training, and XLA on a CPU is far from equally fast at all of
them. Columns instead of rows, and the derivative below instead of the automatic one, take the fast forms; the values
are the same up to rounding. `benchmarks/README.md` has the gains.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from flax import linen as nn

from jrcjax.types import Float, Int

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


_AXES = {"in_axis": 1, "out_axis": 0}  # of a kernel [out, in]
_INITIALISERS = (
    nn.initializers.lecun_normal(**_AXES),
    nn.initializers.glorot_uniform(**_AXES),
    nn.initializers.he_normal(**_AXES),
)  # in the order of jrcjax.readings.Initialiser


def kernel_initialiser(choice: Int | int) -> Callable:
    """The initialiser of kernels [out, in] of that number in `Initialiser`; it may be traced."""

    def init(key, shape, dtype=jnp.float32):
        branches = [functools.partial(each, shape=shape, dtype=dtype) for each in _INITIALISERS]
        return jax.lax.switch(choice, branches, key)

    return init


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
    kernel_init: Callable = _INITIALISERS[0]

    @nn.compact
    def __call__(self, features: Float) -> Float:
        """[F, S] to [A, S]."""
        x = features
        for width in self.hidden:
            x = ColumnDense(width, True, self.kernel_init)(x)
        return ColumnDense(self.num_actions, False, self.kernel_init)(x)
