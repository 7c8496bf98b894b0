"""PureJaxRL's single-file DQN: environments, memory and learner in one scan, vmapped over agents.

It is written here after the structure that its authors describe, since it is no package and comes without a library: a
flat buffer of flashbax holds time steps and gives pairs of neighbours, the target takes the largest value of the target
network (no Double DQN), and learning and copies of the target network are `cond`s. Sizes are Table I's, so an agent has
one environment and learns in every step; its own defaults are ten environments and an update in every tenth step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from benchmarks.measure import Ready


class Agent(NamedTuple):
    """What goes on from one step to the next."""

    train: Any
    """Network, optimiser and their states."""
    target: Any
    memory: Any
    obs: Any
    env: Any
    key: Any
    step: Any


def setup(agents: int, steps: int) -> Ready:
    """Trains on the paper's source environment, from a full memory."""
    import jax
    import jax.numpy as jnp

    from benchmarks.ours import compiled

    start, one_step = _algorithm()
    now = [jax.jit(jax.vmap(start))(jax.random.split(jax.random.key(0), agents))]
    train = jax.jit(jax.vmap(lambda agent: jax.lax.scan(one_step, agent, jnp.arange(steps))[0]), donate_argnums=0)
    train, seconds = compiled(train, now[0])

    def one_repetition() -> None:
        now[0] = jax.block_until_ready(train(now[0]))

    return Ready(one_repetition, seconds)


def _algorithm() -> tuple[Any, Any]:
    """What makes an agent from a key, and what advances it by one step."""
    import jax
    import jax.numpy as jnp
    import optax
    from flax import linen as nn
    from flax.training.train_state import TrainState

    import jrcjax
    from jrcjax.adapters.five_tuple import FiveTupleEnv
    from jrcjax.learners.schedules import epsilon

    env, params = FiveTupleEnv(), jrcjax.paper_params("source")
    hparams, config = jrcjax.HParams(), jrcjax.Config()
    layers = [layer for width in config.hidden for layer in (nn.Dense(width), nn.relu)]
    network: Any = nn.Sequential([*layers, nn.Dense(params.num_actions)])
    buffer, full_memory = _memory(config)

    def start(key) -> Agent:
        obs, state = env.reset(key, params)
        optimiser = optax.adam(float(hparams.learning_rate))
        train = TrainState.create(apply_fn=network.apply, params=network.init(key, obs), tx=optimiser)
        return Agent(train, train.params, full_memory(key), obs, state, key, jnp.int32(0))

    def learn(agent: Agent, key) -> Agent:
        batch = buffer.sample(agent.memory, key).experience
        now, then = batch.first, batch.second
        largest = network.apply(agent.target, then["obs"]).max(axis=-1)
        target = now["reward"] + (1.0 - now["done"]) * hparams.discount * largest

        def loss(weights):
            values = network.apply(weights, now["obs"])
            return jnp.mean(jnp.square(jnp.take_along_axis(values, now["action"][:, None], 1)[:, 0] - target))

        return agent._replace(train=agent.train.apply_gradients(grads=jax.grad(loss)(agent.train.params)))

    def one_step(agent: Agent, _) -> tuple[Agent, None]:
        key, act_key, explore_key, env_key, sample_key = jax.random.split(agent.key, 5)
        greedy = jnp.argmax(network.apply(agent.train.params, agent.obs))
        explores = jax.random.uniform(explore_key) < epsilon(agent.step, hparams, params.max_steps_in_episode)
        action = jnp.where(explores, jax.random.randint(act_key, (), 0, params.num_actions), greedy)
        obs, state, reward, done, _ = env.step(env_key, agent.env, action, params)
        item = {"obs": agent.obs, "action": action, "reward": reward, "done": done.astype(jnp.float32)}
        memory = buffer.add(agent.memory, jax.tree.map(lambda a: a[None], item))
        agent = agent._replace(memory=memory, obs=obs, env=state, key=key, step=agent.step + 1)
        agent = jax.lax.cond(buffer.can_sample(memory), learn, lambda agent, key: agent, agent, sample_key)
        due = agent.step % hparams.target_period == 0
        target = jax.lax.cond(due, lambda agent: agent.train.params, lambda agent: agent.target, agent)
        return agent._replace(target=target), None

    return start, one_step


def _memory(config: Any) -> tuple[Any, Any]:
    """A flat buffer for one environment, and what makes one that is full from a key."""
    import flashbax as fbx
    import jax
    import jax.numpy as jnp

    from benchmarks.peers.flashbax_dqn import random_items

    buffer = fbx.make_flat_buffer(config.replay_capacity, config.batch_size, config.batch_size, add_batch_size=1)

    def full(key):
        items = random_items(key, config.replay_capacity)
        steps = {name: items[name] for name in ("obs", "action", "reward")}
        steps["done"] = jnp.zeros(config.replay_capacity)
        empty = buffer.init(jax.tree.map(lambda a: a[0], steps))
        return empty.replace(experience=jax.tree.map(lambda a: a[None], steps), is_full=jnp.asarray(True))

    return buffer, full
