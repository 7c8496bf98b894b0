"""Double DQN and TLwD as one writes them with flashbax, linen and optax: mini-batches of float states under vmap.

Both run on one device, where XLA uses the cores as it sees fit, as jit(vmap(train)) does.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from benchmarks.measure import Ready


class Agent(NamedTuple):
    """What goes on from one step to the next."""

    params: Any
    target: Any
    optimiser: Any
    memory: Any
    window: Any
    obs: Any
    env: Any
    key: Any
    step: Any


def double_dqn(agents: int, steps: int) -> Ready:
    """Uniform replay."""
    return _setup(agents, steps, _uniform)


def tlwd(agents: int, steps: int) -> Ready:
    """Prioritised replay with demonstrations and the loss of four parts, online."""
    return _setup(agents, steps, _prioritised)


def _setup(agents: int, steps: int, method: Any) -> Ready:
    import jax
    import jax.numpy as jnp
    import optax
    from flax import linen as nn

    import jrcjax
    from benchmarks.ours import compiled
    from jrcjax.learners.schedules import epsilon

    env, params = jrcjax.JRCEnv(), jrcjax.paper_params("source")
    hparams, config = jrcjax.HParams(), jrcjax.Config()
    network: Any = nn.Sequential([nn.Dense(24), nn.relu, nn.Dense(24), nn.relu, nn.Dense(env.num_actions)])
    optimiser = optax.adam(float(hparams.learning_rate))
    fill, learn = method(network, optimiser, hparams, config)

    def start(key):
        obs, state = env.reset(key, params)
        weights = network.init(key, obs)
        memory, window = fill(key)
        return Agent(weights, weights, optimiser.init(weights), memory, window, obs, state, key, jnp.int32(0))

    def one_step(agent: Agent, _):
        key, act_key, explore_key, env_key, sample_key = jax.random.split(agent.key, 5)
        greedy = jnp.argmax(network.apply(agent.params, agent.obs))
        explores = jax.random.uniform(explore_key) < epsilon(agent.step, hparams, params.max_steps_in_episode)
        action = jnp.where(explores, jax.random.randint(act_key, (), 0, env.num_actions), greedy)
        next_obs, state, reward, terminated, _, info = env.step(env_key, agent.env, action, params)
        item = {
            "obs": agent.obs,
            "action": action,
            "reward": reward,
            "next_obs": info["final_observation"],
            "discount": jnp.where(terminated, 0.0, hparams.discount),
        }
        agent = learn(agent, item, sample_key)
        due = (agent.step + 1) % hparams.target_period == 0
        target = jax.tree.map(lambda new, old: jnp.where(due, new, old), agent.params, agent.target)
        return agent._replace(target=target, obs=next_obs, env=state, key=key, step=agent.step + 1), None

    now = [jax.jit(jax.vmap(start))(jax.random.split(jax.random.key(0), agents))]
    train = jax.jit(jax.vmap(lambda agent: jax.lax.scan(one_step, agent, length=steps)[0]), donate_argnums=0)
    train, seconds = compiled(train, now[0])

    def one_repetition() -> None:
        now[0] = jax.block_until_ready(train(now[0]))

    return Ready(one_repetition, seconds)


def random_items(key, count: int) -> dict[str, Any]:
    """Transitions to fill a memory with."""
    import jax
    import jax.numpy as jnp

    obs, next_obs = jax.random.bernoulli(key, 0.5, (2, count, 5)).astype(jnp.float32)
    return {
        "obs": obs,
        "action": jax.random.randint(key, (count,), 0, 4),
        "reward": jax.random.normal(key, (count,)),
        "next_obs": next_obs,
        "discount": jnp.full(count, 0.99),
    }


def _uniform(network, optimiser, hparams, config):
    import flashbax as fbx
    import jax
    import jax.numpy as jnp
    import optax

    from jrcjax.learners.value_learning import double_q_value, td_target

    sizes = (config.replay_capacity, 1, config.batch_size)
    buffer = fbx.make_item_buffer(*sizes)
    of_sequences = fbx.make_item_buffer(*sizes, add_sequences=True)

    def fill(key):
        """A full memory."""
        many = random_items(key, config.replay_capacity)
        return of_sequences.add(buffer.init(jax.tree.map(lambda a: a[0], many)), many), ()

    def learn(agent: Agent, item, key):
        memory = buffer.add(agent.memory, item)
        batch = buffer.sample(memory, key).experience

        def loss(weights):
            chosen = jnp.take_along_axis(network.apply(weights, batch["obs"]), batch["action"][:, None], 1)[:, 0]
            online = network.apply(jax.lax.stop_gradient(weights), batch["next_obs"])
            value = jax.vmap(double_q_value)(online, network.apply(agent.target, batch["next_obs"]))
            return jnp.mean(jnp.square(td_target(batch["reward"], batch["discount"], value) - chosen))

        updates, state = optimiser.update(jax.grad(loss)(agent.params), agent.optimiser)
        return agent._replace(params=optax.apply_updates(agent.params, updates), optimiser=state, memory=memory)

    return fill, learn


def _prioritised(network, optimiser, hparams, config):
    import flashbax as fbx
    import jax
    import jax.numpy as jnp
    import optax

    from jrcjax.learners.value_learning import double_q_value, l2_loss, large_margin_loss, td_target

    sizes = (config.replay_capacity, 1, config.batch_size)
    exponent = float(hparams.priority_exponent)
    buffer = fbx.make_prioritised_item_buffer(*sizes, priority_exponent=exponent)
    of_sequences = fbx.make_prioritised_item_buffer(*sizes, add_sequences=True, priority_exponent=exponent)
    n, of_demonstration = config.n_step, jax.vmap(large_margin_loss, in_axes=(0, 0, None))

    def fill(key):
        """A full memory, and the last n transitions, whose returns are still growing."""
        many = random_items(key, config.replay_capacity)
        many |= {
            "n_return": many["reward"],
            "n_discount": many["discount"],
            "n_obs": many["next_obs"],
            "is_demonstration": jnp.arange(config.replay_capacity) < config.demonstrations,
        }
        window = jax.tree.map(lambda a: jnp.zeros((n, *a.shape[1:]), a.dtype), many)
        memory = buffer.init(jax.tree.map(lambda a: a[0], window))
        return of_sequences.add(memory, many), window

    def learn(agent: Agent, item, key):
        new = item | {"n_return": 0.0, "n_discount": 1.0, "n_obs": item["next_obs"], "is_demonstration": False}
        window = jax.tree.map(
            lambda old, x: jnp.concatenate([old[1:], jnp.asarray(x, old.dtype)[None]]), agent.window, new
        )
        goes_on = jnp.arange(n)[::-1] <= agent.env.time
        window |= {
            "n_return": window["n_return"] + jnp.where(goes_on, window["n_discount"] * item["reward"], 0.0),
            "n_discount": jnp.where(goes_on, window["n_discount"] * item["discount"], window["n_discount"]),
            "n_obs": jnp.where(goes_on[:, None], item["next_obs"], window["n_obs"]),
        }
        memory = buffer.add(agent.memory, jax.tree.map(lambda a: a[0], window))
        sample = buffer.sample(memory, key)
        batch = sample.experience
        weights = (config.replay_capacity * sample.probabilities) ** -hparams.importance_start
        weights = weights / weights.max()

        def loss(params):
            q = network.apply(params, batch["obs"])
            chosen = jnp.take_along_axis(q, batch["action"][:, None], 1)[:, 0]
            online = network.apply(jax.lax.stop_gradient(params), batch["next_obs"])
            value = jax.vmap(double_q_value)(online, network.apply(agent.target, batch["next_obs"]))
            td_error = td_target(batch["reward"], batch["discount"], value) - chosen
            n_value = network.apply(agent.target, batch["n_obs"]).max(axis=-1)
            n_error = td_target(batch["n_return"], batch["n_discount"], n_value) - chosen
            is_expert = jax.nn.one_hot(batch["action"], q.shape[1], dtype=bool)
            margin = jnp.where(batch["is_demonstration"], of_demonstration(q, is_expert, hparams.margin), 0.0)
            total = td_error**2 + hparams.n_step_weight * n_error**2 + hparams.margin_weight * margin
            return jnp.mean(weights * total) + hparams.l2_weight * l2_loss(params), td_error

        gradient, td_error = jax.grad(loss, has_aux=True)(agent.params)
        updates, state = optimiser.update(gradient, agent.optimiser)
        constant = jnp.where(batch["is_demonstration"], hparams.demonstration_constant, hparams.priority_constant)
        memory = buffer.set_priorities(memory, sample.indices, jnp.abs(td_error) + constant)
        params = optax.apply_updates(agent.params, updates)
        return agent._replace(params=params, optimiser=state, memory=memory, window=window)

    return fill, learn
