"""Prioritised replay beside lists and dictionaries, equations (23) and (24), and beside flashbax's buffer."""

from collections import deque
from functools import partial

import flashbax as fbx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from significance import ALPHA, chi_square, same_law

from jrcjax.replay import prioritised as replay_of
from jrcjax.replay import sum_tree
from jrcjax.replay.n_step import NStepTransition

STATES, ACTIONS = 32, 4
GAMMA, N = 0.75, 10
# A power, a logarithm and a sum of some hundred numbers >= 0, in float32.
RTOL = 3e-6

INIT = jax.jit(replay_of.init, static_argnums=1)
ADD = jax.jit(partial(replay_of.add, discount=jnp.float32(GAMMA)), static_argnums=3)
SAMPLE = jax.jit(partial(replay_of.sample, discount=jnp.float32(GAMMA)), static_argnums=2)
SET = jax.jit(replay_of.set_priorities, static_argnums=4)
WEIGHTS = jax.jit(replay_of.importance_weights)


def numbered(i, xp=np) -> NStepTransition:
    """Transitions that tell their number by their reward, which is never 0 as in a row that was not written."""
    ids, number = (xp.asarray(i) * 7919 % 2**20).astype(xp.int32), xp.asarray(i).astype(xp.float32)
    goes_on = (ids % 2).astype(xp.float32)
    return NStepTransition(
        ids % STATES,
        ids % ACTIONS,
        number + 1,
        ids // 3 % STATES,
        goes_on * xp.float32(GAMMA),
        -number,
        goes_on * xp.float32(GAMMA) ** (1 + ids // 2 % N),
        ids // 5 % STATES,
    )


def number_of(transitions: NStepTransition) -> np.ndarray:
    """Numbers of transitions; all other fields must belong to the number, too."""
    numbers = np.asarray(transitions.reward).astype(int) - 1
    for got, wanted in zip(transitions, numbered(numbers), strict=True):
        np.testing.assert_array_equal(got, wanted)
    return numbers


def words_of(key: int, count: int) -> jax.Array:
    return jax.random.bits(jax.random.key(key), (replay_of.NUM_WORDS, count), jnp.uint32)


@partial(jax.jit, static_argnums=1)
def everything(replay: replay_of.Replay, layout: replay_of.Layout):
    """All leaves and all rows as transitions."""
    return replay_of.contents(replay, layout, jnp.float32(GAMMA))


def held(replay: replay_of.Replay, layout: replay_of.Layout) -> dict[int, float]:
    """p^alpha by number of what can be sampled."""
    values, transitions = jax.device_get(everything(replay, layout))
    there = values > 0
    numbers = number_of(jax.tree.map(lambda field: field[there], transitions))
    assert len(set(numbers)) == len(numbers)
    return dict(zip(numbers.tolist(), values[there].tolist(), strict=True))


class Naive:
    """The replay as a list that stays, a queue that forgets, and a dictionary; numbers stand for transitions."""

    def __init__(self, demonstrations: int, capacity: int):
        self.demonstrations = list(range(demonstrations))
        self.new = deque(maxlen=capacity - demonstrations)
        self.scaled = dict.fromkeys(self.demonstrations, 1.0)
        self.largest = 1.0

    def add(self, number: int) -> None:
        self.new.append(number)
        self.scaled[number] = self.largest

    def set_priority(self, number: int, priority: float, alpha: float) -> None:
        self.scaled[number] = priority**alpha
        self.largest = max(self.largest, self.scaled[number])

    def held(self) -> dict[int, float]:
        return {number: self.scaled[number] for number in [*self.demonstrations, *self.new]}

    def probability(self, number: int) -> float:
        return self.scaled[number] / sum(self.held().values())


def assert_same(replay, layout, naive: Naive, count: int) -> None:
    got, wanted = held(replay, layout), naive.held()
    assert got.keys() == wanted.keys()
    numbers = sorted(wanted)
    np.testing.assert_allclose([got[n] for n in numbers], [wanted[n] for n in numbers], rtol=RTOL)
    np.testing.assert_allclose(float(replay.largest), naive.largest, rtol=RTOL)
    assert int(replay_of.size(jnp.int32(count), layout)) == len(wanted)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    st.sampled_from([(1, 2), (3, 4), (1, 8), (4, 9), (20, 37)]),
    st.sampled_from([0.0, 0.4, 1.0]),
    st.integers(1, 4),
    st.lists(st.tuples(st.booleans(), st.integers(0, 2**31 - 1)), max_size=40),
)
def test_replay_against_a_list_and_a_queue(sizes, alpha, late, operations):
    demonstrations, capacity = sizes
    layout, naive = replay_of.layout_of(STATES, ACTIONS, capacity, demonstrations, N), Naive(demonstrations, capacity)
    replay = INIT(numbered(np.arange(demonstrations)), layout)
    assert_same(replay, layout, naive, 0)
    added = 0
    for slot, (learns, seed) in enumerate(operations):
        # As in training, nothing is complete in the first slots, and what is written then means nothing.
        count = slot + 1 - late
        replay = ADD(replay, numbered(demonstrations + count if count >= 0 else 10**6), jnp.int32(count), layout)
        if count >= 0:
            naive.add(demonstrations + count)
            added = count + 1
        if learns:
            batch = SAMPLE(replay, words_of(seed, 4), layout)
            numbers = number_of(batch.transitions)
            assert batch.is_demonstration.tolist() == [n < demonstrations for n in numbers]
            np.testing.assert_allclose(batch.probability, [naive.probability(n) for n in numbers], rtol=RTOL)
            # Over six decades; what is sampled twice gets the same one.
            priorities = np.float32(10.0 ** ((numbers * 2654435761 + seed) % 7 - 3.0))
            replay = SET(replay, batch.indices, jnp.asarray(priorities), jnp.float32(alpha), layout)
            for number, priority in zip(numbers.tolist(), priorities.tolist(), strict=True):
                naive.set_priority(number, priority, alpha)
        assert_same(replay, layout, naive, added)


