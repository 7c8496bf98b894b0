"""The environment for gymnax 1.0's wrappers and for libraries built on it."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jrcjax.model.environment import JRCEnv
from jrcjax.model.params import EnvParams


class GymnaxEnv(JRCEnv):
    """`JRCEnv` with gymnax's own classes of spaces, by which its wrappers tell discrete actions from others."""

    def action_space(self, params: EnvParams | None = None) -> Any:
        """Data rates, then radar modes, as `gymnax.environments.spaces.Discrete`."""
        from gymnax.environments import spaces  # pyright: ignore[reportMissingImports]

        return spaces.Discrete(super().action_space(params).n)

    def observation_space(self, params: EnvParams | None = None) -> Any:
        """Scaled factor levels, as `gymnax.environments.spaces.Box`."""
        from gymnax.environments import spaces  # pyright: ignore[reportMissingImports]

        box = super().observation_space(params)
        return spaces.Box(box.low, box.high, box.shape, jnp.dtype(box.dtype))
