"""What is timed of this package, as `Case.setup` functions."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

from benchmarks.measure import Ready


def compiled(function: Any, *args: Any) -> tuple[Any, float]:
    """A jitted function compiled for arguments, and the seconds that it took."""
    begin = time.perf_counter()
    return function.lower(*args).compile(), time.perf_counter() - begin


def environment(agents: int, steps: int) -> Ready:
    """Slots of the public environment under random actions, automatic reset included."""
    from jrcjax.training import parallel

    parallel.use_all_cores()
    import jax
    import jax.numpy as jnp

    import jrcjax

    env, params = jrcjax.JRCEnv(), jrcjax.paper_params("target")
    space = env.action_space(params)

    def one(params, key):
        def step(carry, i):
            state, total = carry
            act_key, step_key = jax.random.split(jax.random.fold_in(key, i))
            _, state, reward, _, _, _ = env.step(step_key, state, space.sample(act_key), params)
            return (state, total + reward), None

        _, state = env.reset(key, params)
        return jax.lax.scan(step, (state, jnp.float32(0.0)), jnp.arange(steps))[0][1]

    keys = jax.random.split(jax.random.key(0), agents)
    run, seconds = compiled(parallel.over_agents(one, block=512), params, keys)
    return Ready(lambda: jax.block_until_ready(run(params, keys)), seconds)


def learner(name: str, agents: int, steps: int, devices: int | None = None, **settings: Any) -> Ready:
    """A learner's training at the paper's sizes: acting, environment, replay, update, log, exact evaluation.

    The agents go on from one repetition to the next, DDQN and TLwD with a memory that is full from the start. TLwD goes
    without pre-training, so that a step is one of its online steps.
    """
    from jrcjax.training import parallel

    parallel.use_all_cores()
    import jax

    if devices:
        jax.config.update("jax_num_cpu_devices", devices)
    import jax.numpy as jnp

    import jrcjax
    from jrcjax.replay import n_step, packing, prioritised, uniform
    from jrcjax.training.rollout import init_agent, learner_for, run_episodes

    params, hparams = jrcjax.paper_params("source"), jrcjax.HParams()
    episodes = max(steps // params.max_steps_in_episode, 1)
    config = jrcjax.Config(pretraining=0, **settings)
    rule = learner_for(name, params, config)
    source = None
    if rule.needs_source:
        source, _ = jrcjax.train_source(jax.random.key(0), params, hparams, dataclasses.replace(config, episodes=1))

    def agent(source, key):
        new = init_agent(key, hparams, rule, source)
        if name not in ("ddqn", "tlwd"):
            return new
        size, states, actions = config.replay_capacity, params.num_states, params.num_actions
        ids = jax.random.randint(key, (3, size), 0, jnp.array([[states], [actions], [states]]))
        discount = jnp.full(size, hparams.discount)
        one_step = uniform.Transition(ids[0], ids[1], jax.random.normal(key, (size,)), ids[2], discount)
        if name == "ddqn":
            ring = packing.pack(one_step, uniform.layout_of(states, actions))
            return new._replace(learner=new.learner._replace(ring=ring))
        items = n_step.NStepTransition(*one_step, one_step.reward, discount, one_step.next_state)
        replay = prioritised.init(items, prioritised.layout_of(states, actions, size, size, config.n_step))
        return new._replace(learner=new.learner._replace(replay=replay))

    start = parallel.over_agents(agent)
    advance = parallel.over_agents(
        lambda shared, agent: run_episodes(agent, shared[0], episodes, shared[1], hparams, rule), in_place=True
    )
    keys = jax.random.split(jax.random.key(0), parallel.padded(agents))
    start, start_s = compiled(start, source, keys)
    now = [start(source, keys), config.replay_capacity // params.max_steps_in_episode + 1]
    advance, advance_s = compiled(advance, (jnp.int32(now[1]), params), now[0])

    def one_repetition() -> None:
        now[0], log = advance((jnp.int32(now[1]), params), now[0])
        now[1] += episodes
        jax.block_until_ready(log)

    return Ready(one_repetition, start_s + advance_s)


def q_learning(agents: int, steps: int) -> Ready:
    """Tabular Q-learning."""
    return learner("q_learning", agents, steps)


def ddqn(agents: int, steps: int) -> Ready:
    """Double DQN."""
    return learner("ddqn", agents, steps)


def tlwd(agents: int, steps: int) -> Ready:
    """TLwD online."""
    return learner("tlwd", agents, steps)
