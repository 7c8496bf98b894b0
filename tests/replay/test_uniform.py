import functools
from collections import Counter, deque

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from jrcjax.replay import uniform
from jrcjax.replay.uniform import Transition

STATES, ACTIONS = 32, 4
GAMMA = 0.75
LAYOUT = uniform.layout_of(STATES, ACTIONS)
ADD = jax.jit(uniform.add, static_argnums=3)


@functools.partial(jax.jit, static_argnums=3)
def sample(ring, words, count, layout):
    return uniform.at(ring, uniform.draw(words, count, ring.shape[0]), layout, GAMMA)


TRANSITIONS = st.tuples(
    st.integers(0, STATES - 1),
    st.integers(0, ACTIONS - 1),
    st.floats(-100, 100, width=32),
    st.integers(0, STATES - 1),
    st.sampled_from([0.0, GAMMA]),
)


def as_tuples(batch: Transition) -> list[tuple]:
    return list(zip(*(np.asarray(field).tolist() for field in batch), strict=True))


def numbered(i: int) -> tuple:
    """A transition that tells its number by its reward, which is never 0 as in a slot that was not written."""
    return i % STATES, i % ACTIONS, float(i + 1), (i + 1) % STATES, GAMMA * (i % 2)


def filled_ring(capacity: int, count: int) -> jax.Array:
    ring = uniform.init(capacity, LAYOUT)
    for i in range(count):
        ring = ADD(ring, Transition(*numbered(i)), i, LAYOUT)
    return ring


def first_word_of_each_index(n: int) -> jax.Array:
    return jnp.asarray([-(-i * 2**32 // n) for i in range(n)], jnp.uint32)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(capacity=st.integers(1, 6), transitions=st.lists(TRANSITIONS, min_size=1, max_size=20))
def test_ring_against_a_list_of_the_latest(capacity, transitions):
    ring, twin = uniform.init(capacity, LAYOUT), deque(maxlen=capacity)
    for count, transition in enumerate(transitions):
        ring = ADD(ring, Transition(*transition), count, LAYOUT)
        twin.append(transition)
        # These words pick each filled slot once, so the sample is all that the ring holds.
        held = sample(ring, first_word_of_each_index(len(twin)), count + 1, LAYOUT)
        assert Counter(as_tuples(held)) == Counter(twin)


@pytest.mark.parametrize(("capacity", "count"), [(64, 40), (64, 64), (64, 150)])
def test_samples_are_uniform_over_what_is_held(capacity, count):
    words = jax.random.bits(jax.random.key(count), (40_000,), jnp.uint32)
    rewards = np.asarray(sample(filled_ring(capacity, count), words, count, LAYOUT).reward).astype(int)
    held = np.arange(max(count - capacity, 0), count) + 1
    frequencies = np.array([(rewards == reward).sum() for reward in held])
    assert frequencies.sum() == len(rewards)
    assert stats.chisquare(frequencies).pvalue > 1e-3


@pytest.mark.parametrize("count", [1, 2, 31, 63])
def test_slots_not_yet_written_are_never_sampled(count):
    random = jax.random.bits(jax.random.key(1), (5000,), jnp.uint32)
    words = jnp.concatenate([jnp.asarray([0, 2**32 - 1], jnp.uint32), random])
    batch = sample(filled_ring(64, count), words, count, LAYOUT)
    assert set(as_tuples(batch)) <= {numbered(i) for i in range(count)}


def test_sampling_is_with_replacement():
    batch = sample(filled_ring(4, 4), jnp.zeros(8, jnp.uint32), 4, LAYOUT)
    assert as_tuples(batch) == [numbered(0)] * 8
