"""Many environments in Gymnasium's vector shape, against Gymnasium's own vector of single ones."""

import jax.numpy as jnp
import numpy as np
import pytest
from tiny import tiny_params

import jrcjax

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra 'gymnasium'")

from gymnasium.vector import AutoresetMode  # noqa: E402

from jrcjax.adapters import GymnasiumEnv, VectorEnv  # noqa: E402

TARGET, ANY = "jrcjax/JRC-target-v0", "jrcjax/JRC-v0"
MODES = ["NextStep", "SameStep"]


def rollout(env, steps, seed=0):
    """What `step` returns for random actions, most of it stacked."""
    env.reset(seed=seed)
    actions = np.random.default_rng(9).integers(env.single_action_space.n, size=(steps, env.num_envs))
    return [env.step(action) for action in actions]


def test_made_by_its_id():
    """Gymnasium takes the vector entry point by itself, and hands on what it is given."""
    env = gymnasium.make_vec(TARGET, num_envs=3)
    assert isinstance(env.unwrapped, VectorEnv)
    assert env.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    assert env.observation_space.shape == (3, 5)
    assert env.spec.max_episode_steps == 300
    own = gymnasium.make_vec(
        ANY, num_envs=2, vectorization_mode="vector_entry_point", params=tiny_params(), autoreset_mode="SameStep"
    )
    assert own.single_action_space.n == tiny_params().num_actions
    assert own.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    short = gymnasium.make_vec(TARGET, num_envs=2, max_episode_steps=7)
    ends = [step[3].tolist() for step in rollout(short, 8)]
    assert ends == [[False] * 2] * 6 + [[True] * 2] + [[False] * 2]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("terminal", [0, 1])
def test_it_speaks_as_gymnasiums_vector(mode, terminal):
    """Shapes, types, ends and masks of every step; random numbers differ, as one stream serves all environments."""
    params = tiny_params().replace(max_steps_in_episode=3, terminal_time_limit=jnp.int32(terminal))
    ours = VectorEnv(4, params, autoreset_mode=mode)
    theirs = gymnasium.vector.SyncVectorEnv([lambda: GymnasiumEnv(params)] * 4, autoreset_mode=mode)
    assert (ours.observation_space, ours.action_space) == (theirs.observation_space, theirs.action_space)
    for one, other in zip(rollout(ours, 9), rollout(theirs, 9), strict=True):
        assert ours.observation_space.contains(one[0])
        assert [part.dtype for part in one[:4]] == [part.dtype for part in other[:4]]
        np.testing.assert_array_equal(one[2], other[2])
        np.testing.assert_array_equal(one[3], other[3])
        assert_same_masks(one[4], other[4])


def assert_same_masks(ours, theirs):
    """The same names, and the same environments have an entry; no name means that no environment has one."""
    for name in ours.keys() | theirs.keys():
        if name.startswith("_"):
            none = np.zeros(4, bool)
            np.testing.assert_array_equal(ours.get(name, none), theirs.get(name, none), err_msg=name)
        elif isinstance(theirs.get(name), dict):
            assert_same_masks(ours[name], theirs[name])
        elif name in theirs and theirs[name].dtype != object:
            assert ours[name].shape == theirs[name].shape


@pytest.mark.parametrize("mode", MODES)
def test_an_episode_goes_on_from_its_last_observation(mode):
    """Levels that never change until the next episode show which observation belongs to which."""
    params = tiny_params().replace(max_steps_in_episode=4)
    frozen = {name: getattr(params, name).replace(persistence=jnp.float32(1 - 2**-24)) for name in ("channel", "speed")}
    env = VectorEnv(64, params.replace(**frozen), autoreset_mode=mode)
    before, _ = env.reset(seed=1)
    changed = 0
    for observation, reward, _, truncated, infos in (env.step(np.zeros(64, int)) for _ in range(12)):
        last = np.stack(infos["final_obs"]) if "final_obs" in infos else observation
        begun = ~infos["_event"] & (mode == "NextStep")
        np.testing.assert_array_equal(last[~begun][:, [0, 3]], before[~begun][:, [0, 3]])
        assert (reward[begun] == 0).all()
        changed += int((observation[:, [0, 3]] != before[:, [0, 3]]).any())
        before = observation
        assert truncated.all() or not truncated.any()
    assert changed == (2 if mode == "NextStep" else 3)


