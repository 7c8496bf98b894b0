"""The exact solver against dense algebra in NumPy and against long simulations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy_model import Model, policy_iteration, stationary
from significance import ALPHA, mean_differs

from jrcjax import exact
from jrcjax.model import metrics, slot
from jrcjax.model.params import Factor
from jrcjax.readings import EventModel, MissConvention

EPS = float(np.finfo(np.float32).eps)
TOLERANCE = 1e-4  # of value_iteration, by default
LANES, SLOTS = 1000, 1000


def random_policy(seed, num_states, num_actions):
    """[S, A], every row a random distribution."""
    return np.random.default_rng(seed).dirichlet(np.ones(num_actions), num_states).astype(np.float32)


def long_run(params, policy, convention, count_event_packets):
    """(reward, throughput, miss detection) by dense algebra from the package's transition tensor alone."""
    model, policy = Model(params), np.asarray(policy, np.float64)
    tensor = np.asarray(exact.transition_tensor(params), np.float64)
    visits = stationary(np.einsum("sa,sat->st", policy, tensor))[:, None] * policy
    event = model.event[:, None]
    reward = (visits * model.expected_reward()).sum()
    packets = (visits * model.packets * (1.0 if count_event_packets else 1.0 - event)).sum()
    weights = (1.0, event, ~model.is_data)  # in the order of MissConvention
    counted = visits * weights[convention]
    return reward, packets, (counted * model.miss).sum() / counted.sum()


def test_transition_tensor(any_params, strict):
    tensor = np.asarray(exact.transition_tensor(any_params))
    model = Model(any_params)
    assert tensor.shape == (any_params.num_states, any_params.num_actions, any_params.num_states)
    np.testing.assert_allclose(tensor.sum(axis=2), 1.0, rtol=10 * EPS)
    for action in range(any_params.num_actions):
        np.testing.assert_allclose(tensor[:, action], model.transition(), rtol=20 * EPS)


def test_persistence_of_one_factor(target):
    kept = target.replace(road=target.road.replace(persistence=jnp.float32(0.5)))
    np.testing.assert_allclose(exact.transition_tensor(kept)[0, 0], Model(kept).transition()[0], rtol=20 * EPS)
    road = [exact.level_transition(f.prior, f.persistence) for f in (kept.road, kept.weather)]
    np.testing.assert_allclose(road[0], [[0.85, 0.15], [0.35, 0.65]], rtol=10 * EPS)
    np.testing.assert_allclose(road[1], [[0.7, 0.3], [0.7, 0.3]], rtol=10 * EPS)


def test_stationary_distribution(any_params):
    law = exact.stationary_distribution(any_params)
    tensor = np.asarray(exact.transition_tensor(any_params), np.float64)
    np.testing.assert_allclose(law, stationary(tensor[:, 0]), rtol=1e-4, atol=EPS)


@pytest.mark.parametrize("reading", EventModel)
def test_expected_reward(any_params, reading):
    params = any_params.replace(event_model=reading)
    expected = Model(params).expected_reward()
    # Sums of numbers up to the largest weight, which may cancel.
    largest = float(np.max(params.reward_weights))
    np.testing.assert_allclose(exact.expected_reward(params), expected, rtol=0, atol=10 * EPS * largest)


@pytest.mark.parametrize("gamma", [0.0, 0.5, 0.9, 0.99])
def test_value_iteration(any_params, gamma):
    gamma = float(np.float32(gamma))  # as the package knows it: the horizon differs by 1e-6 of itself
    model = Model(any_params)
    rewards = model.expected_reward()
    transition = np.repeat(model.transition()[:, None], any_params.num_actions, axis=1)
    q = policy_iteration(transition, rewards, gamma)
    # The stated tolerance, and one rounding per slot of the horizon.
    atol = TOLERANCE + EPS * np.abs(rewards).max() / (1.0 - gamma) + 2 * EPS * np.abs(q).max()
    got = exact.value_iteration(any_params, gamma)
    assert got.shape == q.shape
    np.testing.assert_allclose(got, q, rtol=0, atol=atol)
    loss = q.max(axis=1) - np.take_along_axis(q, np.asarray(got).argmax(axis=1)[:, None], axis=1)[:, 0]
    assert (loss <= 2 * atol).all()


def test_value_iteration_without_discount_is_the_reward(target):
    np.testing.assert_allclose(exact.value_iteration(target, 0.0), exact.expected_reward(target), rtol=10 * EPS)


def test_value_iteration_over_an_axis_of_discounts(environments):
    params = environments["random-1"]
    gammas = jnp.asarray([0.0, 0.5, 0.99])
    together = jax.vmap(lambda gamma: exact.value_iteration(params, gamma))(gammas)
    for gamma, q in zip(gammas, together, strict=True):
        alone = exact.value_iteration(params, gamma)
        np.testing.assert_allclose(q, alone, atol=2 * TOLERANCE + EPS * 60.0 / (1.0 - float(gamma)))


