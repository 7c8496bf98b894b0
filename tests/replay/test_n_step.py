"""n-step returns against equation (28) as a sum, and the demonstrations of a source agent."""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy_model import Model
from significance import ALPHA, chi_square, z

from jrcjax.learners.hparams import Config, HParams
from jrcjax.replay import n_step
from jrcjax.replay.n_step import NStepTransition
from jrcjax.replay.uniform import Transition
from jrcjax.training.source import demonstrate

SLOTS = 48
RTOL = 1e-5  # at most 12 products and sums, of at most 12 factors


class Wanted(NamedTuple):
    """The fields that n-step returns add, and the scale of the rounding in the return."""

    n_return: np.ndarray
    n_discount: np.ndarray
    n_state: np.ndarray
    scale: np.ndarray


def closed_form(transitions: Transition, ends: np.ndarray, n: int, gamma: float) -> Wanted:
    """Equation (28) slot by slot; `ends` [T] is the slot after which each slot's episode, or the data, is over."""
    rows = []
    for t, end in enumerate(ends):
        window = range(t, min(t + n, end))
        terms = [gamma**k * float(transitions.reward[i]) for k, i in enumerate(window)]
        ended = any(transitions.discount[i] == 0 for i in window)
        discount = 0.0 if ended else gamma ** len(window)
        rows.append((sum(terms), discount, int(transitions.next_state[window[-1]]), sum(map(abs, terms))))
    return Wanted(*map(np.array, zip(*rows, strict=True)))


def assert_is(got: NStepTransition, transitions: Transition, wanted: Wanted) -> None:
    for name in Transition._fields:
        np.testing.assert_array_equal(getattr(got, name), getattr(transitions, name))
    assert (np.abs(got.n_return - wanted.n_return) <= RTOL * wanted.scale).all()
    np.testing.assert_allclose(got.n_discount, wanted.n_discount, rtol=RTOL)
    np.testing.assert_array_equal(got.n_state, wanted.n_state)


def part(tree, rows):
    return jax.tree.map(lambda field: field[rows], tree)


@partial(jax.jit, static_argnums=0)
def windows(n: int, transitions: Transition, positions) -> NStepTransition:
    """The windows after each slot, [T, n]."""

    def one(window, xs):
        window = n_step.push(window, *xs)
        return window, window

    return jax.lax.scan(one, n_step.init(n), (transitions, positions))[1]


def some_episodes(rng: np.random.Generator, lengths, gamma: float) -> tuple[Transition, np.ndarray, np.ndarray]:
    """SLOTS slots in episodes of these lengths, some of which end for good; positions, and the ends of episodes."""
    stops = np.minimum(np.cumsum(lengths), SLOTS)
    starts = np.append(0, stops[:-1])
    positions, ends, terminal = (np.zeros(SLOTS, np.int32) for _ in range(3))
    for start, stop, whole in zip(starts, stops, np.cumsum(lengths) <= SLOTS, strict=True):
        positions[start:stop] = np.arange(stop - start)
        ends[start:stop] = stop
        if stop > start:
            terminal[stop - 1] = whole and rng.random() < 0.5
    ids = lambda high: rng.integers(0, high, SLOTS).astype(np.int32)  # noqa: E731
    # States and rewards never repeat, so that none can be taken for another.
    rewards = (rng.permutation(SLOTS) * 3.7 - 50.0).astype(np.float32)
    next_states = rng.permutation(SLOTS).astype(np.int32) + 1000
    discounts = np.where(terminal == 1, 0, gamma).astype(np.float32)
    return Transition(ids(32), ids(4), rewards, next_states, discounts), positions, ends


