"""Training in the background, whose curves the page asks for while they come."""

from __future__ import annotations

import threading
from typing import Any

import jax

import jrcjax
from jrcjax.checks import refuse
from jrcjax.model.params import EnvParams

LEARNERS = ("ddqn", "q_learning", "round_robin")
"""Those that need no source agent."""
_MOST = {"seeds": 64, "episodes": 1000}


class Training:
    """At most one at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._curves: dict[str, list[float]] = {}
        self._error = ""
        self._is_stopped = False

    def start(self, params: EnvParams, learners: list[str], seeds: int, episodes: int) -> None:
        """Starts training.

        Raises:
          ValueError: naming the field, the value and what is allowed.
        """
        for name, value in {"seeds": seeds, "episodes": episodes}.items():
            if type(value) is not int or not 1 <= value <= _MOST[name]:
                refuse(name, str(value), f"an int from 1 to {_MOST[name]}")
        if not learners or not set(learners) <= set(LEARNERS):
            refuse("learners", ", ".join(learners), f"some of {', '.join(LEARNERS)}")
        with self._lock:
            if self._thread is not None and self._thread.is_alive():
                refuse("train", "while agents train", "one training at a time")
            self._curves, self._error = {name: [] for name in learners}, ""
            self._thread = threading.Thread(target=self._run, args=(params, learners, seeds, episodes), daemon=True)
            self._thread.start()

    def _run(self, params: EnvParams, learners: list[str], seeds: int, episodes: int) -> None:
        keys, config = jax.random.split(jax.random.key(0), seeds), jrcjax.Config(episodes=episodes)
        try:
            for name in learners:

                def told(_: int, log: jrcjax.Log, name: str = name) -> None:
                    if self._is_stopped:
                        raise InterruptedError("training was stopped")
                    self._curves[name] += log.policy_reward.mean(axis=0).tolist()

                chunk = max(1, episodes // 20)
                jrcjax.train_in_chunks(keys, params, learner=name, config=config, on_progress=told, chunk=chunk)
        except Exception as error:  # shown on the page, whose button it answers
            self._error = str(error)

    def stop(self) -> None:
        """Ends training after the chunk of episodes in the making."""
        self._is_stopped = True
        if self._thread is not None:
            self._thread.join()

    def progress(self) -> dict[str, Any]:
        """Mean exact reward of the greedy policies by episode, so far."""
        running = self._thread is not None and self._thread.is_alive()
        return {"curves": self._curves, "running": running, "error": self._error}
