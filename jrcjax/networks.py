"""The Q-network: fully connected, ReLU, one column per state.

Columns instead of rows, because a batched product of weights [out, in] with activations [in, S] runs about
twice as fast in XLA on a CPU as activations [S, in] with weights [in, out].
"""

from __future__ import annotations

from flax import linen as nn

from jrcjax.types import Float


class ColumnDense(nn.Module):
    """W x + b for columns x."""

    features: int

    @nn.compact
    def __call__(self, x: Float) -> Float:
        """[in, S] to [features, S]."""
        kernel = self.param("kernel", nn.initializers.lecun_normal(1, 0), (self.features, x.shape[0]))
        bias = self.param("bias", nn.initializers.zeros, (self.features,))
        return kernel @ x + bias[:, None]


class QNetwork(nn.Module):
    """Action values of states given as columns of features."""

    num_actions: int
    hidden: tuple[int, ...]

    @nn.compact
    def __call__(self, features: Float) -> Float:
        """[F, S] to [A, S]."""
        x = features
        for width in self.hidden:
            x = nn.relu(ColumnDense(width)(x))
        return ColumnDense(self.num_actions)(x)
