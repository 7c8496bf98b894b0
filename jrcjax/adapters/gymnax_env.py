"""The environment for gymnax 1.0's wrappers and for libraries built on it."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jrcjax.model.environment import EnvState, JRCEnv
from jrcjax.model.params import EnvParams
from jrcjax.types import Bool, Float, Int, Key

try:
    from gymnax.environments.environment import Environment  # pyright: ignore[reportMissingImports]
except ModuleNotFoundError:  # `FiveTupleEnv` works without it
    Environment = object


class GymnaxEnv(JRCEnv, Environment):  # pyright: ignore[reportGeneralTypeIssues]
    """`JRCEnv` as a `gymnax.environments.environment.Environment`, with gymnax's classes of spaces."""

    def get_obs(self, state: EnvState, params: EnvParams | None = None, key: Key | None = None) -> Float:
        """Observation [5] of a state; no key is needed."""
        return super().get_obs(state, params)

    def observe(self, key: Key, state: EnvState, action: Int | int | None, params: EnvParams | None = None) -> Float:
        """Observation [5] of a state; neither the key nor the action that led to it matters."""
        return self.get_obs(state, params)

    def is_terminated(self, state: EnvState, params: EnvParams | None = None) -> Bool:
        """Whether the episode ends here as part of the problem, that is at a time limit which is a terminal state."""
        params = self._given(params)
        return (state.time >= params.max_steps_in_episode) & (params.terminal_time_limit == 1)

    def is_terminal(self, state: EnvState, params: EnvParams | None = None) -> Bool:
        """`is_terminated` by its name before gymnax 1.0."""
        return self.is_terminated(state, params)

    def discount(self, state: EnvState, params: EnvParams | None = None) -> Float:
        """0 in a terminal state and 1 in every other, a scalar."""
        return jnp.where(self.is_terminated(state, params), 0.0, 1.0)

    def action_space(self, params: EnvParams | None = None) -> Any:
        """Data rates, then radar modes, as `gymnax.environments.spaces.Discrete`."""
        from gymnax.environments import spaces  # pyright: ignore[reportMissingImports]

        return spaces.Discrete(super().action_space(params).n)

    def observation_space(self, params: EnvParams | None = None) -> Any:
        """Scaled factor levels, as `gymnax.environments.spaces.Box`."""
        from gymnax.environments import spaces  # pyright: ignore[reportMissingImports]

        box = super().observation_space(params)
        return spaces.Box(box.low, box.high, box.shape, jnp.dtype(box.dtype))

    def state_space(self, params: EnvParams | None = None) -> Any:
        """The fields of `EnvState`, as `gymnax.environments.spaces.Dict`."""
        from gymnax.environments import spaces  # pyright: ignore[reportMissingImports]

        params = self._given(params)
        ids, times = spaces.Discrete(params.num_states), spaces.Discrete(params.max_steps_in_episode + 1)
        return spaces.Dict({"id": ids, "time": times, "first": ids})
