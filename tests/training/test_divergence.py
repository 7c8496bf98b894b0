"""Values that diverge are noticed in the episode in which they do, and no others are."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rich.console import Console

import jrcjax
from jrcjax import exact
from jrcjax.config.toml import to_toml
from jrcjax.training import divergence
from sweeps.design import along
from sweeps.engine.job import Job
from sweeps.engine.reference import Reference
from sweeps.engine.run import run_sweep
from sweeps.results import store
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import Size

CONFIG = jrcjax.Config(episodes=3, batch_size=8, replay_capacity=64, hidden=(8,), optimiser="sgd")


def test_the_largest_reward_is_that_of_the_paper(target):
    # An event while sending costs 100; nothing else is as large.
    assert exact.largest_reward(target) == 100.0
    radar_only = target.replace(reward_weights=jnp.asarray([1.0, 2.0, 3.0, 50.0]))
    assert exact.largest_reward(radar_only) == 50.0


def test_values_up_to_the_limit_are_sound_and_any_beyond_is_not(target):
    limit = float(divergence.value_limit(target, 0.99))
    np.testing.assert_allclose(limit, 10 * 100 / 0.01, rtol=1e-5)
    q = jnp.zeros((target.num_states, target.num_actions))
    for value, wanted in ((limit, False), (-limit, False), (1.01 * limit, True), (-1.01 * limit, True)):
        assert divergence.has_diverged(q.at[3, 1].set(value), target, 0.99) == wanted
    for value in (jnp.nan, jnp.inf, -jnp.inf):
        assert divergence.has_diverged(q.at[-1, -1].set(value), target, 0.99)


def test_small_rewards_do_not_make_initial_values_diverge(target):
    nothing = target.replace(reward_weights=jnp.zeros(4))
    assert not divergence.has_diverged(jnp.ones((2, 2)), nothing, 0.0)


@pytest.mark.parametrize(("rate", "diverges"), [(1e3, True), (1e-6, False)])
def test_plain_sgd_with_a_large_rate_diverges(rate, diverges, environments):
    hparams = jrcjax.HParams(learning_rate=jnp.float32(rate))
    env_params = environments["short-target"]
    agent, log = jrcjax.train(jax.random.key(0), env_params, hparams, learner="ddqn", config=CONFIG)
    assert log.diverged.tolist() == [diverges] * 3
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(agent.learner.weights)) == (not diverges)


def test_a_part_holds_the_episode_in_which_an_agent_diverged(tmp_path, environments):
    sweep = replace(
        SWEEPS["fig5a"],
        name="diverging",
        learners=("ddqn", "round_robin"),
        environment=to_toml(environments["short-target"]),
        design=along("rate", "hparams.learning_rate", (1e-3, 1e20)),
    )
    folder = run_sweep(sweep, Size(seeds=2, episodes=2), tmp_path, Console(quiet=True), resume=False)
    first = store.load(folder, 2)["first_diverged"]
    assert first.dims == ("algorithm", "point", "seed")
    assert (first.sel(algorithm="round_robin") == -1).all()
    assert (first.sel(algorithm="ddqn", point=0) == -1).all()
    assert (first.sel(algorithm="ddqn", point=1) == 1).all()


def test_the_first_episode_is_the_first_of_many():
    sweep, size = replace(SWEEPS["fig5a"], learners=("ddqn",)), Size(seeds=2, episodes=4)
    shape = (1, 2, 4)
    diverged = np.array([[[False, False, True, True], [False] * 4]])
    log = jrcjax.Log(*[np.zeros(shape)] * 6, diverged)
    nothing = exact.LongRun(np.zeros(1), np.zeros(1), np.zeros(1))
    job = Job(sweep, size)
    job.__dict__["reference"] = Reference(nothing, nothing, nothing)
    data = store.dataset(job, range(2), {"ddqn": log})
    assert data["first_diverged"].values.tolist() == [[[3, -1]]]
    assert "diverged" not in data
