"""The environment for libraries that unpack five values from `step`, such as rejax and PureJaxRL."""

from __future__ import annotations

from typing import Any

from jrcjax.adapters.gymnax_env import GymnaxEnv
from jrcjax.model.environment import EnvState
from jrcjax.model.params import EnvParams
from jrcjax.types import Bool, Float, Int, Key


class FiveTupleEnv(GymnaxEnv):
    """`GymnaxEnv` whose `step` returns (obs, state, reward, done, info), as gymnax did before version 1.0.

    `done` is true after the last slot of an episode, whether it terminated or was cut off; `info` tells which. With
    gymnax 1.0 or later, `gymnax.wrappers.compat.LegacyStepAPIWrapper(GymnaxEnv())` does the same.
    """

    def step(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, key: Key, state: EnvState, action: Int | int, params: EnvParams | None = None
    ) -> tuple[Float, EnvState, Float, Bool, dict[str, Any]]:
        """One slot with automatic reset; see `JRCEnv.step`."""
        obs, state, reward, terminated, truncated, info = super().step(key, state, action, params)
        return obs, state, reward, terminated | truncated, info
