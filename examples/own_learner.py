"""A learner of your own: expected SARSA with Boltzmann exploration, trained like those of the package.

A learner is a few pure functions on one agent's state (`jrcjax.learners.Learner`); a function that makes one for a
problem's shapes goes wherever a learner's name does.

    .venv/bin/python examples/own_learner.py
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

import jrcjax
from jrcjax import rng
from jrcjax.exact import greedy_policy
from jrcjax.learners import Learner
from jrcjax.model.states import num_states

TEMPERATURE = 30.0  # in units of reward: smaller differences between actions hardly count


class Table(NamedTuple):
    """One agent's state: action values and how often each was updated."""

    q: jax.Array  # [S, A]
    visits: jax.Array  # [S, A]


def expected_sarsa(spec, config) -> Learner:
    """Values of the Boltzmann policy that acts."""
    shape = (num_states(spec.shape), spec.num_actions)

    def chances(values):
        return jax.nn.softmax(values / TEMPERATURE)

    def init(key, hparams, source=None):
        return Table(jnp.zeros(shape), jnp.zeros(shape))

    def act(table, state, step, words, hparams):
        below = jnp.cumsum(chances(table.q[state])) <= rng.uniform(words[0])
        return jnp.minimum(below.sum(), spec.num_actions - 1).astype(jnp.int32)

    def update(table, transition, step, words, hparams):
        s, a, reward, following, discount = transition
        visits = table.visits.at[s, a].add(1.0)
        target = reward + discount * (chances(table.q[following]) * table.q[following]).sum()
        return Table(table.q.at[s, a].add(visits[s, a] ** -hparams.step_exponent * (target - table.q[s, a])), visits)

    return Learner(num_words=2, init=init, act=act, update=update, policy=lambda table: greedy_policy(table.q))


if __name__ == "__main__":
    params = jrcjax.paper_params("target")
    config, keys = jrcjax.Config(episodes=200), jax.random.split(jax.random.key(0), 16)
    optimum = jrcjax.exact.evaluate_policy(params, jrcjax.exact.optimal_policy(params)).reward
    for name, learner in (("expected SARSA", expected_sarsa), ("Q-learning", "q_learning")):
        _, log = jrcjax.train_agents(keys, params, learner=learner, config=config)
        print(f"{name}: {log.policy_reward[:, -20:].mean():.2f} of {optimum:.2f} per slot")