def test_disabled_autoreset_waits_for_its_reset():
    env = VectorEnv(3, tiny_params().replace(max_steps_in_episode=2), autoreset_mode="Disabled")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(3, int))
    first, _ = env.reset(seed=0)
    env.step(np.zeros(3, int))
    mask = np.array([False, True, False])
    again, _ = env.reset(options={"reset_mask": mask})
    assert again.shape == first.shape
    assert env.step(np.zeros(3, int))[3].tolist() == [True, False, True]
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(3, int))
    env.reset(options={"reset_mask": ~mask})
    assert env.step(np.zeros(3, int))[3].tolist() == [False, True, False]
    with pytest.raises(ValueError, match=r"reset_mask: .*allowed: an array of 3 booleans"):
        env.reset(options={"reset_mask": np.array([1, 0, 0])})


def test_the_same_seed_gives_the_same_episodes():
    envs = [VectorEnv(5, tiny_params(), seed=3), VectorEnv(5, tiny_params())]
    envs[0].reset()
    envs[1].reset(seed=3)
    for seed in (None, 4):
        one, other = (rollout(env, 45, seed) for env in envs)
        for ours, theirs in zip(one, other, strict=True):
            for a, b in zip(ours[:4], theirs[:4], strict=True):
                np.testing.assert_array_equal(a, b)
    different = rollout(envs[1], 45, 5)
    assert any(not np.array_equal(a[1], b[1]) for a, b in zip(other, different, strict=True))


def test_each_environment_earns_the_exact_mean(target):
    """One action in all slots; environments are independent, so their means are samples."""
    policy = jnp.zeros((target.num_states, 4)).at[:, 3].set(1.0)
    wanted = float(jrcjax.exact.evaluate_policy(target, policy).reward)
    env = VectorEnv(500, target, seed=0, autoreset_mode="SameStep")
    env.reset()
    means = np.mean([env.step(np.full(500, 3))[1] for _ in range(300)], axis=0)
    assert abs(means.mean() - wanted) < 4 * means.std(ddof=1) / np.sqrt(500)


@pytest.mark.parametrize("actions", [[0, 5], [0, -1], [0.0, 1.0], [0], [[0, 1]], [True, False], 3, "01", None], ids=str)
def test_actions_that_are_none(actions):
    env = VectorEnv(2, tiny_params())
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions: .*allowed: 2 integers from 0 to 4"):
        env.step(actions)


def test_settings_that_are_none():
    for settings, message in (
        ({"num_envs": 0}, "num_envs: 0; allowed"),
        ({"max_episode_steps": 0}, "max_episode_steps: 0; allowed"),
        ({"autoreset_mode": "Never"}, "Never"),
    ):
        with pytest.raises(ValueError, match=message):
            VectorEnv(**{"params": tiny_params(), **settings})


@pytest.mark.parametrize("mode", MODES)
def test_gymnasiums_statistics_of_episodes(mode):
    from gymnasium.wrappers.vector import RecordEpisodeStatistics

    env = RecordEpisodeStatistics(VectorEnv(3, tiny_params(), autoreset_mode=mode))
    steps = rollout(env, 20)
    np.testing.assert_allclose(steps[-1][4]["episode"]["r"], np.sum([step[1] for step in steps], axis=0))
    np.testing.assert_array_equal(steps[-1][4]["episode"]["l"], [20] * 3)


def test_fresh_placements():
    params = tiny_params()
    env = VectorEnv(3, params.replace(radar=params.radar.replace(placements="fresh")))
    ratios = [step[4]["miss_ratio"] for step in rollout(env, 25)]
    assert len(np.unique(ratios)) > 3
