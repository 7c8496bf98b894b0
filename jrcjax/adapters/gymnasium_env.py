"""One environment for Gymnasium and what is built on it, such as Stable-Baselines3."""

from __future__ import annotations

import dataclasses
from typing import Any

import gymnasium  # pyright: ignore[reportMissingImports]
import numpy as np
from gymnasium.envs.registration import EnvSpec  # pyright: ignore[reportMissingImports]
from gymnasium.error import ResetNeeded  # pyright: ignore[reportMissingImports]

from jrcjax.adapters.forks import require_jax
from jrcjax.adapters.slots import paper_slots, slots_of
from jrcjax.model import slot
from jrcjax.model.params import EnvParams

_WORDS_AT_ONCE = 1024  # slots whose random words are drawn together


class GymnasiumEnv(gymnasium.Env):
    """One autonomous vehicle: observations [5] float32 in [0, 1], the paper's actions.

    An episode lasts `max_steps_in_episode` slots and is then truncated, or terminated if the parameters say so.
    `info` holds `event`, `packets` (delivered) and `miss_ratio` (1 in a slot spent on data).

    A step reads tables that JAX computed when the first environment with these parameters was made. It calls no JAX, so
    an environment can be forked and pickled. An environment that tables can't hold (fresh placements, or more than
    2^20 states) runs JAX in each step and is refused in a forked process.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012

    def __init__(self, params: EnvParams | None = None, seed: int | None = None, render_mode: str | None = None):
        """An environment before its first episode.

        Args:
          params: the paper's target environment if None.
          seed: of the first episodes, until `reset` is given one.
          render_mode: "rgb_array" if `render` is to draw slots, else None.

        Raises:
          ValueError: naming the field, the value and what is allowed.
          RuntimeError: in a process that was forked after JAX had run, unless its parent made such an environment.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: {render_mode!r}; allowed: None, 'rgb_array'")
        self.render_mode = render_mode
        self._slots = paper_slots() if params is None else slots_of(params)
        self.params = self._slots.params
        """The parameters, with NumPy's arrays."""
        self._num_actions = self.params.num_actions
        self._limit = self.params.max_steps_in_episode
        self._terminal = bool(self.params.terminal_time_limit == 1)
        self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (len(self.params.shape),), np.float32)
        self.action_space = gymnasium.spaces.Discrete(self._num_actions)
        self._first_seed = seed
        self._state, self._first, self._time = 0, 0, -1  # no episode yet
        self._last_slot: tuple[list[int], int, int] | None = None  # random words, state, action
        self._words: list[list[int]] = []
        self._spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """What Gymnasium makes the environment from; its `max_episode_steps` are the parameters' slots."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            own = {"params": self.params} if spec.kwargs.get("params") is not None else {}
            spec = dataclasses.replace(spec, max_episode_steps=self._limit, kwargs={**spec.kwargs, **own})
        self._spec = spec

    def _random_words(self) -> list[int]:
        if not self._words:
            shape = (_WORDS_AT_ONCE, slot.NUM_WORDS)
            self._words = self.np_random.integers(2**32, size=shape, dtype=np.uint32)[::-1].tolist()
        return self._words.pop()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """A new episode."""
        if seed is None:
            seed = self._first_seed
        self._first_seed = None
        super().reset(seed=seed, options=options)
        if seed is not None:
            self._words = []
        self._state = self._first = self._slots.first_state(self._random_words())
        self._time, self._last_slot = 0, None
        return self._slots.features(self._state), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One slot.

        Raises:
          ValueError: if the action is none of the action space.
          gymnasium.error.ResetNeeded: before the first `reset`, and after the end of an episode.
        """
        if not 0 <= self._time < self._limit:
            raise ResetNeeded("call reset() first" if self._time < 0 else "the episode is over: call reset()")
        if type(action) is not int or not 0 <= action < self._num_actions:
            action = self._as_int(action)
        words, state = self._random_words(), self._state
        outcome = self._slots.run_one(words, state, action, self._first)
        self._last_slot = words, state, action
        self._state, self._time = outcome.next_state, self._time + 1
        over = self._time == self._limit
        info = {"event": outcome.event, "packets": outcome.packets, "miss_ratio": outcome.miss_ratio}
        observation = self._slots.features(self._state)
        return observation, outcome.reward, over and self._terminal, over and not self._terminal, info

    def _as_int(self, action: Any) -> int:
        if not self.action_space.contains(action):
            raise ValueError(f"action: {action!r}; allowed: an integer from 0 to {self._num_actions - 1}")
        return int(action)

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """A picture of the last slot, or of the surroundings before the first one; [height, width, 3] uint8."""
        if self.render_mode is None:
            return None
        if self._time < 0:
            raise ResetNeeded("call reset() first")
        require_jax("a picture")
        from jrcjax import render  # draws with matplotlib, which nobody else needs

        words, state, action = self._last_slot or (None, self._state, None)
        words = None if words is None else np.asarray(words, np.uint32)
        return render.rgb_array(render.figure_of_words(words, state, action, self.params, self._first))