@pytest.mark.parametrize("argument", [{"gamma": 0.99999999}, {"gamma": 1.0}, {"tolerance": 1e-50}])
def test_what_float32_rounds_to_a_number_that_is_not_allowed_is_refused(target, argument):
    with pytest.raises(ValueError, match=rf"^{next(iter(argument))}: .*; allowed: a float32"):
        exact.value_iteration(target, **argument)


def test_larger_gamma_needs_the_transitions(environments):
    # With persistence the next state depends on this one, so Q* is more than the reward and a constant.
    params = environments["random-1"]
    difference = np.asarray(exact.value_iteration(params, 0.9) - exact.expected_reward(params))
    assert np.ptp(difference.mean(axis=1)) > 1.0


@pytest.mark.parametrize("count_event_packets", [0, 1])
@pytest.mark.parametrize("convention", MissConvention)
def test_evaluate_policy(any_params, convention, count_event_packets):
    params = any_params.replace(
        miss_convention=convention,
        count_event_packets=jnp.int32(count_event_packets),
    )
    for seed in range(3):
        policy = random_policy(seed, params.num_states, params.num_actions)
        expected = long_run(params, policy, convention, count_event_packets)
        # The reward is a sum of terms of both signs, as large as the largest weight.
        atol = 20 * EPS * float(np.max(params.reward_weights))
        np.testing.assert_allclose(exact.evaluate_policy(params, jnp.asarray(policy)), expected, rtol=5e-5, atol=atol)


def _simulate(key, params, policy):
    def one_slot(carry, key):
        state, first, sums = carry
        action_key, word_key = jax.random.split(key)
        action = jax.random.categorical(action_key, jnp.log(policy[state]))
        outcome = slot.run_slot(jax.random.bits(word_key, (slot.NUM_WORDS,), jnp.uint32), state, action, params, first)
        return (outcome.next_state, first, slot.measure(sums, outcome, params)), None

    def one_lane(key):
        start_key, key = jax.random.split(key)
        start = slot.initial_state(jax.random.bits(start_key, (slot.NUM_WORDS,), jnp.uint32), params)
        return jax.lax.scan(one_slot, (start, start, metrics.zero()), jax.random.split(key, SLOTS))[0][2]

    return jax.vmap(one_lane)(jax.random.split(key, LANES))


_simulated = jax.jit(_simulate)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper-target", "paper-source", "random-1"])
def test_evaluate_policy_against_a_million_slots(environments, name):
    params = environments[name].replace(max_steps_in_episode=SLOTS)
    policy = jnp.asarray(random_policy(7, params.num_states, params.num_actions))
    for convention, reading in ((0, 0), (1, 0), (2, 0), (0, 1), (1, 1)):
        numbers = {"miss_convention": convention, "count_event_packets": convention % 2, "reward_state": reading}
        params = params.replace(**{field: jnp.int32(number) for field, number in numbers.items()})
        expected = exact.evaluate_policy(params, policy)
        sums = jax.tree.map(np.asarray, _simulated(jax.random.key(convention), params, policy))
        # Lanes start in the stationary law and are independent of each other, so they are a sample.
        assert mean_differs(sums.reward / SLOTS, float(expected.reward)) > ALPHA
        assert mean_differs(sums.packets / SLOTS, float(expected.throughput)) > ALPHA
        if convention > 0:  # a ratio of sums: what is missed beyond the expected share has mean zero
            assert mean_differs(sums.missed - float(expected.miss_detection) * sums.counted, 0.0) > ALPHA
        else:
            assert mean_differs(sums.missed / SLOTS, float(expected.miss_detection)) > ALPHA
        if not reading:
            assert mean_differs(sums.reward / SLOTS, float(expected.reward) + 0.5) < ALPHA  # it can tell


@pytest.mark.parametrize("convention", MissConvention)
def test_miss_detection_of_a_policy_that_only_transmits(target, convention):
    params = target.replace(miss_convention=convention)
    run = exact.evaluate_policy(params, exact.policy_of_actions(jnp.zeros(32, jnp.int32), 4))
    assert float(run.throughput) == pytest.approx(2.0, rel=10 * EPS)
    if convention == MissConvention.RADAR_SLOTS:
        assert np.isnan(run.miss_detection)
    else:
        assert float(run.miss_detection) == pytest.approx(1.0, rel=10 * EPS)


def test_optimum_is_better_than_other_policies(any_params):
    best = float(exact.evaluate_policy(any_params, exact.optimal_policy(any_params)).reward)
    for seed in range(5):
        actions = np.random.default_rng(seed).integers(0, any_params.num_actions, any_params.num_states)
        policy = exact.policy_of_actions(jnp.asarray(actions), any_params.num_actions)
        assert float(exact.evaluate_policy(any_params, policy).reward) < best


