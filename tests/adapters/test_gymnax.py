"""The environment in gymnax' shape and the older one of five values, with the clients that want them.

Clients are looked for in each test, since some of it needs none.
"""

import inspect
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jrcjax
import jrcjax.adapters
from jrcjax.adapters import FiveTupleEnv

ROOT = Path(__file__).parents[2]

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


def test_importing_the_adapters_needs_no_client():
    """A finder that knows none of the clients stands for an environment without them."""
    code = """if True:
        import sys
        CLIENTS = {"gymnasium", "gymnax", "rejax", "stable_baselines3", "torch"}
        class NotInstalled:
            def find_spec(self, name, path=None, target=None):
                if name.split(".")[0] in CLIENTS:
                    raise ModuleNotFoundError(name, name=name)
        class NoSpec:
            def find_spec(name, package=None):
                return None if name in CLIENTS else find_spec(name, package)
        import importlib.util
        find_spec, importlib.util.find_spec = importlib.util.find_spec, NoSpec.find_spec
        sys.meta_path.insert(0, NotInstalled())
        import jrcjax.adapters
        jrcjax.adapters.FiveTupleEnv()
        try:
            jrcjax.adapters.GymnasiumEnv
        except ModuleNotFoundError as error:
            print(error.name)
    """
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "gymnasium", done.stderr


def test_an_unknown_adapter_is_an_attribute_error():
    with pytest.raises(AttributeError, match="JaxMarlEnv"):
        _ = jrcjax.adapters.JaxMarlEnv


class Wrapper:
    """A wrapper as PureJaxRL's: whatever it does not define is the environment's."""

    def __init__(self, env):
        self._env = env

    def __getattr__(self, name):
        return getattr(self._env, name)


class Returns(Wrapper):
    """Sums rewards and, where an episode ended, hands them on; the environment is a static argument of `jit`."""

    @partial(jax.jit, static_argnums=0)
    def reset(self, key, params=None):
        obs, state = self._env.reset(key, params)
        return obs, (state, 0.0, 0.0)

    @partial(jax.jit, static_argnums=0)
    def step(self, key, state, action, params=None):
        state, total, returned = state
        obs, state, reward, done, info = self._env.step(key, state, action, params)
        total = total + reward
        returned = jnp.where(done, total, returned)
        return obs, (state, jnp.where(done, 0.0, total), returned), reward, done, {**info, "returned": returned}


def gymnax():
    return pytest.importorskip("gymnax", reason="needs the extra 'clients'")


def test_a_rollout_as_in_purejaxrl():
    gymnax()
    params = PARAMS.replace(max_steps_in_episode=5)
    env = Returns(FiveTupleEnv())
    space = env.action_space(params)

    def rollout(key):
        key, of_reset = jax.random.split(key)
        obs, state = jax.vmap(env.reset, in_axes=(0, None))(jax.random.split(of_reset, 3), params)

        def step(carry, _):
            key, obs, state = carry
            key, of_action, of_step = jax.random.split(key, 3)
            action = jax.vmap(space.sample)(jax.random.split(of_action, 3))
            of_step = jax.random.split(of_step, 3)
            obs, state, reward, done, info = jax.vmap(env.step, in_axes=(0, 0, 0, None))(of_step, state, action, params)
            return (key, obs, state), (obs, action, reward, done, info["returned"])

        return jax.lax.scan(step, (key, obs, state), None, 12)[1]

    obs, action, reward, done, returned = jax.jit(rollout)(jax.random.key(0))
    assert obs.shape == (12, 3, *env.observation_space(params).shape)
    assert ((action >= 0) & (action < space.n)).all()
    np.testing.assert_array_equal(np.flatnonzero(done.all(axis=1)), [4, 9])
    assert done.sum() == 6
    np.testing.assert_allclose(returned[4], reward[:5].sum(axis=0), rtol=1e-6)
    np.testing.assert_allclose(returned[11], reward[5:10].sum(axis=0), rtol=1e-6)


def contract_env():
    gymnax()
    from jrcjax.adapters import GymnaxEnv

    return GymnaxEnv()


def test_gymnax_contract():
    """What gymnax's `Environment` has, with the same signatures, and the same values from `step`."""
    env = contract_env()
    from gymnax.environments.environment import Environment

    params, key = PARAMS.replace(max_steps_in_episode=3), jax.random.key(0)
    assert isinstance(env, Environment)
    assert isinstance(env.name, str)
    assert env.num_actions == env.action_space(params).n == 4
    names = (
        "reset", "step", "reset_env", "step_env", "action_space", "observation_space", "state_space", "observe",
        "get_obs", "is_truncated", "is_terminated", "is_terminal", "discount",
    )  # fmt: skip
    for name in names:
        theirs, ours = (inspect.signature(getattr(kind, name)) for kind in (Environment, type(env)))
        assert list(ours.parameters) == list(theirs.parameters), name
    _, state = env.reset(key, params)
    for i in range(4):
        ours = env.step(jax.random.key(i), state, i % 4, params)
        theirs = inspect.unwrap(Environment.step)(env_like(env), jax.random.key(i), state, i % 4, params)
        assert len(ours) == len(theirs) == 6
        assert ours[-1].keys() == theirs[-1].keys()
        jax.tree.map(np.testing.assert_array_equal, ours, theirs)
        assert env.observation_space(params).contains(ours[0])
        state = ours[1]


