"""The trade-off between throughput and miss detection, against all policies of a small model and a linear program."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog
from tiny import tiny_params

from jrcjax import exact, front
from jrcjax.readings import MissConvention

EPS = np.finfo(np.float32).eps
ATOL = float(100 * EPS)  # sums of some ten numbers up to 4


def eight_states(convention, count_event_packets):
    """Two levels of channel, road and speed, one of weather and of nearby vehicles; two rates and two radar modes."""
    params = tiny_params()
    channel, speed = params.channel, params.speed
    return params.replace(
        channel=channel.replace(
            prior=jnp.array([0.7, 0.3]),
            interference=channel.interference[:2],
            sinr_threshold=jnp.array([5.0, 20.0]),
            packets=jnp.array([2.0, 4.0]),
        ),
        speed=speed.replace(prior=jnp.array([0.6, 0.4]), event_probability=jnp.array([0.02, 0.3])),
        nearby=params.weather,
        miss_convention=jnp.int32(convention),
        count_event_packets=jnp.int32(count_event_packets),
    )


@pytest.fixture(scope="module")
def all_policies():
    """[4^8, 8, 4]."""
    actions = np.array(list(itertools.product(range(4), repeat=8)))
    return exact.policy_of_actions(jnp.asarray(actions), 4)


evaluate_all = jax.jit(jax.vmap(exact.evaluate_policy, in_axes=(None, 0)))


@pytest.mark.parametrize(("convention", "count_event_packets"), [(0, 1), (1, 0)])
def test_against_all_deterministic_policies(all_policies, convention, count_event_packets):
    params = eight_states(convention, count_event_packets)
    assert (params.num_states, params.num_actions) == (8, 4)
    runs = evaluate_all(params, all_policies)
    points = np.stack([runs.throughput, runs.miss_detection], axis=1).astype(np.float64)
    lower, upper = front.reachable(params)
    # No policy lies outside, and every corner is a policy: the set is the convex hull of all policies' points.
    assert (points[:, 1] >= np.interp(points[:, 0], *lower) - ATOL).all()
    assert (points[:, 1] <= np.interp(points[:, 0], *upper) + ATOL).all()
    for corner in np.concatenate([np.stack(lower, axis=1), np.stack(upper, axis=1)]):
        assert np.abs(points - corner).max(axis=1).min() < ATOL
    best = front.front(params)
    assert points[:, 1].min() == pytest.approx(float(best.miss_detection[0]), abs=ATOL)
    assert points[:, 0].max() == pytest.approx(float(best.throughput[-1]), abs=ATOL)
    assert (np.diff(best.throughput) >= 0).all()
    assert (np.diff(best.miss_detection) >= 0).all()


@pytest.mark.parametrize("name", ["paper-target", "random-1"])
@pytest.mark.parametrize("convention", [0, 1])
def test_between_corners_against_a_linear_program(environments, name, convention):
    """Average reward as a linear program: the share of slots x(s, a) in each state and action."""
    params = environments[name].replace(miss_convention=jnp.int32(convention))
    visits = np.asarray(exact.stationary_distribution(params), np.float64)
    gain, cost = (np.asarray(x, np.float64).ravel() for x in front.contributions(params))
    rows = np.kron(np.eye(params.num_states), np.ones(params.num_actions))  # in each state the shares sum to 1
    corners = front.front(params)
    least, most = float(corners.throughput[0]), float(corners.throughput[-1])
    wanted_throughputs = np.linspace(least, most, 7)[:-1]
    found = front.lowest_miss_detection(params, wanted_throughputs)
    for wanted, lowest in zip(wanted_throughputs, found, strict=True):
        solved = linprog(cost, A_ub=-gain[None], b_ub=[-wanted], A_eq=rows, b_eq=np.ones(len(visits)))
        assert float(lowest) == pytest.approx(solved.fun, abs=ATOL)
    assert np.isnan(front.lowest_miss_detection(params, most + 0.01))


def test_the_largest_throughput_is_reached_whatever_rounding_does(target):
    """The policy that sends the most is on the front; its throughput is another sum of the same numbers."""

    def above(tau):
        params = target.replace(channel=target.channel.replace(prior=jnp.stack([tau, 1.0 - tau])))
        packets = exact.packet_table(params)
        run = exact.evaluate_policy(params, exact.policy_of_actions(packets.argmax(axis=1), packets.shape[1]))
        return run.miss_detection - front.lowest_miss_detection(params, run.throughput)

    np.testing.assert_allclose(jax.jit(jax.vmap(above))(jnp.linspace(0.05, 0.95, 19)), 0.0, atol=ATOL)


def test_a_corner_is_what_its_policy_does(target):
    corners = np.stack(front.front(target), axis=1)
    for price in (0.0, 0.05, 0.2, 10.0):
        run = exact.evaluate_policy(target, front.policy_at(target, price))
        distance = np.abs(corners - [float(run.throughput), float(run.miss_detection)]).max(axis=1)
        assert distance.min() < ATOL


def test_the_optimum_of_the_reward_is_within_the_set_and_round_robin_far_from_the_front(target):
    best = exact.evaluate_policy(target, exact.optimal_policy(target))
    even = exact.evaluate_policy(target, jnp.full((32, 4), 0.25))
    above = [float(run.miss_detection - front.lowest_miss_detection(target, run.throughput)) for run in (best, even)]
    assert above[0] >= -ATOL
    assert above[1] > 0.1


def test_over_an_axis_of_environments(target):
    def at_density(density):
        return front.front(target.replace(radar=target.radar.replace(density=density)))

    fronts = jax.jit(jax.vmap(at_density))(jnp.array([8.0, 24.0, 40.0]))
    assert fronts.throughput.shape == (3, 32 * 3 + 1)
    assert (np.diff(fronts.miss_detection[:, 0]) > 0.01).all()  # more objects, more misses
    np.testing.assert_allclose(fronts.throughput[:, -1], fronts.throughput[0, -1], rtol=EPS * 10)


def test_a_convention_without_a_trade_off(target):
    params = target.replace(miss_convention=MissConvention.RADAR_SLOTS)
    assert np.isnan(front.front(params).miss_detection).all()


def test_a_negative_price_is_refused(target):
    with pytest.raises(ValueError, match=r"price: -1.0; allowed: a number >= 0"):
        front.policy_at(target, -1.0)


def test_there_is_no_policy_on_a_front_that_does_not_exist(target):
    with pytest.raises(ValueError, match=r"^miss_convention: 'radar_slots'; allowed: all_slots, event_slots"):
        front.policy_at(target.replace(miss_convention="radar_slots"), 0.1)
    at = jax.vmap(lambda convention: front.policy_at(target.replace(miss_convention=convention), 0.1))
    policies = np.asarray(at(jnp.arange(3)))
    np.testing.assert_array_equal(policies[0], front.policy_at(target, 0.1))
    assert np.isfinite(policies[1]).all()
    assert np.isnan(policies[2]).all()