EPISODES = st.lists(st.integers(1, 20), min_size=SLOTS, max_size=SLOTS)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(1, 12), EPISODES, st.sampled_from([0.0, 0.3, 0.9, 0.99]), st.integers(0, 2**32 - 1))
def test_returns_against_the_sum(n, lengths, gamma, seed):
    transitions, positions, ends = some_episodes(np.random.default_rng(seed), lengths, gamma)
    seen = jax.device_get(windows(n, transitions, positions))
    assert seen.state.shape == (SLOTS, n)
    # From the n-th slot on the first row is complete.
    wanted = closed_form(transitions, ends, n, gamma)
    complete = part(seen, (slice(n - 1, None), 0))
    assert_is(complete, part(transitions, slice(SLOTS - n + 1)), part(wanted, slice(SLOTS - n + 1)))
    # The others hold what has come so far, which is what remains of them at the end of the data.
    for now in (n, SLOTS // 2, SLOTS):
        held = slice(now - n, now)
        cut = closed_form(part(transitions, slice(now)), np.minimum(ends[:now], now), n, gamma)
        assert_is(part(seen, now - 1), part(transitions, held), part(cut, held))


def one_episode(rewards, gamma: float, terminal=()) -> tuple[Transition, np.ndarray]:
    slots = np.arange(len(rewards), dtype=np.int32)
    discounts = np.where(np.isin(slots, terminal), 0, gamma).astype(np.float32)
    return Transition(slots, slots % 4, np.float32(rewards), slots + 1, discounts), slots


def test_return_by_hand():
    seen = windows(3, *one_episode([1.0, 10.0, 100.0, 1000.0], 0.5))
    first = part(seen, (slice(2, None), 0))
    assert first.n_return.tolist() == [1.0 + 5.0 + 25.0, 10.0 + 50.0 + 250.0]
    assert first.n_discount.tolist() == [0.125, 0.125]
    assert first.n_state.tolist() == [3, 4]


def test_end_for_good_by_hand():
    # The episode ends for good after its third slot, the next one begins.
    transitions, slots = one_episode([1.0, 10.0, 100.0, 7.0, 7.0], 0.5, terminal=[2])
    first = part(windows(3, transitions, slots % 3), (slice(2, None), 0))
    assert first.n_return.tolist() == [31.0, 60.0, 100.0]
    assert first.n_discount.tolist() == [0.0, 0.0, 0.0]
    assert first.n_state.tolist() == [3, 3, 3]


def test_time_limit_by_hand():
    transitions, slots = one_episode([1.0, 10.0, 100.0, 7.0, 7.0], 0.5)
    first = part(windows(3, transitions, slots % 3), (slice(2, None), 0))
    assert first.n_return.tolist() == [31.0, 60.0, 100.0]
    assert first.n_discount.tolist() == [0.125, 0.25, 0.5]
    assert first.n_state.tolist() == [3, 3, 3]


def test_one_step_is_the_transition_itself():
    transitions, slots = one_episode([1.0, 10.0, 100.0], 0.9, terminal=[2])
    seen = part(windows(1, transitions, slots), (slice(None), 0))
    np.testing.assert_array_equal(seen.n_return, transitions.reward)
    np.testing.assert_array_equal(seen.n_discount, np.float32([0.9, 0.9, 0.0]))
    np.testing.assert_array_equal(seen.n_state, transitions.next_state)


LENGTH = 20
DEMONSTRATE = jax.jit(demonstrate, static_argnums=4)


def greedy(params, seed: int = 0) -> tuple[np.ndarray, jax.Array]:
    """Some action for each state, and the policy that takes it."""
    actions = np.random.default_rng(seed).integers(0, params.num_actions, params.num_states)
    return actions, jax.nn.one_hot(actions, params.num_actions)


def demonstrated(params, count: int, n: int, **hparams) -> NStepTransition:
    numbers = {name: jnp.float32(value) for name, value in hparams.items()}
    config = Config(demonstrations=count, n_step=n)
    return jax.device_get(DEMONSTRATE(jax.random.key(count), greedy(params)[1], params, HParams(**numbers), config))


@pytest.fixture(scope="module", params=[0, 1], ids=["truncated", "terminal"])
def params(environments, request):
    """Random numbers, levels that persist, and episodes of LENGTH slots."""
    limit = jnp.int32(request.param)
    return replace(environments["random-1"], max_steps_in_episode=LENGTH, terminal_time_limit=limit)


@pytest.mark.parametrize(("count", "n"), [
    (100, 10), (60, 1),  # whole episodes
    (97, 10), (13, 4),  # the last episode is cut
    (10, 10), (3, 10), (1, 10),  # as many as a return has rewards, and fewer
    (50, 25),  # returns longer than an episode
])  # fmt: skip
def test_demonstrations_follow_each_other(params, count, n):
    seen = demonstrated(params, count, n, discount=0.9)
    for name, field in seen._asdict().items():
        assert field.shape == (count,)
        is_number = name in ("reward", "discount", "n_return", "n_discount")
        assert field.dtype == (np.float32 if is_number else np.int32)
    slots = np.arange(count)
    last = slots % LENGTH == LENGTH - 1
    goes_on = ~last[:-1]
    np.testing.assert_array_equal(seen.next_state[:-1][goes_on], seen.state[1:][goes_on])
    ended = last & (int(params.terminal_time_limit) == 1)
    np.testing.assert_array_equal(seen.discount, np.where(ended, 0, np.float32(0.9)))
    ends = np.minimum((slots // LENGTH + 1) * LENGTH, count)
    transitions = Transition(*seen[:5])
    assert_is(seen, transitions, closed_form(transitions, ends, n, 0.9))


@pytest.mark.parametrize("reading", ["current", "episode_start"])
def test_demonstrations_obey_the_environment_and_the_policy(params, reading):
    params = replace(params, reward_state=jnp.int32(["current", "episode_start"].index(reading)))
    count, epsilon = 20_000, 0.01
    seen = demonstrated(params, count, 10)
    model = Model(params)
    assert np.isin(seen.action, range(model.num_actions)).all()

    # A random action is drawn from all, so the policy's own are among them.
    strays = (seen.action != greedy(params)[0][seen.state]).sum()
    p = epsilon * (1 - 1 / model.num_actions)
    assert z((strays - count * p) / np.sqrt(count * p * (1 - p))) > ALPHA

    # The state that a slot's reward belongs to.
    slots = np.arange(count)
    deciding = seen.state[slots if reading == "current" else slots // LENGTH * LENGTH]

    # Every reward is one of those that equation (11) allows, and their mean is right.
    possible = np.full((len(model.states), model.num_actions, 2 + model.miss_bank.shape[1]), np.nan)
    for s, a in np.ndindex(possible.shape[:2]):
        misses = [1.0] if model.is_data[a] else model.miss_bank[a - model.num_rates]
        rewards = [model.reward(model.is_data[a], True, model.packets[s, a], miss) for miss in misses]
        possible[s, a, : len(rewards)] = rewards
        possible[s, a, -1] = model.reward(model.is_data[a], False, model.packets[s, a], 1.0)
    distance = np.abs(possible[deciding, seen.action] - seen.reward[:, None])
    assert (np.nanmin(distance, axis=1) <= 1e-5 * np.abs(model.weights).max()).all()
    excess = (seen.reward - model.expected_reward()[deciding, seen.action]).sum()
    assert z(excess / np.sqrt(model.reward_variance()[deciding, seen.action].sum())) > ALPHA

    # States within episodes follow equation (10); episodes begin with the prior, wherever the last one ended.
    counts = np.zeros((len(model.states), len(model.states)))
    np.add.at(counts, (seen.state, seen.next_state), 1)
    assert chi_square(counts, model.transition()) > ALPHA
    first = np.bincount(seen.state[::LENGTH], minlength=len(model.states))
    prior = np.array([np.prod([tau[j] for tau, j in zip(model.priors, s, strict=True)]) for s in model.states])
    assert chi_square(first, prior) > ALPHA
    same = (prior**2).sum()
    stays = seen.state[LENGTH::LENGTH] == seen.next_state[LENGTH - 1 : -1 : LENGTH]
    assert z((stays.sum() - len(stays) * same) / np.sqrt(len(stays) * same * (1 - same))) > ALPHA
    # The first state and the first slot do not share random numbers.
    stays = seen.state[::LENGTH] == seen.next_state[::LENGTH]
    p = np.diag(model.transition())[seen.state[::LENGTH]]
    assert z((stays - p).sum() / np.sqrt((p * (1 - p)).sum())) > ALPHA


@pytest.mark.parametrize("epsilon", [0.0, 1.0])
def test_exploration_of_demonstrations(params, epsilon):
    seen = demonstrated(params, 20_000, 10, demonstration_epsilon=epsilon)
    if epsilon == 0.0:
        np.testing.assert_array_equal(seen.action, greedy(params)[0][seen.state])
    else:
        counts = np.bincount(seen.action, minlength=params.num_actions)
        assert chi_square(counts, np.full(params.num_actions, 1 / params.num_actions)) > ALPHA
