"""Stable-Baselines3's DQN, one process per core; it has no double DQN, which spares it a forward pass."""

from __future__ import annotations

from benchmarks.measure import Ready


def setup(agents: int, steps: int) -> Ready:
    """Trains one agent on the paper's source environment at Table I's sizes, learning in every step."""
    import torch  # pyright: ignore[reportMissingImports]
    from stable_baselines3 import DQN  # pyright: ignore[reportMissingImports]

    import jrcjax
    from jrcjax.adapters.gymnasium_env import GymnasiumEnv

    assert agents == 1
    torch.set_num_threads(1)
    hparams, config = jrcjax.HParams(), jrcjax.Config()
    model = DQN(
        "MlpPolicy",
        GymnasiumEnv(jrcjax.paper_params("source"), seed=0),
        learning_rate=float(hparams.learning_rate),
        buffer_size=config.replay_capacity,
        learning_starts=config.batch_size,
        batch_size=config.batch_size,
        gamma=float(hparams.discount),
        train_freq=1,
        gradient_steps=1,
        target_update_interval=int(hparams.target_period),
        exploration_final_eps=float(hparams.epsilon_end),
        policy_kwargs={"net_arch": list(config.hidden)},
        device="cpu",
    )
    return Ready(lambda: model.learn(steps, reset_num_timesteps=False), 0.0)
