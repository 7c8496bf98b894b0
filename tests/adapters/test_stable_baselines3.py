"""Stable-Baselines3's checks, wrappers and learners on one environment and on many."""

import jax.numpy as jnp
import numpy as np
import pytest
from tiny import tiny_params

pytest.importorskip("gymnasium", reason="needs the extra 'gymnasium'")
pytest.importorskip("stable_baselines3", reason="needs the extra 'clients'")

from stable_baselines3 import DQN, PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from jrcjax.adapters import GymnasiumEnv, SB3VecEnv, VectorEnv


def test_check_env():
    check_env(GymnasiumEnv(tiny_params(), render_mode="rgb_array"))  # warnings are errors


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("learner", [DQN, PPO])
def test_its_learners_train(learner, many):
    settings = {DQN: {"learning_starts": 8, "batch_size": 8, "buffer_size": 64}, PPO: {"n_steps": 16, "batch_size": 16}}
    env = SB3VecEnv(2, tiny_params()) if many else GymnasiumEnv(tiny_params())
    small = {"net_arch": [4]}
    model = learner("MlpPolicy", env, seed=0, device="cpu", policy_kwargs=small, **settings[learner])
    before = [parameter.detach().numpy().copy() for parameter in model.policy.parameters()]
    model.learn(64)
    after = [parameter.detach().numpy() for parameter in model.policy.parameters()]
    assert any((one != other).any() for one, other in zip(before, after, strict=True))


@pytest.mark.parametrize("terminal", [0, 1])
def test_many_are_the_vector(terminal):
    """Same seed, same numbers; the end of an episode is told as Stable-Baselines3 wants it."""
    params = tiny_params().replace(max_steps_in_episode=4, terminal_time_limit=jnp.int32(terminal))
    ours, vector = SB3VecEnv(3, params), VectorEnv(3, params, autoreset_mode="SameStep")
    ours.seed(7)
    np.testing.assert_array_equal(ours.reset(), vector.reset(seed=7)[0])
    generator = np.random.default_rng(0)
    for step in range(1, 10):
        actions = generator.integers(params.num_actions, size=3)
        observation, reward, done, infos = ours.step(actions)
        wanted = vector.step(actions)
        np.testing.assert_array_equal(observation, wanted[0])
        np.testing.assert_array_equal(reward, wanted[1].astype(np.float32))
        assert done.tolist() == [step % 4 == 0] * 3
        source = wanted[4]["final_info"] if done.any() else wanted[4]
        for i, info in enumerate(infos):
            assert {name: info[name] for name in ("event", "packets", "miss_ratio")} == {
                name: source[name][i] for name in ("event", "packets", "miss_ratio")
            }
            assert ("terminal_observation" in info) == done[i]
            if done[i]:
                np.testing.assert_array_equal(info["terminal_observation"], wanted[4]["final_obs"][i])
                assert info["TimeLimit.truncated"] == (not terminal)


def test_its_wrappers_take_many():
    env = VecNormalize(VecMonitor(SB3VecEnv(3, tiny_params(), seed=1)))
    env.reset()
    infos = [env.step(np.full(3, 4))[3] for _ in range(20)][-1]
    assert [info["episode"]["l"] for info in infos] == [20] * 3
    assert env.get_attr("render_mode") == [None] * 3
    one = GymnasiumEnv(tiny_params())
    assert env.get_attr("action_space", [0, 2]) == [one.action_space] * 2
    assert env.get_attr("observation_space") == [one.observation_space] * 3
    assert env.env_is_wrapped(VecMonitor) == [False] * 3
    with pytest.raises(AttributeError, match="no attributes of their own"):
        env.set_attr("params", None)
    with pytest.raises(AttributeError, match="no methods of their own"):
        env.env_method("render")


def test_made_by_id_with_own_parameters():
    env = make_vec_env("jrcjax.adapters:jrcjax/JRC-target-v0", 2, 0, env_kwargs={"params": tiny_params()})
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=8, device="cpu", policy_kwargs={"net_arch": [4]})
    rewards, lengths = evaluate_policy(model, env, n_eval_episodes=2, return_episode_rewards=True)
    assert lengths == [20, 20]
    assert np.isfinite(rewards).all()
