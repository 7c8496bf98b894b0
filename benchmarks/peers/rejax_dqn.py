"""rejax's DQN with its double-DQN option, vmapped over seeds as its documentation shows."""

from __future__ import annotations

from typing import Any

from benchmarks.measure import Ready


def setup(agents: int, steps: int) -> Ready:
    """Trains on the paper's source environment at Table I's sizes; evaluation is left out."""
    import jax
    import jax.numpy as jnp
    import rejax  # pyright: ignore[reportMissingImports]
    from flax import linen as nn
    from rejax.buffers import Minibatch  # pyright: ignore[reportMissingImports]
    from rejax.networks import DiscreteQNetwork, EpsilonGreedyPolicy  # pyright: ignore[reportMissingImports]

    import jrcjax
    from benchmarks.ours import compiled
    from benchmarks.peers.flashbax_dqn import random_items
    from jrcjax.adapters.five_tuple import FiveTupleEnv

    hparams, config = jrcjax.HParams(), jrcjax.Config()
    network: Any = EpsilonGreedyPolicy(DiscreteQNetwork)(config.hidden, nn.relu, action_dim=4)  # pyright: ignore
    algorithm = rejax.get_algo("dqn").create(
        env=FiveTupleEnv(),
        env_params=jrcjax.paper_params("source"),
        total_timesteps=steps,
        eval_freq=steps,
        skip_initial_evaluation=True,
        learning_rate=float(hparams.learning_rate),
        gamma=float(hparams.discount),
        buffer_size=config.replay_capacity,
        fill_buffer=0,
        batch_size=config.batch_size,
        target_update_freq=int(hparams.target_period),
        polyak=0.0,
        eps_end=float(hparams.epsilon_end),
    )
    algorithm: Any = algorithm.replace(agent=network, eval_callback=lambda algorithm, state, key: ())

    def start(key):
        """An agent with a full memory."""
        state = algorithm.init_state(key)
        items = random_items(key, config.replay_capacity)
        data = Minibatch(items["obs"], items["action"], items["reward"], items["discount"] < 0, items["next_obs"])
        memory = state.replay_buffer.replace(data=data, full=jnp.asarray(True), index=jnp.int32(0))
        return state.replace(replay_buffer=memory, global_step=jnp.int32(1))

    now = [jax.jit(jax.vmap(start))(jax.random.split(jax.random.key(0), agents))]
    train = jax.jit(jax.vmap(lambda state: algorithm.train(train_state=state)[0]), donate_argnums=0)
    train, seconds = compiled(train, now[0])

    def one_repetition() -> None:
        now[0] = jax.block_until_ready(train(now[0]))

    return Ready(one_repetition, seconds)
