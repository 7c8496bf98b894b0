"""Stable-Baselines3's DQN beside this package's Double DQN: where the two land in the same environment.

Same network, optimiser, memory, mini-batch, discount, target period and exploration. Stable-Baselines3 has no double
DQN, its loss is Huber's, linear for errors beyond 1, and it clips gradients; both act on rewards of -100. So both
libraries are given all rewards divided by 100 (`--scale 1` leaves them as they are).

The greedy policies of both are evaluated exactly after each episode, without the scale, and averaged over the last
quarter of the episodes. Needs the extra "clients"; a seed takes Stable-Baselines3 about half a minute.

    .venv/bin/python examples/sb3_comparison.py --seeds 5
"""

import dataclasses
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import torch  # pyright: ignore[reportMissingImports]
import tyro
from scipy import stats
from stable_baselines3 import DQN  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.callbacks import BaseCallback  # pyright: ignore[reportMissingImports]

import jrcjax
import jrcjax.training.parallel
from jrcjax.adapters import GymnasiumEnv
from jrcjax.model import states
from jrcjax.types import Float


@dataclass(frozen=True)
class Arguments:
    """Stable-Baselines3's DQN beside Double DQN in the paper's target environment."""

    episodes: int = 100
    """Episodes per seed; exploration falls to 1 % over the first half."""
    seeds: int = 5
    """Agents of each kind."""
    scale: float = 0.01
    """By which all rewards are multiplied while training."""


class Evaluation(BaseCallback):
    """The exact long-run reward of the greedy policy after each episode."""

    def __init__(self, params: jrcjax.EnvParams):
        super().__init__()
        self.rewards: list[float] = []
        self._observations = np.asarray(states.features_of(jnp.arange(params.num_states), params.shape))
        self._reward = jax.jit(lambda actions: reward_of(params, actions))

    def _on_step(self) -> bool:
        if self.locals["dones"][0]:
            actions, _ = self.model.predict(self._observations, deterministic=True)
            self.rewards.append(float(self._reward(actions)))
        return True


def reward_of(params: jrcjax.EnvParams, actions: jax.Array) -> Float:
    """Long-run reward per slot of a deterministic policy [S]."""
    policy = jrcjax.exact.policy_of_actions(actions, params.num_actions)
    return jrcjax.exact.evaluate_policy(params, policy).reward


def train_sb3(
    env: GymnasiumEnv, params: jrcjax.EnvParams, hparams: jrcjax.HParams, config: jrcjax.Config, seed: int
) -> list[float]:
    """One agent's rewards, [episodes]."""
    slots = config.episodes * params.max_steps_in_episode
    model = DQN(
        "MlpPolicy",
        env,
        learning_rate=float(hparams.learning_rate),
        buffer_size=config.replay_capacity,
        learning_starts=config.batch_size,
        batch_size=config.batch_size,
        gamma=float(hparams.discount),
        train_freq=1,
        target_update_interval=int(hparams.target_period),
        exploration_fraction=float(hparams.epsilon_slots) / slots,
        exploration_final_eps=float(hparams.epsilon_end),
        policy_kwargs={"net_arch": list(config.hidden)},
        seed=seed,
        device="cpu",
    )
    evaluation = Evaluation(params)
    model.learn(slots, callback=evaluation)
    return evaluation.rewards


def train_both(params: jrcjax.EnvParams, episodes: int, seeds: int, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Exact rewards per slot of Stable-Baselines3's agents and of ours, [seeds, episodes] each, without the scale."""
    scaled = dataclasses.replace(params, reward_weights=scale * params.reward_weights)
    env = GymnasiumEnv(scaled)
    hparams = jrcjax.HParams(epsilon_slots=jnp.float32(episodes * params.max_steps_in_episode / 2))
    config = jrcjax.Config(episodes=episodes)
    torch.set_num_threads(1)  # more only wait for each other in networks as small as these
    theirs = np.array([train_sb3(env, params, hparams, config, seed) for seed in range(seeds)])
    keys = jax.random.split(jax.random.key(0), seeds)
    _, log = jrcjax.train_agents(keys, scaled, hparams, learner="ddqn", config=config)
    return theirs, np.asarray(log.policy_reward) / scale


def main(args: list[str] | None = None) -> None:
    """Trains both and prints means with 95 % intervals over seeds."""
    given = tyro.cli(Arguments, args=args)
    params = jrcjax.paper_params("target")
    optimum = float(jrcjax.exact.evaluate_policy(params, jrcjax.exact.optimal_policy(params)).reward)
    rewards = train_both(params, given.episodes, given.seeds, given.scale)
    quarter = max(1, given.episodes // 4)
    late = [of_agents[:, -quarter:].mean(axis=1) for of_agents in rewards]
    print(f"reward per slot in the last {quarter} of {given.episodes} episodes; optimum {optimum:.2f}")
    for name, rewards in zip(("Stable-Baselines3, DQN", "jrcjax, Double DQN"), late, strict=True):
        low, high = stats.ttest_1samp(rewards, 0.0).confidence_interval()
        print(f"{name}: {rewards.mean():.2f} ({low:.2f} to {high:.2f}), {given.seeds} seeds")
    low, high = stats.ttest_ind(*late, equal_var=False).confidence_interval()
    print(f"difference: {late[0].mean() - late[1].mean():.2f} ({low:.2f} to {high:.2f})")


if __name__ == "__main__":
    jrcjax.training.parallel.use_all_cores()
    main()
