"""Many environments in Stable-Baselines3's vector shape, stepped by one NumPy program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]

from jrcjax.adapters.vector_env import VectorEnv
from jrcjax.model.params import EnvParams

_INFO: tuple[str, ...] = ("event", "packets", "miss_ratio")


class SB3VecEnv(VecEnv):
    """A `VectorEnv` for Stable-Baselines3's learners and wrappers, such as `VecMonitor`."""

    def __init__(self, num_envs: int = 1, params: EnvParams | None = None, seed: int | None = None):
        """Environments before their first episodes; arguments and errors as those of `VectorEnv`."""
        self.venv = VectorEnv(num_envs, params, seed, AutoresetMode.SAME_STEP)
        self.params = self.venv.params
        """The parameters, with NumPy's arrays."""
        self._actions = np.zeros(num_envs, np.int64)
        super().__init__(num_envs, self.venv.single_observation_space, self.venv.single_action_space)

    def reset(self) -> np.ndarray:
        """New episodes; the first of the seeds that `seed` set counts for all environments together."""
        observation, _ = self.venv.reset(seed=self._seeds[0])
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Takes the actions [N] of the next slot."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Observations [N, F], rewards [N], ends of episodes [N] and one dictionary for each environment."""
        observation, reward, terminated, truncated, infos = self.venv.step(self._actions)
        done = terminated | truncated
        numbers = infos
        if done.any():
            final = infos["final_info"]
            numbers = {name: np.where(done, final[name], infos[name]) for name in _INFO}
        columns = [numbers[name].tolist() for name in _INFO]
        of_each = [dict(zip(_INFO, row, strict=True)) for row in zip(*columns, strict=True)]
        for i in np.flatnonzero(done):
            of_each[i] |= {"terminal_observation": infos["final_obs"][i], "TimeLimit.truncated": bool(truncated[i])}
        return observation, reward.astype(np.float32), done, of_each

    def close(self) -> None:
        """Does nothing: there are no processes to end."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environments, which share it; spaces are those of one environment."""
        owner = self if attr_name in ("action_space", "observation_space") else self.venv
        return [getattr(owner, attr_name)] * len(self._indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the environments have no attributes of their own."""
        raise AttributeError(f"{attr_name}: environments of {type(self).__name__} have no attributes of their own")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Refused: the environments have no methods of their own."""
        raise AttributeError(f"{method_name}: environments of {type(self).__name__} have no methods of their own")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No environment is wrapped on its own."""
        return [False] * len(self._indices(indices))

    def _indices(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
