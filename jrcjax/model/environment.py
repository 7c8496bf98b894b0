"""The environment in gymnax 1.0's shape: pure functions of (key, state, action, params)."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Bool, Float, Int

from jrcjax.checks import require, require_keys, require_type
from jrcjax.compiled import compiled
from jrcjax.model import slot, states
from jrcjax.model.params import EnvParams, check_params
from jrcjax.model.presets import paper_params
from jrcjax.model.spaces import Box, Discrete
from jrcjax.types import Key

_ONE_KEY = "one key, as jax.random.key returns it; use vmap for several"


@struct.dataclass
class EnvState:
    """Where an episode is; scalars, or arrays of one shape for several episodes."""

    id: Int[Array, ...]
    """State id."""
    time: Int[Array, ...]
    """Slots since the episode began."""
    first: Int[Array, ...]
    """Id of the episode's first state, for the reading `reward_state`."""


class JRCEnv:
    """Joint radar-communications of one autonomous vehicle.

    Observations are the five factor levels (c, r, w, v, m), each scaled to [0, 1], [5] float32. Actions are the data
    rates in ascending order, then the radar modes; in the paper low rate, high rate, long range, short range.
    """

    def __init__(self, default_params: EnvParams | None = None):
        """Args: default_params: used where a method gets none; the paper's target environment if None."""
        if default_params is not None:
            check_params(default_params)
        self._default_params = default_params

    def _given(self, params: EnvParams | None) -> EnvParams:
        """The parameters, or the default ones if there are none."""
        params = self.default_params if params is None else params
        require_type("params", params, EnvParams)
        return params

    def _run(self, program: Any, *arguments: Any) -> Any:
        """Runs a compiled function of environments; for a subclass, whose attributes may change, uncompiled."""
        return program(_PLAIN, *arguments) if type(self) is JRCEnv else program.__wrapped__(self, *arguments)

    @property
    def name(self) -> str:
        """The environment's name."""
        return "JRC"

    @property
    def default_params(self) -> EnvParams:
        """Parameters used where none are given."""
        if self._default_params is None:
            self._default_params = paper_params("target")
        return self._default_params

    @property
    def num_actions(self) -> int:
        """L data rates plus K radar modes of the default parameters."""
        return self.default_params.num_actions

    @property
    def num_states(self) -> int:
        """Number of states of the default parameters."""
        return self.default_params.num_states

    def action_space(self, params: EnvParams | None = None) -> Discrete:
        """Data rates, then radar modes."""
        return Discrete(self._given(params).num_actions)

    def observation_space(self, params: EnvParams | None = None) -> Box:
        """Scaled factor levels."""
        return Box(0.0, 1.0, (len(self._given(params).shape),))

    def get_obs(self, state: EnvState, params: EnvParams | None = None) -> Float[Array, " F"]:
        """Observation of a state, [5]."""
        return states.features_of(state.id, self._given(params).shape)

    def reset_env(self, key: Key, params: EnvParams) -> tuple[Float[Array, " F"], EnvState]:
        """Observation and state at the start of an episode."""
        require_type("params", params, EnvParams)
        require_keys(key, 0, _ONE_KEY)
        return self._run(_reset, key, params)

    def reset(self, key: Key, params: EnvParams | None = None) -> tuple[Float[Array, " F"], EnvState]:
        """Observation and state at the start of an episode."""
        return self.reset_env(key, self._given(params))

    def step_env(
        self, key: Key, state: EnvState, action: Int[Array, ""] | int, params: EnvParams
    ) -> tuple[Float[Array, " F"], EnvState, Float[Array, ""], Bool[Array, ""], dict[str, Any]]:
        """One slot without reset: (obs, state, reward, terminated, info)."""
        _check_step(key, state, action, params)
        return self._run(_step, key, state, jnp.asarray(action, jnp.int32), params)

    def is_truncated(self, state: EnvState, params: EnvParams) -> Bool[Array, ""]:
        """Whether the time limit cuts the episode here, without being part of the problem."""
        return (state.time >= params.max_steps_in_episode) & (params.terminal_time_limit == 0)

    def step(
        self, key: Key, state: EnvState, action: Int[Array, ""] | int, params: EnvParams | None = None
    ) -> tuple[Float[Array, " F"], EnvState, Float[Array, ""], Bool[Array, ""], Bool[Array, ""], dict[str, Any]]:
        """One slot with automatic reset.

        Returns:
          (obs, state, reward, terminated, truncated, info); after the last slot of an episode `obs` and `state` are
          those of the next episode, and `info["final_observation"]` is the one that the slot led to. `info` also holds
          `event`, `packets` (delivered) and `miss_ratio` (1 in a slot spent on data).
        """
        params = self._given(params)
        _check_step(key, state, action, params)
        return self._run(_step_with_reset, key, state, jnp.asarray(action, jnp.int32), params)


_PLAIN = JRCEnv()


@compiled(static_argnums=0)
def _reset(env: JRCEnv, key: Key, params: EnvParams):
    words = jax.random.bits(key, (slot.NUM_WORDS,), jnp.uint32)
    first = slot.initial_state(words, params)
    state = EnvState(first, jnp.int32(0), first)
    return env.get_obs(state, params), state


@compiled(static_argnums=0)
def _step(env: JRCEnv, key: Key, state: EnvState, action: Int[Array, ""], params: EnvParams):
    words = jax.random.bits(key, (slot.NUM_WORDS,), jnp.uint32)
    outcome = slot.run_slot(words, state.id, action, params, state.first)
    new = EnvState(outcome.next_state, state.time + 1, state.first)
    info = {"event": outcome.event, "packets": outcome.packets, "miss_ratio": outcome.miss_ratio}
    terminated = (new.time >= params.max_steps_in_episode) & (params.terminal_time_limit == 1)
    return env.get_obs(new, params), new, outcome.reward, terminated, info


@compiled(static_argnums=0)
def _step_with_reset(env: JRCEnv, key: Key, state: EnvState, action: Int[Array, ""], params: EnvParams):
    step_key, reset_key = jax.random.split(key)
    obs, new, reward, terminated, info = env.step_env(step_key, state, action, params)
    truncated = env.is_truncated(new, params)
    first_obs, first = env.reset_env(reset_key, params)
    done = terminated | truncated
    info = {**info, "final_observation": obs, "terminated": terminated, "truncated": truncated}
    obs, new = jax.tree.map(lambda a, b: jnp.where(done, a, b), (first_obs, first), (obs, new))
    return obs, new, reward, terminated, truncated, info


def _check_step(key: Key, state: EnvState, action: Int[Array, ""] | int, params: EnvParams) -> None:
    require_type("params", params, EnvParams)
    require_type("state", state, EnvState)
    require_keys(key, 0, _ONE_KEY)
    in_range = lambda a: (a >= 0) & (a < params.num_actions)  # noqa: E731
    require("action", action, (), in_range, f"an integer from 0 to {params.num_actions - 1}", kinds="iu")