@partial(jax.jit, static_argnums=1)
def add_all(replay, layout, counts):
    def one(replay, count):
        return replay_of.add(replay, numbered(layout.demonstrations + count, jnp), count, layout, GAMMA), None

    return jax.lax.scan(one, replay, counts)[0]


@pytest.mark.parametrize("added", [12_345, 30_000, 75_000])
def test_the_papers_replay_keeps_the_demonstrations_and_the_newest_of_the_rest(added):
    demonstrations, capacity, late = 20_000, 50_000, 9
    layout = replay_of.layout_of(STATES, ACTIONS, capacity, demonstrations, N)
    counts = jnp.arange(-late, 75_000)
    # One length for all, so that one compiled program serves; the last ones are repeated.
    replay = add_all(INIT(numbered(np.arange(demonstrations)), layout), layout, jnp.minimum(counts, added - 1))
    newest = range(demonstrations + max(added - 30_000, 0), demonstrations + added)
    assert held(replay, layout) == dict.fromkeys([*range(demonstrations), *newest], 1.0)
    first = jax.tree.map(lambda field: field[:demonstrations], everything(replay, layout)[1])
    assert number_of(first).tolist() == list(range(demonstrations))
    assert float(sum_tree.total(replay.tree, layout.tree)) == demonstrations + len(newest)
    assert int(replay_of.size(jnp.int32(added), layout)) == demonstrations + len(newest)


def test_before_the_first_new_transition_only_demonstrations_are_sampled():
    layout = replay_of.layout_of(STATES, ACTIONS, 40, 16, N)  # the next leaf begins a node
    replay = INIT(numbered(np.arange(16)), layout)
    for count in range(-5, 0):
        replay = ADD(replay, numbered(10**6), jnp.int32(count), layout)
        assert float(sum_tree.total(replay.tree, layout.tree)) == 16.0
    edges = jnp.asarray([[0, 0, 2**32 - 1, 2**32 - 1], [0, 2**32 - 1, 0, 2**32 - 1]], jnp.uint32)
    batch = SAMPLE(replay, jnp.concatenate([edges, words_of(0, 5000)], axis=1), layout)
    assert set(number_of(batch.transitions)) == set(range(16))
    assert batch.is_demonstration.all()
    batch = SAMPLE(ADD(replay, numbered(16), jnp.int32(0), layout), words_of(0, 5000), layout)
    assert set(number_of(batch.transitions)) == set(range(17))


def test_new_transitions_get_the_largest_priority_so_far_even_after_it_is_gone():
    layout = replay_of.layout_of(STATES, ACTIONS, 6, 3, N)
    replay = INIT(numbered(np.arange(3)), layout)
    replay = SET(replay, jnp.asarray([1, 2]), jnp.asarray([16.0, 0.25]), jnp.float32(0.5), layout)
    replay = SET(replay, jnp.asarray([1]), jnp.asarray([4.0]), jnp.float32(0.5), layout)
    replay = ADD(replay, numbered(3), jnp.int32(0), layout)
    assert held(replay, layout) == pytest.approx({0: 1.0, 1: 2.0, 2: 0.5, 3: 4.0}, rel=RTOL)


def filled(priorities: np.ndarray, alpha: float, capacity: int, demonstrations: int):
    """A replay that holds transition i with priority i, and its layout."""
    layout = replay_of.layout_of(STATES, ACTIONS, capacity, demonstrations, N)
    replay = INIT(numbered(np.arange(demonstrations)), layout)
    for i in range(demonstrations, len(priorities)):
        replay = ADD(replay, numbered(i), jnp.int32(i - demonstrations), layout)
    indices = jnp.arange(len(priorities))
    return SET(replay, indices, jnp.asarray(priorities, jnp.float32), jnp.float32(alpha), layout), layout


def some_priorities(count: int, seed: int = 0) -> np.ndarray:
    return (10.0 ** np.random.default_rng(seed).uniform(-3, 3, count)).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("alpha", [0.0, 0.4, 1.0])
