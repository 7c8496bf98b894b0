"""Many environments in Gymnasium's vector shape, stepped by one NumPy program."""

from __future__ import annotations

from typing import Any

import gymnasium  # pyright: ignore[reportMissingImports]
import numpy as np
from gymnasium.error import ResetNeeded  # pyright: ignore[reportMissingImports]
from gymnasium.vector import AutoresetMode  # pyright: ignore[reportMissingImports]
from gymnasium.vector.utils import batch_space  # pyright: ignore[reportMissingImports]

from jrcjax.adapters.slots import paper_slots, slots_of
from jrcjax.checks import refuse, require_integer
from jrcjax.model import slot
from jrcjax.model.params import EnvParams

_INFO = ("event", "packets", "miss_ratio")


class VectorEnv(gymnasium.vector.VectorEnv):
    """N independent vehicles: observations [N, 5] float32, actions, rewards and ends of episodes [N].

    An environment behaves as a `GymnasiumEnv`. `infos` holds `event`, `packets` and `miss_ratio`, [N] each, and for
    each of them a mask, such as `_event`: true where the environment took a slot in this step.
    """

    def __init__(
        self,
        num_envs: int = 1,
        params: EnvParams | None = None,
        seed: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
    ):
        """Environments before their first episodes.

        Args:
          num_envs: N.
          params: of all environments; the paper's target environment if None.
          seed: of the first episodes, until `reset` is given one.
          autoreset_mode: when the environments whose episode ended begin the next one, as for Gymnasium's own vectors:
            in the next step, which then takes no action ("NextStep"); in the same step, with the last observation in
            `infos["final_obs"]` ("SameStep"); or when `reset` says so ("Disabled").
          max_episode_steps: cuts episodes off that the parameters would let last longer.

        Raises:
          ValueError: naming the field, the value and what is allowed.
          RuntimeError: in a process that was forked after JAX had run, unless its parent made such an environment.
        """
        require_integer("num_envs", num_envs, 1)
        self.num_envs = num_envs
        self._slots = paper_slots() if params is None else slots_of(params)
        self.params = self._slots.params
        """The parameters, with NumPy's arrays."""
        limit = self.params.max_steps_in_episode
        self._terminal = bool(self.params.terminal_time_limit == 1)
        if max_episode_steps is not None:
            require_integer("max_episode_steps", max_episode_steps, 1)
            self._terminal = self._terminal and limit <= max_episode_steps
            limit = min(limit, max_episode_steps)
        self._limit = limit
        self._mode = AutoresetMode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self._mode}
        self.single_observation_space = gymnasium.spaces.Box(0.0, 1.0, (len(self.params.shape),), np.float32)
        self.single_action_space = gymnasium.spaces.Discrete(self.params.num_actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._first_seed = seed
        self._state = self._first = np.zeros(num_envs, np.int64)
        self._time = np.full(num_envs, -1)  # no episode yet

    def _random_words(self) -> np.ndarray:
        return self.np_random.integers(2**32, size=(slot.NUM_WORDS, self.num_envs), dtype=np.uint32)

    def _begin(self, where: np.ndarray) -> None:
        """New episodes of the environments in a mask [N]."""
        first = self._slots.first_states(self._random_words())
        self._first, self._state = np.where(where, first, self._first), np.where(where, first, self._state)
        self._time = np.where(where, 0, self._time)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """New episodes, of all environments or of those in the mask `options["reset_mask"]`, [N] bool."""
        if seed is None:
            seed = self._first_seed
        self._first_seed = None
        super().reset(seed=seed, options=options)
        where = (options or {}).get("reset_mask", np.ones(self.num_envs, bool))
        if not isinstance(where, np.ndarray) or where.dtype != bool or where.shape != (self.num_envs,):
            refuse("reset_mask", str(where), f"an array of {self.num_envs} booleans")
        self._begin(where)
        return self._slots.features(self._state), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One slot of every environment, but for those that only begin an episode.

        Raises:
          ValueError: if an action is none of the action space.
          gymnasium.error.ResetNeeded: before the first `reset`; with autoreset disabled, after the end of an episode.
        """
        over = self._time == self._limit
        if (self._time < 0).any() or (self._mode == AutoresetMode.DISABLED and over.any()):
            raise ResetNeeded("call reset() first, for every environment without an episode")
        outcome = self._slots.run(self._random_words(), self._state, self._checked(actions), self._first)
        self._state, self._time = outcome.next_state, self._time + 1
        reward = outcome.reward.astype(np.float64)
        infos = {name: getattr(outcome, name) for name in _INFO}
        if over.any():
            self._begin(over)
            reward *= ~over
        ends = self._time == self._limit
        observation = self._slots.features(self._state)
        if ends.any() and self._mode == AutoresetMode.SAME_STEP:
            infos = _masked(infos, ~ends) | _final(observation, infos, ends)
            self._begin(ends)
            observation = self._slots.features(self._state)
        else:
            infos = _masked(infos, ~over)
        never = np.zeros(self.num_envs, bool)
        terminated, truncated = (ends, never) if self._terminal else (never, ends)
        return observation, reward, terminated, truncated, infos

    def _checked(self, actions: np.ndarray) -> np.ndarray:
        given, count = np.asarray(actions), self.params.num_actions
        if given.shape != (self.num_envs,) or given.dtype.kind not in "iu" or given.min() < 0 or given.max() >= count:
            refuse("actions", str(given), f"{self.num_envs} integers from 0 to {count - 1}")
        return given.astype(np.int64, copy=False)


def _masked(infos: dict[str, np.ndarray], where: np.ndarray) -> dict[str, Any]:
    """Numbers [N] and their masks [N]; elsewhere they are 0, as in Gymnasium's own vectors."""
    numbers = infos if where.all() else {name: number * where for name, number in infos.items()}
    return {**numbers, **{f"_{name}": where for name in infos}}


def _final(observation: np.ndarray, infos: dict[str, np.ndarray], ends: np.ndarray) -> dict[str, Any]:
    """What the last slots of episodes led to, where they ended."""
    last = np.full(len(ends), None, object)
    for i in np.flatnonzero(ends):
        last[i] = observation[i]
    return {"final_obs": last, "_final_obs": ends, "final_info": _masked(infos, ends), "_final_info": ends}
