"""One environment in Gymnasium's shape, checked by Gymnasium."""

import copy
import itertools
import pickle
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest
from tiny import tiny_params

import jrcjax

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra 'gymnasium'")

import jrcjax.adapters  # noqa: E402
from jrcjax.adapters import GymnasiumEnv, VectorEnv  # noqa: E402

TARGET, ANY = "jrcjax/JRC-target-v0", "jrcjax/JRC-v0"


def episode_of(env, actions=None, **reset):
    """First observation, then what `step` returns until the episode ends."""
    given = [env.reset(**reset)]
    for action in actions or itertools.cycle((0, 3, 1, 2)):
        given.append(env.step(action))
        if given[-1][2] or given[-1][3]:
            return given
    return given


def assert_same(first, second):
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:] == other[1:]


# Warnings are errors here, and the checkers warn of what they find odd.
@pytest.mark.parametrize("environment", ["source", "target"])
def test_gymnasium_check_env_of_the_registered(environment):
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make(f"jrcjax/JRC-{environment}-v0").unwrapped)  # its spec lets it try every render mode


def test_registered_environments_are_the_papers():
    for environment in ("source", "target"):
        made = gymnasium.make(f"jrcjax/JRC-{environment}-v0")
        direct = GymnasiumEnv(jrcjax.paper_params(environment))
        assert_same(episode_of(made, seed=4), episode_of(direct, seed=4))
    assert_same(episode_of(gymnasium.make(ANY), seed=4), episode_of(GymnasiumEnv(), seed=4))


def test_registered_environment_takes_a_preset():
    with pytest.raises(ValueError, match="preset: 'town' is unknown"):
        gymnasium.make(TARGET, preset="town")
    table = gymnasium.make(TARGET, preset="paper_table").unwrapped.params
    assert float(table.speed.event_probability[0]) == pytest.approx(0.05)


def test_registered_episode_ends_at_the_time_limit():
    env = gymnasium.make(TARGET)
    assert gymnasium.spec(TARGET).max_episode_steps == env.spec.max_episode_steps == 300
    ends = [step[2:4] for step in episode_of(env, seed=0)[1:]]
    assert ends == [(False, False)] * 299 + [(False, True)]


def test_own_parameters():
    params = tiny_params()
    for name in (TARGET, ANY):
        env = gymnasium.make(name, params=params, seed=3)
        assert env.action_space.n == params.num_actions
        assert_same(episode_of(env), episode_of(GymnasiumEnv(params, seed=3)))
        assert env.unwrapped.spec.max_episode_steps == 20
        again = gymnasium.make(env.unwrapped.spec)
        assert_same(episode_of(again, seed=8), episode_of(env, seed=8))
    long = params.replace(max_steps_in_episode=301)
    with pytest.raises(ValueError, match=r"params.max_steps_in_episode: 301; allowed: at most 300, .* jrcjax/JRC-v0"):
        gymnasium.make(TARGET, params=long)
    env = gymnasium.make(ANY, params=long)
    assert env.spec.max_episode_steps == 301
    assert len(episode_of(env, seed=0)) == 302
    with pytest.raises(ValueError, match="params: int; allowed: EnvParams"):
        gymnasium.make(ANY, params=3)


def test_steps_outside_an_episode_are_refused():
    needed = gymnasium.error.ResetNeeded
    env = GymnasiumEnv(tiny_params(), render_mode="rgb_array")
    for early in (lambda: env.step(0), env.render):
        with pytest.raises(needed, match=r"call reset\(\) first"):
            early()
    episode_of(env, seed=0)
    with pytest.raises(needed, match="the episode is over"):
        env.step(0)
    env.reset()
    env.step(0)


@pytest.mark.parametrize("action", [-1, 5, 1.0, "0", None, np.int64(5), np.array([1])])
def test_actions_that_are_none(action):
    env = GymnasiumEnv(tiny_params())
    env.reset(seed=0)
    with pytest.raises(ValueError, match="allowed: an integer from 0 to 4"):
        env.step(action)
    assert len(episode_of(env, [np.int64(4), np.uint8(0), np.array(3), 2], seed=0)) == 5


def test_the_same_seed_gives_the_same_episodes():
    envs = [GymnasiumEnv(tiny_params(), seed=3) for _ in range(2)]
    for _ in range(3):
        assert_same(*[episode_of(env) for env in envs])
    first = episode_of(envs[0], seed=3)
    assert_same(first, episode_of(envs[1], seed=3))
    other = episode_of(envs[1], seed=4)
    assert not np.array_equal([step[1] for step in first[1:]], [step[1] for step in other[1:]])
    assert all(envs[0].observation_space.contains(step[0]) for step in first)


def test_a_reset_without_a_seed_goes_on_from_the_last_one():
    """The constructor's seed counts until another is given, and then no more."""
    for make in (partial(GymnasiumEnv, tiny_params()), partial(VectorEnv, 3, tiny_params())):
        seeded, plain = make(seed=3), make()
        first = [env.reset(seed=5)[0] for env in (seeded, plain)]
        np.testing.assert_array_equal(*first)
        later = [np.stack([env.reset()[0] for _ in range(20)]) for env in (seeded, plain)]
        np.testing.assert_array_equal(*later)


def test_observations_are_the_callers():
    env = GymnasiumEnv(tiny_params())
    first = episode_of(env, seed=1)
    for step in first:
        kept = step[0].copy()
        step[0][:] = 7.0
        step[0][:] = kept
    observation = env.reset(seed=1)[0]
    observation[:] = 7.0
    assert_same(first, episode_of(env, seed=1))


def test_the_time_limit_as_a_terminal_state():
    env = GymnasiumEnv(tiny_params().replace(terminal_time_limit=jnp.int32(1)))
    assert episode_of(env, seed=0)[-1][2:4] == (True, False)
    # Gymnasium's own limit of the paper's ids truncates in the same slot, whatever the parameters say.
    full = env.params.replace(max_steps_in_episode=300)
    ends = [episode_of(gymnasium.make(name, params=full), seed=0)[-1][2:4] for name in (TARGET, ANY)]
    assert ends == [(True, True), (True, False)]


@pytest.mark.parametrize("copied", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy])
@pytest.mark.parametrize("placements", ["bank", "fresh"])
def test_a_copy_goes_on_alike(copied, placements):
    params = tiny_params()
    env = gymnasium.make(ANY, params=params.replace(radar=params.radar.replace(placements=placements)))
    env.reset(seed=2)
    env.step(3)
    other = copied(env)
    for action in (0, 3, 4, 2):
        assert_same([env.step(action)], [other.step(action)])


def test_rewards_have_the_exact_mean(target):
    """One action in all slots: the mean reward against the solver's, within four standard errors of episodes."""
    policy = jnp.zeros((target.num_states, 4)).at[:, 3].set(1.0)
    wanted = float(jrcjax.exact.evaluate_policy(target, policy).reward)
    env = GymnasiumEnv(target, seed=0)
    means = np.array([np.mean([step[1] for step in episode_of(env, itertools.repeat(3))[1:]]) for _ in range(60)])
    assert abs(means.mean() - wanted) < 4 * means.std(ddof=1) / np.sqrt(60)


def test_it_renders_the_slot_that_it_ran():
    env = GymnasiumEnv(tiny_params(), render_mode="rgb_array")
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


def test_it_draws_nothing_without_a_render_mode():
    env = GymnasiumEnv(tiny_params())
    env.reset(seed=1)
    assert env.render() is None
    with pytest.raises(ValueError, match="render_mode: 'human'; allowed: None, 'rgb_array'"):
        GymnasiumEnv(tiny_params(), render_mode="human")
