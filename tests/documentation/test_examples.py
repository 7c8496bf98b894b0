"""The examples run as they are, at tiny sizes; and state spaces that nobody can enumerate train."""

import importlib.util
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib as mpl
import numpy as np
import pytest
from tiny import tiny_params

import jrcjax
from jrcjax.learners import Spec
from jrcjax.model.params import Factor
from jrcjax.replay.uniform import Transition
from jrcjax.training.rollout import init_agent, learner_for

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_three_levels(tmp_path, capsys):
    """The file with small ranges and a small bank, which are quick to build."""
    text = (EXAMPLES / "three_levels.toml").read_text()
    ranges = "max_intermediate_frequency = [15.01e6, 8.005e6, 4.503e6]"
    assert ranges in text
    text = text.replace(ranges, "max_intermediate_frequency = [2e6, 2e6, 3e6]").replace("= 300\n", "= 8\n")
    small = tmp_path / "small.toml"
    small.write_text(text + "bank_size = 16\n")
    params = jrcjax.load_params(small)
    assert params.shape == (3,) * 5
    assert (params.num_rates, params.radar.num_modes, params.max_steps_in_episode) == (3, 3, 8)
    packets = np.asarray(jrcjax.exact.packet_table(params))[:: 3**4, :3]  # one row per level of the channel
    np.testing.assert_array_equal(packets, [[2, 3, 4], [2, 3, 0], [2, 0, 0]])
    picture = tmp_path / "curve.png"
    example("three_levels").main(
        ["--params", str(small), "--episodes", "2", "--seeds", "2", "--out", str(picture)]
    )  # fmt: skip
    said = capsys.readouterr().out
    assert "243 states, 6 actions; the loss is computed on the table of all states" in said
    # Actions have no influence on the state, so the optimum takes the best reward in each.
    best = np.asarray(jrcjax.exact.expected_reward(params)).max(axis=1)
    optimum = best @ np.asarray(jrcjax.exact.stationary_distribution(params))
    assert float(re.search(r"optimum (\S+) per slot", said)[1]) == pytest.approx(optimum, abs=2e-3)
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_own_learner_fits_in_sixty_lines():
    assert len((EXAMPLES / "own_learner.py").read_text().splitlines()) < 60


def test_own_learner_update_by_hand():
    module = example("own_learner")
    learner = module.expected_sarsa(Spec((2,) * 5, 4, 300), jrcjax.Config())
    table = module.Table(jnp.zeros((32, 4)).at[5].set(jnp.array([30.0, 0.0, 0.0, 0.0])), jnp.zeros((32, 4)))
    new = learner.update(table, Transition(2, 1, 7.0, 5, 0.99), 0, None, jrcjax.HParams())
    first = np.e / (np.e + 3)  # the chance of an action that is one temperature better than three others
    assert float(new.q[2, 1]) == pytest.approx(7.0 + 0.99 * first * 30.0, rel=1e-5)
    again = learner.update(new, Transition(2, 1, 7.0, 5, 0.0), 1, None, jrcjax.HParams())
    assert float(again.q[2, 1]) == pytest.approx(float(new.q[2, 1]) + 2**-0.7 * (7.0 - float(new.q[2, 1])), rel=1e-5)
    words = jax.random.bits(jax.random.key(0), (4000, 2), jnp.uint32)
    actions = jax.vmap(lambda w: learner.act(table, jnp.int32(5), 0, w, jrcjax.HParams()))(words)
    assert np.mean(np.asarray(actions) == 0) == pytest.approx(first, abs=0.03)
    assert set(np.unique(actions)) == {0, 1, 2, 3}


def test_own_learner_trains_like_the_others():
    params, config = tiny_params(), jrcjax.Config(episodes=60)
    keys = jax.random.split(jax.random.key(0), 3)
    _, log = jrcjax.train_agents(keys, params, learner=example("own_learner").expected_sarsa, config=config)
    _, lower = jrcjax.train_agents(keys, params, learner="round_robin", config=config)
    assert log.policy_reward.shape == (3, 60)
    assert float(log.policy_reward[:, -10:].mean()) > float(lower.policy_reward.mean()) + 1.0


def test_stable_baselines3_beside_ours():
    pytest.importorskip("stable_baselines3", reason="needs the extra 'clients'")
    params = tiny_params()
    best = np.asarray(jrcjax.exact.expected_reward(params)).max(axis=1)
    optimum = best @ np.asarray(jrcjax.exact.stationary_distribution(params))
    theirs, ours = example("sb3_comparison").train_both(params, episodes=5, seeds=2, scale=0.01)
    for rewards in (theirs, ours):
        assert rewards.shape == (2, 5)
        assert (rewards <= optimum + 1e-3).all()
        assert len(np.unique(rewards)) > 1


def test_a_state_space_too_large_to_enumerate_trains():
    """100 levels of four factors: 300 million states, of which no array is ever made."""
    levels = Factor(prior=np.full(100, 0.01), event_probability=np.linspace(0.0, 0.1, 100))
    params = tiny_params().replace(road=levels, weather=levels, speed=levels, nearby=levels)
    jrcjax.check_params(params)
    assert params.num_states == 300_000_000
    config = jrcjax.Config(episodes=2, replay_capacity=64, batch_size=4, hidden=(8,))
    assert not config.uses_table(params.num_states)
    key, hparams = jax.random.key(0), jrcjax.HParams()
    before = init_agent(key, hparams, learner_for("ddqn", params, config)).learner.weights
    agent, log = jrcjax.train(key, params, hparams, learner="ddqn", config=config)
    assert np.isfinite(log.reward).all()
    assert np.isnan(log.policy_reward).all()  # it would need all states
    moved = jax.tree.map(lambda a, b: float(jnp.abs(a - b).max()), agent.learner.weights, before)
    assert min(jax.tree.leaves(moved)) > 0


def test_ids_that_int32_cannot_hold_are_refused():
    levels = Factor(prior=np.full(200, 0.005), event_probability=np.linspace(0.0, 0.1, 200))
    params = tiny_params().replace(road=levels, weather=levels, speed=levels, nearby=levels)
    with pytest.raises(ValueError, match=r"shape: '\(3, 200, 200, 200, 200\), 4800000000 states'; allowed: fewer than"):
        jrcjax.check_params(params)


def test_tour_at_a_tiny_size():
    text = (EXAMPLES / "tour.py").read_text()
    assert "EPISODES, AGENTS = 60, 64" in text
    names = {}
    with mpl.rc_context({"backend": "agg"}):
        exec(compile(text.replace("EPISODES, AGENTS = 60, 64", "EPISODES, AGENTS = 3, 2"), "tour.py", "exec"), names)
    assert names["curves"].shape == (2, 3)
    assert (np.diff(names["runs"].reward) > 0).all()  # more to detect, more to earn
