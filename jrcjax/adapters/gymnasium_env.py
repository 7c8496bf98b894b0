"""The environment for Gymnasium and what is built on it, such as Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import gymnasium  # pyright: ignore[reportMissingImports]
import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.model import slot, states
from jrcjax.model.params import EnvParams, check_params
from jrcjax.model.presets import paper_params

_WORDS_AT_ONCE = 1024  # slots whose random words are drawn together


class GymnasiumEnv(gymnasium.Env):
    """One autonomous vehicle: observations [5] float32 in [0, 1], the paper's actions.

    An episode lasts `max_steps_in_episode` slots and is then truncated, or terminated if the parameters say so.
    `info` holds `event`, `packets` (delivered) and `miss_ratio` (1 in a slot spent on data).
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
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: {render_mode!r}; allowed: None, 'rgb_array'")
        self.render_mode = render_mode
        self._params = paper_params("target") if params is None else params
        check_params(self._params)
        shape = self._params.shape
        self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (len(shape),), np.float32)
        self.action_space = gymnasium.spaces.Discrete(self._params.num_actions)
        self._observations = np.array(states.features_of(jnp.arange(states.num_states(shape)), shape))
        self._first_seed = seed
        self._state = self._time = self._next_word = 0
        self._last_slot: tuple[np.ndarray, int, int] | None = None  # random words, state, action
        self._words = np.zeros((0, slot.NUM_WORDS), np.uint32)
        # The parameters are constants of the compiled functions: handing them over costs more than the slot itself.
        self._start = jax.jit(lambda words: slot.initial_state(words, self._params))
        self._run_slot = jax.jit(lambda words, state, action: slot.run_slot(words, state, action, self._params))

    def _random_words(self) -> np.ndarray:
        if self._next_word == len(self._words):
            shape = (_WORDS_AT_ONCE, slot.NUM_WORDS)
            self._words, self._next_word = self.np_random.integers(2**32, size=shape, dtype=np.uint32), 0
        self._next_word += 1
        return self._words[self._next_word - 1]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """A new episode."""
        if seed is None:
            seed, self._first_seed = self._first_seed, None
        super().reset(seed=seed, options=options)
        if seed is not None:
            self._words = self._words[:0]
            self._next_word = 0
        self._state, self._time, self._last_slot = int(self._start(self._random_words())), 0, None
        return self._observations[self._state].copy(), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One slot.

        Raises:
          ValueError: if the action is none of the action space.
        """
        if not self.action_space.contains(action):
            raise ValueError(f"action: {action!r}; allowed: an integer from 0 to {self._params.num_actions - 1}")
        words = self._random_words()
        self._last_slot = words, self._state, int(action)
        outcome = self._run_slot(words, np.int32(self._state), np.int32(action))
        self._state, self._time = int(outcome.next_state), self._time + 1
        over = self._time >= self._params.max_steps_in_episode
        terminal = bool(self._params.terminal_time_limit == 1)
        info = {
            "event": bool(outcome.event),
            "packets": float(outcome.packets),
            "miss_ratio": float(outcome.miss_ratio),
        }
        observation = self._observations[self._state].copy()
        return observation, float(outcome.reward), over and terminal, over and not terminal, info

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """A picture of the last slot, or of the surroundings before the first one; [height, width, 3] uint8."""
        if self.render_mode is None:
            return None
        from jrcjax import render  # draws with matplotlib, which nobody else needs

        words, state, action = self._last_slot or (None, self._state, None)
        return render.rgb_array(render.figure_of_words(words, state, action, self._params))


def paper_env(environment: str = "target", preset: str = "paper", **settings: Any) -> GymnasiumEnv:
    """The paper's source or target environment, as `gymnasium.make` makes it; see `paper_params`."""
    return GymnasiumEnv(paper_params(environment, preset), **settings)