def test_equation_23(alpha):
    priorities = some_priorities(70)
    replay, layout = filled(priorities, alpha, 100, 30)
    wanted = priorities**alpha / (priorities**alpha).sum()
    batch = SAMPLE(replay, words_of(5, 200_000), layout)
    numbers = number_of(batch.transitions)
    np.testing.assert_allclose(batch.probability, wanted[numbers], rtol=RTOL)
    assert (batch.is_demonstration == (numbers < 30)).all()
    assert chi_square(np.bincount(numbers, minlength=70), wanted) > ALPHA
    if alpha == 0.0:
        np.testing.assert_allclose(batch.probability, 1 / 70, rtol=RTOL)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(1, 50_000), st.floats(0, 1, width=32), st.integers(0, 2**32 - 1))
def test_equation_24(size, beta, seed):
    probability = np.float32(np.random.default_rng(seed).dirichlet(np.full(8, 0.5)) * 8 / size).clip(1e-9, 1.0)
    weights = (1.0 / (size * probability.astype(np.float64))) ** np.float64(beta)
    got = WEIGHTS(jnp.asarray(probability), jnp.int32(size), jnp.float32(beta))
    assert got.dtype == jnp.float32
    # Logarithms up to 40 with an error in proportion become relative errors.
    np.testing.assert_allclose(got, weights / weights.max(), rtol=2e-5)
    assert float(got.max()) == pytest.approx(1.0, rel=1e-6)


def test_importance_weights_at_the_ends_of_beta():
    probability = jnp.asarray([0.5, 0.25, 0.125, 0.0625])
    np.testing.assert_array_equal(WEIGHTS(probability, jnp.int32(1000), jnp.float32(0.0)), np.ones(4))
    full = WEIGHTS(probability, jnp.int32(1000), jnp.float32(1.0))
    np.testing.assert_allclose(full, [1 / 8, 1 / 4, 1 / 2, 1.0], rtol=RTOL)


def test_full_weights_undo_the_priorities():
    # With beta = 1 the weighted mean over samples estimates the plain mean over the replay.
    priorities = some_priorities(70) ** (1 / 3)  # from 0.1 to 10
    replay, layout = filled(priorities, 0.4, 100, 30)
    batch = SAMPLE(replay, words_of(6, 200_000), layout)
    size = replay_of.size(jnp.int32(40), layout)
    weights = np.asarray(WEIGHTS(batch.probability, size, jnp.float32(1.0)), np.float64)
    numbers = number_of(batch.transitions)
    shares = np.bincount(numbers, weights, minlength=70) / weights.sum()
    # The rarest is drawn 1000 times, so the standard error is 3 %.
    np.testing.assert_allclose(shares, 1 / 70, rtol=0.15)


@pytest.mark.parametrize("td_error", [-2.5, 0.0, 2.5])
def test_priority_of_a_td_error(td_error):
    both = jnp.asarray([False, True])
    got = replay_of.priority(jnp.full(2, td_error), both, jnp.float32(0.001), jnp.float32(1.0))
    np.testing.assert_allclose(got, [abs(td_error) + 0.001, abs(td_error) + 1.0], rtol=1e-6)


def test_priority_of_a_batch():
    td_error, is_demonstration = jnp.asarray([-1.0, 2.0, -3.0]), jnp.asarray([True, False, False])
    got = replay_of.priority(td_error, is_demonstration, jnp.float32(0.5), jnp.float32(0.75))
    assert got.tolist() == [1.75, 2.5, 3.5]
    smaller = replay_of.priority(td_error, is_demonstration, jnp.float32(0.5), jnp.float32(0.0))
    assert smaller.tolist() == [1.5, 2.5, 3.5]  # no demonstration has less than its own error and the constant


@pytest.mark.parametrize("alpha", [0.0, 0.4, 1.0])
def test_against_flashbax(alpha):
    capacity, count, draws = 100, 70, 50_000
    priorities = some_priorities(count, seed=1)
    replay, layout = filled(priorities, alpha, capacity, 30)
    ours = SAMPLE(replay, words_of(7, draws), layout)

    # One draw a call: in one call flashbax draws one from each of as many equal parts of the total.
    buffer = fbx.make_prioritised_item_buffer(capacity, 1, 1, add_sequences=True, priority_exponent=alpha)
    items = jax.tree.map(jnp.asarray, numbered(np.arange(count)))
    state = buffer.add(buffer.init(jax.tree.map(lambda x: x[0], items)), items)
    state = buffer.set_priorities(state, jnp.arange(count), jnp.asarray(priorities, jnp.float32))
    theirs = jax.jit(jax.vmap(buffer.sample, (None, 0)))(state, jax.random.split(jax.random.key(8), draws))

    probabilities, frequencies = [], []
    for transitions, probability in ((ours.transitions, ours.probability), (theirs.experience, theirs.probabilities)):
        numbers = number_of(jax.tree.map(jnp.ravel, transitions))
        probabilities.append(dict(zip(numbers.tolist(), probability.ravel().tolist(), strict=True)))
        frequencies.append(np.bincount(numbers, minlength=count))
    common = sorted(probabilities[0].keys() & probabilities[1].keys())
    assert len(common) > 0.5 * count
    np.testing.assert_allclose(*([p[i] for i in common] for p in probabilities), rtol=1e-6)
    assert same_law(*frequencies) > ALPHA
