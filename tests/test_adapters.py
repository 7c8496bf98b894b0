"""The environment in other libraries' shapes, checked by those libraries where they are installed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jrcjax
from jrcjax.adapters.five_tuple import FiveTupleEnv

PARAMS = jrcjax.paper_params("target")


@pytest.mark.parametrize("terminal", [0, 1])
def test_five_tuple_is_the_environment_with_one_flag(terminal):
    params = PARAMS.replace(max_steps_in_episode=3, terminal_time_limit=jnp.int32(terminal))
    env, five = jrcjax.JRCEnv(), FiveTupleEnv()
    _, state = env.reset(jax.random.key(0), params)
    flags = []
    for i in range(7):
        wanted = env.step(jax.random.key(i), state, i % 4, params)
        got = five.step(jax.random.key(i), state, i % 4, params)
        assert len(got) == 5
        for a, b in zip(got[:3], wanted[:3], strict=True):
            jax.tree.map(np.testing.assert_array_equal, a, b)
        assert bool(got[3]) == bool(wanted[3] | wanted[4])
        assert bool(got[4]["terminated"]) == bool(wanted[3])
        flags.append(bool(got[3]))
        state = got[1]
    assert flags == [False, False, True, False, False, True, False]


def gymnasium_env(**settings):
    pytest.importorskip("gymnasium", reason="needs the extra 'peers'")
    from jrcjax.adapters.gymnasium_env import GymnasiumEnv

    return GymnasiumEnv(**settings)


@pytest.mark.filterwarnings("ignore")  # the checkers speak through warnings; errors are what counts
def test_gymnasium_check_env():
    env = gymnasium_env()
    from gymnasium.utils.env_checker import check_env

    check_env(env, skip_render_check=True)


@pytest.mark.filterwarnings("ignore")
def test_stable_baselines3_check_env():
    env = gymnasium_env()
    pytest.importorskip("stable_baselines3", reason="needs the extra 'peers'")
    from stable_baselines3.common.env_checker import check_env

    check_env(env)


def test_gymnasium_episode():
    env = gymnasium_env(params=PARAMS.replace(max_steps_in_episode=5), seed=3)
    first = env.reset()[0]
    steps = [env.step(i % 4) for i in range(5)]
    assert [step[3] for step in steps] == [False] * 4 + [True]
    assert not any(step[2] for step in steps)
    assert all(env.observation_space.contains(step[0]) for step in steps)
    again = gymnasium_env(params=PARAMS.replace(max_steps_in_episode=5), seed=3)
    np.testing.assert_array_equal(again.reset()[0], first)
    for i, step in enumerate(steps):
        obs, *rest = again.step(i % 4)
        np.testing.assert_array_equal(obs, step[0])
        assert rest == list(step[1:])
    with pytest.raises(ValueError, match="action: 4; allowed: an integer from 0 to 3"):
        env.step(4)


def test_gymnasium_rewards_have_the_exact_mean():
    """One action in all slots: the mean reward against the solver's, within four standard errors of batches."""
    env = gymnasium_env(seed=0)
    policy = jnp.zeros((PARAMS.num_states, 4)).at[:, 3].set(1.0)
    wanted = float(jrcjax.exact.evaluate_policy(PARAMS, policy).reward)
    env.reset()
    rewards = []
    for _ in range(9000):
        _, reward, _, truncated, _ = env.step(3)
        rewards.append(reward)
        if truncated:
            env.reset()
    batches = np.reshape(rewards, (30, 300)).mean(axis=1)
    assert abs(batches.mean() - wanted) < 4 * batches.std(ddof=1) / np.sqrt(30)
