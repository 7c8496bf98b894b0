"""Rows of packed words: they take as little room as the ids fit, and give back what was put in."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jrcjax.replay import packing, prioritised, uniform
from jrcjax.replay.n_step import NStepTransition

PAPER = (2**5, 4)  # states and actions of the paper's problem
FLOATS = {"reward", "n_return", "n_discount"}
SIZES = [1, 2, 3, 32, 1000, 2**15, 10**6, 2**31 - 1]
LAYOUTS = {
    "uniform": uniform.layout,
    "prioritised": lambda states, actions: prioritised.layout(states, actions, 4, 2).rows,
}
# A few fields of either sort in any order; layouts know no more of a NamedTuple than that.
ANY_SIZES = st.lists(st.one_of(st.none(), st.sampled_from(SIZES), st.integers(1, 2**31 - 1)), min_size=1, max_size=8)


def fields_of(*values) -> tuple:
    """Stands for a NamedTuple of any length."""
    return values


def assert_fields_lie_apart(where: packing.Layout, sizes) -> None:
    """Every id has room for its largest value, every number a word of its own, no bit is used twice."""
    taken = [0] * where.words
    for (word, shift, bits), size in zip(where.fields, sizes, strict=True):
        if size is None:
            assert (shift, bits) == (0, 0)
            mask = 2**32 - 1
        else:
            assert size - 1 < 2**bits
            mask = (2**bits - 1) << shift
        assert mask < 2**32
        assert not taken[word] & mask
        taken[word] |= mask


@pytest.mark.parametrize(
    ("states", "actions", "words"),
    [(*PAPER, 2), (1, 1, 2), (2**14, 4, 2), (2**15, 4, 3), (2**16, 2**15, 3), (2**31 - 1, 4, 4)],
)
def test_transitions_take_as_few_words_as_the_ids_fit(states, actions, words):
    where = uniform.layout(states, actions)
    assert where.kind is uniform.Transition
    assert where.words == words
    assert uniform.init(3, where).shape == (3, words)
    assert_fields_lie_apart(where, (states, actions, None, states, 2))


@pytest.mark.parametrize(
    ("states", "actions", "words"),
    [(*PAPER, 4), (1, 1, 4), (2**9, 8, 4), (2**10, 4, 5), (2**14, 4, 5), (2**31 - 1, 4, 7)],
)
def test_n_step_transitions_take_as_few_words_as_the_ids_fit(states, actions, words):
    where = prioritised.layout(states, actions, 4, 2).rows
    assert where.kind is NStepTransition
    assert [bits == 0 for _, _, bits in where.fields] == [name in FLOATS for name in NStepTransition._fields]
    assert where.words == words
    assert_fields_lie_apart(where, (states, actions, None, states, 2, None, None, states))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(sizes=ANY_SIZES)
def test_fields_lie_apart(sizes):
    assert_fields_lie_apart(packing.layout(fields_of, tuple(sizes)), sizes)


def some_ids(size: int):
    return st.one_of(st.integers(0, size - 1), st.just(size - 1))  # the largest id has all bits in use


def some_fields(data, kind, states: int, actions: int):
    ids = {"action": some_ids(actions), "terminal": st.integers(0, 1)}
    numbers = st.floats(width=32, allow_nan=False)
    return kind(*(data.draw(numbers if f in FLOATS else ids.get(f, some_ids(states))) for f in kind._fields))


@pytest.mark.parametrize("name", LAYOUTS)
@settings(max_examples=80, deadline=None, derandomize=True)
@given(st.data(), st.sampled_from(SIZES), st.integers(1, 70_000))
def test_pack_and_unpack_are_inverse(name, data, states, actions):
    where = LAYOUTS[name](states, actions)
    value = some_fields(data, where.kind, states, actions)
    row = packing.pack(value, where)
    assert row.shape == (where.words,)
    assert row.dtype == jnp.uint32
    back = packing.unpack(row, where)
    assert isinstance(back, where.kind)
    for field, name_of_field in zip(back, back._fields, strict=True):
        assert field.dtype == (jnp.float32 if name_of_field in FLOATS else jnp.int32)
    assert tuple(np.asarray(field).item() for field in back) == value


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("shape", [(7,), (2, 3), (0,)])
def test_rows_of_many(name, shape):
    where = LAYOUTS[name](32, 4)
    rng = np.random.default_rng(0)
    number = lambda: rng.normal(size=shape).astype(np.float32)  # noqa: E731
    value = where.kind(*(number() if f in FLOATS else rng.integers(0, 2, shape) for f in where.kind._fields))
    rows = packing.pack(value, where)
    assert rows.shape == (*shape, where.words)
    for got, wanted in zip(packing.unpack(rows, where), value, strict=True):
        np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize("bits", [0, 1, 0x7F800000, 0xFF800000, 0x7FC00001, 0x80000000])
def test_numbers_keep_their_bits(bits):
    where = uniform.layout(32, 4)
    number = np.uint32(bits).view(np.float32)  # subnormal, infinite, NaN with a payload, -0
    back = packing.unpack(packing.pack(uniform.Transition(31, 3, number, 31, 1), where), where)
    assert np.asarray(back.reward).view(np.uint32) == bits
