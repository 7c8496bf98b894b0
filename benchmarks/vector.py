"""Claim: one environment stepped by hand costs at most 15 us a step, and 1024 of them in a vector a fifth of 1 us each.

Random actions in the paper's target environment for Gymnasium's shapes; Stable-Baselines3's learners train with the
paper's network, on one environment and on a vector. Every case runs in a process of its own, one repetition of each in
turn. The column of agents counts environments here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.measure import Case, Ready, Result, in_turns, print_table
from jrcjax.model.params import EnvParams
from jrcjax.training import parallel

LIMITS = {"gymnasium": 15.0, "vector": 0.2}
"""us per environment and step that the claim allows."""


def _actions(params: EnvParams, shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(0).integers(params.num_actions, size=shape)


def gymnasium(agents: int, steps: int) -> Ready:
    """`GymnasiumEnv`, reset at the end of each episode."""
    from jrcjax.adapters import GymnasiumEnv

    parallel.keep_compiled()
    assert agents == 1
    env = GymnasiumEnv(seed=0)
    env.reset()
    actions = _actions(env.params, (steps,)).tolist()

    def advance() -> None:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return Ready(advance, 0.0)


def _vector(agents: int, steps: int, mode: str) -> Ready:
    import gymnasium  # pyright: ignore[reportMissingImports]

    import jrcjax.adapters  # registers the environments

    parallel.keep_compiled()
    env = gymnasium.make_vec("jrcjax/JRC-target-v0", num_envs=agents, vectorization_mode=mode)
    env.reset(seed=0)
    actions = _actions(jrcjax.paper_params("target"), (steps, agents))

    def advance() -> None:
        for action in actions:
            env.step(action)

    return Ready(advance, 0.0)


def vector(agents: int, steps: int) -> Ready:
    """`VectorEnv`, as `gymnasium.make_vec` makes it by default."""
    return _vector(agents, steps, "vector_entry_point")


def synchronous(agents: int, steps: int) -> Ready:
    """Gymnasium's own vector of single environments in one process."""
    return _vector(agents, steps, "sync")


def _learner(name: str, agents: int, steps: int, **settings: Any) -> Ready:
    import stable_baselines3  # pyright: ignore[reportMissingImports]
    import torch  # pyright: ignore[reportMissingImports]

    from jrcjax.adapters import GymnasiumEnv, SB3VecEnv

    parallel.keep_compiled()
    torch.set_num_threads(1)
    env = GymnasiumEnv(seed=0) if agents == 1 else SB3VecEnv(agents, seed=0)
    kind = getattr(stable_baselines3, name)
    model = kind("MlpPolicy", env, device="cpu", policy_kwargs={"net_arch": [24, 24]}, **settings)
    return Ready(lambda: model.learn(agents * steps, reset_num_timesteps=False), 0.0)


def dqn(agents: int, steps: int) -> Ready:
    """Stable-Baselines3's DQN, an update for every four steps."""
    return _learner("DQN", agents, steps, train_freq=max(4 // agents, 1), gradient_steps=max(agents // 4, 1))


def ppo(agents: int, steps: int) -> Ready:
    """Stable-Baselines3's PPO, 2048 steps for each update."""
    return _learner("PPO", agents, steps, n_steps=2048 // agents)


def cases(quick: bool) -> list[Case]:
    """What is timed; a quick run takes fewer steps."""
    few = 4 if quick else 1
    return [
        Case("gymnasium", gymnasium, 1, 12_000 // few),
        Case("vector", vector, 1024, 600 // few),
        Case("make_vec_sync", synchronous, 64, 200 // few),
        Case("sb3_dqn", dqn, 1, 4_000 // few),
        Case("sb3_dqn_vector", dqn, 16, 400 // few),
        Case("sb3_ppo", ppo, 1, 2048),
        Case("sb3_ppo_vector", ppo, 64, 32),
    ]


def run(quick: bool) -> list[Result]:
    """Measures all cases side by side, prints a table and compares with the claim."""
    results, failed = in_turns(cases(quick), 3 if quick else 7)
    print_table(results, failed)
    for result in results:
        if result.case in LIMITS:
            held = "holds" if result.us_per_agent_step <= LIMITS[result.case] else "DOES NOT HOLD"
            print(f"at most {LIMITS[result.case]:g} us for {result.case}: {held} ({result.us_per_agent_step:.3f} us)")
    return results
