"""Training chunk by chunk: what is told, and that nothing else changes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny import tiny_params

import jrcjax
from jrcjax.learners import Source


def test_every_chunk_is_told_and_the_whole_is_that_of_one_go():
    keys, config, told = jax.random.split(jax.random.key(0), 3), jrcjax.Config(episodes=5), []
    agents, log = jrcjax.train_in_chunks(
        keys, tiny_params(), learner="q_learning", config=config, chunk=2,
        on_progress=lambda episodes, log: told.append((episodes, log.reward.shape)),
    )  # fmt: skip
    assert told == [(2, (3, 2)), (4, (3, 2)), (5, (3, 1))]
    expected_agents, expected = jrcjax.train_agents(keys, tiny_params(), learner="q_learning", config=config)
    np.testing.assert_allclose(log.reward, expected.reward, rtol=1e-5)
    np.testing.assert_allclose(log.policy_reward, expected.policy_reward, rtol=1e-5)
    assert jax.tree.structure(agents) == jax.tree.structure(expected_agents)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"chunk": 0}, "chunk: 0; allowed: an int from 1"),
        ({"learner": "dpr"}, "source: 'None'; allowed: for a learner"),
        ({"source": (1, 2)}, "source: tuple; allowed: Source"),
        ({"source": Source(jnp.zeros(3), jnp.zeros(3))}, "source: 'other leading axes'; allowed: one .* of the 2 keys"),
    ],
)
def test_bad_arguments_are_refused(changed, message):
    arguments = {"learner": "q_learning", "on_progress": print} | changed
    with pytest.raises(ValueError, match=message):
        jrcjax.train_in_chunks(jax.random.split(jax.random.key(0), 2), tiny_params(), **arguments)
