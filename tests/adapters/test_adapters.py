"""The environment in other libraries' shapes, checked by those libraries where they are installed."""

import inspect
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny import tiny_params

import jrcjax
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


def gymnasium_env(**settings):
    pytest.importorskip("gymnasium", reason="needs the extra 'clients'")
    from jrcjax.adapters import GymnasiumEnv

    return GymnasiumEnv(**settings)


def registered(environment, **settings):
    gymnasium = pytest.importorskip("gymnasium", reason="needs the extra 'clients'")
    import jrcjax.adapters  # noqa: F401 - registers the environments

    return gymnasium.make(f"jrcjax/JRC-{environment}-v0", **settings)


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


# Warnings are errors here, and the checkers warn of what they find odd.
@pytest.mark.parametrize("environment", ["source", "target"])
def test_gymnasium_check_env_of_the_registered(environment):
    env = registered(environment)
    from gymnasium.utils.env_checker import check_env

    check_env(env.unwrapped)  # its spec lets it try every render mode


def test_stable_baselines3_check_env():
    env = gymnasium_env(render_mode="rgb_array")
    pytest.importorskip("stable_baselines3", reason="needs the extra 'clients'")
    from stable_baselines3.common.env_checker import check_env

    check_env(env)


def test_registered_environments_are_the_papers():
    for environment in ("source", "target"):
        made, direct = registered(environment), gymnasium_env(params=jrcjax.paper_params(environment))
        np.testing.assert_array_equal(made.reset(seed=4)[0], direct.reset(seed=4)[0])
        for action in (0, 1, 2, 3) * 5:
            one, other = made.step(action), direct.step(action)
            np.testing.assert_array_equal(one[0], other[0])
            assert one[1:] == other[1:]


def test_registered_environment_takes_a_preset():
    with pytest.raises(ValueError, match="preset: 'town' is unknown"):
        registered("target", preset="town")


def test_registered_episode_ends_at_the_time_limit():
    env = registered("target")
    env.reset(seed=0)
    ends = [env.step(3)[2:4] for _ in range(300)]
    assert ends == [(False, False)] * 299 + [(False, True)]


def test_gymnasium_renders_the_slot_that_it_ran():
    env = gymnasium_env(params=tiny_params(), render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    pictures = []
    for action in (0, 4):
        env.step(action)
        pictures.append(env.render())
    assert all(p.dtype == np.uint8 and p.shape == first.shape for p in pictures)
    assert not np.array_equal(first, pictures[0])
    assert not np.array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[1], env.render())
    env.reset(seed=1)
    np.testing.assert_array_equal(env.render(), first)


def test_gymnasium_draws_nothing_without_a_render_mode():
    env = gymnasium_env()
    env.reset(seed=1)
    assert env.render() is None
    with pytest.raises(ValueError, match="render_mode: 'human'; allowed: None, 'rgb_array'"):
        gymnasium_env(render_mode="human")


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
    assert isinstance(env.name, str)
    assert env.num_actions == env.action_space(params).n == 4
    names = ("reset", "step", "reset_env", "step_env", "action_space", "observation_space", "is_truncated")
    for name in names:
        theirs, ours = (inspect.signature(getattr(kind, name)) for kind in (Environment, type(env)))
        assert list(ours.parameters) == list(theirs.parameters), name
    _, state = env.reset(key, params)
    for i in range(4):
        ours = env.step(jax.random.key(i), state, i % 4, params)
        theirs = Environment.step.__wrapped__(env_like(env), jax.random.key(i), state, i % 4, params)
        assert len(ours) == len(theirs) == 6
        assert ours[-1].keys() == theirs[-1].keys()
        jax.tree.map(np.testing.assert_array_equal, ours, theirs)
        assert env.observation_space(params).contains(ours[0])
        state = ours[1]


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