def test_greedy_policy_takes_the_first_of_equals(strict):
    q = jnp.asarray([[1.0, 3.0, 3.0], [2.0, 2.0, 2.0]])
    np.testing.assert_array_equal(exact.greedy_policy(q), [[0, 1, 0], [1, 0, 0]])


def _transmitting(params):
    """Long-run share of slots in which the optimal policy transmits."""
    policy = exact.optimal_policy(params)
    return float((exact.stationary_distribution(params) * policy[:, : params.num_rates].sum(axis=1)).sum())


def test_optimum_of_the_target(target):
    assert 5.5 < float(exact.evaluate_policy(target, exact.optimal_policy(target)).reward) < 5.75
    assert 0.2 < _transmitting(target) < 0.3


def test_optimum_of_the_target_of_table_one(environments):
    params = environments["paper_table-target"]
    assert 6.2 < float(exact.evaluate_policy(params, exact.optimal_policy(params)).reward) < 6.4
    assert _transmitting(params) == 0.0


def test_solver_over_an_axis_of_environments(source, target):
    both = jax.tree.map(lambda *leaves: jnp.stack(leaves), source, target)
    run = jax.jit(jax.vmap(lambda params: exact.evaluate_policy(params, exact.optimal_policy(params))))(both)
    for i, params in enumerate((source, target)):
        alone = exact.evaluate_policy(params, exact.optimal_policy(params))
        np.testing.assert_allclose([x[i] for x in run], alone, rtol=1e-5)


def visits_of_first_states(model, slots):
    """[S, S] how often (first state, observed state) occur per slot of an episode, by powers of the matrix."""
    matrix, power, total = model.transition(), np.eye(len(model.states)), 0.0
    for _ in range(slots):
        total, power = total + power, power @ matrix
    first = np.array([np.prod([tau[j] for tau, j in zip(model.priors, s, strict=True)]) for s in model.states])
    return first[:, None] * total / slots


@pytest.mark.parametrize("slots", [1, 7])
def test_a_first_state_that_decides_all_slots(environments, slots):
    params = environments["random-1"].replace(reward_state="episode_start", max_steps_in_episode=slots)
    model = Model(params)
    pairs, rewards = visits_of_first_states(model, slots), model.expected_reward()
    policy = np.random.default_rng(5).dirichlet(np.ones(params.num_actions), len(rewards))
    taken = pairs @ policy  # [S, A] actions while each first state decides
    earned = exact.evaluate_policy(params, jnp.asarray(policy, jnp.float32))
    np.testing.assert_allclose(earned.reward, (taken * rewards).sum(), rtol=1e-4)
    np.testing.assert_allclose(earned.throughput, (taken * model.packets).sum(), rtol=1e-4)
    np.testing.assert_allclose(earned.miss_detection, (taken * model.miss).sum(), rtol=1e-4)
    observed = (pairs.T @ rewards) / pairs.sum(axis=0)[:, None]
    np.testing.assert_allclose(exact.expected_reward(params), observed, rtol=1e-4, atol=1e-4)
    best = exact.evaluate_policy(params, exact.optimal_policy(params)).reward
    np.testing.assert_allclose(best, (pairs.sum(axis=0) * observed.max(axis=1)).sum(), rtol=1e-4)


def test_a_first_state_decides_one_slot_as_the_current_one(environments):
    current = environments["random-1"].replace(max_steps_in_episode=1)
    first = current.replace(reward_state="episode_start")
    np.testing.assert_allclose(exact.expected_reward(first), exact.expected_reward(current), rtol=1e-5, atol=1e-5)


def cost_of(function, params):
    """Floating-point operations of a function of the environment and a policy."""
    policy = jnp.full((params.num_states, params.num_actions), 1 / params.num_actions)
    return jax.jit(function).lower(params, policy).cost_analysis()["flops"]


def test_the_cost_of_a_policy_grows_with_states_times_levels_not_with_the_square_of_states(target):
    def with_levels(count):
        factor = Factor(prior=np.full(count, 1 / count), event_probability=np.zeros(count))
        return target.replace(road=factor, weather=factor, speed=factor, nearby=factor)

    few, many = (cost_of(exact.evaluate_policy, with_levels(count)) for count in (4, 8))
    assert many <= 2**4 * 2 * few  # the square would be 2**8 times as much


def test_what_is_no_number_stays_none(environments):
    params = environments["random-1"].replace(reward_state="episode_start")
    table = jnp.zeros((params.num_states, 2)).at[3, 1].set(jnp.nan)
    seen = np.asarray(exact.as_observed(params, table))
    assert (seen[:, 0] == 0).all()
    assert np.isnan(seen[:, 1]).all()  # the state 3 may have been the first of any
    np.testing.assert_array_equal(exact.as_observed(params.replace(reward_state="current"), table), table)
