# %% [markdown]
"""A tour of jrcjax: an environment, its exact policy, 64 agents in seconds, a sweep, a figure.

As a notebook: `jupytext --to notebook examples/tour.py`, or open this file with Jupytext in Jupyter.
"""

# %%
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from rich.progress import Progress

import jrcjax

params = jrcjax.paper_params("target")
print(params.num_states, "states,", params.num_actions, "actions")

# %% [markdown]
# ## The exact optimum, and what throughput costs

# %%
best = jrcjax.exact.optimal_policy(params)
optimum = jrcjax.exact.evaluate_policy(params, best)
print(f"reward {optimum.reward:.2f}, {optimum.throughput:.2f} packets, {optimum.miss_detection:.0%} missed, per slot")

front = jrcjax.front.front(params)
figure, axes = plt.subplots()
axes.plot(front.throughput, front.miss_detection, label="front")
axes.plot(optimum.throughput, optimum.miss_detection, "o", label="optimum of the reward")
axes.set(xlabel="packets per slot", ylabel="miss detection")
axes.legend()

# %% [markdown]
# ## 64 agents
#
# Rich's progress bar also works in Jupyter.

# %%
EPISODES, AGENTS = 60, 64
keys = jax.random.split(jax.random.key(0), AGENTS)
with Progress() as progress:
    task = progress.add_task("Double DQN", total=EPISODES)
    agents, log = jrcjax.train_in_chunks(
        keys,
        params,
        learner="ddqn",
        config=jrcjax.Config(episodes=EPISODES),
        on_progress=lambda episodes, _: progress.update(task, completed=episodes),
    )

# %%
curves = np.asarray(log.policy_reward)  # [agents, episodes]
figure, axes = plt.subplots()
axes.fill_between(np.arange(EPISODES), *np.quantile(curves, (0.1, 0.9), axis=0), alpha=0.3, label="8 of 10 agents")
axes.plot(np.median(curves, axis=0), label="median")
axes.axhline(float(optimum.reward), color="black", linestyle="--", label="optimum")
axes.set(xlabel="episode", ylabel="exact reward per slot")
axes.legend()

# %% [markdown]
# ## A sweep
#
# Every number of an environment may be an axis.


# %%
def optimum_at(fast):
    """The optimum with an event probability at high speed of `fast`."""
    speed = params.speed.replace(event_probability=params.speed.event_probability.at[1].set(fast))
    changed = params.replace(speed=speed)
    return jrcjax.exact.evaluate_policy(changed, jrcjax.exact.optimal_policy(changed))


probabilities = jnp.linspace(0.1, 0.9, 9)
runs = jax.vmap(optimum_at)(probabilities)
figure, axes = plt.subplots()
axes.plot(probabilities, runs.reward)
axes.set(xlabel="p_1^v", ylabel="optimal reward per slot")
