"""The simulator against the equations over a million slots, and the shape of its interface."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy_model import Model
from scipy import stats
from significance import ALPHA, chi_square, z

from jrcjax import EnvState, JRCEnv
from jrcjax.model import states
from jrcjax.model.transitions import next_level

LANES, SLOTS = 2500, 400  # a million slots, past the time limit of 300


def _simulate(key, params):
    """(time, state, action, reward, event, packets, miss, next state) of every slot, each [SLOTS, LANES]."""
    env = JRCEnv(params)

    def one_slot(carry, key):
        state = carry
        action_key, step_key = jax.random.split(key)
        action = jax.random.randint(action_key, (), 0, params.num_actions)
        _, new, reward, _, _, info = env.step(step_key, state, action, params)
        largest = jnp.maximum(jnp.asarray(params.shape) - 1, 1)
        levels = jnp.rint(info["final_observation"] * largest).astype(jnp.int32)
        after = states.id_of(levels, params.shape)  # also at the time limit, where `new` is the next episode's
        return new, (state.time, state.id, action, reward, info["event"], info["packets"], info["miss_ratio"], after)

    def one_lane(key):
        start_key, key = jax.random.split(key)
        return jax.lax.scan(one_slot, env.reset(start_key, params)[1], jax.random.split(key, SLOTS))[1]

    return jax.vmap(one_lane)(jax.random.split(key, LANES))


_simulated = jax.jit(_simulate)


@pytest.mark.slow
def test_a_million_slots(any_params):
    model = Model(any_params)
    slots = [np.asarray(x) for x in _simulated(jax.random.key(1), any_params)]
    start = slots[1][:, 0]
    time, state, action, reward, event, packets, miss, after = (x.ravel() for x in slots)
    size, num_actions = len(model.states), model.num_actions
    np.testing.assert_array_equal(time.reshape(LANES, SLOTS), np.tile(np.arange(SLOTS) % 300, (LANES, 1)))

    # States. With persistence slots depend on each other, so only one slot of every lane is counted.
    law = np.array([np.prod([tau[level] for tau, level in zip(model.priors, s, strict=True)]) for s in model.states])
    for first in (start, slots[1][:, 299], slots[1][:, 300]):
        assert chi_square(np.bincount(first, minlength=size), law) > ALPHA

    # Transitions, given the state and the action, which has no influence.
    counts = np.zeros((size, num_actions, size))
    np.add.at(counts, (state, action, after), 1)
    transition = model.transition()
    assert chi_square(counts.reshape(-1, size), np.repeat(transition, num_actions, axis=0)) > ALPHA

    # Events, given the state, the action and where the state went.
    pairs = state * num_actions + action
    happened = np.bincount(pairs, weights=event, minlength=size * num_actions)
    visits = np.bincount(pairs, minlength=size * num_actions)
    p = np.repeat(model.event, num_actions)
    assert chi_square(np.column_stack([happened, visits - happened]), np.column_stack([p, 1 - p])) > ALPHA
    excess = np.bincount(after, weights=event - model.event[state], minlength=size)
    variance = np.bincount(after, weights=(model.event * (1 - model.event))[state], minlength=size)
    assert stats.chi2.sf((excess**2 / variance).sum(), size) > ALPHA

    # What a slot gives, exactly: packets, misses and the reward.
    np.testing.assert_allclose(packets, model.packets[state, action], rtol=1e-6)
    is_data = model.is_data[action]
    np.testing.assert_array_equal(miss[is_data], 1.0)
    expected = np.where(
        is_data,
        np.where(event, -model.weights[1], model.weights[0] * packets),
        np.where(event, model.weights[3] * (1.0 - miss), -model.weights[2]),
    )
    np.testing.assert_allclose(reward, expected, rtol=1e-6, atol=1e-5)

    # Its mean over events and placements.
    excess = reward - model.expected_reward()[state, action]
    variance = model.reward_variance()[state, action]
    for a in range(num_actions):
        mine = action == a
        assert z(excess[mine].sum() / np.sqrt(variance[mine].sum())) > ALPHA
    excess = np.bincount(pairs, weights=excess, minlength=size * num_actions)
    variance = np.bincount(pairs, weights=variance, minlength=size * num_actions)
    rare = np.bincount(pairs, minlength=size * num_actions) * np.minimum(p, 1 - p) < 50  # far from a normal law
    assert (~rare).any()
    assert stats.chi2.sf((excess[~rare] ** 2 / variance[~rare]).sum(), (~rare).sum()) > ALPHA


def test_the_simulation_could_fail(environments):
    # The same statistic with the event probabilities of another reading.
    target = environments["paper-target"]
    slots = [np.asarray(x) for x in _simulated(jax.random.key(1), target)]
    state, event = slots[1].ravel(), slots[4].ravel()
    visits, happened = np.bincount(state), np.bincount(state, weights=event)
    p = Model(target.replace(event_model=jnp.int32(1))).event
    assert chi_square(np.column_stack([happened, visits - happened]), np.column_stack([p, 1 - p])) < ALPHA


@pytest.fixture
def env(target):
    return JRCEnv(target)


def test_spaces(env, target, environments):
    assert (env.num_actions, env.num_states) == (4, 32)
    assert env.action_space(target).n == 4
    assert env.observation_space(target).shape == (5,)
    other = environments["random-0"]
    assert env.action_space(other).n == other.num_actions == 6
    assert other.num_states == np.prod(other.shape)
    assert set(other.shape) == {2, 3}
    space = env.action_space()
    assert bool(space.contains(3))
    assert not bool(space.contains(4))
    assert not bool(space.contains(-1))
    drawn = jax.vmap(space.sample)(jax.random.split(jax.random.key(0), 200))
    assert set(np.asarray(drawn).tolist()) == {0, 1, 2, 3}
    box = env.observation_space()
    assert bool(box.contains(jnp.ones(5)))
    assert not bool(box.contains(jnp.full(5, 1.5)))
    assert not bool(box.contains(jnp.ones(4)))


def test_default_params_are_the_target(target):
    for mine, theirs in zip(jax.tree.leaves(JRCEnv().default_params), jax.tree.leaves(target), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_reset_and_step_shapes(env, target):
    obs, state = env.reset(jax.random.key(0), target)
    assert (obs.shape, obs.dtype) == ((5,), jnp.float32)
    assert int(state.time) == 0
    obs, state, reward, terminated, truncated, info = env.step(jax.random.key(1), state, 3, target)
    assert (obs.shape, obs.dtype, reward.shape, reward.dtype) == ((5,), jnp.float32, (), jnp.float32)
    assert terminated.dtype == truncated.dtype == bool
    assert int(state.time) == 1
    np.testing.assert_array_equal(info["final_observation"], obs)
    np.testing.assert_array_equal(env.get_obs(state, target), obs)
    obs, state, reward, terminated, info = env.step_env(jax.random.key(1), state, jnp.int32(0), target)
    assert int(state.time) == 2


def test_a_key_decides_everything(env, target):
    state = EnvState(jnp.int32(5), jnp.int32(0), jnp.int32(5))
    first, again, other = (env.step(jax.random.key(k), state, 2, target) for k in (3, 3, 4))
    for a, b in zip(jax.tree.leaves(first), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(a, b)
    assert int(first[1].id) != int(other[1].id)


def test_keys_are_used_once(env, target):
    with jax.debug_key_reuse(True):
        _, state = env.reset(jax.random.key(0), target)
        jax.block_until_ready(env.step(jax.random.key(1), state, 3, target))


@pytest.mark.parametrize("terminal", [0, 1])
def test_time_limit(env, target, terminal):
    params = target.replace(terminal_time_limit=jnp.int32(terminal))
    step = jax.jit(env.step)
    before = EnvState(jnp.int32(31), jnp.int32(298), jnp.int32(31))
    _, state, _, terminated, truncated, _ = step(jax.random.key(2), before, 0, params)
    assert (int(state.time), bool(terminated), bool(truncated)) == (299, False, False)
    obs, new, _, terminated, truncated, info = step(jax.random.key(3), state, 0, params)
    assert (bool(terminated), bool(truncated)) == (bool(terminal), not terminal)
    assert int(new.time) == 0
    # The reset draws a new state, and the one that the slot led to is kept.
    step_key, reset_key = jax.random.split(jax.random.key(3))
    led_to = env.step_env(step_key, state, 0, params)
    np.testing.assert_array_equal(info["final_observation"], led_to[0])
    assert int(led_to[1].time) == 300
    np.testing.assert_array_equal(obs, env.reset(reset_key, params)[0])
    np.testing.assert_array_equal(obs, env.get_obs(new, params))


@pytest.mark.parametrize("kappa", [0.95, 0.9999])
def test_what_persistence_draws_anew_follows_the_prior(target, kappa):
    """As exactly as its docstring says, over all numbers of 24 bits that draw."""
    factor = target.speed.replace(persistence=kappa)
    exact = float(factor.persistence)
    numbers = jnp.arange(int(np.ceil(exact * 2**24)), 2**24, dtype=jnp.float32) / 2**24
    drawn = jax.jit(jax.vmap(next_level, in_axes=(0, None, None)))(numbers, jnp.int32(0), factor)
    share = np.bincount(drawn, minlength=2) / len(drawn)
    np.testing.assert_allclose(share, factor.prior, rtol=0, atol=2**-24 / (1 - exact) + 1e-6)


def test_reset_is_independent_of_the_last_slot(env, target):
    keys = jax.random.split(jax.random.key(5), 20_000)
    last = EnvState(jnp.int32(0), jnp.int32(299), jnp.int32(0))
    step = jax.jit(jax.vmap(env.step, in_axes=(0, None, None, None)))
    _, new, _, _, _, info = step(keys, last, 0, target)
    final = states.id_of(jnp.rint(info["final_observation"]).astype(jnp.int32), target.shape)
    table = np.zeros((32, 32))
    np.add.at(table, (np.asarray(final), np.asarray(new.id)), 1)
    law = Model(target).transition()[0]  # without persistence the priors, whatever the state
    assert chi_square(table, np.tile(law, (32, 1))) > ALPHA


def test_episode_length_is_a_parameter(env, target):
    state = EnvState(jnp.int32(0), jnp.int32(6), jnp.int32(0))
    assert bool(env.step(jax.random.key(0), state, 0, target.replace(max_steps_in_episode=7))[4])
    assert not bool(env.step(jax.random.key(0), state, 0, target.replace(max_steps_in_episode=8))[4])


def test_parameters_as_an_axis(env, source, target):
    # A slot of many environments at once is what each gives alone.
    both = jax.tree.map(lambda *leaves: jnp.stack(leaves), source, target)
    key = jax.random.key(6)
    state = EnvState(jnp.int32(9), jnp.int32(0), jnp.int32(9))
    together = jax.jit(jax.vmap(env.step, in_axes=(None, None, None, 0)))(key, state, 2, both)
    for i, params in enumerate((source, target)):
        alone = jax.jit(env.step)(key, state, 2, params)
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(alone), strict=True):
            np.testing.assert_array_equal(a[i], b)


def test_step_is_traced_once(env, source, target):
    traces = []

    @jax.jit
    def step(key, state, action, params):
        traces.append(params)
        return env.step(key, state, action, params)

    _, state = env.reset(jax.random.key(0), target)
    for params in (source, target, target.replace(event_model=jnp.int32(2), terminal_time_limit=jnp.int32(1))):
        state = step(jax.random.key(1), state, jnp.int32(0), params)[1]
    assert len(traces) == 1


@pytest.mark.parametrize(("reading", "constant"), [("current", False), ("episode_start", True)])
def test_the_first_state_decides_all_events_of_an_episode_or_none_but_its_own(environments, reading, constant):
    params = environments["short-target"]
    never, at_high_speed = (params.road.replace(event_probability=p) for p in ((0.0, 0.0), (0.0, 1.0)))
    params = params.replace(road=never, weather=never, nearby=never, speed=at_high_speed, reward_state=reading)
    env = JRCEnv(params)

    def one_slot(state, key):
        _, new, _, _, _, info = env.step(key, state, 0, params)
        return new, (states.levels_of(state.id, params.shape)[3], info["event"])

    _, start = env.reset(jax.random.key(0), params)
    _, (speeds, events) = jax.jit(lambda: jax.lax.scan(one_slot, start, jax.random.split(jax.random.key(1), 400)))()
    speeds, events = (np.asarray(a).reshape(20, 20) for a in (speeds, events))  # episodes of 20 slots
    np.testing.assert_array_equal(events, speeds[:, :1] + 0 * speeds if constant else speeds)
    assert 0 < events.mean() < 1