@pytest.mark.parametrize("terminal", [0, 1])
def test_gymnax_ends_of_episodes(terminal):
    env = contract_env()
    params = PARAMS.replace(max_steps_in_episode=3, terminal_time_limit=jnp.int32(terminal))
    for time in range(4):
        state = jrcjax.EnvState(jnp.int32(7), jnp.int32(time), jnp.int32(7))
        ends = bool(terminal) and time == 3
        assert bool(env.is_terminated(state, params)) == bool(env.is_terminal(state, params)) == ends
        assert bool(env.is_truncated(state, params)) == (not terminal and time == 3)
        assert float(env.discount(state, params)) == (0.0 if ends else 1.0)
        np.testing.assert_array_equal(env.observe(jax.random.key(0), state, 1, params), env.get_obs(state, params))
        assert env.state_space(params).contains(state)
    space = env.state_space(params)
    assert space.spaces["id"].n == params.num_states
    assert space.contains(jrcjax.EnvState(**space.sample(jax.random.key(0))))
    assert not space.contains(jrcjax.EnvState(jnp.int32(7), jnp.int32(0), jnp.int32(params.num_states)))
    assert not env.supports_transition_gradients


def test_gymnax_older_interface_by_its_own_wrapper():
    gymnax()
    from gymnax.wrappers.compat import LegacyStepAPIWrapper

    params = PARAMS.replace(max_steps_in_episode=2)
    theirs, ours = LegacyStepAPIWrapper(contract_env()), FiveTupleEnv()
    _, state = ours.reset(jax.random.key(0), params)
    for i in range(3):
        one, other = (env.step(jax.random.key(i), state, i, params) for env in (theirs, ours))
        jax.tree.map(np.testing.assert_array_equal, one[:4], other[:4])
        state = other[1]


def env_like(env):
    """Our environment's parts under gymnax's own `step`, which puts them together."""
    return Wrapper(env)


@pytest.mark.parametrize("name", ["LogWrapper", "FlattenObservationWrapper", "StickyActionWrapper"])
def test_gymnax_wrappers(name):
    gymnax()
    from gymnax.wrappers import purerl

    params = PARAMS.replace(max_steps_in_episode=3)
    inner = contract_env()
    env = getattr(purerl, name)(inner)
    obs, state = env.reset(jax.random.key(0), params)
    plain_obs, plain = inner.reset(jax.random.key(0), params)
    np.testing.assert_array_equal(obs, plain_obs)
    assert env.observation_space(params).shape == (5,)
    total = 0.0
    for i in range(3):
        obs, state, reward, terminated, truncated, info = env.step(jax.random.key(i), state, i, params)
        wanted = inner.step(jax.random.key(i), plain, i, params)
        plain = wanted[1]
        for a, b in zip((obs, reward, terminated, truncated), (wanted[0], *wanted[2:5]), strict=True):
            np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(info["final_observation"], wanted[5]["final_observation"])
        total += float(reward)
    assert bool(truncated)
    assert not bool(terminated)
    if name == "LogWrapper":
        assert int(info["returned_episode_lengths"]) == 3
        assert float(info["returned_episode_returns"]) == pytest.approx(total, rel=1e-6)


def test_gymnax_dm_env_wrapper():
    gymnax()
    from gymnax.wrappers.dm_env import GymnaxToDmEnvWrapper

    params = PARAMS.replace(max_steps_in_episode=2, terminal_time_limit=jnp.int32(1))
    env = GymnaxToDmEnvWrapper(contract_env())
    timestep = env.reset(jax.random.key(0), params)
    discounts = []
    for i in range(3):
        timestep = env.step(jax.random.key(i), timestep, 3, params)
        discounts.append(float(timestep.discount))
    assert discounts == [1.0, 0.0, 1.0]


@pytest.mark.parametrize("vector", [False, True])
def test_gymnax_gymnasium_wrappers(vector):
    gymnax()
    from gymnax.wrappers import gym

    env = contract_env()
    env = gym.GymnaxToVectorGymWrapper(env, num_envs=2) if vector else gym.GymnaxToGymWrapper(env)
    obs, _ = env.reset(seed=1)
    assert env.observation_space.contains(np.asarray(obs))
    obs, reward, _, truncated, _ = env.step(np.array([0, 3]) if vector else 3)
    assert env.observation_space.contains(np.asarray(obs))
    assert np.isfinite(reward).all()
    assert not np.any(truncated)


def test_rejax_trains_over_seeds_and_environments():
    """Its DQN under one vmap over keys and one over the event probability, against each pair on its own."""
    gymnax()
    rejax = pytest.importorskip("rejax", reason="needs the extra 'clients'")
    short = PARAMS.replace(max_steps_in_episode=8)
    algorithm = rejax.get_algo("dqn").create(
        env=FiveTupleEnv(), env_params=short, total_timesteps=48, eval_freq=48, fill_buffer=8, buffer_size=32,
        batch_size=4, skip_initial_evaluation=True,
    ).replace(eval_callback=lambda algorithm, state, key: state.replay_buffer.data.reward)  # fmt: skip

    def train(key, weight):
        params = short.replace(reward_weights=short.reward_weights.at[0].set(weight))
        state, reward = algorithm.replace(env_params=params).train(key)
        return state.q_ts.params, reward

    keys, weights = jax.random.split(jax.random.key(0), 2), jnp.array([1.0, 1000.0])
    grid = jax.vmap(jax.vmap(train, in_axes=(None, 0)), in_axes=(0, None))
    networks, rewards = jax.jit(grid)(keys, weights)
    assert all(leaf.shape[:2] == (2, 2) and np.isfinite(leaf).all() for leaf in jax.tree.leaves(networks))
    # Packets are worth 1 or 1000: each environment trained on its own rewards, each seed on its own slots.
    largest = np.asarray(rewards).reshape(2, 2, -1).max(axis=-1)
    assert (largest[:, 0] <= 50.0).all()
    assert (largest[:, 1] >= 1000.0).all()
    assert not np.array_equal(rewards[0, 0], rewards[1, 0])
