"""A trained agent away from its training: it acts on observations, is evaluated, and hands on what it learned."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from jrcjax.checks import refuse, require_keys
from jrcjax.exact import LongRun
from jrcjax.learners import Source, Spec
from jrcjax.learners.fixed import FIXED, FixedState
from jrcjax.learners.hparams import Config, HParams
from jrcjax.learners.q_function import q_function
from jrcjax.model.params import EnvParams, check_params
from jrcjax.policies import greedy_policy
from jrcjax.training.rollout import AgentState, Log, run_episodes, spec_of
from jrcjax.training.source import check_source, source_of
from jrcjax.types import Float, Key

_GRID = 1e-3  # how far an observation may be from a level, for numbers that went through other formats


class Evaluation(NamedTuple):
    """What a fixed policy earns in an environment."""

    reward: Float
    """Mean reward per slot of each simulated episode, [episodes]."""
    throughput: Float
    """Packets per episode, equation (6), [episodes]."""
    miss_detection: Float
    """P_k, equation (7), [episodes]."""
    exact: LongRun
    """The long-run figures per slot, computed and not simulated."""


@dataclass(frozen=True)
class SavedAgent:
    """One agent after training, as `load_agent` returns it."""

    learner: str
    """Name of its learning rule."""
    params: EnvParams
    """The environment that it was trained in."""
    hparams: HParams
    config: Config
    """Its static settings; an optimiser that had no name is called "optax"."""
    key: Key
    """Its PRNG key."""
    values: dict[str, Any]
    """What it acts by: the network's "weights", or the table "q" [S, A]."""
    point: int
    """Its point in the sweep that it comes from, else 0."""
    seed: int
    """Its seed in that sweep, else 0."""
    provenance: dict[str, Any]
    """Command, time, versions, machine and commit of its training."""

    @cached_property
    def action_values(self) -> Float:
        """Q(s, a), [S, A]."""
        if "q" in self.values:
            return jnp.asarray(self.values["q"])
        return q_function(spec_of(self.params), self.config).table(self.values["weights"])

    def policy(self) -> Float:
        """The greedy policy, [S, A] probabilities, as `jrcjax.exact.evaluate_policy` takes it."""
        return greedy_policy(self.action_values)

    @cached_property
    def _actions(self) -> np.ndarray:
        return np.asarray(self.policy()).argmax(axis=-1)

    def act(
        self, observations: ArrayLike, epsilon: float = 0.0, rng: np.random.Generator | None = None
    ) -> np.ndarray | np.integer:
        """Actions in NumPy, without JAX.

        Args:
          observations: [F] or [N, F] factor levels scaled to [0, 1], as the environments give them.
          epsilon: probability of a uniform action instead of the best.
          rng: random numbers for it; needed where epsilon is positive.

        Returns:
          An integer, or [N] integers.

        Raises:
          ValueError: naming the argument, the value and what is allowed.
        """
        if not 0.0 <= epsilon <= 1.0:
            refuse("epsilon", epsilon, "a probability in [0, 1]")
        actions = self._actions[self._ids_of(observations)]
        if epsilon == 0.0:
            return actions
        if rng is None:
            refuse("rng", "None", "a numpy.random.Generator where epsilon is positive")
        explored = rng.integers(self.params.num_actions, size=actions.shape)
        return np.where(rng.random(actions.shape) < epsilon, explored, actions)[()]

    def _ids_of(self, observations: ArrayLike) -> np.ndarray:
        """State ids of observations."""
        shape = self.params.shape
        array = np.asarray(observations)
        allowed = f"shape [{len(shape)}] or [N, {len(shape)}], levels of {shape} scaled to [0, 1]"
        if array.dtype.kind not in "iuf" or array.ndim not in (1, 2) or array.shape[-1] != len(shape):
            refuse("observations", f"{array.dtype} of shape {array.shape}", allowed)
        scaled = array * np.maximum(np.array(shape) - 1, 1)
        levels = np.round(scaled)
        on_grid = (np.abs(scaled - levels) <= _GRID) & (levels >= 0) & (levels < shape)
        if not on_grid.all():  # NaN is on no grid
            refuse("observations", array[~on_grid][0].item(), allowed)
        return np.asarray(np.ravel_multi_index(tuple(np.moveaxis(levels.astype(int), -1, 0)), shape))

    def evaluate(
        self, params: EnvParams | None = None, *, episodes: int = 100, key: Key | None = None, epsilon: float = 0.0
    ) -> Evaluation:
        """What the greedy policy earns, by simulation and exactly.

        Args:
          params: any environment with the same factors and actions; the one of its training if None.
          episodes: how many to simulate.
          key: decides the simulation; `jax.random.key(0)` if None.
          epsilon: probability of a uniform action, in the simulation and the exact figures alike.

        Raises:
          ValueError: naming the argument, the value and what is allowed.
        """
        params = self.params if params is None else params
        check_params(params)
        _check_fit("params", spec_of(params), spec_of(self.params))
        key = jax.random.key(0) if key is None else key
        require_keys(key, 0, "one key, as jax.random.key returns it")
        if type(episodes) is not int or episodes < 1:
            refuse("episodes", str(episodes), "an integer >= 1")
        if not 0.0 <= epsilon <= 1.0:
            refuse("epsilon", epsilon, "a probability in [0, 1]")
        log = _simulate(key, FixedState(self.policy(), jnp.float32(epsilon)), params, episodes)
        exact = LongRun(log.policy_reward[-1], log.policy_throughput[-1], log.policy_miss_detection[-1])
        return Evaluation(log.reward, log.throughput, log.miss_detection, exact)

    def source(self, config: Config | None = None) -> Source:
        """What "dpr" and "tlwd" take over: the weights, and demonstrations in the environment of its training.

        They are the ones that `jrcjax.train_source` gives for this agent's key.

        Args:
          config: of the transfer run, which decides how many demonstrations there are; the agent's own if None.

        Raises:
          ValueError: for an agent without a network, or with another than `config` has.
        """
        if "weights" not in self.values:
            refuse("learner", self.learner, "one with a network, whose weights can be taken over")
        config = self.config if config is None else config
        source = _hand_on(self.key, self.policy(), self.values["weights"], self.params, self.hparams, config)
        check_source(source, spec_of(self.params), config)
        return source


def _check_fit(field: str, found: Spec, wanted: Spec) -> None:
    if found[:2] != wanted[:2]:
        allowed = f"levels {wanted.shape} and {wanted.num_actions} actions, as the agent has them"
        refuse(field, f"levels {found.shape} and {found.num_actions} actions", allowed)


@functools.partial(jax.jit, static_argnames="episodes")
def _simulate(key: Key, state: FixedState, params: EnvParams, episodes: int) -> Log:
    return run_episodes(AgentState(key, state), 0, episodes, params, HParams(), FIXED)[1]


_hand_on = jax.jit(source_of, static_argnames="config")
